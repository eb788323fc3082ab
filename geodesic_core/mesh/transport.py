"""Parallel transport: a vector is carried along a line, without turning on the way.

In a face, and over an edge, it keeps its angle in the unfolded plane. At a vertex it keeps its
angle with the line in the tangent plane, to which the angles around the vertex are stretched or
shrunk. These sum to another total than a full turn, and no other way is the same in both
directions. Where the line is straight on one side of the vertex, the vector goes past it there.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from geodesic_core.kernels.mesh.frames import axis_of
from geodesic_core.kernels.mesh.half_edges import APEX_ANGLE, TAIL, following, point_in_frame
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.frames import frame_at
from geodesic_core.mesh.surface_point import SurfacePoint, Weights
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import STRAIGHT_THROUGH


def carried_along(
    mesh: TriangleMesh, locations: tuple[SurfacePoint, ...], faces: Any, angle: float
) -> float:
    """Return a vector at the first point of a polyline as it is carried to the last one.

    Parameters
    ----------
    mesh
        The surface.
    locations
        Canonical points.
    faces
        (K - 1,) the face of each segment.
    angle
        Radians in the frame of the first point.

    Returns
    -------
    float
        Radians in the frame of the last point.

    Raises
    ------
    InvalidPoint
        One of the ends, or a vertex on the way, has no tangent plane.
    """
    first, last = locations[0], locations[-1]
    turn = frame_at(mesh, first).turn_of(angle)
    end = frame_at(mesh, last)
    if len(locations) == 1:
        return end.angle_of(turn)
    inner = mesh.inner_face[faces].tolist()
    ways = [
        _way(mesh, face, *points) for face, points in zip(inner, pairwise(locations), strict=True)
    ]
    turn = _from_point(mesh, first, turn, inner[0], ways[0])
    for i, (face, following_face) in enumerate(pairwise(inner)):
        point = locations[i + 1]
        if point.vertex_index is None:
            turn = _over_edge(mesh, point, turn, face, following_face)
        elif _goes_straight(mesh, point, inner[i : i + 2], ways[i : i + 2]):
            turn += ways[i + 1] - ways[i]
        else:
            turn = _to_point(mesh, point, turn, face, ways[i])
            turn = _from_point(mesh, point, turn, following_face, ways[i + 1])
    return end.angle_of(_to_point(mesh, last, turn, inner[-1], ways[-1]))


def _way(mesh: TriangleMesh, face: int, start: SurfacePoint, end: SurfacePoint) -> float:
    """Return the direction of a segment in the frame of its inner face's first half-edge."""
    geometry = mesh.topology.geometry
    (x0, y0), (x1, y1) = (
        point_in_frame(geometry, 3 * face, np.array(weights_by_face(mesh, point)[face]))
        for point in (start, end)
    )
    return math.atan2(y1 - y0, x1 - x0)


def is_straight(back: Any, onward: Any, total: Any, is_closed: Any) -> Any:
    """Return whether lines through vertices are straight on one side, from angles of their fans.

    There a vector is carried past the vertex, on that side.
    """
    between = np.where(is_closed, np.mod(onward - back, total), np.abs(onward - back))
    beyond = np.where(is_closed, total - between, between)
    return np.minimum(abs(between - math.pi), abs(beyond - math.pi)) <= STRAIGHT_THROUGH


def _goes_straight(
    mesh: TriangleMesh, vertex: SurfacePoint, faces: list[int], ways: list[float]
) -> bool:
    """Tell whether a line is straight on one side of a vertex; through two faces, by its ways."""
    frame = frame_at(mesh, vertex)
    back = _angle_at(mesh, vertex, faces[0], ways[0] + math.pi)
    onward = _angle_at(mesh, vertex, faces[1], ways[1])
    return bool(is_straight(back, onward, frame.total_angle, frame.is_closed))


def _from_point(
    mesh: TriangleMesh, point: SurfacePoint, turn: float, face: int, way: float
) -> float:
    """Return a vector at a point, in its tangent plane, as one in the frame of a face ahead."""
    if point.vertex_index is not None:
        scale: float = frame_at(mesh, point).scale
        return way + turn - scale * _angle_at(mesh, point, face, way)
    faces = weights_by_face(mesh, point)
    number = min(max(int(turn // math.pi), 0), len(faces) - 1)
    into, weights = list(faces.items())[number]
    vector = turn - number * math.pi + _axis_of(mesh, _base_of(into, weights), 3 * into)
    return _over_edge(mesh, point, vector, into, face)


def _to_point(
    mesh: TriangleMesh, point: SurfacePoint, vector: float, face: int, way: float
) -> float:
    """Return a vector in the frame of a face as one in the tangent plane of a point; the inverse.

    ``way`` is the direction of the segment that ends there.
    """
    if point.vertex_index is not None:
        back = _angle_at(mesh, point, face, way + math.pi)
        scale: float = frame_at(mesh, point).scale
        return scale * back + math.pi + vector - way
    faces = weights_by_face(mesh, point)
    for number, (into, weights) in enumerate(faces.items()):
        turned = _over_edge(mesh, point, vector, face, into)
        turn = (turned - _axis_of(mesh, _base_of(into, weights), 3 * into)) % (2.0 * math.pi)
        if turn <= math.pi:
            return turn + number * math.pi
    return turn


def _angle_at(mesh: TriangleMesh, vertex: SurfacePoint, face: int, way: float) -> float:
    """Return the angle in the unfolded fan of a vertex of a way into one of its faces."""
    topology = mesh.topology
    node = topology.inner_vertex[vertex.vertex_index]
    (h,) = (h for h in range(3 * face, 3 * face + 3) if topology.links[h, TAIL] == node)
    inward = (way - _axis_of(mesh, h, 3 * face) + 0.5 * math.pi) % (2.0 * math.pi) - 0.5 * math.pi
    return float(topology.geometry[following(h), APEX_ANGLE]) + inward


def _over_edge(
    mesh: TriangleMesh, point: SurfacePoint, vector: float, face: int, beyond: int
) -> float:
    """Return a vector in the frame of a face as one in that of another at a point of its edge."""
    if face == beyond:
        return vector
    faces = weights_by_face(mesh, point)
    h, g = (_base_of(each, faces[each]) for each in (face, beyond))
    turn = vector - _axis_of(mesh, h, 3 * face)
    tails = mesh.topology.links[[h, g], TAIL]
    return _axis_of(mesh, g, 3 * beyond) + (-turn if tails[0] == tails[1] else turn + math.pi)


def _base_of(face: int, weights: Weights) -> int:
    """Return the half-edge of an inner face that a point with these weights lies on, or its first.

    The kernels measure angles at the point from there.
    """
    corner = weights.index(0.0) if 0.0 in weights else 2
    return 3 * face + (corner + 1) % 3


def _axis_of(mesh: TriangleMesh, h: int, base: int) -> float:
    return float(axis_of(mesh.topology.geometry, h, base))
