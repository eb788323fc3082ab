"""Degeneracies: equal rows, faces that repeat a vertex, and edges of no length.

The vertices that an edge of no length joins are one point of the surface. Inside, the lowest stands
for all of them. A face with such an edge has no extent: an edge of its neighbours, or a point, is
left of it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.kernels.mesh.point_tree import join_within, tree_of


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
    """Return for each vertex the lowest that these edges join it to, or itself.

    O((V + E) log V): of the parts that an edge leads out of, half or more end in two rounds.
    """
    joined: Longs = np.arange(vertex_count)
    while True:
        parts = joined[edges]
        apart = parts[parts[:, 0] != parts[:, 1]]
        if len(apart) == 0:
            return joined
        np.minimum.at(joined, apart.max(axis=1), apart.min(axis=1))
        while (joined != joined[joined]).any():
            joined = joined[joined]


def first_equal(rows: NDArray[Any]) -> Longs:
    """Return for each of (N, K) rows the index of the first row that equals it; O(N log N)."""
    order = np.lexsort(rows.T)
    new = np.ones(len(rows), bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = np.empty(len(rows), np.int64)
    # lexsort is stable: the first of equal rows has the lowest index.
    first[order] = order[new][np.cumsum(new) - 1]
    return first


def repeated_rows(rows: NDArray[Any]) -> Longs:
    """Return the indices of the rows that equal an earlier one."""
    return np.flatnonzero(first_equal(rows) != np.arange(len(rows)))


def first_within(vertices: Floats, distance: float) -> Longs:
    """Return for each vertex the first of those that steps of at most a distance lead it to.

    Each step leads from a vertex to another one. O(V log V) in practice, however many are near.
    """
    if distance == 0.0:
        return first_equal(vertices)
    joined: Longs = np.arange(len(vertices))
    join_within(tree_of(vertices), distance, joined)
    return joined


def merged(vertices: Floats, distance: float) -> tuple[Floats, Longs]:
    """Return the positions that merging leaves, and the new index of each vertex.

    Of vertices that become one, the first keeps its position; those left are in its order.
    """
    first = first_within(vertices, distance)
    is_first = first == np.arange(len(vertices))
    return vertices[is_first], (np.cumsum(is_first) - 1)[first]
