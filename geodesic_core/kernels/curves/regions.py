r"""Regions of the plane of a face, each convex: discs and bands, cut to straight sides.

A region lies on the near side of its *front*, a circle or a line, and within up to three *sides*,
which are straight::

             .---.   front: a circle       +<--e---+ C   front: a line, whose near side
            /     \                        |       |     is on the left of e
            \     /                        |       |
             \   /   sides: two rays       |       |     sides: two rays; perhaps one more,
              \ /                          |       |     opposite the front
               C                           +-------+
"""

import math
from typing import Any

from geodesic_core.arrays import Floats
from geodesic_core.kernels.curves.conics import CURVE, CX, CY, EX, EY, K, Q, is_line
from geodesic_core.kernels.jit import inlined, kernel

RADIUS = Q  # of a disc; infinite of a band

# Columns of a region: those of its front, then three for each side
SIDES = CURVE
NX = 0  # the normal, inward, a unit; zero where there is no such side
NY = 1
DEPTH = 2  # how far inside (CX, CY) is
SIDE = 3
SIDES_END = SIDES + 3 * SIDE


@kernel
def end_of_sides(region: Floats) -> int:
    """Return the column after the last side that a region may have: discs have two."""
    return SIDES_END if is_line(region) else SIDES_END - SIDE


@inlined
def put_side(region: Floats, rank: int, nx: float, ny: float, depth: float) -> None:
    """Set side number ``rank`` of ``region``: its inward unit normal, and its depth at (CX, CY)."""
    side = SIDES + SIDE * rank
    region[side + NX], region[side + NY], region[side + DEPTH] = nx, ny, depth


@inlined
def put_disc(region: Floats, x: float, y: float, radius: float) -> None:
    """Make ``region`` a whole disc."""
    region[CX], region[CY], region[RADIUS], region[K] = x, y, radius, 1.0


@inlined
def put_band(region: Floats, x: float, y: float, ex: float, ey: float, width: float) -> None:
    """Make ``region`` a band: its front from (x, y) along e, its sides at both ends."""
    region[CX], region[CY], region[RADIUS] = x, y, math.inf
    region[EX], region[EY] = ex, ey
    put_side(region, 0, ex, ey, 0.0)
    put_side(region, 1, -ex, -ey, width)


@kernel
def runs_along(front: Floats, slack: float, edge: Any, length: float) -> bool:
    """Whether a front is a line that runs along an edge, given as by `half_edge_in_face`."""
    if not is_line(front):
        return False
    ox, oy, ux, uy = edge
    depth = front[EX] * (oy - front[CY]) - front[EY] * (ox - front[CX])
    rise = length * (front[EX] * uy - front[EY] * ux)
    return max(abs(depth), abs(depth + rise)) <= slack


@kernel
def span_in_half_plane(lo: float, hi: float, depth: float, rate: float) -> tuple[float, float]:
    """Cut a span of a line to a half-plane, in which its parameter t is ``depth + rate t`` deep."""
    if rate > 0.0:
        return max(lo, -depth / rate), hi
    if rate < 0.0:
        return lo, min(hi, -depth / rate)
    return (lo, hi) if depth >= 0.0 else (1.0, 0.0)


@kernel
def span_between_sides(
    region: Floats, x: float, y: float, ex: float, ey: float, lo: float, hi: float
) -> tuple[float, float]:
    """Cut the span [lo, hi] of the line from (x, y) along e to the sides of a region.

    The span is empty where lo > hi.
    """
    wx, wy = x - region[CX], y - region[CY]
    for side in range(SIDES, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * wx + ny * wy
        lo, hi = span_in_half_plane(lo, hi, depth, nx * ex + ny * ey)
    return lo, hi


@kernel
def span_on_line(
    region: Floats, slack: float, x: float, y: float, ex: float, ey: float, lo: float, hi: float
) -> tuple[float, float]:
    """Cut the span [lo, hi] of the line from (x, y) along e to a region.

    The region's front is moved outward by ``slack``. The span is empty where lo > hi.
    """
    wx, wy = x - region[CX], y - region[CY]
    if is_line(region):
        depth = region[EX] * wy - region[EY] * wx + slack
        lo, hi = span_in_half_plane(lo, hi, depth, region[EX] * ey - region[EY] * ex)
    else:
        radius = region[RADIUS] + slack
        height, middle = abs(ex * wy - ey * wx), -(wx * ex + wy * ey)
        if height > radius:
            return 1.0, 0.0
        half = math.sqrt((radius - height) * (radius + height))
        lo, hi = max(lo, middle - half), min(hi, middle + half)
    return span_between_sides(region, x, y, ex, ey, lo, hi)


@inlined
def is_beyond_side(chord: Any, region: Floats) -> bool:
    """Whether an arc is surely beyond a side of a region: a cheap test without arctangents.

    The arc is given as by `chord_of`.
    """
    x0, y0, x1, y1, sagitta = chord
    x0, y0, x1, y1 = x0 - region[CX], y0 - region[CY], x1 - region[CX], y1 - region[CY]
    for side in range(SIDES, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + sagitta
        if max(nx * x0 + ny * y0, nx * x1 + ny * y1) + depth < 0.0:
            return True
    return False
