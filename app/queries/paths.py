"""Shortest paths from one point to many, from one sweep."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import geodesic_core as gc
from app import schemas
from app.encoding import JSON, Answer
from app.mesh_store import OpenMesh
from app.points import described
from app.queries.accuracy import method_of, solve_field, with_its_error
from app.queries.costs import (
    PER_PATH,
    PER_POINT,
    Cost,
    share_within,
    straight_between,
    sweep_cost,
    typical_edge,
)
from app.queries.outline import likely_outline, no_outline, outline_of
from app.queries.places import Places, look_up
from app.queries.query import VALUES_OF_POINT, Grant, Likely, Query, numbered
from app.queries.refusals import MeshSize, Named, refuse_large_json
from app.queries.stats import likely_stats, stats_of

_TRIED = 64
"""Targets to which a straight path is laid for an estimate, about."""


class PathsQuery(Query[schemas.PathsRequest]):
    """The shortest paths from a point to each of some targets."""

    model = schemas.PathsRequest
    offers: Sequence[str] = (JSON,)
    hint = "ask for fewer targets at once"

    @classmethod
    def normal(cls, request: schemas.PathsRequest) -> schemas.PathsRequest:
        """Name the error that is granted."""
        return with_its_error(request)

    def value_count(self, size: MeshSize) -> int:
        """Return the least number of values: the ends of the paths."""
        return VALUES_OF_POINT * len(self.request.targets)

    def points(self) -> Named:
        """Yield the source, then the targets."""
        return chain([("/source", self.request.source)], numbered("targets", self.request.targets))

    def solve(self, opened: OpenMesh, places: Places, grant: Grant) -> Answer:
        """Sweep once, and trace path after path, as long as they fit into the answer."""
        source, *targets = places
        field = solve_field(
            opened.solver,
            self.request,
            source,
            max_distance=self.request.max_distance,
            targets=targets,
            keep_windows=True,
            **grant.options,
        )
        found: list[dict[str, Any]] = []
        values = 0
        for target in targets:
            look_up(grant.cancel)
            try:
                path = field.path_to(target)
            except gc.errors.NoPath as error:
                found.append(no_outline(error.reason))
                continue
            values += VALUES_OF_POINT * len(path.points)
            refuse_large_json(values, grant.max_values, self.hint)
            found.append(outline_of(path))
        return self._answer(opened, places, found, stats_of(field.stats))

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what a sweep and as many paths cost; those lead straight to their targets."""
        mesh, limit = opened.mesh, self.request.max_distance
        source, *targets = places
        share = 1.0 if limit is None else float(share_within(mesh, limit))
        sweep = sweep_cost(mesh, self.request, share, keeps=True)
        seconds = sweep.seconds + (PER_PATH + PER_POINT) * len(targets)
        some = targets[:: 1 + len(targets) // _TRIED]
        start, edge = mesh.position(source), typical_edge(mesh)
        lengths = straight_between(mesh, [source], some, limit)[0].tolist()
        found = [
            likely_outline(mesh, start, mesh.position(target), length, edge)
            for target, length in zip(some, lengths, strict=True)
        ]
        answer = self._answer(opened, [source, *some], found, likely_stats(mesh, share))
        return Likely(Cost(seconds, sweep.memory_bytes), answer, len(targets) / len(some))

    def _answer(
        self,
        opened: OpenMesh,
        places: Places,
        found: Sequence[Mapping[str, Any]],
        stats: Mapping[str, Any],
    ) -> Answer:
        source, *targets = (described(opened.mesh, place) for place in places)
        paths = [{"target": target, **path} for target, path in zip(targets, found, strict=True)]
        return Answer(
            {
                "mesh_id": self.mesh_id,
                **method_of(self.request),
                "source": source,
                "paths": paths,
                "stats": stats,
                "warnings": opened.warnings,
            }
        )
