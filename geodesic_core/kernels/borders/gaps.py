"""Closing the gaps in the outlines of a face, so that borders go on from edge to edge, and meet.

Where an end and its start are one point up to rounding, they become one node. A gap in the outlines
of two sources, in opposite directions, is closed by a straight piece of border. Other gaps are
drawn together to the most central of their nodes.
"""

import math

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.rows import copy_rows
from geodesic_core.kernels.jit import kernel


@kernel
def root_of(parent: Ints, node: int) -> int:
    """Return the node that stands for all that a node was united with."""
    while parent[node] != node:
        node = parent[node]
    return node


@kernel
def close_gaps(gaps: Ints, at: Floats, crossings: int, near: float) -> tuple[Ints, Ints, Floats]:
    """Close the gaps of a face: unite nodes, and return straight pieces between others.

    The nodes are at ``at``; the last ``crossings`` of them are crossings, which stay apart. Ends
    nearer than ``near`` are one. The first array returned has the node that each node is united
    with, which may be a new one. The second has the pieces (n, 4): their two nodes, and the sources
    on the left and right. The third has the places of all nodes.
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
    """Draw each connected group of gaps together to a hub, a new node at its most central node.

    Ends of bisectors, the nodes below ``inner``, become the hub. Straight pieces join crossings to
    the hub; they are appended to the first ``count`` of ``straight``. Returns the places of all
    nodes, and the number of pieces. Modifies ``parent`` and ``straight``.
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
