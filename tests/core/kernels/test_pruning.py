"""Bounds of a pruned search, against exact distances; and a search leaves nothing behind."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.fields.sweep import run_sweep
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import exact_bounds, merging_bounds
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.pruning import (
    forget,
    least_to_start,
    lower_bound_to_target,
    mark_visited,
    may_pass,
    steepest_to_start,
)
from geodesic_core.kernels.front.state import MARKS, SIZE, new_wavefront
from geodesic_core.kernels.paths import edge_dijkstra
from geodesic_core.kernels.sweep import continuous_dijkstra
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import SEARCH_SLACK
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import MERGING
from tests.support.searches import goal_at_vertex, random_pairs, spread
from tests.support.stepping import view_of_arrays

ROUNDING = 1e-10
GUIDE = 1e-3
CASES = {name: zoo.SMALL[name] for name in ("crags_with_holes", "crumpled_torus", "two_components")}


def distances_of(case) -> np.ndarray:
    """Exact distances (V, V) by inner vertex."""
    matrix = expected.matrix(case)
    outer = gc.TriangleMesh(case.vertices, case.faces).topology.outer_vertex
    return matrix[np.ix_(outer, outer)]


def with_landmarks(case, count):
    """A mesh; its landmarks, in every component."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    landmarks = Landmarks(mesh)
    for k in range(count):
        place = np.flatnonzero(mesh.components == k % (mesh.components.max() + 1))[0]
        landmarks.add(int(mesh.topology.inner_vertex[place]), Control())
    return mesh, landmarks


def view_toward(mesh, landmarks, start, **goal):
    topology = mesh.topology
    wave = new_wavefront(topology, pruned=True)
    goal = goal_at_vertex(mesh, start, landmarks=landmarks, **goal)
    return view_of_arrays(topology, wave, exact_bounds(math.inf, goal))


# Lower bounds -----------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf - inf, in plain Python
@zoo.each(CASES)
@pytest.mark.parametrize("count", [0, 1, 4])
@pytest.mark.jit
def test_the_rest_is_never_bounded_above_the_distance(case, count):
    mesh, landmarks = with_landmarks(case, count)
    matrix = distances_of(case)
    gain = 1.0
    for start in spread(case, 3 if WITHOUT_JIT else 20):
        view = view_toward(mesh, landmarks, start)
        connected = np.flatnonzero(np.isfinite(matrix[start]))
        straight = np.linalg.norm(mesh.positions - mesh.positions[start], axis=1)
        for v in connected.tolist():
            bound = lower_bound_to_target(view, v)
            assert straight[v] * (1 - 1e-12) <= bound <= matrix[start, v] * (1 + ROUNDING)
            gain = max(gain, bound / straight[v] if straight[v] else 1.0)
    if case.name != "two_components":  # where every distance is that of a straight line
        assert (gain > 1.05) == (count > 0)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf - inf, in plain Python
@zoo.each(CASES)
@pytest.mark.jit
def test_landmarks_alone_are_bounds_and_tight_behind_the_start(case):
    """Seen from a landmark, what lies straight behind the start is bounded almost exactly."""
    mesh, landmarks = with_landmarks(case, 4)
    matrix = distances_of(case)
    best = 0.0
    for start in spread(case, 3 if WITHOUT_JIT else 20):
        view = view_toward(mesh, landmarks, start)
        for v in np.flatnonzero(np.isfinite(matrix[start]) & (matrix[start] > 0)).tolist():
            bound = least_to_start(view, v, 0.0)
            assert 0 <= bound <= matrix[start, v] * (1 + ROUNDING)
            best = max(best, bound / matrix[start, v])
    assert best > 0.99


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf - inf, in plain Python
@zoo.each(CASES)
@pytest.mark.jit
def test_the_steepest_bound_exceeds_any_other_by_the_way_between(case):
    mesh, landmarks = with_landmarks(case, 4)
    matrix = distances_of(case)
    start = 0
    view = view_toward(mesh, landmarks, start)
    straight = np.linalg.norm(mesh.positions - mesh.positions[start], axis=1)
    connected = np.flatnonzero(np.isfinite(matrix[start])).tolist()
    least = {q: least_to_start(view, q, straight[q]) for q in connected}
    for v in connected[:: 8 if WITHOUT_JIT else 1]:
        steepest = steepest_to_start(view, v, straight[v])
        for q in connected:
            assert least[q] <= (steepest + matrix[v, q]) * (1 + ROUNDING)


@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(MERGING)
@pytest.mark.parametrize("count", [0, 3])
def test_what_an_earlier_sweep_knows_bounds_the_rest(case, count):
    """The bounds of the exact sweep, also where the guiding sweep pruned what they build upon."""
    mesh, landmarks = with_landmarks(case, count)
    topology = mesh.topology
    pruned = 0
    for source, target in random_pairs(mesh, 8):
        start, end = int(topology.inner_vertex[source]), int(topology.inner_vertex[target])
        exact = gc.exact_distance(mesh, target).distances[topology.outer_vertex]
        for room in (1.0, 1.2, 2.0):
            limit = room * exact[start] * (1 + ROUNDING)
            goal = goal_at_vertex(mesh, start, limit, landmarks)
            bounds = merging_bounds(math.inf, GUIDE, math.inf, goal)
            wave = new_wavefront(topology, merges=True, pruned=True)
            continuous_dijkstra.start_sweep(
                topology,
                wave,
                np.array([end], np.int32),
                np.zeros(1, np.int32),
                np.zeros(1),
                bounds,
            )
            wave, _ = run_sweep(mesh, wave, bounds, Control(), lambda _: 0.0)
            view = view_toward(mesh, landmarks, start, known=wave.vertices.distance, ceiling=limit)
            rest = np.array([lower_bound_to_target(view, v) for v in range(len(exact))])
            assert (rest <= exact * (1 + ROUNDING)).all()
            pruned += int((wave.vertices.distance > exact * (1 + 1e-3)).sum())
    assert pruned > 0, "else the ceiling was never needed"


def test_what_may_pass_lies_within_the_limit():
    mesh = gc.TriangleMesh(*zoo.grid(4, 4))
    wave = new_wavefront(mesh.topology, pruned=True)
    wave.vertices.distance[3], wave.vertices.heuristic[3] = 2.0, 1.5
    for limit, passes in ((3.5, True), (3.6, True), (3.4, False)):
        view = view_of_arrays(
            mesh.topology, wave, exact_bounds(math.inf, goal_at_vertex(mesh, 0, limit))
        )
        assert may_pass(view, 3) == passes
    plain = new_wavefront(mesh.topology)
    assert may_pass(view_of_arrays(mesh.topology, plain), 3)


# What a search leaves behind --------------------------------------------------------------------


def snapshot(wave) -> dict[str, bytes]:
    """All that a search builds upon; the rest of the arrays is written before it is read."""
    names = ("distance", "winner_ints", "status", "upper", "light", "reference", "source_index")
    held = {name: getattr(wave.vertices, name).tobytes() for name in names}
    held["heap_place"] = wave.queues.heap_place.tobytes()
    held["runs"] = wave.pool.runs.tobytes()
    held["counters"] = wave.counters.tobytes()
    return held | {"lists": wave.pool.lists[:, [SIZE, MARKS]].tobytes()}


def after(mesh, start, end, *, merges, budget):
    """A pruned sweep, stopped within its first slice of so much work; its bounds."""
    topology = mesh.topology
    wave = new_wavefront(topology, merges=merges, paths=merges, pruned=True)
    straight = float(np.linalg.norm(mesh.positions[start] - mesh.positions[end]))
    goal = goal_at_vertex(mesh, end, 1.5 * straight)
    bounds = (
        merging_bounds(math.inf, GUIDE, math.inf, goal) if merges else exact_bounds(math.inf, goal)
    )
    continuous_dijkstra.start_sweep(
        topology, wave, np.array([start], np.int32), np.zeros(1, np.int32), np.zeros(1), bounds
    )
    continuous_dijkstra.advance(topology, wave, bounds, budget)
    return wave, bounds


@pytest.mark.parametrize("name", ["sphere", "crags_with_holes", "bow_tie_of_fans", "obstacles"])
@pytest.mark.parametrize("merges", [False, True])
def test_a_sweep_is_forgotten_whole(name, merges):
    """Wherever it was interrupted."""
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    fresh = snapshot(new_wavefront(mesh.topology, merges=merges, paths=merges, pruned=True))
    budgets = [1, 300, 1 << 60] if WITHOUT_JIT else [*np.geomspace(1, 1e5, 40).astype(int), 1 << 60]
    last = len(case.vertices) - 1
    for budget in budgets:
        wave, _ = after(mesh, 0, last, merges=merges, budget=int(budget))
        assert snapshot(wave) != fresh
        forget(mesh.topology, wave)
        assert snapshot(wave) == fresh


@pytest.mark.parametrize("name", ["sphere", "crags_with_holes"])
def test_a_search_along_edges_is_forgotten_whole(name):
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    wave = new_wavefront(mesh.topology, pruned=True)
    fresh = snapshot(wave)
    bounds = exact_bounds(math.inf, goal_at_vertex(mesh, 30))
    edge_dijkstra.search_edges(mesh.topology, wave, bounds, 0, 30)
    assert snapshot(wave) != fresh
    forget(mesh.topology, wave)
    assert snapshot(wave) == fresh


def test_every_touched_vertex_is_noted_once():
    mesh = gc.TriangleMesh(*zoo.grid(9, 9))
    wave, _ = after(mesh, 0, 55, merges=False, budget=1 << 60)
    touched = wave.vertices.touched[: wave.counters[TOUCHED]].tolist()
    assert len(touched) == len(set(touched)) < len(mesh.vertices)
    changed = np.flatnonzero(
        np.isfinite(wave.vertices.distance) | (wave.vertices.status != state.FAR)
    )
    assert sorted(touched) == changed.tolist()


def test_visited_are_the_faces_that_were_reached_at_all_corners():
    case = zoo.SMALL["crags_with_holes"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    wave, _ = after(mesh, 0, 20, merges=False, budget=1 << 60)
    visited = np.zeros(len(mesh.faces), np.uint8)
    mark_visited(
        mesh.topology,
        wave.vertices.distance,
        wave.vertices.touched[: wave.counters[TOUCHED]],
        visited,
    )
    reached = np.isfinite(wave.vertices.distance[mesh.topology.inner_vertex])
    np.testing.assert_array_equal(visited, reached[mesh.faces].all(axis=1))
    assert 0 < visited.sum() < len(visited)


def sought(mesh, source, target, exact, limit) -> float:
    """The distance that an exact sweep finds within a limit, bounded by exact distances itself."""
    topology = mesh.topology
    start, end = (int(topology.inner_vertex[v]) for v in (source, target))
    goal = goal_at_vertex(mesh, start, limit, known=exact[topology.outer_vertex])
    bounds = exact_bounds(math.inf, goal)
    wave = new_wavefront(topology, pruned=True)
    continuous_dijkstra.start_sweep(
        topology, wave, np.array([start], np.int32), np.zeros(1, np.int32), np.zeros(1), bounds
    )
    wave, _ = run_sweep(mesh, wave, bounds, Control(), lambda _: 0.0)
    return float(wave.vertices.distance[end])


SEARCHED = {
    name: zoo.SMALL[name]
    for name in ("crags_with_holes", "crumpled_torus", "bow_tie_of_fans", "obstacles", "box_1x2x3")
} | {name: zoo.KNOWN[name] for name in ("flat", "cone_ruffle", "prism_slivers", "caps")}


@pytest.mark.jit
@zoo.each(SEARCHED)
def test_search_slack_keeps_the_path_itself(case):
    """Under the tightest bounds there can be: no rounding prunes it, and anything less would."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for target in spread(case, 6):
        exact = gc.exact_distance(mesh, target).distances
        for source in spread(case, 9):
            if source == target:
                continue
            distance = exact[source]
            found = sought(mesh, source, target, exact, distance * (1 + SEARCH_SLACK))
            assert found == pytest.approx(distance, rel=0.1 * SEARCH_SLACK)
            lost = sought(mesh, source, target, exact, distance * (1 - SEARCH_SLACK))
            assert not lost <= distance * (1 - 0.1 * SEARCH_SLACK)
