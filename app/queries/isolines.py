"""Lines of equal distance, of equal cost, or of equal value."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import Answer
from app.errors import pointer
from app.queries.accuracy import (
    CERTAIN,
    bound_of,
    solve_field,
    stats_of,
    with_default_accuracy,
)
from app.queries.base import ExecutionContext
from app.queries.cost_model import (
    PER_FACE_CROSSED,
    PER_FACE_SCANNED,
    faces_crossed,
    sweep_seconds,
)
from app.queries.costs import CHEAPEST, check_alone, solve_costs, sweeps_of
from app.queries.from_sources import FromSources
from app.queries.lines import (
    OFFERS,
    are_located,
    count_values,
    describe_line,
    resolved_chord_error,
)
from app.queries.points import (
    SurfacePoints,
    checkpoint,
    describe_source,
    to_sources,
)
from app.queries.validation import (
    FAULTS_SHOWN,
    check_count,
    check_json_size,
    invalid_fields,
    naming,
)
from app.queries.views import lines_of
from app.schemas.requests import IsolinesRequest, SurfaceCost
from app.settings import Settings
from app.store.meshes import OpenMesh

_VALUES_OF_LEVEL = 1
"""Values in JSON of a level itself."""
_OF_DISTANCES = (
    "sources",
    "method",
    "relative_error",
    "absolute_error",
    "max_distance",
    "chord_error",
    "cost",
)
"""Members that do not go with values"""

Drawn = tuple[dict[str, Any], list[float], Iterable[Sequence[gc.SurfaceCurve]]]
"""Members of an answer, its levels, and the lines of each, drawn one level after the other"""


class IsolinesQuery(FromSources[IsolinesRequest]):
    """The points at some distances from ``sources``, or with some ``values``, as polylines."""

    kind = "isolines"
    model = IsolinesRequest
    offers = OFFERS
    hint = "ask for fewer levels at once, or for a larger chord_error"

    @classmethod
    def normalized(cls, request: IsolinesRequest) -> IsolinesRequest:
        """Name the error; refuse levels and count together, or neither; likewise what is drawn."""
        if request.levels is None and request.count is None:
            raise invalid_fields(["/levels"], "give levels, or count for evenly spaced levels")
        if request.levels is not None and request.count is not None:
            raise invalid_fields(["/count"], "does not go with levels")
        if request.values is not None:
            _refuse_members_of_distances(request)
            return request
        if not request.sources:
            are_missing = "sources" not in request.model_fields_set
            message = "give sources, or values" if are_missing else "give at least one source"
            raise invalid_fields(["/sources"], message)
        _refuse_levels_below_0(request)
        if request.cost is not None:
            check_alone(request, "chord_error")
        return with_default_accuracy(request)

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many sources or levels."""
        super().check_limits(settings)
        check_count("levels", self._level_count, settings, "max_levels")

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of the sources, if any, and the mesh."""
        return (self.mesh_id,) if self.request.values is not None else super().affinity_keys

    def rough_seconds(self) -> float:
        """Return the cost of two sweeps to the limit, or of a look at all values; and of lines."""
        request, faces = self.request, self.size.faces
        crossed = PER_FACE_CROSSED * faces_crossed(faces, self._level_count, self.share)
        if request.values is not None:
            return PER_FACE_SCANNED * faces * self._level_count + crossed
        sweeps = 2.0 if request.cost is None else sweeps_of(request.cost)
        return sweeps * sweep_seconds(faces, request, self.share) + crossed

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Draw level by level, as long as the lines fit into the answer."""
        request = self.request
        if request.values is not None:
            about, levels, drawn = self._of_values(opened, context)
        elif request.cost is not None:
            about, levels, drawn = self._of_costs(opened, points, request.cost, context)
        else:
            about, levels, drawn = self._of_distances(opened, points, context)
        located = are_located(opened.mesh, self.request)
        found: list[dict[str, Any]] = []
        values = 0
        for level, lines in zip(levels, drawn, strict=True):
            values += _VALUES_OF_LEVEL + count_values(lines, located=located)
            check_json_size(values, context.max_values, self.hint)
            described = [describe_line(line, located=located) for line in lines]
            found.append({"level": level, "lines": described})
        members = self.members(opened, **about, isolines=found)
        return Answer(members, shown=("isolines",), lines=lambda: lines_of(found, located=located))

    def _of_distances(
        self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext
    ) -> Drawn:
        """Sweep, and return the lines that a further sweep draws."""
        chord_error = resolved_chord_error(opened.mesh, self.request.chord_error)
        starts = to_sources(opened.mesh, self.request.sources, points)
        field = solve_field(
            opened,
            self.request,
            starts,
            context.part(0, 2),
            max_distance=self.request.max_distance,
            isolines=True,
        )
        levels = self._levels_within(field.distances)
        about = {
            "method": self.request.method,
            "error_bound": bound_of(field.error_bound),
            "chord_error": chord_error,
            "sources": [describe_source(opened.mesh, start) for start in starts],
            "stats": stats_of(field.stats),
        }
        drawn = field.each_isoline(levels, chord_error, **context.part(1, 2).options)
        return about, levels, drawn

    def _of_costs(
        self,
        opened: OpenMesh,
        points: SurfacePoints,
        cost: SurfaceCost,
        context: ExecutionContext,
    ) -> Drawn:
        """Sweep, and return the lines of the costs of vertices, which are straight in each face."""
        starts = to_sources(opened.mesh, self.request.sources, points)
        field = solve_costs(opened, cost, starts, context.part(0, 2))
        levels = self._levels_within(field.distances)
        about = {
            "method": CHEAPEST,
            "error_bound": bound_of(field.error_bound),
            "chord_error": 0.0,
            "sources": [describe_source(opened.mesh, start) for start in starts],
            "stats": {},
        }
        costs = gc.ScalarField(opened.mesh, field.distances)
        return about, levels, _straight_lines(costs, levels, context.part(1, 2))

    def _of_values(self, opened: OpenMesh, context: ExecutionContext) -> Drawn:
        """Return the lines of the values, which are straight in each face."""
        with naming((gc.errors.InvalidArgument, "/values")):
            field = gc.ScalarField(opened.mesh, np.array(self.request.values, np.float64))
        levels = self.request.levels
        if levels is None:
            with naming((gc.errors.InvalidArgument, "/count")):
                levels = field.levels(self._level_count).tolist()
        about = {
            "method": "exact",
            "error_bound": CERTAIN,
            "chord_error": 0.0,
            "sources": [],
            "stats": {},
        }
        return about, levels, _straight_lines(field, levels, context)

    def _levels_within(self, distances: NDArray[np.float64]) -> list[float]:
        """Return the levels, or as many between 0 and the largest distance."""
        if self.request.levels is not None:
            return self.request.levels
        with naming((gc.errors.InvalidArgument, "/count")):
            levels: list[float] = gc.spaced_levels(distances, self._level_count).tolist()
        return levels

    @property
    def _level_count(self) -> int:
        request = self.request
        return len(request.levels) if request.levels is not None else request.count or 0


def _straight_lines(
    field: gc.ScalarField, levels: Sequence[float], context: ExecutionContext
) -> Iterator[Sequence[gc.SurfaceCurve]]:
    """Yield the lines of each level."""
    for i, level in enumerate(levels):
        checkpoint(context.cancel)
        yield field.isolines([level])[0]
        context.progress((i + 1) / len(levels))


def _refuse_members_of_distances(request: IsolinesRequest) -> None:
    fields = IsolinesRequest.model_fields
    wrong = [name for name in _OF_DISTANCES if getattr(request, name) != fields[name].default]
    if wrong:
        raise invalid_fields(list(map(pointer, wrong)), "does not go with values")


def _refuse_levels_below_0(request: IsolinesRequest) -> None:
    levels = enumerate(request.levels or ())
    wrong = [pointer("levels", i) for i, level in levels if level <= 0.0]
    if wrong:
        raise invalid_fields(wrong[:FAULTS_SHOWN], "a distance must be greater than 0")
