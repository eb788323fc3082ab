"""Borders across faces: chains between the same two sources, joined from junction to junction."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.kernels.borders.gaps import root_of
from geodesic_core.kernels.curves.chains import (
    Lines,
    link_chains,
    nodes_at_seams,
    partners,
    row_at,
)
from geodesic_core.kernels.curves.crossings import put_crossing
from geodesic_core.kernels.curves.face_points import copy_weights, put_corner, way_between
from geodesic_core.kernels.jit import inlined, kernel

_SEVERAL = -2
"""What a node is at where crossings of several edges are one with it"""


@kernel
def link_borders(
    topology: Any, row_of: Ints, labelled: Any, chains: Any, sources: Ints, nodes: int,
    shortest: float,
) -> tuple[Lines, Ints]:  # fmt: skip
    """Join the chains of borders to lines, as `link_chains` does; also return their sources.

    ``sources`` (c, 2) are those of the chains, ``row_of`` has the rows of faces, and ``nodes`` is
    the number of nodes. Open lines begin and end exactly at their nodes. Modifies the ends of the
    chains.
    """
    geometry, crossings = topology.geometry, labelled.crossings
    node_of, contracted = contract(geometry, crossings.half_edges, chains, nodes, shortest)
    unite_ends(geometry, row_of, crossings, chains, node_of)
    partner = border_partners(topology.links, labelled, chains, sources, node_of, contracted)
    order, places = np.arange(len(partner)).astype(np.int32), np.arange(nodes).astype(np.int32)
    lines = link_chains(geometry, chains, partner, order, contracted, places, shortest)
    line_sources = np.empty((len(lines.closed), 2), np.int32)
    for line in range(len(lines.closed)):
        for side in range(2):
            line_sources[line, side] = sources[lines.ends[line, 0] // 2, side]
    return lines, line_sources


@kernel
def is_short(geometry: Floats, chains: Any, chain: int, shortest: float) -> bool:
    """Tell whether no point of a chain is farther from its first one than ``shortest``."""
    first = chains.first[chain]
    for i in range(first + 1, chains.first[chain + 1]):
        if way_between(geometry, chains.faces[chain], chains.weights, first, i) > shortest:
            return False
    return True


@inlined
def leads_across(half_edges: Ints, u: int, v: int) -> bool:
    """Tell whether two nodes are crossings of two edges, given by their first ``half_edges``."""
    count = len(half_edges)
    return u < count and v < count and half_edges[u] != half_edges[v]


@kernel
def is_at_corner(geometry: Floats, chains: Any, chain: int, shortest: float) -> bool:
    """Tell whether the first point of a chain is no farther from a corner than ``shortest``."""
    corner, row = np.zeros((2, 3)), chains.first[chain]
    copy_weights(chains.weights, row, corner, 0)
    copy_weights(chains.weights, row, corner, 1)
    put_nearest_corner(corner, 1)
    return way_between(geometry, chains.faces[chain], corner, 0, 1) <= shortest


@kernel
def contract(
    geometry: Floats, half_edges: Ints, chains: Any, nodes: int, shortest: float
) -> tuple[Ints, Flags]:
    """Contract the chains no longer than ``shortest``, which join points that differ by rounding.

    From edge to edge they do so beside a vertex only: a face may be as thin. Returns the node that
    stands for each, and which chains are contracted.
    """
    count = len(chains.nodes)
    node_of, contracted = np.arange(nodes).astype(np.int32), np.zeros(count, np.uint8)
    for c in range(count):
        is_contracted = is_short(geometry, chains, c, shortest)
        if is_contracted and leads_across(half_edges, chains.nodes[c, 0], chains.nodes[c, 1]):
            is_contracted = is_at_corner(geometry, chains, c, shortest)
        if is_contracted:
            contracted[c] = 1
            node_of[root_of(node_of, chains.nodes[c, 0])] = root_of(node_of, chains.nodes[c, 1])
    for node in range(nodes):
        node_of[node] = root_of(node_of, node)
    return node_of, contracted


@kernel
def unite_ends(geometry: Floats, row_of: Ints, crossings: Any, chains: Any, node_of: Ints) -> None:
    """Give all chains at a node the same point as their end, in whatever face they are.

    It is a crossing where one is among the nodes that are one; where crossings of several edges
    are, the vertex of these edges. Modifies the ends of the chains.
    """
    crossing_at = np.full(len(node_of), -1, np.int64)
    for c in range(len(crossings.half_edges)):
        node, other = node_of[c], crossing_at[node_of[c]]
        if other == -1:
            crossing_at[node] = c
        elif other != _SEVERAL and crossings.half_edges[c] != crossings.half_edges[other]:
            crossing_at[node] = _SEVERAL
    row_in_face = np.full(len(node_of), -1, np.int64)
    for end in range(2 * len(chains.nodes)):
        node, row = node_of[chains.nodes[end // 2, end % 2]], row_at(chains, end)
        face, c = chains.faces[end // 2], crossing_at[node]
        if c >= 0:
            put_crossing(geometry, crossings, c, row_of[face], chains.weights, row)
        elif c == _SEVERAL:
            put_nearest_corner(chains.weights, row)
        else:  # all of its chains are in one face
            if row_in_face[node] < 0:
                row_in_face[node] = row
            copy_weights(chains.weights, row_in_face[node], chains.weights, row)


@kernel
def put_nearest_corner(weights: Floats, row: int) -> None:
    """Move a point to the corner of its face of which it has most. Modifies its row."""
    nearest = 0
    for k in range(1, 3):
        if weights[row, k] > weights[row, nearest]:
            nearest = k
    put_corner(weights, row, nearest)


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
