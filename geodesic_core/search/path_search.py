"""The path between two points: a sequence of searches with tightening bounds (section 5).

1. Along edges from the target to the start, directed by lower bounds; what it finds is shortened
   across faces: an upper bound U.
2. The merging sweep from the target, pruned by U: lower bounds of the distance to the target.
3. Its backtraced path: a tighter U.
4. The exact sweep from the start, pruned by U and the lower bounds: a thin region.
5. Its backtraced path, which is the answer.

A limit of the length takes the place of U as soon as it is below: a target that is not reached then
is farther.

A fast path is found by step 1 and a fast sweep from the start, pruned by U. Both are pulled tight,
and the shorter is the answer.
"""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np

from geodesic_core.control import Control
from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InternalError,
    MemoryLimitExceeded,
)
from geodesic_core.fields.path import (
    EXACT,
    ErrorBound,
    GeodesicPath,
    located_path,
    rounding_of,
    traced_path,
)
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Nodes, corners_of, nodes_of
from geodesic_core.fields.straighten import straightened_curve
from geodesic_core.fields.sweep import sweep_nodes, winners_of
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.front import pruning, state
from geodesic_core.kernels.front.bounds import (
    LANDMARKS,
    Bounds,
    PruningBounds,
    exact_bounds,
    merging_bounds,
)
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.state import (
    NO_SITES,
    PREDECESSOR,
    Sites,
    Wavefront,
    new_wavefront,
    with_sites,
)
from geodesic_core.kernels.mesh.half_edges import LENGTH
from geodesic_core.kernels.paths import edge_dijkstra, funnel
from geodesic_core.mesh.curve import length_in_face
from geodesic_core.mesh.surface_curve import length_on
from geodesic_core.mesh.surface_point import Point, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.fast_path_sweep import FastPathSweep
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.search.leg import End, Leg, SearchLog
from geodesic_core.tolerances import AT_LIMIT, SEARCH_SLACK, STRAIGHT

GUIDE_ERROR = 1e-3
"""Relative error of the sweep that guides the exact one (the paper's)."""

_MARGIN = 2.0
"""Mean edges by which step 2 looks beyond U: its values next to the path are then not pruned."""

# The share of a search that is done, about, before steps 2 and 4
_AFTER_EDGES = 0.2
_AFTER_APPROXIMATE = 0.9

FAST_PATH = ErrorBound("relative", 0.01, "estimated")
"""The error of fast paths: on each mesh that was measured 99 of 100 are within, see
docs/accuracy.md."""


class PathSearch:
    """Searches for paths on one mesh, in reused memory.

    A search resets the vertices that it touched, so that its cost does not depend on the size of
    the mesh.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        topology = mesh.topology
        room = Sites(2, *NO_SITES[1:])  # both ends may be no vertices
        self._toward = new_wavefront(topology, room, merges=True, paths=True, pruned=True)
        self._outward = new_wavefront(topology, room, pruned=True)
        self._landmarks = Landmarks(mesh)
        self._nearest = np.zeros(len(mesh.vertices) + room.nodes, np.int32)
        self._fast = FastPathSweep(mesh, self._nearest)
        self._state_bytes = state.bytes_of(self._toward) + state.bytes_of(self._outward)
        self._margin = _MARGIN * float(topology.geometry[:, LENGTH].mean())
        self._touched = 0

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, the mesh not counted."""
        held = self._landmarks.distances.nbytes + self._nearest.nbytes + self._state_bytes
        return held + self._fast.nbytes

    def find(
        self,
        source: SurfacePoint,
        target: SurfacePoint,
        control: Control,
        *,
        explain: bool,
        limit: float = math.inf,
    ) -> GeodesicPath:
        """Return an exact path between two canonical points of one component.

        A path to a point in a face may exceed the limit by ``AT_LIMIT``; one to a vertex is found
        where a field reaches that.

        Raises
        ------
        NoPath
            It is longer than ``limit``.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `run_sweep`.
        """
        control.check_memory(self.nbytes)
        control.checkpoint(0.0)
        ends = End(self.mesh, source), End(self.mesh, target)
        leg = Leg(*ends, limit, SEARCH_SLACK, control, SearchLog(self.mesh, explain))
        try:
            path = self._search(leg)
        except InternalError:
            # Rounding on slivers can exceed any slack; without bounds there is nothing to lose.
            # Where many faces lie near each other, the path of the merging sweep may be lost.
            leg = Leg(*ends, limit, math.inf, control, SearchLog(self.mesh, explain))
            path = self._search(leg)
        is_rounding = limit * (1.0 - AT_LIMIT) < path.length
        if is_rounding and target.vertex_index is not None and not self._is_within(leg):
            raise leg.beyond()
        return path

    def find_fast(
        self,
        source: SurfacePoint,
        target: SurfacePoint,
        control: Control,
        *,
        effort: int,
        explain: bool,
        limit: float = math.inf,
    ) -> GeodesicPath:
        """Return a path between two canonical points of one component, usually the shortest.

        It is as short as any that lies near it, and `FAST_PATH` estimates its excess. ``effort`` is
        that of the sweep, as in `fast_distance`.

        Raises
        ------
        NoPath
            The one that was found is longer than ``limit``.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `run_sweep`.
        """
        control.check_memory(self.nbytes)
        control.checkpoint(0.0)
        ends, log = (End(self.mesh, source), End(self.mesh, target)), SearchLog(self.mesh, explain)
        leg = Leg(*ends, limit, SEARCH_SLACK, control, log)
        if leg.straight > leg.longest:
            raise leg.beyond()
        try:
            upper, stops = self._search_edges(leg)
            end = leg.end
            toward = self._landmarks.pruning_through(
                end.position, end.corners, end.reaches, math.inf
            )
            others = control.holding(self.nbytes - self._fast.nbytes)
            before = self._fast.touched
            swept = self._fast.curve(leg, upper, toward, effort, others, _AFTER_EDGES)
            self._touched += self._fast.touched - before
        finally:
            self._forget()
        quiet = replace(control.holding(self.nbytes), progress=None)
        curves = [straightened_curve(swept, quiet)] if swept is not None else []
        if not curves or curves[0].length > upper:
            curves.append(straightened_curve(self.mesh.curve(stops), quiet))
        best = min(curves, key=lambda curve: curve.length)
        log.add("straighten", best.length)
        if best.length > leg.longest:
            raise leg.beyond()
        return GeodesicPath(**vars(best), error_bound=FAST_PATH, steps=log.steps)

    def _is_within(self, leg: Leg) -> bool:
        """Tell whether a vertex is within the limit for fields, whose sums round differently."""
        control = replace(leg.control.holding(self.nbytes), progress=None)
        ends = leg.start.point, leg.end.point
        question = Question.of(self.mesh, *ends, leg.limit, control)
        distance = ExactSweep(question).run(control).vertices.distance
        return math.isfinite(distance[question.nodes.targets[0]])

    def _search(self, leg: Leg) -> GeodesicPath:
        if leg.straight > leg.longest:
            raise leg.beyond()
        try:
            upper, _ = self._search_edges(leg)
            start = leg.start
            pruning_bounds = self._landmarks.pruning_through(
                start.position, start.corners, start.reaches, math.inf
            )
            if leg.slack < math.inf:
                upper, pruning_bounds = self._sweep_toward(leg, upper, pruning_bounds)
            path = self._sweep_outward(leg, upper, pruning_bounds)
        finally:
            self._forget()
        if path.length > leg.longest:
            raise leg.beyond()
        return path if leg.log.steps is None else replace(path, steps=leg.log.steps)

    def add_landmark_if_due(self, beside: SurfacePoint, control: Control) -> None:
        """Add a landmark in the component of a point, once searches touched as many vertices.

        So landmarks never cost more than was spent without them. A stop of the call before the
        landmark is done is left for the next call to raise: it must not lose the path just found.
        """
        count = self._landmarks.count
        due = self._touched >= (count + 1) * len(self.mesh.vertices)
        if due and count < LANDMARKS:
            with suppress(Cancelled, DeadlineExceeded, MemoryLimitExceeded):
                corners, _ = corners_of(self.mesh, beside)
                self._landmarks.add(int(corners[0]), control.holding(self.nbytes))

    def _search_edges(self, leg: Leg) -> tuple[float, list[Point]]:
        """Return the length of a path along edges, shortened across faces (step 1), and its stops.

        At an end that is no vertex it begins or ends at the nearest corner. In one face it is
        straight, where that is shorter.
        """
        topology, wave = self.mesh.topology, self._outward
        first, last = leg.start.nearest_corner, leg.end.nearest_corner
        beside = float(leg.start.reaches.min() + leg.end.reaches.min())
        corner = (
            self.mesh.positions_for_bounds[first].copy(),
            np.array([first], np.int32),
            np.zeros(1),
        )
        bounds = exact_bounds(math.inf, self._landmarks.pruning_through(*corner, math.inf))
        edge_dijkstra.search_edges(topology, wave, bounds, last, first)
        self._touched += int(wave.counters[TOUCHED])
        upper = float(wave.vertices.distance[first])
        if math.isinf(upper):
            raise leg.lost("along edges")
        leg.log.add("dijkstra", upper + beside, wave)
        path = edge_dijkstra.vertices_to(wave.vertices.winner_ints[:, PREDECESSOR], first)
        pruning.forget(topology, wave)
        if leg.slack < math.inf:  # else only what is sure: faces without area unfold to anything
            # Unfolding rounds: by more than the slack of the searches, where faces are slivers.
            upper = min(upper, funnel.shortened(topology, path) * (1.0 + STRAIGHT))
        upper += beside
        ends = leg.start.point, leg.end.point
        vertices = topology.outer_vertex[path].tolist()
        stops = [ends[0], *vertices, ends[1]]
        if ends[0].face_index == ends[1].face_index:
            straight = length_in_face(self.mesh, *ends)
            if straight < upper:
                upper, stops = straight, [*ends]
        leg.log.add("shorten", upper)
        return upper, stops

    def _sweep_toward(
        self, leg: Leg, upper: float, pruning_bounds: PruningBounds
    ) -> tuple[float, PruningBounds]:
        """Return a tighter upper bound, and the bounds of the next sweep (steps 2 and 3)."""
        limit = leg.loosened(leg.bound(upper)) + self._margin
        bounds = merging_bounds(
            math.inf, GUIDE_ERROR, math.inf, pruning_bounds._replace(limit=limit)
        )
        nodes = nodes_of(self.mesh, [(leg.end.point,)], [leg.start.point], leg.control)
        self._toward = with_sites(self._toward, nodes.sites)
        wave = self._toward = self._run(self._toward, nodes, bounds, leg.control, _AFTER_EDGES)
        node = int(nodes.targets[0])
        if math.isinf(wave.vertices.distance[node]):
            raise leg.missed("by the merging sweep", upper)
        self._touched += int(wave.counters[TOUCHED])
        leg.log.add("approximate", upper, wave)
        guide = located_path(self.mesh, winners_of(wave, self._nearest), nodes, node)
        upper = min(upper, length_on(self.mesh, *guide))
        leg.log.add("backtrace", upper)
        tighter = leg.loosened(leg.bound(upper))
        return upper, pruning_bounds._replace(
            limit=tighter, known=wave.vertices.distance, ceiling=limit
        )

    def _sweep_outward(self, leg: Leg, upper: float, pruning_bounds: PruningBounds) -> GeodesicPath:
        """Return the path (steps 4 and 5)."""
        bounds = exact_bounds(math.inf, pruning_bounds)
        nodes = nodes_of(self.mesh, [(leg.start.point,)], [leg.end.point], leg.control)
        self._outward = with_sites(self._outward, nodes.sites)
        wave = self._outward = self._run(
            self._outward, nodes, bounds, leg.control, _AFTER_APPROXIMATE
        )
        node = int(nodes.targets[0])
        distance = float(wave.vertices.distance[node])
        if math.isinf(distance) or distance > leg.loosened(upper):
            raise leg.missed("by the exact sweep", upper)
        leg.log.add("exact", distance, wave)
        path = traced_path(self.mesh, winners_of(wave, self._nearest), nodes, node, EXACT)
        if abs(path.length - distance) > rounding_of(self.mesh, distance):
            raise leg.lost(f"by backtracing, at {path.length} for {distance},")
        leg.log.add("path", distance)
        return path

    def _run(
        self, wave: Wavefront, nodes: Nodes, bounds: Bounds, control: Control, share: float
    ) -> Wavefront:
        before, size = wave, state.bytes_of(wave)
        control = control.holding(self.nbytes - size)
        wave = sweep_nodes(self.mesh, wave, nodes, np.zeros(1), bounds, control, lambda _: share)
        if wave is not before:  # it has grown
            self._state_bytes += state.bytes_of(wave) - size
        return wave

    def _forget(self) -> None:
        pruning.forget(self.mesh.topology, self._toward)
        pruning.forget(self.mesh.topology, self._outward)
