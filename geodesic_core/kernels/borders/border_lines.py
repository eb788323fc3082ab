"""Borders across faces: chains between the same two sources, joined from junction to junction."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Flags, Ints
from geodesic_core.kernels.borders.gaps import root_of
from geodesic_core.kernels.curves.chains import (
    Lines,
    copy_point,
    link_chains,
    nodes_at_seams,
    partners,
    row_at,
)
from geodesic_core.kernels.jit import kernel


@kernel
def link_borders(
    links: Ints, labelled: Any, chains: Any, sources: Ints, nodes: int, shortest: float
) -> tuple[Lines, Ints]:
    """Join the chains of borders to lines, as `link_chains` does; also return their sources.

    ``sources`` (c, 2) are those of the chains, and ``nodes`` is the number of nodes. Open lines
    begin and end exactly at their nodes. Modifies the ends of the chains' points.
    """
    node_of, contracted = contract(chains, nodes, shortest)
    partner = border_partners(links, labelled, chains, sources, node_of, contracted)
    order, places = np.arange(len(partner)).astype(np.int32), np.arange(nodes).astype(np.int32)
    lines = link_chains(chains, partner, order, contracted, places, shortest)
    line_sources = np.empty((len(lines.closed), 2), np.int32)
    for line in range(len(lines.closed)):
        start, last = lines.ends[line, 0], lines.ends[line, 1]
        line_sources[line, 0] = sources[start // 2, 0]
        line_sources[line, 1] = sources[start // 2, 1]
        if not lines.closed[line]:
            begin, end = lines.first[line], lines.first[line + 1]
            copy_point(chains.points, row_at(chains, start), lines.points, begin)
            copy_point(chains.points, row_at(chains, last), lines.points, end - 1)
    return lines, line_sources


@kernel
def extent_of(chains: Any, chain: int) -> float:
    """Return how far the points of a chain are from its first one, along an axis, at most."""
    extent, first = 0.0, chains.first[chain]
    for i in range(first, chains.first[chain + 1]):
        for axis in range(3):
            extent = max(extent, abs(chains.points[i, axis] - chains.points[first, axis]))
    return extent


@kernel
def contract(chains: Any, nodes: int, shortest: float) -> tuple[Ints, Flags]:
    """Contract the chains no longer than ``shortest``, which join points that differ by rounding.

    Returns the node that stands for each, and which chains are contracted. All chains at a node get
    the same point as their end, to the bit.
    """
    count = len(chains.nodes)
    node_of, contracted = np.arange(nodes).astype(np.int32), np.zeros(count, np.uint8)
    for c in range(count):
        if extent_of(chains, c) <= shortest:
            contracted[c] = 1
            node_of[root_of(node_of, chains.nodes[c, 0])] = root_of(node_of, chains.nodes[c, 1])
    for node in range(nodes):
        node_of[node] = root_of(node_of, node)
    row = np.full(nodes, -1, np.int64)
    for end in range(2 * count):
        node, here = node_of[chains.nodes[end // 2, end % 2]], row_at(chains, end)
        if row[node] < 0:
            row[node] = here
        copy_point(chains.points, row[node], chains.points, here)
    return node_of, contracted


@kernel
def border_partners(
    links: Ints, labelled: Any, chains: Any, sources: Ints, node_of: Ints, contracted: Flags
) -> Ints:
    """Return the end of a chain that each end goes on with, as `partners` does.

    Lines go on only between the same sources. Contracted chains do not count.
    """
    nodes, stops = np.full(chains.nodes.shape, -1, np.int32), np.zeros(len(node_of), np.uint8)
    at_seam = nodes_at_seams(links, labelled.crossings.half_edges, len(node_of))
    for node in range(len(node_of)):
        stops[node_of[node]] |= at_seam[node]
    for end in range(2 * len(nodes)):
        if not contracted[end // 2]:
            nodes[end // 2, end % 2] = node_of[chains.nodes[end // 2, end % 2]]
    partner = partners(nodes, stops)
    for end in range(len(partner)):
        if partner[end] < 0:
            continue
        c, d = end // 2, partner[end] // 2
        if sources[c, 0] != sources[d, 0] or sources[c, 1] != sources[d, 1]:
            partner[end] = -1
    return partner
