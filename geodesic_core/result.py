"""What the solvers give back."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.errors import InternalError, InvalidPoint, NoPath
from geodesic_core.kernels.backtrace import Winners
from geodesic_core.mesh import TriangleMesh
from geodesic_core.path import EXACT, ErrorBound, GeodesicPath, traced_path
from geodesic_core.surface_point import SurfacePoint
from geodesic_core.tolerances import PATH_LENGTH


@dataclass(frozen=True, slots=True)
class Source:
    """A source, and the distance at which it starts (mesh units, 0 or more)."""

    point: int | SurfacePoint
    start_distance: float = 0.0


@dataclass(frozen=True, slots=True)
class SweepStats:
    """What a sweep did."""

    windows_created: int
    windows_kept: int
    """Windows left after trimming: those that were propagated."""
    windows_peak: int
    """Windows alive at once, at most."""
    windows_per_edge_created: float
    windows_per_edge_kept: float
    peak_bytes: int
    """Memory of the sweep's state at its largest, the mesh itself not counted."""
    seconds: float
    """Time of the solve, with the allocation of its state."""

    def as_dict(self) -> dict[str, Any]:
        """Return the statistics as what JSON can hold."""
        return asdict(self)


@dataclass(frozen=True)
class DistanceField:
    """Geodesic distances from the sources to all vertices."""

    mesh: TriangleMesh
    sources: tuple[Source, ...]
    max_distance: float
    """Mesh units; infinite where no limit was given."""
    distances: Floats
    """(V,) float64, mesh units; infinite where unreachable or beyond ``max_distance``."""
    nearest_source: Ints
    """(V,) int32 index into ``sources``; -1 where unreachable; ties to the lowest."""
    error_bound: ErrorBound
    stats: SweepStats
    _winners: Winners | None
    """For backtracing; None where the sweep kept nothing for it."""
    _find_winners: Callable[[], Winners]

    @cached_property
    def _known_winners(self) -> Winners:
        return self._find_winners() if self._winners is None else self._winners

    def path_to(self, target: int | SurfacePoint) -> GeodesicPath:
        """Return a path from the nearest source to a vertex (sections 3.5 and 4.3).

        Of an exact field its length is the vertex's distance less the start distance of its source;
        of an approximate one at most the promised error more. O(faces crossed). Where an
        approximate field was not told to keep its windows, the first call runs the sweep again.

        Raises
        ------
        InvalidPoint
            The target is not a vertex of the mesh.
        NoPath
            The vertex is not connected to a source, or lies beyond ``max_distance``.
        """
        vertex = vertex_of(self.mesh, target, "target")
        if self.nearest_source[vertex] < 0:
            raise self._no_path(vertex)
        v = int(self.mesh.topology.inner_vertex[vertex])
        path = traced_path(self.mesh, self._known_winners, v, EXACT)
        start = self.sources[self.nearest_source[vertex]].start_distance
        distance = float(self.distances[vertex])
        excess = start + path.length - distance
        exact = self.error_bound == EXACT
        if excess < -PATH_LENGTH * distance or (exact and excess > PATH_LENGTH * distance):
            raise InternalError(
                f"the path to vertex {vertex} has length {path.length}, but the field says "
                f"{distance - start}; please report this mesh"
            )
        if exact:
            return path
        share = max(excess, 0.0) / distance if distance > 0.0 else 0.0
        return replace(path, error_bound=ErrorBound("relative", share, "guaranteed"))

    def _no_path(self, vertex: int) -> NoPath:
        components = self.mesh.components
        mine = {int(components[vertex_of(self.mesh, s.point, "source")]) for s in self.sources}
        if int(components[vertex]) in mine:
            return NoPath(
                f"vertex {vertex} is farther than max_distance = {self.max_distance:g} from every "
                f"source",
                "beyond_max_distance",
            )
        return NoPath(
            f"vertex {vertex} is in another connected component than every source", "disconnected"
        )


def vertex_of(mesh: TriangleMesh, point: int | SurfacePoint, name: str) -> int:
    """Return the vertex that a point is.

    Raises
    ------
    InvalidPoint
        The point is no vertex, or the index is out of range; negative indices count as such.
    """
    index: Any = point
    if isinstance(point, SurfacePoint):
        index = point.vertex_index
        if index is None and point.face >= 0:
            raise InvalidPoint(
                f"the {name} lies in face {point.face}: only vertices can be asked for yet"
            )
    if isinstance(index, bool) or not isinstance(index, int | np.integer):
        raise InvalidPoint(f"the {name} is {index!r}; it must be a vertex index or a SurfacePoint")
    if not 0 <= index < len(mesh.vertices):
        raise InvalidPoint(
            f"the {name} is vertex {index}, but vertices are numbered 0 to {len(mesh.vertices) - 1}"
        )
    return int(index)


Sources = int | SurfacePoint | Source | Sequence[int | SurfacePoint | Source]
