r"""Arcs of one level in one face: the outline of the region within the level, in closed form.

The points within a level form the union of the regions that reach them (`reached`), cut to the
face. Its outline consists of arcs of their fronts. An arc counts where it lies in the face, between
the sides of its own region, and in no other region::

              .---.
             / \ / \        Two discs of rays from below: of each circle the part counts
            /  |X|  \       that the other disc does not hold.
           |  / | \  |

Circles run counter-clockwise, and the nearer side of a line is on its left. So the nearer side is
on the left of each arc.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.clipping import (
    ALL,
    INTERVALS,
    clip_angles,
    clip_to_edge,
    clip_to_half_plane,
    clip_to_sides,
    hide,
    left_over,
)
from geodesic_core.kernels.curves.conics import (
    ARC,
    CX,
    CY,
    END,
    EX,
    EY,
    START,
    chord_of,
    is_line,
    put_arc,
    whole_range,
)
from geodesic_core.kernels.curves.regions import RADIUS, is_beyond_side, runs_along, span_on_line
from geodesic_core.kernels.curves.rows import ROWS, with_room
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face
from geodesic_core.tolerances import LEVEL


@inlined
def length_of(arc: Floats) -> float:
    """Return the length of an arc of a circle or a line."""
    width = arc[END] - arc[START]
    return width if is_line(arc) else arc[RADIUS] * width


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
    dx, dy, r = front[CX] - region[CX], front[CY] - region[CY], front[RADIUS]
    if is_line(region):
        nx, ny = -region[EY], region[EX]
        return clip_to_half_plane(intervals, count, front, nx * dx + ny * dy + slack, nx, ny)
    radius = region[RADIUS] + slack
    if radius <= 0.0:
        return 0
    d = math.hypot(dx, dy)
    alpha, swing = (radius - r) * (radius + r) - d * d, 2.0 * r * d
    return clip_angles(intervals, count, alpha, -2.0 * r * dx, -2.0 * r * dy, swing)


@kernel
def arcs_within(topology: Any, face: int, regions: Floats, slack: float) -> tuple[Floats, Ints]:
    """Return the arcs of the regions' fronts in the face and between the sides of their regions.

    The second array has the row of each arc's own region. A line along an edge, within ``slack``,
    would be in either face by rounding. It counts as in the face that is farther.
    """
    geometry, regions = borrowed(topology.geometry), borrowed(regions)
    arcs, owners, count = np.empty((len(regions), ARC)), np.empty(len(regions), np.int32), 0
    intervals = np.empty((INTERVALS, 2))
    for i in range(len(regions)):
        region, left = regions[i], 1
        if region[RADIUS] <= 0.0:
            continue
        intervals[0, 0], intervals[0, 1] = whole_range(region, geometry, face)
        for h in range(3 * face, 3 * face + 3):
            edge = half_edge_in_face(geometry, h)
            if not runs_along(region, slack, edge, geometry[h, LENGTH]):
                left = clip_to_edge(intervals, left, region, geometry, h)
            elif region[EX] * edge[2] + region[EY] * edge[3] > 0.0:  # nearer is in this face
                left = 0
        left = clip_to_sides(intervals, left, region, region)
        arcs, owners = with_room(arcs, count + left), with_room(owners, count + left)
        for k in range(left):
            put_arc(arcs[count], region, intervals[k, 0], intervals[k, 1])
            owners[count] = i
            count += 1
    return arcs[:count], owners[:count]


@inlined
def is_apart(chord: Any, half: float, region: Floats, slack: float) -> bool:
    """Whether an arc, ``half`` of which is so long, is surely outside a region: a cheap test."""
    if is_beyond_side(chord, region):
        return True
    x0, y0, x1, y1, sagitta = chord
    x0, y0, x1, y1 = x0 - region[CX], y0 - region[CY], x1 - region[CX], y1 - region[CY]
    ex, ey = region[EX], region[EY]
    if is_line(region):
        return max(ex * y0 - ey * x0, ex * y1 - ey * x1) + sagitta + slack < 0.0
    nearest = math.sqrt(min(x0 * x0 + y0 * y0, x1 * x1 + y1 * y1))
    return nearest - half > region[RADIUS] + slack


@inlined
def yields_to(arc: Floats, owner: int, region: Floats, rank: int) -> bool:
    """Whether an arc gives way where the front of another region coincides with it.

    A line takes precedence over a circle, which may touch it. Of two circles, or two lines, the
    first takes precedence. Of lines that face each other neither counts: nothing is farther between
    them.
    """
    if is_line(arc) != is_line(region):
        return is_line(region)
    return rank < owner or arc[EX] * region[EX] + arc[EY] * region[EY] < 0.0


@kernel
def outer_arcs(topology: Any, face: int, regions: Floats, level: float, shortest: float) -> Floats:
    """Return the outline of the union of the regions in the face: arcs in no other region.

    Where fronts coincide within `LEVEL`, one of them takes precedence (`yields_to`). That front
    loses only what another region holds by more than the tolerance. The others lose all that the
    first region holds within it. Arcs not longer than ``shortest`` are left out. O(n² log n) for n
    regions.
    """
    slack, regions = LEVEL * level, borrowed(regions)
    arcs, owners = arcs_within(topology, face, regions, slack)
    outer, count = np.empty((len(arcs) + 4, ARC)), 0
    free, scratch = np.empty((ROWS, 2)), np.empty((INTERVALS, 2))
    for a in range(len(arcs)):
        arc = arcs[a]
        free, left = free_intervals(arc, owners[a], regions, slack, scratch, free)
        outer = with_room(outer, count + left)
        for k in range(left):
            put_arc(outer[count], arc, free[k, 0], free[k, 1])
            if length_of(outer[count]) > shortest:
                count += 1
    return outer[:count]


@inlined
def free_intervals(
    arc: Floats, owner: int, regions: Floats, slack: float, scratch: Floats, free: Floats
) -> tuple[Floats, int]:
    """Return the intervals of an arc that no other region holds, and how many there are.

    The intervals are written to ``free``, or to a larger array.
    """
    arc, scratch = borrowed(arc), borrowed(scratch)
    start, end, hidden = arc[START], arc[END], 0
    chord, half = chord_of(arc, start, end), 0.5 * length_of(arc)
    for j in range(len(regions)):
        if j == owner:
            continue
        region = regions[j]
        beyond = slack if yields_to(arc, owner, region, j) else -slack
        if is_apart(chord, half, region, beyond):
            continue
        scratch[0, 0], scratch[0, 1] = start, end
        held = clip_to_region(scratch, arc, region, beyond)
        free, hidden = hide(free, hidden, scratch, held, start, end)
        if hidden == ALL:
            break
    return left_over(free, hidden, start, end)
