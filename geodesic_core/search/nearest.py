"""Nearest candidates: those with the shortest geodesic distance to a point."""

from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.sources import as_points, ends_of
from geodesic_core.mesh.surface_point import Point, Points
from geodesic_core.search.workspace import Workspace
from geodesic_core.tolerances import TIE
from geodesic_core.validation import as_limit, is_index


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The nearest of some candidates, nearest first.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> near = gc.nearest(mesh, 0, [3, 2], k=2)
    >>> near.indices.tolist(), near.distances.round(3).tolist()
    ([1, 0], [1.0, 1.414])
    """

    indices: Ints
    """(n,) int32, into the candidates; of equal distances the lower index goes first"""
    distances: Floats
    """(n,) float64, mesh units"""


def find_nearest(
    workspace: Workspace,
    source: Point,
    candidates: Points,
    k: int,
    max_distance: float | None,
    control: Control,
) -> Nearest:
    """Return the nearest candidates, see `geodesic_core.nearest`."""
    mesh, limit = workspace.mesh, as_limit(max_distance)
    start = mesh.point(source, "source")
    points = as_points(mesh, candidates, "candidate", control)
    if not is_index(k) or not 1 <= k <= len(points):
        raise InvalidArgument(
            f"k is {k!r}; it must be an integer from 1 to the number of candidates, {len(points)}"
        )
    ends = ends_of(mesh, [start], points, control)
    row, columns = np.zeros(1, np.int64), (np.zeros(1, np.int32), np.full(1, len(points), np.int32))
    (found,) = workspace.target_sweep().rows(ends, limit, row, columns, control, int(k))
    by_index = np.argsort(found.columns)
    indices, distances = found.columns[by_index], found.distances[by_index]
    order = _nearest_first(distances)[: int(k)]
    control.finish()
    return Nearest(indices[order], distances[order])


def _nearest_first(distances: Floats) -> Longs:
    """Return the order of distances, where those that differ by rounding count as equal."""
    order = np.argsort(distances, kind="stable")
    ascending = distances[order]
    rank = np.zeros(len(order), np.int64)
    rank[1:] = np.cumsum(ascending[1:] > ascending[:-1] * (1.0 + TIE))
    return order[np.lexsort((order, rank))]
