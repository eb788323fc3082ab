"""The shortest path between two points."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np

import geodesic_core as gc
from app.encoding import CSV, GEOJSON, JSON, NPY, OBJ, OCTETS, SVG, Answer
from app.errors import Fault, ProblemError, pointer
from app.queries import point_text
from app.queries.accuracy import as_swept, method_of, solve_field, with_default_accuracy
from app.queries.base import ExecutionContext, Forecast, Query
from app.queries.cost_model import (
    PER_PATH,
    PER_POINT,
    Cost,
    rough_share,
    search_cost,
    share_within,
    sweep_cost,
    typical_edge,
)
from app.queries.outline import SHOWN, expected_outline, no_outline, outline_of
from app.queries.points import SurfacePoints, components_of, describe_point, numbered, positions_of
from app.queries.validation import (
    MeshSize,
    WrittenPoints,
    check_count,
    detail_of,
    invalid_fields,
    invalid_points,
)
from app.queries.views import line_of
from app.schemas.points import Point
from app.schemas.requests import AccuracyOrEffort, PathParameters, PathRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class PathQuery(Query[PathRequest]):
    """The shortest path between two points, past ``waypoints`` in their order."""

    kind = "path"
    model = PathRequest
    offers: Sequence[str] = (JSON, NPY, OCTETS, OBJ, CSV, SVG, GEOJSON)

    @classmethod
    def normalized(cls, request: PathRequest) -> PathRequest:
        """Name error or effort; refuse options of exact paths where the path is another."""
        request = with_default_accuracy(request)
        if request.method != "exact":
            options = {"/waypoints": request.waypoints, "/explain": request.explain}
            given = [pointer for pointer, value in options.items() if value]
            if given:
                raise invalid_fields(given, "goes with method 'exact' only")
        return request

    @property
    def is_repeatable(self) -> bool:
        """Whether the answer is the same in every run: an explained path states seconds."""
        return not self.request.explain

    @property
    def hint(self) -> str:
        """The remedy for an answer that is too large for JSON."""
        if self.request.explain:
            return "ask without explain, or with fewer waypoints at once"
        return super().hint

    def check_limits(self, size: MeshSize, settings: Settings) -> None:
        """Refuse too many waypoints."""
        check_count("waypoints", len(self.request.waypoints), settings, "max_waypoints")

    def written_points(self) -> WrittenPoints:
        """Yield the source, the target, then the waypoints."""
        ends = ("/source", self.request.source), ("/target", self.request.target)
        return chain(ends, numbered("/waypoints", self.request.waypoints))

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a search for each leg, or of a sweep."""
        request = self.request
        if request.method != "exact":
            share = rough_share(size, 1, request.max_distance)
            return sweep_cost(size.faces, request, share, paths=True).seconds
        return search_cost(size.faces, 1 + len(request.waypoints)).seconds

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Search for an exact path, or sweep for another one."""
        request = self.request
        source, target, *waypoints = points
        field: gc.DistanceField | None = None
        try:
            if request.method == "exact":
                path = opened.solver.shortest_path(
                    source,
                    target,
                    waypoints,
                    request.max_distance,
                    explain=request.explain,
                    **context.options,
                )
            else:
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
        except gc.errors.NoPath as error:
            return self._answer(opened, points, no_outline(error.reason, field))
        found = outline_of(path)
        values = 8 * len(path.points)
        if path.steps is not None:
            found["steps"] = path.steps
            values += sum(step.faces.size for step in path.steps)
        return self._answer(opened, points, found, values)

    def forecast(self, opened: OpenMesh, points: SurfacePoints) -> Forecast:
        """Return the cost of searches or of a sweep, and a path straight from stop to stop."""
        mesh, limit = opened.mesh, self.request.max_distance
        source, target, *waypoints = points
        if self.request.method == "exact":
            cost = search_cost(len(mesh.faces), len(points) - 1)
        else:
            share = 1.0 if limit is None else float(share_within(mesh, limit))
            cost = sweep_cost(len(mesh.faces), as_swept(self.request, mesh), share, paths=True)
        stops = positions_of(mesh, [source, *waypoints, target])
        length = sum(float(np.linalg.norm(there - here)) for here, there in pairwise(stops))
        is_beyond = limit is not None and length > limit
        if is_beyond or len(set(components_of(mesh, points).tolist())) > 1:
            length = math.inf
        found = expected_outline(mesh, stops[0], stops[-1], length, typical_edge(mesh))
        seconds = cost.seconds + PER_PATH + PER_POINT * len(points)
        return Forecast(Cost(seconds, cost.memory_bytes), self._answer(opened, points, found))

    def _answer(
        self, opened: OpenMesh, points: SurfacePoints, found: dict[str, Any], values: int = 0
    ) -> Answer:
        source, target, *waypoints = (describe_point(opened.mesh, point) for point in points)
        members = {
            "kind": self.kind,
            "mesh_id": self.mesh_id,
            **method_of(self.request),
            "source": source,
            "target": target,
            "waypoints": waypoints,
            "warnings": opened.warnings,
        }
        return Answer(members | found, ("points",), SHOWN, values, lines=lambda: [line_of(found)])


# As a GET


def written_request(parameters: PathParameters) -> PathRequest:
    """Return the body of the ``POST`` that is equivalent to the parameters of a ``GET``."""
    return PathRequest(
        source=_parsed("/source", parameters.source),
        target=_parsed("/target", parameters.target),
        waypoints=[_parsed(pointer("waypoints", i), text) for i, text in enumerate(parameters.via)],
        max_distance=parameters.max_distance,
        explain=parameters.explain,
        **parameters.model_dump(include=set(AccuracyOrEffort.model_fields)),
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
