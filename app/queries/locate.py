"""Where positions are on the surface."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import geodesic_core as gc
from app.encoding import CSV, GEOJSON, JSON, Answer
from app.errors import Fault
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Likely, Query
from app.queries.cost_model import PER_POSITION, Cost
from app.queries.places import Places, checkpoint
from app.queries.points import described
from app.queries.validation import MeshSize, refuse_points
from app.queries.views import places_of, table_of_places
from app.schemas.requests import LocateRequest
from app.store.meshes import OpenMesh


class LocateQuery(Query[LocateRequest]):
    """The points of the surface nearest to positions, where they are near enough."""

    kind = "locate"
    model = LocateRequest
    offers: Sequence[str] = (JSON, CSV, GEOJSON)
    hint = "ask for fewer points at once"

    def value_count(self, size: MeshSize) -> int:
        """Return the number of values of all points."""
        return VALUES_OF_POINT * len(self.request.points)

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of looking for each point."""
        return PER_POSITION * len(self.request.points)

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Look for one position after the other."""
        found = []
        for i in range(len(self.request.points)):
            checkpoint(grant.cancel)
            found.append(self._located(opened.mesh, i))
        return self._answer(opened, found)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what it costs to look for all positions, each like the one farthest out."""
        points = self.request.points
        farthest = max(range(len(points)), key=lambda i: max(map(abs, points[i])))
        found = [self._located(opened.mesh, farthest)] * len(points)
        return Likely(Cost(PER_POSITION * len(points), 0), self._answer(opened, found))

    def _located(self, mesh: gc.TriangleMesh, i: int) -> Mapping[str, Any] | None:
        """Return what is nearest to a position; None where that is too far away."""
        position, limit = self.request.points[i], self.request.max_distance
        try:
            place = mesh.locate(position, limit)
        except gc.errors.InvalidPoint as error:
            if limit is None:  # it did not miss: its numbers are too large
                raise refuse_points([Fault(f"/points/{i}", str(error))]) from None
            return None
        told = described(mesh, place)
        away = float(np.linalg.norm(np.subtract(told["position"], position)))
        return {**told, "distance": away}

    def _answer(self, opened: OpenMesh, found: Sequence[Mapping[str, Any] | None]) -> Answer:
        return Answer(
            {"mesh_id": self.mesh_id, "points": found, "warnings": opened.warnings},
            shown=("points",),
            table=table_of_places("point", found),
            places=lambda: places_of("point", found),
        )
