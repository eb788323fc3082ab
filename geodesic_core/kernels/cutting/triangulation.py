r"""The triangulation of one face: points are inserted, edges are flipped.

Half-edge ``h`` of triangle ``h // 3`` leaves its *tail* and has the triangle on its left; its
*twin* runs the other way in the triangle beyond, and is -1 on an edge of the face. Triangles never
turn over: a point goes into the triangle that contains it, and an edge is flipped only where both
new triangles run counter-clockwise, by exact signs.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.cutting.predicates import (
    STEPS,
    apart,
    is_on_border,
    twice_area,
)
from geodesic_core.kernels.jit import kernel

POINTS, TRIANGLES = 0, 1
FLAT_ENOUGH = 1e-9  # sum of two cotangents up to which an edge is not flipped: rounding


class Triangulation(NamedTuple):
    """Points and triangles of a face, in arrays with room for more."""

    places: Longs
    """(n, 2): see `predicates`"""
    names: Longs
    """(n,): the caller's numbers of points; -1 of those that it does not know"""
    leaving: Longs
    """(n,): a half-edge that leaves each point; on an edge of the face the clockwise-most"""
    tails: Longs
    """(3m,)"""
    twins: Longs
    """(3m,)"""
    claims: Longs
    """(3m,): the first row of the segments' owners that the edge belongs to; 0 for none"""
    sizes: Longs
    """(2,): number of POINTS and of TRIANGLES"""


@kernel
def roomy(t: Any, points: int) -> Triangulation:
    """Return the triangulation with room for some more points: in the same arrays, or larger."""
    n, m = t.sizes[POINTS] + points, 3 * (t.sizes[TRIANGLES] + 2 * points)
    return Triangulation(
        with_room(t.places, n),
        with_room(t.names, n),
        with_room(t.leaving, n),
        with_room(t.tails, m),
        with_room(t.twins, m),
        with_room(t.claims, m),
        t.sizes,
    )


@kernel
def following(h: int) -> int:
    """Half-edge after h in its triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def previous(h: int) -> int:
    """Half-edge before h in its triangle."""
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def begin(t: Any) -> None:
    """Become the face itself, as one triangle of three points."""
    t.sizes[POINTS], t.sizes[TRIANGLES] = 3, 1
    for k in range(3):
        t.places[k, 0], t.places[k, 1] = STEPS * (k == 1), STEPS * (k == 2)
        put(t, k, k, -1, 0)


@kernel
def put(t: Any, h: int, tail: int, twin: int, claim: int) -> None:
    """Write a half-edge, and link it with its twin."""
    t.tails[h], t.twins[h], t.claims[h] = tail, twin, claim
    if twin >= 0:
        t.twins[twin] = h
    if twin < 0 or not is_on_border(t.places, tail):
        t.leaving[tail] = h


@kernel
def next_leaving(t: Any, h: int) -> int:
    """Half-edge that leaves the tail of h next, counter-clockwise; -1 on an edge of the face."""
    return t.twins[previous(h)]


@kernel
def edge_between(t: Any, i: int, j: int) -> int:
    """Return a half-edge of the edge between two points, from i to j if there is one; else -1."""
    start = t.leaving[i]
    h = start
    while True:
        if t.tails[following(h)] == j:
            return h
        last = previous(h)
        h = next_leaving(t, h)
        if h < 0:
            return last if t.tails[last] == j else -1
        if h == start:
            return -1


@kernel
def add_place(t: Any, x: int, y: int, name: int) -> int:
    """Write a point, which is in no triangle as yet; return it. There must be room."""
    p = t.sizes[POINTS]
    t.places[p, 0], t.places[p, 1], t.names[p] = x, y, name
    return p


@kernel
def triangle_at(t: Any, p: int, h: int) -> int:
    """Return the triangle that contains a point, walking from that of h; -1 if it is not found.

    The edge to leave by is chosen by turns: a fixed order may go round in circles.
    """
    triangle, turn = h // 3, 1
    for _ in range(100 + 20 * t.sizes[TRIANGLES]):
        turn = (turn * 1103515245 + 12345) & 0x7FFFFFFF
        beyond = -2
        for k in range(3):
            g = 3 * triangle + (k + (turn >> 16)) % 3
            if twice_area(t.places, t.tails[g], t.tails[following(g)], p) < 0.0:
                beyond = t.twins[g]
                break
        if beyond == -2:
            return triangle
        if beyond < 0:
            return -1
        triangle = beyond // 3
    return -1


@kernel
def point_near(t: Any, triangle: int, p: int, reach: int) -> int:
    """Return the corner of a triangle, or of one beside it, that is nearest to a point in it.

    -1 where none is within reach.
    """
    nearest, best = -1, reach + 1
    for h in range(3 * triangle, 3 * triangle + 3):
        for g in (h, t.twins[h]):
            if g >= 0:
                corner = t.tails[previous(g)]
                if apart(t.places, corner, p) < best:
                    nearest, best = corner, apart(t.places, corner, p)
    return nearest


@kernel
def insert(t: Any, triangle: int, p: int) -> None:
    """Insert the last written point, which is in a triangle or on one of its edges."""
    t.sizes[POINTS] = p + 1
    for h in range(3 * triangle, 3 * triangle + 3):
        if twice_area(t.places, t.tails[h], t.tails[following(h)], p) == 0.0:
            split_edge(t, h, p)
            return
    a, b, c = 3 * triangle, 3 * t.sizes[TRIANGLES], 3 * t.sizes[TRIANGLES] + 3
    t.sizes[TRIANGLES] += 2
    put(t, b, t.tails[a + 1], t.twins[a + 1], t.claims[a + 1])
    put(t, c, t.tails[a + 2], t.twins[a + 2], t.claims[a + 2])
    put(t, a + 1, t.tails[b], b + 2, 0)
    put(t, b + 1, t.tails[c], c + 2, 0)
    put(t, c + 1, t.tails[a], a + 2, 0)
    for h in (a + 2, b + 2, c + 2):
        put(t, h, p, t.twins[h], 0)


@kernel
def split_edge(t: Any, h: int, p: int) -> int:
    """Insert a point on the edge of h, which then ends there; return the half-edge that goes on."""
    g, m = t.twins[h], 3 * t.sizes[TRIANGLES]
    end = t.tails[following(h)]
    t.sizes[POINTS], t.sizes[TRIANGLES] = p + 1, t.sizes[TRIANGLES] + (2 if g >= 0 else 1)
    split_side(t, h, p, m, end)
    put(t, m, p, -1, t.claims[h])
    if g >= 0:  # the triangle beyond keeps the part of the edge that h keeps
        q = previous(g)
        put(t, m + 5, t.tails[q], t.twins[q], t.claims[q])
        put(t, m + 4, p, q, 0)
        put(t, q, t.tails[q], m + 4, 0)
        put(t, m + 3, end, m, t.claims[g])
        put(t, g, p, h, t.claims[g])
    return m


@kernel
def split_side(t: Any, h: int, p: int, m: int, end: int) -> None:
    """Split the triangle of h from a point on h to its apex; the part at its head begins at m."""
    n = following(h)
    apex = t.tails[previous(h)]
    put(t, m + 1, end, t.twins[n], t.claims[n])
    t.tails[m], t.tails[n], t.claims[n] = p, p, 0
    put(t, m + 2, apex, n, 0)
    put(t, n, p, m + 2, 0)


@kernel
def flip(t: Any, h: int) -> bool:
    r"""Flip the edge of h, if its quadrilateral is strictly convex; tell whether it was.

    ::

             c                      c
           /   \                  /|\
         p       n              g  | n
        /    h    \            /   |   \
       a --------- b    ->    a   p|q   b
        \    g    /            \   |   /
       left      q            left | h
           \   /                  \|/
             d                      d
    """
    g = t.twins[h]
    if g < 0:
        return False
    n, p, left, q = following(h), previous(h), following(g), previous(g)
    a, b, c, d = t.tails[h], t.tails[g], t.tails[p], t.tails[q]
    if twice_area(t.places, a, d, c) <= 0.0 or twice_area(t.places, d, b, c) <= 0.0:
        return False
    twin, claim = t.twins[p], t.claims[p]
    put(t, h, d, t.twins[q], t.claims[q])
    put(t, g, c, twin, claim)
    put(t, p, c, q, 0)
    put(t, q, d, p, 0)
    for kept in (n, left):  # of a and b a flipped half-edge may have been the one that leaves
        put(t, kept, t.tails[kept], t.twins[kept], t.claims[kept])
    return True


@kernel
def is_worth_flipping(t: Any, shape: Floats, h: int) -> bool:
    """Whether flipping the edge of h makes its triangles Delaunay, in the plane of the face."""
    g = t.twins[h]
    if g < 0 or t.claims[h] > 0:
        return False
    u, v = t.tails[h], t.tails[g]
    cotangents = 0.0
    for apex in (t.tails[previous(h)], t.tails[previous(g)]):
        ax, ay = from_apex(t.places, shape, apex, u)
        bx, by = from_apex(t.places, shape, apex, v)
        cotangents += (ax * bx + ay * by) / max(abs(ax * by - ay * bx), 1e-300)
    return cotangents < -FLAT_ENOUGH


@kernel
def from_apex(places: Longs, shape: Floats, i: int, j: int) -> tuple[float, float]:
    """Return the step from i to j in the plane of the face; the shape is as `Patch` has it."""
    dx, dy = float(places[j, 0] - places[i, 0]), float(places[j, 1] - places[i, 1])
    return dx * shape[0] + dy * shape[1], dy * shape[2]


@kernel
def make_delaunay(t: Any, shape: Floats) -> None:
    """Flip edges that belong to no segment until all are Delaunay; O(n) in practice."""
    m = 3 * t.sizes[TRIANGLES]
    waiting, is_waiting, count = np.empty(m, np.int64), np.ones(m, np.uint8), m
    for h in range(m):
        waiting[h] = h
    for _ in range(100 * m):  # rounding may let edges flip in turn
        if count == 0:
            break
        count -= 1
        h = waiting[count]
        is_waiting[h] = 0
        if is_worth_flipping(t, shape, h):
            g = t.twins[h]
            if flip(t, h):
                for edge in (h, following(h), g, following(g)):
                    if is_waiting[edge] == 0:
                        waiting[count], is_waiting[edge] = edge, 1
                        count += 1
