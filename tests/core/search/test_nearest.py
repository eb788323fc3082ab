"""The geodesically nearest of some candidates."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.front.counters import WORK
from geodesic_core.kernels.front.rows import FIRST_PART
from geodesic_core.search import target_sweep
from tests.core.fields.test_points import SAME
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points


def test_equal_distances_go_by_the_lowest_index():
    """The octahedron's four neighbours of a corner, in any order; rounding does not count."""
    mesh = mesh_of(zoo.SMALL["octahedron"].moved(zoo.rotation(3), (0.1, 0.7, -0.3)))
    for candidates in ([1, 2, 3, 4, 5], [5, 4, 1, 3, 2, 0], [4, 4, 2, 4]):
        distances = [0.0 if c == 0 else math.sqrt(3) if c == 1 else 1.0 for c in candidates]
        expected = np.argsort(distances, kind="stable")
        for k in range(1, len(candidates) + 1):
            found = gc.nearest(mesh, 0, candidates, k)
            np.testing.assert_array_equal(found.indices, expected[:k])
            np.testing.assert_allclose(found.distances, np.array(distances)[expected[:k]], SAME)


def test_permuted_candidates_are_the_same_points():
    mesh = mesh_of(zoo.SMALL["hills"])
    points = random_points(mesh, 12, seed=33)
    order = np.random.default_rng(33).permutation(11)
    found = gc.nearest(mesh, points[0], points[1:], 5)
    mixed = gc.nearest(mesh, points[0], [points[1 + i] for i in order], 5)
    np.testing.assert_array_equal(order[mixed.indices], found.indices)
    np.testing.assert_allclose(mixed.distances, found.distances, SAME)


def test_what_cannot_be_reached_is_left_out():
    case = zoo.SMALL["two_components"]
    mesh = mesh_of(case)
    here, there = np.flatnonzero(mesh.components == 0), np.flatnonzero(mesh.components == 1)
    some = gc.nearest(mesh, int(here[0]), [int(there[0]), int(here[1]), int(there[1])], 3)
    assert some.indices.tolist() == [1]
    none = gc.nearest(mesh, int(here[0]), there.tolist())
    assert len(none.indices) == len(none.distances) == 0
    seen = []
    gc.nearest(mesh, int(here[0]), there.tolist(), progress=seen.append)
    assert seen[-1] == 1


@pytest.mark.slow
@pytest.mark.jit
def test_the_sweep_ends_at_the_last_of_the_nearest(monkeypatch):
    """It does hardly more work than one to the distance, which it could not know."""
    work = 0
    engine_of = target_sweep._engine

    def counting(*arguments):
        engine = engine_of(*arguments)

        def advance(topology, wave, bounds, budget):
            nonlocal work
            outcome = engine.advance(topology, wave, bounds, budget)
            work += int(wave.counters[WORK])
            return outcome

        return engine._replace(advance=advance)

    def nearest(*arguments, **options):
        nonlocal work
        work = 0
        return gc.nearest(*arguments, **options), work

    monkeypatch.setattr(target_sweep, "_engine", counting)
    mesh = gc.TriangleMesh(*zoo.icosphere(6))
    field = gc.exact_distance(mesh, 0)
    order = np.argsort(field.distances)
    candidates = order[np.linspace(1, len(order) - 1, 50).astype(int)].tolist()
    done = []
    for k in (1, 3, 10, 25, 50):
        found, own = nearest(mesh, 0, candidates, k)
        _, least = nearest(mesh, 0, candidates, k, max_distance=found.distances[-1])
        assert own <= 1.6 * least + 2 * FIRST_PART
        done.append(own)
    assert done[0] < 0.02 * done[-1]


BAD = [
    ({"candidates": []}, "InvalidArgument", "no candidates"),
    ({"candidates": 3.5}, "InvalidArgument", "candidates is 3.5"),
    ({"candidates": [1, -1]}, "InvalidPoint", "candidate 1 is vertex -1"),
    ({"candidates": [6]}, "InvalidPoint", "candidate 0 is vertex 6"),
    ({"source": 6}, "InvalidPoint", "source is vertex 6"),
    ({"source": [0]}, "InvalidPoint", "source is"),
    ({"k": 0}, "InvalidArgument", "k is 0; .* from 1 to the number of candidates, 3"),
    ({"k": 4}, "InvalidArgument", "k is 4"),
    ({"k": 1.0}, "InvalidArgument", "k is 1.0"),
    ({"k": True}, "InvalidArgument", "k is True"),
    ({"max_distance": -1.0}, "InvalidArgument", "max_distance is -1.0"),
]


@pytest.mark.parametrize(("changed", "error", "message"), BAD)
def test_bad_arguments_are_named(changed, error, message):
    mesh = mesh_of(zoo.SMALL["octahedron"])
    arguments = {"source": 0, "candidates": [1, 2, 3]} | changed
    for ask in (lambda **kwargs: gc.nearest(mesh, **kwargs), gc.Solver(mesh).nearest):
        with pytest.raises(getattr(gc.errors, error), match=message):
            ask(**arguments)
