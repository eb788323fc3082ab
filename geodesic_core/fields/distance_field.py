"""What the solvers give back."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InternalError, NoPath
from geodesic_core.fields.gradient import gradient_at_vertices
from geodesic_core.fields.isolines import (
    Drawing,
    Isoline,
    as_levels,
    crossed_faces,
    resolve_chord_error,
    spaced_levels,
)
from geodesic_core.fields.path import EXACT, ErrorBound, GeodesicPath, traced_path
from geodesic_core.fields.point_query import (
    Arrival,
    NearestSource,
    arrival_at,
    find_nearest_source,
    with_target,
)
from geodesic_core.fields.repeatable_sweep import Lazy, RepeatableSweep, SweepResult, SweepStats
from geodesic_core.fields.sources import Nodes, Source, component_of, disconnected
from geodesic_core.kernels.isolines.face_windows import FaceWindows
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.sweep.bounds import exact_bounds, merging_bounds, with_parallel_windows
from geodesic_core.mesh.curve import (
    Curve,
    Polyline,
    polylines_from_arrays,
    polylines_to_arrays,
)
from geodesic_core.mesh.surface_point import Point, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import FOOT, LEVEL, PATH_LENGTH


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
    _targets: tuple[SurfacePoint, ...]
    """Those that the sweep was told of, canonical"""
    _sweep: RepeatableSweep
    """Where the values come from"""
    _found: SweepResult

    @classmethod
    def from_arrays(cls, mesh: TriangleMesh, arrays: Mapping[str, NDArray[Any]]) -> "DistanceField":
        """Return the field on ``mesh`` whose `arrays` these are; trusted, not checked.

        What it answers is the same to the bit; its sources are spelled canonically.
        """
        places = polylines_from_arrays("source", arrays)
        targets = tuple(point for (point,) in polylines_from_arrays("target", arrays))
        starts = arrays["start_distances"]
        sources = tuple(
            Source(line[0] if len(line) == 1 else Curve(line), start)
            for line, start in zip(places, starts.tolist(), strict=True)
        )
        limit, *errors = arrays["limits"].tolist()
        bounds = merging_bounds(limit, *errors) if errors else exact_bounds(limit)
        of_type, kind = arrays["promise"].tolist()
        created, kept, peak, peak_bytes = arrays["counts"].tolist()
        seconds = float(arrays["seconds"])
        return field_of(
            sources,
            places,
            targets,
            RepeatableSweep.between(mesh, places, starts, targets, bounds),
            ErrorBound(of_type, float(arrays["promised"]), kind),
            SweepResult.from_arrays(arrays),
            SweepStats.of(mesh, created, kept, peak, peak_bytes, seconds),
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return what was asked for, and what was found, by name: what a store keeps.

        All but the mesh, and what was searched for later.
        """
        bounds, stats, promise = self._sweep.bounds, self.stats, self.error_bound
        errors = [bounds.relative_error, bounds.absolute_error] if bounds.merging else []
        counts = stats.windows_created, stats.windows_kept, stats.windows_peak, stats.peak_bytes
        return {
            **polylines_to_arrays("source", self._places),
            **polylines_to_arrays("target", [(target,) for target in self._targets]),
            "start_distances": self._sweep.start_distances,
            "limits": np.array([bounds.max_distance, *errors]),
            "promise": np.array([promise.type, promise.kind]),
            "promised": np.array(promise.value),
            **self._found.arrays(),
            "counts": np.array(counts, np.int64),
            "seconds": np.array(stats.seconds),
        }

    @property
    def nbytes(self) -> int:
        """Memory kept, bytes, the mesh not counted; it grows by what is found only when asked."""
        found, ways = self._found, self._ways
        kept: list[Any] = [found.distance, self.distances, self.nearest_source]
        kept += self._winners.found or ()
        for windows in (found.windows, ways.found[1] if ways and ways.found else None):
            kept += windows or ()
        return sum(array.nbytes for array in kept)

    @cached_property
    def _node_of(self) -> Mapping[SurfacePoint, int]:
        """The nodes of the targets."""
        return dict(zip(self._targets, self._sweep.nodes.targets.tolist(), strict=True))

    @cached_property
    def _winners(self) -> Lazy[Winners]:
        """For backtracing; the sweep may not have kept what that needs."""
        return Lazy(self._sweep.find_winners, self._found.winners)

    @cached_property
    def _ways(self) -> Lazy[tuple[Winners, FaceWindows]] | None:
        """By which windows any point is found exactly; None where it is searched from."""
        sweep, bounds, found = self._sweep, self._sweep.bounds, self._found
        if found.winners is not None and found.windows is not None and not bounds.merging:
            return Lazy(sweep.find_ways, (found.winners, found.windows))
        if bounds.parallel:  # a sweep back from a point ends at points, not on curves
            exact = with_parallel_windows(exact_bounds(bounds.max_distance), bounds.first_segment)
            return Lazy(replace(sweep, bounds=exact).find_ways)
        return None

    def distance_at(
        self,
        point: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> float:
        """Return the distance of any point of the surface, mesh units; infinite as in `distances`.

        At a vertex or a target of the sweep it is what the sweep found, O(1). Elsewhere it is
        exact, also where the field is approximate: by the windows of an exact field that kept them,
        O(windows of the face); else by an exact sweep from the point to the nearest source, in a
        thin strip that the field's own values leave. Where a source is a curve, the first such
        point runs the sweep again, exactly, and keeps its windows. Sweeps are watched as those of
        the solvers are: see `Control`.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As said in `Control`; the field is as good as before.
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        place = self.mesh.point(point)
        node = self._node(place)
        if node is not None:
            return float(self._found.distance[node])
        if self._ways is None:
            return self._nearest_to(place, control).distance
        return self._arrival_at(place, *self._ways.get(control)).distance

    def nearest_source_at(
        self,
        point: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> int:
        """Return the index of the source nearest to any point of the surface; -1 for none.

        Found as `distance_at` finds the distance, and watched as that.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As said in `Control`; the field is as good as before.
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        place = self.mesh.point(point)
        node = self._node(place)
        if node is not None:
            return int(self._found.nearest[node])
        if self._ways is None:
            return self._nearest_to(place, control).source
        return self._arrival_at(place, *self._ways.get(control)).source

    def path_to(
        self,
        target: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> GeodesicPath:
        """Return a path from the nearest source to any point of the surface (sections 3.5 and 4.3).

        Of an exact field its length is the point's distance less the start distance of its source;
        of an approximate one at most the promised error more. O(faces crossed) to a vertex or a
        target of the sweep. Where an approximate field was not told to keep what paths need, the
        first of those runs the sweep again. To other points as `distance_at` finds their distances,
        and watched as that.

        Raises
        ------
        InvalidPoint
            The target is not a point of the mesh.
        NoPath
            It is not connected to a source, or lies beyond ``max_distance``.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As said in `Control`; the field is as good as before.
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        place = self.mesh.point(target, "target")
        node = self._node(place)
        if node is not None:
            if math.isinf(self._found.distance[node]):
                raise self._no_path(place)
            return self._traced(place, self._winners.get(control), self._sweep.nodes, node)
        if self._ways is None:
            path = self._nearest_to(place, control).path
            if path is None:
                raise self._no_path(place)
            return path
        winners, windows = self._ways.get(control)
        arrival = self._arrival_at(place, winners, windows)
        if arrival.source < 0:
            raise self._no_path(place)
        return self._traced(
            place, *with_target(self.mesh, winners, self._sweep.nodes, place, arrival)
        )

    @cached_property
    def gradient(self) -> Floats:
        """Unit vectors (V, 3), float64: where distance grows fastest, tangent to the surface.

        At each vertex the direction against that in which the shortest path to its nearest source
        sets out; of one of them where several are as short. NaN at sources, and where `distances`
        is infinite. O(V); of an approximate field that did not keep what paths need, after another
        sweep, which nobody watches: unless `path_to` has found a path before.
        """
        return gradient_at_vertices(self.mesh, self._winners.get(Control()), self._sweep.nodes)

    def levels(self, count: int) -> Floats:
        """Return levels for `isolines`: evenly spaced between 0 and the largest finite distance.

        The two themselves are left out.

        Raises
        ------
        InvalidArgument
            The count is not an integer, 1 or more; or no vertex is reached but sources.
        """
        return spaced_levels(self.distances, count)

    def isolines(
        self,
        levels: Sequence[float],
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> list[list[Isoline]]:
        """Return for each level, in their order, the lines of points at that distance.

        They are where the surface within that distance ends: closed, or open where they end at the
        boundary or at an edge of more than two faces. In each face they consist of circular arcs,
        and of straight lines beside curves; their ends, and what crosses edges, are exact, and
        between them arcs become chords. A vertex at
        the level itself counts as within. Levels beyond all distances, or beyond ``max_distance``,
        have no lines. Of an approximate field they are those of its own distances, which the same
        error bounds.

        Parameters
        ----------
        levels
            Distances above 0, mesh units; `levels` spaces some evenly.
        chord_error
            How far chords may stray from their arcs, mesh units; by default a thousandth of the
            mean edge length, at least a billionth of the bounding box's diagonal.

        Raises
        ------
        InvalidArgument
            A level or the chord error is out of its domain.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As said in `Control`; the field is as good as before.

        Notes
        -----
        Where the sweep did not keep its windows, each call runs it again: of an exact field for
        the windows of those faces only that the levels may pass. That takes less memory by far than
        to keep all, and mostly less time. O(windows), and for each level O(n² log n) for n windows
        in each face that it passes.
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        return list(
            self._isolines(as_levels(levels), resolve_chord_error(self.mesh, chord_error), control)
        )

    def each_isoline(
        self,
        levels: Sequence[float],
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Iterator[list[Isoline]]:
        """Yield what `isolines` returns, level by level: each is drawn when it is asked for."""
        control = Control(progress, cancel, deadline_s, memory_limit)
        return self._isolines(
            as_levels(levels), resolve_chord_error(self.mesh, chord_error), control
        )

    def _isolines(
        self, levels: Sequence[float], chord_error: float, control: Control
    ) -> Iterator[list[Isoline]]:
        # At its very limit the sweep is cut off by rounding: a line stays clear of that.
        highest = self.max_distance * (1.0 - 3.0 * LEVEL)
        within = [min(level, highest) for level in levels if level <= self.max_distance]
        if not within:
            yield from ([] for _ in levels)
            return
        windows = self._found.windows
        if windows is None:
            windows = self._windows_at(within, control.for_part(0, 2))
            control = control.for_part(1, 2)
        parts = 1 + len(levels)
        drawing = Drawing(
            self.mesh, windows, self._found.distance, self._sweep.nodes, control.for_part(0, parts)
        )
        for i, level in enumerate(levels):
            part = control.for_part(1 + i, parts)
            reached = level <= self.max_distance
            yield drawing.lines(min(level, highest), chord_error, part) if reached else []
        if control.progress is not None:
            control.progress(1.0)

    def _windows_at(self, levels: Sequence[float], control: Control) -> FaceWindows:
        """Return the windows of all faces that some levels may pass."""
        if self._sweep.bounds.merging:
            return self._sweep.find_windows(self._sweep.all_faces, control)
        faces = crossed_faces(self.mesh, self._found.distance, self.max_distance, levels)
        return self._sweep.find_windows(faces, control)

    def _traced(
        self, place: SurfacePoint, winners: Winners, nodes: Nodes, node: int
    ) -> GeodesicPath:
        """Return the path to a node, which must have the length that the field says."""
        distance = float(winners.distance[node])
        path = traced_path(self.mesh, winners, nodes, node, EXACT)
        start = self.sources[winners.nearest[node]].start_distance
        excess = start + path.length - distance
        exact = self.error_bound == EXACT
        rounding = FOOT * self.mesh.diagonal
        most = PATH_LENGTH * distance + rounding
        if excess < -most or (exact and excess > most):
            raise InternalError(
                f"the path to {place} has length {path.length}, but the field says "
                f"{distance - start}; please report this mesh"
            )
        if exact:
            return path
        share = max(excess, 0.0) / distance if distance > rounding else 0.0
        return replace(path, error_bound=ErrorBound("relative", share, "guaranteed"))

    def _node(self, place: SurfacePoint) -> int | None:
        if place.vertex_index is not None:
            return int(self.mesh.topology.inner_vertex[place.vertex_index])
        return self._node_of.get(place)

    def _arrival_at(self, place: SurfacePoint, winners: Winners, windows: FaceWindows) -> Arrival:
        """Return how windows reach a point."""
        nodes = self._sweep.nodes
        return arrival_at(self.mesh, winners, windows, nodes, place, self.max_distance)

    def _nearest_to(self, place: SurfacePoint, control: Control) -> NearestSource:
        sweep, starts = self._sweep, [line[0] for line in self._places]
        return find_nearest_source(
            self.mesh,
            starts,
            sweep.start_distances,
            self._found.distance,
            sweep.bounds,
            place,
            control,
        )

    def _no_path(self, place: SurfacePoint) -> NoPath:
        if component_of(self.mesh, place) in {component_of(self.mesh, p) for p, *_ in self._places}:
            return NoPath(
                f"{place} is farther than max_distance = {self.max_distance:g} from every source",
                "beyond_max_distance",
            )
        message = f"{place} is in another connected component than every source"
        return disconnected(self.mesh, message, place, *(line[0] for line in self._places))


def field_of(
    sources: tuple[Source, ...],
    places: tuple[Polyline, ...],
    targets: tuple[SurfacePoint, ...],
    sweep: RepeatableSweep,
    promise: ErrorBound,
    found: SweepResult,
    stats: SweepStats,
) -> DistanceField:
    """Return the field of a sweep that has found what it was asked for."""
    inner = sweep.mesh.topology.inner_vertex
    return DistanceField(
        mesh=sweep.mesh,
        sources=sources,
        max_distance=sweep.bounds.max_distance,
        distances=found.distance[inner],
        nearest_source=found.nearest[inner],
        error_bound=promise,
        stats=stats,
        _places=places,
        _targets=targets,
        _sweep=sweep,
        _found=found,
    )
