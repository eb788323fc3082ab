"""Imports: the library loads what is slow when a call needs it, and no sooner."""

import pytest

from tests.support.fresh import told_by

pytestmark = pytest.mark.slow  # a process each

SLOW = {"scipy", "igl", "trimesh", "manifold3d", "pyvista"}
MESH = "mesh = gc.samples.plane(8)\n"
EXACT = MESH + "assert gc.exact_distance(mesh, 0).path_to(8).length > 0.0"


def loaded_by(work: str) -> set[str]:
    """Return the slow packages of which some work loads more than numba does by itself.

    Numba loads SciPy's linear algebra with the first kernel, where SciPy is installed.
    """
    told = told_by(
        "import sys, numba\n"
        "numba.njit(lambda: 0)()\n"
        "before = set(sys.modules)\n"
        f"import geodesic_core as gc\n{work}\n"
        "print(*{name.partition('.')[0] for name in set(sys.modules) - before})"
    )
    return SLOW & set(told.split())


@pytest.mark.parametrize("work", ["", EXACT], ids=["import", "exact answer"])
def test_nothing_slow_is_loaded_for_an_exact_answer(work: str) -> None:
    assert loaded_by(work) == set()


def test_the_nearest_point_of_a_position_loads_what_finds_it() -> None:
    assert "igl" in loaded_by(MESH + "mesh.locate([0.5, 0.5, 1.0])")
