"""The Karcher mean: the point whose squared distances from given points sum to the least."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.fields.charts import Charts, charts_of
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import component_of, disconnected
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SMALLEST_MOVE

_MOST_MOVES = 100
"""Moves of the mean, at most; on smooth surfaces some ten find it"""

_DIRECTIONS = 8
"""In which a lower cost is looked for where that of the mean's own direction does not fall"""


@dataclass(frozen=True)
class MeanPoint:
    """The mean of points on a surface, and whether it was found.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square
    >>> mean = gc.mean_point(mesh, [0, 1, 2, 3])
    >>> mesh.position(mean.point).round(6).tolist(), mean.converged
    ([0.5, 0.5, 0.0], True)
    """

    point: SurfacePoint
    """Canonical."""
    variance: float
    """Mesh units squared: the weighted mean of the squared distances from the points."""
    converged: bool
    """Whether no point near it is better. False if the search was still moving when it ended."""
    moves: int
    """How often the search moved, from the best vertex on."""


def find_mean(
    mesh: TriangleMesh, points: Sequence[SurfacePoint], weights: Floats, control: Control
) -> MeanPoint:
    """Return the mean of canonical points with weights that sum to 1.

    From the best vertex on, it moves by the weighted mean of its log map, or else by the part of
    that, or the way in another direction, by which the variance falls.

    Raises
    ------
    NoPath
        No path joins the points.
    NoTangentPlane
        The search meets a point that has none.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    for point in points[1:]:
        if component_of(mesh, point) != component_of(mesh, points[0]):
            message = f"{points[0]} and {point} are in different connected components"
            raise disconnected(mesh, message, points[0], point)
    silent = replace(control, progress=None)
    start = _best_vertex(mesh, points, weights, control.for_part(0, 2))
    mean = _charts(mesh, start, points, silent)
    smallest = SMALLEST_MOVE * mesh.extent
    moves, converged = 0, False
    while not converged and moves < _MOST_MOVES:
        control.checkpoint(0.5 + 0.5 * moves / _MOST_MOVES)
        (target,) = mean.steps(weights, len(mesh.vertices))
        if math.hypot(*target) <= smallest:
            converged = True
            continue
        after = _lower(mean, target, points, weights, smallest, silent)
        converged = after is None
        if after is not None:
            mean, moves = after, moves + 1
    control.finish()
    return MeanPoint(mean.sources[0], _variance(mean, weights), converged, moves)


def _best_vertex(
    mesh: TriangleMesh, points: Sequence[SurfacePoint], weights: Floats, control: Control
) -> SurfacePoint:
    """Return the vertex of least variance. One sweep for each point."""
    costs, inner = np.zeros(len(mesh.vertices)), mesh.topology.inner_vertex
    for i, point in enumerate(points):
        if weights[i] > 0.0:
            part = control.for_part(i, len(points))
            sweep = ExactSweep(Question.of(mesh, point, (), math.inf, part))
            costs += weights[i] * sweep.run(part).vertices.distance[inner] ** 2
    return mesh.point(int(costs.argmin()))


def _lower(
    mean: Charts,
    target: Floats,
    points: Sequence[SurfacePoint],
    weights: Floats,
    smallest: float,
    control: Control,
) -> Charts | None:
    """Return a point of less variance: on the way to the target, or beside it; None if none is."""
    best, frames = _variance(mean, weights), mean.frames
    reach = math.hypot(*target)
    last = (frames.total_angle * frames.scale)[0]
    around = np.linspace(0.0, last, _DIRECTIONS, endpoint=not frames.is_closed[0])
    beside = np.stack([np.cos(around), np.sin(around)], axis=1)
    while reach > smallest:
        for direction in (target / math.hypot(*target), *beside):
            (place,) = mean.moved(reach * direction[None], control)
            after = _charts(mean.mesh, place, points, control)
            if _variance(after, weights) < best:
                return after
        reach *= 0.25
    return None


def _charts(
    mesh: TriangleMesh, place: SurfacePoint, points: Sequence[SurfacePoint], control: Control
) -> Charts:
    return charts_of(Question.of(mesh, place, points, math.inf, control), control)


def _variance(charts: Charts, weights: Floats) -> float:
    return float(weights @ charts.distances[len(charts.mesh.vertices) :] ** 2)
