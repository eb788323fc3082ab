"""The geodesically nearest of some candidates."""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from app.encoding import CSV, JSON, Answer
from app.queries.accuracy import CERTAIN
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_POINT, share_reached, sweep_seconds
from app.queries.points import (
    SurfacePoints,
    components_of,
    count_unreachable,
    describe_point,
    numbered,
)
from app.queries.validation import WrittenPoints, invalid_fields
from app.queries.views import table_of_points
from app.schemas.requests import Accuracy, NearestRequest
from app.store.meshes import OpenMesh


class NearestQuery(Query[NearestRequest]):
    """The ``k`` candidates that are geodesically nearest to a point."""

    kind = "nearest"
    model = NearestRequest
    offers: Sequence[str] = (JSON, CSV)
    hint = "ask for a smaller k"

    @classmethod
    def normalized(cls, request: NearestRequest) -> NearestRequest:
        """Refuse to find more candidates than there are."""
        k, count = request.k, len(request.candidates)
        if k > count:
            message = f"k is {k}; it must be an integer from 1 to the number of candidates, {count}"
            raise invalid_fields(["/k"], message)
        return request

    def value_count(self) -> int:
        """Return the number of values of ``k`` candidates."""
        return (VALUES_OF_POINT + 1) * self.request.k

    def written_points(self) -> WrittenPoints:
        """Yield the source, then the candidates."""
        request = self.request
        return chain([("/source", request.source)], numbered("/candidates", request.candidates))

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit."""
        share = share_reached(self.size, 1, self.request.max_distance)
        sweep = sweep_seconds(self.size.faces, Accuracy(), share)
        return sweep + PER_POINT * len(self.request.candidates)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep to the k-th nearest."""
        source, *candidates = points
        mesh, request = opened.mesh, self.request
        nearest = opened.solver.nearest(
            source, candidates, request.k, request.max_distance, **context.options
        )
        indices, distances = nearest.indices, nearest.distances
        found = [
            {"candidate": i, "distance": distance, **describe_point(mesh, candidates[i])}
            for i, distance in zip(indices.tolist(), distances.tolist(), strict=True)
        ]
        members = self.members(
            opened,
            method="exact",
            error_bound=CERTAIN,
            source=describe_point(mesh, source),
            nearest=found,
        )
        if len(indices) < request.k:
            missed = np.ones(len(candidates), bool)
            missed[indices] = False
            connected = components_of(mesh, candidates) == components_of(mesh, [source])[0]
            members["unreachable"] = count_unreachable(missed, connected)
        return Answer(members, shown=("nearest",), table=table_of_points("candidate", found))
