"""Segments enforced in the triangulation of one face, so that each is a chain of its edges.

A segment is flipped into place (Sloan, 1993). Where it meets another one, the crossing, rounded to
the grid, becomes a point, and the pieces of both are enforced anew. As in snap rounding, a segment
that passes NEAR a point runs through it.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Longs
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.cutting.predicates import (
    NEAR,
    STEPS,
    is_beside,
    is_on_border,
    twice_area,
)
from geodesic_core.kernels.cutting.triangulation import (
    POINTS,
    TRIANGLES,
    add_place,
    edge_between,
    flip,
    following,
    insert,
    next_leaving,
    point_near,
    previous,
    triangle_at,
)
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.outcome import Outcome

WAITING, OWNERS, ENFORCED = 0, 1, 2

# What a segment meets first
ITS_END, A_POINT, A_SEGMENT, NOTHING = 0, 1, 2, 3

_TURNS = 50  # flips for each pair of crossing edges, at most
_MOST = 1000  # enforced pieces for each segment and point of a face, at most


class Segments(NamedTuple):
    """The segments of a face: those that wait, and the owners of those that are edges."""

    waiting: Longs
    """(s, 3): both points, and the curve"""
    owners: Longs
    """(c, 2): a curve, and the row of the next owner of the same edge; 0 for none"""
    sizes: Longs
    """(3,): number of WAITING segments, of rows of OWNERS, and of ENFORCED pieces"""


@kernel
def with_segments(s: Any, waiting: int, owners: int) -> Segments:
    """Return the segments with room for some more: in the same arrays, or larger."""
    return Segments(
        with_room(s.waiting, s.sizes[WAITING] + waiting),
        with_room(s.owners, s.sizes[OWNERS] + owners),
        s.sizes,
    )


@kernel
def add_segment(s: Any, i: int, j: int, curve: int) -> Segments:
    """Return the segments with one more that waits."""
    s = with_segments(s, 1, 0)
    row = s.sizes[WAITING]
    s.waiting[row, 0], s.waiting[row, 1], s.waiting[row, 2] = i, j, curve
    s.sizes[WAITING] += 1
    return s


@kernel
def claim(t: Any, s: Any, h: int, curve: int) -> Segments:
    """Return the segments, after making the edge of h one of a curve."""
    row = t.claims[h]
    while row > 0:
        if s.owners[row, 0] == curve:
            return s
        row = s.owners[row, 1]
    s = with_segments(s, 0, 1)
    row = s.sizes[OWNERS]
    s.owners[row, 0], s.owners[row, 1] = curve, t.claims[h]
    s.sizes[OWNERS] += 1
    t.claims[h] = row
    if t.twins[h] >= 0:
        t.claims[t.twins[h]] = row
    return s


@kernel
def lead_through(t: Any, s: Any, h: int, p: int) -> Segments:
    """Return the segments, after the edge of h is theirs no more: they wait to run through p."""
    i, j, row = t.tails[h], t.tails[following(h)], t.claims[h]
    t.claims[h] = 0
    if t.twins[h] >= 0:
        t.claims[t.twins[h]] = 0
    while row > 0:
        s = add_segment(add_segment(s, i, p, s.owners[row, 0]), p, j, s.owners[row, 0])
        row = s.owners[row, 1]
    return s


@kernel
def enforce(t: Any, s: Any) -> tuple[Segments, int, bool]:
    """Take a segment that waits, and make it an edge or pieces that wait.

    Returns the segments, the outcome, and whether a point of the face's border was made. There must
    be room for a point.
    """
    s.sizes[WAITING] -= 1
    row = s.sizes[WAITING]
    i, j, curve = s.waiting[row, 0], s.waiting[row, 1], s.waiting[row, 2]
    s.sizes[ENFORCED] += 1
    if s.sizes[ENFORCED] > _MOST * (s.sizes[OWNERS] + t.sizes[POINTS]):
        return s, Outcome.LOST, False
    if i == j:
        return s, Outcome.FINISHED, False
    crossed = np.empty((8, 2), np.int64)
    met, what, crossed, count = first_met(t, i, j, crossed)
    if met == NOTHING:
        return s, Outcome.LOST, False
    if met == ITS_END:
        if what < 0:
            what = flip_away(t, i, j, crossed, count)
        if what < 0:
            return s, Outcome.LOST, False
        return claim(t, s, what, curve), Outcome.FINISHED, False
    is_wish = False
    if met == A_SEGMENT:
        h, known = what, t.sizes[POINTS]
        what = crossing_of(t, i, j, h)
        if what < 0:
            return s, Outcome.LOST, False
        is_wish = t.sizes[POINTS] > known and is_on_border(t.places, what)
        h = edge_between(t, crossed[count, 0], crossed[count, 1])
        if h >= 0:
            s = lead_through(t, s, h, what)
    s = add_segment(add_segment(s, i, what, curve), what, j, curve)
    return s, Outcome.FINISHED, is_wish


@kernel
def first_met(t: Any, i: int, j: int, crossed: Longs) -> tuple[int, int, Longs, int]:
    """Return what the segment from i to j meets first, and the edges of no segment before that.

    With ITS_END the edge that it is, or -1; with A_POINT the point beside it; with A_SEGMENT an
    edge, which then follows those in ``crossed``, (n, 2) points.
    """
    h, edge, start = -1, -1, t.leaving[i]
    g = start
    while g >= 0:
        right, left = t.tails[following(g)], t.tails[previous(g)]
        for k, e in ((right, g), (left, previous(g))):
            if k == j:
                edge = e
            elif is_beside(t.places, i, j, k):
                return A_POINT, k, crossed, 0
        if twice_area(t.places, i, j, right) < 0.0 < twice_area(t.places, i, j, left):
            h = following(g)
        g = next_leaving(t, g)
        if g == start:
            break
    if edge >= 0:
        return ITS_END, edge, crossed, 0
    count = 0
    while h >= 0:  # from right to left, in the triangle that the segment is to leave
        crossed = with_room(crossed, count + 1)
        crossed[count, 0], crossed[count, 1] = t.tails[h], t.tails[following(h)]
        if t.claims[h] > 0:
            return A_SEGMENT, h, crossed, count
        count += 1
        g = t.twins[h]
        if g < 0:
            break
        k = t.tails[previous(g)]
        if k == j:
            return ITS_END, -1, crossed, count
        if is_beside(t.places, i, j, k):
            return A_POINT, k, crossed, 0
        h = following(g) if twice_area(t.places, i, j, k) > 0.0 else previous(g)
    return NOTHING, -1, crossed, 0


@kernel
def crossing_of(t: Any, i: int, j: int, h: int) -> int:
    """Return the point where the segment from i to j crosses the edge of h; -1 if it is lost.

    A known point that is near, or a new one; NEAR the border of the face it is on the border.
    """
    u, v = t.tails[h], t.tails[following(h)]
    before, after = abs(twice_area(t.places, i, j, u)), abs(twice_area(t.places, i, j, v))
    share = before / (before + after)
    x = t.places[u, 0] + np.int64(np.rint(share * float(t.places[v, 0] - t.places[u, 0])))
    y = t.places[u, 1] + np.int64(np.rint(share * float(t.places[v, 1] - t.places[u, 1])))
    z = STEPS - x - y
    if x <= NEAR and x <= min(y, z):
        x = 0
    elif y <= NEAR and y <= z:
        y = 0
    elif z <= NEAR:
        x += z
    p = add_place(t, x, y, -1)
    triangle = triangle_at(t, p, h)
    if triangle < 0:
        return -1
    near = point_near(t, triangle, p, 2 * NEAR)
    if near >= 0:
        return near
    insert(t, triangle, p)
    return p


@kernel
def flip_away(t: Any, i: int, j: int, crossed: Longs, count: int) -> int:
    """Flip the edges that the segment from i to j crosses, and return its own edge; -1 if not.

    A queue: an edge that cannot be flipped now, or crosses still, comes again after the others.
    """
    for _ in range(_TURNS * count * (count + 1)):
        if count == 0:
            break
        h = edge_between(t, crossed[0, 0], crossed[0, 1])
        for k in range(1, count):
            crossed[k - 1, 0], crossed[k - 1, 1] = crossed[k, 0], crossed[k, 1]
        if flip(t, h):
            h = previous(h)
        if crosses(t.places, i, j, t.tails[h], t.tails[following(h)]):
            crossed[count - 1, 0], crossed[count - 1, 1] = t.tails[h], t.tails[following(h)]
        else:
            count -= 1
    return edge_between(t, i, j)


@kernel
def crosses(places: Longs, i: int, j: int, u: int, v: int) -> bool:
    """Whether the line from i to j passes between u and v, neither of which is i or j."""
    if u in (i, j) or v in (i, j):
        return False
    a, b = twice_area(places, i, j, u), twice_area(places, i, j, v)
    return a < 0.0 < b or b < 0.0 < a


@kernel
def lead_through_apexes(t: Any, s: Any) -> Segments:
    """Return the segments, with those waiting again whose edges have an apex beside them."""
    for h in range(3 * t.sizes[TRIANGLES]):
        if t.claims[h] > 0:
            i, j, apex = t.tails[h], t.tails[following(h)], t.tails[previous(h)]
            if is_beside(t.places, i, j, apex):
                s = lead_through(t, s, h, apex)
    return s
