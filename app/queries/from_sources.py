"""Queries for distances from the nearest of some sources: what they share."""

from collections.abc import Sequence
from typing import TypeVar

import geodesic_core as gc
from app.queries.accuracy import affinity_keys_of, solve_field
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import share_reached
from app.queries.costs import CostsAsDistances, solve_costs
from app.queries.points import point_count, points_in_sources
from app.queries.validation import WrittenPoints, check_count
from app.schemas.requests import (
    BordersRequest,
    CellsRequest,
    DistancesRequest,
    IsolinesRequest,
    PathsRequest,
)
from app.settings import Settings
from app.store.meshes import OpenMesh

R = TypeVar("R", bound=DistancesRequest | IsolinesRequest | BordersRequest | CellsRequest)


class FromSources(Query[R]):
    """A query with ``sources``, and a largest distance from them."""

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many sources."""
        check_count("sources", self.source_count, settings, "max_sources")

    @property
    def source_count(self) -> int:
        """The number of sources, points of curves counted one by one."""
        return point_count(*self.request.sources)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of these sources, and the mesh."""
        return affinity_keys_of(self, self.request.sources)

    def written_points(self) -> WrittenPoints:
        """Yield the sources."""
        return points_in_sources(self.request.sources)

    @property
    def share(self) -> float:
        """The share of the surface within the largest distance, about."""
        return share_reached(self.size, self.source_count, self.request.max_distance)


def solve_either(
    opened: OpenMesh,
    request: DistancesRequest | PathsRequest,
    sources: Sequence[gc.Source],
    context: ExecutionContext,
    targets: Sequence[gc.SurfacePoint],
) -> gc.DistanceField | CostsAsDistances:
    """Return the distances from some sources, or the costs if the request has any."""
    if request.cost is not None:
        return solve_costs(opened, request.cost, sources, context)
    limit = request.max_distance
    return solve_field(opened, request, sources, context, max_distance=limit, targets=targets)
