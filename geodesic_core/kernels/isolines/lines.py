"""Lines of equal distance: arcs in faces, joined to chains, joined across edges to lines.

Arcs are cut out in every face that a level may pass (`arcs`). The crossings of the level with an
edge are found once for all faces of the edge, from the stretches that each of them holds to be
nearer. So each face is entered as often as it is left, by turns around it counter-clockwise. The
ends of its arcs are joined to each other and to these crossings, the nearest first. No arc can be
left over, however the ends are rounded.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.front.window import B0, B1, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.isolines.arcs import (
    ARC,
    END,
    ROWS,
    START,
    insert_interval,
    outer_arcs,
    point_on,
    with_room,
)
from geodesic_core.kernels.isolines.face_windows import FaceWindows
from geodesic_core.kernels.isolines.regions import (
    RADIUS,
    is_line,
    regions_of_face,
    runs_along,
    span_on_line,
)
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    COS_LEFT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    TAIL,
    half_edge_in_face,
    next_around,
)
from geodesic_core.kernels.planar import distance
from geodesic_core.tolerances import CROSSING, LEVEL, PIECE


class Field(NamedTuple):
    """The results of a sweep from which distances in faces follow."""

    face_windows: FaceWindows
    distance: Floats
    """(N,) by node"""
    site_ints: Ints
    """Those of sources only, by face"""
    site_weights: Floats
    segment_ints: Ints
    """By face"""
    segment_ends: Floats
    first_segment: int
    """The least node of a segment"""


class Cuts(NamedTuple):
    """The faces that a level may pass, with its arcs there and its spans on their edges."""

    faces: Ints
    """(n, 1)"""
    spans: Floats
    """(S, 2): stretches of half-edges within the level, by the regions of their face"""
    first_span: Ints
    """(3n + 1, 1): of each half-edge of the faces"""
    arcs: Floats
    """(A, ARC)"""
    first_arc: Ints
    """(n + 1, 1): of each face"""


UNKNOWN = -1
"""Number of crossings of an edge before they are looked for"""


class Crossings(NamedTuple):
    """The crossings of a level with the edges of the faces that it may pass."""

    positions: Floats
    """(C, 1): distance from the tail of the first half-edge of the edge, ascending on each edge"""
    half_edges: Ints
    """(C, 1): that half-edge"""
    first: Ints
    """(3n, 1): first crossing on the edge of each half-edge of the faces"""
    number: Ints
    """(3n, 1): number of crossings on that edge"""
    turned: Ints
    """(3n, 1): whether the half-edge runs against the one from whose tail positions are measured"""


class Chains(NamedTuple):
    """The level in each face, from crossing to crossing."""

    points: Floats
    """(N, 3)"""
    first: Longs
    """(c + 1, 1): the first point of each chain"""
    ends: Ints
    """(c, 2): the crossings at both ends; -1 of a chain that is closed by itself"""
    faces: Ints
    """(c, 1)"""


@kernel
def bound_faces(
    topology: Any, field: Any, first: int, last: int, least: Floats, most: Floats
) -> None:
    """Bound the distances in the faces from ``first`` up to ``last`` by windows and corners.

    Lowers ``least`` (F,) to lower bounds and ``most`` (F,) to upper bounds. Points and segments
    inside are left to the caller. O(windows of the faces).
    """
    geometry, face_windows = topology.geometry, field.face_windows
    ints = face_windows.windows.view(np.int32)
    for face in range(first, last):
        for h in range(3 * face, 3 * face + 3):
            for i in range(face_windows.first[h], face_windows.first[h + 1]):
                w = face_windows.windows[i]
                if ints[i, ROOT] >= field.first_segment:  # least at an end
                    x, sw = w[B1] if w[SX] > 0.0 else w[B0], 0.0
                else:
                    x, sw = min(max(w[SX], w[B0]), w[B1]), 1.0
                least[face] = min(least[face], distance(x, w[SX], w[SY], sw) + w[SIGMA])
            corner = field.distance[topology.links[h, TAIL]]
            farthest = max(geometry[h, LENGTH], geometry[h, LENGTH_LEFT])
            least[face], most[face] = min(least[face], corner), min(most[face], corner + farthest)


@kernel
def cut_faces(
    topology: Any, field: Any, faces: Ints, known: int, level: float, row_of: Ints
) -> tuple[Floats, Ints, Floats, Ints, Ints]:
    """Cut some of the faces that a level may pass; ``faces`` (n, 1) are their numbers.

    Returns their spans and arcs, each as `Cuts` has them, followed by the number for each half-edge
    and for each face. Last come neighbours that the level may pass as well, by these spans.
    ``row_of`` (F,) is the row of each face among all that are to be cut, -1 for none. There are
    ``known`` rows; those of the neighbours follow, and are written to ``row_of``.
    """
    topology, field = borrowed(topology), borrowed(field)
    links, geometry = topology.links, topology.geometry
    slack, shortest = LEVEL * level, PIECE * level
    spans, span_count = np.empty((ROWS, 2)), 0
    arcs, arc_count = np.empty((ROWS, ARC)), 0
    spans_of = np.empty((3 * len(faces), 1), np.int32)
    arcs_of = np.empty((len(faces), 1), np.int32)
    found, count = np.empty((ROWS, 1), np.int32), 0
    for k in range(len(faces)):
        f = faces[k, 0]
        regions = regions_of_face(topology, field, f, level)
        outer = outer_arcs(topology, f, regions, level, shortest)
        arcs = with_room(arcs, arc_count + len(outer))
        for i in range(len(outer)):
            for column in range(ARC):
                arcs[arc_count, column] = outer[i, column]
            arc_count += 1
        arcs_of[k, 0] = len(outer)
        for h in range(3 * f, 3 * f + 3):
            spans, begin = with_room(spans, span_count + len(regions)), span_count
            size = cut_edge(geometry, h, regions, slack, spans[begin:])
            spans_of[3 * (k - f) + h, 0] = size
            span_count += size
            is_whole = size == 1 and spans[begin, 0] <= 0.0
            is_whole = is_whole and spans[begin, 1] >= geometry[h, LENGTH]
            g = -1 if is_whole or size == 0 else next_around(links, h)
            while g >= 0 and g != h:
                if row_of[g // 3] < 0:
                    found = with_room(found, count + 1)
                    found[count, 0], row_of[g // 3] = g // 3, known + count
                    count += 1
                g = next_around(links, g)
    return spans[:span_count], spans_of, arcs[:arc_count], arcs_of, found[:count]


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
def cross_edges(
    topology: Any, distance: Floats, cuts: Any, level: float, row_of: Ints
) -> Crossings:
    """Find the crossings of a level with the edges of the faces that it may pass, each edge once.

    A vertex at the level, within `LEVEL`, counts as nearer. An end of an edge is on the same side
    as its vertex. So the crossings around a face come in pairs.
    """
    links, geometry, reach = topology.links, topology.geometry, level * (1.0 + LEVEL)
    count, total, spans = 3 * len(cuts.faces), 0, np.empty((ROWS, 2))
    positions, half_edges = np.empty((ROWS, 1)), np.empty((ROWS, 1), np.int32)
    first, turned = np.zeros((count, 1), np.int32), np.zeros((count, 1), np.int32)
    number = np.full((count, 1), UNKNOWN, np.int32)
    for n in range(count):
        if number[n, 0] != UNKNOWN:
            continue
        h, begin = 3 * cuts.faces[n // 3, 0] + n % 3, total
        tail_inside = distance[links[h, TAIL]] <= reach
        head_inside = distance[links[h, HEAD]] <= reach
        spans, size = spans_on_edge(topology, cuts, row_of, h, tail_inside, head_inside, spans)
        positions = with_room(positions, total + 2 * size)
        half_edges = with_room(half_edges, total + 2 * size)
        for i in range(size):
            lo, hi = spans[i, 0], spans[i, 1]
            from_tail = tail_inside and i == 0
            to_head = head_inside and i == size - 1
            if from_tail or to_head or hi - lo > CROSSING * geometry[h, LENGTH]:
                if not from_tail:
                    positions[total, 0], half_edges[total, 0] = lo, h
                    total += 1
                if not to_head:
                    positions[total, 0], half_edges[total, 0] = hi, h
                    total += 1
        number_around(links, row_of, h, begin, total, first, number, turned)
    return Crossings(positions[:total], half_edges[:total], first, number, turned)


@inlined
def number_around(
    links: Ints, row_of: Ints, h: int, begin: int, end: int, first: Ints, number: Ints, turned: Ints
) -> None:
    """Note that the crossings from ``begin`` to ``end`` are those of h's edge.

    Modifies ``first``, ``number`` and ``turned``, as `Crossings` has them, for each half-edge of
    the edge.
    """
    g = h
    while True:
        if row_of[g // 3] >= 0:
            m = 3 * row_of[g // 3] + g % 3
            first[m, 0], number[m, 0] = begin, end - begin
            turned[m, 0] = links[g, TAIL] != links[h, TAIL]
        g = next_around(links, g)
        if g < 0 or g == h:
            break


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
        if row_of[g // 3] >= 0:
            m = 3 * row_of[g // 3] + g % 3
            first, end = cuts.first_span[m, 0], cuts.first_span[m + 1, 0]
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


@kernel
def ends_of_face(
    topology: Any, distance: Floats, cuts: Any, crossings: Any, k: int, level: float
) -> tuple[Floats, Ints, Floats, Ints]:
    """Return the points at which arcs end and start in the k-th face, and the number of each.

    Crossings are among them, with numbers -1 - c below zero. A line enters the face at a crossing
    from which the boundary, counter-clockwise, is farther than the level. Such a crossing counts as
    an end, and one at which the line leaves as a start.
    """
    face = cuts.faces[k, 0]
    arc0, arc1 = cuts.first_arc[k, 0], cuts.first_arc[k + 1, 0]
    room = arc1 - arc0
    for n in range(3 * k, 3 * k + 3):
        room += crossings.number[n, 0]
    ends, end_ids, end_count = np.empty((room, 2)), np.empty(room, np.int32), 0
    starts, start_ids, start_count = np.empty((room, 2)), np.empty(room, np.int32), 0
    for a in range(arc0, arc1):
        arc = cuts.arcs[a]
        ends[end_count, 0], ends[end_count, 1] = point_on(arc, arc[END])
        starts[start_count, 0], starts[start_count, 1] = point_on(arc, arc[START])
        end_ids[end_count], start_ids[start_count] = a, a
        end_count, start_count = end_count + 1, start_count + 1
    for i in range(3):
        h, n = 3 * face + i, 3 * k + i
        ox, oy, ux, uy = half_edge_in_face(topology.geometry, h)
        inside = distance[topology.links[h, TAIL]] <= level * (1.0 + LEVEL)
        for j in range(crossings.number[n, 0]):
            c = crossings.first[n, 0] + j
            x = crossings.positions[c, 0]
            if crossings.turned[n, 0]:
                c = crossings.first[n, 0] + crossings.number[n, 0] - 1 - j
                x = topology.geometry[h, LENGTH] - crossings.positions[c, 0]
            if inside:
                ends[end_count, 0], ends[end_count, 1] = ox + x * ux, oy + x * uy
                end_ids[end_count] = -1 - c
                end_count += 1
            else:
                starts[start_count, 0], starts[start_count, 1] = ox + x * ux, oy + x * uy
                start_ids[start_count] = -1 - c
                start_count += 1
            inside = not inside
    return ends[:end_count], end_ids[:end_count], starts[:start_count], start_ids[:start_count]


@kernel
def join(ends: Floats, starts: Floats) -> Ints:
    """Return for each end the start that it is joined to: the nearest pair first, and so on.

    Each round joins all pairs that are each other's nearest, of which there is at least one. Mostly
    one round of O(n²).
    """
    count = len(ends)
    joined, taken = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    nearest_start, nearest_end = np.empty(count, np.int32), np.empty(count, np.int32)
    left = count
    while left > 0:
        reach_end, reach_start = np.full(count, np.inf), np.full(count, np.inf)
        for i in range(count):
            if joined[i] >= 0:
                continue
            for j in range(count):
                if taken[j] >= 0:
                    continue
                d = math.hypot(ends[i, 0] - starts[j, 0], ends[i, 1] - starts[j, 1])
                if d < reach_end[i]:
                    reach_end[i], nearest_start[i] = d, j
                if d < reach_start[j]:
                    reach_start[j], nearest_end[j] = d, i
        for i in range(count):
            if joined[i] < 0 and nearest_end[nearest_start[i]] == i:
                joined[i], taken[nearest_start[i]] = nearest_start[i], i
                left -= 1
    return joined


@kernel
def step_of(radius: float, chord_error: float) -> float:
    """Angle of a chord that strays from its circle by an error, at most a third of the circle."""
    return 4.0 * math.asin(min(math.sqrt(0.5 * chord_error / radius), 0.5))


@kernel
def trace_arc(
    topology: Any, face: int, arc: Floats, error: float, points: Floats, count: int
) -> Any:
    """Append an arc's points to ``points``, both ends included; return them and their number."""
    width, chords = arc[END] - arc[START], 1
    if not is_line(arc):
        chords = max(math.ceil(width / step_of(arc[RADIUS], error)), 1)
    points = with_room(points, count + chords + 1)
    for i in range(chords + 1):
        x, y = point_on(arc, arc[START] + width * (i / chords))
        put_in_face(topology, face, x, y, points[count])
        count += 1
    return points, count


@inlined
def put_in_face(topology: Any, face: int, x: float, y: float, point: Floats) -> None:
    """Write the point of a face at (x, y) in its frame to ``point`` (3,), pulled into the face."""
    links, geometry, positions = topology.links, topology.geometry, topology.positions
    h = 3 * face
    tail, head, apex = links[h, TAIL], links[h, HEAD], links[h + 1, HEAD]
    ax = geometry[h, LENGTH_LEFT] * geometry[h, COS_LEFT]
    ay = geometry[h, LENGTH_LEFT] * geometry[h, SIN_LEFT]
    up = min(max(y / ay, 0.0), 1.0) if ay > 0.0 else 0.0
    along = min(max((x - up * ax) / geometry[h, LENGTH], 0.0), 1.0 - up)
    for axis in range(3):
        start = positions[tail, axis]
        rise = along * (positions[head, axis] - start) + up * (positions[apex, axis] - start)
        point[axis] = start + rise


@kernel
def put_crossing(topology: Any, crossings: Any, c: int, points: Floats, count: int) -> Any:
    """Append the point of a crossing to ``points``: the same to the bit for all faces."""
    links, positions, h = topology.links, topology.positions, crossings.half_edges[c, 0]
    share = crossings.positions[c, 0] / topology.geometry[h, LENGTH]
    points = with_room(points, count + 1)
    for axis in range(3):
        start, end = positions[links[h, TAIL], axis], positions[links[h, HEAD], axis]
        points[count, axis] = (1.0 - share) * start + share * end
    return points, count + 1


@kernel
def chain_arcs(
    topology: Any,
    distance: Floats,
    cuts: Any,
    crossings: Any,
    level: float,
    chord_error: float,
    first: int,
    last: int,
) -> tuple[Floats, Longs, Ints, Ints]:
    """Join the arcs of each of the cut faces from ``first`` up to ``last`` to chains.

    Returns the chains, as `Chains` has them, but with the number of points of each. O(n²) for n
    arcs in a face.
    """
    points, count = np.empty((4 * ROWS, 3)), 0
    points_of, ends = np.empty((ROWS, 1), np.int64), np.empty((ROWS, 2), np.int32)
    faces, chains = np.empty((ROWS, 1), np.int32), 0
    for k in range(first, last):
        face = cuts.faces[k, 0]
        end_places, end_ids, start_places, start_ids = ends_of_face(
            topology, distance, cuts, crossings, k, level
        )
        joined = join(end_places, start_places)
        arc0 = cuts.first_arc[k, 0]
        arcs = cuts.first_arc[k + 1, 0] - arc0  # the first of the ends, and of the starts
        done = np.zeros(arcs, np.uint8)
        # Lines that come in over an edge; then those that are closed within the face
        for i in range(len(end_ids)):
            e = arcs + i if i < len(end_ids) - arcs else i - (len(end_ids) - arcs)
            if e < arcs and done[e]:
                continue
            points_of = with_room(points_of, chains + 1)
            ends, faces = with_room(ends, chains + 1), with_room(faces, chains + 1)
            faces[chains, 0], ends[chains, 0], ends[chains, 1] = face, -1, -1
            begin, s = count, e
            if e >= arcs:
                ends[chains, 0] = -1 - end_ids[e]
                points, count = put_crossing(topology, crossings, ends[chains, 0], points, count)
                s = joined[e]
            while s < arcs and not done[s]:
                done[s] = 1
                points, count = trace_arc(
                    topology, face, cuts.arcs[arc0 + s], chord_error, points, count
                )
                s = joined[s]
            if s >= arcs:
                ends[chains, 1] = -1 - start_ids[s]
                points, count = put_crossing(topology, crossings, ends[chains, 1], points, count)
            else:
                points = with_room(points, count + 1)
                for axis in range(3):
                    points[count, axis] = points[begin, axis]
                count += 1
            points_of[chains, 0] = count - begin
            chains += 1
    return points[:count], points_of[:chains], ends[:chains], faces[:chains]


@kernel
def faces_at(links: Ints, h: int) -> int:
    """Return how many faces the edge of h has."""
    count, g = 1, next_around(links, h)
    while g >= 0 and g != h:
        count += 1
        g = next_around(links, g)
    return count


@kernel
def link_chains(
    links: Ints, crossings: Any, chains: Any, shortest: float
) -> tuple[Floats, Ints, Longs, Flags]:
    """Join chains across edges to lines; return points, faces, first points and closed flags.

    The faces are those that follow each point; the last point of an open line has none, -1. The
    first points and the flags have a row for each line. Points nearer than ``shortest`` to the one
    before are left out, and so are lines of too few points. Of an open line that crosses a strip so
    narrow, from one edge to another, both ends are left.
    """
    count, partner = len(chains.ends), partners(links, crossings, chains)
    done, lines, total = np.zeros(count, np.uint8), 0, 0
    points, faces = np.empty((len(chains.points), 3)), np.empty(len(chains.points), np.int32)
    first, closed = np.zeros(count + 1, np.int64), np.zeros(count, np.uint8)
    for turn in range(3):  # open lines from their beginnings; the rest of them; closed lines
        for start in range(2 * count):
            is_open = chains.ends[start // 2, start % 2] >= 0 and partner[start] < 0
            if done[start // 2] or (turn < 2 and not is_open) or (turn != 1 and start % 2):
                continue
            begin, end, last = total, start, start
            while end >= 0 and not done[end // 2]:
                done[end // 2] = 1
                total = append_chain(chains, end, shortest, points, faces, begin, total)
                last = end ^ 1
                end = partner[last]
            if is_open and total == begin + 1 and lead_across(crossings, chains, start, last):
                for axis in range(3):
                    points[total, axis] = points[begin, axis]
                    points[begin, axis] = chains.points[row_at(chains, start), axis]
                faces[begin] = chains.faces[start // 2, 0]
                total += 1
            if not is_open and total > begin + 1:
                total -= 1  # the first point again
            else:
                faces[total - 1] = -1
            if total - begin < (2 if is_open else 3):
                total = begin
                continue
            closed[lines] = not is_open
            lines += 1
            first[lines] = total
    return points[:total], faces[:total], first[: lines + 1], closed[:lines]


@kernel
def partners(links: Ints, crossings: Any, chains: Any) -> Ints:
    """Return the end of a chain that each end continues with, -1 for none.

    The ends of chain c are 2 c and 2 c + 1. At an edge of more than two faces lines end.
    """
    count = 2 * len(chains.ends)
    partner = np.full(count, -1, np.int32)
    waiting = np.full(len(crossings.positions), -1, np.int32)
    for end in range(count):
        c = chains.ends[end // 2, end % 2]
        if c < 0 or faces_at(links, crossings.half_edges[c, 0]) > 2:
            continue
        if waiting[c] < 0:
            waiting[c] = end
        else:
            partner[end], partner[waiting[c]] = waiting[c], end
    return partner


@inlined
def row_at(chains: Any, end: int) -> int:
    """Return the row of the point at an end of a chain."""
    chain = end // 2
    return chains.first[chain, 0] if end % 2 == 0 else chains.first[chain + 1, 0] - 1


@inlined
def lead_across(crossings: Any, chains: Any, start: int, last: int) -> bool:
    """Tell whether a line whose ends these are leads from an edge to another, to another point.

    From an edge back to itself it may be rounding: a gap between the spans of two windows.
    """
    c, d = chains.ends[start // 2, start % 2], chains.ends[last // 2, last % 2]
    apart = 0.0
    for axis in range(3):
        begin, end = (
            chains.points[row_at(chains, start), axis],
            chains.points[row_at(chains, last), axis],
        )
        apart = max(apart, abs(end - begin))
    return crossings.half_edges[c, 0] != crossings.half_edges[d, 0] and apart > 0.0


@inlined
def append_chain(
    chains: Any, end: int, shortest: float, points: Floats, faces: Ints, begin: int, total: int
) -> int:
    """Append a chain, from one of its ends on, to the line that begins at point ``begin``.

    Fills ``points`` and ``faces`` from ``total`` on; returns the new total.
    """
    chain = end // 2
    lo, hi = chains.first[chain, 0], chains.first[chain + 1, 0]
    for i in range(hi - lo):
        source = lo + i if end % 2 == 0 else hi - 1 - i
        if total > begin:
            way = 0.0
            for axis in range(3):
                way += (chains.points[source, axis] - points[total - 1, axis]) ** 2
            if way > shortest * shortest:
                faces[total - 1] = chains.faces[chain, 0]
            elif i == hi - lo - 1:  # the crossing replaces the point that is nearly there
                total -= 1
            else:
                continue
        for axis in range(3):
            points[total, axis] = chains.points[source, axis]
        total += 1
    return total
