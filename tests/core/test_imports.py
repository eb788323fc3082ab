"""Imports: the library loads what is slow when a call needs it, and no sooner."""

import pytest

from tests.support.fresh import told_by

pytestmark = [pytest.mark.slow, pytest.mark.jit]  # a process each

SLOW = {
    *("scipy.linalg", "scipy.sparse", "scipy.spatial", "igl", "trimesh", "manifold3d", "pyvista"),
    "numba.np.arrayobj",  # numba's compiled functions, which kernels from disk do without
}
MESH = "mesh = gc.samples.plane(8)\n"
EXACT = MESH + "assert gc.exact_distance(mesh, 0).path_to(8).length > 0.0"


def loaded_by(work: str) -> set[str]:
    """Return the slow modules that some work loads, once its kernels are on disk."""
    told = told_by(f"import sys\nimport geodesic_core as gc\n{work}\nprint(*sys.modules)")
    return SLOW & set(told.split())


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("work", ["", EXACT], ids=["import", "exact answer"])
def test_nothing_slow_is_loaded_for_an_exact_answer(work: str) -> None:
    told_by(f"import geodesic_core as gc\n{work}")
    assert loaded_by(work) == set()


@pytest.mark.jit
def test_the_nearest_point_of_a_position_loads_what_finds_it() -> None:
    assert "igl" in loaded_by(MESH + "mesh.locate([0.5, 0.5, 1.0])")
