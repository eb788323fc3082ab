"""Matrices of distances: sweeps from one side, in threads; searches where pairs are few."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.methods import SweepOf
from geodesic_core.fields.sources import as_points, component_of, ends_of
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.matrices.driver import fill
from geodesic_core.matrices.plan import Plan, taken
from geodesic_core.matrices.threads import as_threads
from geodesic_core.mesh.surface_point import Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.path_search import PathSearch
from geodesic_core.search.target_sweep import Entries
from geodesic_core.search.workspace import Workspace
from geodesic_core.validation import as_limit, check_choice

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Layout = Literal["dense", "sparse", "pairs"]

SWEEP_FROM = 6
"""Targets of one source from which on a sweep costs less than searches for them, one by one.

Measured: a sweep costs as much as 7 searches on a scan of 10⁵ faces, as 20 where it is smooth.
"""


def find_matrix(
    workspace: Workspace,
    sweep_of: SweepOf,
    sources: Points,
    targets: Points | None,
    max_distance: float | None,
    layout: Layout,
    threads: int | None,
    control: Control,
) -> "Floats | csr_array":
    """Return a matrix, see `geodesic_core.distance_matrix`.

    Its distances are those of the sweep of a method.
    """
    mesh, limit = workspace.mesh, as_limit(max_distance)
    check_choice("layout", layout, get_args(Layout))
    most = as_threads(threads)
    source_points = as_points(mesh, sources, "source", control)
    target_points = (
        source_points if targets is None else as_points(mesh, targets, "target", control)
    )
    table: _Dense | _Sparse | _Pairs
    if layout == "pairs":
        if targets is None:
            raise InvalidArgument("pairs need targets, one for each source")
        table = _Pairs(
            mesh, source_points, target_points, SWEEP_FROM if sweep_of is ExactSweep else 1, control
        )
    elif layout == "dense":
        control.check_memory(8 * len(source_points) * len(target_points))
        table = _Dense(Plan.of(mesh, source_points, target_points, control, in_order=False))
    else:
        table = _Sparse(Plan.of(mesh, source_points, target_points, control, in_order=True))
    rest = control
    if isinstance(table, _Pairs) and len(table.searched):
        few, parts = len(table.searched), len(table.searched) + len(table.sweeps)
        finder = workspace.path_search()
        for done, i in enumerate(table.searched.tolist()):
            part = control.for_part(done, parts)
            table.values[i] = _searched(finder, source_points[i], target_points[i], limit, part)
        rest = control.for_part(few, parts, len(table.sweeps)).holding(finder.nbytes)
    fill(table, mesh, table.ends, limit, sweep_of, most, rest, workspace.target_sweep)
    control.finish()
    return table.result()


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


class _Dense:
    """A matrix of all distances in the making."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._values = np.full(plan.shape, math.inf)
        self.ends, self.sweeps, self.columns_of = plan.ends, range(plan.sweeps), plan.columns_of
        self.nbytes = self._values.nbytes

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps."""
        order = self._plan.order
        rows, columns = entries.row_of_each, entries.columns.astype(np.int64)
        table = self._values.T if self._plan.is_flipped else self._values
        if self._plan.is_symmetric:
            rows, columns = order[rows], order[columns]
            table[columns, rows] = entries.distances
        table[rows, columns] = entries.distances

    def result(self) -> Floats:
        """Return the matrix."""
        return self._values


class _Sparse:
    """A matrix of the finite distances in the making."""

    def __init__(self, plan: Plan) -> None:
        from scipy.sparse import coo_array

        self._from_triples = coo_array
        self._plan = plan
        self._found: list[Entries] = []
        self.ends, self.sweeps, self.columns_of = plan.ends, range(plan.sweeps), plan.columns_of
        self.nbytes = 0

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps."""
        self._found.append(entries)
        self.nbytes += entries.nbytes

    def result(self) -> "csr_array":
        """Return the matrix."""
        rows, columns, values = (
            np.concatenate([getattr(entries, name) for entries in self._found])
            for name in ("row_of_each", "columns", "distances")
        )
        if self._plan.is_symmetric:
            off = rows != columns
            rows, columns = (
                np.concatenate([rows, columns[off]]),
                np.concatenate([columns, rows[off]]),
            )
            values = np.concatenate([values, values[off]])
        if self._plan.is_flipped:
            rows, columns = columns, rows
        return self._from_triples((values, (rows, columns)), shape=self._plan.shape).tocsr()


class _Pairs:
    """Distances of pairs in the making; points that are in many of them are swept from."""

    def __init__(
        self,
        mesh: TriangleMesh,
        sources: Sequence[SurfacePoint],
        targets: Sequence[SurfacePoint],
        sweep_from: int,
        control: Control,
    ) -> None:
        if len(sources) != len(targets):
            raise InvalidArgument(
                f"there are {len(sources)} sources and {len(targets)} targets; pairs need the same "
                "number of both"
            )
        by_source, by_target = (_grouped(control.watched(side)) for side in (sources, targets))
        if _cost(by_target, sweep_from) < _cost(by_source, sweep_from):
            groups, others = by_target, sources
        else:
            groups, others = by_source, targets
        many = {hub: pairs for hub, pairs in groups.items() if len(pairs) >= sweep_from}
        self._pairs = np.array([i for pairs in many.values() for i in pairs], np.int64)
        self._first = np.cumsum([0, *map(len, many.values())], dtype=np.int32)
        self.searched = np.setdiff1d(np.arange(len(sources)), self._pairs)
        self.ends = ends_of(mesh, list(many), taken(others, self._pairs), control)
        self.sweeps = range(len(many))
        self.values = np.full(len(sources), math.inf)
        self.nbytes = self.values.nbytes

    def columns_of(self, sweeps: Longs) -> tuple[Ints, Ints]:
        """Return the first target of each of some sweeps, and one beyond its last."""
        return self._first[sweeps], self._first[sweeps + 1]

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps."""
        self.values[self._pairs[entries.columns]] = entries.distances

    def result(self) -> Floats:
        """Return the distances."""
        return self.values


def _grouped(points: Iterable[SurfacePoint]) -> dict[SurfacePoint, list[int]]:
    """Return the indices of each point."""
    groups: dict[SurfacePoint, list[int]] = {}
    for i, point in enumerate(points):
        groups.setdefault(point, []).append(i)
    return groups


def _cost(groups: Mapping[SurfacePoint, Sequence[int]], sweep_from: int) -> int:
    """Return the cost of pairs that are grouped by a point, in searches."""
    return sum(min(len(pairs), sweep_from) for pairs in groups.values())
