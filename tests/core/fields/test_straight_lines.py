"""Straightest lines: in the plane, around a cube and a cone, there and back, and where they end."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoDirection, NoTangentPlane
from geodesic_core.kernels.paths.straight_lines import TOGETHER
from geodesic_core.tolerances import NO_DIRECTION, THROUGH_VERTEX
from tests.core.fields.test_log_map import apart, sources_of
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.path_checks import check_path

TURNS = np.linspace(0.1, 6.2, 13)


def plane(seed=0, wound_at_random=False) -> gc.TriangleMesh:
    vertices, faces = zoo.grid(9, 7, seed=seed, jitter=0.22)
    return gc.TriangleMesh(
        vertices, zoo.wound_at_random(faces, seed)[0] if wound_at_random else faces
    )


@pytest.mark.parametrize("wound_at_random", [False, True])
def test_lines_in_the_plane_are_straight_and_end_at_its_rim(wound_at_random):
    mesh = plane(3, wound_at_random)
    for start in sources_of(mesh, 9):
        place = mesh.position(start)
        for turn in TURNS:
            way = np.array([math.cos(turn), math.sin(turn), 0.0])
            to_rim = min(
                (bound - place[k]) / way[k]
                for k, bound in ((0, 9.0 * (way[0] > 0)), (1, 7.0 * (way[1] > 0)))
            )
            line = gc.trace(mesh, start, way, 2.5)
            assert line.stopped == ("length" if to_rim > 2.5 else "boundary")
            length = min(max(to_rim, 0.0), 2.5)
            np.testing.assert_allclose(line.points[-1], place + length * way, atol=1e-12)
            assert line.length == pytest.approx(length, abs=1e-12)
            if line.length > 0.0:
                check_path(mesh, line, start, line.locations[-1], line.length)


@zoo.each(zoo.SMALL)
def test_lines_are_paths_and_lead_back_to_where_they_began(case):
    mesh = mesh_of(case)
    for start in sources_of(mesh, 6):
        lines = gc.trace(mesh, [start] * 5, np.linspace(0.3, 5.1, 5), mesh.diagonal)
        for line in lines:
            if line.length == 0.0:
                continue
            check_path(mesh, line, start, line.locations[-1], line.length)
            end = line.locations[-1]
            if line.stopped != "length" or any(
                point.vertex_index is not None for point in line.locations
            ):
                continue
            back = gc.trace(mesh, end, line.end_direction + math.pi, line.length)
            missed = np.linalg.norm(back.points[-1] - line.points[0])
            assert missed <= 1e-9 * mesh.diagonal


def test_around_a_cube_lines_close():
    mesh = gc.TriangleMesh(*zoo.box_grid((3, 3, 3)))
    start = mesh.locate([1.3, 0.8, 3.0])
    around = gc.trace(mesh, start, [1.0, 0.0, 0.0], 12.0)
    np.testing.assert_allclose(around.points[-1], [1.3, 0.8, 3.0], atol=1e-12)
    frame = gc.trace(mesh, start, [1.0, 0.0, 0.0], 0.0).end_direction
    assert apart(around.end_direction, frame) <= 1e-12
    # Over six faces: a hexagon parallel to the plane x + y + z = 0, of length 3 · 3 √2.
    skew = gc.trace(mesh, mesh.locate([1.0, 0.5, 3.0]), [1.0, -1.0, 0.0], 9.0 * math.sqrt(2.0))
    np.testing.assert_allclose(skew.points[-1], [1.0, 0.5, 3.0], atol=1e-12)


@pytest.mark.parametrize(("sides", "tilt", "zigzag"), [(5, 1.2, False), (12, 0.6, True)])
def test_through_a_vertex_both_sides_have_half_of_its_angle(sides, tilt, zigzag):
    vertices, faces, _, total = zoo.cone(sides, tilt, zigzag=zigzag, splits=2)
    mesh = gc.TriangleMesh(vertices, faces)
    log_map = gc.log_map(mesh, 0)
    for v in np.flatnonzero((log_map.distances > 0.2) & (log_map.distances < 0.6))[:12].tolist():
        to_apex = gc.log_map(mesh, v)
        length = float(log_map.distances[v]) + 0.25
        line = gc.trace(mesh, v, to_apex.angles[0], length)
        passed = [point.vertex_index for point in line.locations]
        assert passed.index(0) > 0
        beyond = log_map.at(line.locations[-1])
        assert beyond.distance == pytest.approx(0.25, rel=1e-12)
        turn = (beyond.angle - log_map.angles[v]) % total
        assert turn == pytest.approx(total / 2.0, abs=1e-11)
        ends = gc.trace(mesh, v, to_apex.angles[0], length, at_vertices="stop")
        assert ends.stopped == "vertex"
        assert ends.locations[-1].vertex_index is not None


def test_along_edges_and_the_rim_lines_go_from_vertex_to_vertex():
    mesh = gc.TriangleMesh(*zoo.grid(4, 3))
    for start, way in ((0, [1.0, 0, 0]), (5, [1.0, 0, 0]), (1, [0, 1.0, 0]), (0, [1.0, 1.0, 0])):
        line = gc.trace(mesh, start, way, 9.0)
        assert line.stopped == "boundary"
        assert all(point.vertex_index is not None for point in line.locations)
        assert len(line.locations) in (4, 5)
    halfway = gc.trace(mesh, 0, [1.0, 0, 0], 2.5)
    assert halfway.points[-1].tolist() == [2.5, 0.0, 0.0]
    assert halfway.stopped == "length"


def test_lines_end_where_they_cannot_go_on():
    mesh = gc.TriangleMesh(*zoo.grid(6, 6))
    start = mesh.locate([0.5, 2.2, 0.0])
    ahead = int(mesh.locate([3.5, 2.2, 0.0]).face_index)
    assert gc.trace(mesh, start, [1.0, 0, 0], 9.0, barriers=[ahead]).stopped == "barrier"
    assert gc.trace(mesh, start, [-1.0, 0, 0], 9.0, barriers=[ahead]).stopped == "boundary"
    book = mesh_of(zoo.IRREGULAR["book_of_3"])
    spine = (book.vertices[0] + book.vertices[1]) / 2.0
    inside = gc.SurfacePoint.face(0, (0.3, 0.3, 0.4))
    line = gc.trace(book, inside, spine - book.position(inside), 9.0)
    assert line.stopped == "non_manifold"


def test_many_lines_at_once_are_those_of_single_calls():
    mesh = gc.TriangleMesh(*zoo.icosphere(2))
    starts, lengths = sources_of(mesh, 9)[:7], np.linspace(0.0, 3.0, 7)
    angles, vectors = np.linspace(0.0, 6.0, 7), np.random.default_rng(1).normal(size=(7, 3))
    for directions in (angles, vectors):
        many = gc.trace(mesh, starts, directions, lengths)
        for line, *question in zip(many, starts, directions, lengths, strict=True):
            one = gc.trace(mesh, *question)
            np.testing.assert_array_equal(line.points, one.points)
            assert (line.length, line.stopped) == (one.length, one.stopped)
            assert line.end_direction == one.end_direction
    assert gc.trace(mesh, [], 0.0, 1.0) == []


@pytest.mark.parametrize(
    ("arguments", "error", "told"),
    [
        ((5, [0.0, 0.0, 0.0], 1.0), InvalidArgument, "no direction on the surface"),
        ((5, [0.0, 0.0, 2.0], 1.0), InvalidArgument, "along the normal"),
        ((5, math.inf, 1.0), InvalidArgument, "finite angle"),
        ((5, "north", 1.0), InvalidArgument, "finite angle"),
        (([5, 6], [0.1, 0.2, 0.3, 0.4], 1.0), InvalidArgument, "or 2 of them"),
        ((5, 0.1, -1.0), InvalidArgument, "0 or more"),
        ((5, 0.1, math.nan), InvalidArgument, "0 or more"),
        (([5, 6], 0.1, [1.0, 2.0, 3.0]), InvalidArgument, "or 2 of them"),
        ((99, 0.1, 1.0), InvalidPoint, "start 0 is vertex 99"),
    ],
)
def test_what_has_no_answer_is_refused(arguments, error, told):
    with pytest.raises(error, match=told):
        gc.trace(gc.TriangleMesh(*zoo.grid(3, 3)), *arguments)
    with pytest.raises(InvalidArgument, match="at_vertices"):
        gc.trace(gc.TriangleMesh(*zoo.grid(3, 3)), 5, 0.1, 1.0, at_vertices="bend")


@pytest.mark.parametrize(("share", "meets"), [(0.1, True), (1000.0, False)])
def test_through_vertex_is_how_near_a_line_must_pass(share, meets):
    mesh = gc.TriangleMesh(*zoo.cone(12, 0.6, zigzag=True, splits=1)[:2])
    start = mesh.point(gc.SurfacePoint.face(0, (0.5, 0.3, 0.2)))
    (apex,) = np.flatnonzero(mesh.faces[0] == 0)
    to_apex = gc.log_map(mesh, start).at(int(mesh.faces[0, apex]))
    line = gc.trace(mesh, start, to_apex.angle + share * THROUGH_VERTEX, 2.0 * to_apex.distance)
    assert (0 in [point.vertex_index for point in line.locations]) == meets


@pytest.mark.parametrize(("share", "is_refused"), [(0.5, True), (2.0, False)])
def test_no_direction_is_what_is_left_of_a_normal(share, is_refused):
    mesh = gc.TriangleMesh(*zoo.grid(3, 3))
    for start in (5, gc.SurfacePoint.face(4, (0.2, 0.3, 0.5))):
        vector = [share * NO_DIRECTION, 0.0, 1.0]
        if is_refused:
            with pytest.raises(NoDirection, match="no direction"):
                gc.trace(mesh, start, vector, 0.15)
        else:
            way = gc.trace(mesh, start, vector, 0.15).points
            np.testing.assert_allclose(way[-1] - way[0], [0.15, 0.0, 0.0], atol=1e-14)


def test_errors_tell_which_of_many_lines_they_are_about():
    mesh = mesh_of(zoo.IRREGULAR["book_of_3"])
    good, bad = gc.SurfacePoint.face(0, (0.2, 0.3, 0.5)), mesh.point_on_edge(0, 1, 0.5)
    with pytest.raises(NoTangentPlane) as refusal:
        gc.trace(mesh, [good, good, bad], 0.1, 1.0)
    assert refusal.value.index == 2
    with pytest.raises(NoDirection) as refusal:
        gc.trace(mesh, [good, good], [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], 1.0)
    assert refusal.value.index == 1


def test_a_vertex_of_no_face_has_no_tangent_plane():
    mesh = gc.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
    with pytest.raises(NoTangentPlane, match="vertex 3 has no tangent plane, as no free face"):
        gc.trace(mesh, 3, 0.0, 1.0)
    with pytest.raises(NoTangentPlane, match="no free face has an angle"):
        gc.log_map(mesh, 3)


FLAT = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1.5, 0, 0]]
"""Points of a line: whatever faces join them have no area"""


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.5, 3.0, math.pi, 5.0])
@pytest.mark.parametrize("start", range(4))
def test_lines_in_faces_without_area_end(start, angle):
    line = gc.trace(gc.TriangleMesh(FLAT[:3], [[0, 1, 2]]), 1, math.pi, 0.25)
    assert line.stopped == "length"
    assert line.points.tolist() == [[1.0, 0.0, 0.0], [0.75, 0.0, 0.0]]
    closed = gc.TriangleMesh(FLAT, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    try:
        line = gc.trace(closed, start, angle, 0.25, deadline_s=60.0)
    except NoTangentPlane:
        assert start in (0, 2)  # where all angles are 0
        return
    if line.stopped == "collapsed":
        assert line.length < 0.25
        assert len(line.faces) > len(closed.faces)
    else:
        assert line.stopped == "length"
        assert line.length == 0.25


def test_more_lines_than_take_turns_are_those_of_single_calls():
    mesh = plane(1)
    starts = sources_of(mesh, 3 * TOGETHER)
    turns = np.random.default_rng(2).uniform(0.0, 6.0, len(starts))
    lengths = np.linspace(0.0, 12.0, len(starts))[::-1]
    for stops in ("straight", "stop"):
        many = gc.trace(mesh, starts, turns, lengths, at_vertices=stops)
        for line, *question in zip(many, starts, turns, lengths, strict=True):
            one = gc.trace(mesh, *question, at_vertices=stops)
            np.testing.assert_array_equal(line.points, one.points)
            np.testing.assert_array_equal(line.faces, one.faces)
            assert (line.length, line.stopped) == (one.length, one.stopped)


def test_a_full_trail_is_continued(monkeypatch):
    mesh = gc.TriangleMesh(*zoo.box_grid((3, 3, 3)))
    asked = [gc.SurfacePoint.face(0, (0.2, 0.3, 0.5))] * 40, np.linspace(0.1, 6.0, 40), 30.0
    at_once = gc.trace(mesh, *asked)
    monkeypatch.setattr("geodesic_core.fields.straight_lines._TRAIL", 4 * TOGETHER)
    for line, other in zip(gc.trace(mesh, *asked), at_once, strict=True):
        np.testing.assert_array_equal(line.points, other.points)
        np.testing.assert_array_equal(line.faces, other.faces)
