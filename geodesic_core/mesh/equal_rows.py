"""Rows that repeat an earlier one: vertices at one position, faces of the same vertices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs


def first_equal(rows: NDArray[Any]) -> Longs:
    """Return for each of (N, K) numbers the lowest row that equals it; O(N log N)."""
    order = np.lexsort(rows.T)
    new = np.ones(len(rows), bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = np.empty(len(rows), np.int64)
    # lexsort is stable: the first of equal rows is the lowest.
    first[order] = order[new][np.cumsum(new) - 1]
    return first


def repeated(rows: NDArray[Any]) -> Longs:
    """Return the numbers of the rows that equal an earlier one."""
    return np.flatnonzero(first_equal(rows) != np.arange(len(rows)))


def merged(vertices: Floats) -> tuple[Floats, Longs]:
    """Return the distinct positions in order of first appearance, and where each vertex went."""
    first = first_equal(vertices)
    is_first = first == np.arange(len(vertices))
    return vertices[is_first], (np.cumsum(is_first) - 1)[first]
