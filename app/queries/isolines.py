"""Lines of equal distance."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import Answer
from app.queries.accuracy import (
    bound_of,
    solve_field,
    stats_of,
    with_default_accuracy,
)
from app.queries.base import ExecutionContext
from app.queries.cost_model import PER_FACE_CROSSED, faces_crossed, sweep_seconds
from app.queries.from_sources import FromSources
from app.queries.lines import (
    OFFERS,
    VALUES_OF_LINE_POINT,
    describe_line,
    resolved_chord_error,
)
from app.queries.points import (
    SurfacePoints,
    describe_source,
    to_sources,
)
from app.queries.validation import (
    check_count,
    check_json_size,
    invalid_fields,
    naming,
)
from app.queries.views import lines_of
from app.schemas.requests import IsolinesRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

_VALUES_OF_LEVEL = 1
"""Values in JSON of a level itself."""


class IsolinesQuery(FromSources[IsolinesRequest]):
    """The points at some distances from ``sources``, as polylines."""

    kind = "isolines"
    model = IsolinesRequest
    offers = OFFERS
    hint = "ask for fewer levels at once, or for a larger chord_error"

    @classmethod
    def normalized(cls, request: IsolinesRequest) -> IsolinesRequest:
        """Name the error; refuse levels and count together, or neither."""
        if request.levels is None and request.count is None:
            raise invalid_fields(["/levels"], "give levels, or count for evenly spaced levels")
        if request.levels is not None and request.count is not None:
            raise invalid_fields(["/count"], "does not go with levels")
        return with_default_accuracy(request)

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many sources or levels."""
        super().check_limits(settings)
        check_count("levels", self._level_count, settings, "max_levels")

    def rough_seconds(self) -> float:
        """Return the cost of two sweeps to the limit, and of the lines."""
        request = self.request
        sweep = sweep_seconds(self.size.faces, request, self.share)
        crossed = faces_crossed(self.size.faces, self._level_count, self.share)
        return 2 * sweep + PER_FACE_CROSSED * crossed

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep, then draw level by level, as long as the lines fit into the answer."""
        opened.mesh.require_positions("an isoline")
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
        found: list[dict[str, Any]] = []
        values = 0
        levels = self._levels(field.distances)
        drawn = field.each_isoline(levels, chord_error, **context.part(1, 2).options)
        for level, lines in zip(levels, drawn, strict=True):
            values += _VALUES_OF_LEVEL
            values += VALUES_OF_LINE_POINT * sum(len(line.points) for line in lines)
            check_json_size(values, context.max_values, self.hint)
            found.append(describe_level(level, lines))
        members = self.members(
            opened,
            method=self.request.method,
            error_bound=bound_of(field.error_bound),
            chord_error=chord_error,
            sources=[describe_source(opened.mesh, start) for start in starts],
            isolines=found,
            stats=stats_of(field.stats),
        )
        return Answer(members, shown=("isolines",), lines=lambda: lines_of(found))

    @property
    def _level_count(self) -> int:
        request = self.request
        return len(request.levels) if request.levels is not None else request.count or 0

    def _levels(self, distances: NDArray[np.float64]) -> list[float]:
        """Return the levels of the request; refuse to space some where only sources are reached."""
        request = self.request
        if request.levels is not None:
            return request.levels
        with naming((gc.errors.InvalidArgument, "/count")):
            levels = gc.spaced_levels(distances, self._level_count)
        return [float(level) for level in levels]


def describe_level(level: float, lines: Sequence[gc.Isoline]) -> dict[str, Any]:
    """Return the members of a level."""
    return {"level": level, "lines": [describe_line(line) for line in lines]}
