"""The mean of points on the surface."""

import geodesic_core as gc
from app.encoding import JSON, Answer
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_POINT, SWEEPS_OF_MEAN, sweep_seconds
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import WrittenPoints, check_count, invalid_fields, naming
from app.schemas.requests import Accuracy, MeanRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class MeanQuery(Query[MeanRequest]):
    """The point whose squared distances from ``points`` sum to the least."""

    kind = "mean"
    model = MeanRequest
    offers = (JSON,)
    hint = "ask for fewer points"

    @classmethod
    def normalized(cls, request: MeanRequest) -> MeanRequest:
        """Refuse weights of another number, and weights that are all 0."""
        weights, count = request.weights, len(request.points)
        if weights is not None and len(weights) != count:
            raise invalid_fields(["/weights"], f"give one for each of {count} points")
        if weights is not None and not any(weights):
            raise invalid_fields(["/weights"], "one must be above 0")
        return request

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many points."""
        check_count("points", len(self.request.points), settings, "max_sources")

    def value_count(self) -> int:
        """Return the number of values of the points."""
        return VALUES_OF_POINT * len(self.request.points)

    def written_points(self) -> WrittenPoints:
        """Yield the points."""
        return numbered("/points", self.request.points)

    def rough_seconds(self) -> float:
        """Return the cost of a sweep from each point, and of the search."""
        count = len(self.request.points)
        sweep = sweep_seconds(self.size.faces, Accuracy(), 1.0)
        return (count + SWEEPS_OF_MEAN) * sweep + count * PER_POINT

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Search from the best vertex on."""
        mesh = opened.mesh
        try:
            with naming((gc.errors.NoTangentPlane, "/points")):
                found = gc.mean_point(mesh, points, self.request.weights, **context.options)
        except gc.errors.NoPath as error:
            raise invalid_fields(["/points"], str(error)) from None
        members = self.members(
            opened,
            points=[describe_point(mesh, point) for point in points],
            mean=describe_point(mesh, found.point),
            variance=found.variance,
            converged=found.converged,
            moves=found.moves,
        )
        return Answer(members, shown=("mean", "variance"))
