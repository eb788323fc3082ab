"""Searches for paths between two points: on what they are tried, and what must hold of each."""

from collections.abc import Iterable, Iterator

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.front import pruning, state
from geodesic_core.kernels.front.bounds import PruningBounds, exact_bounds
from geodesic_core.kernels.paths import edge_dijkstra
from geodesic_core.search.landmarks import Landmarks
from tests.support import zoo
from tests.support.path_checks import LENGTH, check_path

STEPS = ["dijkstra", "shorten", "approximate", "backtrace", "exact", "path"]


def solver_of(case: zoo.Case) -> gc.Solver:
    return gc.Solver(gc.TriangleMesh(case.vertices, case.faces))


def spread(case: zoo.Case, count: int) -> list[int]:
    """Up to ``count`` vertices, evenly spread, the first and the last among them."""
    last = len(case.vertices) - 1
    return np.unique(np.linspace(0, last, min(count, last + 1)).astype(int)).tolist()


def random_pairs(mesh: gc.TriangleMesh, count: int, seed: int = 0) -> list[tuple[int, int]]:
    """Pairs of connected vertices."""
    rng = np.random.default_rng(seed)
    starts = rng.choice(np.unique(mesh.faces), count).tolist()
    return [
        (start, int(rng.choice(np.flatnonzero(mesh.components == mesh.components[start]))))
        for start in starts
    ]


def landmark_count(solver: gc.Solver) -> int:
    return 0 if solver._workspace._search is None else solver._workspace._search._landmarks.count


def buy_landmarks(solver: gc.Solver, count: int) -> None:
    """Search here and there until the solver has so many landmarks."""
    for source, target in random_pairs(solver.mesh, 100 * count):
        if landmark_count(solver) >= count:
            return
        solver.shortest_path(source, target)
    raise AssertionError(f"no {count} landmarks after {100 * count} searches")


def check_searches(solver: gc.Solver, source: int, targets: Iterable[int]) -> None:
    """The solver and a new one, there and back, find what the full sweep does."""
    mesh = solver.mesh
    distances = gc.exact_distance(mesh, source).distances
    for target in targets:
        if np.isfinite(distances[target]):
            path = solver.shortest_path(source, target)
            check_search(mesh, path, source, target, distances[target])
            back = solver.shortest_path(target, source)
            assert back.length == pytest.approx(distances[target], rel=LENGTH, abs=0)
            fresh = gc.shortest_path(mesh, source, target)
            assert fresh.length == pytest.approx(distances[target], rel=LENGTH, abs=0)


def check_search(mesh, path, source, target, distance) -> None:
    """An exact path of this length, over the surface; a single point where both ends are one."""
    assert (path.error_bound.type, path.error_bound.value) == ("relative", 0.0)
    if source == target:
        assert path.length == 0
        np.testing.assert_array_equal(path.points, mesh.vertices[[source]])
        assert [place.vertex_index for place in path.locations] == [source]
        assert len(path.faces) == 0
    else:
        check_path(mesh, path, source, target, distance)


def answer(path: gc.GeodesicPath) -> tuple:
    """All of a path that does not depend on the clock."""
    steps = [(s.name, s.bound, s.windows, s.faces.tobytes()) for s in path.steps or ()]
    return path.points.tobytes(), path.faces.tobytes(), path.locations, path.length, steps


def goal_at_vertex(
    mesh: gc.TriangleMesh,
    v: int,
    limit: float = np.inf,
    landmarks: Landmarks | None = None,
    **known: object,
) -> PruningBounds:
    """The bounds of paths through inner vertex v."""
    here = mesh.positions[v].copy(), np.array([v], np.int32), np.zeros(1)
    return (landmarks or Landmarks(mesh)).pruning_through(*here, limit)._replace(**known)


def edge_paths(mesh: gc.TriangleMesh, pairs) -> Iterator[tuple[int, int, np.ndarray, float]]:
    """For each pair, what the search along edges finds: inner vertices from start to end."""
    topology = mesh.topology
    wave = state.new_wavefront(topology, pruned=True)
    for start, end in pairs:
        first, last = (int(topology.inner_vertex[v]) for v in (start, end))
        bounds = exact_bounds(np.inf, goal_at_vertex(mesh, first))
        edge_dijkstra.search_edges(topology, wave, bounds, last, first)
        length = float(wave.vertices.distance[first])
        yield (
            start,
            end,
            edge_dijkstra.vertices_to(wave.vertices.winner_ints[:, state.PREDECESSOR], first),
            length,
        )
        pruning.forget(topology, wave)
