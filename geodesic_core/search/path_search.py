"""The exact path between two points: a sequence of searches with tightening bounds (section 5).

1. Along edges from the target to the start, directed by lower bounds; what it finds is shortened
   across faces: an upper bound U.
2. The merging sweep from the target, pruned by U: lower bounds of the distance to the target.
3. Its backtraced path: a tighter U.
4. The exact sweep from the start, pruned by U and the lower bounds: a thin region.
5. Its backtraced path, which is the answer.

A limit of the length takes the place of U as soon as it is below: a target that is not reached then
is farther.
"""

import math
import time
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InternalError,
    MemoryLimitExceeded,
    NoPath,
)
from geodesic_core.fields.path import (
    EXACT,
    GeodesicPath,
    SearchStep,
    StepName,
    located_path,
    rounding_of,
    traced_path,
)
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Nodes, corners_of, nodes_of
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
from geodesic_core.kernels.front.counters import CREATED, TOUCHED
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
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import AT_LIMIT, SEARCH_SLACK, STRAIGHT

GUIDE_ERROR = 1e-3
"""Relative error of the sweep that guides the exact one (the paper's)."""

_MARGIN = 2.0
"""Mean edges by which step 2 looks beyond U: its values next to the path are then not pruned."""

# The share of a search that is done, about, before steps 2 and 4
_AFTER_EDGES = 0.2
_AFTER_APPROXIMATE = 0.9


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
        self._state_bytes = state.bytes_of(self._toward) + state.bytes_of(self._outward)
        self._margin = _MARGIN * float(topology.geometry[:, LENGTH].mean())
        self._touched = 0

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, the mesh not counted."""
        return self._landmarks.distances.nbytes + self._nearest.nbytes + self._state_bytes

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
        ends = _End(self.mesh, source), _End(self.mesh, target)
        leg = _Leg(*ends, limit, SEARCH_SLACK, control, _Log(self, explain))
        try:
            path = self._search(leg)
        except InternalError:
            # Rounding on slivers can exceed any slack; without bounds there is nothing to lose.
            # Where many faces lie near each other, the path of the merging sweep may be lost.
            leg = _Leg(*ends, limit, math.inf, control, _Log(self, explain))
            path = self._search(leg)
        is_rounding = limit * (1.0 - AT_LIMIT) < path.length
        if is_rounding and target.vertex_index is not None and not self._is_within(leg):
            raise leg.beyond()
        return path

    def _is_within(self, leg: "_Leg") -> bool:
        """Tell whether a vertex is within the limit for fields, whose sums round differently."""
        control = replace(leg.control.holding(self.nbytes), progress=None)
        ends = leg.start.point, leg.end.point
        question = Question.of(self.mesh, *ends, leg.limit, control)
        distance = ExactSweep(question).run(control).vertices.distance
        return math.isfinite(distance[question.nodes.targets[0]])

    def _search(self, leg: "_Leg") -> GeodesicPath:
        if leg.straight > leg.longest:
            raise leg.beyond()
        try:
            upper = self._search_edges(leg)
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

    def _search_edges(self, leg: "_Leg") -> float:
        """Return the length of a path along edges, shortened across faces (step 1).

        At an end that is no vertex it begins or ends at the nearest corner.
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
        if leg.start.point.face_index == leg.end.point.face_index:
            upper = min(upper, length_in_face(self.mesh, leg.start.point, leg.end.point))
        leg.log.add("shorten", upper)
        return upper

    def _sweep_toward(
        self, leg: "_Leg", upper: float, pruning_bounds: PruningBounds
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

    def _sweep_outward(
        self, leg: "_Leg", upper: float, pruning_bounds: PruningBounds
    ) -> GeodesicPath:
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


class _End:
    """An end of a search, and the vertices around it."""

    def __init__(self, mesh: TriangleMesh, point: SurfacePoint) -> None:
        self.point = point
        self.position: Floats = mesh.position_for_bounds(point)
        self.corners, self.reaches = corners_of(mesh, point)

    @property
    def nearest_corner(self) -> int:
        """The inner vertex nearest to it."""
        return int(self.corners[self.reaches.argmin()])


class _Leg(NamedTuple):
    """Ends, limits and control of a search."""

    start: _End
    end: _End
    limit: float
    """Length of the longest path that is asked for, mesh units"""
    slack: float
    """Relative amount by which it looks beyond its bounds; infinite where it is not to have any"""
    control: Control
    log: "_Log"

    @property
    def longest(self) -> float:
        """Length above which a path is beyond the limit however it is rounded."""
        return self.limit * (1.0 + AT_LIMIT)

    @property
    def straight(self) -> float:
        """Lower bound of the distance of its ends: as the crow flies, where that is one."""
        return float(np.linalg.norm(self.start.position - self.end.position))

    def bound(self, upper: float) -> float:
        """Return how far to look where a path of length ``upper`` is known.

        Beyond the limit by more than slivers round: a path that is missed is longer than the limit.
        """
        return min(upper, self.limit * (1.0 + STRAIGHT))

    def loosened(self, length: float) -> float:
        """Return a length with the slack: where that is infinite, even if the length is 0.

        Ends in one place may have a path of length 0, and a distance that is rounded.
        """
        return length * (1.0 + self.slack) if self.slack < math.inf else math.inf

    def missed(self, how: str, upper: float) -> NoPath | InternalError:
        """Return the error of not having reached the end, though a path so long leads there."""
        return self.lost(how) if self.bound(upper) == upper else self.beyond()

    def beyond(self) -> NoPath:
        """Return the error of a path that is longer than the limit."""
        return NoPath(
            f"{self.end.point} is farther than {self.limit:g} from {self.start.point}",
            "beyond_max_distance",
        )

    def lost(self, how: str) -> InternalError:
        """Return the error of not having reached the end."""
        return InternalError(
            f"{self.end.point} was not reached {how} from {self.start.point}, though the two are "
            f"connected; please report this mesh"
        )


class _Log:
    """Log of the steps of a search, where they are to be explained."""

    def __init__(self, search: PathSearch, explain: bool) -> None:
        self.steps: tuple[SearchStep, ...] | None = () if explain else None
        self._mesh = search.mesh
        self._began = time.perf_counter()

    def add(self, name: StepName, bound: float, wave: Wavefront | None = None) -> None:
        if self.steps is None:
            return
        seconds = time.perf_counter() - self._began
        faces: Ints = np.empty(0, np.int32)
        if wave is not None:
            visited = np.zeros(len(self._mesh.faces), np.uint8)
            touched = wave.vertices.touched[: wave.counters[TOUCHED]]
            pruning.mark_visited(self._mesh.topology, wave.vertices.distance, touched, visited)
            faces = np.flatnonzero(visited).astype(np.int32)
        windows = 0 if wave is None else int(wave.counters[CREATED])
        self.steps += (SearchStep(0, name, seconds, bound, windows, faces),)
        self._began = time.perf_counter()
