"""Paths between two points, against the full sweep and the oracles, on the zoo."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.path_checks import LENGTH
from tests.support.searches import (
    check_search,
    check_searches,
    landmark_count,
    random_pairs,
    solver_of,
    spread,
)

EXACT = 1e-9
"""Relative error allowed against an oracle, as of exact fields."""


@pytest.mark.jit
def test_bounds_that_rounding_makes_contradict_each_other():
    """The bounds pruned the path itself, and the search was given up."""
    case = zoo.KNOWN["slivers_1e-05"].moved(zoo.rotation(3), (1.0, 2.0, -3.0))
    check_searches(solver_of(case), 18, [438])


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("aspect", [1e-8, 1e-10])
def test_slivers_at_the_end_of_precision(aspect):
    points, faces = zoo.grid(20, 20, seed=4, jitter=0.22)
    solver = gc.Solver(gc.TriangleMesh(points * (1.0, aspect, 1.0), faces))
    for source, target in random_pairs(solver.mesh, 200, seed=1):
        distance = gc.exact_distance(solver.mesh, source).distances[target]
        length = solver.shortest_path(source, target).length
        assert length == pytest.approx(distance, rel=EXACT, abs=0)


def test_an_upper_bound_belongs_to_the_path_of_its_ends():
    """A strip that was led past its last bend ended at another vertex, and so too soon."""
    points, faces = zoo.grid(2, 3, seed=28, jitter=0.2)
    near = np.einsum("k,fkd->fd", (1e-5, 0.45 - 1e-5, 0.55), points[faces])
    _, split = zoo.split_at_centroids(points, faces)
    mesh = gc.TriangleMesh(np.vstack([points, near]), split)
    distance = gc.exact_distance(mesh, 23).distances[1]
    check_search(mesh, gc.shortest_path(mesh, 23, 1), 23, 1, distance)


# Several equally short paths --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("level", [1, 3, 4])
def test_opposite_points_of_a_sphere(level):
    """Twelve vertices on axes of symmetry, each with several shortest paths to the one opposite."""
    case = zoo.Case("sphere", *zoo.icosphere(level))
    solver = solver_of(case)
    opposite = (case.vertices[:12] @ case.vertices[:12].T).argmin(axis=1).tolist()
    lengths = []
    for source, target in enumerate(opposite):
        check_searches(solver, source, [target])
        lengths.append(solver.shortest_path(source, target).length)
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-13)


# Ends of every kind -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["single_triangle", "sphere", "crags_with_holes", "bow_tie", "isolated_vertices"]
)
def test_from_a_vertex_to_itself(name):
    solver = solver_of(zoo.SMALL[name])
    for vertex in spread(zoo.SMALL[name], 3 if WITHOUT_JIT else 100):
        for path in (
            solver.shortest_path(vertex, vertex, explain=True),
            gc.shortest_path(solver.mesh, vertex, vertex),
        ):
            check_search(solver.mesh, path, vertex, vertex, 0.0)


def test_to_a_neighbour_along_the_edge():
    solver = solver_of(zoo.SMALL["hills"])
    path = solver.shortest_path(9, 10)
    np.testing.assert_array_equal(path.points, solver.mesh.vertices[[9, 10]])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crags", "thin_plate", "bow_tie_of_fans", "obtuse_pair"])
def test_between_the_corners_of_a_face(name):
    case = zoo.SMALL[name]
    solver = solver_of(case)
    for a, b, c in case.faces[:: 40 if WITHOUT_JIT else 1].tolist():
        check_searches(solver, a, [b, c])


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("name", ["crags_with_holes", "double_frame", "open_fan", "comb"])
def test_between_the_rims(name):
    case = zoo.SMALL[name]
    solver = solver_of(case)
    sides = np.sort(np.vstack([case.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    rim = np.unique(edges[uses == 1])
    ends = rim if len(rim) else np.unique(case.faces)
    for source in ends[::4].tolist():
        check_searches(solver, source, ends[::3].tolist())


@pytest.mark.jit
@pytest.mark.parametrize("name", ["cone_saddle", "cone_ruffle"])
def test_over_a_saddle(name):
    """Ends more than a half turn apart on both sides: the path bends at the apex."""
    case = zoo.KNOWN[name]
    solver = solver_of(case)
    apex_paths = 0
    for source, target in random_pairs(solver.mesh, 60):
        distances = np.linalg.norm(case.vertices, axis=1)  # along the generators from the apex
        path = solver.shortest_path(source, target)
        assert path.length == pytest.approx(case.distances(source)[target], rel=EXACT, abs=0)
        if 0 in [place.vertex_index for place in path.locations[1:-1]]:
            apex_paths += 1
            through = distances[source] + distances[target]
            assert path.length == pytest.approx(through, rel=LENGTH)
    assert apex_paths > 5


def test_around_the_corners_of_a_comb():
    """Every bend is a vertex of the rim."""
    case = zoo.SMALL["comb"]
    corners = [int(np.flatnonzero((case.vertices == (x, 0, 0)).all(axis=1))[0]) for x in (0, 7)]
    path = solver_of(case).shortest_path(*corners)
    directions = np.diff(path.points, axis=0)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    bends = np.flatnonzero((directions[1:] * directions[:-1]).sum(axis=1) < 1 - 1e-9) + 1
    assert len(bends) >= 2
    assert all(path.locations[bend].vertex_index is not None for bend in bends)


# No path ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["two_components", "isolated_vertices"])
def test_no_path_between_components(name):
    solver = solver_of(zoo.SMALL[name])
    components = solver.mesh.components
    last = len(components) - 1
    other = int(np.flatnonzero(components != components[last])[0])
    for source, target in ((other, last), (last, other)):
        for find in (solver.shortest_path, lambda *ends: gc.shortest_path(solver.mesh, *ends)):
            with pytest.raises(
                gc.errors.NoPath, match=f"vertex {source} and vertex {target}"
            ) as caught:
                find(source, target)
            assert caught.value.reason == "disconnected"
    assert solver.nbytes == 0, "nothing was searched for"


@pytest.mark.parametrize("bad", [-1, 10**6, 1.5, None, True, "3"])
def test_ends_that_are_no_vertices(bad):
    solver = solver_of(zoo.SMALL["crags"])
    with pytest.raises(gc.errors.InvalidPoint, match="source"):
        solver.shortest_path(bad, 0)
    with pytest.raises(gc.errors.InvalidPoint, match="target"):
        solver.shortest_path(0, bad)


@pytest.mark.jit
def test_ends_may_be_surface_points():
    solver = solver_of(zoo.SMALL["crags"])
    point = gc.SurfacePoint.vertex
    by_number = solver.shortest_path(3, 40, [17])
    by_point = solver.shortest_path(point(3), point(40), [point(17)])
    np.testing.assert_array_equal(by_point.points, by_number.points)


# What a solver keeps ----------------------------------------------------------------------------


@pytest.mark.jit
def test_a_solver_answers_as_a_new_one_does():
    """To the bit, whatever was asked before, landmarks or not."""
    solver = solver_of(zoo.SMALL["crumpled_torus"])
    for source, target in random_pairs(solver.mesh, 60):
        fresh = gc.shortest_path(solver.mesh, source, target)
        used = solver.shortest_path(source, target)
        assert used.points.tobytes() == fresh.points.tobytes()
    assert landmark_count(solver) > 2


@pytest.mark.jit
def test_a_solver_has_the_solvers_of_its_mesh():
    solver = solver_of(zoo.SMALL["crags"])
    exact = solver.exact_distance([3, 5], max_distance=2.0)
    np.testing.assert_array_equal(
        exact.distances, gc.exact_distance(solver.mesh, [3, 5], max_distance=2.0).distances
    )
    found = solver.approximate_distance(3, 1e-2, retain="paths")
    np.testing.assert_array_equal(
        found.distances, gc.approximate_distance(solver.mesh, 3, 1e-2).distances
    )
    assert solver.nbytes == 0
    assert exact.mesh is solver.mesh


@pytest.mark.parametrize("weights", [(0.25, 0.5, 0.25), (0.3, 0.45, 0.25)])
def test_ends_in_one_place_of_a_face_of_no_area(weights):
    """Their distance is rounded, although a path along edges has no length."""
    flat = [(4, 6), (1, 3), (2, 4), (4, 1), (2, 3), (5, 7), (2, 0)]
    faces = [(5, 0, 6), (1, 5, 3), (2, 1, 0), (6, 2, 4), (0, 6, 1), (6, 2, 4)]
    mesh = gc.TriangleMesh(np.pad(flat, ((0, 0), (0, 1))) / 4, faces)
    point = gc.SurfacePoint.face(2, weights)
    distance = np.linalg.norm(mesh.position(point) - mesh.vertices[2])
    for path in (gc.shortest_path(mesh, point, 2), gc.shortest_path(mesh, 2, point)):
        assert path.length == pytest.approx(distance, rel=1e-12, abs=1e-15)
