"""Frames at vertices: where the angles around each begin, and in which sense they count."""

import math
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.mesh.half_edges import (
    APEX_ANGLE,
    BOUNDARY,
    COS_LEFT,
    FANS,
    HEAD,
    SIN_LEFT,
    TAIL,
    Topology,
)


class VertexFrames(NamedTuple):
    """The frames of vertices; see `frames.Frame`, which is that of one point."""

    starts: Floats
    """(N,): the kernels' angle at which each begins, radians"""
    senses: Floats
    """(N,): 1, or -1 where the kernels see the surface from inside"""


def vertex_frames(
    topology: Topology, faces: Ints, inner_face: Ints, nodes: Ints | Longs, lowest: Longs
) -> VertexFrames:
    """Return the frames of inner vertices, whose lowest faces are given.

    At a vertex that the surface closes around, angles begin at the edge that leaves it in its
    lowest face, as that is wound. At a boundary they begin where the surface does.
    """
    row = np.arange(len(nodes))
    first = 3 * inner_face[lowest].astype(np.int64)
    tails = topology.links[first[:, None] + np.arange(3), TAIL]
    corner = np.argmax(tails == nodes[:, None], axis=1)
    h, ahead = first + corner, first + (corner + 1) % 3
    given = topology.inner_vertex[faces[lowest]]
    place = np.argmax(given == nodes[:, None], axis=1)
    is_over = topology.links[h, HEAD] != given[row, (place + 1) % 3]
    geometry = topology.geometry
    width = np.arctan2(geometry[h, SIN_LEFT], geometry[h, COS_LEFT])
    closed = geometry[ahead, APEX_ANGLE] + np.where(is_over, width, 0.0)
    open_ = np.where(is_over, topology.total_angle[nodes], 0.0)
    starts = np.where(is_open(topology)[nodes], open_, closed)
    return VertexFrames(starts, np.where(is_over, -1.0, 1.0))


def first_corners(nodes: Ints, count: int) -> Longs:
    """Return the first place of each of ``count`` inner vertices among the corners of faces.

    (count,): number of the corner, three a face; -1 of vertices that no face has.
    """
    flat = nodes.reshape(-1)
    first = np.full(count, -1)
    first[flat[::-1]] = np.arange(len(flat))[::-1]
    return first


def is_open(topology: Topology) -> Flags:
    """Return at which inner vertices the surface does not close around, (V,)."""
    open_: Flags = (topology.flags & (BOUNDARY | FANS)) != 0
    return open_


def scales_of(topology: Topology) -> Floats:
    """Return the angle in the tangent plane for one of the surface, at each inner vertex, (V,).

    Angles are stretched or shrunk to a full turn, at a boundary only where they sum to more.
    """
    total = topology.total_angle
    is_scaled = np.where(is_open(topology), total > 2.0 * math.pi, total > 0.0)
    return np.divide(2.0 * math.pi, total, out=np.ones_like(total), where=is_scaled)
