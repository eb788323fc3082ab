"""Chains: what of a line is in one face, from node to node; and their links across edges to lines.

The ends of chain c have the numbers 2 c and 2 c + 1, so that ``end ^ 1`` is the other end of the
same chain.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.curves.crossings import faces_at
from geodesic_core.kernels.curves.face_points import copy_weights, way_between
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import inlined, kernel


class Chains(NamedTuple):
    """The chains of all faces."""

    weights: Floats
    """(N, 3): the points of each, by their weights in its face"""
    first: Longs
    """(c + 1,): the first point of each chain; where the last one ends"""
    nodes: Ints
    """(c, 2): the nodes at both ends: crossings, or other points; -1 of a chain closed by itself"""
    faces: Ints
    """(c,)"""


class ChainRows(NamedTuple):
    """Chains as they are traced, one after another; their points are elsewhere."""

    sizes: Longs
    """(c,): number of points of each"""
    nodes: Ints
    """(c, 2): as `Chains` has them"""
    faces: Ints
    """(c,)"""


class Lines(NamedTuple):
    """Chains joined to lines.

    Where a line goes from face to face, its point has weights in both.
    """

    arriving: Floats
    """(N, 3): weights of each point in the face that the line comes from; of the first point of an
    open line, in the face that it goes into"""
    leaving: Floats
    """(N, 3): weights of each point in ``faces``"""
    faces: Ints
    """(N,): the face that the line goes into at each point; at the last one of an open line, that
    which it comes from"""
    first: Longs
    """(L + 1,): the first point of each line; where the last one ends"""
    closed: Flags
    """(L,)"""
    ends: Ints
    """(L, 2): the end of a chain at which each line begins, and that at which it stops"""


@kernel
def room_for_chains(count: int) -> ChainRows:
    """Return room for some chains."""
    return ChainRows(
        np.empty(count, np.int64), np.empty((count, 2), np.int32), np.empty(count, np.int32)
    )


@kernel
def with_chain(chains: Any, count: int, size: int, face: int, u: int, v: int) -> Any:
    """Return chains with one more after the first ``count``: in the same arrays, or larger ones."""
    sizes, nodes = with_room(chains.sizes, count + 1), with_room(chains.nodes, count + 1)
    faces = with_room(chains.faces, count + 1)
    sizes[count], faces[count], nodes[count, 0], nodes[count, 1] = size, face, u, v
    return ChainRows(sizes, nodes, faces)


@inlined
def first_chains(chains: Any, count: int) -> Any:
    """Return the first ``count`` chains."""
    return ChainRows(chains.sizes[:count], chains.nodes[:count], chains.faces[:count])


@kernel
def nodes_at_seams(links: Ints, half_edges: Ints, nodes: int) -> Flags:
    """Flag the crossings of edges of more than two faces among ``nodes`` nodes; lines end there.

    The first nodes are the crossings, on ``half_edges``.
    """
    flags = np.zeros(nodes, np.uint8)
    for c in range(len(half_edges)):
        flags[c] = faces_at(links, half_edges[c]) > 2
    return flags


@kernel
def partners(nodes: Ints, stops: Flags) -> Ints:
    """Return the end of a chain that each end continues with, -1 for none.

    ``nodes`` are those of `Chains`. A line goes on at a node where two ends meet and no more,
    except where ``stops`` (N,) is set. A chain that is closed by itself continues with itself.
    """
    meeting, waiting = np.zeros(len(stops), np.int32), np.full(len(stops), -1, np.int32)
    partner = np.full(2 * len(nodes), -1, np.int32)
    for end in range(len(partner)):
        node = nodes[end // 2, end % 2]
        if node >= 0:
            meeting[node] += 1
    for end in range(len(partner)):
        node = nodes[end // 2, end % 2]
        if node < 0:
            partner[end] = end ^ 1
        elif meeting[node] != 2 or stops[node]:
            continue
        elif waiting[node] < 0:
            waiting[node] = end
        else:
            partner[end], partner[waiting[node]] = waiting[node], end
    return partner


@inlined
def row_at(chains: Any, end: int) -> int:
    """Return the row of the point at an end of a chain."""
    chain = end // 2
    return chains.first[chain] if end % 2 == 0 else chains.first[chain + 1] - 1


@kernel
def link_crossing_chains(topology: Any, half_edges: Ints, chains: Any, shortest: float) -> Lines:
    """Join chains whose nodes are crossings, on ``half_edges``, to lines, as `link_chains` does.

    Chains have the lower values on their left, and lines the higher ones, wherever all faces of a
    line run the same way.
    """
    count = len(chains.nodes)
    partner = partners(chains.nodes, nodes_at_seams(topology.links, half_edges, len(half_edges)))
    order = np.empty(2 * count, np.int32)
    for chain in range(count):
        order[chain], order[count + chain] = 2 * chain + 1, 2 * chain
    done = np.zeros(count, np.uint8)
    return link_chains(topology.geometry, chains, partner, order, done, half_edges, shortest)


@kernel
def link_chains(
    geometry: Floats, chains: Any, partner: Ints, order: Ints, done: Flags, place_of: Ints,
    shortest: float,
) -> Lines:  # fmt: skip
    """Join chains to lines: first the open ones, then those that are closed.

    Lines begin at the ends of chains in the given ``order``, and go on as ``partner`` says. Chains
    that are ``done`` are left out; the call flags all others. Points between two nodes that are
    nearer than ``shortest`` to the one before are left out. So are closed lines with fewer than
    three points farther apart, and open ones with fewer than two, unless their nodes have different
    places by ``place_of``: from a place back to itself such a line may be rounding. A closed line
    of two points leads over two faces of the same three vertices.
    """
    count, line_count, total = len(chains.nodes), 0, 0
    lines = room_for_lines(len(chains.weights), count)
    for is_closed in range(2):
        for i in range(len(order)):
            start = order[i]
            if done[start // 2] or (partner[start] >= 0) != is_closed:
                continue
            begin, end, last, apart = total, start, start, 0
            while end >= 0 and not done[end // 2]:
                done[end // 2] = 1
                total, more = append_chain(geometry, chains, end, shortest, lines, begin, total)
                last, apart = end ^ 1, apart + more
                end = partner[last]
            if is_closed:
                total -= 1  # the first point again
                copy_weights(lines.arriving, total, lines.arriving, begin)
                is_line = apart >= 3 or (
                    apart == 2 and lead_apart(chains, place_of, start, start ^ 1)
                )
            else:
                is_line = apart >= 1 or lead_apart(chains, place_of, start, last)
            if not is_line:
                total = begin
                continue
            lines.closed[line_count] = is_closed
            lines.ends[line_count, 0], lines.ends[line_count, 1] = start, last
            line_count += 1
            lines.first[line_count] = total
    return Lines(
        lines.arriving[:total], lines.leaving[:total], lines.faces[:total],
        lines.first[: line_count + 1], lines.closed[:line_count], lines.ends[:line_count],
    )  # fmt: skip


@inlined
def room_for_lines(points: int, lines: int) -> Lines:
    """Return room for some points of some lines."""
    return Lines(
        np.empty((points, 3)),
        np.empty((points, 3)),
        np.empty(points, np.int32),
        np.zeros(lines + 1, np.int64),
        np.zeros(lines, np.uint8),
        np.empty((lines, 2), np.int32),
    )


@inlined
def lead_apart(chains: Any, place_of: Ints, start: int, last: int) -> bool:
    """Tell whether a line from one end of a chain to another leads to another place."""
    u, v = chains.nodes[start // 2, start % 2], chains.nodes[last // 2, last % 2]
    return place_of[u] != place_of[v]


@inlined
def append_chain(
    geometry: Floats, chains: Any, end: int, shortest: float, lines: Any, begin: int, total: int
) -> tuple[int, int]:
    """Append a chain, from one of its ends on, to the line that begins at point ``begin``.

    Fills ``lines`` from ``total`` on; returns the new total, and how many points are farther from
    the one before than ``shortest``.
    """
    face, weights, first = chains.faces[end // 2], chains.weights, row_at(chains, end)
    if total == begin:
        copy_weights(weights, first, lines.arriving, total)
        total += 1
    copy_weights(weights, first, lines.leaving, total - 1)  # where the line goes on
    lines.faces[total - 1] = face
    count = chains.first[end // 2 + 1] - chains.first[end // 2]
    last, step, apart = first, 1 - 2 * (end % 2), 0
    for i in range(1, count):
        row = first + i * step
        is_apart = way_between(geometry, face, weights, last, row) > shortest
        if not is_apart and i < count - 1:
            continue
        apart += is_apart
        if is_apart or last == first:  # else the node replaces the point that is nearly there
            total += 1
        copy_weights(weights, row, lines.arriving, total - 1)
        copy_weights(weights, row, lines.leaving, total - 1)
        lines.faces[total - 1] = face
        last = row
    return total, apart
