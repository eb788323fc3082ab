"""Distances from the nearest of some sources, to all vertices or to some targets."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, NPZ, OCTETS, PLY, Answer, Indices
from app.errors import Fault, problem
from app.queries.accuracy import (
    bound_of,
    stats_of,
    with_default_accuracy,
)
from app.queries.base import VALUES_OF_POINT, ExecutionContext
from app.queries.cost_model import PER_FACE_CERTIFIED, PER_POINT, sweep_seconds
from app.queries.costs import CHEAPEST, check_alone, sweeps_of
from app.queries.from_sources import FromSources, solve_either
from app.queries.points import (
    SurfacePoints,
    components_of,
    count_unreachable,
    describe_point,
    describe_source,
    numbered,
    to_sources,
)
from app.queries.proofs import check_proof_format, told
from app.queries.validation import FAULTS_SHOWN, WrittenPoints, invalid_fields, naming
from app.queries.views import columns_of, surface_of, table_of_distances
from app.schemas.points import CurveSource
from app.schemas.requests import DistancesRequest
from app.store.meshes import OpenMesh

_BOUNDS = "lower", "upper"
_VIOLATIONS = "violations"
_VALUES_INCLUDED = {"nearest_source": 1, "gradient": 3, "lower": 1, "upper": 1}
"""Values in JSON for each distance, by name."""


class DistancesQuery(FromSources[DistancesRequest]):
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    kind = "distances"
    model = DistancesRequest

    @classmethod
    def normalized(cls, request: DistancesRequest) -> DistancesRequest:
        """Name error or effort, and each included array once; refuse what does not go together."""
        if "gradient" in request.include and request.targets is not None:
            message = "gradient covers all vertices; ask for it without targets"
            raise invalid_fields(["/include"], message)
        if request.cost is not None:
            check_alone(request, "certify")
            if "gradient" in request.include:
                raise invalid_fields(["/include"], "a gradient is one of distances, not of costs")
        if request.certify:
            _check_certifiable(request)
        elif proved := {*_BOUNDS, _VIOLATIONS} & set(request.include):
            raise invalid_fields(["/include"], f"{', '.join(sorted(proved))}: with certify only")
        included = list(dict.fromkeys(request.include))
        return with_default_accuracy(request.model_copy(update={"include": included}))

    @property
    def offers(self) -> Sequence[str]:
        """The media types of the answer; PLY has room for distances of all vertices only."""
        request = self.request
        of_all = [PLY] if request.targets is None else []
        return (JSON, NPY, OCTETS, CSV, *of_all, *([NPZ] if request.certify else []))

    def check_format(self, media_type: str) -> None:
        """Refuse a second array in binary, one by face in tables, and a proof that is rounded."""
        if media_type != JSON and _VIOLATIONS in self.request.include:
            raise invalid_fields(["/include"], "violations are values of faces; ask for json")
        message = "does not come with a bare array; ask for json, csv or ply"
        faults = [Fault("/include", f"{name} {message}") for name in self.request.include]
        if faults and media_type in (NPY, OCTETS, NPZ):
            detail = "the proof" if media_type == NPZ else "one array"
            raise problem("invalid_request", f"{media_type} holds {detail}", errors=tuple(faults))
        check_proof_format(media_type, self.representation)

    def value_count(self) -> int:
        """Return the number of distances, and of the values that are included with each."""
        request = self.request
        columns = 1 + sum(_VALUES_INCLUDED.get(name, 0) for name in request.include)
        of_faces = self.size.faces if _VIOLATIONS in request.include else 0
        if request.targets is None:
            return columns * self.size.vertices + of_faces
        return (columns + VALUES_OF_POINT) * len(request.targets) + of_faces

    def written_points(self) -> WrittenPoints:
        """Yield the sources, then the targets."""
        return chain(super().written_points(), numbered("/targets", self.request.targets or ()))

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit, and of the proof."""
        request = self.request
        points = self.source_count + len(request.targets or ())
        proof = PER_FACE_CERTIFIED * self.size.faces if request.certify else 0.0
        seconds = sweeps_of(request.cost) * sweep_seconds(self.size.faces, request, self.share)
        return seconds + PER_POINT * points + proof

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep once, and prove what was found if asked for."""
        request, mesh = self.request, opened.mesh
        if "gradient" in request.include:
            with naming((gc.errors.NotEmbedded, "/include")):
                mesh.require_embedded("a gradient")
        count = self.source_count
        sources, targets = points[:count], None if request.targets is None else points[count:]
        if request.certify:
            _check_vertices(targets or ())
        starts = to_sources(mesh, request.sources, sources)
        parts = 2 if request.certify else 1
        field = solve_either(opened, request, starts, context.part(0, parts), targets or ())
        certificate = None
        if isinstance(field, gc.DistanceField) and request.certify:
            field = copy(field)  # that of the cache keeps its bound, as others are answered by it
            certificate = field.certify(**context.part(1, parts).options)
        distances = _at(targets, field.distances, field.distance_at)
        members = self.members(
            opened,
            method=request.method if request.cost is None else CHEAPEST,
            error_bound=bound_of(field.error_bound),
            sources=[describe_source(mesh, start) for start in starts],
            **_described(mesh, targets),
            distances=distances,
            **(told(certificate, certificate.relative_gap) if certificate else {}),
            unreachable=_unreachable(mesh, sources, targets, distances),
            stats=stats_of(field.stats),
        )
        included: dict[str, Any] = {}
        if "nearest_source" in request.include:
            nearest = _at(targets, field.nearest_source, field.nearest_source_at)
            included["nearest_source"] = Indices(nearest)
        if isinstance(field, gc.DistanceField) and "gradient" in request.include:
            included["gradient"] = field.gradient
        for name in _BOUNDS:
            if name in request.include:
                included[name] = _at(targets, getattr(certificate, name), field.distance_at)
        if certificate is not None and _VIOLATIONS in request.include:
            included[_VIOLATIONS] = certificate.violations
        members |= included
        columns = columns_of(members)
        return Answer(
            members,
            ("distances",),
            ("distances", *included),
            table=table_of_distances("vertex" if targets is None else "target", columns),
            surface=surface_of(mesh, columns) if targets is None else None,
            named=None if certificate is None else certificate.arrays,
        )


def _check_certifiable(request: DistancesRequest) -> None:
    """Refuse to prove what has no certificate."""
    if any(isinstance(source, CurveSource) for source in request.sources):
        message = "distances from curves have no certificate yet: give points as sources"
        raise invalid_fields(["/certify"], message)


def _check_vertices(targets: SurfacePoints) -> None:
    """Refuse targets off vertices, whose distances a certificate does not bound."""
    off = [i for i, target in enumerate(targets) if target.vertex_index is None]
    if off:
        places = [f"/targets/{i}" for i in off[:FAULTS_SHOWN]]
        raise invalid_fields(places, "is no vertex: a certificate proves distances of vertices")


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
