r"""Arcs of one level in one face: the outline of the region within the level, in closed form.

The points within a level form the union of the regions that reach them (`regions`), cut to the
face. Its outline consists of arcs of their fronts. An arc counts where it lies in the face, between
the sides of its own region, and in no other region::

              .---.
             / \ / \        Two discs of rays from below: of each circle the part counts
            /  |X|  \       that the other disc does not hold.
           |  / | \  |

An arc is an interval of *parameters* of its front. Those of a circle are angles, counter-clockwise;
those of a line are distances from its first point. So the nearer side is on the arc's left.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.isolines.regions import (
    CX,
    CY,
    DEPTH,
    EX,
    EY,
    FRONT,
    NX,
    NY,
    RADIUS,
    SIDE,
    end_of_sides,
    is_line,
    runs_along,
    span_in_half_plane,
    span_on_line,
)
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face
from geodesic_core.tolerances import LEVEL

# Columns of an arc, after those of its front
START = FRONT  # parameter at which the arc starts
END = FRONT + 1
ARC = FRONT + 2

TURN = 2.0 * math.pi

INTERVALS = 16
"""Intervals that a circle, a face and a region have in common, at most.

A convex cut adds at most one interval: three edges of the face, three sides and a front make eight.
"""

ROWS = 64  # rows that arrays have at first; they grow


@kernel
def with_room(rows: Any, needed: int) -> Any:
    """Return ``rows``, in a larger array if it has fewer than ``needed`` rows."""
    if needed <= len(rows):
        return rows
    larger = np.empty((max(2 * len(rows), needed), rows.shape[1]), rows.dtype)
    copy_rows(rows, larger, 0)
    return larger


@kernel
def copy_rows(rows: Any, target: Any, first: int) -> None:
    """Copy ``rows`` into ``target``, from its row ``first`` on.

    An assignment to a slice does the same, but takes half a second to compile.
    """
    for i in range(len(rows)):
        for column in range(rows.shape[1]):
            target[first + i, column] = rows[i, column]


@kernel
def point_on(front: Floats, parameter: float) -> tuple[float, float]:
    """Point of a front at a parameter."""
    x, y = front[CX], front[CY]
    if is_line(front):
        return x + parameter * front[EX], y + parameter * front[EY]
    return x + front[RADIUS] * math.cos(parameter), y + front[RADIUS] * math.sin(parameter)


@inlined
def speed(front: Floats) -> float:
    """Length of a front per unit of its parameter."""
    return 1.0 if is_line(front) else front[RADIUS]


@kernel
def clip(intervals: Floats, count: int, start: float, width: float) -> int:
    """Cut the first ``count`` intervals of angles to an arc, in place; return how many are left."""
    intervals = borrowed(intervals)
    cut, left = np.empty((INTERVALS, 2)), 0
    for i in range(count):
        lo, hi = intervals[i, 0], intervals[i, 1]
        turn = start + TURN * math.floor((lo - start) / TURN)
        while turn < hi and left < INTERVALS:
            a, b = max(turn, lo), min(turn + width, hi)
            if b > a:
                cut[left, 0], cut[left, 1] = a, b
                left += 1
            turn += TURN
    for i in range(left):
        intervals[i, 0], intervals[i, 1] = cut[i, 0], cut[i, 1]
    return left


@inlined
def clip_line(intervals: Floats, depth: float, rate: float) -> int:
    """Cut the one interval of a line to ``depth`` + t ``rate`` >= 0; return 1, or 0 for nothing."""
    lo, hi = span_in_half_plane(intervals[0, 0], intervals[0, 1], depth, rate)
    intervals[0, 0], intervals[0, 1] = lo, hi
    return 1 if lo < hi else 0


@kernel
def clip_to_half_plane(
    intervals: Floats, count: int, front: Floats, depth: float, nx: float, ny: float
) -> int:
    """Cut ``intervals`` of a front to the half-plane n·p >= 0; return how many are left.

    Its (CX, CY) is ``depth`` inside; n is a unit vector, or zero where nothing is to be cut.
    """
    intervals, front = borrowed(intervals), borrowed(front)
    if count == 0 or (nx == 0.0 and ny == 0.0):
        return count
    if is_line(front):
        return clip_line(intervals, depth, nx * front[EX] + ny * front[EY])
    radius = front[RADIUS]
    if depth >= radius:
        return count
    if depth <= -radius:
        return 0
    half = math.acos(-depth / radius)
    return clip(intervals, count, math.atan2(ny, nx) - half, 2.0 * half)


@kernel
def clip_to_disc(
    intervals: Floats, count: int, radius: float, dx: float, dy: float, other: float
) -> int:
    """Cut ``intervals`` of a circle to a disc of radius ``other``, whose centre is at -(dx, dy)."""
    if count == 0 or other <= 0.0:
        return 0
    d = math.hypot(dx, dy)
    excess = (other - radius) * (other + radius) - d * d
    if excess >= 2.0 * radius * d:
        return count
    if excess <= -2.0 * radius * d:
        return 0
    half = math.acos(excess / (2.0 * radius * d))
    return clip(intervals, count, math.atan2(dy, dx) + half, TURN - 2.0 * half)


@kernel
def clip_to_sides(intervals: Floats, count: int, front: Floats, region: Floats) -> int:
    """Cut ``intervals`` of a front to the sides of a region; return how many are left."""
    intervals, front, region = borrowed(intervals), borrowed(front), borrowed(region)
    dx, dy = front[CX] - region[CX], front[CY] - region[CY]
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * dx + ny * dy
        count = clip_to_half_plane(intervals, count, front, depth, nx, ny)
    return count


@kernel
def clip_to_region(intervals: Floats, front: Floats, region: Floats, slack: float) -> int:
    """Cut the first of ``intervals`` of a front to a region; return how many are left.

    The region's own front is moved outward by ``slack``.
    """
    if is_line(front):
        x, y, ex, ey = front[CX], front[CY], front[EX], front[EY]
        lo, hi = intervals[0, 0], intervals[0, 1]
        lo, hi = span_on_line(region, slack, x, y, ex, ey, lo, hi)
        intervals[0, 0], intervals[0, 1] = lo, hi
        return 1 if lo < hi else 0
    count = clip_to_sides(intervals, 1, front, region)
    dx, dy = front[CX] - region[CX], front[CY] - region[CY]
    if is_line(region):
        nx, ny = -region[EY], region[EX]
        return clip_to_half_plane(intervals, count, front, nx * dx + ny * dy + slack, nx, ny)
    return clip_to_disc(intervals, count, front[RADIUS], dx, dy, region[RADIUS] + slack)


@kernel
def arcs_within(topology: Any, face: int, regions: Floats, slack: float) -> tuple[Floats, Any]:
    """Return the arcs of the regions' fronts in the face and between their sides; whose each is.

    A line along an edge, within ``slack``, would be in either face by rounding: it counts as in the
    face that is farther.
    """
    geometry, regions = borrowed(topology.geometry), borrowed(regions)
    arcs, owners, count = np.empty((len(regions), ARC)), np.empty((len(regions), 1), np.int32), 0
    intervals = np.empty((INTERVALS, 2))
    ax, ay, _, _ = half_edge_in_face(geometry, 3 * face + 2)
    middle_x, middle_y = (geometry[3 * face, LENGTH] + ax) / 3.0, ay / 3.0
    for i in range(len(regions)):
        region, left = regions[i], 1
        x, y = region[CX], region[CY]
        if region[RADIUS] <= 0.0:
            continue
        if is_line(region):
            intervals[0, 0], intervals[0, 1] = -math.inf, math.inf
        else:  # a whole circle begins where it is farthest from the face
            intervals[0, 0] = math.atan2(y - middle_y, x - middle_x)
            intervals[0, 1] = intervals[0, 0] + TURN
        for h in range(3 * face, 3 * face + 3):
            ox, oy, ux, uy = half_edge_in_face(geometry, h)
            if runs_along(region, slack, (ox, oy, ux, uy), geometry[h, LENGTH]):
                if region[EX] * ux + region[EY] * uy > 0.0:  # the nearer side is in this face
                    left = 0
                continue
            depth = ux * (y - oy) - uy * (x - ox)
            left = clip_to_half_plane(intervals, left, region, depth, -uy, ux)
        left = clip_to_sides(intervals, left, region, region)
        arcs, owners = with_room(arcs, count + left), with_room(owners, count + left)
        for k in range(left):
            put_arc(arcs[count], region, intervals[k, 0], intervals[k, 1])
            owners[count, 0] = i
            count += 1
    return arcs[:count], owners[:count]


@inlined
def put_arc(arc: Floats, front: Floats, start: float, end: float) -> None:
    """Make ``arc`` the arc of a front between two parameters."""
    for column in range(FRONT):
        arc[column] = front[column]
    arc[START], arc[END] = start, end


@kernel
def chord_of(arc: Floats) -> tuple[float, float, float, float, float, float]:
    """Return an arc's ends, its sagitta (how far it strays from its chord), and half its length."""
    width, radius = arc[END] - arc[START], arc[RADIUS]
    x0, y0 = point_on(arc, arc[START])
    x1, y1 = point_on(arc, arc[END])
    sagitta = 0.0
    if not is_line(arc):
        sagitta = 2.0 * radius
        if width < math.pi:
            sagitta = radius * (1.0 - math.cos(0.5 * width))
    return x0, y0, x1, y1, sagitta, 0.5 * speed(arc) * width


@inlined
def is_apart(chord: Any, region: Floats, slack: float) -> bool:
    """Whether an arc is surely outside a region: a cheap test without arctangents.

    An arc strays from its chord by no more than its sagitta.
    """
    x0, y0, x1, y1, sagitta, half = chord
    x0, y0, x1, y1 = x0 - region[CX], y0 - region[CY], x1 - region[CX], y1 - region[CY]
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + sagitta
        if max(nx * x0 + ny * y0, nx * x1 + ny * y1) + depth < 0.0:
            return True
    ex, ey = region[EX], region[EY]
    if is_line(region):
        return max(ex * y0 - ey * x0, ex * y1 - ey * x1) + sagitta + slack < 0.0
    nearest = math.sqrt(min(x0 * x0 + y0 * y0, x1 * x1 + y1 * y1))
    return nearest - half > region[RADIUS] + slack


@inlined
def yields_to(arc: Floats, owner: int, region: Floats, rank: int) -> bool:
    """Whether an arc gives way where the front of another region coincides with it.

    Lines take precedence over circles, which may touch them; then the first does. Of lines that
    face each other neither counts: nothing is farther between them.
    """
    if is_line(arc) != is_line(region):
        return is_line(region)
    return rank < owner or arc[EX] * region[EX] + arc[EY] * region[EY] < 0.0


@kernel
def outer_arcs(topology: Any, face: int, regions: Floats, level: float, shortest: float) -> Floats:
    """Return the outline of the union of the regions in the face: arcs in no other region.

    Where fronts coincide within `LEVEL`, one of them takes precedence (`yields_to`). It loses only
    what another region holds by more than that, and the others lose all that it holds within that.
    Arcs not longer than ``shortest`` are left out. O(n² log n) for n regions.
    """
    slack, regions = LEVEL * level, borrowed(regions)
    arcs, owners = arcs_within(topology, face, regions, slack)
    outer, count = np.empty((len(arcs) + 4, ARC)), 0
    hidden, intervals = np.empty((ROWS, 2)), np.empty((INTERVALS, 2))
    for a in range(len(arcs)):
        arc = arcs[a]
        hidden, hidden_count = hidden_intervals(
            arc, owners[a, 0], regions, slack, intervals, hidden
        )
        if hidden_count < 0:
            continue
        outer = with_room(outer, count + hidden_count + 1)
        start = arc[START]
        for k in range(hidden_count + 1):
            end = hidden[k, 0] if k < hidden_count else arc[END]
            if (end - start) * speed(arc) > shortest:
                put_arc(outer[count], arc, start, end)
                count += 1
            if k < hidden_count:
                start = max(start, hidden[k, 1])
    return outer[:count]


@inlined
def hidden_intervals(
    arc: Floats, owner: int, regions: Floats, slack: float, intervals: Floats, hidden: Floats
) -> tuple[Floats, int]:
    """Return the intervals of an arc that other regions hold, sorted, and how many there are.

    They are written to ``hidden``, or to a larger array; ``intervals`` is scratch memory. Their
    number is -1 where one region holds all of the arc.
    """
    arc, intervals = borrowed(arc), borrowed(intervals)
    start, end, chord, count = arc[START], arc[END], chord_of(arc), 0
    for j in range(len(regions)):
        if j == owner:
            continue
        region = regions[j]
        beyond = slack if yields_to(arc, owner, region, j) else -slack
        if is_apart(chord, region, beyond):
            continue
        intervals[0, 0], intervals[0, 1] = start, end
        left = clip_to_region(intervals, arc, region, beyond)
        if left == 1 and intervals[0, 0] <= start and intervals[0, 1] >= end:
            return hidden, -1
        hidden = with_room(hidden, count + left)
        for k in range(left):
            insert_interval(hidden, count, intervals[k, 0], intervals[k, 1])
            count += 1
    return hidden, count


@inlined
def insert_interval(rows: Floats, count: int, start: float, end: float) -> None:
    """Insert an interval into the first ``count`` of ``rows``, which are sorted by their starts."""
    row = count
    while row > 0 and rows[row - 1, 0] > start:
        rows[row, 0], rows[row, 1] = rows[row - 1, 0], rows[row - 1, 1]
        row -= 1
    rows[row, 0], rows[row, 1] = start, end
