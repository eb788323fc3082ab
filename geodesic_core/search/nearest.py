"""Nearest candidates: those with the shortest geodesic distance to a point."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.sources import as_points, ends_of
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.mesh.barriers import with_barriers
from geodesic_core.mesh.surface_point import Point, Points
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import TargetSweep
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


def nearest(
    mesh: MeshLike,
    source: Point,
    candidates: Points,
    k: int = 1,
    max_distance: float | None = None,
    *,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> Nearest:
    """Return the ``k`` candidates that are geodesically nearest to a point, exactly.

    For many calls on one mesh, a `Solver` is faster.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    source, candidates
        Vertex indices or `SurfacePoint`.
    k
        Number to find, from 1 to the number of candidates. Fewer are returned where fewer can be
        reached.
    max_distance
        Limit, mesh units; None for no limit. Candidates beyond it are left out.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    Nearest
        Indices into the candidates, (n,) int32, and distances, (n,) float64, nearest first.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    Distances that differ by rounding count as equal. The sweep goes no farther than the k-th
    nearest; allocating its state is O(V + F), which a `Solver` does once.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

    >>> gc.nearest(mesh, 0, [3, 2]).indices.tolist()
    [1]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, control = with_barriers(as_mesh(mesh), barriers, control)
    return find_nearest(
        surface, lambda: TargetSweep(surface), source, candidates, k, max_distance, control
    )


def find_nearest(
    mesh: TriangleMesh,
    target_sweep: Callable[[], TargetSweep],
    source: Point,
    candidates: Points,
    k: int,
    max_distance: float | None,
    control: Control,
) -> Nearest:
    """Do as `nearest` does, with a `TargetSweep` made once the arguments are in order."""
    limit = as_limit(max_distance)
    start = mesh.point(source, "source")
    points = as_points(mesh, candidates, "candidate", control)
    if not is_index(k) or not 1 <= k <= len(points):
        raise InvalidArgument(
            f"k is {k!r}; it must be an integer from 1 to the number of candidates, {len(points)}"
        )
    ends = ends_of(mesh, [start], points, control)
    connected = ends.targets_connected_to(0)
    indices, distances = connected[:0], np.empty(0)
    if len(connected) > 0:
        count = min(int(k), len(connected))
        reached = target_sweep().distances(ends, 0, connected, count, limit, control)
        order = _nearest_first(reached)[:count]
        order = order[np.isfinite(reached[order])]
        indices, distances = connected[order], reached[order]
    if control.progress is not None:
        control.progress(1.0)
    return Nearest(indices, distances)


def _nearest_first(distances: Floats) -> Longs:
    """Return the order of distances, where those that differ by rounding count as equal."""
    order = np.argsort(distances, kind="stable")
    ascending = distances[order]
    rank = np.zeros(len(order), np.int64)
    rank[1:] = np.cumsum(ascending[1:] > ascending[:-1] * (1.0 + TIE))
    return order[np.lexsort((order, rank))]
