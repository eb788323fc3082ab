"""Cuts of a level: its arcs in faces, the stretches of edges within it, and its crossings.

Arcs are cut out in every face that the level may pass (`arcs`). Each face also has the stretches of
its edges that it holds to be within the level. The stretches of all faces of an edge, united, give
the crossings of that edge once. So the level enters each face as often as it leaves it.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.clipping import insert_interval
from geodesic_core.kernels.curves.conics import ARC
from geodesic_core.kernels.curves.crossings import (
    Crossings,
    add_faces_across,
    is_first_of_edge,
    number_crossings,
    row_of_half_edge,
)
from geodesic_core.kernels.curves.regions import runs_along, span_on_line
from geodesic_core.kernels.curves.rows import ROWS, copy_rows, with_room
from geodesic_core.kernels.front.window import B0, B1, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.isolines.arcs import outer_arcs
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    TAIL,
    half_edge_in_face,
    next_around,
)
from geodesic_core.kernels.planar import distance
from geodesic_core.kernels.retained.reached import regions_of_face
from geodesic_core.tolerances import CROSSING, LEVEL, PIECE


class Cuts(NamedTuple):
    """The faces that a level may pass, with its arcs there and its spans on their edges."""

    faces: Ints
    """(n,)"""
    spans: Floats
    """(S, 2): stretches of half-edges within the level, by the regions of their face"""
    first_span: Ints
    """(3n + 1,): of each half-edge of the faces"""
    arcs: Floats
    """(A, ARC)"""
    first_arc: Ints
    """(n + 1,): of each face"""


@kernel
def bound_faces(
    topology: Any, swept: Any, first: int, last: int, least: Floats, most: Floats
) -> None:
    """Bound the distances in the faces from ``first`` up to ``last`` by windows and corners.

    Lowers ``least`` (F,) to lower bounds and ``most`` (F,) to upper bounds. Points and segments
    inside are left to the caller. O(windows of the faces).
    """
    geometry, face_windows = topology.geometry, swept.face_windows
    ints = face_windows.windows.view(np.int32)
    for face in range(first, last):
        for h in range(3 * face, 3 * face + 3):
            for i in range(face_windows.first[h], face_windows.first[h + 1]):
                w = face_windows.windows[i]
                if ints[i, ROOT] >= swept.first_segment:  # least at an end
                    x, sw = w[B1] if w[SX] > 0.0 else w[B0], 0.0
                else:
                    x, sw = min(max(w[SX], w[B0]), w[B1]), 1.0
                least[face] = min(least[face], distance(x, w[SX], w[SY], sw) + w[SIGMA])
            corner = swept.distance[topology.links[h, TAIL]]
            farthest = max(geometry[h, LENGTH], geometry[h, LENGTH_LEFT])
            least[face], most[face] = min(least[face], corner), min(most[face], corner + farthest)


@kernel
def cut_faces(
    topology: Any, swept: Any, faces: Ints, known: int, level: float, row_of: Ints
) -> tuple[Floats, Ints, Floats, Ints, Ints]:
    """Cut some of the faces that a level may pass; ``faces`` (n,) are their numbers.

    Returns the spans and their number for each half-edge, then the arcs and their number for each
    face; spans and arcs are as in `Cuts`. Last come neighbours that the level may pass as well, by
    these spans. ``row_of`` (F,) is the row of each face among all that are to be cut, -1 for none.
    ``known`` faces have rows. The call gives the neighbours the rows that follow.
    """
    topology, swept = borrowed(topology), borrowed(swept)
    links, geometry = topology.links, topology.geometry
    slack, shortest = LEVEL * level, PIECE * level
    spans, span_count = np.empty((ROWS, 2)), 0
    arcs, arc_count = np.empty((ROWS, ARC)), 0
    spans_of, arcs_of = np.empty(3 * len(faces), np.int32), np.empty(len(faces), np.int32)
    found, count = np.empty(ROWS, np.int32), 0
    for k in range(len(faces)):
        face = faces[k]
        regions = regions_of_face(topology, swept, face, level)
        outer = outer_arcs(topology, face, regions, level, shortest)
        arcs = with_room(arcs, arc_count + len(outer))
        copy_rows(outer, arcs, arc_count)
        arcs_of[k], arc_count = len(outer), arc_count + len(outer)
        for i in range(3):
            h, begin = 3 * face + i, span_count
            spans = with_room(spans, begin + len(regions))
            size = cut_edge(geometry, h, regions, slack, spans[begin:])
            spans_of[3 * k + i], span_count = size, begin + size
            if size > 1 or (size == 1 and not is_whole_edge(spans[begin], geometry[h, LENGTH])):
                found, count = add_faces_across(links, h, known, row_of, found, count)
    return spans[:span_count], spans_of, arcs[:arc_count], arcs_of, found[:count]


@inlined
def is_whole_edge(span: Floats, length: float) -> bool:
    """Whether a span is all of an edge."""
    return span[0] <= 0.0 and span[1] >= length


@inlined
def cut_edge(geometry: Floats, h: int, regions: Floats, slack: float, spans: Floats) -> int:
    """Write the spans of h that lie in regions of its face to ``spans``; return how many there are.

    A line that runs along the edge, within ``slack``, holds it: at the level counts as nearer.
    """
    regions, spans = borrowed(regions), borrowed(spans)
    edge, length, count = half_edge_in_face(geometry, h), geometry[h, LENGTH], 0
    ox, oy, ux, uy = edge
    for i in range(len(regions)):
        beyond = slack if runs_along(regions[i], slack, edge, length) else 0.0
        lo, hi = span_on_line(regions[i], beyond, ox, oy, ux, uy, 0.0, length)
        if lo <= hi:
            spans[count, 0], spans[count, 1] = lo, hi
            count += 1
    return united(spans[:count], CROSSING * length)


@kernel
def united(spans: Floats, gap: float) -> int:
    """Sort ``spans`` and unite those with a gap of at most ``gap``; return how many are left."""
    for i in range(1, len(spans)):
        insert_interval(spans, i, spans[i, 0], spans[i, 1])
    count = 0
    for i in range(len(spans)):
        if count > 0 and spans[i, 0] <= spans[count - 1, 1] + gap:
            spans[count - 1, 1] = max(spans[count - 1, 1], spans[i, 1])
        else:
            spans[count, 0], spans[count, 1] = spans[i, 0], spans[i, 1]
            count += 1
    return count


@kernel
def is_within(distance: Floats, vertex: int, level: float) -> bool:
    """Whether a vertex counts as nearer than a level: one at the level, within `LEVEL`, does."""
    return distance[vertex] <= level * (1.0 + LEVEL)


@kernel
def cross_edges(
    topology: Any, distance: Floats, cuts: Any, level: float, row_of: Ints
) -> Crossings:
    """Find the crossings of a level with the edges of the faces that it may pass, each edge once.

    An end of an edge is on the same side of the level as its vertex (`is_within`). So the crossings
    around a face come in pairs.
    """
    links, geometry, faces = topology.links, topology.geometry, len(cuts.faces)
    positions, half_edges, count = np.empty(ROWS), np.empty(ROWS, np.int32), 0
    spans = np.empty((ROWS, 2))
    for row in range(3 * faces):
        h = 3 * cuts.faces[row // 3] + row % 3
        if not is_first_of_edge(links, row_of, h):
            continue
        tail_inside = is_within(distance, links[h, TAIL], level)
        head_inside = is_within(distance, links[h, HEAD], level)
        spans, size = spans_on_edge(topology, cuts, row_of, h, tail_inside, head_inside, spans)
        positions = with_room(positions, count + 2 * size)
        half_edges = with_room(half_edges, count + 2 * size)
        for i in range(size):
            from_tail = tail_inside and i == 0
            to_head = head_inside and i == size - 1
            is_point = spans[i, 1] - spans[i, 0] <= CROSSING * geometry[h, LENGTH]
            if is_point and not from_tail and not to_head:
                continue
            if not from_tail:
                positions[count], half_edges[count] = spans[i, 0], h
                count += 1
            if not to_head:
                positions[count], half_edges[count] = spans[i, 1], h
                count += 1
    return number_crossings(links, row_of, faces, positions[:count], half_edges[:count])


@inlined
def spans_on_edge(
    topology: Any,
    cuts: Any,
    row_of: Ints,
    h: int,
    tail_inside: bool,
    head_inside: bool,
    spans: Floats,
) -> tuple[Floats, int]:
    """Return the united spans of all faces of the edge of h, and how many there are.

    They are written to ``spans``, or to a larger array.
    """
    links, length, size, g = topology.links, topology.geometry[h, LENGTH], 0, h
    gap = CROSSING * length
    if tail_inside:
        spans[size, 0], spans[size, 1] = 0.0, 0.0
        size += 1
    if head_inside:
        spans[size, 0], spans[size, 1] = length, length
        size += 1
    while True:
        row = row_of_half_edge(row_of, g)
        if row >= 0:
            first, end = cuts.first_span[row], cuts.first_span[row + 1]
            spans = with_room(spans, size + end - first)
            for i in range(first, end):
                lo, hi = cuts.spans[i, 0], cuts.spans[i, 1]
                if links[g, TAIL] != links[h, TAIL]:
                    lo, hi = length - hi, length - lo
                spans[size, 0] = lo if tail_inside else max(lo, gap)
                spans[size, 1] = hi if head_inside else min(hi, length - gap)
                size += 1
        g = next_around(links, g)
        if g < 0 or g == h:
            return spans, united(spans[:size], gap)
