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
    solve_field,
    stats_of,
    with_default_accuracy,
)
from app.queries.base import VALUES_OF_POINT, ExecutionContext
from app.queries.cost_model import PER_POINT, sweep_seconds
from app.queries.from_sources import FromSources
from app.queries.points import (
    SurfacePoints,
    components_of,
    count_unreachable,
    describe_point,
    describe_source,
    numbered,
    to_sources,
)
from app.queries.validation import WrittenPoints, invalid_fields, naming
from app.queries.views import columns_of, surface_of, table_of_distances
from app.schemas.requests import DistancesRequest
from app.store.meshes import OpenMesh

_VALUES_INCLUDED = {"nearest_source": 1, "gradient": 3}
"""Values in JSON for each distance, by name."""


class DistancesQuery(FromSources[DistancesRequest]):
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    kind = "distances"
    model = DistancesRequest

    @classmethod
    def normalized(cls, request: DistancesRequest) -> DistancesRequest:
        """Name error or effort, and each included array once; refuse the gradient at targets."""
        if "gradient" in request.include and request.targets is not None:
            message = "gradient covers all vertices; ask for it without targets"
            raise invalid_fields(["/include"], message)
        included = list(dict.fromkeys(request.include))
        return with_default_accuracy(request.model_copy(update={"include": included}))

    @property
    def offers(self) -> Sequence[str]:
        """The media types of the answer; PLY has room for distances of all vertices only."""
        return (JSON, NPY, OCTETS, CSV, *([PLY] if self.request.targets is None else []))

    def check_format(self, media_type: str) -> None:
        """Refuse a second array in binary."""
        message = "does not come with a bare array; ask for json, csv or ply"
        faults = [Fault("/include", f"{name} {message}") for name in self.request.include]
        if faults and media_type in (NPY, OCTETS):
            raise problem("invalid_request", f"{media_type} holds one array", errors=tuple(faults))

    def value_count(self) -> int:
        """Return the number of distances, and of the values that are included with each."""
        columns = 1 + sum(_VALUES_INCLUDED[name] for name in self.request.include)
        if self.request.targets is None:
            return columns * self.size.vertices
        return (columns + VALUES_OF_POINT) * len(self.request.targets)

    def written_points(self) -> WrittenPoints:
        """Yield the sources, then the targets."""
        return chain(super().written_points(), numbered("/targets", self.request.targets or ()))

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit."""
        request = self.request
        points = self.source_count + len(request.targets or ())
        return sweep_seconds(self.size.faces, request, self.share) + PER_POINT * points

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep once."""
        request, mesh = self.request, opened.mesh
        if "gradient" in request.include:
            with naming((gc.errors.NotEmbedded, "/include")):
                mesh.require_embedded("a gradient")
        count = self.source_count
        sources, targets = points[:count], None if request.targets is None else points[count:]
        starts = to_sources(mesh, request.sources, sources)
        limit = request.max_distance
        field = solve_field(
            opened, request, starts, context, max_distance=limit, targets=targets or ()
        )
        distances = _at(targets, field.distances, field.distance_at)
        members = self.members(
            opened,
            method=request.method,
            error_bound=bound_of(field.error_bound),
            sources=[describe_source(mesh, start) for start in starts],
            **_described(mesh, targets),
            distances=distances,
            unreachable=_unreachable(mesh, sources, targets, distances),
            stats=stats_of(field.stats),
        )
        included: dict[str, Any] = {}
        if "nearest_source" in request.include:
            nearest = _at(targets, field.nearest_source, field.nearest_source_at)
            included["nearest_source"] = Indices(nearest)
        if "gradient" in request.include:
            included["gradient"] = field.gradient
        members |= included
        columns = columns_of(members)
        return Answer(
            members,
            ("distances",),
            ("distances", *included),
            table=table_of_distances("vertex" if targets is None else "target", columns),
            surface=surface_of(mesh, columns) if targets is None else None,
        )


def _described(mesh: gc.TriangleMesh, targets: SurfacePoints | None) -> dict[str, Any]:
    """Return the member for targets; none where they are all vertices."""
    if targets is None:
        return {}
    return {"targets": [describe_point(mesh, point) for point in targets]}


def _at(
    targets: SurfacePoints | None, at_vertices: NDArray[Any], at: Callable[[gc.SurfacePoint], Any]
) -> NDArray[Any]:
    """Return the values of a field at targets, or at all vertices."""
    if targets is None:
        return at_vertices
    vertices = [-1 if point.vertex_index is None else point.vertex_index for point in targets]
    values = at_vertices[vertices]
    for i, vertex in enumerate(vertices):
        if vertex < 0:
            values[i] = at(targets[i])
    return values


def _unreachable(
    mesh: gc.TriangleMesh,
    sources: SurfacePoints,
    targets: SurfacePoints | None,
    distances: NDArray[np.float64],
) -> Mapping[str, int]:
    ends = mesh.components if targets is None else components_of(mesh, targets)
    with_a_source = np.isin(ends, components_of(mesh, sources))
    return count_unreachable(np.isinf(distances), with_a_source)
