"""Parallel transport: two ways to the same vector, there and back, around vertices, on spheres."""

import copy
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.kernels.mesh.half_edges import FANS
from geodesic_core.mesh.transport import is_straight
from geodesic_core.tolerances import STRAIGHT_THROUGH
from tests.core.fields.test_log_map import ALL, apart, sources_of
from tests.support import zoo
from tests.support.meshes import mesh_of

ROUNDED = 1e-10
"""Radians in the tangent plane"""

ANGLE = 0.7


def turns(mesh: gc.TriangleMesh, point: gc.SurfacePoint, angles) -> np.ndarray:
    """Angles on the surface at a point as angles in its tangent plane."""
    v = point.vertex_index
    return np.asarray(angles) * (1.0 if v is None else mesh.tangent_frames().scales[v])


def without_plane(mesh: gc.TriangleMesh) -> set[int]:
    """Vertices at which several fans of faces meet."""
    return set(np.flatnonzero(mesh.topology.flags[mesh.topology.inner_vertex] & FANS).tolist())


def leaves_as_told(log_map: gc.LogMap, path: gc.GeodesicPath, v: int) -> bool:
    """Whether a path leaves its source in the direction of the vertex."""
    way = path.points[1] - path.points[0]
    reach = 0.1 * float(np.linalg.norm(way))
    line = gc.trace(log_map.mesh, log_map.source, log_map.angles[v], reach)
    return bool(np.linalg.norm(line.points[-1] - path.points[0] - 0.1 * way) <= 1e-3 * reach)


@pytest.mark.jit
@pytest.mark.parametrize("wound_at_random", [False, True])
def test_in_the_plane_vectors_stay_as_they_are(wound_at_random):
    vertices, faces = zoo.grid(9, 7, seed=2, jitter=0.22)
    mesh = gc.TriangleMesh(vertices, zoo.wound_at_random(faces, 2)[0] if wound_at_random else faces)
    frames = mesh.tangent_frames()
    for source in sources_of(mesh, 9):
        carried = frames.vectors(gc.exact_distance(mesh, source).transport(ANGLE))
        line = gc.trace(mesh, source, ANGLE, 1e-3)
        if line.length > 0.0:
            way = line.points[-1] - line.points[0]
            aligned = way / np.linalg.norm(way)
            assert np.abs(carried - aligned).max() <= ROUNDED
        assert np.abs(carried - carried[0]).max() <= ROUNDED
        for end in sources_of(mesh, 6, 1):
            path = gc.shortest_path(mesh, source, end)
            there = gc.trace(mesh, end, path.transport(ANGLE), 1e-3)
            if line.length > 0.0 and there.length > 0.0:
                onward = there.points[-1] - there.points[0]
                assert np.abs(onward - way * (there.length / line.length)).max() <= ROUNDED


@zoo.each(ALL)
def test_the_field_carries_vectors_as_each_of_its_paths(case):
    mesh = mesh_of(case)
    broken = without_plane(mesh)
    for source in sources_of(mesh, 4):
        field = gc.exact_distance(mesh, source)
        carried, log_map = field.transport(ANGLE), field.log_map()
        reached = np.flatnonzero(np.isfinite(field.distances) & (field.distances > 0.0))
        for v in reached[:: max(1, len(reached) // 40)].tolist():
            path = field.path_to(v)
            if {point.vertex_index for point in path.locations[1:]} & broken:
                with pytest.raises(InvalidPoint, match="has no tangent plane"):
                    path.transport(ANGLE)
                continue
            between = [p.vertex_index for p in path.locations[1:-1] if p.vertex_index is not None]
            if not leaves_as_told(log_map, path, v):
                continue  # there is another path as short, which the field knows
            shortest = min(np.linalg.norm(np.diff(path.points, axis=0), axis=1))
            # Where a path passes a vertex by less than its length rounds, it may go through it.
            rounding = 1e-12 * mesh.diagonal / shortest + (1e-5 if between else 0.0)
            error = apart(
                *(turns(mesh, mesh.point(v), a) for a in (carried[v], path.transport(ANGLE)))
            )
            assert error <= ROUNDED + rounding


@zoo.each(ALL)
def test_there_and_back_a_vector_is_the_same(case):
    mesh = mesh_of(case)
    points = sources_of(mesh, 6)
    for source, end in zip(points, reversed(points), strict=True):
        for method in (gc.exact_distance, gc.fast_distance, gc.approximate_distance):
            field = method(mesh, source, targets=[end], retain="paths")
            if not math.isfinite(field.distance_at(end)):
                continue
            path = field.path_to(end)
            try:
                there = path.transport(ANGLE)
            except InvalidPoint:
                continue
            back = path.reversed().transport(there)
            assert apart(turns(mesh, source, back), turns(mesh, source, ANGLE)) <= ROUNDED


@pytest.mark.parametrize(("sides", "tilt"), [(5, 1.2), (9, 0.4), (12, 0.9)])
def test_around_a_vertex_a_vector_turns_by_the_angle_defect(sides, tilt):
    vertices, faces, _, total = zoo.cone(sides, tilt, splits=3)
    mesh = gc.TriangleMesh(vertices, faces)
    rim = [
        mesh.locate([math.cos(turn), math.sin(turn), vertices[0, 2] * 0.5])
        for turn in 2.0 * math.pi * np.arange(7) / 7
    ]
    field = [gc.shortest_path(mesh, a, b) for a, b in zip(rim, [*rim[1:], rim[0]], strict=True)]
    angle = ANGLE
    for path in field:
        assert all(point.vertex_index != 0 for point in path.locations)
        angle = path.transport(angle)
    assert apart(angle - ANGLE, 2.0 * math.pi - total) <= ROUNDED


@pytest.mark.jit
def test_on_spheres_transport_converges():
    """Against the vector that the great circle carries: it turns with the tangent."""
    errors = []
    for faces in (320, 1280, 5120):
        mesh = gc.samples.sphere(faces)
        frames, up = (
            mesh.tangent_frames(),
            mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None],
        )
        begin = frames.vectors(np.full(len(mesh.vertices), ANGLE))[0]
        carried = frames.vectors(gc.exact_distance(mesh, 0).transport(ANGLE))
        axis = np.cross(up[0], up)
        cosine, sine = up @ up[0], np.linalg.norm(axis, axis=1)
        near = (sine > 1e-3) & (cosine > -0.5)
        axis = axis[near] / sine[near, None]
        begin = begin - (begin @ up[0]) * up[0]
        begin /= np.linalg.norm(begin)
        true = (
            begin * cosine[near, None]
            + np.cross(axis, begin) * sine[near, None]
            + axis * (axis @ begin)[:, None] * (1.0 - cosine[near, None])
        )
        errors.append(float(np.linalg.norm(carried[near] - true, axis=1).mean()))
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


def test_a_path_of_no_length_leaves_a_vector_alone():
    mesh = gc.samples.sphere(80)
    for point in sources_of(mesh, 6):
        path = gc.shortest_path(mesh, point, point)
        assert apart(path.transport(ANGLE), ANGLE) <= 1e-15


def test_barriers_and_limits_hold():
    mesh = gc.samples.plane(50)
    field = gc.exact_distance(mesh, 0, 0.5, barriers=[7])
    carried = field.transport(ANGLE)
    np.testing.assert_array_equal(np.isfinite(carried), np.isfinite(field.distances))


@pytest.mark.parametrize(("share", "is_past"), [(0.5, True), (1.5, False)])
def test_straight_through_is_how_far_a_path_may_bend_and_go_past_a_vertex(share, is_past):
    """On either side of a saddle and of a tip, and inside a boundary, but not around it."""
    turn = math.pi + share * STRAIGHT_THROUGH
    for total in (1.6 * math.pi, 2.5 * math.pi):
        for back, onward in ((0.3, 0.3 + turn), (0.3 + turn, 0.3)):
            assert is_straight(back, onward % total, total, True) == is_past
    assert is_straight(0.1, 0.1 + turn, 1.5 * math.pi, False) == is_past
    assert not is_straight(0.1, 0.1 + 0.5 * math.pi, 1.5 * math.pi, False)


@pytest.mark.parametrize("angle", [math.nan, math.inf, "north", None, [1.0], True])
def test_an_angle_must_be_a_finite_number(angle):
    mesh = gc.samples.plane(2)
    for carries in (gc.exact_distance(mesh, 0), gc.shortest_path(mesh, 0, 3)):
        with pytest.raises(InvalidArgument, match="it must be a finite number, in radians"):
            carries.transport(angle)


def test_only_exact_fields_of_one_point_carry_vectors():
    mesh = gc.samples.plane(8)
    with pytest.raises(InvalidArgument, match="only exact fields have transport"):
        gc.fast_distance(mesh, 0).transport(ANGLE)
    for sources in ([0, 1], gc.Source(0, 0.5), gc.Curve([0, 1])):
        with pytest.raises(InvalidArgument, match="transport has one source"):
            gc.exact_distance(mesh, sources).transport(ANGLE)


def test_a_copy_of_a_path_has_no_mesh_to_carry_along():
    path = copy.copy(gc.shortest_path(gc.samples.plane(2), 0, 3))
    with pytest.raises(InvalidArgument, match="no mesh"):
        path.transport(ANGLE)
