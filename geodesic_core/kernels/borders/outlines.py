"""Borders across faces: the outline of each territory in a face, put together from bisectors.

The outline of a territory, its source on the left, leads through a face from where the boundary,
counter-clockwise, leaves the territory to where it enters it again. So for each source there are as
many ends of bisectors and crossings as starts. They are joined, the nearest first, and no bisector
can be left over, however its ends are rounded. Where an end and its start are one point up to
rounding, they become one node. What is left are *gaps*. A gap in the outlines of two sources, in
opposite directions, is closed by a straight piece of border. Other gaps are drawn together to the
most central of their nodes. So borders go on from edge to edge, and meet.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.borders.bisectors import (
    BISECTOR,
    END,
    LEFT,
    RIGHT,
    START,
    point_on,
    strays,
)
from geodesic_core.kernels.isolines.arcs import ROWS, copy_rows, with_room
from geodesic_core.kernels.isolines.lines import (
    UNKNOWN,
    Crossings,
    join,
    number_around,
    put_crossing,
    put_in_face,
)
from geodesic_core.kernels.isolines.regions import is_line
from geodesic_core.kernels.jit import borrowed, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face

DEPTH = 24
"""Times that a bisector is halved at most: until its pieces are a millionth of it."""


class LabelledCrossings(NamedTuple):
    """The crossings of borders with edges, each edge once."""

    crossings: Crossings
    sources: Ints
    """(C, 2): the source before and after each, along the first half-edge of its edge"""


class Pieces(NamedTuple):
    """The borders in each face, from node to node: a crossing, or a point in the face."""

    points: Floats
    """(N, 3)"""
    first: Longs
    """(p + 1, 1): the first point of each piece"""
    nodes: Ints
    """(p, 2): the nodes at both ends; those below the number of crossings are these"""
    faces: Ints
    """(p, 1)"""
    sources: Ints
    """(p, 2): of the territories on both sides, the lower first"""


class FaceNodes(NamedTuple):
    """The nodes of a face: both ends of each bisector, then crossings, then hubs."""

    inner: int
    """Number of ends, and the first crossing among the nodes"""
    crossings: Ints
    """(n, 3): as `crossings_of_face` returns them"""
    parent: Ints
    """By node, the one that it is united with, or itself; see `root_of`"""
    places: Floats
    """(N, 2): in the frame of the face's first half-edge"""


@kernel
def cross_edges(topology: Any, territories: Any, row_of: Ints) -> LabelledCrossings:
    """Find the crossings of borders with the edges of the faces that they may pass, each edge once.

    An edge has those that the first of its faces found.
    """
    links, count, total = topology.links, 3 * len(territories.faces), 0
    positions, half_edges = np.empty((ROWS, 1)), np.empty((ROWS, 1), np.int32)
    sources = np.empty((ROWS, 2), np.int32)
    first, turned = np.zeros((count, 1), np.int32), np.zeros((count, 1), np.int32)
    number = np.full((count, 1), UNKNOWN, np.int32)
    for n in range(count):
        if number[n, 0] != UNKNOWN:
            continue
        h, begin = 3 * territories.faces[n // 3, 0] + n % 3, total
        lo, hi = territories.first_run[n, 0], territories.first_run[n + 1, 0]
        positions = with_room(positions, total + hi - lo)
        half_edges = with_room(half_edges, total + hi - lo)
        sources = with_room(sources, total + hi - lo)
        for i in range(lo + 1, hi):
            positions[total, 0], half_edges[total, 0] = territories.runs[i, 0], h
            sources[total, 0] = int(territories.runs[i - 1, 1])
            sources[total, 1] = int(territories.runs[i, 1])
            total += 1
        number_around(links, row_of, h, begin, total, first, number, turned)
    crossings = Crossings(positions[:total], half_edges[:total], first, number, turned)
    return LabelledCrossings(crossings, sources[:total])


@kernel
def crossings_of_face(topology: Any, labelled: Any, face: int, k: int) -> tuple[Floats, Ints]:
    """Return the crossings around the k-th face, counter-clockwise: places (n, 2), and (n, 3).

    The latter are the number of each, the source before it, and the one after it.
    """
    crossings, room = labelled.crossings, 0
    for n in range(3 * k, 3 * k + 3):
        room += crossings.number[n, 0]
    places, ids, count = np.empty((room, 2)), np.empty((room, 3), np.int32), 0
    for i in range(3):
        h, n = 3 * face + i, 3 * k + i
        ox, oy, ux, uy = half_edge_in_face(topology.geometry, h)
        number = crossings.number[n, 0]
        for j in range(number):
            turned = crossings.turned[n, 0]
            c = crossings.first[n, 0] + (number - 1 - j if turned else j)
            x = crossings.positions[c, 0]
            if turned:
                x = topology.geometry[h, LENGTH] - x
            places[count, 0], places[count, 1] = ox + x * ux, oy + x * uy
            ids[count, 0] = c
            ids[count, 1] = labelled.sources[c, 1 if turned else 0]
            ids[count, 2] = labelled.sources[c, 0 if turned else 1]
            count += 1
    return places, ids


@kernel
def source_on_edge(territories: Any, labelled: Any, k: int, i: int, length: float, x: float) -> int:
    """Return the source that is nearest at a place of the i-th edge of the k-th face."""
    n, crossings = 3 * k + i, labelled.crossings
    source = int(territories.runs[territories.first_run[n, 0], 1])
    number, turned = crossings.number[n, 0], crossings.turned[n, 0]
    for j in range(number):
        c = crossings.first[n, 0] + (number - 1 - j if turned else j)
        at = length - crossings.positions[c, 0] if turned else crossings.positions[c, 0]
        if at <= x:
            source = labelled.sources[c, 0 if turned else 1]
    return source


@kernel
def bisectors_inside(
    topology: Any, territories: Any, labelled: Any, face: int, k: int, near: float
) -> Floats:
    """Return the bisectors in the k-th face, but for those along edges that are in the other face.

    A border along an edge, within ``near``, would be in either face by rounding. It is in that face
    whose side is not that of the edge itself.
    """
    lo, hi = territories.first_bisector[k, 0], territories.first_bisector[k + 1, 0]
    curves, count = np.empty((hi - lo, BISECTOR)), 0
    for b in range(lo, hi):
        curve = territories.bisectors[b]
        begin, end = curve[START], curve[END]
        x0, y0 = point_on(curve, begin)
        x1, y1 = point_on(curve, end)
        x, y = point_on(curve, 0.5 * (begin + end))
        is_inside = True
        for i in range(3):
            h = 3 * face + i
            ox, oy, ux, uy = half_edge_in_face(topology.geometry, h)
            away = max(abs(ux * (y0 - oy) - uy * (x0 - ox)), abs(ux * (y1 - oy) - uy * (x1 - ox)))
            if max(away, abs(ux * (y - oy) - uy * (x - ox))) > near:
                continue
            along = ux * (x1 - x0) + uy * (y1 - y0) > 0.0
            place = ux * (x - ox) + uy * (y - oy)
            length = topology.geometry[h, LENGTH]
            source = source_on_edge(territories, labelled, k, i, length, place)
            is_inside = is_inside and source != int(curve[LEFT if along else RIGHT])
        if is_inside:
            for column in range(BISECTOR):
                curves[count, column] = curve[column]
            count += 1
    return curves[:count]


@kernel
def root_of(parent: Ints, node: int) -> int:
    """Return the node that stands for all that a node was united with."""
    while parent[node] != node:
        node = parent[node]
    return node


@kernel
def gaps_between(curves: Floats, places: Floats, ids: Ints) -> Ints:
    """Join the ends and starts in the outline of each source; return the gaps, (n, 3).

    A gap is a node, the node that follows it, and the source on the left. The nodes of bisector b
    are 2 b and 2 b + 1; those of crossings follow.
    """
    bisectors = len(curves)
    total = 2 * bisectors + len(ids)
    gaps, count = np.empty((total, 3), np.int32), 0
    seen = np.empty(total, np.int32)
    for first in range(total):
        label = ids[first - 2 * bisectors, 1] if first >= 2 * bisectors else -2
        if first < 2 * bisectors:
            label = int(curves[first // 2, LEFT if first % 2 == 0 else RIGHT])
        seen[first] = label
        if occurs(label, seen, first):
            continue
        ends, starts = np.empty((total, 2)), np.empty((total, 2))
        end_ids, start_ids = np.empty(total, np.int32), np.empty(total, np.int32)
        end_count, start_count = 0, 0
        for b in range(bisectors):
            if label not in (int(curves[b, LEFT]), int(curves[b, RIGHT])):
                continue
            along = int(curves[b, LEFT]) == label
            begin, end = curves[b, START], curves[b, END]
            if not along:
                begin, end = end, begin
            starts[start_count, 0], starts[start_count, 1] = point_on(curves[b], begin)
            ends[end_count, 0], ends[end_count, 1] = point_on(curves[b], end)
            start_ids[start_count] = 2 * b if along else 2 * b + 1
            end_ids[end_count] = 2 * b + 1 if along else 2 * b
            start_count, end_count = start_count + 1, end_count + 1
        for c in range(len(ids)):
            if ids[c, 1] == label:
                ends[end_count, 0], ends[end_count, 1] = places[c, 0], places[c, 1]
                end_ids[end_count] = 2 * bisectors + c
                end_count += 1
            if ids[c, 2] == label:
                starts[start_count, 0], starts[start_count, 1] = places[c, 0], places[c, 1]
                start_ids[start_count] = 2 * bisectors + c
                start_count += 1
        joined = join(ends[:end_count], starts[:start_count])
        for i in range(end_count):
            gaps[count, 0], gaps[count, 1] = end_ids[i], start_ids[joined[i]]
            gaps[count, 2] = label
            count += 1
    return gaps[:count]


@kernel
def occurs(label: int, labels: Ints, count: int) -> bool:
    """Whether a label is among the first ``count`` labels."""
    for i in range(count):  # noqa: SIM110 - numba has no generators in any()
        if labels[i] == label:
            return True
    return False


@kernel
def close_gaps(gaps: Ints, at: Floats, crossings: int, near: float) -> tuple[Ints, Ints, Floats]:
    """Close the gaps of a face: unite nodes, and return straight pieces between others.

    Returns the node that each is united with, which may be a new one; the pieces (n, 4), their
    nodes and the sources on the left and right; and the places of all nodes. The last ``crossings``
    of the nodes at ``at`` are crossings, which stay apart. Ends nearer than ``near`` are one.
    """
    inner = len(at) - crossings
    parent = np.arange(len(at) + len(gaps)).astype(np.int32)
    straight = np.empty((2 * len(gaps), 4), np.int32)
    gaps = unite_ends(gaps, at, inner, near, parent)
    gaps, count = close_opposite(gaps, straight)
    places, count = draw_together(gaps, at, inner, parent, straight, count)
    return parent, straight[:count], places


@kernel
def unite_ends(gaps: Ints, at: Floats, inner: int, near: float, parent: Ints) -> Ints:
    """Unite the ends of bisectors, the nodes below ``inner``, at gaps no wider than ``near``.

    Returns the gaps that are left, between the nodes that stand for theirs. Modifies ``parent``.
    """
    for i in range(len(gaps)):
        u, v = gaps[i, 0], gaps[i, 1]
        if max(u, v) < inner and math.hypot(at[u, 0] - at[v, 0], at[u, 1] - at[v, 1]) <= near:
            parent[root_of(parent, u)] = root_of(parent, v)
    left, count = np.empty(gaps.shape, np.int32), 0
    for i in range(len(gaps)):
        u, v = root_of(parent, gaps[i, 0]), root_of(parent, gaps[i, 1])
        if u != v:
            left[count, 0], left[count, 1], left[count, 2] = u, v, gaps[i, 2]
            count += 1
    return left[:count]


@kernel
def close_opposite(gaps: Ints, straight: Ints) -> tuple[Ints, int]:
    """Close each two gaps between the same nodes in opposite directions; return the others.

    Writes a piece to ``straight`` where they are of two sources. The number of pieces comes last.
    """
    closed, count = np.zeros(len(gaps), np.uint8), 0
    for i in range(len(gaps)):
        for j in range(i):
            if closed[i] or closed[j]:
                continue
            if gaps[j, 0] == gaps[i, 1] and gaps[j, 1] == gaps[i, 0]:
                closed[i], closed[j] = 1, 1
                if gaps[i, 2] != gaps[j, 2]:
                    count = put_straight(
                        straight, count, gaps[i, 0], gaps[i, 1], gaps[i, 2], gaps[j, 2]
                    )
    left, size = np.empty(gaps.shape, np.int32), 0
    for i in range(len(gaps)):
        if not closed[i]:
            left[size, 0], left[size, 1], left[size, 2] = gaps[i, 0], gaps[i, 1], gaps[i, 2]
            size += 1
    return left[:size], count


@kernel
def draw_together(
    gaps: Ints, at: Floats, inner: int, parent: Ints, straight: Ints, count: int
) -> tuple[Floats, int]:
    """Draw each connected group of gaps together to a hub: a new node at the most central of its.

    Ends of bisectors, the nodes below ``inner``, become the hub, and crossings are joined to it by
    pieces, appended to the first ``count`` of ``straight``. Returns the places of all nodes, and
    the number of pieces. Modifies ``parent`` and ``straight``.
    """
    places, hub = np.empty((len(at) + len(gaps), 2)), len(at)
    copy_rows(at, places, 0)
    group = groups_of(gaps, len(at))
    for first in range(len(at)):
        central = most_central(gaps, at, group, first)
        if central < 0:
            continue
        places[hub, 0], places[hub, 1] = at[central, 0], at[central, 1]
        for i in range(len(gaps)):
            u = gaps[i, 0]
            if group[u] != first:
                continue
            if u < inner:
                parent[u] = hub
                continue
            for j in range(len(gaps)):  # the gap that ends at this crossing
                if gaps[j, 1] == u:
                    count = put_straight(straight, count, u, hub, gaps[i, 2], gaps[j, 2])
        hub += 1
    return places[:hub], count


@kernel
def groups_of(gaps: Ints, nodes: int) -> Ints:
    """Return the node that stands for the connected group of gaps of each node."""
    group = np.arange(nodes).astype(np.int32)
    for i in range(len(gaps)):
        group[root_of(group, gaps[i, 0])] = root_of(group, gaps[i, 1])
    for node in range(nodes):
        group[node] = root_of(group, node)
    return group


@kernel
def most_central(gaps: Ints, at: Floats, group: Ints, first: int) -> int:
    """Return the node of a group that is nearest to all others in sum; -1 if it has no gaps."""
    least, central = math.inf, -1
    for i in range(len(gaps)):
        u, ways = gaps[i, 0], 0.0
        if group[u] != first:
            continue
        for j in range(len(gaps)):
            v = gaps[j, 0]
            if group[v] == first:
                ways += math.hypot(at[u, 0] - at[v, 0], at[u, 1] - at[v, 1])
        if ways < least:
            least, central = ways, u
    return central


@kernel
def put_straight(rows: Ints, count: int, u: int, v: int, left: int, right: int) -> int:
    """Write a straight piece from node u to node v to row ``count``; return the next row."""
    rows[count, 0], rows[count, 1], rows[count, 2], rows[count, 3] = u, v, left, right
    return count + 1


@kernel
def trace_bisector(
    topology: Any, face: int, curve: Floats, error: float, points: Floats, count: int
) -> Any:
    """Append the points inside a bisector to ``points``, but for its ends; return both.

    Pieces that may stray farther from their chords than ``error`` are halved.
    """
    if is_line(curve):
        return points, count
    stack = np.empty((DEPTH + 2, 2))
    start, top = curve[START], 0
    stack[0, 0], stack[0, 1] = curve[END], 0.0
    while top >= 0:
        end, depth = stack[top, 0], stack[top, 1]
        if depth < DEPTH and strays(curve, start, end, error) > error:
            stack[top, 1] = depth + 1.0
            stack[top + 1, 0], stack[top + 1, 1] = 0.5 * (start + end), depth + 1.0
            top += 1
            continue
        if top > 0:
            points = with_room(points, count + 1)
            x, y = point_on(curve, end)
            put_in_face(topology, face, x, y, points[count])
            count += 1
        start, top = end, top - 1
    return points, count


@kernel
def trace_borders(
    topology: Any, territories: Any, labelled: Any, near: float, chord_error: float, first: int,
    last: int, next_node: int,
) -> tuple[Floats, Longs, Ints, Ints, Ints, int]:  # fmt: skip
    """Trace the borders of two sources in each of the faces from row ``first`` up to ``last``.

    Returns the pieces, as `Pieces` has them, but with the number of points of each. Nodes in faces
    have numbers from ``next_node`` on; the next free one comes last. Ends nearer than ``near``,
    mesh units, are one. O(n³) for n bisectors in a face.
    """
    topology, territories, labelled = borrowed(topology), borrowed(territories), borrowed(labelled)
    points, count = np.empty((4 * ROWS, 3)), 0
    points_of, pieces = np.empty((ROWS, 1), np.int64), 0
    nodes, sources = np.empty((ROWS, 2), np.int32), np.empty((ROWS, 2), np.int32)
    faces = np.empty((ROWS, 1), np.int32)
    for k in range(first, last):
        face = territories.faces[k, 0]
        curves = bisectors_inside(topology, territories, labelled, face, k, near)
        own, straight = nodes_of_face(topology, labelled, face, k, curves, near)
        room = pieces + len(curves) + len(straight)
        points_of, nodes = with_room(points_of, room), with_room(nodes, room)
        sources, faces = with_room(sources, room), with_room(faces, room)
        for i in range(len(curves) + len(straight)):
            u, v, left, right = ends_of_piece(curves, straight, own.parent, i)
            if min(left, right) < 0:
                continue
            begin = count
            points, count = put_node(topology, labelled, face, own, u, points, count)
            if i < len(curves):
                points, count = trace_bisector(
                    topology, face, curves[i], chord_error, points, count
                )
            points, count = put_node(topology, labelled, face, own, v, points, count)
            points_of[pieces, 0], faces[pieces, 0] = count - begin, face
            nodes[pieces, 0] = global_node(own, u, next_node)
            nodes[pieces, 1] = global_node(own, v, next_node)
            sources[pieces, 0], sources[pieces, 1] = min(left, right), max(left, right)
            pieces += 1
        next_node += len(own.places)
    return (
        points[:count],
        points_of[:pieces],
        nodes[:pieces],
        faces[:pieces],
        sources[:pieces],
        next_node,
    )


@kernel
def nodes_of_face(
    topology: Any, labelled: Any, face: int, k: int, curves: Floats, near: float
) -> tuple[FaceNodes, Ints]:
    """Return the nodes of the k-th face, which has these bisectors, and its straight pieces.

    The pieces, and ``near``, are as in `close_gaps`.
    """
    places, ids = crossings_of_face(topology, labelled, face, k)
    inner = 2 * len(curves)
    at = np.empty((inner + len(ids), 2))
    for b in range(len(curves)):
        at[2 * b, 0], at[2 * b, 1] = point_on(curves[b], curves[b, START])
        at[2 * b + 1, 0], at[2 * b + 1, 1] = point_on(curves[b], curves[b, END])
    copy_rows(places, at, inner)
    gaps = gaps_between(curves, places, ids)
    parent, straight, places = close_gaps(gaps, at, len(ids), near)
    return FaceNodes(inner, ids, parent, places), straight


@kernel
def ends_of_piece(
    curves: Floats, straight: Ints, parent: Ints, i: int
) -> tuple[int, int, int, int]:
    """Return the nodes of piece i, and the sources on its left and right; bisectors come first."""
    s = i - len(curves)
    if s >= 0:
        u, v = root_of(parent, straight[s, 0]), root_of(parent, straight[s, 1])
        return u, v, straight[s, 2], straight[s, 3]
    u, v = root_of(parent, 2 * i), root_of(parent, 2 * i + 1)
    return u, v, int(curves[i, LEFT]), int(curves[i, RIGHT])


@kernel
def crossing_of(nodes: FaceNodes, node: int) -> int:
    """Return the number of the crossing that a node of a face is, -1 if it is none."""
    place = node - nodes.inner
    return nodes.crossings[place, 0] if 0 <= place < len(nodes.crossings) else -1


@kernel
def global_node(nodes: FaceNodes, node: int, next_node: int) -> int:
    """Return the number of a node of a face among those of all faces."""
    crossing = crossing_of(nodes, node)
    return crossing if crossing >= 0 else next_node + node


@kernel
def put_node(
    topology: Any, labelled: Any, face: int, nodes: FaceNodes, node: int, points: Floats, count: int
) -> Any:
    """Append the point of a node of a face to ``points``; return them and their number."""
    nodes, crossing = borrowed(nodes), crossing_of(nodes, node)
    if crossing >= 0:
        return put_crossing(topology, labelled.crossings, crossing, points, count)
    points = with_room(points, count + 1)
    put_in_face(topology, face, nodes.places[node, 0], nodes.places[node, 1], points[count])
    return points, count + 1
