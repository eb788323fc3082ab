"""Shortest paths from one point to many, from one sweep."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, GEOJSON, JSON, OBJ, SVG, Answer
from app.queries.accuracy import method_of, solve_field, topics_of, with_its_error
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Likely, Query, numbered
from app.queries.cost_model import (
    PER_PATH,
    PER_POINT,
    Cost,
    rough_share,
    share_within,
    straight_to_nearest,
    sweep_cost,
    typical_edge,
)
from app.queries.outline import likely_outline, no_outline, outline_of
from app.queries.places import Places, checkpoint, positions_of
from app.queries.points import described, described_origin
from app.queries.sources import named_origin, origin_of, point_count
from app.queries.stats import likely_stats, stats_of
from app.queries.validation import MeshSize, Named, refuse_large_json, refuse_more
from app.queries.views import line_of
from app.schemas.requests import PathsRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

_TRIED = 64
"""Targets to which a straight path is laid for an estimate, about."""


class PathsQuery(Query[PathsRequest]):
    """The shortest paths from a point to each of some targets."""

    kind = "paths"
    model = PathsRequest
    offers: Sequence[str] = (JSON, OBJ, CSV, SVG, GEOJSON)
    hint = "ask for fewer targets at once"

    @classmethod
    def normal(cls, request: PathsRequest) -> PathsRequest:
        """Name the error that is granted."""
        return with_its_error(request)

    def value_count(self, size: MeshSize) -> int:
        """Return the least number of values: the ends of the paths."""
        return VALUES_OF_POINT * len(self.request.targets)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of these sources, and the mesh."""
        return topics_of(self, [self.request.source])

    def points(self) -> Named:
        """Yield the source, then the targets."""
        request = self.request
        return chain(named_origin("/source", request.source), numbered("/targets", request.targets))

    def refuse(self, settings: Settings) -> None:
        """Refuse too many points of a curve."""
        refuse_more("sources", point_count(self.request.source), settings, "max_sources")

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a sweep to the limit, and of the paths."""
        request = self.request
        share = rough_share(size, point_count(request.source), request.max_distance)
        sweep = sweep_cost(size.faces, request, share, paths=True)
        return sweep.seconds + (PER_PATH + PER_POINT) * len(request.targets)

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Sweep once, and trace path after path, as long as they fit into the answer."""
        starts, targets = self._parted(places)
        origin = origin_of(opened.mesh, "/source", self.request.source, starts)
        field = solve_field(
            opened,
            self.request,
            [gc.Source(origin)],
            grant,
            max_distance=self.request.max_distance,
            targets=targets,
        )
        found: list[dict[str, Any]] = []
        values = 0
        for target in targets:
            checkpoint(grant.cancel)
            try:
                path = field.path_to(target)
            except gc.errors.NoPath as error:
                found.append(no_outline(error.reason))
                continue
            values += VALUES_OF_POINT * len(path.points)
            refuse_large_json(values, grant.max_values, self.hint)
            found.append(outline_of(path))
        return self._answer(opened, origin, targets, found, stats_of(field.stats))

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what a sweep and as many paths cost; those lead straight to their targets."""
        mesh, limit = opened.mesh, self.request.max_distance
        starts, targets = self._parted(places)
        origin = origin_of(mesh, "/source", self.request.source, starts)
        share = 1.0 if limit is None else float(share_within(mesh, limit))
        sweep = sweep_cost(len(mesh.faces), self.request, share, paths=True)
        seconds = sweep.seconds + (PER_PATH + PER_POINT) * len(targets)
        some = targets[:: 1 + len(targets) // _TRIED]
        edge = typical_edge(mesh)
        lengths, nearest = straight_to_nearest(mesh, starts, some, limit)
        ends = positions_of(mesh, starts)[nearest], positions_of(mesh, some)
        found = [
            likely_outline(mesh, start, end, length, edge)
            for start, end, length in zip(*ends, lengths.tolist(), strict=True)
        ]
        answer = self._answer(opened, origin, some, found, likely_stats(mesh, share))
        return Likely(Cost(seconds, sweep.memory_bytes), answer, len(targets) / len(some))

    def _parted(self, places: Places) -> tuple[Places, Places]:
        """Return the points of the source, and the targets."""
        count = point_count(self.request.source)
        return places[:count], places[count:]

    def _answer(
        self,
        opened: OpenMesh,
        origin: gc.SurfacePoint | gc.Curve,
        targets: Places,
        found: Sequence[Mapping[str, Any]],
        stats: Mapping[str, Any],
    ) -> Answer:
        mesh = opened.mesh
        paths = [
            {"target": described(mesh, target), **path}
            for target, path in zip(targets, found, strict=True)
        ]
        return Answer(
            {
                "mesh_id": self.mesh_id,
                **method_of(self.request),
                "source": described_origin(mesh, origin),
                "paths": paths,
                "stats": stats,
                "warnings": opened.warnings,
            },
            shown=("paths",),
            lines=lambda: [line_of(path, i) for i, path in enumerate(found)],
        )
