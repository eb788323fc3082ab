"""Samples of a surface, each the farthest from those before."""

from dataclasses import dataclass, replace

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweep import add_source
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.front.relaxation import nearest_sources
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.reprs import as_table


@dataclass(frozen=True, eq=False, repr=False)
class FarthestPoints:
    """Points of a surface, each the vertex that was the farthest from those before it.

    Every vertex is within the last `radius` of a point, and no two points that were added are
    nearer to each other than that.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> gc.farthest_points(mesh, count=4, start=0)
    FarthestPoints(4 points, covering radius 0.707107)
    """

    mesh: TriangleMesh
    """The surface, with the barriers of the call."""
    points: tuple[SurfacePoint, ...]
    """N canonical points: where the call began, and the vertices added. They can be sources."""
    radius: Floats
    """Covering radius, mesh units: the distance of the farthest vertex, with the points that the
    call began with, and after each one added; infinite while a part has no point."""
    distances: Floats
    """(V,) float64, mesh units: to the nearest point; infinite where unreachable."""
    nearest: Ints
    """(V,) int32 index into `points`; -1 where unreachable; ties to the lowest."""

    @property
    def vertices(self) -> Ints:
        """(N,) int32: vertex index of each point; -1 where the call began at another point."""
        return np.array(
            [-1 if p.vertex_index is None else p.vertex_index for p in self.points], np.int32
        )

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        return f"FarthestPoints({len(self)} points, covering radius {self.radius[-1]:.6g})"

    def _repr_html_(self) -> str:
        radius = f"{self.radius[-1]:.6g}"
        return as_table("FarthestPoints", {"points": len(self), "covering radius": radius})


def spread_points(
    question: Question, count: float, radius: float, control: Control
) -> FarthestPoints:
    """Add the farthest vertex to the sources of a question, again and again.

    Until there are ``count`` points, or none is farther than ``radius``.

    Raises
    ------
    InvalidArgument
        Fewer points than ``count`` are apart from each other.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded, InternalError
        As in `exact_distance`.
    """
    mesh, sweep = question.mesh, ExactSweep(question)
    found = [line[0] for line in question.polylines]
    topology = mesh.topology
    in_no_face = topology.first_corner[1:] == topology.first_corner[:-1]
    silent = replace(control, progress=None)
    wave, bounds, radii = sweep.run(silent), sweep.bounds, list[float]()
    while True:
        distances = wave.vertices.distance[: len(mesh.vertices)]
        distances[in_no_face] = -1.0
        radii.append(float(distances.max()))
        if len(found) >= count or radii[-1] <= radius:
            break
        if radii[-1] == 0.0:
            raise InvalidArgument(
                f"count is {count}, but only {len(found)} points of the mesh are apart from each "
                "other: ask for fewer"
            )
        control.checkpoint(max(len(found) / count, (max(radius, 0.0) / radii[-1]) ** 2))
        # No path that is longer improves a vertex.
        bounds = bounds._replace(max_distance=radii[-1])
        vertex = int(topology.outer_vertex[np.flatnonzero(distances == radii[-1])].min())
        node = int(topology.inner_vertex[vertex])
        wave = add_source(mesh, wave, node, len(found), bounds, silent)
        found.append(mesh.point(vertex))
    control.finish()
    wave.vertices.distance[: len(mesh.vertices)][in_no_face] = np.inf
    distances, inner = wave.vertices.distance, topology.inner_vertex
    nearest = nearest_sources(distances, wave.vertices.winner_ints, wave.vertices.source_index)
    return FarthestPoints(mesh, tuple(found), np.array(radii), distances[inner], nearest[inner])
