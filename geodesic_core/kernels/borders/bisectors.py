r"""Bisectors of two regions in a face, in closed form: hyperbolas, parabolas and straight lines.

Each region of a face (`regions`) has a distance function: D(p) = σ + |p - c| of a disc, and a
linear one of a band. Seen from the centre c of a disc, at an angle φ, another region is nearer
beyond the radius r(φ) = q / w(φ), where w(φ) = k + gx cos φ + gy sin φ::

                  \   |
          c        |  |  b       |p - b| < |p - c| + k holds where r > (d² - k²) / 2 / w(φ),
           *------>+--|-*        for d = |b - c|, g = b - c and k = σc - σb
              r   |   |
                 /    |

A straight line has such a form as well: the side of a region, or the edge of a face. So all
conditions on a bisector are of the form α + β cos φ + γ sin φ >= 0, and each holds on one interval
of angles. The bisector of two bands is a straight line, on which each holds on one interval too.

All is planar, in the frame of the face's first half-edge.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.isolines.arcs import (
    INTERVALS,
    ROWS,
    TURN,
    clip,
    clip_line,
    insert_interval,
    with_room,
)
from geodesic_core.kernels.isolines.regions import (
    CX,
    CY,
    DEPTH,
    EX,
    EY,
    FRONT,
    NX,
    NY,
    OVER,
    RADIUS,
    SIDE,
    end_of_sides,
    is_line,
    span_in_half_plane,
)
from geodesic_core.kernels.jit import borrowed, kernel
from geodesic_core.kernels.mesh.half_edges import half_edge_in_face

# Columns of a bisector; the first five as those of a front: the centre c, or a line
Q = FRONT
K = FRONT + 1
GX = FRONT + 2
GY = FRONT + 3
START = FRONT + 4  # parameter at which the piece starts: an angle, or a distance along the line
END = FRONT + 5
LEFT = FRONT + 6  # the source that is nearest on the left
RIGHT = FRONT + 7
BISECTOR = FRONT + 8

PARALLEL = 1e-6
"""Sine of an angle below which two rays count as parallel: where they meet is not sure enough."""

FARTHER, NEARER, BEYOND = -1, 1, 0
"""Another region is farther than one everywhere, nearer everywhere, or nearer beyond a bisector."""


class Regions(NamedTuple):
    """The regions of a face that are to be compared, and how."""

    rows: Floats
    """(n, REGION)"""
    labels: Ints
    """(n, 1): the source of each"""
    level: float
    """The distance up to which they reach; mesh units"""
    slack: float
    """Differences of distances up to this count as rounding"""


@kernel
def linear(region: Floats, level: float) -> tuple[float, float, float]:
    """Return m, nx and ny of a band, whose distance function is m + n·p."""
    ex, ey = region[EX], region[EY]
    return level + ex * region[CY] - ey * region[CX], ey, -ex


@kernel
def distance_to(region: Floats, level: float, x: float, y: float) -> float:
    """Return what the distance function of a region is at a point, its sides disregarded."""
    if is_line(region):
        m, nx, ny = linear(region, level)
        return m + nx * x + ny * y
    return level - region[RADIUS] + math.hypot(x - region[CX], y - region[CY])


@kernel
def seen_from(
    disc: Floats, other: Floats, level: float, favour: float, slack: float
) -> tuple[int, float, float, float, float]:
    """Return where another region is nearer than a disc: its kind, then q, k, gx and gy.

    The other one counts as nearer than it is by ``favour``. What differs nowhere by more than
    ``slack`` on one side of the bisector has none: it would be a ray, by rounding.
    """
    cx, cy = disc[CX], disc[CY]
    sigma = level - disc[RADIUS]
    if is_line(other):
        m, nx, ny = linear(other, level)
        q = m + nx * cx + ny * cy - sigma - favour
        return (NEARER if q <= slack else BEYOND), q, 1.0, -nx, -ny
    gx, gy = other[CX] - cx, other[CY] - cy
    d, k = math.hypot(gx, gy), other[RADIUS] - disc[RADIUS] + favour
    kind = BEYOND
    if k <= slack - d:
        kind = FARTHER
    elif k >= d - slack:
        kind = NEARER
    return kind, 0.5 * (d - k) * (d + k), k, gx, gy


@kernel
def clip_angles(intervals: Floats, count: int, alpha: float, beta: float, gamma: float) -> int:
    """Cut ``intervals`` of angles to α + β cos φ + γ sin φ >= 0; return how many are left."""
    if count == 0:
        return 0
    swing = math.hypot(beta, gamma)
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
    """Cut ``intervals`` of a bisector to the half-plane n·p >= 0; return how many are left.

    Its (CX, CY) is ``depth`` inside; n is a unit vector, or zero where nothing is to be cut.
    """
    if count == 0 or (nx == 0.0 and ny == 0.0):
        return count
    if is_line(curve):
        return clip_line(intervals, depth, nx * curve[EX] + ny * curve[EY])
    alpha, q = depth * curve[K], curve[Q]
    return clip_angles(
        intervals, count, alpha, depth * curve[GX] + q * nx, depth * curve[GY] + q * ny
    )


@kernel
def clip_to_sides(intervals: Floats, count: int, curve: Floats, region: Floats) -> int:
    """Cut ``intervals`` of a bisector to the sides of a region; return how many are left."""
    dx, dy = curve[CX] - region[CX], curve[CY] - region[CY]
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * dx + ny * dy
        count = clip_to_half_plane(intervals, count, curve, depth, nx, ny)
    return count


@kernel
def clip_to_nearer(
    intervals: Floats,
    count: int,
    curve: Floats,
    region: Floats,
    other: Floats,
    level: float,
    favour: float,
) -> int:
    """Cut ``intervals`` of a bisector of ``region`` to where another one is nearer than that.

    Returns how many are left. The other one counts as nearer than it is by ``favour``.
    """
    if count == 0:
        return 0
    if not is_line(curve):
        kind, q, k, gx, gy = seen_from(region, other, level, favour, 0.0)
        if kind != BEYOND:
            return count if kind == NEARER else 0
        here = curve[Q]
        return clip_angles(
            intervals, count, here * k - q * curve[K], here * gx - q * curve[GX],
            here * gy - q * curve[GY],
        )  # fmt: skip
    ex, ey = curve[EX], curve[EY]
    m, nx, ny = linear(region, level)
    start, rate = m + nx * curve[CX] + ny * curve[CY] + favour, nx * ex + ny * ey
    lo, hi = intervals[0, 0], intervals[0, 1]
    if is_line(other):
        m, nx, ny = linear(other, level)
        start -= m + nx * curve[CX] + ny * curve[CY]
        lo, hi = span_in_half_plane(lo, hi, start, rate - nx * ex - ny * ey)
    else:
        dx, dy = curve[CX] - other[CX], curve[CY] - other[CY]
        low, high = span_in_cone(dx, dy, ex, ey, start - (level - other[RADIUS]), rate)
        lo, hi = max(lo, low), min(hi, high)
    intervals[0, 0], intervals[0, 1] = lo, hi
    return 1 if lo < hi else 0


@kernel
def span_in_cone(
    dx: float, dy: float, ex: float, ey: float, start: float, rate: float
) -> tuple[float, float]:
    """Return the interval of t in which |d + t e| < ``start + rate t``; empty where lo > hi.

    The left side is convex, and e is a unit vector, along which the right side rises by less.
    """
    a = (1.0 - rate) * (1.0 + rate)
    b = dx * ex + dy * ey - start * rate
    c = dx * dx + dy * dy - start * start
    spare = b * b - a * c
    if a <= 0.0 or spare <= 0.0:
        return 1.0, 0.0
    middle, half = -b / a, math.sqrt(spare) / a
    if start + rate * middle <= 0.0:
        return 1.0, 0.0
    return middle - half, middle + half


@kernel
def put_bisector(
    curve: Floats, intervals: Floats, disc: Floats, other: Floats, level: float, slack: float,
    middle: Any,
) -> int:  # fmt: skip
    """Make ``curve`` the bisector of two regions, of which the first is no band if one is none.

    Writes its whole range to ``intervals``; returns 1, or 0 where there is none. A whole turn
    begins where it is farthest from ``middle``; ``slack`` is as in `seen_from`.
    """
    if is_line(disc):
        m0, nx0, ny0 = linear(disc, level)
        m1, nx1, ny1 = linear(other, level)
        nx, ny = nx1 - nx0, ny1 - ny0
        turn = math.hypot(nx, ny)
        if turn <= 0.0:
            return 0
        nx, ny = nx / turn, ny / turn
        curve[CX], curve[CY] = nx * (m0 - m1) / turn, ny * (m0 - m1) / turn
        curve[RADIUS], curve[EX], curve[EY] = math.inf, ny, -nx
        intervals[0, 0], intervals[0, 1] = -math.inf, math.inf
        return 1
    kind, q, k, gx, gy = seen_from(disc, other, level, 0.0, slack)
    if kind != BEYOND:
        return 0
    curve[CX], curve[CY], curve[RADIUS], curve[EX], curve[EY] = disc[CX], disc[CY], 0.0, 0.0, 0.0
    curve[Q], curve[K], curve[GX], curve[GY] = q, k, gx, gy
    swing = math.hypot(gx, gy)
    if k >= swing:
        away_x, away_y = disc[CX] - middle[0], disc[CY] - middle[1]
        first = math.atan2(away_y, away_x) if swing == 0.0 else math.atan2(-gy, -gx)
        intervals[0, 0], intervals[0, 1] = first, first + TURN
    else:
        half = math.acos(-k / swing)
        first = math.atan2(gy, gx) - half
        intervals[0, 0], intervals[0, 1] = first, first + 2.0 * half
    return 1


@kernel
def point_on(curve: Floats, parameter: float) -> tuple[float, float]:
    """Point of a bisector at a parameter."""
    x, y = curve[CX], curve[CY]
    if is_line(curve):
        return x + parameter * curve[EX], y + parameter * curve[EY]
    cosine, sine = math.cos(parameter), math.sin(parameter)
    r = curve[Q] / (curve[K] + curve[GX] * cosine + curve[GY] * sine)
    return x + r * cosine, y + r * sine


@kernel
def direction_at(curve: Floats, parameter: float) -> tuple[float, float]:
    """Return the unit vector along a conic at a parameter, toward larger ones."""
    cosine, sine = math.cos(parameter), math.sin(parameter)
    w = curve[K] + curve[GX] * cosine + curve[GY] * sine
    turn = curve[GX] * sine - curve[GY] * cosine  # -w'
    x, y = turn * cosine - w * sine, turn * sine + w * cosine
    length = math.hypot(x, y)
    return x / length, y / length


@kernel
def strays(curve: Floats, start: float, end: float, enough: float) -> float:
    """Return an upper bound of how far a conic strays from the chord between two parameters.

    It is convex: between the chord and the tangents at its ends. Chords no longer than ``enough``
    count as exact.
    """
    x0, y0 = point_on(curve, start)
    x1, y1 = point_on(curve, end)
    ux, uy = direction_at(curve, start)
    vx, vy = direction_at(curve, end)
    length = math.hypot(x1 - x0, y1 - y0)
    if length <= enough:
        return 0.0
    ex, ey = (x1 - x0) / length, (y1 - y0) / length
    rise, fall = abs(ex * uy - ey * ux), abs(ex * vy - ey * vx)
    if ex * ux + ey * uy <= 0.5 or ex * vx + ey * vy <= 0.5:  # more than a third of half a turn
        return math.inf
    whole = rise * (ex * vx + ey * vy) + fall * (ex * ux + ey * uy)
    return length * rise * fall / whole if whole > 0.0 else 0.0


@kernel
def is_one_sided(geometry: Floats, face: int, region: Floats, other: Floats, slack: float) -> bool:
    """Whether one of two windows is nearer wherever the rays of both meet: a cheap test.

    The rays meet in a quadrilateral whose sides are rays of the one or of the other. Along a ray
    the difference of the distances changes its sign once at most, so its corners tell.
    """
    if min(region[OVER], other[OVER]) < 0.0 or is_line(region) or is_line(other):
        return False
    _, _, ux, uy = half_edge_in_face(geometry, 3 * face + int(region[OVER]))
    _, _, vx, vy = half_edge_in_face(geometry, 3 * face + int(other[OVER]))
    dx, dy = other[CX] - region[CX], other[CY] - region[CY]
    sign = 0
    for end in range(2):
        side = FRONT + SIDE * end
        ex, ey = region[side + NY], -region[side + NX]  # along the ray, into the face
        if ux * ey - uy * ex < 0.0:
            ex, ey = -ex, -ey
        for end1 in range(2):
            side1 = FRONT + SIDE * end1
            fx, fy = other[side1 + NY], -other[side1 + NX]
            if vx * fy - vy * fx < 0.0:
                fx, fy = -fx, -fy
            cross = ex * fy - ey * fx
            if abs(cross) < PARALLEL:
                return False
            along, along1 = (dx * fy - dy * fx) / cross, (dx * ey - dy * ex) / cross
            if along <= 0.0 or along1 <= 0.0:
                return False
            difference = along - region[RADIUS] - (along1 - other[RADIUS])
            if abs(difference) <= slack or difference * sign < 0.0:
                return False
            sign = 1 if difference > 0.0 else -1
    return True


@kernel
def bisectors_within(topology: Any, face: int, regions: Regions, shortest: float) -> Floats:
    """Return the pieces of bisectors that are borders in a face: nothing else is nearer there.

    Of regions that are equally near within the slack everywhere, the first takes precedence. Pieces
    not longer than ``shortest`` are left out. O(n³) for n regions.
    """
    geometry, regions = topology.geometry, borrowed(regions)
    rows, labels, level, slack = regions.rows, regions.labels, regions.level, regions.slack
    pieces, count = np.empty((ROWS, BISECTOR)), 0
    curve, intervals = np.zeros(BISECTOR), np.empty((INTERVALS, 2))
    hidden, one = np.empty((ROWS, 2)), np.empty((INTERVALS, 2))
    ax, ay, ux, uy = half_edge_in_face(geometry, 3 * face + 2)
    middle = (geometry[3 * face, 0] + ax) / 3.0, ay / 3.0
    for i in range(len(rows)):
        for j in range(len(rows)):
            if labels[i, 0] == labels[j, 0] or is_line(rows[i]) > is_line(rows[j]):
                continue
            if i > j and is_line(rows[i]) == is_line(rows[j]):
                continue
            if is_one_sided(geometry, face, rows[i], rows[j], slack):
                continue
            left = put_bisector(curve, intervals, rows[i], rows[j], level, slack, middle)
            for h in range(3 * face, 3 * face + 3):
                ox, oy, ux, uy = half_edge_in_face(geometry, h)
                depth = ux * (curve[CY] - oy) - uy * (curve[CX] - ox)
                left = clip_to_half_plane(intervals, left, curve, depth, -uy, ux)
            left = clip_to_sides(intervals, left, curve, rows[i])
            left = clip_to_sides(intervals, left, curve, rows[j])
            for k in range(left):
                start, end = intervals[k, 0], intervals[k, 1]
                hidden, hides = hidden_intervals(curve, start, end, regions, i, j, one, hidden)
                pieces = with_room(pieces, count + max(hides, 0) + 1)
                for n in range(hides + 1):
                    stop = hidden[n, 0] if n < hides else end
                    if stop > start:
                        for column in range(BISECTOR):
                            pieces[count, column] = curve[column]
                        piece = pieces[count]
                        piece[START], piece[END] = start, stop
                        piece[LEFT], piece[RIGHT] = labels[i, 0], labels[j, 0]
                        x0, y0 = point_on(piece, start)
                        x1, y1 = point_on(piece, stop)
                        if math.hypot(x1 - x0, y1 - y0) > shortest:
                            count += 1
                    if n < hides:
                        start = max(start, hidden[n, 1])
    return pieces[:count]


@kernel
def chord_of(curve: Floats, start: float, end: float) -> tuple[float, float, float, float, float]:
    """Return the ends of a piece of a bisector, and how far it may stray from its chord."""
    x0, y0 = point_on(curve, start)
    x1, y1 = point_on(curve, end)
    sagitta = 0.0 if is_line(curve) else strays(curve, start, end, 0.0)
    return x0, y0, x1, y1, sagitta


@kernel
def is_apart(chord: Any, region: Floats) -> bool:
    """Whether a piece of a bisector is surely beyond a side of a region: a cheap test."""
    x0, y0, x1, y1, sagitta = chord
    x0, y0, x1, y1 = x0 - region[CX], y0 - region[CY], x1 - region[CX], y1 - region[CY]
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        if max(nx * x0 + ny * y0, nx * x1 + ny * y1) + region[side + DEPTH] + sagitta < 0.0:
            return True
    return False


@kernel
def hidden_intervals(
    curve: Floats, start: float, end: float, regions: Regions, i: int, j: int, one: Floats,
    hidden: Floats,
) -> tuple[Floats, int]:  # fmt: skip
    """Return the intervals of a bisector of regions i and j that others hold, and their number.

    They are sorted, and written to ``hidden``, or to a larger array. Their number is -1 where one
    region holds all of the piece from ``start`` to ``end``. ``one`` is scratch memory.
    """
    curve, rows, labels = borrowed(curve), borrowed(regions.rows), borrowed(regions.labels)
    count, chord = 0, chord_of(curve, start, end)
    for c in range(len(rows)):
        if c in (i, j) or is_apart(chord, rows[c]):
            continue
        own = i if labels[c, 0] == labels[i, 0] else j
        precedes = labels[c, 0] == labels[own, 0] and c < own
        favour = regions.slack if precedes else -regions.slack
        one[0, 0], one[0, 1] = start, end
        left = clip_to_nearer(one, 1, curve, rows[i], rows[c], regions.level, favour)
        left = clip_to_sides(one, left, curve, rows[c])
        if left == 1 and one[0, 0] <= start and one[0, 1] >= end:
            return hidden, -1
        hidden = with_room(hidden, count + left)
        for k in range(left):
            insert_interval(hidden, count, one[k, 0], one[k, 1])
            count += 1
    return hidden, count
