r"""Bisectors of two regions in a face, in closed form: hyperbolas, parabolas and straight lines.

Each region of a face (`reached`) has a distance function. It is D(p) = σ + |p - c| of a disc, and
linear of a band. Take a disc around c, and another region that is nearer from some distance on. As
seen from c the bisector of the two is a conic with its focus at c (`conics`), beyond which the
other region is nearer::

                  \   |
          c        |  |  b       |p - b| < |p - c| + k holds where r > (d² - k²) / 2 / w(φ),
           *------>+--|-*        for d = |b - c|, g = b - c and k = σc - σb
              r   |   |
                 /    |

The bisector of two bands is a straight line.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.clipping import (
    ALL,
    INTERVALS,
    clip_angles,
    clip_to_edge,
    clip_to_sides,
    hide,
    left_over,
)
from geodesic_core.kernels.curves.conics import (
    ARC,
    CX,
    CY,
    EX,
    EY,
    GX,
    GY,
    K,
    Q,
    chord_of,
    is_line,
    point_on,
    put_arc,
    whole_range,
)
from geodesic_core.kernels.curves.regions import (
    NX,
    NY,
    RADIUS,
    SIDE,
    SIDES,
    is_beyond_side,
    span_in_half_plane,
)
from geodesic_core.kernels.curves.rows import ROWS, with_room
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import half_edge_in_face
from geodesic_core.kernels.retained.reached import OVER
from geodesic_core.tolerances import PARALLEL

# Columns of a bisector, after those of an arc
LEFT = ARC  # the source that is nearest on the left
RIGHT = ARC + 1
BISECTOR = ARC + 2

FARTHER, NEARER, BEYOND = -1, 1, 0
"""Another region is farther than one everywhere, nearer everywhere, or nearer beyond a bisector."""


class Regions(NamedTuple):
    """The regions of a face that are to be compared, and how."""

    rows: Floats
    """(n, REGION)"""
    labels: Ints
    """(n,): the source of each"""
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
        alpha = here * k - q * curve[K]
        beta, gamma = here * gx - q * curve[GX], here * gy - q * curve[GY]
        swing = math.hypot(beta, gamma)
        return clip_angles(intervals, count, alpha, beta, gamma, swing)
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
def put_bisector(curve: Floats, disc: Floats, other: Floats, level: float, slack: float) -> bool:
    """Make ``curve`` the bisector of two regions, of which the first is no band if one is none.

    Returns whether there is one; ``slack`` is as in `seen_from`.
    """
    if is_line(disc):
        m0, nx0, ny0 = linear(disc, level)
        m1, nx1, ny1 = linear(other, level)
        nx, ny = nx1 - nx0, ny1 - ny0
        turn = math.hypot(nx, ny)
        if turn <= 0.0:
            return False
        nx, ny = nx / turn, ny / turn
        curve[CX], curve[CY] = nx * (m0 - m1) / turn, ny * (m0 - m1) / turn
        curve[Q], curve[EX], curve[EY] = math.inf, ny, -nx
        return True
    kind, q, k, gx, gy = seen_from(disc, other, level, 0.0, slack)
    curve[CX], curve[CY], curve[Q] = disc[CX], disc[CY], q
    curve[K], curve[GX], curve[GY] = k, gx, gy
    return kind == BEYOND


@inlined
def ray_of(window: Floats, end: int, edge: Any) -> tuple[float, float]:
    """Return the unit vector along one of a window's two outermost rays, into the face."""
    _, _, ux, uy = edge
    side = SIDES + SIDE * end
    ex, ey = window[side + NY], -window[side + NX]
    return (ex, ey) if ux * ey - uy * ex >= 0.0 else (-ex, -ey)


@kernel
def is_one_sided(geometry: Floats, face: int, region: Floats, other: Floats, slack: float) -> bool:
    """Whether one of two windows is nearer wherever the rays of both meet: a cheap test.

    The rays meet in a quadrilateral whose sides are rays of the one or of the other. Along a ray
    the difference of the distances changes its sign once at most, so its corners tell.
    """
    if min(region[OVER], other[OVER]) < 0.0 or is_line(region) or is_line(other):
        return False
    edge = half_edge_in_face(geometry, 3 * face + int(region[OVER]))
    edge1 = half_edge_in_face(geometry, 3 * face + int(other[OVER]))
    dx, dy = other[CX] - region[CX], other[CY] - region[CY]
    sign = 0
    for corner in range(4):
        ex, ey = ray_of(region, corner // 2, edge)
        fx, fy = ray_of(other, corner % 2, edge1)
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
    whose chords are not longer than ``shortest`` are left out. O(n³) for n regions.
    """
    geometry, regions = topology.geometry, borrowed(regions)
    rows, labels = regions.rows, regions.labels
    pieces, count = np.empty((ROWS, BISECTOR)), 0
    curve, intervals = np.zeros(ARC), np.empty((INTERVALS, 2))
    free, scratch = np.empty((ROWS, 2)), np.empty((INTERVALS, 2))
    for i in range(len(rows)):
        for j in range(len(rows)):
            if not is_pair(regions, i, j):
                continue
            if is_one_sided(geometry, face, rows[i], rows[j], regions.slack):
                continue
            if not put_bisector(curve, rows[i], rows[j], regions.level, regions.slack):
                continue
            intervals[0, 0], intervals[0, 1] = whole_range(curve, geometry, face)
            left = 1
            for h in range(3 * face, 3 * face + 3):
                left = clip_to_edge(intervals, left, curve, geometry, h)
            left = clip_to_sides(intervals, left, curve, rows[i])
            left = clip_to_sides(intervals, left, curve, rows[j])
            for k in range(left):
                start, end = intervals[k, 0], intervals[k, 1]
                free, stretches = free_intervals(curve, start, end, regions, i, j, scratch, free)
                pieces = with_room(pieces, count + stretches)
                for n in range(stretches):
                    put_arc(pieces[count], curve, free[n, 0], free[n, 1])
                    pieces[count, LEFT], pieces[count, RIGHT] = labels[i], labels[j]
                    if has_chord_over(shortest, curve, free[n, 0], free[n, 1]):
                        count += 1
    return pieces[:count]


@inlined
def is_pair(regions: Regions, i: int, j: int) -> bool:
    """Whether regions i and j have a bisector that is asked for, in this order.

    They are of different sources. A disc comes before a band. Of two discs, or two bands, that with
    the lower row comes first.
    """
    is_line0, is_line1 = is_line(regions.rows[i]), is_line(regions.rows[j])
    if regions.labels[i] == regions.labels[j]:
        return False
    return i < j if is_line0 == is_line1 else is_line1


@inlined
def has_chord_over(shortest: float, curve: Floats, start: float, end: float) -> bool:
    """Whether the chord of a curve between two parameters is longer than ``shortest``."""
    x0, y0 = point_on(curve, start)
    x1, y1 = point_on(curve, end)
    return math.hypot(x1 - x0, y1 - y0) > shortest


@kernel
def free_intervals(
    curve: Floats, start: float, end: float, regions: Regions, i: int, j: int, scratch: Floats,
    free: Floats,
) -> tuple[Floats, int]:  # fmt: skip
    """Return the intervals of a bisector of regions i and j where no other is nearer.

    They lie between ``start`` and ``end``, and are written to ``free``, or to a larger array. Their
    number comes last.
    """
    curve, rows, labels = borrowed(curve), borrowed(regions.rows), borrowed(regions.labels)
    hidden, chord = 0, chord_of(curve, start, end)
    for c in range(len(rows)):
        if c in (i, j) or is_beyond_side(chord, rows[c]):
            continue
        own = i if labels[c] == labels[i] else j
        precedes = labels[c] == labels[own] and c < own
        favour = regions.slack if precedes else -regions.slack
        scratch[0, 0], scratch[0, 1] = start, end
        held = clip_to_nearer(scratch, 1, curve, rows[i], rows[c], regions.level, favour)
        held = clip_to_sides(scratch, held, curve, rows[c])
        free, hidden = hide(free, hidden, scratch, held, start, end)
        if hidden == ALL:
            break
    return left_over(free, hidden, start, end)
