"""The outlines of territories in one face: bisectors, and the crossings of borders with its edges.

A territory lies on the left of its outline. Going around the face counter-clockwise, the outline
begins where the boundary of the face leaves the territory, and stops where the boundary enters it
again. So each source has as many ends, of bisectors and at crossings, as it has starts. The nearest
are joined first, and no bisector is left over, however its ends are rounded. An end and its start
that are not at one node are a *gap*.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.borders.bisectors import BISECTOR, LEFT, RIGHT
from geodesic_core.kernels.curves.conics import END, START, point_on
from geodesic_core.kernels.curves.crossings import (
    Crossings,
    FaceCrossings,
    crossing_along,
    is_first_of_edge,
    number_crossings,
)
from geodesic_core.kernels.curves.joining import join, put_end, room_for_ends
from geodesic_core.kernels.curves.rows import ROWS, copy_rows, with_room
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face


class LabelledCrossings(NamedTuple):
    """The crossings of borders with edges, each edge once."""

    crossings: Crossings
    sources: Ints
    """(C, 2): the source before and after each, along the first half-edge of its edge"""


@kernel
def cross_edges(topology: Any, territories: Any, row_of: Ints) -> LabelledCrossings:
    """Find the crossings of borders with the edges of the faces that they may pass, each edge once.

    An edge has those that the first of its faces found.
    """
    links, faces, count = topology.links, len(territories.faces), 0
    positions, half_edges = np.empty(ROWS), np.empty(ROWS, np.int32)
    sources = np.empty((ROWS, 2), np.int32)
    for row in range(3 * faces):
        h = 3 * territories.faces[row // 3] + row % 3
        if not is_first_of_edge(links, row_of, h):
            continue
        lo, hi = territories.first_run[row], territories.first_run[row + 1]
        positions = with_room(positions, count + hi - lo)
        half_edges = with_room(half_edges, count + hi - lo)
        sources = with_room(sources, count + hi - lo)
        for i in range(lo + 1, hi):
            positions[count], half_edges[count] = territories.runs[i, 0], h
            sources[count, 0] = int(territories.runs[i - 1, 1])
            sources[count, 1] = int(territories.runs[i, 1])
            count += 1
    crossings = number_crossings(links, row_of, faces, positions[:count], half_edges[:count])
    return LabelledCrossings(crossings, sources[:count])


@inlined
def source_after(sources: Ints, c: int, turned: int) -> int:
    """Return the source after a crossing, along a half-edge that is turned or not."""
    return sources[c, 0] if turned else sources[c, 1]


@inlined
def source_before(sources: Ints, c: int, turned: int) -> int:
    """Return the source before a crossing, along a half-edge that is turned or not."""
    return sources[c, 1] if turned else sources[c, 0]


@kernel
def source_on_edge(territories: Any, labelled: Any, row: int, length: float, x: float) -> int:
    """Return the source that is nearest at a distance x from the tail of a half-edge with a row."""
    crossings = labelled.crossings
    source = int(territories.runs[territories.first_run[row], 1])
    for j in range(crossings.number[row]):
        c, at = crossing_along(crossings, row, j, length)
        if at <= x:
            source = source_after(labelled.sources, c, crossings.turned[row])
    return source


@inlined
def away_from_line(edge: Any, x: float, y: float) -> float:
    """Return how far a point is from the line of an edge."""
    ox, oy, ux, uy = edge
    return abs(ux * (y - oy) - uy * (x - ox))


@kernel
def bisectors_inside(
    topology: Any, territories: Any, labelled: Any, face: int, k: int, near: float
) -> Floats:
    """Return the bisectors in the k-th face, but for those along edges that are in the other face.

    A border along an edge, within ``near``, would be in either face by rounding. It is in that face
    whose side is not that of the edge itself.
    """
    lo, hi = territories.first_bisector[k], territories.first_bisector[k + 1]
    curves, count = np.empty((hi - lo, BISECTOR)), 0
    for b in range(lo, hi):
        curve, is_inside = territories.bisectors[b], True
        x0, y0 = point_on(curve, curve[START])
        x1, y1 = point_on(curve, curve[END])
        x, y = point_on(curve, 0.5 * (curve[START] + curve[END]))
        for i in range(3):
            h = 3 * face + i
            edge, length = half_edge_in_face(topology.geometry, h), topology.geometry[h, LENGTH]
            away = max(away_from_line(edge, x0, y0), away_from_line(edge, x1, y1))
            if max(away, away_from_line(edge, x, y)) > near:
                continue
            ox, oy, ux, uy = edge
            along = ux * (x1 - x0) + uy * (y1 - y0) > 0.0
            place = ux * (x - ox) + uy * (y - oy)
            source = source_on_edge(territories, labelled, 3 * k + i, length, place)
            is_inside = is_inside and source != int(curve[LEFT if along else RIGHT])
        if is_inside:
            copy_rows(territories.bisectors[b : b + 1], curves, count)
            count += 1
    return curves[:count]


@kernel
def sources_around(curves: Floats, sources: Ints, around: FaceCrossings) -> Ints:
    """Return the sources whose territories have outlines in a face, each once."""
    bisectors, count = len(curves), 0
    found = np.empty(2 * bisectors + len(around.ids), np.int32)
    for node in range(len(found)):
        c = node - 2 * bisectors
        if c >= 0:
            label = source_before(sources, around.ids[c], around.turned[c])
        else:
            label = int(curves[node // 2, LEFT if node % 2 == 0 else RIGHT])
        is_new = True
        for i in range(count):
            is_new = is_new and found[i] != label
        if is_new:
            found[count] = label
            count += 1
    return found[:count]


@kernel
def gaps_between(curves: Floats, sources: Ints, around: FaceCrossings, at: Floats) -> Ints:
    """Join the ends and starts in the outline of each source; return the gaps, (n, 3).

    A gap is a node, the node that follows it, and the source on the left. The nodes, at ``at``, are
    2 b and 2 b + 1 of bisector b, then those of the crossings ``around`` the face. ``sources`` are
    as in `LabelledCrossings`.
    """
    inner = 2 * len(curves)
    gaps, count = np.empty((len(at), 3), np.int32), 0
    for label in sources_around(curves, sources, around):
        ends, end_count = room_for_ends(len(at)), 0
        starts, start_count = room_for_ends(len(at)), 0
        for b in range(len(curves)):
            if label not in (int(curves[b, LEFT]), int(curves[b, RIGHT])):
                continue
            along = int(curves[b, LEFT]) == label
            start, end = (2 * b, 2 * b + 1) if along else (2 * b + 1, 2 * b)
            start_count = put_end(starts, start_count, at[start, 0], at[start, 1], start)
            end_count = put_end(ends, end_count, at[end, 0], at[end, 1], end)
        for c in range(len(around.ids)):
            node, crossing, turned = inner + c, around.ids[c], around.turned[c]
            if source_before(sources, crossing, turned) == label:
                end_count = put_end(ends, end_count, at[node, 0], at[node, 1], node)
            if source_after(sources, crossing, turned) == label:
                start_count = put_end(starts, start_count, at[node, 0], at[node, 1], node)
        joined = join(ends.places[:end_count], starts.places[:start_count])
        for i in range(end_count):
            gaps[count, 0], gaps[count, 1] = ends.ids[i], starts.ids[joined[i]]
            gaps[count, 2] = label
            count += 1
    return gaps[:count]
