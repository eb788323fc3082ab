"""Distances and paths of any point of the surface, from a field.

An exact field with windows reaches the point by those of its face. Else an exact sweep runs back
from the point to the nearest source, pruned by the field: its values bound the rest of every path
from below, as those of step 2 do in a search between two points (section 5). So only a thin strip
around the answer is swept.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.errors import InternalError
from geodesic_core.fields.path import (
    EXACT,
    GeodesicPath,
    rounding_of,
    traced_path,
)
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Nodes, corners_of, nodes_of
from geodesic_core.fields.sweep import sweep_nodes, winners_of
from geodesic_core.fields.sweep_result import SweepResult, all_winners
from geodesic_core.fields.sweeps import ExactSweep, Sweep
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import exact_bounds, pruning_toward
from geodesic_core.kernels.mesh.half_edges import point_in_frame
from geodesic_core.kernels.paths.backtracing import End, Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows, Reach, reach_point
from geodesic_core.mesh.curve import length_in_face, weights_by_face
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SEARCH_SLACK, TIE

T = TypeVar("T")


class NearestSource(NamedTuple):
    """The source nearest to a point, its exact distance, and how to trace the path from there."""

    source: int
    """Index into the sources of the field; -1 where there is no path"""
    distance: float
    """Mesh units, the source's start distance counted; infinite where there is no path"""
    path: Callable[[], GeodesicPath] | None
    """Traces the path; None where there is none"""


NOT_REACHED = NearestSource(-1, math.inf, None)


def arrival_at(
    sweep: ExactSweep, winners: Winners, windows: FaceWindows, point: SurfacePoint
) -> NearestSource:
    """Return the source nearest to a point, by the windows of its faces; O(windows)."""
    mesh, nodes = sweep.question.mesh, sweep.question.nodes
    reaches = (
        reach_point(mesh.topology, winners, windows, nodes.first_target, face, np.array(weights))
        for face, weights in weights_by_face(mesh, point).items()
    )
    reach = Reach(*min(reaches, key=lambda reach: reach[0]))
    if math.isinf(reach.distance) or reach.distance > sweep.question.max_distance:
        return NOT_REACHED
    source = int(winners.nearest[reach.predecessor])

    def path() -> GeodesicPath:
        end = _end_of(mesh, point, reach, source, len(winners.vertices.distance))
        reached = winners._replace(target=end)
        return checked_path(sweep, reached, replace(nodes, added=(point,)), end.node)

    return NearestSource(source, reach.distance, path)


def _end_of(mesh: TriangleMesh, point: SurfacePoint, reach: Reach, source: int, node: int) -> End:
    """Return a point that windows reach as one more node, of the given number."""
    weights = weights_by_face(mesh, point)[reach.entry_edge // 3]
    x, y = point_in_frame(mesh.topology.geometry, reach.entry_edge, np.array(weights))
    return End(
        node=node,
        distance=reach.distance,
        source=source,
        entry_edge=reach.entry_edge,
        x=x,
        y=y,
        sx=reach.sx,
        sy=reach.sy,
        reference=-1 - reach.predecessor,
        crossing=math.nan,
    )


class Lazy(Generic[T]):
    """A value that is there already, or is found by the first call that is not stopped."""

    def __init__(self, find: Callable[[Control], T], value: T | None = None) -> None:
        self._find = find
        self._value = value

    @property
    def value(self) -> T | None:
        """The value; None until it is found."""
        return self._value

    def get(self, control: Control) -> T:
        """Return the value, found under ``control`` if it is not there.

        Raises
        ------
        GeodesicError
            As finding it does; the next call tries again.
        """
        if self._value is None:
            self._value = self._find(control)
        return self._value


class PointQueries:
    """Points of the surface, asked of the result of a sweep; what is swept again is retained."""

    def __init__(self, sweep: Sweep, result: SweepResult) -> None:
        self._sweep, self._result = sweep, result
        self.winners = Lazy(partial(_winners_by, sweep), result.winners)
        """Data of paths to vertices and targets"""
        both = None
        if sweep.exact is sweep and result.winners is not None and result.windows is not None:
            both = result.winners, result.windows
        self.exact = Lazy(sweep.exact.find_winners_and_windows, both)
        """Data by which any point is found exactly"""

    def distance_at(self, point: SurfacePoint, control: Control) -> float:
        """Return the distance of a canonical point, infinite where it is not reached."""
        node = self._sweep.question.node(point)
        if node is not None:
            return float(self._result.distance[node])
        return self._found(point, control).distance

    def nearest_source_at(self, point: SurfacePoint, control: Control) -> int:
        """Return the index of the source nearest to a canonical point; -1 for none."""
        node = self._sweep.question.node(point)
        if node is not None:
            return int(self._result.nearest[node])
        return self._found(point, control).source

    def path_to(self, point: SurfacePoint, control: Control) -> GeodesicPath | None:
        """Return the path to a canonical point; None where it is not reached."""
        node = self._sweep.question.node(point)
        if node is None:
            path = self._found(point, control).path
            return None if path is None else path()
        if math.isinf(self._result.distance[node]):
            return None
        nodes = self._sweep.question.nodes
        return checked_path(self._sweep, self.winners.get(control), nodes, node)

    def _found(self, point: SurfacePoint, control: Control) -> NearestSource:
        """Return the source nearest to a point that is no node.

        A sweep back from the point ends at points, not on curves, and needs lower bounds.
        """
        least = self._result.distance
        if self.exact.value is None and not self._sweep.question.has_curves:
            most = self._sweep.upper_bounds(least)
            if most is not None:
                return find_nearest_source(self._sweep.question, least, most, point, control)
        return arrival_at(self._sweep.exact, *self.exact.get(control), point)


def _winners_by(sweep: Sweep, control: Control) -> Winners:
    """Run a sweep for the data of paths."""
    return all_winners(sweep.run(control, "paths"))


def checked_path(sweep: Sweep, winners: Winners, nodes: Nodes, node: int) -> GeodesicPath:
    """Return the path to a node, whose length must go with the node's distance.

    Raises
    ------
    InternalError
        It does not.
    """
    mesh = sweep.question.mesh
    distance, source = winners.reached(node)
    path = traced_path(mesh, winners, nodes, node, EXACT)
    start = float(sweep.question.start_distances[source])
    error = sweep.error_of_path(
        start + path.length - distance, distance, rounding_of(mesh, distance)
    )
    if error is None:
        raise InternalError(
            f"the path to {path.locations[-1]} has length {path.length}, but the field says "
            f"{distance - start}; please report this mesh"
        )
    return path if error == EXACT else replace(path, error_bound=error)


def find_nearest_source(
    question: Question, least: Floats, most: Floats, point: SurfacePoint, control: Control
) -> NearestSource:
    """Return the source nearest to a point, by a sweep back from it.

    ``least`` and ``most`` bound the exact distances of the inner vertices; more values may follow.
    O(faces in the strip), and O(V + F) for memory.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `run_sweep`.
    """
    mesh, limit, starts = question.mesh, question.max_distance, question.start_distances
    nodes = nodes_of(mesh, [(point,)], [line[0] for line in question.polylines], control)
    corners, reaches = corners_of(mesh, point)
    upper = float((most[corners] + reaches).min())
    upper = min(upper, _within_face(question, point, control), limit)
    if math.isinf(upper):
        return NOT_REACHED
    # A vertex beyond the limit of the field is at least as far as that.
    rest = np.minimum(least[: len(mesh.vertices)], limit)
    pruning_bounds = pruning_toward(
        mesh.positions_for_bounds, np.zeros(3), upper * (1.0 + SEARCH_SLACK), rest
    )
    wave = state.new_wavefront(mesh.topology, nodes.sites, pruned=True)
    control.check_memory(state.bytes_of(wave))
    backward = exact_bounds(math.inf, pruning_bounds)
    wave = sweep_nodes(mesh, wave, nodes, np.zeros(1), backward, control, lambda _: 0.0)
    totals = wave.vertices.distance[nodes.targets] + starts
    distance = float(totals.min())
    if distance > limit:
        return NOT_REACHED
    nearest = int(np.flatnonzero(totals <= distance * (1.0 + TIE))[0])

    def path() -> GeodesicPath:
        winners = winners_of(wave, np.zeros(len(wave.vertices.distance), np.int32))
        traced = traced_path(mesh, winners, nodes, int(nodes.targets[nearest]), EXACT)
        return traced.reversed()

    return NearestSource(nearest, float(totals[nearest]), path)


def _within_face(question: Question, point: SurfacePoint, control: Control) -> float:
    """Return the length of the straight path to the nearest source in the face of a point."""
    mesh = question.mesh
    sources = [line[0] for line in question.polylines]
    starts = question.start_distances
    return min(
        (
            start + length_in_face(mesh, source, point)
            for source, start in control.watched(zip(sources, starts.tolist(), strict=True))
            if source.face_index == point.face_index
        ),
        default=math.inf,
    )
