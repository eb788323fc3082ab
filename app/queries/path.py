"""The shortest path between two points."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, OBJ, OCTETS, Answer
from app.errors import Fault, ProblemError, pointer
from app.queries import point_text
from app.queries.accuracy import options_of, solve_field, with_default_accuracy
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import search_seconds, share_reached, sweep_seconds
from app.queries.outline import SHOWN, no_outline, outline_of
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import (
    WrittenPoints,
    check_count,
    detail_of,
    invalid_fields,
    invalid_points,
)
from app.queries.views import line_of
from app.schemas.points import Point
from app.schemas.requests import EFFORT_OF_PATHS, PathParameters, PathRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class PathQuery(Query[PathRequest]):
    """The shortest path between two points, past ``waypoints`` in their order."""

    kind = "path"
    model = PathRequest
    offers: Sequence[str] = (JSON, NPY, OCTETS, OBJ, CSV)

    @classmethod
    def normalized(cls, request: PathRequest) -> PathRequest:
        """Name error or effort; refuse waypoints where the path is approximate."""
        if request.method == "approximate" and request.waypoints:
            raise invalid_fields(["/waypoints"], "goes with methods 'exact' and 'fast' only")
        if request.method == "fast" and request.effort is None:
            request = request.model_copy(update={"effort": EFFORT_OF_PATHS})
        return with_default_accuracy(request)

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many waypoints."""
        check_count("waypoints", len(self.request.waypoints), settings, "max_waypoints")

    def written_points(self) -> WrittenPoints:
        """Yield the source, the target, then the waypoints."""
        ends = ("/source", self.request.source), ("/target", self.request.target)
        return chain(ends, numbered("/waypoints", self.request.waypoints))

    def rough_seconds(self) -> float:
        """Return the cost of a search for each leg, or of a sweep."""
        request = self.request
        if request.method == "approximate":
            share = share_reached(self.size, 1, request.max_distance)
            return sweep_seconds(self.size.faces, request, share)
        return search_seconds(self.size.faces, 1 + len(request.waypoints))

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Search for an exact or a fast path, or sweep for an approximate one."""
        request = self.request
        source, target, *waypoints = points
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
                    **context.options,
                )
        except gc.errors.NoPath as error:
            bound = gc.error_bound(opened.mesh, **options_of(request))
            return self._answer(opened, points, no_outline(error.reason, bound))
        answer = self._answer(opened, points, outline_of(path))
        values = VALUES_OF_POINT * len(path.locations)
        return replace(answer, values=values, array=lambda: path.points)

    def _answer(self, opened: OpenMesh, points: SurfacePoints, found: dict[str, Any]) -> Answer:
        source, target, *waypoints = (describe_point(opened.mesh, point) for point in points)
        members = self.members(
            opened,
            method=self.request.method,
            source=source,
            target=target,
            waypoints=waypoints,
        )
        return Answer(members | found, ("points",), SHOWN, lines=lambda: [line_of(found)])


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
