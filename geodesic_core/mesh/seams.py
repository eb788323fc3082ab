"""Open seams: borders that nearly touch, though the surface is not joined there."""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
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
    Embedding,
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
    """(J, 2): the edge of each, the lower vertex first"""


_NONE = np.empty((0, 2), np.int64)
NO_SEAMS = Seams(_NONE, np.empty(0), _NONE[:, 0], _NONE)


def seams_of(embedding: Embedding, used: Longs, first: Longs) -> Seams:
    """Return the open seams of a mesh; O(B log B) for B border vertices in practice.

    ``used`` are the vertices of the surface, ascending, and ``first`` the first one at the position
    of each. Those at one position count as one here: they are told as duplicates.
    """
    topology, positions = embedding
    links = topology.links
    border = np.flatnonzero(links[:, OPPOSITE] == NO_FACE)
    if len(border) == 0:
        return NO_SEAMS
    ends = np.stack([links[border, TAIL], links[border, HEAD]], axis=1)
    outer_ends: Longs = topology.outer_vertex[ends].astype(np.int64)

    # Of the border vertices at one position, the lowest stands for all: a place of the tree.
    is_border = np.zeros(len(positions), bool)
    is_border[outer_ends] = True
    vertices, at = used[is_border[used]], first[is_border[used]]
    lowest = np.empty_like(is_border, np.int64)
    lowest[at[::-1]] = vertices[::-1]
    places = vertices[lowest[at] == vertices]
    tree = tree_of(positions[topology.inner_vertex[places]])
    places = places[tree.order]
    place_of = np.full_like(lowest, -1)
    place_of[places] = np.arange(len(places))
    place_at = np.full_like(lowest, -1)  # by inner vertex
    place_at[topology.inner_vertex[vertices]] = place_of[lowest[at]]

    corners = np.flatnonzero(place_at[links[:, TAIL]] >= 0)
    reach = np.full(len(places), np.inf)
    np.minimum.at(reach, place_at[links[corners, TAIL]], _heights(topology, corners))
    following = border - border % 3 + (border + 1) % 3
    widths = np.minimum(_heights(topology, border), _heights(topology, following)) / 2.0
    reach, widths = NEARLY_JOINED * reach, NEARLY_JOINED * widths

    nearest, distances = np.empty(len(places), np.int64), np.empty(len(places))
    find_nearest(tree, reach, nearest, distances)
    edge = np.empty(len(places), np.int64)
    find_on_edges(tree, reach, place_at[ends], widths, edge)

    is_told_by_other = (nearest[nearest] == np.arange(len(places))) & (places[nearest] < places)
    told = np.flatnonzero((nearest >= 0) & ~is_told_by_other)
    pairs = np.sort(np.stack([places[told], places[nearest[told]]], axis=1), axis=1)
    by_vertex = np.lexsort(pairs.T[::-1])
    on_edge = np.flatnonzero(edge >= 0)
    on_edge = on_edge[np.argsort(places[on_edge])]
    return Seams(
        pairs[by_vertex],
        distances[told][by_vertex],
        places[on_edge],
        np.sort(outer_ends[edge[on_edge]], axis=1),
    )


def _heights(topology: Topology, corners: Longs) -> Floats:
    """Return the distance of each half-edge's tail from the opposite edge of its face."""
    geometry = topology.geometry
    length = geometry[corners, LENGTH]
    foot = length * geometry[corners, COS_RIGHT]
    is_inside = (foot >= 0.0) & (foot <= geometry[corners, LENGTH_RIGHT])
    to_ends = np.minimum(length, geometry[corners, LENGTH_LEFT])
    heights: Floats = np.where(is_inside, length * geometry[corners, SIN_RIGHT], to_ends)
    return heights
