"""Distances from the nearest of some sources, to all vertices or to some targets."""

from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app import schemas
from app.encoding import Answer
from app.errors import Fault, refuse
from app.mesh_store import OpenMesh
from app.points import described
from app.queries.accuracy import bound_of, method_of, solve_field, with_its_error
from app.queries.costs import (
    PER_POINT,
    Cost,
    share_within,
    straight_to_nearest,
    sweep_cost,
)
from app.queries.places import Places, components_of, unreachable
from app.queries.query import VALUES_OF_POINT, Grant, Likely, Query, numbered
from app.queries.refusals import MeshSize, Named, refuse_more
from app.queries.stats import likely_stats, stats_of
from app.settings import Settings


class DistancesQuery(Query[schemas.DistancesRequest]):
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    model = schemas.DistancesRequest

    @classmethod
    def normal(cls, request: schemas.DistancesRequest) -> schemas.DistancesRequest:
        """Name the error that is granted, and what is included once."""
        once = request.model_copy(update={"include": list(dict.fromkeys(request.include))})
        return with_its_error(once)

    def refuse(self, settings: Settings) -> None:
        """Refuse too many sources."""
        refuse_more("sources", len(self.request.sources), settings, "max_sources")

    def refuse_format(self, media_type: str) -> None:
        """Refuse a second array in binary."""
        if self._names_sources:
            fault = Fault("/include", "nearest_source comes with JSON only")
            raise refuse("invalid_request", f"{media_type} holds one array", errors=(fault,))

    def value_count(self, size: MeshSize) -> int:
        """Return the number of distances and of what is told of each."""
        columns = 2 if self._names_sources else 1
        if self.request.targets is None:
            return columns * size.vertices
        return (columns + VALUES_OF_POINT) * len(self.request.targets)

    def points(self) -> Named:
        """Yield the sources, then the targets."""
        request = self.request
        return chain(
            numbered("sources", request.sources), numbered("targets", request.targets or ())
        )

    def solve(self, opened: OpenMesh, places: Places, grant: Grant) -> Answer:
        """Sweep once."""
        request = self.request
        sources, targets = self._parted(places)
        starts = [
            gc.Source(place, source.start_distance)
            for place, source in zip(sources, request.sources, strict=True)
        ]
        field = solve_field(
            opened.solver,
            request,
            starts,
            max_distance=request.max_distance,
            targets=[place for place in targets or () if place.vertex_index is None],
            **grant.options,
        )
        distances = _at(targets, field.distances, field.distance_at)
        nearest = None
        if self._names_sources:
            nearest = _at(targets, field.nearest_source, field.nearest_source_at)
        bound, stats = bound_of(field.error_bound), stats_of(field.stats)
        return self._answer(opened, places, distances, nearest, bound, stats)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what one sweep costs; the numbers of the answer are straight distances."""
        request, mesh = self.request, opened.mesh
        sources, targets = self._parted(places)
        share = 1.0
        if request.max_distance is not None:
            share = min(1.0, len(sources) * float(share_within(mesh, request.max_distance)))
        sweep = sweep_cost(mesh, request, share)
        away, nearest = straight_to_nearest(mesh, sources, targets, request.max_distance)
        cost = Cost(sweep.seconds + PER_POINT * len(places), sweep.memory_bytes)
        bound = {"type": "relative", "value": request.relative_error or 0.0, "kind": "guaranteed"}
        found = nearest if self._names_sources else None
        stats = likely_stats(mesh, share)
        return Likely(cost, self._answer(opened, places, away, found, bound, stats))

    @property
    def _names_sources(self) -> bool:
        return "nearest_source" in self.request.include

    def _parted(self, places: Places) -> tuple[Places, Places | None]:
        """Return sources and targets, None where those are all vertices."""
        count = len(self.request.sources)
        return places[:count], None if self.request.targets is None else places[count:]

    def _answer(
        self,
        opened: OpenMesh,
        places: Places,
        distances: NDArray[np.float64],
        nearest_source: NDArray[Any] | None,
        error_bound: Mapping[str, Any],
        stats: Mapping[str, Any],
    ) -> Answer:
        mesh = opened.mesh
        sources, targets = self._parted(places)
        members: dict[str, Any] = {
            "mesh_id": self.mesh_id,
            **method_of(self.request),
            "error_bound": error_bound,
            "sources": [
                {**described(mesh, place), "start_distance": source.start_distance}
                for place, source in zip(sources, self.request.sources, strict=True)
            ],
        }
        if targets is not None:
            members["targets"] = [described(mesh, place) for place in targets]
        members |= {
            "distances": distances,
            "unreachable": _unreachable(mesh, sources, targets, distances),
            "stats": stats,
            "warnings": opened.warnings,
        }
        if nearest_source is not None:
            members["nearest_source"] = [None if i < 0 else i for i in nearest_source.tolist()]
        return Answer(members, ("distances",))


def _at(
    targets: Places | None, at_vertices: NDArray[Any], at: Callable[[gc.SurfacePoint], Any]
) -> NDArray[Any]:
    """Return the values of a field at targets, or at all vertices."""
    if targets is None:
        return at_vertices
    vertices = [-1 if place.vertex_index is None else place.vertex_index for place in targets]
    values = at_vertices[vertices]
    for i, vertex in enumerate(vertices):
        if vertex < 0:
            values[i] = at(targets[i])
    return values


def _unreachable(
    mesh: gc.TriangleMesh,
    sources: Places,
    targets: Places | None,
    distances: NDArray[np.float64],
) -> Mapping[str, int]:
    ends = mesh.components if targets is None else components_of(mesh, targets)
    with_a_source = np.isin(ends, components_of(mesh, sources))
    return unreachable(np.isinf(distances), with_a_source)
