"""Approximate distances and paths on real meshes, against the exact ones."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.approximation import ERRORS, ROUNDING, check_approximate_path, check_within
from tests.support.meshes import named_mesh

MADE_HERE = ["rough_scan", "thin_cad"]
SLICE = [
    *MADE_HERE,
    "turbine.ply",
    "buddha30k.ply",
    "fandisk10k.ply",
    "rockerarm20k.ply",
    "cow.obj",
]
REST = [
    *("dragon100k.ply", "horse97k.ply", "fandisk.obj", "armadillo86k.ply", "bunny.obj"),
    *("blade.ply", "spot.obj", "teapot.obj", "alligator.obj"),
]
CASES = [
    *(pytest.param(name, 3, id=name) for name in SLICE),
    *(pytest.param(name, 50, id=f"{name}-50", marks=pytest.mark.full) for name in SLICE + REST),
]


def fields(name, count, **options):
    """The exact field from each of some sources, and for each error the approximate one."""
    mesh = named_mesh(name)
    used = np.unique(mesh.faces)
    for source in np.random.default_rng(len(used)).choice(used, count, replace=False).tolist():
        exact = gc.exact_distance(mesh, source)
        for error in ERRORS:
            yield exact, error, gc.approximate_distance(mesh, source, error, **options)


@pytest.mark.jit
@pytest.mark.parametrize(("name", "count"), CASES)
def test_within_the_error_at_every_vertex(name, count):
    for exact, error, field in fields(name, count):
        check_within(field.distances, exact.distances, error)
        np.testing.assert_array_equal(field.nearest_source, exact.nearest_source)


@pytest.mark.jit
@pytest.mark.parametrize(
    ("name", "count"),
    [pytest.param(name, 1, id=name) for name in SLICE]
    + [pytest.param(name, 20, id=f"{name}-20", marks=pytest.mark.full) for name in SLICE + REST],
)
def test_paths_are_at_most_longer_by_the_error(name, count):
    longest = 0.0
    for exact, error, field in fields(name, count, retain="paths"):
        far = np.flatnonzero(np.isfinite(exact.distances) & (exact.distances > 0))
        for target in np.random.default_rng(1).choice(far, 15 if count == 1 else 50).tolist():
            check_approximate_path(field, target, exact.distances[target], error)
            longest = max(longest, field.path_to(target).error_bound.value)
        assert field.stats.peak_bytes <= 1.2 * field.mesh.nbytes
    assert longest > ROUNDING, "else nothing was merged"


@pytest.mark.jit
@pytest.mark.parametrize(
    "name", [*SLICE[:3], *(pytest.param(name, marks=pytest.mark.full) for name in REST)]
)
def test_absolute_errors_and_limits(name):
    mesh = named_mesh(name)
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    exact = gc.exact_distance(mesh, int(mesh.faces[0, 0])).distances
    for share in (1e-5, 1e-4, 1e-3):
        absolute = share * diagonal
        for relative in (None, 1e-3):
            field = gc.approximate_distance(mesh, int(mesh.faces[0, 0]), relative, absolute)
            check_within(field.distances, exact, relative or np.inf, absolute)
    limit = float(np.median(exact[np.isfinite(exact)]))
    near = gc.approximate_distance(mesh, int(mesh.faces[0, 0]), 1e-2, max_distance=limit).distances
    reached = np.isfinite(near)
    assert reached[exact <= limit * (1 - ROUNDING)].all()
    assert (near[reached] <= limit).all()
    check_within(near[reached], exact[reached], 1e-2)


@pytest.mark.jit
@pytest.mark.parametrize("error", [5e-5, 1e-4, 2e-4])
def test_a_window_within_a_nearer_one_goes_on(error):
    """It was sent to one side only, and up to 15 vertices came out too far."""
    mesh = named_mesh("dragon100k.ply")
    exact = gc.exact_distance(mesh, 15008).distances
    check_within(gc.approximate_distance(mesh, 15008, error).distances, exact, error)
