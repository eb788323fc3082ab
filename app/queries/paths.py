"""Shortest paths from one point to many, from one sweep."""

from itertools import chain
from typing import Any

import geodesic_core as gc
from app.encoding import Answer
from app.queries.accuracy import (
    affinity_keys_of,
    stats_of,
    with_default_accuracy,
)
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_PATH, PER_POINT, share_reached, sweep_seconds
from app.queries.costs import CHEAPEST, check_alone, sweeps_of
from app.queries.from_sources import solve_either
from app.queries.lines import OFFERS
from app.queries.outline import no_outline, outline_of
from app.queries.points import (
    SurfacePoints,
    checkpoint,
    describe_point,
    describe_point_or_curve,
    numbered,
    point_count,
    points_in,
    to_point_or_curve,
)
from app.queries.validation import WrittenPoints, check_count, check_json_size
from app.queries.views import line_of
from app.schemas.requests import PathsRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class PathsQuery(Query[PathsRequest]):
    """The shortest or cheapest paths from a point to each of some targets."""

    kind = "paths"
    model = PathsRequest
    offers = OFFERS
    hint = "ask for fewer targets at once"

    @classmethod
    def normalized(cls, request: PathsRequest) -> PathsRequest:
        """Name error or effort; refuse what does not go with costs."""
        if request.cost is not None:
            check_alone(request)
        return with_default_accuracy(request)

    def value_count(self) -> int:
        """Return the least number of values: those of the ends of the paths."""
        return VALUES_OF_POINT * len(self.request.targets)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of these sources, and the mesh."""
        return affinity_keys_of(self, [self.request.source])

    def written_points(self) -> WrittenPoints:
        """Yield the source, then the targets."""
        request = self.request
        return chain(points_in("/source", request.source), numbered("/targets", request.targets))

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many points of a curve."""
        check_count("sources", point_count(self.request.source), settings, "max_sources")

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit, and of the paths."""
        request = self.request
        share = share_reached(self.size, point_count(request.source), request.max_distance)
        sweep = sweeps_of(request.cost) * sweep_seconds(self.size.faces, request, share)
        return sweep + (PER_PATH + PER_POINT) * len(request.targets)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep once, then trace path by path, as long as they fit into the answer."""
        request = self.request
        count = point_count(request.source)
        starts, targets = points[:count], points[count:]
        start = to_point_or_curve(opened.mesh, "/source", request.source, starts)
        field = solve_either(opened, request, [gc.Source(start)], context, targets)
        found: list[dict[str, Any]] = []
        values = 0
        for target in targets:
            checkpoint(context.cancel)
            try:
                path = field.path_to(target)
            except gc.errors.NoPath as error:
                cost = {} if request.cost is None else {"cost": None}
                found.append(no_outline(error.reason, field.error_bound) | cost)
                continue
            values += VALUES_OF_POINT * len(path.locations)
            check_json_size(values, context.max_values, self.hint)
            found.append(outline_of(path))
        paths = [
            {"target": describe_point(opened.mesh, target), **path}
            for target, path in zip(targets, found, strict=True)
        ]
        members = self.members(
            opened,
            method=request.method if request.cost is None else CHEAPEST,
            source=describe_point_or_curve(opened.mesh, start),
            paths=paths,
            stats=stats_of(field.stats),
        )
        return Answer(
            members,
            shown=("paths",),
            lines=lambda: [line_of(path, i) for i, path in enumerate(found)],
        )
