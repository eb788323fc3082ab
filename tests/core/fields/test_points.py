"""Points anywhere on the surface, as sources and as targets."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.fields import point_query
from geodesic_core.tolerances import (
    EDGE_STEPS,
    ROUNDED_COORDINATE,
    ROUNDED_SUM,
    SNAP,
    WEIGHT,
    WEIGHT_ERROR,
)
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points
from tests.support.path_checks import check_path

EXACT = 1e-9
"""Relative error allowed against an oracle."""

SAME = 1e-11
"""Relative difference allowed between two ways to one exact distance."""


@pytest.mark.parametrize("t", [0.3, 1 / 3, 0.5, 1e-5, 0.7])
def test_all_spellings_of_a_point_on_an_edge_are_one(t):
    mesh = mesh_of(zoo.SMALL["icosphere"] if "icosphere" in zoo.SMALL else zoo.SMALL["octahedron"])
    a, b, c = mesh.faces[0].tolist()
    other = next(f for f, face in enumerate(mesh.faces.tolist()) if f > 0 and {a, b} <= set(face))
    corner = next(i for i in range(3) if mesh.faces[other, i] == b)
    place = (1 - t) * mesh.vertices[a] + t * mesh.vertices[b]
    spellings = [
        mesh.point(gc.SurfacePoint.edge(0, 0, t)),
        mesh.point(gc.SurfacePoint.edge(other, corner, 1 - t)),
        mesh.point(gc.SurfacePoint.face(0, (1 - t, t, 0.0))),
        mesh.point(gc.SurfacePoint.face(0, (1 - t, t, -5e-17))),
        mesh.point(gc.SurfacePoint.face(0, (1 - t, t - 1e-16, 1e-16))),
        mesh.locate(place),
        mesh.locate(place * (1 + 1e-15)),
    ]
    assert set(spellings) == {spellings[0]}
    assert mesh.point(spellings[0]) == spellings[0]
    assert c not in mesh.faces[spellings[0].face_index][np.array(spellings[0].barycentric) > 0]


def test_all_spellings_of_a_vertex_are_one():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    spellings = [mesh.point(4), mesh.point(np.int32(4)), mesh.point(gc.SurfacePoint.vertex(4))]
    for face, corners in enumerate(mesh.faces.tolist()):
        if 4 in corners:
            i = corners.index(4)
            weights = [0.0, 0.0, 0.0]
            weights[i], weights[i - 1] = 1 + 5e-17, -5e-17
            spellings += [
                mesh.point(gc.SurfacePoint.edge(face, i, 0.0)),
                mesh.point(gc.SurfacePoint.edge(face, (i + 2) % 3, 1 - 1e-16)),
                mesh.point(gc.SurfacePoint.face(face, tuple(weights))),
            ]
    spellings += [mesh.locate(mesh.vertices[4]), mesh.locate(mesh.vertices[4] * (1 + 1e-15))]
    assert set(spellings) == {spellings[0]}
    assert spellings[0].vertex_index == 4
    assert spellings[0].face_index == min(np.flatnonzero((mesh.faces == 4).any(axis=1)))


@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_located_positions_are_where_they_were(case):
    mesh = mesh_of(case)
    for point in random_points(mesh, 12, seed=4):
        place = mesh.position(point)
        found = mesh.locate(place)
        np.testing.assert_allclose(mesh.position(found), place, rtol=0, atol=1e-12 * mesh.diagonal)
        assert mesh.point(found) == found


def test_locating_stops_at_max_distance():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    away = 0.25 * np.linalg.norm(mesh.vertices[2])
    outside = mesh.vertices[2] * 1.25
    assert mesh.locate(outside, 1.001 * away) == mesh.point(2)
    with pytest.raises(gc.errors.InvalidPoint, match=f"{away:g} away .* max_distance"):
        mesh.locate(outside, 0.999 * away)


def test_distances_trace_no_path(monkeypatch):
    mesh = mesh_of(zoo.SMALL["sphere"])
    field = gc.exact_distance(mesh, [0, 5])
    point = random_points(mesh, 1, seed=3)[0]
    path = field.path_to(point)
    traced = []
    monkeypatch.setattr(point_query, "traced_path", lambda *_: traced.append(1))
    assert field.distance_at(point) == pytest.approx(path.length, rel=SAME)
    assert field.nearest_source_at(point) in (0, 1)
    assert not traced


@pytest.mark.parametrize("height", [1e-12, 3e-13, 1e-13, 1e-16, 1e-40, 0.0])
def test_points_of_slivers_are_located_where_they_are(height):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, height, 0], [0.5, -1, 0]])
    mesh = gc.TriangleMesh(corners, [[0, 1, 2], [1, 0, 3]])
    for weights in np.random.default_rng(6).dirichlet((1, 1, 1), 100):
        place = weights @ corners[:3]
        found = mesh.position(mesh.locate(place))
        np.testing.assert_allclose(found, place, rtol=0, atol=3e-12)


def test_positions_on_the_surface_are_at_no_distance():
    mesh = mesh_of(zoo.SMALL["crumpled_sphere"])
    for point in random_points(mesh, 50, seed=12):
        assert mesh.locate(mesh.position(point), max_distance=0) == mesh.locate(
            mesh.position(point)
        )
    with pytest.raises(gc.errors.InvalidPoint, match="max_distance = 0"):
        mesh.locate(mesh.vertices.max(axis=0) + 1e-9, max_distance=0)


@pytest.mark.parametrize("position", [(1, 2), "here", (1, 2, math.nan), (1, math.inf, 0), None])
def test_positions_that_are_none(position):
    with pytest.raises(gc.errors.InvalidPoint, match="three finite numbers"):
        mesh_of(zoo.SMALL["octahedron"]).locate(position)


@pytest.mark.parametrize(
    "point",
    [
        gc.SurfacePoint.face(0, (0.5, 0.6, -0.1)),
        gc.SurfacePoint.face(0, (0.5, 0.4, 0.0)),
        gc.SurfacePoint.face(0, (0.5, math.nan, 0.5)),
        gc.SurfacePoint.face(0, (0.5, 0.5)),
        gc.SurfacePoint.face(0, "abc"),
        gc.SurfacePoint.face(8, (0.5, 0.5, 0.0)),
        gc.SurfacePoint.face(-1, (0.5, 0.5, 0.0)),
        gc.SurfacePoint.face(True, (0.5, 0.5, 0.0)),
        gc.SurfacePoint.edge(0, 1, 1.5),
        gc.SurfacePoint.edge(0, 1, -0.1),
    ],
)
def test_points_that_are_not_on_the_mesh(point):
    mesh = mesh_of(zoo.SMALL["octahedron"])
    field = gc.exact_distance(mesh, 0)
    for ask, name in (
        (lambda: gc.exact_distance(mesh, [1, point]), "source 1"),
        (lambda: gc.exact_distance(mesh, 0, targets=[point]), "target 0"),
        (lambda: gc.shortest_path(mesh, 0, point), "target"),
        (lambda: gc.shortest_path(mesh, 0, 1, [2, point]), "waypoint 1"),
        (lambda: field.path_to(point), "target"),
        (lambda: field.distance_at(point), "point"),
    ):
        with pytest.raises(gc.errors.InvalidPoint, match=name):
            ask()


def test_corners_that_there_are_not():
    with pytest.raises(gc.errors.InvalidPoint, match="corner of face 7 is 3"):
        gc.SurfacePoint.edge(7, 3, 0.5)


def test_two_points_of_one_face_have_the_segment_between_them():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    here, there = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5)), gc.SurfacePoint.face(3, (0.6, 0.3, 0.1))
    path = gc.shortest_path(mesh, here, there)
    np.testing.assert_array_equal(path.points, [mesh.position(here), mesh.position(there)])
    assert path.faces.tolist() == [3]


@zoo.each(zoo.SMALL)
def test_points_of_an_edge_by_its_ends(case):
    mesh = mesh_of(case)
    for face, corners in list(enumerate(mesh.faces.tolist()))[:30]:
        for corner in range(3):
            start, end = corners[corner], corners[(corner + 1) % 3]
            for t in (0.0, 0.3, 1 / 3, 1.0, 1 + 1e-16, -5e-17):
                point = mesh.point_on_edge(start, end, t)
                assert point == mesh.point(gc.SurfacePoint.edge(face, corner, t))
                assert point == mesh.point_on_edge(end, start, 1.0 - t)


@pytest.mark.parametrize(
    ("ends", "t", "message"),
    [
        ((0, 5), 0.5, "no edge joins the vertices 0 and 5"),
        ((0, 0), 0.5, "no edge joins"),
        ((0, -1), 0.5, "end of the edge is vertex -1"),
        ((6, 0), 0.5, "end of the edge is vertex 6"),
        ((0, 1.0), 0.5, "end of the edge is 1.0"),
        ((0, 1), 1.5, "t is 1.5"),
        ((0, 1), -1e-6, "t is -1e-06"),
        ((0, 1), math.nan, "t is nan"),
        ((0, 1), "0.5", "t is '0.5'"),
    ],
)
def test_edges_and_shares_that_there_are_not(ends, t, message):
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 2, 2], [3, 3, 3]]
    mesh = gc.TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3]])

    with pytest.raises(gc.errors.InvalidPoint, match=message):
        mesh.point_on_edge(*ends, t)


@pytest.mark.parametrize("position", [(1e51, 0, 0), (0, -1e160, 0), (0, 0, 1.7e308)])
def test_positions_too_large_for_vertices(position):
    with pytest.raises(gc.errors.InvalidPoint, match=r"at most 1e\+50 in size"):
        mesh_of(zoo.SMALL["octahedron"]).locate(position)


@pytest.mark.parametrize("weight", [0.0, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 7e-9, 1e-8, 1e-6])
def test_points_hard_by_an_irregular_edge_are_found_again(weight):
    """The line toward them ends just beyond the edge: not before it, as in the other faces."""
    mesh = mesh_of(zoo.IRREGULAR["three_faces_at_an_edge"])
    start = gc.SurfacePoint.face(1, (5e-4, 0.9685, 0.031))
    beside = gc.SurfacePoint.face(2, (0.9765 - weight, 0.0235, weight))
    there = gc.exact_distance(mesh, start)
    back = gc.exact_distance(mesh, beside)
    distance = there.distance_at(beside)
    assert back.distance_at(start) == pytest.approx(distance, rel=SAME)
    check_path(mesh, there.path_to(beside), start, beside, distance)
    check_path(mesh, back.path_to(start), beside, start, distance)


@pytest.mark.slice(8)
@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(i, marks=pytest.mark.full) for i in range(3, 20))]
)
@zoo.each({name: case for name, case in zoo.IRREGULAR.items() if name.startswith("complex")})
@pytest.mark.jit
def test_approximate_paths_take_the_right_face_beyond_an_irregular_edge(case, seed):
    """Where windows were merged, a face that the path did not come from leads nowhere."""
    mesh, rng = mesh_of(case), np.random.default_rng(seed)
    for _ in range(12):
        points = [
            gc.SurfacePoint.face(int(face), tuple(rng.dirichlet(np.ones(3)).tolist()))
            for face in rng.integers(len(mesh.faces), size=4)
        ]
        exact = gc.exact_distance(mesh, points[:2], targets=points)
        field = gc.approximate_distance(mesh, points[:2], 1e-3, targets=points, retain="paths")
        for target in [*points, *range(len(mesh.vertices))]:
            distance = exact.distance_at(target)
            length = field.path_to(target).length
            assert distance * (1 - 1e-9) - 1e-15 <= length <= distance * (1 + 1e-3) + 1e-15


@pytest.fixture
def cube() -> gc.TriangleMesh:
    case = zoo.SMALL["cube"]
    return gc.TriangleMesh(case.vertices, case.faces)


def carrier(mesh, point) -> int:
    """Of how many corners a point is made."""
    return sum(weight > 0 for weight in mesh.point(point).barycentric)


def test_paths_to_points_are_found_where_vertices_lie_beyond_the_limit():
    """Beside an edge of three faces, all of whose vertices but one are beyond it."""
    corners = [[0, 0, 0], [1, 0, 0], [0.2, 1, 0], [0.5, 0, 1], [0.8, -1, 0]]
    mesh = gc.TriangleMesh(corners, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    source = gc.SurfacePoint.face(1, (0.918, 0.062, 0.02))
    target = gc.SurfacePoint.face(2, (0.186, 0.7, 0.114))
    exact = gc.exact_distance(mesh, source).distance_at(target)
    assert exact < 0.4
    for targets in ([], [target]):
        for retain in ("paths", "windows"):
            field = gc.exact_distance(mesh, source, 0.4, targets=targets, retain=retain)
            assert np.isinf(field.distances).sum() >= 3
            path = field.path_to(target)
            assert path.length == pytest.approx(exact, rel=SAME)
            check_path(mesh, path, source, target, exact)


@pytest.mark.parametrize(("share", "corners"), [(0.9, 2), (1.1, 3)])
def test_weight_divides_what_is_on_an_edge_from_what_is_inside(cube, share, corners):
    small = share * WEIGHT
    point = gc.SurfacePoint.face(1, (0.5 - small, small, 0.5))
    assert carrier(cube, point) == corners


@pytest.mark.parametrize(("share", "is_taken"), [(0.9, True), (1.1, False)])
def test_weight_error_is_how_far_weights_may_be_off(cube, share, is_taken):
    off = share * WEIGHT_ERROR
    for weights in ((0.5, 0.5 + off, -off), (0.5, 0.3, 0.2 + off), (0.5, 0.3, 0.2 - off)):
        if is_taken:
            cube.point(gc.SurfacePoint.face(1, weights))
        else:
            with pytest.raises(gc.errors.InvalidPoint, match="weights"):
                cube.point(gc.SurfacePoint.face(1, weights))


def test_edge_steps_tell_points_on_an_edge_apart(cube):
    step = 1 / EDGE_STEPS
    at = lambda t: cube.point(gc.SurfacePoint.edge(0, 0, t))  # noqa: E731
    assert at(0.25) == at(0.25 + 0.4 * step) == at(0.25 - 0.4 * step)
    assert at(0.25) != at(0.25 + 0.6 * step)
    assert at(0.4 * step) == at(0.0)
    assert at(0.4 * step).vertex_index is not None
    assert at(1.2 * step).vertex_index is None


@zoo.each_scale
@pytest.mark.parametrize(("share", "snaps"), [(0.5, True), (3.0, False)])
def test_snap_is_how_near_a_position_must_be(scale, share, snaps):
    case = zoo.SMALL["cube"]
    mesh = gc.TriangleMesh(scale * case.vertices, case.faces)
    a, b, c = mesh.vertices[mesh.faces[0]]
    away = share * SNAP * mesh.diagonal
    inward = away * (c - 0.5 * (a + b)) / np.linalg.norm(c - 0.5 * (a + b))
    assert carrier(mesh, mesh.locate(0.6 * a + 0.4 * b + inward)) == (2 if snaps else 3)
    along = away * (b - a) / np.linalg.norm(b - a)
    assert carrier(mesh, mesh.locate(a + along)) == (1 if snaps else 2)


@zoo.each_scale
@pytest.mark.parametrize(("share", "snaps"), [(0.5, True), (3.0, False)])
def test_rounded_coordinate_is_how_near_a_position_far_from_zero_must_be(scale, share, snaps):
    mesh = gc.TriangleMesh(scale * (np.eye(3)[[2, 0, 1]] + 5e6), [[0, 1, 2]])
    a, b, c = mesh.vertices
    away = share * ROUNDED_COORDINATE * np.abs(mesh.vertices).max()
    inward = away * (c - 0.5 * (a + b)) / np.linalg.norm(c - 0.5 * (a + b))
    assert carrier(mesh, mesh.locate(0.5 * a + 0.5 * b + inward)) == (2 if snaps else 3)
    along = away * (b - a) / np.linalg.norm(b - a)
    assert carrier(mesh, mesh.locate(a + along)) == (1 if snaps else 2)


def test_rounded_sum_is_how_far_weights_stay_as_they_are(cube):
    for excess, stays in ((0.9, True), (-0.9, True), (5.0, False), (-5.0, False)):
        weights = (0.25, 0.25, 0.5 + excess * ROUNDED_SUM)
        point = cube.point(gc.SurfacePoint.face(0, weights))
        assert (point.barycentric == weights) == stays
        assert cube.point(point) == point
