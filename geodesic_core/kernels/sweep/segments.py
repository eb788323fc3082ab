"""Straight pieces of curves, as sources: the strips they emit, and what they reach in their faces.

A piece has a node of its own and a row for each face that it lies in: several where it runs along
an edge. Its ends are sources of their own; it adds the rays that leave it at right angles, on both
sides. Distance to it is then exact: nearest to a point is an end, or the foot of the perpendicular.
"""

import math
from typing import Any

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
from geodesic_core.kernels.sweep.relaxation import bound_vertex, illuminate_vertex, relax_vertex
from geodesic_core.kernels.sweep.state import (
    FACE,
    NODE,
    SEGMENT,
    SEGMENT_END,
    SEGMENT_ENDS,
    merging,
)
from geodesic_core.kernels.sweep.window_lists import put_window, send_out
from geodesic_core.tolerances import SLANT


@kernel
def is_segment(ints: Any, node: int) -> bool:
    """Whether a node is a piece; ``ints`` are rows of pieces, as `Wavefront.piece_ints`."""
    return len(ints) > 0 and ints[0, NODE] <= node <= ints[-1, NODE]


@kernel
def emit_segment(wave: Any, k: int) -> None:
    """Send the strips of the piece of row k over the edges of its face, and reach the corners."""
    mesh, sites = wave.mesh, wave.sites
    ints, ends = sites.segment_ints, sites.segment_ends
    node, face = ints[SEGMENT * k + NODE], ints[SEGMENT * k + FACE]
    for h in range(3 * face, 3 * face + 3):
        px, py = weights_in_frame(mesh.geometry, ends, SEGMENT_ENDS * k, h)
        qx, qy = weights_in_frame(mesh.geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
        reach = math.hypot(qx - px, qy - py)
        dx, dy = (qx - px) / reach, (qy - py) / reach
        if dx < 0.0:
            px, py, qx, qy, dx, dy = qx, qy, px, py, -dx, -dy
        if dx > SLANT and is_off_edge(ends, k, h):
            emit_parallel_window(wave, node, h, px, py, qx, qy, dx, dy)
        reach_corner(wave, node, h, px, py, dx, dy, reach)


@kernel
def is_off_edge(ends: Any, k: int, h: int) -> bool:
    """Whether the piece does not run along the edge of h; by weights, as faces may have no area."""
    up = SEGMENT_ENDS * k + (h + 2) % 3
    return bool(max(ends[up], ends[up + SEGMENT_END]) > 0.0)


@kernel
def emit_parallel_window(
    wave: Any,
    node: int,
    h: int,
    px: float,
    py: float,
    qx: float,
    qy: float,
    dx: float,
    dy: float,
) -> None:
    """Send the strip that leaves pq over the edge of h; (dx, dy) is its direction, dx > 0."""
    mesh = wave.mesh
    row = ROW * h
    length = mesh.geometry[row + LENGTH]
    b0, b1 = max(px + py * dy / dx, 0.0), min(qx + qy * dy / dx, length)
    if mesh.links[row + OPPOSITE] == NO_FACE or b1 <= b0:
        return
    # The rays run along (dy, -dx). The frame across begins at the other end, and looks that way.
    sigma = wave.vertices.distance[node] + (length - px) * dy + py * dx
    slot = put_window(wave, length - b1, length - b0, dy, -dx, sigma, node, 0.0, -1 - node)
    send_out(wave, h, slot)


@kernel
def reach_corner(
    wave: Any, node: int, h: int, px: float, py: float, dx: float, dy: float, reach: float
) -> None:
    """Offer the apex of h the perpendicular to the piece from p on, if its foot is on it.

    In a face of no area the apex may lie on the piece itself, and not be an end of it.
    """
    mesh = wave.mesh
    row = ROW * h
    x = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT] - px
    y = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT] - py
    height = y * dx - x * dy
    if not 0.0 <= x * dx + y * dy <= reach:
        return
    sx, sy = (dy, -dx) if height >= 0.0 else (-dy, dx)  # against the ray to the apex
    distance = wave.vertices.distance[node] + abs(height)
    apex = mesh.links[row + APEX]
    if merging(wave):
        bound_vertex(wave, apex, distance)
        if mesh.flags[apex]:
            illuminate_vertex(wave, apex, distance, h, sx, sy, 0.0)
    relax_vertex(wave, apex, distance, h, sx, sy, node, -1 - node)


@kernel
def distance_to_segment(geometry: Any, ends: Any, k: int, h: int, x: float, y: float) -> float:
    """Distance of the piece of row k from (x, y) in the frame of h, of the same face."""
    px, py = weights_in_frame(geometry, ends, SEGMENT_ENDS * k, h)
    qx, qy = weights_in_frame(geometry, ends, SEGMENT_ENDS * k + SEGMENT_END, h)
    dx, dy = qx - px, qy - py
    t = ((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(px + t * dx - x, py + t * dy - y)
