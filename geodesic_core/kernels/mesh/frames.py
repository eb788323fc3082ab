"""Frames: from where directions at points of the surface are measured, and in which sense.

Angles are measured on the surface, counter-clockwise seen from outside, as the caller wound the
faces. Kernels measure them in the unfolded fan of a vertex, or face by face around a point of an
edge (`kernels.front.directions`), in faces that may be turned over.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    APEX_ANGLE,
    BOUNDARY,
    COS_LEFT,
    COS_RIGHT,
    FANS,
    HEAD,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    next_around,
)
from geodesic_core.kernels.mesh.locations import Locations, corner_of


class Frame(NamedTuple):
    """From where, and in which sense, angles at a point are measured; or at N, with arrays (N,)."""

    start: Any
    """The kernels' angle at which it begins, radians; NaN where there is no tangent plane"""
    sense: Any
    """1, or -1 where the kernels see the surface from inside"""
    total_angle: Any
    """Sum of the angles of the surface at the point, radians"""
    is_closed: Any
    """Whether the surface closes around the point: then angles are from 0 up to the total angle"""

    @property
    def scale(self) -> Any:
        """Angle in the tangent plane for one of the surface, see `TangentFrames`."""
        turn = 2.0 * math.pi
        is_scaled = np.logical_or(self.is_closed, self.total_angle > turn)
        return np.where(is_scaled, turn / self.total_angle, 1.0)[()]

    def angles(self, kernel_angles: Floats) -> Floats:
        """Return angles from the kernels' own."""
        return self._around(self.sense * (kernel_angles - self.start))

    def kernel_angles(self, angles: Floats) -> Floats:
        """Return the kernels' angles, the inverse of `angles`."""
        return self._around(self.start + self.sense * angles)

    def _around(self, angles: Floats) -> Floats:
        return np.mod(angles, self.total_angle, out=np.array(angles), where=self.is_closed)

    def turn_of(self, angle: float) -> float:
        """Return an angle in the tangent plane, in the kernels' sense and from their beginning."""
        return float(self.scale * (self.start + self.sense * angle))

    def angle_of(self, turn: float) -> float:
        """Return the angle of a turn in the tangent plane, the inverse of `turn_of`."""
        away = self.sense * (turn - self.scale * self.start)
        return float(away % (2.0 * math.pi) / self.scale)


@kernel
def find_frames(topology: Topology, faces: Ints, inner_face: Ints, located: Locations) -> Frame:
    """Return the frames of canonical points, (N,) arrays.

    At a vertex that the surface closes around, angles begin at the edge that leaves it in its
    lowest face, as that is wound; elsewhere in a face, or on an edge, parallel to the edge from
    corner 0 to corner 1 of the lowest face. At a boundary they begin where the surface does.
    ``faces`` are the caller's.
    """
    count = len(located.faces)
    frames = Frame(
        np.full(count, np.nan), np.ones(count), np.full(count, np.nan), np.ones(count, np.bool_)
    )
    for i in range(count):
        face, v = located.faces[i], located.vertices[i]
        if face < 0:  # a vertex of no face
            continue
        if v >= 0:
            frame = frame_at_vertex(
                topology, faces, inner_face[face], face, topology.inner_vertex[v]
            )
        else:
            h = half_edge_at(topology, faces, inner_face, located, i)
            frame = frame_beside(topology, faces, inner_face[face], face, h)
        frames.start[i], frames.sense[i] = frame.start, frame.sense
        frames.total_angle[i], frames.is_closed[i] = frame.total_angle, frame.is_closed
    return frames


@inlined
def frame_at_vertex(topology: Topology, faces: Ints, inner: int, face: int, v: int) -> Frame:
    """Return the frame of inner vertex v, whose lowest face is given by both its numbers."""
    geometry, total, flags = topology.geometry, topology.total_angle[v], topology.flags[v]
    if flags & FANS or total == 0.0:
        return Frame(math.nan, 1.0, total, False)
    h = half_edge_from(topology, inner, v)
    ahead = topology.inner_vertex[faces[face, (corner_of(topology, faces, face, v) + 1) % 3]]
    is_over = topology.links[h, HEAD] != ahead
    sense = -1.0 if is_over else 1.0
    if flags & BOUNDARY:
        return Frame(total if is_over else 0.0, sense, total, False)
    width = math.atan2(geometry[h, SIN_LEFT], geometry[h, COS_LEFT]) if is_over else 0.0
    return Frame(geometry[following(h), APEX_ANGLE] + width, sense, total, True)


@inlined
def frame_beside(topology: Topology, faces: Ints, inner: int, face: int, on: int) -> Frame:
    """Return the frame of a point on half-edge ``on`` of a face, or inside it where that is -1."""
    first, second = topology.inner_vertex[faces[face, 0]], topology.inner_vertex[faces[face, 1]]
    h = half_edge_from(topology, inner, first)
    is_over = topology.links[h, HEAD] != second
    sense, total, is_closed = -1.0 if is_over else 1.0, 2.0 * math.pi, True
    if is_over:  # from the second to the first
        h = half_edge_from(topology, inner, second)
    base: Any = np.int64(on if on >= 0 else 3 * inner)
    start = axis_of(topology.geometry, h, base)
    if is_over:
        start += math.pi
    if on >= 0:
        across = next_around(topology.links, on)
        if across < 0:
            start, total, is_closed = math.pi if is_over else 0.0, math.pi, False
        elif next_around(topology.links, across) != on:  # three faces, or more
            start = math.nan
    return Frame(start, sense, total, is_closed)


@inlined
def half_edge_from(topology: Topology, inner: int, v: int) -> int:
    """Return the half-edge of an inner face that leaves inner vertex v."""
    h: Any = np.int64(3 * inner)
    while topology.links[h, TAIL] != v:
        h += 1
    return h


@kernel
def half_edge_at(
    topology: Topology, faces: Ints, inner_face: Ints, located: Locations, i: int
) -> int:
    """Return the half-edge of its face that a canonical point lies on, no vertex; -1 for none."""
    face = located.faces[i]
    for k in range(3):
        if located.weights[i, k] == 0.0:
            h: Any = np.int64(3 * inner_face[face])
            while topology.links[h, APEX] != topology.inner_vertex[faces[face, k]]:
                h += 1
            return h
    return -1


@kernel
def axis_of(geometry: Floats, h: int, base: int) -> float:
    """Direction of a half-edge in the frame of another one of its face, radians."""
    if h == base:
        return 0.0
    if h == following(base):
        return math.pi - math.atan2(geometry[base, SIN_RIGHT], geometry[base, COS_RIGHT])
    return math.pi + math.atan2(geometry[base, SIN_LEFT], geometry[base, COS_LEFT])
