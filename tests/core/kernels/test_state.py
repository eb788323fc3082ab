"""The wavefront of the sweep, checked after each single step."""

import math

import numpy as np
import pytest

from geodesic_core.kernels.front.counters import COUNTERS, WORK
from geodesic_core.kernels.outcome import Outcome
from tests.support import zoo
from tests.support.invariants import Watch, exact_by_euclid, exact_by_unfolding
from tests.support.stepping import finished, started, steps, topology_of, with_pool

# Of every kind, and small enough for the oracle when twice subdivided
CURVED = [
    "open_fan",
    "tetrahedron",
    "octahedron",
    "icosahedron",
    "cube",
    "bipyramid",
    "obtuse_pair",
    "bow_tie",
    "bow_tie_of_fans",
    "isolated_vertices",
    "two_components",
    "saddle_fan",
    "crumpled_octahedron",
    "crag",
    "little_torus",
]
PLANAR = ["single_triangle", "square", "strip", "flat_grid", "jittered_grid"]


def _crumpled(name, mesh, amplitude, seed):
    return zoo.Case(name, zoo.crumpled(mesh[0], amplitude, seed), mesh[1])


OWN = {
    "saddle_fan": zoo.Case("saddle_fan", *zoo.cone(8, 0.9, zigzag=True)[:2]),
    "crumpled_octahedron": _crumpled("crumpled_octahedron", zoo.octahedron(), 0.6, seed=5),
    "crag": _crumpled("crag", zoo.grid(3, 2, seed=4), 0.9, seed=4),
    "little_torus": _crumpled("little_torus", zoo.torus(3, 3), 0.5, seed=2),
}
CASES = zoo.SMALL | OWN


def watch(case, oracle, sources, starts, limit=math.inf):
    """Sweep step by step, checking everything."""
    topology = topology_of(case)
    wave = started(topology, sources, starts, limit)
    witness = Watch(topology, wave, oracle(case, topology, sources, starts), limit)
    for _, now in steps(topology, wave, limit):
        witness.step(now)
    witness.finish(now)


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(3)
@pytest.mark.parametrize("name", CURVED)
def test_every_step_on_curved_meshes(name):
    case = CASES[name]
    used = np.unique(case.faces)
    for source in used[:: max(1, len(used) // 5)]:
        watch(case, exact_by_unfolding, [source], [0.0])


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANAR)
@pytest.mark.jit
def test_every_step_on_the_plane(name):
    case = CASES[name]
    last = len(case.vertices) - 1
    for source in {0, last // 2, last}:
        watch(case, exact_by_euclid, [source], [0.0])


@pytest.mark.jit
@pytest.mark.parametrize("aspect", ["1e-03", "1e-04", "1e-05"])
def test_every_step_on_slivers(aspect):
    points, faces = zoo.grid(6, 6, seed=2, jitter=0.22)
    case = zoo.Case("slivers", points * (1, float(aspect), 1), faces)
    watch(case, exact_by_euclid, [8], [0.0])


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("name", ["icosahedron", "crag", "bow_tie", "saddle_fan"])
def test_every_step_from_several_sources(name):
    case = CASES[name]
    last = len(case.vertices) - 1
    watch(case, exact_by_unfolding, [0, last, last // 2], [0.3, 0.0, 0.1])


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0.0, 0.7, 1.5])
@pytest.mark.jit
def test_every_step_within_a_limit(limit):
    watch(CASES["icosahedron"], exact_by_unfolding, [0], [0.0], limit)
    watch(CASES["jittered_grid"], exact_by_euclid, [20], [0.0], 2 * limit)


def test_a_limit_does_not_hide_what_lies_behind_a_long_edge():
    """Both ends of the edge between them are too far; the two middle vertices are not."""
    points = np.array([(0, -0.1, 0), (10, 0, 0), (-10, 0, 0), (0, 0.1, 0)], dtype=float)
    case = zoo.Case("kite", points, np.array([(0, 1, 2), (3, 2, 1)]))
    watch(case, exact_by_euclid, [0], [0.0], 1.0)


def test_bisectors_of_two_branches_within_one_edge():
    """The wrong one of two roots made a vertex 5 % too far."""
    heights = [0, 0, 0, 0.09, 0.071, 0.09, 0.18, 0.177, 0.18, 0.27, 0.264, 0.27, 0.36, 0.36, 0.36]
    columns = [0, 1, 2, 0, 0.926, 2, 0, 0.858, 2, 0, 1.03, 2, 0, 1, 2]
    faces = [
        *[(0, 1, 4), (0, 4, 3), (1, 2, 4), (2, 5, 4), (3, 4, 7), (3, 7, 6), (4, 5, 7), (5, 8, 7)],
        *[(6, 7, 9), (7, 10, 9), (7, 8, 11), (7, 11, 10), (9, 10, 13), (9, 13, 12)],
        *[(10, 11, 14), (10, 14, 13)],
    ]
    points = np.stack([columns, heights, np.zeros(15)], axis=1)
    watch(
        zoo.Case("two_branches", points, np.array(faces)), exact_by_euclid, [10, 7], [0.384, 0.45]
    )


def state_of(wave):
    """What an answer is made of, to the bit."""
    return [
        array.tobytes()
        for array in (wave.vertices.distance, wave.vertices.winner_ints, wave.vertices.source_index)
    ]


@pytest.mark.jit
@pytest.mark.parametrize("name", ["sphere", "crags_with_holes", "double_frame"])
def test_slices_change_nothing(name):
    topology = topology_of(CASES[name])
    whole = finished(topology, started(topology, 3))
    for budget in (1, 500):
        sliced = finished(topology, started(topology, 3), budget=budget)
        assert state_of(sliced) == state_of(whole)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["sphere", "crags_with_holes", "torus"])
def test_growing_changes_nothing(name):
    """From a pool and a scratch of one row each."""
    topology = topology_of(CASES[name])
    whole = finished(topology, started(topology, 3))
    row = np.empty((1, 8))
    wave = with_pool(started(topology, 3), windows=row, scratch=row.copy())
    outcomes = []
    for outcome, grown in steps(topology, wave):
        outcomes.append(outcome)
        wave = grown
    assert set(outcomes) == {
        Outcome.RUNNING,
        Outcome.FINISHED,
        Outcome.POOL_FULL,
        Outcome.SCRATCH_FULL,
    }
    assert state_of(wave) == state_of(whole)
    rest = np.arange(COUNTERS) != WORK  # which counts a slice alone
    np.testing.assert_array_equal(wave.counters[rest], whole.counters[rest])
