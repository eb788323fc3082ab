"""Edges of no length: the vertices that they join are one place of the surface.

Inside, one vertex stands for all of them, the lowest. A face with such an edge has no extent left:
what remains of it is an edge of its neighbours, or a point.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geodesic_core.arrays import Floats, Longs


def of_three_vertices(faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Tell which faces have three different vertices."""
    a, b, c = faces.T
    different: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return different


def edges_of_no_length(vertices: Floats, faces: NDArray[np.integer]) -> Longs:
    """Return the (E, 2) edges, lower vertex first, whose ends are different but at one position.

    Of faces of three different vertices: others are no part of the surface. O(F).
    """
    faces = faces[of_three_vertices(faces)]
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    same = (vertices[ends[:, 0]] == vertices[ends[:, 1]]).all(axis=1)
    edges: Longs = np.unique(np.sort(ends[same].astype(np.int64), axis=1), axis=0)
    return edges


def lowest_joined(vertex_count: int, edges: Longs) -> Longs:
    """Return for each vertex the lowest that these edges join it to, or itself; O(V + E)."""
    graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(vertex_count, vertex_count))
    _, label = connected_components(graph, directed=False)
    _, lowest = np.unique(label, return_index=True)
    joined: Longs = lowest[label]
    return joined
