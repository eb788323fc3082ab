"""Paths between two points within a largest distance: found, or certain not to be there."""

import itertools
import math
from functools import partial

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tolerances import AT_LIMIT
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.searches import buy_landmarks, check_search, random_pairs, solver_of

NEAR = 1e-9
"""Relative distance from the limit at which the answer is no longer a matter of rounding."""


@pytest.mark.slice(4)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_the_limit_divides_paths_as_the_full_sweep_does(case):
    """At the very limit a path is found; beyond it none."""
    solver = solver_of(case)
    for source, target in random_pairs(solver.mesh, 2 if WITHOUT_JIT else 12):
        distance = gc.exact_distance(solver.mesh, source).distances[target]
        for limit in (distance, distance * (1 + NEAR), 1.5 * distance, math.inf):
            path = solver.shortest_path(source, target, max_distance=limit)
            check_search(solver.mesh, path, source, target, distance)
        shares = (1 - NEAR, 0.999, 0.8, 0.3, 0.0) if distance > 0 else ()
        for share in shares:
            with pytest.raises(gc.errors.NoPath, match="max_distance") as caught:
                solver.shortest_path(source, target, max_distance=share * distance)
            assert caught.value.reason == "beyond_max_distance"


@pytest.mark.slow
@pytest.mark.slice(2)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
@pytest.mark.jit
def test_all_questions_agree_on_what_is_within_a_limit(case):
    """Also where the limit is the next number below the distance, or above it."""
    solver = solver_of(case)
    for source, target in random_pairs(solver.mesh, 2 if WITHOUT_JIT else 6):
        distance = solver.exact_distance(source).distances[target]
        if not 0 < distance < math.inf:
            continue
        below, above = np.nextafter(distance, 0), np.nextafter(distance, math.inf)
        for limit, is_within in ((below, False), (distance, True), (above, True)):
            found = is_within_limit(solver, source, target, limit)
            assert found == dict.fromkeys(found, is_within)


def is_within_limit(solver, source, target, limit):
    """Return whether each way to ask finds a target within a limit."""

    def finds(path_of, *arguments):
        try:
            return path_of(*arguments).length > 0
        except gc.errors.NoPath:
            return False

    field = solver.exact_distance(source, limit)
    aimed = solver.exact_distance(source, limit, targets=[target])
    searched = partial(solver.shortest_path, max_distance=limit)
    one = [source], [target], limit
    return {
        "field": math.isfinite(field.distance_at(target)),
        "target": math.isfinite(aimed.distance_at(target)),
        "path_to": finds(field.path_to, target),
        "search": finds(searched, source, target),
        "dense": bool(np.isfinite(solver.distance_matrix(*one)).all()),
        "sparse": solver.distance_matrix(*one, "sparse").nnz == 1,
        "pairs": bool(np.isfinite(solver.distance_matrix(*one, "pairs")).all()),
        "nearest": len(solver.nearest(source, [target], max_distance=limit).indices) == 1,
    }


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", ["flat", "cone_saddle", "slivers_1e-05", "pleats_slivers"])
def test_larger_meshes_and_slivers(name):
    solver = solver_of(zoo.KNOWN[name])
    for source, target in random_pairs(solver.mesh, 40, seed=2):
        distance = gc.exact_distance(solver.mesh, source).distances[target]
        path = solver.shortest_path(source, target, max_distance=distance * (1 + NEAR))
        check_search(solver.mesh, path, source, target, distance)
        if distance > 0:
            with pytest.raises(gc.errors.NoPath):
                solver.shortest_path(source, target, max_distance=distance * (1 - NEAR))


@pytest.mark.slow
@pytest.mark.jit
def test_slivers_that_no_slack_covers():
    points, faces = zoo.grid(20, 20, seed=4, jitter=0.22)
    solver = gc.Solver(gc.TriangleMesh(points * (1.0, 1e-10, 1.0), faces))
    for source, target in random_pairs(solver.mesh, 60, seed=1):
        length = solver.shortest_path(source, target).length
        within = solver.shortest_path(source, target, max_distance=length * (1 + NEAR))
        assert within.length == pytest.approx(length, rel=NEAR)
        if length > 0:
            with pytest.raises(gc.errors.NoPath):
                solver.shortest_path(source, target, max_distance=length * (1 - NEAR))


@pytest.mark.jit
def test_points_in_faces():
    mesh = solver_of(zoo.SMALL["crags"]).mesh
    solver, rng = gc.Solver(mesh), np.random.default_rng(5)
    points = [
        mesh.point(gc.SurfacePoint.face(face, tuple(rng.dirichlet(np.ones(3)))))
        for face in rng.choice(len(mesh.faces), 24).tolist()
    ]
    for source, target in itertools.pairwise(points):
        distance = gc.exact_distance(mesh, source).distance_at(target)
        path = solver.shortest_path(source, target, max_distance=distance)
        assert path.length == pytest.approx(distance, rel=1e-10)
        with pytest.raises(gc.errors.NoPath):
            solver.shortest_path(source, target, max_distance=distance * (1 - NEAR))


@pytest.mark.jit
def test_the_limit_is_that_of_the_whole_path():
    solver = solver_of(zoo.SMALL["crags"])
    stops = [3, 30, 30, 8, 50]
    legs = [gc.exact_distance(solver.mesh, a).distances[b] for a, b in itertools.pairwise(stops)]
    total = sum(legs)
    for limit in (total, total * (1 + NEAR), 2 * total):
        path = solver.shortest_path(3, 50, stops[1:-1], limit)
        assert path.length == pytest.approx(total, rel=1e-12)
    for limit in (total * (1 - NEAR), total - 0.5 * legs[-1], max(legs), 0.0):
        with pytest.raises(gc.errors.NoPath, match="from vertex 3 to vertex 50") as caught:
            solver.shortest_path(3, 50, stops[1:-1], limit)
        assert caught.value.reason == "beyond_max_distance"


@pytest.mark.jit
def test_straight_legs_at_the_very_limit():
    """The rest is bounded by what is as long as the path: rounding must not refuse it."""
    points, faces = zoo.grid(9, 9)
    mesh = gc.TriangleMesh(points * 0.1, faces)
    whole = gc.shortest_path(mesh, 0, 9)
    between = [int(place.vertex_index) for place in whole.locations[1:-1]]
    assert len(between) > 5
    stops = [0, *between, between[-1], 9]
    legs = [gc.shortest_path(mesh, a, b).length for a, b in itertools.pairwise(stops)]
    for limit in (sum(legs), whole.length):
        path = gc.shortest_path(mesh, 0, 9, stops[1:-1], limit)
        assert path.length == pytest.approx(whole.length, rel=1e-14)


def test_no_way_at_all_within_nothing():
    mesh = solver_of(zoo.SMALL["sphere"]).mesh
    assert gc.shortest_path(mesh, 7, 7, max_distance=0.0).length == 0.0
    with pytest.raises(gc.errors.NoPath):
        gc.shortest_path(mesh, 7, 8, max_distance=0.0)


def test_disconnected_comes_first():
    solver = solver_of(zoo.SMALL["two_components"])
    with pytest.raises(gc.errors.NoPath) as caught:
        solver.shortest_path(0, 15, max_distance=1e-3)
    assert caught.value.reason == "disconnected"


@pytest.mark.parametrize("bad", [-1.0, math.nan, "3", True])
def test_limits_that_are_none(bad):
    solver = solver_of(zoo.SMALL["sphere"])
    for find in (solver.shortest_path, lambda *a, **k: gc.shortest_path(solver.mesh, *a, **k)):
        with pytest.raises(gc.errors.InvalidArgument, match="max_distance"):
            find(0, 1, max_distance=bad)


@pytest.mark.jit
def test_a_limit_saves_work_and_leaves_the_search_sound():
    """A wall between two near points: the way around it is long, and not all of it is searched."""
    case = zoo.SMALL["comb"]
    solver = solver_of(case)
    ends = [int(np.flatnonzero((case.vertices == (x, 0, 0)).all(axis=1))[0]) for x in (0, 7)]
    buy_landmarks(solver, 2)
    path = solver.shortest_path(*ends, explain=True)
    search = solver._workspace._search
    straight = float(np.linalg.norm(np.diff(solver.mesh.vertices[ends], axis=0)))
    touched = []
    for limit in (straight * (1 - NEAR), 0.6 * path.length, 0.9 * path.length, path.length):
        before = search._touched
        try:
            solver.shortest_path(*ends, max_distance=limit)
        except gc.errors.NoPath:
            assert limit < path.length
        touched.append(search._touched - before)
    assert touched[0] == 0, "the straight line is longer"
    assert touched == sorted(touched)
    assert touched[1] < touched[-1]
    again = solver.shortest_path(*ends)
    assert again.points.tobytes() == path.points.tobytes()


def test_faces_without_area_between_vertices_at_one_place():
    """Unfolded, the ends lie upon each other; the path leads around the faces all the same."""
    vertices = [[2, 1, 2], [0, 1, 2], [0, 2, 2], [0, 2, 2], [2, 2, 0], [0, 0, 2]]
    mesh = gc.TriangleMesh(vertices, [[5, 1, 2], [1, 3, 0], [4, 3, 5], [5, 3, 1]])
    assert gc.exact_distance(mesh, 2).distances[3] == 2.0
    for source, target in ((2, 3), (3, 2)):
        path = gc.shortest_path(mesh, source, target)
        assert path.length == 2.0
        np.testing.assert_array_equal(path.points[1], vertices[1])


@zoo.each_scale
@pytest.mark.parametrize(("share", "is_found"), [(0.9, True), (1.1, False)])
def test_at_limit_is_how_much_longer_a_path_to_a_point_may_be(scale, share, is_found):
    mesh = gc.TriangleMesh(np.eye(3)[[0, 0, 1]] * scale * [[0], [1], [1]], [[0, 1, 2]])
    middle = gc.SurfacePoint.edge(0, 0, 0.5)
    limit = 0.5 * scale / (1.0 + share * AT_LIMIT)
    found = gc.distance_matrix(mesh, [0], [middle], limit, "pairs")
    assert np.isfinite(found).tolist() == [is_found]
    if is_found:
        assert gc.shortest_path(mesh, 0, middle, max_distance=limit).length == 0.5 * scale
    else:
        with pytest.raises(gc.errors.NoPath):
            gc.shortest_path(mesh, 0, middle, max_distance=limit)
