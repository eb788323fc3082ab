"""The points of the surface that are nearest to positions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import geodesic_core as gc
from app.encoding import CSV, JSON, Answer
from app.errors import Fault
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_POSITION
from app.queries.points import SurfacePoints, checkpoint, describe_point
from app.queries.validation import invalid_points, naming
from app.queries.views import table_of_points
from app.schemas.requests import LocateRequest
from app.store.meshes import OpenMesh


class LocateQuery(Query[LocateRequest]):
    """The points of the surface nearest to positions, where they are near enough."""

    kind = "locate"
    model = LocateRequest
    offers: Sequence[str] = (JSON, CSV)
    hint = "ask for fewer points at once"

    def value_count(self) -> int:
        """Return the number of values of all points."""
        return VALUES_OF_POINT * len(self.request.points)

    def rough_seconds(self) -> float:
        """Return the cost of locating each position."""
        return PER_POSITION * len(self.request.points)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Locate one position after the other."""
        with naming((gc.errors.NotEmbedded, "/points")):
            opened.mesh.require_positions("locate")
        found = []
        for i in range(len(self.request.points)):
            checkpoint(context.cancel)
            found.append(self._located(opened.mesh, i))
        members = self.members(opened, points=found)
        return Answer(members, shown=("points",), table=table_of_points("point", found))

    def _located(self, mesh: gc.TriangleMesh, i: int) -> Mapping[str, Any] | None:
        """Return the point nearest to a position; None where it is beyond the limit."""
        position, limit = self.request.points[i], self.request.max_distance
        try:
            point = mesh.locate(position, limit)
        except gc.errors.InvalidPoint as error:
            if limit is None:  # not beyond a limit: its numbers are too large
                raise invalid_points([Fault(f"/points/{i}", str(error))]) from None
            return None
        members = describe_point(mesh, point)
        distance = float(np.linalg.norm(np.subtract(members["position"], position)))
        return {**members, "distance": distance}
