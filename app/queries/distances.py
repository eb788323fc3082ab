"""Distances from the nearest of some sources, to all vertices or to some targets."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, OCTETS, PLY, Answer, Indices
from app.errors import Fault, problem
from app.queries.accuracy import (
    bound_of,
    likely_bound,
    method_of,
    solve_field,
    topics_of,
    with_its_error,
)
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Likely, Query, numbered
from app.queries.cost_model import (
    PER_POINT,
    Cost,
    rough_share,
    share_within,
    straight_to_nearest,
    sweep_cost,
)
from app.queries.places import Places, components_of, positions_of, unreachable
from app.queries.points import described, described_source
from app.queries.sources import named_sources, point_count, starts_of
from app.queries.stats import likely_stats, stats_of
from app.queries.validation import MeshSize, Named, refuse_more, refuse_places
from app.queries.views import columns_of, surface_of, table_of_distances
from app.schemas.requests import DistancesRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

_VALUES_INCLUDED = {"nearest_source": 1, "gradient": 3}
"""Values of JSON for each distance"""


class DistancesQuery(Query[DistancesRequest]):
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    kind = "distances"
    model = DistancesRequest

    @classmethod
    def normal(cls, request: DistancesRequest) -> DistancesRequest:
        """Name the error that is granted, and what is included once.

        The gradient is known at vertices only.
        """
        if "gradient" in request.include and request.targets is not None:
            message = "gradient is that of all vertices; ask for it without targets"
            raise refuse_places(["/include"], message)
        once = request.model_copy(update={"include": list(dict.fromkeys(request.include))})
        return with_its_error(once)

    def refuse(self, settings: Settings) -> None:
        """Refuse too many sources."""
        refuse_more("sources", point_count(*self.request.sources), settings, "max_sources")

    @property
    def offers(self) -> Sequence[str]:
        """The media types: a mesh has distances at its vertices."""
        return (JSON, NPY, OCTETS, CSV, *([PLY] if self.request.targets is None else []))

    def refuse_format(self, media_type: str) -> None:
        """Refuse a second array in binary."""
        message = "does not come with a bare array; ask for json, csv or ply"
        faults = [Fault("/include", f"{name} {message}") for name in self._included]
        if faults and media_type in (NPY, OCTETS):
            raise problem("invalid_request", f"{media_type} holds one array", errors=tuple(faults))

    def value_count(self, size: MeshSize) -> int:
        """Return the number of distances and of what is told of each."""
        columns = 1 + sum(_VALUES_INCLUDED[name] for name in self._included)
        if self.request.targets is None:
            return columns * size.vertices
        return (columns + VALUES_OF_POINT) * len(self.request.targets)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of these sources, and the mesh."""
        return topics_of(self, self.request.sources)

    def points(self) -> Named:
        """Yield the sources, then the targets."""
        request = self.request
        return chain(named_sources(request.sources), numbered("/targets", request.targets or ()))

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a sweep to the limit."""
        request = self.request
        share = rough_share(size, point_count(*request.sources), request.max_distance)
        paths = "gradient" in self._included
        points = point_count(*request.sources) + len(request.targets or ())
        return sweep_cost(size.faces, request, share, paths=paths).seconds + PER_POINT * points

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Sweep once."""
        request = self.request
        sources, targets = self._parted(places)
        starts = starts_of(opened.mesh, request.sources, sources)
        field = solve_field(
            opened,
            request,
            starts,
            grant,
            max_distance=request.max_distance,
            targets=targets or (),
        )
        distances = _at(targets, field.distances, field.distance_at)
        included: dict[str, NDArray[Any]] = {}
        if "nearest_source" in self._included:
            nearest = _at(targets, field.nearest_source, field.nearest_source_at)
            included["nearest_source"] = nearest
        if "gradient" in self._included:
            included["gradient"] = field.gradient
        bound, stats = bound_of(field.error_bound), stats_of(field.stats)
        return self._answer(opened, places, starts, distances, included, bound, stats)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what one sweep costs; the numbers of the answer are straight distances."""
        request, mesh = self.request, opened.mesh
        sources, targets = self._parted(places)
        starts = starts_of(mesh, request.sources, sources)
        share = 1.0
        if request.max_distance is not None:
            share = min(1.0, len(sources) * float(share_within(mesh, request.max_distance)))
        sweep = sweep_cost(len(mesh.faces), request, share, paths="gradient" in self._included)
        away, nearest = straight_to_nearest(mesh, sources, targets, request.max_distance)
        cost = Cost(sweep.seconds + PER_POINT * len(places), sweep.memory_bytes)
        bound = likely_bound(request)
        included: dict[str, NDArray[Any]] = {}
        if "nearest_source" in self._included:
            included["nearest_source"] = nearest
        if "gradient" in self._included:
            ahead = mesh.vertices - positions_of(mesh, sources)[nearest]
            included["gradient"] = _straight_gradient(ahead, away)
        stats = likely_stats(mesh, share)
        return Likely(cost, self._answer(opened, places, starts, away, included, bound, stats))

    @property
    def _included(self) -> Sequence[str]:
        return self.request.include

    def _parted(self, places: Places) -> tuple[Places, Places | None]:
        """Return sources and targets, None where those are all vertices."""
        count = point_count(*self.request.sources)
        return places[:count], None if self.request.targets is None else places[count:]

    def _answer(
        self,
        opened: OpenMesh,
        places: Places,
        starts: Sequence[gc.Source],
        distances: NDArray[np.float64],
        included: Mapping[str, NDArray[Any]],
        error_bound: Mapping[str, Any],
        stats: Mapping[str, Any],
    ) -> Answer:
        mesh = opened.mesh
        sources, targets = self._parted(places)
        members: dict[str, Any] = {
            "mesh_id": self.mesh_id,
            **method_of(self.request),
            "error_bound": error_bound,
            "sources": [described_source(mesh, start) for start in starts],
        }
        if targets is not None:
            members["targets"] = [described(mesh, place) for place in targets]
        members |= {
            "distances": distances,
            "unreachable": _unreachable(mesh, sources, targets, distances),
            "stats": stats,
            "warnings": opened.warnings,
        }
        for name, array in included.items():
            members[name] = Indices(array) if name == "nearest_source" else array
        columns = columns_of(members)
        return Answer(
            members,
            ("distances",),
            ("distances", *included),
            table=table_of_distances("vertex" if targets is None else "target", columns),
            surface=surface_of(mesh, columns) if targets is None else None,
        )


def _straight_gradient(
    ahead: NDArray[np.float64], away: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the directions (V, 3) of what is straight ahead; NaN as in the real one."""
    length = np.linalg.norm(ahead, axis=1)
    length[~np.isfinite(away) | (length == 0.0)] = np.nan
    ahead /= length[:, None]
    return ahead


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
