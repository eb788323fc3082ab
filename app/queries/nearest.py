"""The geodesically nearest of some candidates."""

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.encoding import CSV, GEOJSON, JSON, Answer
from app.queries.accuracy import CERTAIN
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Likely, Query, numbered
from app.queries.cost_model import (
    PER_POINT,
    Cost,
    rough_share,
    share_within,
    straight_between,
    sweeps_cost,
)
from app.queries.places import Places, components_of, unreachable
from app.queries.points import described
from app.queries.validation import MeshSize, Named, refuse_places
from app.queries.views import places_of, table_of_places
from app.schemas.requests import NearestRequest
from app.store.meshes import OpenMesh


class NearestQuery(Query[NearestRequest]):
    """The ``k`` candidates that are geodesically nearest to a point."""

    kind = "nearest"
    model = NearestRequest
    offers: Sequence[str] = (JSON, CSV, GEOJSON)
    hint = "ask for a smaller k"

    @classmethod
    def normal(cls, request: NearestRequest) -> NearestRequest:
        """Refuse to find more candidates than there are."""
        k, count = request.k, len(request.candidates)
        if k > count:
            message = f"k is {k}; it must be an integer from 1 to the number of candidates, {count}"
            raise refuse_places(["/k"], message)
        return request

    def value_count(self, size: MeshSize) -> int:
        """Return the number of values of those found."""
        return (VALUES_OF_POINT + 1) * self.request.k

    def points(self) -> Named:
        """Yield the source, then the candidates."""
        request = self.request
        return chain([("/source", request.source)], numbered("/candidates", request.candidates))

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a sweep to the limit."""
        share = rough_share(size, 1, self.request.max_distance)
        sweep = sweeps_cost(size.faces, [share], 1)
        return sweep.seconds + PER_POINT * len(self.request.candidates)

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Sweep to the k-th nearest."""
        source, *candidates = places
        request = self.request
        found = opened.solver.nearest(
            source, candidates, request.k, request.max_distance, **grant.options
        )
        return self._answer(opened, places, found.indices, found.distances)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what a sweep costs to the candidate that is k-th nearest along a straight line."""
        mesh, k = opened.mesh, self.request.k
        source, *candidates = places
        away = straight_between(mesh, [source], candidates, self.request.max_distance)[0]
        order = np.argsort(away, kind="stable")[:k]
        order = order[np.isfinite(away[order])]
        if len(order) == k:
            share = float(share_within(mesh, away[order[-1]]))
        elif self.request.max_distance is not None:
            share = float(share_within(mesh, self.request.max_distance))
        else:
            share = 1.0
        sweep = sweeps_cost(len(mesh.faces), [share], 1)
        cost = Cost(sweep.seconds + PER_POINT * len(places), sweep.memory_bytes)
        return Likely(cost, self._answer(opened, places, order, away[order]))

    def _answer(
        self,
        opened: OpenMesh,
        places: Places,
        indices: NDArray[Any],
        distances: NDArray[np.float64],
    ) -> Answer:
        mesh = opened.mesh
        source, *candidates = places
        found = [
            {"candidate": i, "distance": away, **described(mesh, candidates[i])}
            for i, away in zip(indices.tolist(), distances.tolist(), strict=True)
        ]
        members = {
            "mesh_id": self.mesh_id,
            "method": "exact",
            "exact": True,
            "error_bound": CERTAIN,
            "source": described(mesh, source),
            "nearest": found,
            "warnings": opened.warnings,
        }
        if len(indices) < self.request.k:
            missed = np.ones(len(candidates), bool)
            missed[indices] = False
            connected = components_of(mesh, candidates) == components_of(mesh, [source])[0]
            members["unreachable"] = unreachable(missed, connected)
        return Answer(
            members,
            shown=("nearest",),
            table=table_of_places("candidate", found),
            places=lambda: places_of("candidate", found),
        )
