"""Intervals of the parameters of a curve: cut to half-planes and regions, hidden, and left over.

On a conic each condition is of the form α + β cos φ + γ sin φ >= 0, and so holds on one interval
of angles. On a line each condition holds on one interval as well.
"""

import math

from geodesic_core.arrays import Floats
from geodesic_core.kernels.curves.conics import CX, CY, EX, EY, GX, GY, TURN, K, Q, is_line
from geodesic_core.kernels.curves.regions import (
    DEPTH,
    NX,
    NY,
    SIDE,
    SIDES,
    end_of_sides,
    span_in_half_plane,
)
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import half_edge_in_face

INTERVALS = 16
"""Intervals that a conic, a face and two regions have in common, at most.

A convex cut adds at most one interval: three edges of the face and three sides of each region, or a
front, make ten. Arrays of intervals have as many rows, of which `clip` needs three to spare.
"""

ALL = -1
"""Number of hidden intervals where one of them hides the whole arc"""


@kernel
def clip(intervals: Floats, count: int, start: float, width: float) -> int:
    """Cut the first ``count`` intervals of angles to an arc, in place; return how many are left."""
    intervals, left = borrowed(intervals), 0
    moved = INTERVALS - count  # to the last rows, clear of the first ones
    for i in range(count - 1, -1, -1):
        intervals[moved + i, 0], intervals[moved + i, 1] = intervals[i, 0], intervals[i, 1]
    for i in range(moved, INTERVALS):
        lo, hi = intervals[i, 0], intervals[i, 1]
        turn = start + TURN * math.floor((lo - start) / TURN)
        while turn < hi and left < INTERVALS:
            first, last = max(turn, lo), min(turn + width, hi)
            if last > first:
                intervals[left, 0], intervals[left, 1] = first, last
                left += 1
            turn += TURN
    return left


@kernel
def clip_angles(
    intervals: Floats, count: int, alpha: float, beta: float, gamma: float, swing: float
) -> int:
    """Cut ``intervals`` of angles to α + β cos φ + γ sin φ >= 0; return how many are left.

    ``swing`` is the root of β² + γ², as exactly as the caller knows it: near a tangent, its last
    bit moves the end of an interval by 1e-8.
    """
    intervals = borrowed(intervals)
    if count == 0:
        return 0
    most = abs(beta) + abs(gamma)  # mostly this tells, without a root
    if alpha >= most:
        return count
    if alpha <= -most:
        return 0
    if alpha >= swing:
        return count
    if alpha <= -swing:
        return 0
    half = math.acos(-alpha / swing)
    return clip(intervals, count, math.atan2(gamma, beta) - half, 2.0 * half)


@kernel
def clip_to_half_plane(
    intervals: Floats, count: int, curve: Floats, depth: float, nx: float, ny: float
) -> int:
    """Cut ``intervals`` of a curve to the half-plane n·p >= 0; return how many are left.

    The curve's (CX, CY) is ``depth`` inside. n is a unit vector, or zero where nothing is to be
    cut.
    """
    intervals, curve = borrowed(intervals), borrowed(curve)
    if count == 0 or (nx == 0.0 and ny == 0.0):
        return count
    if is_line(curve):
        rate = nx * curve[EX] + ny * curve[EY]
        lo, hi = span_in_half_plane(intervals[0, 0], intervals[0, 1], depth, rate)
        intervals[0, 0], intervals[0, 1] = lo, hi
        return 1 if lo < hi else 0
    alpha, q = depth * curve[K], curve[Q]
    beta, gamma = depth * curve[GX] + q * nx, depth * curve[GY] + q * ny
    is_circle = curve[GX] == 0.0 and curve[GY] == 0.0
    swing = q if is_circle else math.hypot(beta, gamma)
    return clip_angles(intervals, count, alpha, beta, gamma, swing)


@inlined
def clip_to_edge(intervals: Floats, count: int, curve: Floats, geometry: Floats, h: int) -> int:
    """Cut ``intervals`` of a curve to the side of h where its face is; return how many are left."""
    intervals, curve, geometry = borrowed(intervals), borrowed(curve), borrowed(geometry)
    ox, oy, ux, uy = half_edge_in_face(geometry, h)
    depth = ux * (curve[CY] - oy) - uy * (curve[CX] - ox)
    return clip_to_half_plane(intervals, count, curve, depth, -uy, ux)


@kernel
def clip_to_sides(intervals: Floats, count: int, curve: Floats, region: Floats) -> int:
    """Cut ``intervals`` of a curve to the sides of a region; return how many are left."""
    intervals, curve, region = borrowed(intervals), borrowed(curve), borrowed(region)
    dx, dy = curve[CX] - region[CX], curve[CY] - region[CY]
    for side in range(SIDES, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * dx + ny * dy
        count = clip_to_half_plane(intervals, count, curve, depth, nx, ny)
    return count


@inlined
def insert_interval(rows: Floats, count: int, start: float, end: float) -> None:
    """Insert an interval into the first ``count`` of ``rows``, which are sorted by their starts."""
    row = count
    while row > 0 and rows[row - 1, 0] > start:
        rows[row, 0], rows[row, 1] = rows[row - 1, 0], rows[row - 1, 1]
        row -= 1
    rows[row, 0], rows[row, 1] = start, end


@inlined
def hide(
    hidden: Floats, count: int, intervals: Floats, more: int, start: float, end: float
) -> tuple[Floats, int]:
    """Add the first ``more`` of ``intervals`` to ``hidden``, which are sorted by their starts.

    Returns the hidden intervals, which may be in a larger array, and their number. The number is
    `ALL` where one interval is all of [start, end].
    """
    if more == 1 and intervals[0, 0] <= start and intervals[0, 1] >= end:
        return hidden, ALL
    hidden = with_room(hidden, count + more)
    for k in range(more):
        insert_interval(hidden, count, intervals[k, 0], intervals[k, 1])
        count += 1
    return hidden, count


@inlined
def left_over(hidden: Floats, count: int, start: float, end: float) -> tuple[Floats, int]:
    """Replace hidden intervals, sorted by their starts, by what they leave of [start, end].

    Returns the intervals that are left, which may be in a larger array, and their number.
    """
    if count == ALL:
        return hidden, 0
    hidden, left = with_room(hidden, count + 1), 0
    for k in range(count + 1):
        stop, after = (hidden[k, 0], hidden[k, 1]) if k < count else (end, end)
        if stop > start:
            hidden[left, 0], hidden[left, 1] = start, stop
            left += 1
        start = max(start, after)
    return hidden, left
