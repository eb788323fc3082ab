"""Matrices of distances: sweeps from one side, in threads; searches where pairs are few."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.extras import extra
from geodesic_core.fields.sources import as_points, component_of, ends_of
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.mesh.surface_point import Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.path_search import PathSearch
from geodesic_core.search.target_sweep import TargetSweep
from geodesic_core.search.threads import available_cores, share_out
from geodesic_core.validation import as_limit, check_choice, is_index

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Layout = Literal["dense", "sparse", "pairs"]

SWEEP_FROM = 6
"""Targets of one source from which on a sweep costs less than searches for them, one by one.

Measured: a sweep costs as much as 7 searches on a scan of 10⁵ faces, as 20 where it is smooth.
"""

_GROWTH = 2
"""Growth of the state of a sweep that is allowed for where memory is scarce."""


def distance_matrix(
    mesh: MeshLike,
    sources: Points,
    targets: Points,
    max_distance: float | None = None,
    layout: Layout = "dense",
    *,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> "Floats | csr_array":
    """Return the exact geodesic distances from each source to each target.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    sources, targets
        N and M vertex indices or `SurfacePoint`; a single one needs no list.
    max_distance
        Limit of the sweeps, mesh units; None for no limit. Points beyond it count as unreachable.
    layout
        ``"dense"`` for an (N, M) array, infinite where unreachable; ``"sparse"`` for a
        `scipy.sparse.csr_array` of the same shape that holds the finite distances, zeros too;
        ``"pairs"`` for an (N,) array of the distances from each source to the target of the same
        index, with as many targets as sources.
    threads
        Largest number of threads; None for one per core that the process may use.
    progress, cancel, deadline_s, memory_limit
        See `Control`; the result counts as memory. Callbacks are called in the caller's thread.

    Returns
    -------
    numpy.ndarray or scipy.sparse.csr_array
        Distances, float64, mesh units, in the shape of the layout.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.
    MissingExtra
        The layout is sparse, and SciPy is not installed; the extra ``sparse`` brings it.

    Notes
    -----
    One sweep starts from each point of the smaller side and ends at its farthest target. If both
    sides are the same points, half of the work suffices, and the matrix is symmetric to the bit.
    For pairs, a sweep starts from each point that is in many pairs; the other pairs are searched
    for as in `shortest_path`, in one thread. The memory of each thread is a third of the mesh's own
    arrays; that of the searches is two thirds. Results do not depend on the number of threads.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

    >>> gc.distance_matrix(mesh, [0, 1], [2, 3]).round(3).tolist()
    [[1.0, 1.414], [1.414, 1.0]]
    >>> gc.distance_matrix(mesh, [0, 1], [2, 3], layout="pairs").round(3).tolist()
    [1.0, 1.0]
    >>> gc.distance_matrix(mesh, [0, 1], [1, 2, 3], max_distance=1.0, layout="sparse").nnz
    4
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface = as_mesh(mesh)
    make = partial(TargetSweep, surface), partial(PathSearch, surface)
    return find_matrix(surface, *make, sources, targets, max_distance, layout, threads, control)


def find_matrix(
    mesh: TriangleMesh,
    target_sweep: Callable[[], TargetSweep],
    search: Callable[[], PathSearch],
    sources: Points,
    targets: Points,
    max_distance: float | None,
    layout: Layout,
    threads: int | None,
    control: Control,
) -> "Floats | csr_array":
    """Do as `distance_matrix` does; the first `TargetSweep` and a `PathSearch` come from makers."""
    limit = as_limit(max_distance)
    check_choice("layout", layout, get_args(Layout))
    if threads is not None and not (is_index(threads) and threads >= 1):
        raise InvalidArgument(f"threads is {threads!r}; it must be an integer, 1 or more, or None")
    starts = as_points(mesh, sources, "source", control)
    stops = as_points(mesh, targets, "target", control)
    cores = threads or available_cores()
    if layout == "pairs":
        return _find_pairs(mesh, target_sweep, search, starts, stops, limit, cores, control)
    table: _Dense | _Sparse
    if layout == "dense":
        control.check_memory(8 * len(starts) * len(stops))
        table = _Dense(mesh, starts, stops, control)
    else:
        table = _Sparse(mesh, starts, stops, control)
    _sweep_all(mesh, target_sweep(), table, limit, cores, control)
    if control.progress is not None:
        control.progress(1.0)
    return table.result()


def _find_pairs(
    mesh: TriangleMesh,
    target_sweep: Callable[[], TargetSweep],
    search: Callable[[], PathSearch],
    sources: Sequence[SurfacePoint],
    targets: Sequence[SurfacePoint],
    limit: float,
    cores: int,
    control: Control,
) -> Floats:
    """Return the distances of pairs: from points that are in many by sweeps, else by searches."""
    if len(sources) != len(targets):
        raise InvalidArgument(
            f"there are {len(sources)} sources and {len(targets)} targets; pairs need the same "
            "number of both"
        )
    table = _Pairs(mesh, sources, targets, control)
    few, parts = len(table.searched), len(table.searched) + len(table.groups)
    if few > 0:
        finder = search()
        for done, i in enumerate(table.searched.tolist()):
            part = control.for_part(done, parts)
            table.values[i] = _searched(finder, sources[i], targets[i], limit, part)
        control = control.holding(finder.nbytes)
    if table.groups:
        rest = control.for_part(few, parts, len(table.groups))
        _sweep_all(mesh, target_sweep(), table, limit, cores, rest)
    if control.progress is not None:
        control.progress(1.0)
    return table.values


def _searched(
    search: PathSearch, source: SurfacePoint, target: SurfacePoint, limit: float, control: Control
) -> float:
    """Return the distance of two points, infinite beyond the limit, by a search."""
    mesh = search.mesh
    if component_of(mesh, source) != component_of(mesh, target):
        control.checkpoint(0.0)
        return math.inf
    try:
        return search.find(source, target, control, explain=False, limit=limit).length
    except NoPath:
        return math.inf
    finally:
        search.add_landmark_if_due(source, replace(control, progress=None))


def _sweep_all(
    mesh: TriangleMesh,
    target_sweep: TargetSweep,
    table: "_Dense | _Sparse | _Pairs",
    limit: float,
    cores: int,
    control: Control,
) -> None:
    """Do all sweeps of a table, in as many threads as cores, sweeps and memory allow."""
    ends = table.ends
    count = min(cores, table.sweeps)
    if control.memory_limit is not None:
        room = control.memory_limit - control.bytes_beside - table.nbytes
        count = max(1, min(count, room // (_GROWTH * target_sweep.nbytes)))
    target_sweeps = [target_sweep, *(TargetSweep(mesh) for _ in range(count - 1))]

    def sweep(target_sweep: TargetSweep, source: int, control: Control) -> None:
        targets = np.intersect1d(table.wanted(source), ends.targets_connected_to(source))
        if len(targets) == 0:
            return
        # The states of other threads are about as large as this one.
        control = control.holding(table.nbytes + (count - 1) * target_sweep.nbytes)
        distances = target_sweep.distances(ends, source, targets, len(targets), limit, control)
        table.put(source, targets, distances)

    share_out(table.sweeps, [partial(sweep, each) for each in target_sweeps], control)


class _Grid:
    """A matrix in the making, swept from the smaller side; half of it where both sides are one."""

    def __init__(
        self,
        mesh: TriangleMesh,
        sources: Sequence[SurfacePoint],
        targets: Sequence[SurfacePoint],
        control: Control,
    ) -> None:
        self.shape = len(sources), len(targets)
        self.flipped = len(targets) < len(sources)
        self.symmetric = sources == targets
        sides = (targets, sources) if self.flipped else (sources, targets)
        self.ends = ends_of(mesh, *sides, control)
        self.sweeps = min(self.shape)

    def wanted(self, source: int) -> Ints:
        """Return the targets of a sweep."""
        return np.arange(source if self.symmetric else 0, max(self.shape), dtype=np.int32)


class _Dense(_Grid):
    """All distances, infinite until they are found."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._values = np.full(self.shape, math.inf)
        self.nbytes = self._values.nbytes

    def put(self, source: int, targets: Ints, distances: Floats) -> None:
        """Store the distances of a sweep."""
        rows = self._values.T if self.flipped else self._values
        rows[source, targets] = distances
        if self.symmetric:
            rows[targets, source] = distances

    def result(self) -> Floats:
        """Return the matrix."""
        return self._values


class _Sparse(_Grid):
    """The finite distances."""

    def __init__(self, *arguments: Any) -> None:
        with extra("sparse", "SciPy", 'distance_matrix(layout="sparse")'):
            from scipy.sparse import coo_array

        super().__init__(*arguments)
        self._from_triples = coo_array
        self._found = [(np.empty(0, np.int32), np.empty(0))] * self.sweeps
        self.nbytes = 0

    def put(self, source: int, targets: Ints, distances: Floats) -> None:
        """Store the distances of a sweep."""
        near = np.isfinite(distances)
        self._found[source] = targets[near], distances[near]
        self.nbytes += 12 * int(np.count_nonzero(near))

    def result(self) -> "csr_array":
        """Return the matrix."""
        rows = np.repeat(np.arange(self.sweeps), [len(targets) for targets, _ in self._found])
        columns, values = (np.concatenate(parts) for parts in zip(*self._found, strict=True))
        if self.symmetric:
            off = rows != columns
            rows, columns = (
                np.concatenate([rows, columns[off]]),
                np.concatenate([columns, rows[off]]),
            )
            values = np.concatenate([values, values[off]])
        if self.flipped:
            rows, columns = columns, rows
        return self._from_triples((values, (rows, columns)), shape=self.shape).tocsr()


class _Pairs:
    """Distances of pairs in the making; points that are in many of them are swept from."""

    def __init__(
        self,
        mesh: TriangleMesh,
        sources: Sequence[SurfacePoint],
        targets: Sequence[SurfacePoint],
        control: Control,
    ) -> None:
        by_source, by_target = (_grouped(control.watched(side)) for side in (sources, targets))
        if _cost(by_target) < _cost(by_source):
            groups, others = by_target, sources
        else:
            groups, others = by_source, targets
        many = {hub: pairs for hub, pairs in groups.items() if len(pairs) >= SWEEP_FROM}
        self.groups = [np.array(pairs, np.int32) for pairs in many.values()]
        self.searched = np.setdiff1d(np.arange(len(sources)), np.concatenate([[], *self.groups]))
        self.ends = ends_of(mesh, list(many), others, control)
        self.sweeps = len(many)
        self.values = np.full(len(sources), math.inf)
        self.nbytes = self.values.nbytes

    def wanted(self, source: int) -> Ints:
        """Return the targets of a sweep: one for each pair."""
        return self.groups[source]

    def put(self, _: int, targets: Ints, distances: Floats) -> None:
        """Store the distances of a sweep."""
        self.values[targets] = distances


def _grouped(points: Iterable[SurfacePoint]) -> dict[SurfacePoint, list[int]]:
    """Return the indices of each point."""
    groups: dict[SurfacePoint, list[int]] = {}
    for i, point in enumerate(points):
        groups.setdefault(point, []).append(i)
    return groups


def _cost(groups: Mapping[SurfacePoint, Sequence[int]]) -> int:
    """Return the cost of pairs that are grouped by a point, in searches."""
    return sum(min(len(pairs), SWEEP_FROM) for pairs in groups.values())
