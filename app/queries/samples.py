"""Points spread over the surface."""

import math
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, JSON, Answer, Indices
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import (
    PER_POINT,
    PER_SWEEP,
    SWEEPS_OF_ITERATION,
    SWEEPS_OF_SAMPLES,
    sweep_seconds,
)
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import (
    WrittenPoints,
    check_count,
    check_json_size,
    invalid_fields,
    naming,
)
from app.queries.views import table_of_points
from app.schemas.points import BareVertex
from app.schemas.requests import Accuracy, SamplesRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class SamplesQuery(Query[SamplesRequest]):
    """Farthest points, relaxed if asked for."""

    kind = "samples"
    model = SamplesRequest
    offers = JSON, CSV
    hint = "ask for fewer points, or for CSV"

    @classmethod
    def normalized(cls, request: SamplesRequest) -> SamplesRequest:
        """Refuse a request that does not say how many points there shall be."""
        if request.count is None and request.radius is None:
            raise invalid_fields(["/count", "/radius"], "give at least one of the two")
        if not request.starts:
            return request.model_copy(update={"starts": [BareVertex(vertex=0)]})
        return request

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many points."""
        count = max(self.request.count or 0, len(self.request.starts))
        check_count("points", count, settings, "max_sources")

    def value_count(self) -> int:
        """Return the number of values that are known before."""
        points = VALUES_OF_POINT * (self.request.count or 1)
        return points + 2 * self.size.vertices * ("distances" in self.request.include)

    def written_points(self) -> WrittenPoints:
        """Yield the starts."""
        return numbered("/starts", self.request.starts)

    def rough_seconds(self) -> float:
        """Return the cost of all sweeps."""
        count = self.request.count or self.size.vertices
        sweeps = min(SWEEPS_OF_SAMPLES, count) + SWEEPS_OF_ITERATION * self.request.iterations
        sweep = sweep_seconds(self.size.faces, Accuracy(), 1.0)
        return sweeps * sweep + count * (PER_SWEEP + PER_POINT)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Add points one by one, then move them."""
        request, mesh = self.request, opened.mesh
        parts = 2 if request.iterations else 1
        with naming((gc.errors.InvalidArgument, "/count")):
            spread = gc.farthest_points(
                mesh, request.count, request.radius, points, **context.part(0, parts).options
            )
        check_json_size(VALUES_OF_POINT * len(spread), context.max_values, self.hint)
        found, distances, nearest = spread.points, spread.distances, spread.nearest
        moved: dict[str, Any] = {"costs": [], "converged": None}
        if request.iterations:
            with naming((gc.errors.NoTangentPlane, "/starts")):
                relaxed = gc.relax_points(
                    mesh, found, request.iterations, **context.part(1, parts).options
                )
            found, distances, nearest = relaxed.points, relaxed.distances, relaxed.nearest
            moved = {"costs": relaxed.costs.tolist(), "converged": relaxed.converged}
        on_surface = mesh.faces[mesh.face_areas > 0.0]
        reach = float(distances[on_surface].max(initial=0.0))
        described = [describe_point(mesh, point) for point in found]
        members = self.members(
            opened,
            points=described,
            radii=[radius if math.isfinite(radius) else None for radius in spread.radius.tolist()],
            covering_radius=reach if math.isfinite(reach) else None,
            **moved,
        )
        large: tuple[str, ...] = ()
        if "distances" in request.include:
            large = "distances", "nearest"
            members |= {"distances": distances, "nearest": Indices(nearest)}
        return Answer(members, large, ("points",), table=table_of_points("point", described))
