"""Cheapest paths: curves with what they cost."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.costs.cost_sweep import (
    CostSweep,
    Detail,
    goal_of,
    nodes_on_edge,
    starts_of,
    sweep_costs,
)
from geodesic_core.costs.crossings import (
    Crossings,
    cost_of,
    straightened,
    traced,
    traced_inside,
    weights_beside,
)
from geodesic_core.costs.surface_costs import SurfaceCosts
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.path import ErrorBound
from geodesic_core.fields.sources import component_of, disconnected
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.surface_curve import SurfaceCurve, curve_through
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.path_search import PathSearch

_LEAST_ERROR = 1e-3
"""Least share that is told as the error of a straightened path"""
_BEYOND = 1.25
"""Times the limit up to which a sweep looks for a path: straightening may make it cheaper"""


@dataclass(frozen=True, eq=False, repr=False)
class CheapestPath(SurfaceCurve):
    """A path over the surface, and what it costs.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> cost = np.where(mesh.vertices[mesh.faces].mean(axis=1)[:, 1] < 0.5, 1.0, 3.0)
    >>> path = gc.cheapest_path(mesh, 0, 120, cost)  # bends where costs change, like light
    >>> round(path.cost, 3), round(path.length, 3)
    (2.552, 1.508)
    """

    cost: float
    """What the path costs, summed over its segments."""
    error_bound: ErrorBound
    """By what share the path may cost more than the cheapest: an estimate, as much as straightening
    has taken off its cost, and 0.001 at least. Of 100 paths that were measured, 97 were within."""
    _costs: SurfaceCosts

    def reversed(self) -> "CheapestPath":
        """Return the path from its target to its source.

        Returns
        -------
        CheapestPath
            With the same cost.

        Raises
        ------
        InvalidArgument
            Costs are by slope: the way back costs otherwise, and a cheaper one may run elsewhere.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> gc.cheapest_path(mesh, 0, 3, [1.0, 2.0]).reversed().points[0].tolist()
        [1.0, 1.0, 0.0]
        """
        if not self._costs.is_symmetric:
            raise InvalidArgument(
                "the way back costs otherwise where slopes count, and a cheaper one may run "
                "elsewhere: ask cheapest_path for it"
            )
        back = vars(super().reversed())
        return CheapestPath(
            **back, cost=self.cost, error_bound=self.error_bound, _costs=self._costs
        )

    def lower_bound(
        self,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> float:
        """Return a cost that no path between its ends is below.

        It is what the exact distance costs where all faces are as the cheapest, on the slope that
        costs least; and with costs by slope no less than the straight line through space. So it
        says something where costs differ little: nothing better is known that holds.

        Parameters
        ----------
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        float
            At most `cost`, rounding aside.

        Raises
        ------
        InvalidArgument
            The path is a copy or comes from a pickle, and has no mesh.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            See `Control`.

        Notes
        -----
        A search as that of `shortest_path`.

        Examples
        --------
        >>> path = gc.cheapest_path(gc.samples.plane(2), 1, 2, [1.0, 1.5])
        >>> round(path.lower_bound(), 3), round(path.cost, 3)
        (1.414, 1.768)
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        mesh, costs = self.on_mesh(), self._costs
        start, end = self.locations[0], self.locations[-1]
        distance = (
            PathSearch(mesh).find(start, end, control, explain=False).length
            if start != end
            else 0.0
        )
        apart = np.zeros(3)
        if not costs.is_symmetric:
            apart = mesh.position_from_origin(end) - mesh.position_from_origin(start)
        return float(costs.at_least(np.array([distance]), apart[None])[0])

    def __repr__(self) -> str:
        return f"CheapestPath({self.summary}, cost {self.cost:.6g}, {self.error_bound})"

    @property
    def _shown(self) -> dict[str, Any]:
        ends = {"from": self.locations[0], "to": self.locations[-1], "cost": self.cost}
        return ends | {"length": self.length, "accuracy": self.error_bound}

    @property
    def _properties(self) -> dict[str, Any]:
        return {
            "length": self.length,
            "cost": self.cost,
            "error_bound": asdict(self.error_bound),
        }


def find_cheapest_path(
    mesh: TriangleMesh,
    costs: SurfaceCosts,
    source: SurfacePoint,
    target: SurfacePoint,
    detail: Detail,
    limit: float,
    control: Control,
) -> CheapestPath:
    """Return the cheapest path between two canonical points.

    Raises
    ------
    NoPath
        They are not connected, or the path costs more than the limit.
    InvalidPoint
        One of them lies in closed faces only.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    if component_of(mesh, source) != component_of(mesh, target):
        message = f"{source} and {target} are in different connected components"
        raise disconnected(mesh, message, source, target)
    starts, goal = starts_of(mesh, costs, [(source,)], [0.0]), goal_of(mesh, costs, target)
    per_edge = nodes_on_edge(costs, detail)
    sweep = sweep_costs(mesh, costs, starts, per_edge, limit * _BEYOND, control, goal)
    path = path_to(sweep, target, control)
    if path is None and limit == np.inf:
        raise NoPath(f"faces of infinite cost lie between {source} and {target}", "disconnected")
    if path is None or path.cost > limit:
        raise NoPath(
            f"the path from {source} to {target} costs more than max_cost = {limit:g}",
            "beyond_max_cost",
        )
    return path


def path_to(
    sweep: CostSweep, point: SurfacePoint, control: Control, *, turned: bool = False
) -> CheapestPath | None:
    """Return the path of a sweep to a canonical point, straightened; None where it has none."""
    crossings = crossings_to(sweep, point)
    if crossings is None:
        return None
    raw = cost_of(sweep, crossings)
    crossings, cost = straightened(sweep, crossings, control)
    curve = _curve_of(sweep, crossings, point)
    costs, bound = sweep.costs, path_bound(raw, cost)
    if turned:
        curve, costs = curve.reversed(), costs.turned()
    return CheapestPath(**vars(curve), cost=cost, error_bound=bound, _costs=costs)


def crossings_to(sweep: CostSweep, point: SurfacePoint) -> Crossings | None:
    """Return the path of a sweep to a canonical point; None where it has none."""
    if point.vertex_index is not None:
        v = int(sweep.mesh.topology.inner_vertex[point.vertex_index])
        return traced(sweep, v) if sweep.front.nearest[v] >= 0 else None
    place = weights_by_face(sweep.mesh, point)
    arrival = sweep.best_at(place)
    if not np.isfinite(arrival.cost):
        return None
    return traced_inside(sweep, arrival, np.array(place[arrival.face]))


def path_bound(raw: float, cost: float) -> ErrorBound:
    """Return the estimated error of a path, by how much straightening has lowered its cost."""
    gained = raw / cost - 1.0 if cost > 0.0 else 0.0
    return ErrorBound("relative", max(_LEAST_ERROR, gained), "estimated")


def _curve_of(sweep: CostSweep, path: Crossings, end: SurfacePoint) -> SurfaceCurve:
    """Return a path to a canonical point as a curve on its mesh."""
    mesh = sweep.mesh
    if len(path.faces) == 0:
        face, weights = next(iter(weights_by_face(mesh, end).items()))
        at, none = np.array([face], np.int64), np.empty(0, np.int64)
        return curve_through(mesh, at, np.array([weights]), none, closed=False)
    faces = np.concatenate([path.faces[:1], path.faces])
    return curve_through(mesh, faces, _weights_of(sweep, path), path.faces, closed=False)


def _weights_of(sweep: CostSweep, path: Crossings) -> Floats:
    """Return the weights of the points of a path, the first in the face after it, others before."""
    first, change = weights_beside(sweep, path, slice(0, -1))
    others, changes = weights_beside(sweep, path, slice(1, None))
    begin = first[:1] + path.places[:1, None] * change[:1]
    return np.concatenate([begin, others + path.places[1:, None] * changes])
