"""What the solvers give back."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.curve import Curve, Polyline
from geodesic_core.errors import InternalError, NoPath
from geodesic_core.kernels.backtrace import Winners
from geodesic_core.kernels.wavefront import Bounds
from geodesic_core.mesh import TriangleMesh
from geodesic_core.nearest_source import NearestSource, find_nearest_source
from geodesic_core.nodes import Nodes, component_of, disconnected
from geodesic_core.path import EXACT, ErrorBound, GeodesicPath, traced_path
from geodesic_core.surface_point import Point, SurfacePoint
from geodesic_core.tolerances import PATH_LENGTH


@dataclass(frozen=True, slots=True)
class Source:
    """A source, and the distance at which it starts (mesh units, 0 or more)."""

    point: Point | Curve
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
    """With its barriers, if there are any"""
    sources: tuple[Source, ...]
    max_distance: float
    """Mesh units; infinite where no limit was given."""
    distances: Floats
    """(V,) float64, mesh units; infinite where unreachable or beyond ``max_distance``."""
    nearest_source: Ints
    """(V,) int32 index into ``sources``; -1 where unreachable; ties to the lowest."""
    error_bound: ErrorBound
    stats: SweepStats
    _places: tuple[Polyline, ...]
    """The sources' points, canonical"""
    _bounds: Bounds
    _nodes: Nodes
    _node_of: Mapping[SurfacePoint, int]
    """The nodes of the targets that the sweep was told of"""
    _node_distances: Floats
    """(N,) by node"""
    _node_nearest: Ints
    """(N,) the same of `nearest_source`"""
    _winners: Winners | None
    """For backtracing; None where the sweep kept nothing for it."""
    _find_winners: Callable[[], Winners]

    @cached_property
    def _known_winners(self) -> Winners:
        return self._find_winners() if self._winners is None else self._winners

    def distance_at(self, point: Point) -> float:
        """Return the distance of any point of the surface, mesh units; infinite as in `distances`.

        At a vertex or a target of the sweep it is what the sweep found, O(1). Elsewhere it is
        exact, also where the field is approximate: by an exact sweep from the point to the nearest
        source, in a thin strip that the field's own values leave.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        """
        place = self.mesh.point(point)
        node = self._node(place)
        if node is not None:
            return float(self._node_distances[node])
        return self._nearest_to(place).distance

    def nearest_source_at(self, point: Point) -> int:
        """Return the index of the source nearest to any point of the surface; -1 for none.

        Found as `distance_at` finds the distance.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        """
        place = self.mesh.point(point)
        node = self._node(place)
        if node is not None:
            return int(self._node_nearest[node])
        return self._nearest_to(place).source

    def path_to(self, target: Point) -> GeodesicPath:
        """Return a path from the nearest source to any point of the surface (sections 3.5 and 4.3).

        Of an exact field its length is the point's distance less the start distance of its source;
        of an approximate one at most the promised error more. O(faces crossed) to a vertex or a
        target of the sweep. Where an approximate field was not told to keep its windows, the first
        of those runs the sweep again. To other points as in `distance_at`.

        Raises
        ------
        InvalidPoint
            The target is not a point of the mesh.
        NoPath
            It is not connected to a source, or lies beyond ``max_distance``.
        """
        place = self.mesh.point(target, "target")
        node = self._node(place)
        if node is None:
            nearest = self._nearest_to(place)
            if nearest.path is None:
                raise self._no_path(place)
            return nearest.path
        distance = float(self._node_distances[node])
        if math.isinf(distance):
            raise self._no_path(place)
        winners = self._known_winners
        path = traced_path(self.mesh, winners, self._nodes, node, EXACT)
        start = self.sources[winners.nearest[node]].start_distance
        excess = start + path.length - distance
        exact = self.error_bound == EXACT
        if excess < -PATH_LENGTH * distance or (exact and excess > PATH_LENGTH * distance):
            raise InternalError(
                f"the path to {place} has length {path.length}, but the field says "
                f"{distance - start}; please report this mesh"
            )
        if exact:
            return path
        share = max(excess, 0.0) / distance if distance > 0.0 else 0.0
        return replace(path, error_bound=ErrorBound("relative", share, "guaranteed"))

    def _node(self, place: SurfacePoint) -> int | None:
        if place.vertex_index is not None:
            return int(self.mesh.topology.inner_vertex[place.vertex_index])
        return self._node_of.get(place)

    def _nearest_to(self, place: SurfacePoint) -> NearestSource:
        starts = np.array([source.start_distance for source in self.sources])
        return find_nearest_source(
            self.mesh,
            [line[0] for line in self._places],
            starts,
            self._node_distances,
            self._bounds,
            place,
        )

    def _no_path(self, place: SurfacePoint) -> NoPath:
        if component_of(self.mesh, place) in {component_of(self.mesh, p) for p, *_ in self._places}:
            return NoPath(
                f"{place} is farther than max_distance = {self.max_distance:g} from every source",
                "beyond_max_distance",
            )
        message = f"{place} is in another connected component than every source"
        return disconnected(self.mesh, message, place, *(line[0] for line in self._places))


Sources = Point | Curve | Source | Sequence[Point | Curve | Source]
