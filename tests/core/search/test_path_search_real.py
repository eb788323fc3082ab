"""Paths between two points on real meshes, against full sweeps."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.meshes import named_mesh
from tests.support.path_checks import LENGTH
from tests.support.searches import check_search, landmark_count

SLICE = [
    "rough_scan",
    "thin_cad",
    "turbine.ply",
    "buddha30k.ply",
    "fandisk10k.ply",
    "rockerarm20k.ply",
    "cow.obj",
]
SMALL = ["blade.ply", "spot.obj", "teapot.obj", "alligator.obj", "fandisk.obj"]
LARGE = ["dragon100k.ply", "horse97k.ply", "armadillo86k.ply", "bunny.obj"]
CASES = [
    *(pytest.param(name, 6, 40, id=name) for name in SLICE + SMALL),
    *(pytest.param(name, 2, 12, id=name) for name in LARGE),
    *(
        pytest.param(name, 30, 60, id=f"{name}-full", marks=pytest.mark.full)
        for name in SLICE + SMALL + LARGE
    ),
]


def ends(mesh, sources, targets, seed=5):
    """Sources, and for each of them connected targets: half of them anywhere, half of them near."""
    rng = np.random.default_rng(seed)
    for source in rng.choice(np.unique(mesh.faces), sources, replace=False).tolist():
        distances = gc.exact_distance(mesh, source).distances
        reached = np.flatnonzero(np.isfinite(distances))
        near = reached[np.argsort(distances[reached])][: max(len(reached) // 50, 2)]
        chosen = [*rng.choice(reached, targets // 2), *rng.choice(near, targets // 2)]
        yield source, [int(target) for target in chosen], distances


@pytest.mark.slow
@pytest.mark.slice(3)
@pytest.mark.jit
@pytest.mark.parametrize(("name", "sources", "targets"), CASES)
def test_equals_the_full_sweep_both_ways(name, sources, targets):
    solver = gc.Solver(named_mesh(name))
    for source, chosen, distances in ends(solver.mesh, sources, targets):
        lengths = [solver.shortest_path(source, target).length for target in chosen]
        np.testing.assert_allclose(lengths, distances[chosen], rtol=LENGTH, atol=0)
        back = [solver.shortest_path(target, source).length for target in chosen]
        np.testing.assert_allclose(back, distances[chosen], rtol=LENGTH, atol=0)
    assert landmark_count(solver) > 0


@pytest.mark.slice(2)
@pytest.mark.jit
@pytest.mark.parametrize("name", SLICE + SMALL)
def test_paths_lie_on_the_surface(name):
    """Of a solver that has been used, and of new ones."""
    mesh = named_mesh(name)
    solver = gc.Solver(mesh)
    for source, chosen, distances in ends(mesh, 2, 10):
        for target in chosen:
            check_search(
                mesh, solver.shortest_path(source, target), source, target, distances[target]
            )
        fresh = gc.shortest_path(mesh, source, chosen[0])
        check_search(mesh, fresh, source, chosen[0], distances[chosen[0]])
