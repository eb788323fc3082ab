"""Faces that curves cross, triangulated one after another, and what comes of them."""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.cutting.predicates import NEAR, STEPS
from geodesic_core.kernels.cutting.segments import (
    ENFORCED,
    OWNERS,
    WAITING,
    Segments,
    add_segment,
    enforce,
    lead_through_apexes,
)
from geodesic_core.kernels.cutting.triangulation import (
    POINTS,
    TRIANGLES,
    Triangulation,
    add_place,
    begin,
    following,
    insert,
    make_delaunay,
    point_near,
    roomy,
    split_edge,
    triangle_at,
)
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.outcome import Outcome

ROW, IS_BEGUN = 0, 1
MADE, CHILDREN, EDGES, WISHES = 0, 1, 2, 3


class Patch(NamedTuple):
    """The faces that curves cross, R of them, and the points and segments in them."""

    corners: Longs
    """(R, 3): vertices"""
    edges: Longs
    """(R, 3): number i is the edge from corner i to corner i + 1"""
    shapes: Floats
    """(R, 3): length of edge 0; distance of corner 2 along it, and above it"""
    edge_first: Longs
    """(E + 1,): the first of `edge_points` on each edge; where the last one's end"""
    edge_points: Longs
    """(P, 2): steps from the lower vertex, ascending on each edge; and name"""
    inner_first: Longs
    """(R + 1,): likewise for `inner_points` in each face"""
    inner_points: Longs
    """(Q, 2): places"""
    segment_first: Longs
    """(R + 1,): likewise for `segments`"""
    segments: Longs
    """(S, 3): two points and the curve. The points of a face are its corners, those of edge 0, 1
    and 2 in turn around the face, and its `inner_points`"""


class Work(NamedTuple):
    """The state between slices: the face at hand."""

    triangulation: Triangulation
    segments: Segments
    at: Longs
    """(2,): the ROW at hand, among those to be cut, and whether it IS_BEGUN"""


class Pieces(NamedTuple):
    """What has come of faces."""

    made: Longs
    """(M, 3): row of the face, and place, of each new point in it. Number i is named -1 - i"""
    children: Longs
    """(C, 4): row, and names of corners"""
    edges: Longs
    """(K, 4): row, names of both ends, and curve that has this edge"""
    wishes: Longs
    """(W, 3): row and place of each new point on an edge, which other faces must have as well"""
    sizes: Longs
    """(4,): number of MADE … WISHES"""


@kernel
def begin_face(patch: Any, row: int, work: Any) -> Work:
    """Return the work with a face at hand: its points inserted, its segments waiting."""
    t, s = work.triangulation, work.segments
    begin(t)
    for k in range(3):
        t.names[k] = patch.corners[row, k]
    for k in range(3):
        first, end = (
            patch.edge_first[patch.edges[row, k]],
            patch.edge_first[patch.edges[row, k] + 1],
        )
        t, h = roomy(t, end - first), t.leaving[k]
        is_forward = patch.corners[row, k] < patch.corners[row, (k + 1) % 3]
        for c in range(end - first):
            point = patch.edge_points[first + c if is_forward else end - 1 - c]
            along = point[0] if is_forward else STEPS - point[0]
            x, y = (
                (along, 0) if k == 0 else (STEPS - along, along) if k == 1 else (0, STEPS - along)
            )
            h = split_edge(t, h, add_place(t, x, y, point[1]))
    given, first = t.sizes[POINTS], patch.inner_first[row]
    count = patch.inner_first[row + 1] - first
    points, triangle = np.empty(given + count, np.int64), 0
    for i in range(given):
        points[i] = i
    t = roomy(t, count)
    for c in range(count):
        p = add_place(t, patch.inner_points[first + c, 0], patch.inner_points[first + c, 1], -1)
        triangle = triangle_at(t, p, 3 * triangle)
        near = point_near(t, triangle, p, NEAR)
        points[given + c] = p if near < 0 else near
        if near < 0:
            insert(t, triangle, p)
    s.sizes[WAITING], s.sizes[OWNERS], s.sizes[ENFORCED] = 0, 1, 0
    for c in range(patch.segment_first[row], patch.segment_first[row + 1]):
        i, j, curve = patch.segments[c]
        s = add_segment(s, points[i], points[j], curve)
    return Work(t, s, work.at)


@kernel
def put_pieces(work: Any, row: int, pieces: Any) -> Pieces:
    """Return the pieces with those of the face at hand."""
    t, owners, sizes = work.triangulation, work.segments.owners, pieces.sizes
    n, m = t.sizes[POINTS], t.sizes[TRIANGLES]
    made = with_room(pieces.made, sizes[MADE] + n)
    for p in range(n):
        if t.names[p] < 0:
            t.names[p] = -1 - sizes[MADE]
            made[sizes[MADE]] = row, t.places[p, 0], t.places[p, 1]
            sizes[MADE] += 1
    children, edges = with_room(pieces.children, sizes[CHILDREN] + m), pieces.edges
    for h in range(3 * m):
        if h % 3 == 0:
            a, b, c = t.tails[h], t.tails[h + 1], t.tails[h + 2]
            children[sizes[CHILDREN]] = row, t.names[a], t.names[b], t.names[c]
            sizes[CHILDREN] += 1
        owner = t.claims[h] if h > t.twins[h] else 0
        while owner > 0:
            edges = with_room(edges, sizes[EDGES] + 1)
            u, v = t.names[t.tails[h]], t.names[t.tails[following(h)]]
            edges[sizes[EDGES]] = row, u, v, owners[owner, 0]
            sizes[EDGES] += 1
            owner = owners[owner, 1]
    return Pieces(made, children, edges, pieces.wishes, sizes)


@kernel
def with_wish(t: Any, row: int, pieces: Any) -> Pieces:
    """Return the pieces with a wish for the last point of the face at hand."""
    wishes, p = with_room(pieces.wishes, pieces.sizes[WISHES] + 1), t.sizes[POINTS] - 1
    wishes[pieces.sizes[WISHES]] = row, t.places[p, 0], t.places[p, 1]
    pieces.sizes[WISHES] += 1
    return Pieces(pieces.made, pieces.children, pieces.edges, wishes, pieces.sizes)


@kernel
def cut_faces(
    patch: Any, rows: Longs, work: Any, pieces: Any, budget: int
) -> tuple[Work, Pieces, int]:
    """Cut faces of the patch, in about ``budget`` steps.

    Returns the work and the pieces so far, in the same arrays or larger ones, and FINISHED, RUNNING
    or, where the face at hand cannot be cut, which is a defect, LOST.
    """
    at = work.at
    while at[ROW] < len(rows):
        row = rows[at[ROW]]
        if at[IS_BEGUN] == 0:
            work, at[IS_BEGUN] = begin_face(patch, row, work), 1
            budget -= work.triangulation.sizes[TRIANGLES]
        t, s = work.triangulation, work.segments
        while s.sizes[WAITING] > 0 and budget > 0:
            t = roomy(t, 1)
            s, outcome, is_wish = enforce(t, s)
            budget -= 1
            if outcome != Outcome.FINISHED:
                return work, pieces, outcome
            if is_wish:
                pieces = with_wish(t, row, pieces)
            if s.sizes[WAITING] == 0:
                make_delaunay(t, patch.shapes[row])
                s = lead_through_apexes(t, s)
        work = Work(t, s, at)
        if s.sizes[WAITING] > 0:
            return work, pieces, Outcome.RUNNING
        if s.sizes[ENFORCED] == 0:  # points alone
            make_delaunay(t, patch.shapes[row])
        pieces = put_pieces(work, row, pieces)
        at[ROW], at[IS_BEGUN] = at[ROW] + 1, 0
        if budget <= 0:
            return work, pieces, Outcome.RUNNING
    return work, pieces, Outcome.FINISHED
