"""Chains: what of a line is in one face, from node to node; and their links across edges to lines.

The ends of chain c have the numbers 2 c and 2 c + 1, so that ``end ^ 1`` is the other end of the
same chain.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.curves.crossings import faces_at
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import inlined, kernel


class Chains(NamedTuple):
    """The chains of all faces."""

    points: Floats
    """(N, 3)"""
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
    """Chains joined to lines."""

    points: Floats
    """(N, 3)"""
    faces: Ints
    """(N,): the face behind each point; -1 behind the last one of an open line"""
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


@inlined
def copy_point(source: Floats, row: int, points: Floats, target: int) -> None:
    """Copy a point from a row of ``source`` to a row of ``points``."""
    for axis in range(3):
        points[target, axis] = source[row, axis]


@kernel
def link_crossing_chains(links: Ints, half_edges: Ints, chains: Any, shortest: float) -> Lines:
    """Join chains whose nodes are crossings, on ``half_edges``, to lines, as `link_chains` does.

    An open line begins where its first chain does, wherever there is such a chain.
    """
    count = len(chains.nodes)
    partner = partners(chains.nodes, nodes_at_seams(links, half_edges, len(half_edges)))
    order = np.empty(2 * count, np.int32)
    for chain in range(count):
        order[chain], order[count + chain] = 2 * chain, 2 * chain + 1
    done = np.zeros(count, np.uint8)
    return link_chains(chains, partner, order, done, half_edges, shortest)


@kernel
def link_chains(
    chains: Any, partner: Ints, order: Ints, done: Flags, place_of: Ints, shortest: float
) -> Lines:
    """Join chains to lines: first the open ones, then those that are closed.

    Lines begin at the ends of chains in the given ``order``, and go on as ``partner`` says. Chains
    that are ``done`` are left out; the call flags all others. Points nearer than ``shortest`` to
    the one before are left out, and so are lines of too few points. Where all points of an open
    line are as near, both ends are left, if they are apart and their nodes have different places
    by ``place_of``. From a place back to itself such a line may be rounding.
    """
    count, lines, total = len(chains.nodes), 0, 0
    points, faces = np.empty((len(chains.points), 3)), np.empty(len(chains.points), np.int32)
    first, closed = np.zeros(count + 1, np.int64), np.zeros(count, np.uint8)
    ends = np.empty((count, 2), np.int32)
    for is_closed in range(2):
        for i in range(len(order)):
            start = order[i]
            if done[start // 2] or (partner[start] >= 0) != is_closed:
                continue
            begin, end, last = total, start, start
            while end >= 0 and not done[end // 2]:
                done[end // 2] = 1
                total = append_chain(chains, end, shortest, points, faces, begin, total)
                last = end ^ 1
                end = partner[last]
            if is_closed:
                total -= 1  # the first point again
            elif total == begin + 1 and lead_apart(chains, place_of, start, last):
                copy_point(chains.points, row_at(chains, start), points, begin)
                copy_point(chains.points, row_at(chains, last), points, begin + 1)
                faces[begin] = chains.faces[start // 2]
                total += 1
            if total - begin < (3 if is_closed else 2):
                total = begin
                continue
            if not is_closed:
                faces[total - 1] = -1
            closed[lines], ends[lines, 0], ends[lines, 1] = is_closed, start, last
            lines += 1
            first[lines] = total
    return Lines(points[:total], faces[:total], first[: lines + 1], closed[:lines], ends[:lines])


@inlined
def lead_apart(chains: Any, place_of: Ints, start: int, last: int) -> bool:
    """Tell whether a line from one end of a chain to another leads to another place and point."""
    u, v = chains.nodes[start // 2, start % 2], chains.nodes[last // 2, last % 2]
    a, b, apart = row_at(chains, start), row_at(chains, last), 0.0
    for axis in range(3):
        apart = max(apart, abs(chains.points[a, axis] - chains.points[b, axis]))
    return place_of[u] != place_of[v] and apart > 0.0


@inlined
def append_chain(
    chains: Any, end: int, shortest: float, points: Floats, faces: Ints, begin: int, total: int
) -> int:
    """Append a chain, from one of its ends on, to the line that begins at point ``begin``.

    Fills ``points`` and ``faces`` from ``total`` on; returns the new total.
    """
    chain = end // 2
    lo, hi = chains.first[chain], chains.first[chain + 1]
    for i in range(hi - lo):
        source = lo + i if end % 2 == 0 else hi - 1 - i
        if total > begin:
            way = 0.0
            for axis in range(3):
                way += (chains.points[source, axis] - points[total - 1, axis]) ** 2
            if way > shortest * shortest:
                faces[total - 1] = chains.faces[chain]
            elif i == hi - lo - 1:  # the node replaces the point that is nearly there
                total -= 1
            else:
                continue
        copy_point(chains.points, source, points, total)
        total += 1
    return total
