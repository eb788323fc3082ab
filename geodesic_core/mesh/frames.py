"""Frames: from where directions at a point of the surface are measured, and in which sense.

Angles are measured on the surface, counter-clockwise seen from outside, as the caller wound the
faces. Kernels measure them in the unfolded fan of a vertex, or face by face around a point of an
edge (`kernels.front.directions`), in faces that may be turned over.
"""

import math
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import NoTangentPlane
from geodesic_core.kernels.mesh.half_edges import (
    BOUNDARY,
    COS_LEFT,
    COS_RIGHT,
    FANS,
    HEAD,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
)
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.surface_point import SurfacePoint, Weights
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.mesh.vertex_frames import vertex_frames
from geodesic_core.tolerances import NO_DIRECTION


@dataclass(frozen=True)
class Frame:
    """From where, and in which sense, angles at a point are measured."""

    start: float
    """The kernels' angle at which it begins, radians"""
    sense: int
    """1, or -1 where the kernels see the surface from inside"""
    total_angle: float
    """Sum of the angles of the surface at the point, radians"""
    is_closed: bool
    """Whether the surface closes around the point: then angles are from 0 up to the total angle"""

    @property
    def scale(self) -> float:
        """Angle in the tangent plane for one of the surface, see `TangentFrames`."""
        turn = 2.0 * math.pi
        return turn / self.total_angle if self.is_closed or self.total_angle > turn else 1.0

    def angles(self, kernel_angles: Floats) -> Floats:
        """Return angles from the kernels' own."""
        angles = self.sense * (kernel_angles - self.start)
        return np.mod(angles, self.total_angle) if self.is_closed else angles

    def kernel_angles(self, angles: Floats) -> Floats:
        """Return the kernels' angles, the inverse of `angles`."""
        kernel_angles = self.start + self.sense * angles
        return np.mod(kernel_angles, self.total_angle) if self.is_closed else kernel_angles

    def turn_of(self, angle: float) -> float:
        """Return an angle in the tangent plane, in the kernels' sense and from their beginning."""
        return self.scale * (self.start + self.sense * angle)

    def angle_of(self, turn: float) -> float:
        """Return the angle of a turn in the tangent plane, the inverse of `turn_of`."""
        return self.sense * (turn - self.scale * self.start) % (2.0 * math.pi) / self.scale


def frame_at(mesh: TriangleMesh, point: SurfacePoint) -> Frame:
    """Return the frame of a canonical point.

    At a vertex that the surface closes around, angles begin at the edge that leaves it in its
    lowest face, as that is wound; elsewhere in a face, or on an edge, parallel to the edge from
    corner 0 to corner 1 of the lowest face. At a boundary they begin where the surface does.
    """
    return _at_vertex(mesh, point) if point.vertex_index is not None else _beside(mesh, point)


def _at_vertex(mesh: TriangleMesh, point: SurfacePoint) -> Frame:
    topology = mesh.topology
    v = topology.inner_vertex[point.vertex_index]
    if topology.flags[v] & FANS:
        raise _without_plane(point, "several fans of faces meet")
    if topology.total_angle[v] == 0.0:
        raise _without_plane(point, "no face is around it that is not blocked")
    nodes, lowest = np.array([v]), np.array([point.face_index])
    frames = vertex_frames(topology, mesh.faces, mesh.inner_face, nodes, lowest)
    is_closed, total = not topology.flags[v] & BOUNDARY, float(topology.total_angle[v])
    return Frame(float(frames.starts[0]), int(frames.senses[0]), total, is_closed)


def _beside(mesh: TriangleMesh, point: SurfacePoint) -> Frame:
    """Return the frame of a point that is no vertex."""
    faces = weights_by_face(mesh, point)
    is_turned_over = _is_turned_over(mesh, point.face_index)
    if len(faces) > 2:
        raise _without_plane(point, f"{len(faces)} faces meet at an edge")
    if len(faces) == 1 and 0.0 in point.barycentric:
        start, sense = (math.pi, -1) if is_turned_over else (0.0, 1)
        return Frame(start, sense, math.pi, False)
    inner = int(mesh.inner_face[point.face_index])
    base, turn = base_of(inner, faces[inner]), list(faces).index(inner) * math.pi
    first, second = mesh.topology.inner_vertex[mesh.faces[point.face_index, :2]].tolist()
    for h in _half_edges_of(inner):
        axis = turn + axis_of(mesh, h, base)
        ends = mesh.topology.links[h, TAIL], mesh.topology.links[h, HEAD]
        if ends == (first, second):
            return Frame(axis, 1, 2.0 * math.pi, True)
        if ends == (second, first):
            return Frame(axis + math.pi, -1, 2.0 * math.pi, True)
    raise AssertionError("a face has an edge between its first two corners")


def _without_plane(point: SurfacePoint, why: str) -> NoTangentPlane:
    return NoTangentPlane(
        f"{point} has no tangent plane, as {why}: directions have no meaning there; choose a point "
        "beside it"
    )


def axis_of(mesh: TriangleMesh, h: int, base: int) -> float:
    """Return the direction of a half-edge in the frame of another one of its face, radians."""
    if h == base:
        return 0.0
    if h == following(base):
        return math.pi - _angle(mesh, base, COS_RIGHT, SIN_RIGHT)
    return math.pi + _angle(mesh, base, COS_LEFT, SIN_LEFT)


def direction_of(mesh: TriangleMesh, point: SurfacePoint, vector: Floats) -> float:
    """Return the direction of a vector in space, projected to the surface at a canonical point.

    Radians in the frame of the point; NaN where its projection has no direction. Raises
    `NotEmbedded` where the surface is given by its lengths.
    """
    mesh.require_embedded("a direction")
    if point.vertex_index is not None:
        frames, v = mesh.tangent_frames(), point.vertex_index
        x_axis, y_axis, scale = frames.x_axes[v], frames.y_axes[v], float(frames.scales[v])
    else:
        corners = mesh.vertices[mesh.faces[point.face_index]]
        x_axis, scale = corners[1] - corners[0], 1.0
        normal = np.cross(x_axis, corners[2] - corners[0])
        if not frame_at(mesh, point).is_closed:
            x_axis = _boundary_axis(mesh, point)
        x_axis, normal = x_axis / np.linalg.norm(x_axis), normal / np.linalg.norm(normal)
        y_axis = np.cross(normal, x_axis)
    x, y = float(x_axis @ vector), float(y_axis @ vector)
    if math.hypot(x, y) <= NO_DIRECTION * float(np.linalg.norm(vector)):
        return math.nan
    return math.atan2(y, x) % (2.0 * math.pi) / scale


def _boundary_axis(mesh: TriangleMesh, point: SurfacePoint) -> Floats:
    """Return the vector along which angles begin at a point of a boundary edge."""
    ((face, weights),) = weights_by_face(mesh, point).items()
    base = base_of(face, weights)
    ends = mesh.positions[mesh.topology.links[base, [TAIL, HEAD]]]
    axis: Floats = ends[1] - ends[0]
    return -axis if _is_turned_over(mesh, point.face_index) else axis


def base_of(face: int, weights: Weights) -> int:
    """Return the half-edge of an inner face that a point with these weights lies on, or its first.

    The kernels measure angles at the point from there.
    """
    corner = weights.index(0.0) if 0.0 in weights else 2
    return 3 * face + (corner + 1) % 3


def _half_edges_of(face: int) -> range:
    return range(3 * face, 3 * face + 3)


def _is_turned_over(mesh: TriangleMesh, face: int) -> bool:
    """Whether the kernels run around a face the other way than the caller wound it."""
    first, second = mesh.topology.inner_vertex[mesh.faces[face, :2]].tolist()
    links = mesh.topology.links
    return not any(
        links[h, TAIL] == first and links[h, HEAD] == second
        for h in _half_edges_of(int(mesh.inner_face[face]))
    )


def _angle(mesh: TriangleMesh, h: int, cosine: int, sine: int) -> float:
    geometry = mesh.topology.geometry
    return math.atan2(geometry[h, sine], geometry[h, cosine])
