"""Points relaxed by Lloyd's method: each moves to the middle of the part that is nearest to it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from geodesic_core.arrays import Floats, Ints, sums_by
from geodesic_core.control import Control
from geodesic_core.fields.charts import Charts, charts_of
from geodesic_core.fields.question import Question
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SMALLEST_MOVE


@dataclass(frozen=True, eq=False, repr=False)
class RelaxedPoints:
    """Points that were moved, again and again, to the middle of what is nearest to them.

    Examples
    --------
    >>> mesh = gc.samples.plane(2000)  # the unit square
    >>> relaxed = gc.relax_points(mesh, [0, 1], iterations=50)
    >>> relaxed.converged
    True
    """

    mesh: TriangleMesh
    """The surface, with the barriers of the call."""
    points: tuple[SurfacePoint, ...]
    """N canonical points."""
    costs: Floats
    """(iterations + 1,) mesh units to the fourth, never rising: the sum of squared distances from
    the points, over the surface, before and after each iteration."""
    converged: bool
    """Whether the last iteration moved no point farther than rounding."""
    distances: Floats
    """(V,) float64, mesh units: to the nearest point; infinite where unreachable."""
    nearest: Ints
    """(V,) int32 index into `points`; -1 where unreachable; ties to the lowest."""

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        return f"RelaxedPoints({len(self)} points, cost {self.costs[-1]:.6g}, {state})"


def relaxed_points(
    mesh: TriangleMesh,
    points: tuple[SurfacePoint, ...],
    iterations: int,
    density: Floats,
    control: Control,
) -> RelaxedPoints:
    """Return canonical points after some iterations, or fewer if they converge.

    ``density`` (V,) is the mass of the surface by area, at its vertices.

    Raises
    ------
    NoTangentPlane
        A point has none.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    masses, silent = masses_of(mesh) * density, replace(control, progress=None)
    charts = _charts(mesh, points, silent)
    costs, converged = [_cost(charts, masses)], False
    for i in range(iterations):
        control.checkpoint(i / iterations)
        moves = charts.steps(masses)
        smallest, share, cost = SMALLEST_MOVE * mesh.extent, 1.0, math.inf
        while cost > costs[-1] and not converged:
            converged = float(np.hypot(*(share * moves).T).max()) <= smallest
            after = _charts(mesh, tuple(charts.moved(share * moves, silent)), silent)
            cost, share = _cost(after, masses), 0.5 * share
        if cost <= costs[-1]:
            charts = after
        costs.append(min(cost, costs[-1]))
        if converged:
            break
    control.finish()
    return RelaxedPoints(
        mesh, charts.sources, np.array(costs), converged, charts.distances, charts.nearest
    )


def masses_of(mesh: TriangleMesh) -> Floats:
    """Return a third of the area of the faces around each vertex, (V,)."""
    areas: Floats = np.repeat(mesh.face_areas / 3.0, 3)
    return sums_by(mesh.faces.reshape(-1), areas, len(mesh.vertices))


def _charts(mesh: TriangleMesh, points: tuple[SurfacePoint, ...], control: Control) -> Charts:
    return charts_of(Question.of(mesh, points, (), math.inf, control), control)


def _cost(charts: Charts, masses: Floats) -> float:
    reached = charts.nearest >= 0
    return float((masses[reached] * charts.distances[reached] ** 2).sum())
