"""Distances from many points to many others."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, NPZ, OCTETS, Answer
from app.errors import over_limit
from app.queries.accuracy import CERTAIN
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Forecast, Query
from app.queries.cost_model import (
    PER_POINT,
    SWEPT_FROM,
    Cost,
    rough_share,
    search_cost,
    share_within,
    straight_along,
    straight_between,
    sweeps_cost,
)
from app.queries.points import SurfacePoints, components_of, describe_point, numbered
from app.queries.validation import MeshSize, WrittenPoints, check_count, invalid_fields
from app.queries.views import table_of_matrix, table_of_sparse
from app.schemas.requests import MatrixRequest
from app.settings import Settings, available_cores
from app.store.meshes import OpenMesh

if TYPE_CHECKING:
    from scipy.sparse import coo_array

_CELLS = "cells of the matrix"
_AT_A_TIME = 2**20
"""Straight distances that are computed at a time."""


class MatrixQuery(Query[MatrixRequest]):
    """Distances from each of N sources to each of M targets, or from each to one target."""

    kind = "matrix"
    model = MatrixRequest

    @classmethod
    def normalized(cls, request: MatrixRequest) -> MatrixRequest:
        """Refuse pairs without as many sources as targets."""
        sources, targets = len(request.sources), len(request.targets)
        if request.layout == "pairs" and sources != targets:
            message = f"there are {sources} sources and {targets} targets; pairs need as many"
            raise invalid_fields(["/targets"], message)
        return request

    @property
    def offers(self) -> Sequence[str]:
        """The media types that hold the layout."""
        return (JSON, NPZ, CSV) if self.request.layout == "sparse" else (JSON, NPY, OCTETS, CSV)

    @property
    def hint(self) -> str:
        """The remedy for an answer that is too large for JSON."""
        if self.request.layout == "sparse":
            return "ask for application/x-npz, with `Accept` or with ?format=npz"
        return super().hint

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many sources, or cells where their number is known before solving."""
        check_count("sources", len(self.request.sources), settings, "max_sources")
        if self.request.layout != "sparse" or self.request.max_distance is None:
            check_count(_CELLS, self._cells, settings, "max_matrix_cells")

    def value_count(self, size: MeshSize) -> int:
        """Return the number of cells, and of the values of each point."""
        points = VALUES_OF_POINT * (len(self.request.sources) + len(self.request.targets))
        return points if self.request.layout == "sparse" else points + self._cells

    def written_points(self) -> WrittenPoints:
        """Yield the sources, then the targets."""
        request = self.request
        return chain(numbered("/sources", request.sources), numbered("/targets", request.targets))

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a sweep to the limit from each point of the smaller side."""
        request = self.request
        points = len(request.sources) + len(request.targets)
        sweeps = min(len(request.sources), len(request.targets))
        share = rough_share(size, 1, request.max_distance)
        return sweeps_cost(size.faces, [share] * sweeps, 1).seconds + PER_POINT * points

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep from the smaller side."""
        sources, targets = self._parted(points)
        request = self.request
        found: Any = opened.solver.distance_matrix(
            sources, targets, request.max_distance, request.layout, **context.options
        )
        if request.layout == "sparse" and found.nnz > context.max_cells:
            raise over_limit(
                "limit_exceeded", _CELLS, found.nnz, context.max_cells, "max_matrix_cells"
            )
        return self._answer(opened, points, found)

    def forecast(self, opened: OpenMesh, points: SurfacePoints) -> Forecast:
        """Return the cost of sweeps, each to its farthest target along a straight line."""
        mesh, limit = opened.mesh, self.request.max_distance
        sources, targets = self._parted(points)
        found: Any
        if self.request.layout == "pairs":
            found = straight_along(mesh, sources, targets, limit)
            cost = _cost_of_pairs(mesh, sources, targets, found)
        elif self.request.layout == "dense":
            found = straight_between(mesh, sources, targets, limit)
            from_sources = len(sources) <= len(targets)
            cost = _cost_of_sweeps(mesh, _farthest(found if from_sources else found.T))
        else:
            found = _straight_sparse(mesh, sources, targets, limit)
            from_sources = len(sources) <= len(targets)
            radii = np.zeros(min(found.shape))
            np.maximum.at(radii, found.row if from_sources else found.col, found.data)
            cost = _cost_of_sweeps(mesh, radii)
        seconds = cost.seconds + PER_POINT * len(points)
        table = found.nnz * 12 if self.request.layout == "sparse" else found.nbytes
        return Forecast(
            Cost(seconds, cost.memory_bytes + table), self._answer(opened, points, found)
        )

    @property
    def _cells(self) -> int:
        sources, targets = len(self.request.sources), len(self.request.targets)
        return sources if self.request.layout == "pairs" else sources * targets

    def _parted(self, points: SurfacePoints) -> tuple[SurfacePoints, SurfacePoints]:
        count = len(self.request.sources)
        return points[:count], points[count:]

    def _answer(self, opened: OpenMesh, points: SurfacePoints, found: Any) -> Answer:
        mesh, layout = opened.mesh, self.request.layout
        sources, targets = self._parted(points)
        starts, ends = components_of(mesh, sources), components_of(mesh, targets)
        members: dict[str, Any] = {
            "kind": self.kind,
            "mesh_id": self.mesh_id,
            "method": "exact",
            "exact": True,
            "error_bound": CERTAIN,
            "layout": layout,
            "sources": _describe_ends(mesh, sources, starts),
            "targets": _describe_ends(mesh, targets, ends),
        }
        arrays: tuple[str, ...] = ("distances",)
        if layout == "sparse":
            table = found.tocoo()
            arrays += ("rows", "columns")
            found = table.data
            members |= {"shape": table.shape, "rows": table.row, "columns": table.col}
            table = table_of_sparse(table.row, table.col, found)
        else:
            table = table_of_matrix(found)
        if layout == "pairs":
            connected = int(np.count_nonzero(starts == ends))
        else:
            connected = sum(int(np.count_nonzero(ends == component)) for component in starts)
        members |= {
            "distances": found,
            "unreachable": {
                "disconnected": self._cells - connected,
                "beyond_max_distance": connected - int(np.count_nonzero(np.isfinite(found))),
            },
            "warnings": opened.warnings,
        }
        values = VALUES_OF_POINT * len(points) + sum(members[name].size for name in arrays)
        return Answer(members, arrays, arrays, values, table)


def _describe_ends(
    mesh: gc.TriangleMesh, points: SurfacePoints, components: NDArray[np.int64]
) -> Sequence[Mapping[str, Any]]:
    return [
        {**describe_point(mesh, point), "component": component}
        for point, component in zip(points, components.tolist(), strict=True)
    ]


def _straight_sparse(
    mesh: gc.TriangleMesh, sources: SurfacePoints, targets: SurfacePoints, limit: float | None
) -> "coo_array":
    """Return the finite straight distances, computed for some sources at a time."""
    from scipy.sparse import coo_array

    size = max(1, _AT_A_TIME // len(targets))
    rows, columns, values = [], [], []
    for first in range(0, len(sources), size):
        table = straight_between(mesh, sources[first : first + size], targets, limit)
        row, column = np.nonzero(np.isfinite(table))
        rows.append(first + row)
        columns.append(column)
        values.append(table[row, column])
    cells = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(values), cells), shape=(len(sources), len(targets)))


def _farthest(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest finite distance of each row, or 0."""
    farthest: NDArray[np.float64] = np.where(np.isfinite(distances), distances, 0.0).max(axis=1)
    return farthest


def _cost_of_sweeps(mesh: gc.TriangleMesh, radii: NDArray[np.float64]) -> Cost:
    threads = min(available_cores(), len(radii))
    return sweeps_cost(len(mesh.faces), share_within(mesh, radii).tolist(), threads)


def _cost_of_pairs(
    mesh: gc.TriangleMesh,
    sources: SurfacePoints,
    targets: SurfacePoints,
    distances: NDArray[np.float64],
) -> Cost:
    """Return the cost of searches and of sweeps, these from the side with fewer points."""
    ends = min(sources, targets, key=lambda side: len(set(side)))
    pairs = Counter(ends)
    searches = sum(count for count in pairs.values() if count < SWEPT_FROM)
    radii = {end: 0.0 for end, count in pairs.items() if count >= SWEPT_FROM}
    for end, distance in zip(ends, distances.tolist(), strict=True):
        if end in radii and distance < math.inf:
            radii[end] = max(radii[end], distance)
    costs = [search_cost(len(mesh.faces), searches)] if searches else []
    if radii:
        costs.append(_cost_of_sweeps(mesh, np.array(list(radii.values()))))
    return Cost(sum(cost.seconds for cost in costs), sum(cost.memory_bytes for cost in costs))
