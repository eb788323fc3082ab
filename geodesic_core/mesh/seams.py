"""Open seams: borders that nearly touch, though the surface is not joined there."""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.mesh.half_edges import (
    COS_RIGHT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OPPOSITE,
    SIN_RIGHT,
    TAIL,
    Topology,
)
from geodesic_core.kernels.mesh.point_tree import find_nearest, find_on_edges, tree_of
from geodesic_core.tolerances import NEARLY_JOINED


class Seams(NamedTuple):
    """Border vertices that are nearly joined to others, and those on a border edge."""

    near: Longs
    """(N, 2): pairs of vertices, the lower one first"""
    distances: Floats
    """(N,): how far apart they are, mesh units"""
    on_edge: Longs
    """(J,): vertices that lie on an edge"""
    edges: Longs
    """(J, 2): the edge of each"""


def seams_of(topology: Topology, used: Longs, first: Longs) -> Seams:
    """Return the open seams of a mesh; O(B log B) for B border vertices in practice.

    ``used`` are the vertices of the surface, ascending, and ``first`` the first one at the position
    of each. Vertices at one position count as one here: they are told as duplicates.
    """
    links = topology.links
    border = np.flatnonzero(links[:, OPPOSITE] == NO_FACE)
    ends = topology.outer_vertex[links[border][:, [TAIL, HEAD]]]
    if len(border) == 0:
        none = np.empty((0, 2), np.int64)
        return Seams(none, np.empty(0), none[:, 0], none)
    vertices = np.unique(ends)
    # Of the border vertices at one position, the lowest stands for all.
    _, lowest, place = np.unique(
        first[np.searchsorted(used, vertices)], return_index=True, return_inverse=True
    )
    names = vertices[lowest].astype(np.int64)
    tree = tree_of(topology.positions[topology.inner_vertex[names]])
    leaf = np.empty(len(names), np.int32)
    leaf[tree.order] = np.arange(len(names), dtype=np.int32)
    names = names[tree.order]

    at_vertex = np.full(len(topology.positions), -1, np.int32)
    at_vertex[topology.inner_vertex[vertices]] = leaf[place]
    corners = np.flatnonzero(at_vertex[links[:, TAIL]] >= 0)
    reach = np.full(len(names), np.inf)
    np.minimum.at(reach, at_vertex[links[corners, TAIL]], _heights(topology.geometry, corners))
    reach *= NEARLY_JOINED
    following = border - border % 3 + (border + 1) % 3
    heights = [_heights(topology.geometry, at) for at in (border, following)]
    widths = NEARLY_JOINED / 2.0 * np.minimum(*heights)
    edges = at_vertex[links[border][:, [TAIL, HEAD]]]

    nearest, distances = np.empty(len(names), np.int32), np.empty(len(names))
    find_nearest(tree, reach, nearest, distances)
    on = np.empty(len(names), np.int32)
    find_on_edges(tree, reach, edges, widths, on)
    has_near, on_edge = np.flatnonzero(nearest >= 0), np.flatnonzero(on >= 0)
    pairs = np.sort(np.stack([names[has_near], names[nearest[has_near]]], axis=1), axis=1)
    near, which = np.unique(pairs, axis=0, return_index=True)
    on_edge = on_edge[np.argsort(names[on_edge])]
    return Seams(
        near,
        distances[has_near][which],
        names[on_edge],
        np.sort(ends[on[on_edge]].astype(np.int64), axis=1),
    )


def _heights(geometry: Floats, corners: Longs) -> Floats:
    """Return the distance of each half-edge's tail from the opposite edge of its face."""
    rows = geometry[corners]
    foot = rows[:, LENGTH] * rows[:, COS_RIGHT]
    is_inside = (foot >= 0.0) & (foot <= rows[:, LENGTH_RIGHT])
    heights: Floats = np.where(
        is_inside,
        rows[:, LENGTH] * rows[:, SIN_RIGHT],
        np.minimum(rows[:, LENGTH], rows[:, LENGTH_LEFT]),
    )
    return heights
