"""Segments of curves as sources: their parallel windows, and distances from them.

A segment has a node of its own and a row for each face that it lies in: several where it runs along
an edge. Its ends are sources of their own; it adds the rays that leave it at right angles, on both
sides. Distance to it is then exact: nearest to a point is an end, or the foot of the perpendicular.
"""

import math
from typing import NamedTuple

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.state import NODE, SEGMENT_END, SEGMENT_ENDS, View
from geodesic_core.kernels.front.window import Window, emitted_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    COS_LEFT,
    LENGTH_LEFT,
    ROW,
    SIN_LEFT,
    weights_in_frame,
)


@kernel
def is_segment(ints: Ints, node: int) -> bool:
    """Whether a node is a segment; ``ints`` are rows as of `Sites.segment_ints`."""
    return len(ints) > 0 and ints[0, NODE] <= node <= ints[-1, NODE]


class PlacedSegment(NamedTuple):
    """A segment pq in the frame of a half-edge of its face, p before q in the order of x."""

    px: float
    py: float
    qx: float
    qy: float
    dx: float
    """(dx, dy): the unit vector from p to q, dx >= 0"""
    dy: float
    length: float


@kernel
def place_segment(geometry: Floats, ends: Floats, k: int, h: int) -> PlacedSegment:
    """Return the segment of row k in the frame of h, of the same face."""
    px, py = weights_in_frame(geometry, ends, SEGMENT_ENDS * k, h)
    qx, qy = weights_in_frame(geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
    length = math.hypot(qx - px, qy - py)
    dx, dy = (qx - px) / length, (qy - py) / length
    if dx < 0.0:
        px, py, qx, qy, dx, dy = qx, qy, px, py, -dx, -dy
    return PlacedSegment(px, py, qx, qy, dx, dy, length)


@kernel
def is_off_edge(ends: Floats, k: int, h: int) -> bool:
    """Whether the segment leaves the edge of h; by weights, as faces may have no area."""
    up = SEGMENT_ENDS * k + (h + 2) % 3
    return bool(max(ends[up], ends[up + SEGMENT_END]) > 0.0)


@kernel
def parallel_window(
    wave: View, start: float, node: int, length: float, segment: PlacedSegment
) -> Window:
    """Return the parallel window of a segment at distance ``start``, as the face across sees it.

    The segment is placed in the frame of an edge of this ``length``. Empty if b1 <= b0.
    """
    px, py, dx, dy = segment.px, segment.py, segment.dx, segment.dy
    b0, b1 = max(px + py * dy / dx, 0.0), min(segment.qx + segment.qy * dy / dx, length)
    # The rays run along (dy, -dx). The frame across begins at the other end, and looks that way.
    sigma = start + (length - px) * dy + py * dx
    return emitted_window(wave, length - b1, length - b0, dy, -dx, sigma, node, 0.0)


@kernel
def perpendicular_to(
    geometry: Floats, h: int, segment: PlacedSegment
) -> tuple[bool, float, float, float]:
    """Return whether a segment has a foot for the apex of h, how far it is, and the way to it.

    In a face of no area the apex may lie on the segment itself, and not be an end of it.
    """
    row, dx, dy = ROW * h, segment.dx, segment.dy
    x = geometry[row + COS_LEFT] * geometry[row + LENGTH_LEFT] - segment.px
    y = geometry[row + SIN_LEFT] * geometry[row + LENGTH_LEFT] - segment.py
    height = y * dx - x * dy
    is_foot = 0.0 <= x * dx + y * dy <= segment.length
    sx, sy = (dy, -dx) if height >= 0.0 else (-dy, dx)  # against the ray to the apex
    return is_foot, abs(height), sx, sy


@kernel
def distance_to_segment(
    geometry: Floats, ends: Floats, k: int, h: int, x: float, y: float
) -> float:
    """Distance of the segment of row k from (x, y) in the frame of h, of the same face."""
    px, py = weights_in_frame(geometry, ends, SEGMENT_ENDS * k, h)
    qx, qy = weights_in_frame(geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
    dx, dy = qx - px, qy - py
    t = ((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(px + t * dx - x, py + t * dy - y)
