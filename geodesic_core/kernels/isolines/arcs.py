r"""One level in one face: the edge of all that is nearer, in closed form.

What is no farther than a level is the union of all that reaches it (`regions`), cut to the face.
Its edge consists of arcs of their fronts: of each what lies in the face, between its sides, and in
none of the others::

              .---.
             / \ / \        Two discs of rays from below: of each circle that part counts
            /  |X|  \       which the other does not reach.
           |  / | \  |

Arcs are intervals of *places*: of a circle angles, counter-clockwise, and of a line distances from
where it begins; so that the nearer side is on their left.
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
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face
from geodesic_core.tolerances import LEVEL

# Columns of an arc, after those of its front
FROM = FRONT  # places
TO = FRONT + 1
ARC = FRONT + 2

TURN = 2.0 * math.pi
_INTERVALS = 16  # that a circle, a face and a region can have in common, at most


@kernel
def with_room(rows: Any, needed: int) -> Any:
    """Return the rows in an array that has room for so many."""
    if needed <= len(rows):
        return rows
    larger = np.empty((max(2 * len(rows), needed), rows.shape[1]), rows.dtype)
    for i in range(len(rows)):
        for column in range(rows.shape[1]):
            larger[i, column] = rows[i, column]
    return larger


@kernel
def point_on(front: Floats, place: float) -> tuple[float, float]:
    """Point of a front."""
    x, y = front[CX], front[CY]
    if is_line(front):
        return x + place * front[EX], y + place * front[EY]
    return x + front[RADIUS] * math.cos(place), y + front[RADIUS] * math.sin(place)


@kernel
def pace(front: Floats) -> float:
    """Length of a front per unit of its places."""
    return 1.0 if is_line(front) else front[RADIUS]


@kernel
def clip(intervals: Floats, count: int, start: float, width: float) -> int:
    """Cut intervals of angles to an arc; return how many are left."""
    cut, left = np.empty((_INTERVALS, 2)), 0
    for i in range(count):
        lo, hi = intervals[i, 0], intervals[i, 1]
        turn = start + TURN * math.floor((lo - start) / TURN)
        while turn < hi and left < _INTERVALS:
            a, b = max(turn, lo), min(turn + width, hi)
            if b > a:
                cut[left, 0], cut[left, 1] = a, b
                left += 1
            turn += TURN
    for i in range(left):
        intervals[i, 0], intervals[i, 1] = cut[i, 0], cut[i, 1]
    return left


@kernel
def clip_to_half_plane(
    intervals: Floats, count: int, front: Floats, depth: float, nx: float, ny: float
) -> int:
    """Cut intervals of a front to n·p >= 0, its (CX, CY) ``depth`` inside; n a unit, or zero."""
    if count == 0 or (nx == 0.0 and ny == 0.0):
        return count
    if is_line(front):
        lo, hi = intervals[0, 0], intervals[0, 1]
        lo, hi = span_in_half_plane(lo, hi, depth, nx * front[EX] + ny * front[EY])
        intervals[0, 0], intervals[0, 1] = lo, hi
        return 1 if lo < hi else 0
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
    """Cut intervals of a circle to a disc of radius ``other``, whose centre is at -(dx, dy)."""
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
    """Cut intervals of a front to the sides of a region."""
    dx, dy = front[CX] - region[CX], front[CY] - region[CY]
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * dx + ny * dy
        count = clip_to_half_plane(intervals, count, front, depth, nx, ny)
    return count


@kernel
def clip_to_region(intervals: Floats, front: Floats, region: Floats, slack: float) -> int:
    """Cut an interval of a front to a region, whose own front is moved outward by ``slack``."""
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

    Lines along an edge, within ``slack``, are in the faces beyond: rounding must not say.
    """
    geometry = topology.geometry
    arcs, owners, count = np.empty((len(regions), ARC)), np.empty((len(regions), 1), np.int32), 0
    intervals = np.empty((_INTERVALS, 2))
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
            if runs_along(region, slack, ox, oy, ux, uy, geometry[h, LENGTH]):
                if region[EX] * ux + region[EY] * uy > 0.0:  # what is nearer is in this face
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


@kernel
def put_arc(arc: Floats, front: Floats, start: float, end: float) -> None:
    """Make an arc of a front."""
    for column in range(FRONT):
        arc[column] = front[column]
    arc[FROM], arc[TO] = start, end


@kernel
def chord_of(arc: Floats) -> tuple[float, float, float, float, float, float]:
    """Return an arc's ends, how far it strays from their chord, and half its length."""
    width, radius = arc[TO] - arc[FROM], arc[RADIUS]
    x0, y0 = point_on(arc, arc[FROM])
    x1, y1 = point_on(arc, arc[TO])
    sagitta = 0.0
    if not is_line(arc):
        sagitta = 2.0 * radius
        if width < math.pi:
            sagitta = radius * (1.0 - math.cos(0.5 * width))
    return x0, y0, x1, y1, sagitta, 0.5 * pace(arc) * width


@kernel
def is_apart(chord: Any, region: Floats, slack: float) -> bool:
    """Whether an arc surely is beyond a region: asked first, without arctangents.

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


@kernel
def yields_to(arc: Floats, owner: int, region: Floats, rank: int) -> bool:
    """Whether an arc does not count where the front of another region coincides with it.

    Lines come before circles, which may touch them, then what is first. Of lines that face each
    other neither counts: nothing is farther between them.
    """
    if is_line(arc) != is_line(region):
        return is_line(region)
    return rank < owner or arc[EX] * region[EX] + arc[EY] * region[EY] < 0.0


@kernel
def outer_arcs(topology: Any, face: int, regions: Floats, level: float, shortest: float) -> Floats:
    """Return the edge of the union of the regions in the face: arcs that no other one reaches.

    Where fronts coincide within `LEVEL`, one of them counts (`yields_to`): of it nothing is taken
    that another does not reach by more, and from the others all that it reaches but for as much.
    What is not longer than ``shortest`` is left out. O(n² log n) for n regions.
    """
    slack = LEVEL * level
    arcs, owners = arcs_within(topology, face, regions, slack)
    outer, count = np.empty((len(arcs) + 4, ARC)), 0
    hidden, intervals = np.empty((64, 2)), np.empty((_INTERVALS, 2))
    for a in range(len(arcs)):
        arc, owner, hidden_count = arcs[a], owners[a, 0], 0
        lo, hi, chord = arc[FROM], arc[TO], chord_of(arc)
        for j in range(len(regions)):
            if j == owner:
                continue
            region = regions[j]
            beyond = slack if yields_to(arc, owner, region, j) else -slack
            if is_apart(chord, region, beyond):
                continue
            intervals[0, 0], intervals[0, 1] = lo, hi
            left = clip_to_region(intervals, arc, region, beyond)
            if left == 1 and intervals[0, 0] <= lo and intervals[0, 1] >= hi:
                lo = hi  # all of it: what others hide does not matter
                break
            hidden = with_room(hidden, hidden_count + left)
            for k in range(left):  # kept in order
                place = hidden_count
                while place > 0 and hidden[place - 1, 0] > intervals[k, 0]:
                    hidden[place, 0], hidden[place, 1] = hidden[place - 1, 0], hidden[place - 1, 1]
                    place -= 1
                hidden[place, 0], hidden[place, 1] = intervals[k, 0], intervals[k, 1]
                hidden_count += 1
        outer = with_room(outer, count + hidden_count + 1)
        for k in range(hidden_count + 1):
            end = hidden[k, 0] if k < hidden_count else hi
            if (end - lo) * pace(arc) > shortest:
                put_arc(outer[count], arc, lo, end)
                count += 1
            if k < hidden_count:
                lo = max(lo, hidden[k, 1])
    return outer[:count]
