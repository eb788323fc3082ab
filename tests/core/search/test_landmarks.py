"""Landmarks: what they are bounds of, when they are added, and what they cost."""

import math
import time

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.kernels.front.bounds import LANDMARKS, exact_bounds
from geodesic_core.kernels.front.pruning import least_to_start
from geodesic_core.kernels.front.state import new_wavefront
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import LANDMARK_ERROR, SINGLE_PRECISION
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import MERGING
from tests.support.searches import (
    answer,
    buy_landmarks,
    check_searches,
    goal_at_vertex,
    landmark_count,
    random_pairs,
    solver_of,
    spread,
)
from tests.support.stepping import view_of_arrays

SINGLE = 2.0**-24
"""Relative rounding of single precision."""


def landmarks_of(case, count, beside=0) -> tuple[gc.TriangleMesh, Landmarks]:
    """Landmarks in the component of a vertex."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    landmarks = Landmarks(mesh)
    for _ in range(count):
        landmarks.add(int(mesh.topology.inner_vertex[beside]), Control())
    return mesh, landmarks


def columns(mesh, landmarks) -> np.ndarray:
    """Their distances (V, count), as the caller numbers the vertices."""
    return landmarks.distances[mesh.topology.inner_vertex, : landmarks.count]


@pytest.mark.parametrize("name", ["sphere", "crags_with_holes", "two_components", "bow_tie"])
@pytest.mark.jit
def test_distances_are_those_of_one_vertex_each(name):
    """Short by the error at most, and never too long but for rounding; infinite elsewhere."""
    mesh, landmarks = landmarks_of(zoo.SMALL[name], 3)
    assert landmarks.distances.shape == (len(mesh.vertices), LANDMARKS)
    found = columns(mesh, landmarks)
    places = found.argmin(axis=0).tolist()
    assert len(set(places)) == 3
    for place, distances in zip(places, found.T, strict=True):
        exact = gc.exact_distance(mesh, place).distances
        assert distances[place] == 0
        np.testing.assert_array_equal(np.isfinite(distances), np.isfinite(exact))
        reached = np.isfinite(exact)
        assert (distances[reached] <= exact[reached] * (1 + SINGLE + 1e-12)).all()
        least = exact[reached] * (1 - LANDMARK_ERROR) * (1 - SINGLE - 1e-12)
        assert (distances[reached] >= least).all()


@pytest.mark.jit
def test_landmarks_lie_far_apart():
    """The first far from where the search began, each further one far from those before."""
    mesh, landmarks = landmarks_of(zoo.SMALL["hills"], 5, beside=20)
    straight = np.linalg.norm(mesh.vertices - mesh.vertices[20], axis=1)
    found = columns(mesh, landmarks).astype(float)
    places = found.argmin(axis=0).tolist()
    assert places[0] == straight.argmax()
    for k in range(1, 5):
        nearest = found[:, :k].min(axis=1)
        assert nearest[places[k]] == nearest.max()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf - inf, in plain Python
@pytest.mark.jit
def test_landmarks_of_several_components():
    """Each lies where it was asked for, and the searches of both components stay right."""
    solver = solver_of(zoo.SMALL["two_components"])
    components = solver.mesh.components
    for _ in range(4 if WITHOUT_JIT else 30):
        for source, target in ((0, 3), (15, 5), (2, 1), (4, 13)):
            check_searches(solver, source, [target])
    search = solver._workspace._search
    found = columns(solver.mesh, search._landmarks)
    assert {int(components[place]) for place in found.argmin(axis=0)} == set(components.tolist())


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf - inf, in plain Python
def test_an_isolated_vertex_may_be_a_landmark():
    solver = solver_of(zoo.SMALL["isolated_vertices"])
    for _ in range(12):
        assert solver.shortest_path(0, 0).length == 0
    assert landmark_count(solver) > 0
    check_searches(solver, 1, [2, 4, 6])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["square", "crags", "crumpled_torus"])
@pytest.mark.jit
def test_neither_landmarks_nor_memory_grow_without_end(name):
    solver = solver_of(zoo.SMALL[name])
    pairs = random_pairs(solver.mesh, 3 if WITHOUT_JIT else 40)
    if WITHOUT_JIT:
        buy_landmarks(solver, 2)
        return
    buy_landmarks(solver, LANDMARKS)
    for source, target in pairs:
        solver.shortest_path(source, target)
    memory = solver.nbytes
    for _ in range(3):
        for source, target in pairs:
            solver.shortest_path(source, target)
    assert solver.nbytes == memory
    assert landmark_count(solver) == LANDMARKS


@pytest.mark.slow
@pytest.mark.jit
def test_memory_is_that_of_landmarks_and_scratch():
    """64 bytes a vertex for all landmarks, at once; two thirds of the mesh for all the rest."""
    mesh = gc.TriangleMesh(*zoo.icosphere(5))
    solver = gc.Solver(mesh)
    assert solver.nbytes == 0
    solver.shortest_path(0, 0)
    before = solver.nbytes
    assert before <= 0.7 * mesh.nbytes
    buy_landmarks(solver, 1)
    first = solver.nbytes
    buy_landmarks(solver, LANDMARKS)
    grown = 4 * LANDMARKS * len(mesh.vertices)
    assert first - before >= grown
    assert solver.nbytes - first < grown, "the others fit beside the first"


@pytest.mark.jit
def test_no_landmark_before_as_much_was_searched():
    """A near path costs no more for them; a far one soon brings the first."""
    mesh = gc.TriangleMesh(*zoo.icosphere(5))
    solver = gc.Solver(mesh)
    near = np.argsort(np.linalg.norm(mesh.vertices - mesh.vertices[0], axis=1))[:20]
    for target in near.tolist():
        solver.shortest_path(0, target)
    assert landmark_count(solver) == 0
    counts = []
    for source, target in random_pairs(mesh, 30):
        counts.append(landmark_count(solver))
        solver.shortest_path(source, target)
    assert 1 <= counts[-1] <= LANDMARKS
    assert max(np.diff(counts)) == 1, "one at a time"


@pytest.mark.slow
@pytest.mark.jit
def test_landmarks_thin_the_search():
    """On a knot, where straight distances say little; the region of the last step stays."""
    mesh = gc.samples.knot(20_000)
    solver = gc.Solver(mesh)
    buy_landmarks(solver, LANDMARKS)
    faces = np.zeros((2, 6))
    for pair in random_pairs(mesh, 12, seed=1):
        paths = (
            gc.shortest_path(mesh, *pair, explain=True),
            solver.shortest_path(*pair, explain=True),
        )
        faces += [[len(step.faces) for step in path.steps] for path in paths]
        assert paths[0].length == pytest.approx(paths[1].length, rel=1e-12)
    without, with_landmarks = faces
    assert with_landmarks[0] < 0.25 * without[0]
    assert with_landmarks[2] < 0.5 * without[2]


@pytest.mark.jit
@pytest.mark.parametrize("stop", ["cancel", "deadline", "memory"])
def test_what_stops_a_landmark_does_not_lose_the_path(stop, monkeypatch):
    """The next call that is not stopped adds it."""
    mesh = gc.TriangleMesh(*zoo.icosphere(4))
    asked, ends, late, clock = [], (0, 2000), [0.0], time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: clock() + late[0])
    expected = answer(gc.shortest_path(mesh, *ends, cancel=lambda: asked.append(1)))
    for_the_path = len(asked)

    def cancel():
        """Let the path be found, but no landmark."""
        asked.append(1)
        if len(asked) <= for_the_path or stop == "memory":
            return False
        if stop == "deadline":
            late[0] = 1e6
        return stop == "cancel"

    solver = gc.Solver(mesh)
    solver.shortest_path(*ends)
    options = {"deadline": {"deadline_s": 1e5}, "memory": {"memory_limit": solver.nbytes}}
    asks = set()
    for _ in range(10 if stop != "deadline" else 5):
        asked.clear()
        late[0] = 0.0
        assert (
            answer(solver.shortest_path(*ends, cancel=cancel, **options.get(stop, {}))) == expected
        )
        asks.add(len(asked))
    assert landmark_count(solver) == 0
    if stop != "memory":
        assert max(asks) == for_the_path + 1, "a landmark was due"
    solver.shortest_path(*ends)
    assert landmark_count(solver) == 1


@pytest.mark.parametrize("scale", [1e-49, 1e49])
@pytest.mark.jit
def test_paths_where_single_precision_ends(scale):
    vertices, faces = zoo.torus(8, 6)
    small = gc.Solver(gc.TriangleMesh(vertices, faces))
    solver = gc.Solver(gc.TriangleMesh(vertices * scale, faces))
    for source, target in [(0, 20), (3, 40), (11, 30), (47, 5), (2, 25), (8, 33)]:
        expected = small.shortest_path(source, target).length
        found = solver.shortest_path(source, target).length
        assert found == pytest.approx(scale * expected, rel=1e-9, abs=0)


def test_single_precision_is_more_than_rounding_to_it():
    numbers = np.random.default_rng(0).uniform(1.0, 2.0, 10_000)
    assert (abs(numbers.astype(np.float32) - numbers) < 0.1 * SINGLE_PRECISION * numbers).all()


@pytest.mark.jit
@zoo.each(MERGING)
def test_landmark_error_is_all_that_landmarks_fall_short(case):
    """Their bounds make up for it; taken as exact, their distances would bound too much."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    topology = mesh.topology
    landmarks = Landmarks(mesh)
    landmarks.add(0, Control())
    stored = landmarks.distances[:, 0].astype(float)
    place = int(topology.outer_vertex[stored.argmin()])
    exact = gc.exact_distance(mesh, place).distances[topology.outer_vertex]
    assert (stored <= exact * (1 + 1e-7)).all()
    assert (stored >= exact * (1 - LANDMARK_ERROR) * (1 - 1e-7)).all()
    assert (stored < exact * (1 - 0.01 * LANDMARK_ERROR)).any(), "else nothing was merged"
    naive = 0.0
    for start in spread(case, 6):
        goal = goal_at_vertex(mesh, start, landmarks=landmarks)
        view = view_of_arrays(
            topology, new_wavefront(topology, pruned=True), exact_bounds(math.inf, goal)
        )
        distances = gc.exact_distance(mesh, int(topology.outer_vertex[start])).distances
        distances = distances[topology.outer_vertex]
        bounds = np.array([least_to_start(view, v, 0.0) for v in range(len(distances))])
        assert (bounds <= distances * (1 + 1e-12)).all()
        naive = max(naive, (np.abs(stored - stored[start]) - distances).max())
    assert naive > 0
