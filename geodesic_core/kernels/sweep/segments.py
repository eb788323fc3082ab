"""Segments of curves as sources: the parallel windows they emit, and the corners they reach.

A segment has a node of its own and a row for each face that it lies in: several where it runs along
an edge. Its ends are sources of their own; it adds the rays that leave it at right angles, on both
sides. Distance to it is then exact: nearest to a point is an end, or the foot of the perpendicular.
"""

import math
from typing import Any, NamedTuple

from geodesic_core.kernels.front.bounds import merging
from geodesic_core.kernels.front.relaxation import bound_vertex, illuminate_vertex, relax_vertex
from geodesic_core.kernels.front.state import FACE, NODE, SEGMENT, SEGMENT_END, SEGMENT_ENDS
from geodesic_core.kernels.front.window import Window, emitted_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    NO_FACE,
    OPPOSITE,
    ROW,
    SIN_LEFT,
    weights_in_frame,
)
from geodesic_core.kernels.sweep.window_lists import send_out
from geodesic_core.tolerances import SLANT


@kernel
def is_segment(ints: Any, node: int) -> bool:
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
def emit_segment(wave: Any, k: int) -> None:
    """Send the parallel windows of the segment of row k over the edges of its face.

    Reach the corners of the face. Modifies lists and vertices.
    """
    node = wave.sites.segment_ints[SEGMENT * k + NODE]
    face = wave.sites.segment_ints[SEGMENT * k + FACE]
    ends = wave.sites.segment_ends
    for h in range(3 * face, 3 * face + 3):
        segment = place_segment(wave.mesh.geometry, ends, k, h)
        if segment.dx > SLANT and is_off_edge(ends, k, h):
            emit_parallel_window(wave, node, h, segment)
        reach_corner(wave, node, h, segment)


@kernel
def place_segment(geometry: Any, ends: Any, k: int, h: int) -> PlacedSegment:
    """Return the segment of row k in the frame of h, of the same face."""
    px, py = weights_in_frame(geometry, ends, SEGMENT_ENDS * k, h)
    qx, qy = weights_in_frame(geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
    length = math.hypot(qx - px, qy - py)
    dx, dy = (qx - px) / length, (qy - py) / length
    if dx < 0.0:
        px, py, qx, qy, dx, dy = qx, qy, px, py, -dx, -dy
    return PlacedSegment(px, py, qx, qy, dx, dy, length)


@kernel
def is_off_edge(ends: Any, k: int, h: int) -> bool:
    """Whether the segment leaves the edge of h; by weights, as faces may have no area."""
    up = SEGMENT_ENDS * k + (h + 2) % 3
    return bool(max(ends[up], ends[up + SEGMENT_END]) > 0.0)


@kernel
def emit_parallel_window(wave: Any, node: int, h: int, segment: PlacedSegment) -> None:
    """Send the parallel window that leaves a segment over the edge of h, for dx > 0."""
    length = wave.mesh.geometry[ROW * h + LENGTH]
    window = parallel_window(wave, wave.vertices.distance[node], node, length, segment)
    if wave.mesh.links[ROW * h + OPPOSITE] != NO_FACE and window.b1 > window.b0:
        send_out(wave, h, window)


@kernel
def parallel_window(
    wave: Any, start: float, node: int, length: float, segment: PlacedSegment
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
def reach_corner(wave: Any, node: int, h: int, segment: PlacedSegment) -> None:
    """Offer the apex of h the perpendicular to a segment, if its foot is on it."""
    is_foot, reach, sx, sy = perpendicular_to(wave.mesh.geometry, h, segment)
    if not is_foot:
        return
    distance = wave.vertices.distance[node] + reach
    apex = wave.mesh.links[ROW * h + APEX]
    if merging(wave):
        bound_vertex(wave, apex, distance)
        if wave.mesh.flags[apex]:
            illuminate_vertex(wave, apex, distance, h, sx, sy, 0.0)
    relax_vertex(wave, apex, distance, h, sx, sy, node, -1 - node)


@kernel
def perpendicular_to(
    geometry: Any, h: int, segment: PlacedSegment
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
def distance_to_segment(geometry: Any, ends: Any, k: int, h: int, x: float, y: float) -> float:
    """Distance of the segment of row k from (x, y) in the frame of h, of the same face."""
    px, py = weights_in_frame(geometry, ends, SEGMENT_ENDS * k, h)
    qx, qy = weights_in_frame(geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
    dx, dy = qx - px, qy - py
    t = ((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(px + t * dx - x, py + t * dy - y)
