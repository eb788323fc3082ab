"""The log map: directions against the plane, the traced path, and the straight line back."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoDirection, NoTangentPlane
from geodesic_core.tolerances import ROUNDED_TURN
from tests.support import zoo
from tests.support.meshes import MESHES, mesh_of

ANGLE = 1e-12
"""Radians by which a direction may be off."""

MISSED = 1e-12
"""How far a straight line may miss its vertex, as a share of the diagonal."""

ALL = zoo.SMALL | zoo.KNOWN | zoo.IRREGULAR


def apart(angles, others):
    """How far directions are apart, modulo a full turn."""
    return np.abs((np.asarray(angles) - others + math.pi) % (2.0 * math.pi) - math.pi)


def sources_of(mesh: gc.TriangleMesh, count: int, seed: int = 0) -> list[gc.SurfacePoint]:
    """Points at vertices, on edges and in faces, all of which have a tangent plane."""
    rng, found = np.random.default_rng(seed), []
    for face in rng.permutation(len(mesh.faces)).tolist():
        weights = tuple((0.1 + 0.7 * rng.dirichlet(np.ones(3))).tolist())
        for point in (
            int(mesh.faces[face, 0]),
            gc.SurfacePoint.edge(face, 1, 0.37),
            gc.SurfacePoint.face(face, weights),
        ):
            try:
                gc.trace(mesh, point, 0.0, 0.0)
                found.append(mesh.point(point))
            except InvalidPoint:
                continue
        if len(found) >= count:
            break
    return found


def missed(log_map: gc.LogMap, vertices: np.ndarray, beside: float = 0.0) -> np.ndarray:
    """How far straight lines miss vertices, each led by its own direction, or beside it."""
    mesh = log_map.mesh
    angles = log_map.angles[vertices] + beside
    lines = gc.trace(mesh, [log_map.source] * len(vertices), angles, log_map.distances[vertices])
    ends = np.array([line.points[-1] for line in lines])
    return np.linalg.norm(ends - mesh.vertices[vertices], axis=1) / mesh.diagonal


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("wound_at_random", [False, True])
def test_directions_in_the_plane_are_those_of_straight_lines(seed, wound_at_random):
    vertices, faces = zoo.grid(9, 7, seed=seed, jitter=0.22)
    mesh = gc.TriangleMesh(
        vertices, zoo.wound_at_random(faces, seed)[0] if wound_at_random else faces
    )
    for source in sources_of(mesh, 9, seed):
        log_map = gc.log_map(mesh, source)
        away = mesh.vertices - mesh.position(source)
        seen = np.flatnonzero((np.abs(away) > 0).any(axis=1))
        true = np.arctan2(away[seen, 1], away[seen, 0])
        corners = mesh.vertices[mesh.faces[source.face_index]]
        is_from_below = np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] < 0.0
        angles = log_map.angles[seen] * (-1.0 if is_from_below else 1.0)
        assert apart(angles - angles[0], true - true[0]).max() <= ANGLE
        assert log_map.angles[seen].min() >= 0.0
        assert log_map.angles[seen].max() <= log_map.total_angle + ANGLE


@zoo.each(ALL)
def test_distances_are_those_of_the_exact_sweep_and_paths_leave_as_told(case):
    mesh = mesh_of(case)
    for source in sources_of(mesh, 6):
        log_map, field = gc.log_map(mesh, source), gc.exact_distance(mesh, source)
        np.testing.assert_array_equal(log_map.distances, field.distances)
        is_away = (log_map.distances > 0.0) & np.isfinite(log_map.distances)
        np.testing.assert_array_equal(np.isfinite(log_map.angles), is_away)
        if min(source.barycentric) == 0.0:
            continue
        corners = mesh.vertices[mesh.faces[source.face_index]]
        x_axis = corners[1] - corners[0]
        y_axis = np.cross(np.cross(x_axis, corners[2] - corners[0]), x_axis)
        x_axis, y_axis = (axis / np.linalg.norm(axis) for axis in (x_axis, y_axis))
        for v in np.flatnonzero(is_away)[:40].tolist():
            path = field.path_to(v)
            way = path.points[1] - path.points[0]
            true = math.atan2(way @ y_axis, way @ x_axis)
            rounding = 1e-13 * mesh.diagonal / np.linalg.norm(way)
            passed = sum(each.vertex_index is not None for each in path.locations[1:-1])
            # A path goes through a vertex that lies beside it by no more than its length rounds.
            detour = 1e-5 if passed else 0.0
            assert apart(log_map.angles[v], true) <= ANGLE + rounding + detour
            assert log_map.bends[v] <= passed


@zoo.each(ALL)
def test_straight_lines_lead_back_to_each_vertex_up_to_the_first_bend(case):
    mesh = mesh_of(case)
    for source in sources_of(mesh, 6, 1):
        log_map = gc.log_map(mesh, source)
        is_seen = (log_map.bends == 0) & (log_map.distances > 0.0)
        seen = np.flatnonzero(is_seen & np.isfinite(log_map.angles))[:60]
        if len(seen) == 0:
            continue
        # Where a line meets a vertex, it goes on at once on either side of it, but not through it.
        error = np.min([missed(log_map, seen, beside) for beside in (0.0, -1e-12, 1e-12)], axis=0)
        lines = gc.trace(mesh, [source] * len(seen), log_map.angles[seen], log_map.distances[seen])
        goes_on = np.array([line.stopped != "non_manifold" for line in lines])
        assert error[goes_on].max(initial=0.0) <= MISSED


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", sorted(path.name for path in MESHES.glob("*.[op][bl][jy]")))
def test_straight_lines_lead_back_on_real_meshes(name):
    mesh, rng = gc.load_mesh(MESHES / name), np.random.default_rng(3)
    for source in sources_of(mesh, 9, 2):
        log_map = gc.log_map(mesh, source)
        seen = np.flatnonzero((log_map.bends == 0) & np.isfinite(log_map.angles))
        seen = rng.choice(seen, min(200, len(seen)), replace=False)
        error = np.min([missed(log_map, seen, beside) for beside in (0.0, -1e-12, 1e-12)], axis=0)
        assert error.max(initial=0.0) <= MISSED


@pytest.mark.parametrize(("sides", "tilt"), [(5, 1.2), (6, 0.3), (12, 0.05)])
def test_on_a_cone_unrolled_directions_are_those_of_the_plane(sides, tilt):
    vertices, faces, polar, total = zoo.cone(sides, tilt, splits=2)
    mesh, (radius, angle) = gc.TriangleMesh(vertices, faces), polar.T
    source = int(np.argmax((radius < 0.6) & (radius > 0.2)))
    log_map = gc.log_map(mesh, source)
    turn = (angle - angle[source] + total / 2.0) % total - total / 2.0
    x = radius * np.cos(turn) - radius[source]
    y = radius * np.sin(turn)
    seen = np.flatnonzero((np.abs(turn) < total / 2.0 - 1e-9) & (np.hypot(x, y) > 1e-9))
    true = np.arctan2(y[seen], x[seen])
    found = log_map.angles[seen]
    assert apart(found - found[0], true - true[0]).max() <= ANGLE
    apex = gc.log_map(mesh, 0)
    assert apex.total_angle == pytest.approx(total, rel=1e-14)
    seen = np.flatnonzero(radius > 0.0)
    scaled = 2.0 * math.pi / total
    first = apex.angles[seen] - apex.angles[seen[0]]
    assert apart(first * scaled, (angle[seen] - angle[seen[0]]) * scaled).max() <= ANGLE


def test_coordinates_hold_a_full_turn_or_true_angles():
    vertices, faces, _, total = zoo.cone(6, 0.3, splits=2)
    mesh = gc.TriangleMesh(vertices, faces)
    full, true = gc.log_map(mesh, 0), gc.log_map(mesh, 0, rescale=False)
    for log_map, scale in ((full, 2.0 * math.pi / total), (true, 1.0)):
        away = log_map.coordinates[1:]
        np.testing.assert_allclose(np.hypot(*away.T), log_map.distances[1:], rtol=1e-14)
        angles = np.arctan2(away[:, 1], away[:, 0])
        assert apart(angles, log_map.angles[1:] * scale).max() <= 1e-14
    assert full.coordinates[0].tolist() == [0.0, 0.0]
    saddle = gc.TriangleMesh(*zoo.cone(6, 0.5, zigzag=True, splits=1)[:2])
    with pytest.raises(InvalidArgument, match="more than a full turn"):
        gc.log_map(saddle, 0, rescale=False)


@pytest.mark.parametrize("source", [60, gc.SurfacePoint.face(30, (0.2, 0.3, 0.5))])
def test_the_x_axis_is_a_point_or_a_vector(source):
    mesh = gc.TriangleMesh(*zoo.grid(9, 9, seed=1, jitter=0.2))
    away = mesh.vertices - mesh.position(source)
    seen = np.flatnonzero(np.hypot(*away[:, :2].T) > 0.0)
    true = np.arctan2(away[seen, 1], away[seen, 0])
    along = gc.log_map(mesh, source, x_axis=[3.0, 4.0, 9.0])
    assert apart(along.angles[seen], true - math.atan2(4.0, 3.0)).max() <= ANGLE
    for point in (7, gc.SurfacePoint.face(50, (0.5, 0.3, 0.2))):
        toward = gc.log_map(mesh, source, x_axis=point)
        way = mesh.position(point) - mesh.position(source)
        assert apart(toward.angles[seen], true - math.atan2(way[1], way[0])).max() <= ANGLE
        assert apart(toward.at(point).angle, 0.0) <= ANGLE


@pytest.mark.jit
def test_any_point_has_its_place_and_exp_leads_there():
    mesh = gc.TriangleMesh(*zoo.icosphere(2))
    for source in sources_of(mesh, 6):
        log_map = gc.log_map(mesh, source, x_axis=[0.3, 0.5, -0.7])
        for target in sources_of(mesh, 6, 5):
            distance, angle = log_map.at(target)
            assert distance == pytest.approx(
                gc.shortest_path(mesh, source, target).length, rel=1e-13
            )
            if distance == 0.0:
                continue
            turn = angle * 2.0 * math.pi / log_map.total_angle
            (end,) = log_map.exp([distance * math.cos(turn), distance * math.sin(turn)])
            away = mesh.position(end) - mesh.position(target)
            assert np.linalg.norm(away) <= 1e-11


def test_points_beyond_the_limit_have_no_place():
    mesh = gc.TriangleMesh(*zoo.grid(6, 6))
    log_map = gc.log_map(mesh, 0, max_distance=2.0)
    for place in ([1.1, 0.3, 0.0], [1.9, 0.9, 0.0], [3.2, 2.1, 0.0]):
        distance, angle = log_map.at(mesh.locate(place))
        true = math.hypot(*place)
        if true <= 2.0:
            assert distance == pytest.approx(true, rel=1e-14)
            assert apart(angle, math.atan2(place[1], place[0])) <= ANGLE
        else:
            assert (distance, math.isnan(angle)) == (math.inf, True)


def test_what_is_not_reached_has_no_direction():
    mesh = gc.TriangleMesh(*zoo.joined(zoo.grid(3, 3), zoo.grid(2, 2)))
    log_map = gc.log_map(mesh, 0, max_distance=2.0)
    beyond = ~np.isfinite(log_map.distances)
    assert beyond[16:].all()
    assert beyond[:16].any()
    assert np.isnan(log_map.angles[beyond]).all()
    assert (log_map.bends[beyond] == -1).all()
    assert np.isnan(log_map.coordinates[beyond]).all()
    assert repr(log_map) == f"LogMap(from vertex 0, {(~beyond).sum()} of 25 vertices reached)"


@pytest.mark.parametrize(
    ("arguments", "error", "told"),
    [
        ({"source": 0}, InvalidPoint, "no tangent plane"),
        ({"source": 99}, InvalidPoint, "vertices are numbered"),
        ({"source": 5, "x_axis": [0.0, 0.0, 0.0]}, InvalidArgument, "no direction"),
        ({"source": 5, "x_axis": [1.0, 0.0]}, InvalidArgument, "three finite numbers"),
        ({"source": 5, "x_axis": [1.0, 0.0, math.nan]}, InvalidArgument, "three finite numbers"),
        ({"source": 5, "x_axis": "north"}, InvalidArgument, "three finite numbers"),
        ({"source": 5, "x_axis": 5}, InvalidPoint, "the source itself"),
        ({"source": 5, "max_distance": -1.0}, InvalidArgument, "max_distance"),
    ],
)
def test_what_has_no_answer_is_refused(arguments, error, told):
    book = mesh_of(zoo.IRREGULAR["book_of_3"])
    with pytest.raises(error, match=told):
        gc.log_map(book, **arguments)


def test_a_point_on_an_edge_of_three_faces_has_no_plane():
    book = mesh_of(zoo.IRREGULAR["book_of_3"])
    with pytest.raises(NoTangentPlane, match="3 faces meet at an edge"):
        gc.log_map(book, book.point_on_edge(0, 1, 0.5))
    normal = np.cross(*(book.vertices[book.faces[0, [1, 2]]] - book.vertices[book.faces[0, 0]]))
    with pytest.raises(NoDirection, match="no direction"):
        gc.log_map(book, gc.SurfacePoint.face(0, (0.2, 0.3, 0.5)), x_axis=normal)


@pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource")
@pytest.mark.parametrize(("vertex", "barriers"), [(4, []), (0, [0])])
def test_a_vertex_that_is_in_no_face_has_no_plane(vertex, barriers):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [9, 9, 9]]
    mesh = gc.TriangleMesh(corners, [[0, 1, 2], [1, 3, 2]]).with_barriers(barriers)
    told = f"vertex {vertex} has no tangent plane, as no free face"
    for call in (gc.log_map, gc.relax_points, gc.mean_point):
        with pytest.raises(NoTangentPlane, match=told):
            call(mesh, [vertex] if call is not gc.log_map else vertex)
    with pytest.raises(NoTangentPlane, match=told):
        gc.trace(mesh, vertex, 0.0, 1.0)


@pytest.mark.parametrize(("share", "is_refused"), [(0.5, False), (2.0, True)])
def test_rounded_turn_is_the_most_that_a_flat_vertex_exceeds_a_turn_by(share, is_refused):
    low, high = 0.0, 0.1
    for _ in range(60):  # the tilt at which the angles are so much more than a turn
        tilt = 0.5 * (low + high)
        excess = zoo.cone(6, tilt, zigzag=True)[3] / (2.0 * math.pi) - 1.0
        low, high = (tilt, high) if excess < share * ROUNDED_TURN else (low, tilt)
    mesh = gc.TriangleMesh(*zoo.cone(6, low, zigzag=True)[:2])
    if is_refused:
        with pytest.raises(InvalidArgument, match="more than a full turn"):
            gc.log_map(mesh, 0, rescale=False)
    else:
        assert np.isfinite(gc.log_map(mesh, 0, rescale=False).coordinates).all()


def test_fields_have_the_log_map_of_their_source():
    mesh = gc.TriangleMesh(*zoo.icosphere(2))
    for source in sources_of(mesh, 3):
        field, log_map = gc.exact_distance(mesh, source, 1.5), gc.log_map(mesh, source)
        of_field = field.log_map()
        near = np.isfinite(field.distances)
        np.testing.assert_array_equal(of_field.distances, field.distances)
        np.testing.assert_array_equal(of_field.angles[near], log_map.angles[near])
        np.testing.assert_array_equal(of_field.bends[near], log_map.bends[near])
    for field, told in (
        (gc.approximate_distance(mesh, 0), "only exact fields"),
        (gc.fast_distance(mesh, 0), "only exact fields"),
        (gc.exact_distance(mesh, [0, 1]), "one source"),
        (gc.exact_distance(mesh, gc.Source(0, start_distance=0.5)), "one source"),
        (gc.exact_distance(mesh, gc.Curve(mesh.faces[0, :2].tolist())), "one source"),
    ):
        with pytest.raises(InvalidArgument, match=told):
            field.log_map()
