"""Lines of equal distance: arcs in faces, joined to chains, joined across edges to lines.

In every face that a level may pass, the arcs are cut out (`arcs`). Where the level crosses an edge
is found once for all faces of that edge, from what each of them says that is nearer. So each face
is entered as often as it is left, counter-clockwise around it by turns; and the ends of its arcs
are joined, the nearest first, to each other and to these crossings. No piece can be left over,
however the ends are rounded.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.isolines.arcs import ARC, FROM, TO, outer_arcs, point_on, with_room
from geodesic_core.kernels.isolines.face_windows import FaceWindows
from geodesic_core.kernels.isolines.regions import (
    RADIUS,
    is_line,
    regions_of_face,
    runs_along,
    span_on_line,
)
from geodesic_core.kernels.jit import kernel
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
from geodesic_core.kernels.sweep.window import B0, B1, ROOT, SIGMA, SX, SY
from geodesic_core.tolerances import CROSSING, LEVEL, PIECE


class Field(NamedTuple):
    """What a finished sweep knows of the distances in its faces."""

    kept: FaceWindows
    distance: Floats
    """(N,) by node"""
    site_ints: Ints
    """Those of sources only, by face"""
    site_weights: Floats
    piece_ints: Ints
    """By face"""
    piece_ends: Floats
    first_piece: int
    """The least node of a piece"""


class Cuts(NamedTuple):
    """The faces that a level may pass, and what it does there."""

    faces: Ints
    """(n, 1)"""
    spans: Floats
    """(S, 2): stretches of half-edges that are no farther than the level, as the face says"""
    first_span: Ints
    """(3n + 1, 1): of each half-edge of the faces"""
    arcs: Floats
    """(A, ARC)"""
    first_arc: Ints
    """(n + 1, 1): of each face"""


class Crossings(NamedTuple):
    """Where a level crosses the edges of the faces that it may pass."""

    places: Floats
    """(C, 1): distance from the tail of the first half-edge of the edge, ascending there"""
    half_edges: Ints
    """(C, 1): that half-edge"""
    first: Ints
    """(3n, 1): of the edge of each half-edge of the faces"""
    number: Ints
    """(3n, 1): how many there are on that edge"""
    turned: Ints
    """(3n, 1): whether the half-edge runs against that from which places are counted"""


class Chains(NamedTuple):
    """What the level does in each face, from crossing to crossing."""

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
    """Lower bounds (F,) of the distances in some faces in a row to what windows and corners say.

    ``most`` (F,) to upper ones. Points and pieces inside are left to the caller. O(their windows).
    """
    geometry, kept = topology.geometry, field.kept
    ints = kept.windows.view(np.int32)
    for face in range(first, last):
        for h in range(3 * face, 3 * face + 3):
            for i in range(kept.first[h], kept.first[h + 1]):
                w = kept.windows[i]
                if ints[i, ROOT] >= field.first_piece:  # least at an end
                    x, sw = w[B1] if w[SX] > 0.0 else w[B0], 0.0
                else:
                    x, sw = min(max(w[SX], w[B0]), w[B1]), 1.0
                least[face] = min(least[face], distance(x, w[SX], w[SY], sw) + w[SIGMA])
            corner = field.distance[topology.links[h, TAIL]]
            farthest = max(geometry[h, LENGTH], geometry[h, LENGTH_LEFT])
            least[face], most[face] = min(least[face], corner), min(most[face], corner + farthest)


@kernel
def cut_faces(
    topology: Any, field: Any, faces: Ints, known: int, level: float, place: Ints
) -> tuple[Floats, Ints, Floats, Ints, Ints]:
    """Cut some (n, 1) of the faces that a level may pass.

    Returns their spans and arcs, each as `Cuts` has them, followed by how many there are of each
    half-edge and of each face; then the faces that the level may pass as well, as these say.
    ``place`` (F,) tells where among all faces each one is, -1 for none; ``known`` is how many there
    are, and those that are found come after them.
    """
    links, geometry = topology.links, topology.geometry
    slack, shortest = LEVEL * level, PIECE * level
    spans, span_count = np.empty((64, 2)), 0
    arcs, arc_count = np.empty((64, ARC)), 0
    spans_of = np.empty((3 * len(faces), 1), np.int32)
    arcs_of = np.empty((len(faces), 1), np.int32)
    found, count = np.empty((64, 1), np.int32), 0
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
            ox, oy, ux, uy = half_edge_in_face(geometry, h)
            length, begin = geometry[h, LENGTH], span_count
            spans = with_room(spans, span_count + len(regions))
            for i in range(len(regions)):
                along = runs_along(regions[i], slack, ox, oy, ux, uy, length)
                beyond = slack if along else 0.0  # at the level counts as nearer
                lo, hi = span_on_line(regions[i], beyond, ox, oy, ux, uy, 0.0, length)
                if lo <= hi:
                    spans[span_count, 0], spans[span_count, 1] = lo, hi
                    span_count += 1
            span_count = begin + united(spans[begin:span_count], CROSSING * length)
            spans_of[3 * (k - f) + h, 0] = span_count - begin
            whole = span_count == begin + 1 and spans[begin, 0] <= 0.0 and spans[begin, 1] >= length
            g = -1 if whole or span_count == begin else next_around(links, h)
            while g >= 0 and g != h:
                if place[g // 3] < 0:
                    found = with_room(found, count + 1)
                    found[count, 0], place[g // 3] = g // 3, known + count
                    count += 1
                g = next_around(links, g)
    return spans[:span_count], spans_of, arcs[:arc_count], arcs_of, found[:count]


@kernel
def united(spans: Floats, gap: float) -> int:
    """Sort spans and unite those that leave no more than a gap; return how many are left."""
    for i in range(1, len(spans)):
        lo, hi, place = spans[i, 0], spans[i, 1], i
        while place > 0 and spans[place - 1, 0] > lo:
            spans[place, 0], spans[place, 1] = spans[place - 1, 0], spans[place - 1, 1]
            place -= 1
        spans[place, 0], spans[place, 1] = lo, hi
    count = 0
    for i in range(len(spans)):
        if count > 0 and spans[i, 0] <= spans[count - 1, 1] + gap:
            spans[count - 1, 1] = max(spans[count - 1, 1], spans[i, 1])
        else:
            spans[count, 0], spans[count, 1] = spans[i, 0], spans[i, 1]
            count += 1
    return count


@kernel
def cross_edges(topology: Any, distance: Floats, cuts: Any, level: float, place: Ints) -> Crossings:
    """Find where a level crosses the edges of the faces that it may pass, each edge once.

    A vertex at the level, within `LEVEL`, counts as nearer, and no end of an edge is anything but
    what its vertex is: so that what crosses the edges around a face does so in pairs.
    """
    reach = level * (1.0 + LEVEL)
    links, geometry = topology.links, topology.geometry
    count = 3 * len(cuts.faces)
    places, half_edges, total = np.empty((64, 1)), np.empty((64, 1), np.int32), 0
    first, number = np.zeros((count, 1), np.int32), np.zeros((count, 1), np.int32)
    turned, known = np.zeros((count, 1), np.int32), np.zeros(count, np.uint8)
    spans = np.empty((64, 2))
    for n in range(count):
        if known[n]:
            continue
        h = 3 * cuts.faces[n // 3, 0] + n % 3
        length, gap = geometry[h, LENGTH], CROSSING * geometry[h, LENGTH]
        tail_inside = distance[links[h, TAIL]] <= reach
        head_inside = distance[links[h, HEAD]] <= reach
        size, begin, g = 0, total, h
        if tail_inside:
            spans[size, 0], spans[size, 1] = 0.0, 0.0
            size += 1
        if head_inside:
            spans[size, 0], spans[size, 1] = length, length
            size += 1
        while True:
            if place[g // 3] >= 0:
                m = 3 * place[g // 3] + g % 3
                against = links[g, TAIL] != links[h, TAIL]
                known[m], first[m, 0], turned[m, 0] = 1, begin, against
                spans = with_room(spans, size + cuts.first_span[m + 1, 0] - cuts.first_span[m, 0])
                for i in range(cuts.first_span[m, 0], cuts.first_span[m + 1, 0]):
                    lo, hi = cuts.spans[i, 0], cuts.spans[i, 1]
                    if against:
                        lo, hi = length - hi, length - lo
                    spans[size, 0] = lo if tail_inside else max(lo, gap)
                    spans[size, 1] = hi if head_inside else min(hi, length - gap)
                    size += 1
            g = next_around(links, g)
            if g < 0 or g == h:
                break
        size = united(spans[:size], gap)
        places = with_room(places, total + 2 * size)
        half_edges = with_room(half_edges, total + 2 * size)
        for i in range(size):
            lo, hi = spans[i, 0], spans[i, 1]
            from_tail = tail_inside and i == 0
            to_head = head_inside and i == size - 1
            if from_tail or to_head or hi - lo > gap:
                if not from_tail:
                    places[total, 0], half_edges[total, 0] = lo, h
                    total += 1
                if not to_head:
                    places[total, 0], half_edges[total, 0] = hi, h
                    total += 1
        g = h
        while True:
            if place[g // 3] >= 0:
                number[3 * place[g // 3] + g % 3, 0] = total - begin
            g = next_around(links, g)
            if g < 0 or g == h:
                break
    return Crossings(places[:total], half_edges[:total], first, number, turned)


@kernel
def ends_of_face(
    topology: Any, distance: Floats, cuts: Any, crossings: Any, k: int, level: float
) -> tuple[Floats, Ints, Floats, Ints]:
    """Return where pieces end and where they begin in the k-th face, and what each is.

    Numbers below zero are crossings, -1 - c; others are arcs. The line enters a face where the
    boundary, counter-clockwise, comes to what is farther: there a piece ends, so to say.
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
        ends[end_count, 0], ends[end_count, 1] = point_on(arc, arc[TO])
        starts[start_count, 0], starts[start_count, 1] = point_on(arc, arc[FROM])
        end_ids[end_count], start_ids[start_count] = a, a
        end_count, start_count = end_count + 1, start_count + 1
    for i in range(3):
        h, n = 3 * face + i, 3 * k + i
        ox, oy, ux, uy = half_edge_in_face(topology.geometry, h)
        inside = distance[topology.links[h, TAIL]] <= level * (1.0 + LEVEL)
        for j in range(crossings.number[n, 0]):
            c = crossings.first[n, 0] + j
            x = crossings.places[c, 0]
            if crossings.turned[n, 0]:
                c = crossings.first[n, 0] + crossings.number[n, 0] - 1 - j
                x = topology.geometry[h, LENGTH] - crossings.places[c, 0]
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
    """Return for each end the start that it is joined to: the nearest pair first, then of the rest.

    Pairs that are each other's nearest are joined at once; so are at least the nearest of each
    round. Mostly one round of O(n²).
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
    """Append an arc's points, both ends included; return the points and how many there are."""
    links, geometry, positions = topology.links, topology.geometry, topology.positions
    h = 3 * face
    tail, head = positions[links[h, TAIL]], positions[links[h, HEAD]]
    apex = positions[links[h + 1, HEAD]]
    length = geometry[h, LENGTH]
    ax = geometry[h, LENGTH_LEFT] * geometry[h, COS_LEFT]
    ay = geometry[h, LENGTH_LEFT] * geometry[h, SIN_LEFT]
    width, chords = arc[TO] - arc[FROM], 1
    if not is_line(arc):
        chords = max(math.ceil(width / step_of(arc[RADIUS], error)), 1)
    points = with_room(points, count + chords + 1)
    for i in range(chords + 1):
        x, y = point_on(arc, arc[FROM] + width * (i / chords))
        up = min(max(y / ay, 0.0), 1.0) if ay > 0.0 else 0.0
        along = min(max((x - up * ax) / length, 0.0), 1.0 - up)
        for axis in range(3):
            rise = along * (head[axis] - tail[axis]) + up * (apex[axis] - tail[axis])
            points[count, axis] = tail[axis] + rise
        count += 1
    return points, count


@kernel
def put_crossing(topology: Any, crossings: Any, c: int, points: Floats, count: int) -> Any:
    """Append the point of a crossing: the same to the bit for all faces."""
    links, positions, h = topology.links, topology.positions, crossings.half_edges[c, 0]
    share = crossings.places[c, 0] / topology.geometry[h, LENGTH]
    points = with_room(points, count + 1)
    for axis in range(3):
        start, end = positions[links[h, TAIL], axis], positions[links[h, HEAD], axis]
        points[count, axis] = (1.0 - share) * start + share * end
    return points, count + 1


@kernel
def chain_pieces(
    topology: Any,
    distance: Floats,
    cuts: Any,
    crossings: Any,
    level: float,
    chord_error: float,
    first: int,
    last: int,
) -> tuple[Floats, Longs, Ints, Ints]:
    """Join the pieces of each of the cut faces from the first up to the last.

    Returns the chains, as `Chains` has them, with the number of points of each. O(n²) for n pieces
    in a face.
    """
    points, count = np.empty((256, 3)), 0
    points_of, ends = np.empty((64, 1), np.int64), np.empty((64, 2), np.int32)
    faces, chains = np.empty((64, 1), np.int32), 0
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
    """Join chains across edges to lines: points, faces, the first point of each, what is closed.

    Across an edge of more than two faces lines end. The faces are those that follow each point; the
    last of an open line has none, -1. Points nearer than ``shortest`` to the one before are left
    out, and with them lines that are not longer.
    """
    count = len(chains.ends)
    partner = np.full(2 * count, -1, np.int32)  # of each end of a chain, 2 c and 2 c + 1
    waiting = np.full(len(crossings.places), -1, np.int32)
    for end in range(2 * count):
        c = chains.ends[end // 2, end % 2]
        if c < 0 or faces_at(links, crossings.half_edges[c, 0]) > 2:
            continue
        if waiting[c] < 0:
            waiting[c] = end
        else:
            partner[end], partner[waiting[c]] = waiting[c], end
    done, lines = np.zeros(count, np.uint8), 0
    points, faces = np.empty((len(chains.points), 3)), np.empty(len(chains.points), np.int32)
    first, closed = np.zeros(count + 1, np.int64), np.zeros(count, np.uint8)
    total = 0
    for turn in range(3):  # open lines from where they begin; what is left of them; closed ones
        for start in range(2 * count):
            is_open = chains.ends[start // 2, start % 2] >= 0 and partner[start] < 0
            if done[start // 2] or (turn < 2 and not is_open) or (turn != 1 and start % 2):
                continue
            begin, end, last = total, start, start
            while not done[end // 2]:
                chain = end // 2
                done[chain] = 1
                lo, hi = chains.first[chain, 0], chains.first[chain + 1, 0]
                for i in range(hi - lo):
                    source = lo + i if end % 2 == 0 else hi - 1 - i
                    if total > begin:
                        way = 0.0
                        for axis in range(3):
                            way += (chains.points[source, axis] - points[total - 1, axis]) ** 2
                        if way > shortest * shortest:
                            faces[total - 1] = chains.faces[chain, 0]
                        elif i == hi - lo - 1:  # the crossing, not what nearly is there
                            total -= 1
                        else:
                            continue
                    for axis in range(3):
                        points[total, axis] = chains.points[source, axis]
                    total += 1
                last = end ^ 1
                if partner[last] < 0:
                    break
                end = partner[last]
            is_closed = not is_open
            if is_closed and total > begin + 1:
                total -= 1  # the first point again
            else:
                faces[total - 1] = -1
            if total - begin < (3 if is_closed else 2):
                total = begin
                continue
            closed[lines] = is_closed
            lines += 1
            first[lines] = total
    return points[:total], faces[:total], first[: lines + 1], closed[:lines]
