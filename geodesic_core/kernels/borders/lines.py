"""Borders as lines: the pieces in faces, joined from junction to junction."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.borders.outlines import root_of
from geodesic_core.kernels.isolines.lines import append_chain, faces_at, row_at
from geodesic_core.kernels.jit import kernel


@kernel
def link_pieces(
    links: Ints, labelled: Any, pieces: Any, nodes: int, shortest: float
) -> tuple[Floats, Ints, Longs, Flags, Ints]:
    """Join pieces to lines; return points, faces, first points, closed flags and sources.

    The faces are those that follow each point; the last point of an open line has none, -1. The
    first points, flags and sources have a row for each line. ``nodes`` is the number of nodes.
    Points nearer than ``shortest`` to the one before are left out, but for the ends of open lines.
    Modifies the ends of the pieces' points.
    """
    count = len(pieces.nodes)
    node_of, done = contract(pieces, nodes, shortest)
    partner = partners(links, labelled, pieces, node_of, done)
    lines, total = 0, 0
    room = len(pieces.points) + count
    points, faces = np.empty((room, 3)), np.empty(room, np.int32)
    first, closed = np.zeros(count + 1, np.int64), np.zeros(count, np.uint8)
    sources = np.empty((count, 2), np.int32)
    for turn in range(2):  # open lines; closed ones
        for start in range(2 * count):
            is_open = partner[start] < 0
            if done[start // 2] or (turn == 0) != is_open:
                continue
            begin, end, last = total, start, start
            while end >= 0 and not done[end // 2]:
                done[end // 2] = 1
                total = append_chain(pieces, end, shortest, points, faces, begin, total)
                last = end ^ 1
                end = partner[last]
            if is_open:
                total = with_both_ends(pieces, start, last, points, faces, begin, total)
            elif total > begin + 1:
                total -= 1  # the first point again
            if is_open:
                faces[total - 1] = -1
            if total - begin < (2 if is_open else 3):
                total = begin
                continue
            closed[lines] = not is_open
            sources[lines, 0] = pieces.sources[start // 2, 0]
            sources[lines, 1] = pieces.sources[start // 2, 1]
            lines += 1
            first[lines] = total
    return points[:total], faces[:total], first[: lines + 1], closed[:lines], sources[:lines]


@kernel
def with_both_ends(
    pieces: Any, start: int, last: int, points: Floats, faces: Ints, begin: int, total: int
) -> int:
    """Make an open line begin and end exactly at its nodes, if they are apart; return the total."""
    a, b = row_at(pieces, start), row_at(pieces, last)
    apart = 0.0
    for axis in range(3):
        apart = max(apart, abs(pieces.points[a, axis] - pieces.points[b, axis]))
    if total == begin + 1:
        if apart == 0.0:
            return total
        faces[begin] = pieces.faces[start // 2, 0]
        total += 1
    for axis in range(3):
        points[begin, axis] = pieces.points[a, axis]
        points[total - 1, axis] = pieces.points[b, axis]
    return total


@kernel
def contract(pieces: Any, nodes: int, shortest: float) -> tuple[Ints, Flags]:
    """Contract the pieces no longer than ``shortest``, which join points that differ by rounding.

    Returns the node that stands for each, and which pieces are contracted. All pieces at a node get
    the same point as their end, to the bit.
    """
    count = len(pieces.nodes)
    node_of, contracted = np.arange(nodes).astype(np.int32), np.zeros(count, np.uint8)
    for p in range(count):
        extent, first = 0.0, pieces.first[p, 0]
        for i in range(first, pieces.first[p + 1, 0]):
            for axis in range(3):
                away = abs(pieces.points[i, axis] - pieces.points[first, axis])
                extent = max(extent, away)
        if extent <= shortest:
            contracted[p] = 1
            node_of[root_of(node_of, pieces.nodes[p, 0])] = root_of(node_of, pieces.nodes[p, 1])
    row = np.full(nodes, -1, np.int64)
    for end in range(2 * count):
        node = root_of(node_of, pieces.nodes[end // 2, end % 2])
        here = row_at(pieces, end)
        if row[node] < 0:
            row[node] = here
        for axis in range(3):
            pieces.points[here, axis] = pieces.points[row[node], axis]
    for node in range(nodes):
        node_of[node] = root_of(node_of, node)
    return node_of, contracted


@kernel
def partners(links: Ints, labelled: Any, pieces: Any, node_of: Ints, contracted: Flags) -> Ints:
    """Return the end of a piece that each end goes on with, -1 for none.

    The ends of piece p are 2 p and 2 p + 1. Lines go on where two pieces between the same sources
    meet, and no more; not at an edge of more than two faces.
    """
    count, nodes = 2 * len(pieces.nodes), len(node_of)
    partner = np.full(count, -1, np.int32)
    meeting, first = np.zeros(nodes, np.int32), np.full(nodes, -1, np.int32)
    for c in range(len(labelled.sources)):
        if faces_at(links, labelled.crossings.half_edges[c, 0]) > 2:
            meeting[node_of[c]] = count  # lines end here
    for end in range(count):
        meeting[node_of[pieces.nodes[end // 2, end % 2]]] += 1 - contracted[end // 2]
    for end in range(count):
        node = node_of[pieces.nodes[end // 2, end % 2]]
        if meeting[node] != 2 or contracted[end // 2]:
            continue
        if first[node] < 0:
            first[node] = end
            continue
        p, q = end // 2, first[node] // 2
        if pieces.sources[p, 0] == pieces.sources[q, 0] and (
            pieces.sources[p, 1] == pieces.sources[q, 1]
        ):
            partner[end], partner[first[node]] = first[node], end
    return partner
