"""Distances from many points to many others."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, NPZ, OCTETS, Answer
from app.errors import over_limit
from app.queries.accuracy import CERTAIN
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Likely, Query, numbered
from app.queries.cost_model import (
    PER_POINT,
    Cost,
    rough_share,
    search_cost,
    share_within,
    straight_along,
    straight_between,
    sweeps_cost,
)
from app.queries.places import Places, components_of
from app.queries.points import described
from app.queries.validation import MeshSize, Named, refuse_more, refuse_places
from app.queries.views import table_of_matrix, table_of_sparse
from app.schemas.requests import MatrixRequest
from app.settings import Settings
from app.store.meshes import OpenMesh
from geodesic_core.search.matrix import SWEEP_FROM
from geodesic_core.search.threads import available_cores

_CELLS = "cells of the matrix"
_AT_A_TIME = 2**20
"""Straight distances that are worked on at a time."""


class MatrixQuery(Query[MatrixRequest]):
    """Distances from each of N sources to each of M targets, or from each to one target."""

    kind = "matrix"
    model = MatrixRequest

    @classmethod
    def normal(cls, request: MatrixRequest) -> MatrixRequest:
        """Refuse pairs of which one end is missing."""
        sources, targets = len(request.sources), len(request.targets)
        if request.layout == "pairs" and sources != targets:
            message = f"there are {sources} sources and {targets} targets; pairs need as many"
            raise refuse_places(["/targets"], message)
        return request

    @property
    def offers(self) -> Sequence[str]:
        """The media types that hold the layout."""
        return (JSON, NPZ, CSV) if self.request.layout == "sparse" else (JSON, NPY, OCTETS, CSV)

    @property
    def hint(self) -> str:
        """What to do where the answer is too large for JSON."""
        if self.request.layout == "sparse":
            return "ask for application/x-npz, with `Accept` or with ?format=npz"
        return super().hint

    def refuse(self, settings: Settings) -> None:
        """Refuse too many sources or cells, where these can be told before they are found."""
        refuse_more("sources", len(self.request.sources), settings, "max_sources")
        if self.request.layout != "sparse" or self.request.max_distance is None:
            refuse_more(_CELLS, self._cells, settings, "max_matrix_cells")

    def value_count(self, size: MeshSize) -> int:
        """Return the number of cells and of what is told of each point."""
        points = VALUES_OF_POINT * (len(self.request.sources) + len(self.request.targets))
        return points if self.request.layout == "sparse" else points + self._cells

    def points(self) -> Named:
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

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Sweep from the smaller side."""
        sources, targets = self._parted(places)
        request = self.request
        found: Any = opened.solver.distance_matrix(
            sources, targets, request.max_distance, request.layout, **grant.options
        )
        if request.layout == "sparse" and found.nnz > grant.max_cells:
            raise over_limit(
                "limit_exceeded", _CELLS, found.nnz, grant.max_cells, "max_matrix_cells"
            )
        return self._answer(opened, places, found)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what the sweeps cost, each as far as its farthest target along a straight line."""
        mesh, limit = opened.mesh, self.request.max_distance
        sources, targets = self._parted(places)
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
        seconds = cost.seconds + PER_POINT * len(places)
        table = found.nnz * 12 if self.request.layout == "sparse" else found.nbytes
        return Likely(Cost(seconds, cost.memory_bytes + table), self._answer(opened, places, found))

    @property
    def _cells(self) -> int:
        sources, targets = len(self.request.sources), len(self.request.targets)
        return sources if self.request.layout == "pairs" else sources * targets

    def _parted(self, places: Places) -> tuple[Places, Places]:
        count = len(self.request.sources)
        return places[:count], places[count:]

    def _answer(self, opened: OpenMesh, places: Places, found: Any) -> Answer:
        mesh, layout = opened.mesh, self.request.layout
        sources, targets = self._parted(places)
        starts, ends = components_of(mesh, sources), components_of(mesh, targets)
        members: dict[str, Any] = {
            "mesh_id": self.mesh_id,
            "method": "exact",
            "exact": True,
            "error_bound": CERTAIN,
            "layout": layout,
            "sources": _told(mesh, sources, starts),
            "targets": _told(mesh, targets, ends),
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
        values = VALUES_OF_POINT * len(places) + sum(members[name].size for name in arrays)
        return Answer(members, arrays, arrays, values, table)


def _told(
    mesh: gc.TriangleMesh, places: Places, components: NDArray[np.int64]
) -> Sequence[Mapping[str, Any]]:
    return [
        {**described(mesh, place), "component": component}
        for place, component in zip(places, components.tolist(), strict=True)
    ]


def _straight_sparse(
    mesh: gc.TriangleMesh, sources: Places, targets: Places, limit: float | None
) -> coo_array:
    """Return the straight distances that there are: some sources at a time, of all they are few."""
    size = max(1, _AT_A_TIME // len(targets))
    rows, columns, values = [], [], []
    for first in range(0, len(sources), size):
        table = straight_between(mesh, sources[first : first + size], targets, limit)
        row, column = np.nonzero(np.isfinite(table))
        rows.append(first + row)
        columns.append(column)
        values.append(table[row, column])
    places = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(values), places), shape=(len(sources), len(targets)))


def _farthest(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the farthest that can be reached is, for each row."""
    farthest: NDArray[np.float64] = np.where(np.isfinite(distances), distances, 0.0).max(axis=1)
    return farthest


def _cost_of_sweeps(mesh: gc.TriangleMesh, radii: NDArray[np.float64]) -> Cost:
    threads = min(available_cores(), len(radii))
    return sweeps_cost(len(mesh.faces), share_within(mesh, radii).tolist(), threads)


def _cost_of_pairs(
    mesh: gc.TriangleMesh, sources: Places, targets: Places, distances: NDArray[np.float64]
) -> Cost:
    """Return the cost of searches and of sweeps, these from the side that has fewer points."""
    ends = min(sources, targets, key=lambda side: len(set(side)))
    pairs = Counter(ends)
    searches = sum(count for count in pairs.values() if count < SWEEP_FROM)
    radii = {end: 0.0 for end, count in pairs.items() if count >= SWEEP_FROM}
    for end, away in zip(ends, distances.tolist(), strict=True):
        if end in radii and away < math.inf:
            radii[end] = max(radii[end], away)
    costs = [search_cost(len(mesh.faces), searches)] if searches else []
    if radii:
        costs.append(_cost_of_sweeps(mesh, np.array(list(radii.values()))))
    return Cost(sum(cost.seconds for cost in costs), sum(cost.memory_bytes for cost in costs))
