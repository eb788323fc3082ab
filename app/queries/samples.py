"""Points spread over the surface."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, OCTETS, Answer, Indices
from app.errors import Fault, over_limit, problem
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import (
    PER_POINT,
    PER_SWEEP,
    SWEEPS_OF_ITERATION,
    SWEEPS_OF_SAMPLES,
    share_reached,
    sweep_seconds,
)
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import (
    WrittenPoints,
    check_count,
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
    offers = JSON, NPY, OCTETS, CSV

    @classmethod
    def normalized(cls, request: SamplesRequest) -> SamplesRequest:
        """Name each included array once; refuse a request that does not say how many points."""
        if request.count is None and request.radius is None:
            raise invalid_fields(["/count", "/radius"], "give at least one of the two")
        starts = request.starts or [BareVertex(vertex=0)]
        included = list(dict.fromkeys(request.include))
        return request.model_copy(update={"starts": starts, "include": included})

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many points."""
        count = max(self.request.count or 0, len(self.request.starts))
        check_count("points", count, settings, "max_sources")

    def check_format(self, media_type: str) -> None:
        """Refuse distances where there is a row for each point."""
        if self.request.include:
            fault = Fault("/include", "distances do not come with rows of points; ask for json")
            message = f"{media_type} holds the points alone"
            raise problem("invalid_request", message, errors=(fault,))

    def value_count(self) -> int:
        """Return the number of values that are known before."""
        points = VALUES_OF_POINT * (self.request.count or 1)
        return points + 2 * self.size.vertices * ("distances" in self.request.include)

    def written_points(self) -> WrittenPoints:
        """Yield the starts."""
        return numbered("/starts", self.request.starts)

    def rough_seconds(self) -> float:
        """Return the cost of all sweeps."""
        count = self._likely_count
        sweeps = min(SWEEPS_OF_SAMPLES, count) + SWEEPS_OF_ITERATION * self.request.iterations
        sweep = sweep_seconds(self.size.faces, Accuracy(), 1.0)
        return sweeps * sweep + count * (PER_SWEEP + PER_POINT)

    @property
    def _likely_count(self) -> float:
        """The number of points, about: discs of the radius cover the surface."""
        request = self.request
        count = float(min(request.count or self.size.vertices, self.size.vertices))
        if request.radius is None:
            return count
        share = share_reached(self.size, 1, request.radius)
        return min(count, 1.0 / share) if share > 0.0 else count

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Add points one by one, then move them."""
        request, mesh = self.request, opened.mesh
        parts = 2 if request.iterations else 1
        most = context.max_points
        count = request.count or most + 1  # one too many tells that there would be more
        with naming((gc.errors.InvalidArgument, "/count")):
            spread = gc.farthest_points(
                mesh, count, request.radius, points, **context.part(0, parts).options
            )
        if len(spread) > most:
            hint = "ask for a larger radius, or for a count"
            raise over_limit(
                "limit_exceeded", "points", len(spread), most, "max_sources", hint=hint
            )
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
        values = VALUES_OF_POINT * len(found)
        if "distances" in request.include:
            members |= {"distances": distances, "nearest": Indices(nearest)}
            values += 2 * len(distances)
        return Answer(
            members,
            ("points",),
            ("points",),
            values,
            table=table_of_points("point", described, None),
            array=lambda: rows_of(mesh, found),
        )


def rows_of(mesh: gc.TriangleMesh, points: SurfacePoints) -> NDArray[np.float64]:
    """Return position, face and weights of each point, (N, 7); positions that are none are NaN."""
    rows = np.full((len(points), 7), np.nan)
    for row, point in zip(rows, points, strict=True):
        if mesh.has_positions:
            row[:3] = mesh.position(point)
        row[3:] = point.face_index, *point.barycentric
    return rows
