"""Distances from many points to many others."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, NPZ, OCTETS, Answer, Elements
from app.errors import over_limit
from app.queries.accuracy import (
    bound_on,
    options_of,
    with_default_accuracy,
)
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_POINT, share_reached, sweep_seconds
from app.queries.points import SurfacePoints, components_of, describe_point, numbered
from app.queries.validation import WrittenPoints, check_count, invalid_fields
from app.queries.views import table_of_matrix, table_of_sparse
from app.schemas.requests import Layout, MatrixRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

_CELLS = "cells of the matrix"
_IN_PARTS: Mapping[Layout, str] = {"dense": NPY, "sparse": NPZ}
"""Media types in which jobs compute a matrix of any size, by layout"""
_INDEX_BYTES = 8
"""Bytes of an index in a sparse file: of the column of a distance, or of the end of a row"""


class MatrixQuery(Query[MatrixRequest]):
    """Distances from each of N sources to each of M targets, or from each to one target."""

    kind = "matrix"
    model = MatrixRequest

    @classmethod
    def normalized(cls, request: MatrixRequest) -> MatrixRequest:
        """Name error or effort; refuse pairs without as many sources as targets."""
        if request.layout == "pairs":
            for name in ("sources", "targets"):
                if getattr(request, name) == "all":
                    message = "pairs need lists of points; give vertex indices instead of `all`"
                    raise invalid_fields([f"/{name}"], message)
            if "targets" not in request.model_fields_set:
                raise invalid_fields(["/layout"], "pairs need targets, one for each source")
            sources, targets = len(request.sources), len(request.targets)
            if sources != targets:
                message = (
                    f"there are {sources} sources and {targets} targets; pairs need the same "
                    "number of both"
                )
                raise invalid_fields(["/targets"], message)
        return with_default_accuracy(request)

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

    def check_answer(self, settings: Settings, *, as_job: bool) -> None:
        """Refuse a matrix that is too large for the memory of a worker, or as a job for the store.

        The parts and the file are there at the same time.
        """
        if self.is_in_parts(settings, as_job=as_job):
            needed = self.bytes_in_parts()
            if needed > settings.results_bytes:
                what, limit = "bytes of the matrix and its parts", settings.results_bytes
                raise over_limit("limit_exceeded", what, needed, limit, "results_bytes")
        else:
            self._check_in_memory(settings)
        super().check_answer(settings, as_job=as_job)

    def is_in_parts(self, settings: Settings, *, as_job: bool) -> bool:
        """Tell whether the answer is computed in parts, since it may be too large for memory."""
        if not as_job or self.representation.media_type != _IN_PARTS.get(self.request.layout):
            return False
        sources, targets = self._count()
        return sources > settings.max_sources or sources * targets > settings.max_matrix_cells

    def areas_of_parts(self) -> list[int]:
        """Return the number of distances in each part."""
        sources, targets = self._count()
        return gc.MatrixParts.areas(
            sources,
            None if self._is_symmetric else targets,
            self.size.faces,
            self.request.max_distance,
        )

    def bytes_in_parts(self) -> int:
        """Return the size of the parts and of the file that they become.

        Of a sparse matrix these are only the ends of rows: `bytes_of_part` tells the rest.
        """
        if self.request.layout == "sparse":
            return _INDEX_BYTES * self._count()[0]
        cells = sum(self.areas_of_parts()) + math.prod(self._count())
        return cells * np.dtype(self.representation.dtype).itemsize

    def bytes_of_part(self, nbytes: int, reached: int) -> int:
        """Return what a part of ``nbytes`` adds to `bytes_in_parts`, once it is computed."""
        if self.request.layout == "dense":
            return 0
        return nbytes + reached * (_INDEX_BYTES + np.dtype(self.representation.dtype).itemsize)

    def parts(self, opened: OpenMesh, cancel: Callable[[], bool]) -> gc.MatrixParts:
        """Return the parts of the matrix, which are still to be computed."""
        mesh, request = opened.mesh, self.request
        sources, targets = self._sides(mesh, self.resolved(mesh, cancel))
        assert request.layout != "pairs", "pairs are in memory"  # noqa: S101
        return gc.MatrixParts(
            mesh,
            sources.given,
            None if self._is_symmetric else targets.given,
            layout=request.layout,
            **options_of(request),
            max_distance=request.max_distance,
            dtype=cast(Any, self.representation.dtype),
            cancel=cancel,
        )

    def answer_of_parts(self, opened: OpenMesh, reached: int, cancel: Callable[[], bool]) -> Answer:
        """Return the answer that is in parts, but for its points and distances.

        ``reached`` of the distances are finite.
        """
        mesh = opened.mesh
        points = self.resolved(mesh, cancel)
        unreachable = self._unreachable(*self._sides(mesh, points), reached)
        warnings = self.noted(opened, points).warnings
        return Answer(self._about(mesh) | {"unreachable": unreachable, "warnings": warnings})

    def value_count(self) -> int:
        """Return the number of cells, and of the values of each point."""
        points = VALUES_OF_POINT * sum(self._count())
        return points if self.request.layout == "sparse" else points + self._cells()

    def written_points(self) -> WrittenPoints:
        """Yield the sources, then other targets, where they are written one by one."""
        for name in ("sources",) if self._is_symmetric else ("sources", "targets"):
            points = getattr(self.request, name)
            if points != "all":
                yield from numbered(f"/{name}", points)

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit from each point of the smaller side."""
        count = self._count()
        share = share_reached(self.size, 1, self.request.max_distance)
        one = sweep_seconds(self.size.faces, self.request, share)
        return min(count) * one + PER_POINT * sum(count)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep from the smaller side."""
        sources, targets = self._sides(opened.mesh, points)
        request = self.request
        is_half = self._is_symmetric and request.layout != "pairs"
        found: Any = opened.solver.distance_matrix(
            sources.given,
            None if is_half else targets.given,
            request.max_distance,
            request.layout,
            **options_of(request),
            **context.options,
        )
        if request.layout == "sparse" and found.nnz > context.max_cells:
            setting, hint = "max_matrix_cells", self._as_job
            raise over_limit(
                "limit_exceeded", _CELLS, found.nnz, context.max_cells, setting, hint=hint
            )
        return self._answer(opened, sources, targets, found)

    @cached_property
    def _is_symmetric(self) -> bool:
        """Whether the targets are the sources."""
        return self.request.sources == self.request.targets

    @property
    def _as_job(self) -> str | None:
        """The remedy for a matrix that is too large for memory."""
        media_type = _IN_PARTS.get(self.request.layout)
        return media_type and (
            f"ask for {media_type} with `Prefer: respond-async`: such a job may have more cells"
        )

    def _check_in_memory(self, settings: Settings) -> None:
        """Refuse too many sources, or cells where their number is known before solving."""
        hint = self._as_job
        check_count("sources", self._count()[0], settings, "max_sources", hint=hint)
        if self.request.layout != "sparse" or self.request.max_distance is None:
            check_count(_CELLS, self._cells(), settings, "max_matrix_cells", hint=hint)

    def _count(self) -> tuple[int, int]:
        """Return the numbers of sources and of targets."""
        sources, targets = (
            self.size.vertices if points == "all" else len(points)
            for points in (self.request.sources, self.request.targets)
        )
        return sources, targets

    def _cells(self) -> int:
        sources, targets = self._count()
        return sources if self.request.layout == "pairs" else sources * targets

    def _sides(self, mesh: gc.TriangleMesh, written: SurfacePoints) -> "tuple[_Side, _Side]":
        """Return the sources and the targets, of which some were written one by one."""
        request = self.request
        if request.sources == "all":
            sources, rest = _Side(mesh, None), written
        else:
            count = len(request.sources)
            sources, rest = _Side(mesh, written[:count]), written[count:]
        if self._is_symmetric:
            return sources, sources
        return sources, _Side(mesh, None if request.targets == "all" else rest)

    def _answer(self, opened: OpenMesh, sources: "_Side", targets: "_Side", found: Any) -> Answer:
        layout = self.request.layout
        members: dict[str, Any] = {
            **self._about(opened.mesh),
            "sources": Elements(len(sources), sources.described),
            "targets": Elements(len(targets), targets.described),
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
        members |= {
            "distances": found,
            "unreachable": self._unreachable(sources, targets, int(np.isfinite(found).sum())),
            "warnings": opened.warnings,
        }
        points = len(sources) + len(targets)
        values = VALUES_OF_POINT * points + sum(members[name].size for name in arrays)
        return Answer(members, arrays, arrays, values, table)

    def _about(self, mesh: gc.TriangleMesh) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "mesh_id": self.mesh_id,
            "method": self.request.method,
            "error_bound": bound_on(mesh, self.request),
            "layout": self.request.layout,
        }

    def _unreachable(self, sources: "_Side", targets: "_Side", reached: int) -> dict[str, int]:
        """Return the number of missing distances by reason."""
        starts, ends = sources.components, targets.components
        if self.request.layout == "pairs":
            cells, connected = len(starts), int(np.count_nonzero(starts == ends))
        else:
            cells = len(starts) * len(ends)
            counts = np.bincount(ends, minlength=int(starts.max()) + 1)
            connected = int(counts[starts].sum())
        return {"disconnected": cells - connected, "beyond_max_distance": connected - reached}


@dataclass(frozen=True)
class _Side:
    """The points on one side of a matrix: all vertices, or those that were written one by one.

    There is no object for each vertex: many would take longer than the sweeps.
    """

    mesh: gc.TriangleMesh
    points: SurfacePoints | None
    """None for all vertices"""

    def __len__(self) -> int:
        return len(self.mesh.vertices) if self.points is None else len(self.points)

    @property
    def given(self) -> Sequence[int | gc.SurfacePoint]:
        """The points, as the library takes them."""
        return range(len(self.mesh.vertices)) if self.points is None else self.points

    @cached_property
    def components(self) -> NDArray[np.int64]:
        """The connected component of each point."""
        if self.points is None:
            return self.mesh.components.astype(np.int64)
        return components_of(self.mesh, self.points)

    def described(self, part: slice) -> list[dict[str, Any]]:
        """Return the members of some of the points."""
        components = self.components[part].tolist()
        if self.points is not None:
            described = [describe_point(self.mesh, point) for point in self.points[part]]
        else:
            indices = range(len(self))[part]
            positions = [None] * len(indices)
            if self.mesh.has_positions:
                positions = self.mesh.vertices[part].tolist()
            described = [
                {"vertex": vertex, "position": position}
                for vertex, position in zip(indices, positions, strict=True)
            ]
        return [
            {**point, "component": component}
            for point, component in zip(described, components, strict=True)
        ]
