"""The shortest path between two points."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, NPZ, OBJ, OCTETS, Answer
from app.errors import Fault, ProblemError, pointer
from app.queries import point_text
from app.queries.accuracy import bound_of, options_of, solve_field, with_default_accuracy
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_FACE_CERTIFIED, search_seconds, share_reached, sweep_seconds
from app.queries.costs import CHEAPEST, ROUGHLY, check_alone, library_cost, naming_cost, sweeps_of
from app.queries.outline import SHOWN, no_outline, outline_of
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.proofs import check_proof_format, told
from app.queries.validation import (
    WrittenPoints,
    check_count,
    detail_of,
    invalid_fields,
    invalid_points,
)
from app.queries.views import line_of
from app.schemas.points import Point
from app.schemas.requests import EFFORT_OF_PATHS, PathParameters, PathRequest, SurfaceCost
from app.settings import Settings
from app.store.meshes import OpenMesh

_BEYOND = 1e-9
"""Share of the length by which a proof looks beyond it: distances round differently"""


class PathQuery(Query[PathRequest]):
    """The shortest path between two points, past ``waypoints`` in their order."""

    kind = "path"
    model = PathRequest

    @property
    def offers(self) -> Sequence[str]:
        """The media types of the answer: a proof is one as well."""
        return (JSON, NPY, OCTETS, OBJ, CSV, *([NPZ] if self.request.certify else []))

    @classmethod
    def normalized(cls, request: PathRequest) -> PathRequest:
        """Name error or effort; refuse what does not go together."""
        if request.cost is not None:
            check_alone(request, "certify", "waypoints")
            if request.cost.direction != "from":
                raise invalid_fields(["/cost/direction"], "a path has one: exchange its ends")
        if request.certify and request.method != "exact":
            raise invalid_fields(["/certify"], "goes with method 'exact' only")
        if request.certify and request.waypoints:
            raise invalid_fields(
                ["/certify"], "a path past waypoints has no certificate: ask for each leg's"
            )
        if request.method == "approximate" and request.waypoints:
            raise invalid_fields(["/waypoints"], "goes with methods 'exact' and 'fast' only")
        if request.method == "fast" and request.effort is None:
            request = request.model_copy(update={"effort": EFFORT_OF_PATHS})
        return with_default_accuracy(request)

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many waypoints."""
        check_count("waypoints", len(self.request.waypoints), settings, "max_waypoints")

    def check_format(self, media_type: str) -> None:
        """Refuse a proof that is rounded."""
        check_proof_format(media_type, self.representation)

    def written_points(self) -> WrittenPoints:
        """Yield the source, the target, then the waypoints."""
        ends = ("/source", self.request.source), ("/target", self.request.target)
        return chain(ends, numbered("/waypoints", self.request.waypoints))

    def rough_seconds(self) -> float:
        """Return the cost of a search for each leg, or of a sweep."""
        request = self.request
        if request.cost is not None:
            return sweeps_of(request.cost) * sweep_seconds(self.size.faces, request, 1.0)
        if request.method == "approximate":
            share = share_reached(self.size, 1, request.max_distance)
            return sweep_seconds(self.size.faces, request, share)
        proof = PER_FACE_CERTIFIED * self.size.faces if request.certify else 0.0
        return search_seconds(self.size.faces, 1 + len(request.waypoints)) + proof

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Search for an exact or a fast path, or sweep for an approximate one."""
        request = self.request
        source, target, *waypoints = points
        if request.certify and source.vertex_index is None and target.vertex_index is None:
            message = "one end must be a vertex: a certificate proves distances of vertices"
            raise invalid_fields(["/source", "/target"], message)
        searching = context.part(0, 2) if request.certify else context
        if request.cost is not None:
            return self._cheapest(opened, points, request.cost, context)
        try:
            if request.method == "approximate":
                start = [gc.Source(source)]
                field = solve_field(
                    opened,
                    request,
                    start,
                    context,
                    max_distance=request.max_distance,
                    targets=[target],
                )
                path = field.path_to(target, **context.options)
            else:
                path = opened.solver.shortest_path(
                    source,
                    target,
                    waypoints,
                    request.max_distance,
                    **options_of(request),
                    **searching.options,
                )
        except gc.errors.NoPath as error:
            bound = gc.error_bound(opened.mesh, **options_of(request))
            nothing = self._answer(opened, points, no_outline(error.reason, bound))
            return replace(nothing, named={} if request.certify else None)
        outline, proof = outline_of(path), None
        if request.certify:
            proof, proved = _proved(opened, path.length, source, target, context.part(1, 2))
            outline |= proved
        answer = self._answer(opened, points, outline)
        values = VALUES_OF_POINT * len(path.locations)
        return replace(answer, values=values, array=lambda: path.points, named=proof)

    def _cheapest(
        self, opened: OpenMesh, points: SurfacePoints, cost: SurfaceCost, context: ExecutionContext
    ) -> Answer:
        """Return the answer where ways cost."""
        source, target = points
        given = library_cost(cost)
        try:
            with naming_cost():
                path = opened.solver.cheapest_path(
                    source, target, given, cost.max_cost, detail=cost.detail, **context.options
                )
        except gc.errors.NoPath as error:
            return self._answer(opened, points, no_outline(error.reason, ROUGHLY) | {"cost": None})
        answer = self._answer(opened, points, outline_of(path))
        values = VALUES_OF_POINT * len(path.locations)
        return replace(answer, values=values, array=lambda: path.points)

    def _answer(self, opened: OpenMesh, points: SurfacePoints, found: dict[str, Any]) -> Answer:
        source, target, *waypoints = (describe_point(opened.mesh, point) for point in points)
        members = self.members(
            opened,
            method=self.request.method if self.request.cost is None else CHEAPEST,
            source=source,
            target=target,
            waypoints=waypoints,
        )
        return Answer(members | found, ("points",), SHOWN, lines=lambda: [line_of(found)])


def _proved(
    opened: OpenMesh,
    length: float,
    source: gc.SurfacePoint,
    target: gc.SurfacePoint,
    context: ExecutionContext,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what proves the length of a shortest path, and the members that tell of it.

    It is a proof of distances from the source, or from the target where that is no vertex.
    """
    start, end = (target, source) if target.vertex_index is None else (source, target)
    limit = length * (1.0 + _BEYOND)
    sweep, proof = context.part(0, 2).options, context.part(1, 2).options
    field = opened.solver.exact_distance(start, limit, retain="distances", **sweep)
    certificate = field.certify(**proof)
    lower, upper = (
        float(bounds[end.vertex_index]) for bounds in (certificate.lower, certificate.upper)
    )
    bound = gc.ErrorBound("absolute", max(upper - length, length - lower), "certified")
    gap = (upper - lower) / upper if upper > 0.0 else 0.0
    return certificate.arrays, {"error_bound": bound_of(bound), **told(certificate, gap)}


# As a GET


def written_request(parameters: PathParameters) -> PathRequest:
    """Return the body of the ``POST`` that is equivalent to the parameters of a ``GET``."""
    return PathRequest(
        source=_parsed("/source", parameters.source),
        target=_parsed("/target", parameters.target),
        waypoints=[_parsed(pointer("waypoints", i), text) for i, text in enumerate(parameters.via)],
        method=parameters.method,
    )


@contextmanager
def naming_parameters() -> Iterator[None]:
    """Rename members of the body to parameters of a ``GET`` in the problems raised inside."""
    try:
        yield
    except ProblemError as error:
        faults = [Fault(_in_query(fault.pointer), fault.message) for fault in error.problem.errors]
        if not faults:
            raise
        raise ProblemError(
            replace(error.problem, detail=detail_of(faults), errors=tuple(faults))
        ) from None


def _parsed(where: str, text: str) -> Point:
    try:
        return point_text.parse(text)
    except ValueError as error:
        raise invalid_points([Fault(where, str(error))]) from None


def _in_query(where: str) -> str:
    """Return the parameter of a ``GET`` for a pointer into the body of a ``POST``."""
    _, name, *members = where.split("/")
    if name == "query":
        return where
    number = members[:1] if name == "waypoints" else []
    return pointer("query", _PARAMETERS.get(name, name), *number)


_PARAMETERS = {"source": "from", "target": "to", "waypoints": "via"}
