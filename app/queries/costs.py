"""Costs of ways: by face and by slope, as requests have them, and fields of them."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.errors import pointer
from app.queries.base import ExecutionContext
from app.queries.validation import invalid_fields, naming
from app.schemas.requests import Accuracy, SurfaceCost
from app.store.meshes import OpenMesh

ROUGHLY = gc.ErrorBound("relative", 0.05, "estimated")
"""Of costs that were not found: on each mesh that was measured 95 % were within 0.03"""

CHEAPEST = "cheapest"
"""The method of answers where ways cost"""
SWEEPS = {"default": 3.0, "fine": 6.0}
"""Exact sweeps that a sweep for costs takes, about, by detail; twice as many where slopes cost"""
_BY_DISTANCE = "relative_error", "absolute_error", "effort", "max_distance"


def check_alone(request: Accuracy, *others: str) -> None:
    """Refuse members that do not go with costs: those about distances, and some others."""
    wrong = [name for name in _BY_DISTANCE if getattr(request, name, None) is not None]
    wrong += [name for name in others if getattr(request, name)]
    if request.method != "exact":
        wrong.append("method")
    if wrong:
        raise invalid_fields(list(map(pointer, wrong)), "does not go with cost")


def sweeps_of(cost: SurfaceCost | None) -> float:
    """Return the exact sweeps that take as long as one with a cost, about; 1 without one."""
    if cost is None:
        return 1.0
    return SWEEPS[cost.detail] * (1.0 if cost.slope is None else 2.0)


def library_cost(cost: SurfaceCost) -> Any:
    """Return a cost as the library takes it."""
    faces = None
    if cost.faces is not None:
        faces = np.array([np.inf if each is None else each for each in cost.faces])
    if cost.slope is None:
        return faces
    with naming((gc.errors.InvalidArgument, "/cost/slope")):
        slope = gc.SlopeCost(cost.slope, cost.up, zigzag=cost.zigzag)
    return slope if faces is None else (faces, slope)


def naming_cost() -> AbstractContextManager[None]:
    """Name the member that an error of the library is about."""
    kinds = gc.errors.NotEmbedded, gc.errors.InvalidArgument
    return naming(*zip(kinds, ("/cost/slope", "/cost/faces"), strict=True))


@dataclass(frozen=True)
class CostsAsDistances:
    """A field of costs under the names that a field of distances has."""

    field: gc.CostField
    stats: None = None

    @property
    def distances(self) -> NDArray[np.float64]:
        """(V,): what each vertex costs."""
        return self.field.costs

    @property
    def nearest_source(self) -> NDArray[np.int32]:
        """(V,): index of the source of each vertex; -1 where none."""
        return self.field.nearest_source

    @property
    def error_bound(self) -> gc.ErrorBound:
        """An estimate."""
        return self.field.error_bound

    def nearest_source_at(self, point: gc.SurfacePoint) -> int:
        """Refuse: only vertices have one."""
        raise invalid_fields(["/include"], f"{point} is no vertex: only vertices have one of costs")

    def distance_at(self, point: gc.SurfacePoint) -> float:
        """Return what a point costs."""
        return self.field.cost_at(point)

    def path_to(self, point: gc.SurfacePoint) -> gc.CheapestPath:
        """Return the cheapest path."""
        return self.field.path_to(point)


def solve_costs(
    opened: OpenMesh, cost: SurfaceCost, sources: Sequence[gc.Source], context: ExecutionContext
) -> CostsAsDistances:
    """Return what it costs to get from some sources, or to them."""
    given = library_cost(cost)
    with naming_cost():
        field = opened.solver.cost_distance(
            sources,
            given,
            cost.max_cost,
            direction=cost.direction,
            detail=cost.detail,
            **context.options,
        )
    return CostsAsDistances(field)
