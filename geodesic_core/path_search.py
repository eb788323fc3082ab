"""The exact path between two vertices: a sequence of searches with tightening bounds (section 5).

1. Along edges from the target to the start, directed by lower bounds; what it finds is shortened
   across faces: an upper bound U.
2. The merging sweep from the target, pruned by U: lower bounds of the distance to the target.
3. Its backtraced path: a tighter U.
4. The exact sweep from the start, pruned by U and the lower bounds: a thin region.
5. Its backtraced path, which is the answer.
"""

import math
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np

from geodesic_core.arrays import Ints
from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InternalError,
    MemoryLimitExceeded,
    NotConverged,
)
from geodesic_core.kernels import edge_path, prune, straighten, sweep, wavefront
from geodesic_core.kernels.backtrace import Winners
from geodesic_core.kernels.topology import LENGTH
from geodesic_core.kernels.wavefront import CREATED, FROM, TOUCHED, Bounds, Goal, Wavefront, goal_at
from geodesic_core.landmarks import Landmarks
from geodesic_core.mesh import TriangleMesh
from geodesic_core.path import EXACT, GeodesicPath, SearchStep, StepName, length_of, traced_path
from geodesic_core.run import Control, run_sweep
from geodesic_core.tolerances import PATH_LENGTH, SEARCH_SLACK, STRAIGHT

GUIDE_ERROR = 1e-3
"""Relative error of the sweep that guides the exact one (the paper's)."""

_MARGIN = 2.0
"""Mean edges by which step 2 looks beyond U: its values next to the path are then not pruned."""

# The share of a search that is done, about, before steps 2 and 4
_AFTER_EDGES = 0.2
_AFTER_APPROXIMATE = 0.9


class PathSearch:
    """Searches for paths on one mesh, with memory that is kept between them.

    A search resets what it touched, so that its cost does not depend on the size of the mesh.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        topology = mesh.topology
        self._toward = wavefront.new_wavefront(topology, merges=True, paths=True, pruned=True)
        self._outward = wavefront.new_wavefront(topology, pruned=True)
        self._landmarks = Landmarks(mesh)
        self._nearest = np.zeros(len(mesh.vertices), np.int32)
        self._margin = _MARGIN * float(topology.geometry[:, LENGTH].mean())
        self._touched = 0

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, the mesh not counted."""
        kept = self._landmarks.distances.nbytes + self._nearest.nbytes
        return kept + wavefront.bytes_of(self._toward) + wavefront.bytes_of(self._outward)

    def find(self, source: int, target: int, control: Control, *, explain: bool) -> GeodesicPath:
        """Return an exact path between two vertices of one component.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded, NotConverged
            As in `run_sweep`.
        """
        control.grant_memory(self.nbytes)
        control.look_up(0.0)
        inner = self.mesh.topology.inner_vertex
        start, end = int(inner[source]), int(inner[target])
        try:
            return self._search(start, end, SEARCH_SLACK, control, _Log(self, explain))
        except _LostError:
            # Rounding on slivers can exceed any slack; without bounds there is nothing to lose.
            return self._search(start, end, math.inf, control, _Log(self, explain))

    def _search(
        self, start: int, end: int, slack: float, control: Control, log: "_Log"
    ) -> GeodesicPath:
        try:
            upper = self._search_edges(start, end, log)
            upper, toward = self._sweep_toward(start, end, upper, slack, control, log)
            path = self._sweep_outward(start, end, upper, slack, toward, control, log)
        finally:
            self._forget()
        return replace(path, steps=log.steps)

    def add_landmark_if_due(self, beside: int, control: Control) -> None:
        """Add a landmark in the component of a vertex, once searches touched as much as it will.

        So landmarks never cost more than what was spent without them. What stops the call before
        there is one is left for the next call to raise: it must not lose the path just found.
        """
        count = self._landmarks.count
        due = self._touched >= (count + 1) * len(self.mesh.vertices)
        if due and count < wavefront.LANDMARKS:
            with suppress(Cancelled, DeadlineExceeded, MemoryLimitExceeded, NotConverged):
                inner = int(self.mesh.topology.inner_vertex[beside])
                self._landmarks.add(inner, self.nbytes, control)

    def _goal(self, start: int, limit: float) -> Goal:
        return goal_at(start, limit, self._landmarks.distances, self._landmarks.count)

    def _search_edges(self, start: int, end: int, log: "_Log") -> float:
        """Return the length of a path along edges, shortened across faces (step 1)."""
        topology, wave = self.mesh.topology, self._outward
        bounds = wavefront.exact_bounds(math.inf, self._goal(start, math.inf))
        edge_path.search_edges(topology, wave, bounds, end, start)
        self._touched += int(wave.counters[TOUCHED])
        upper = float(wave.distance[start])
        if math.isinf(upper):
            raise self._lost(start, end, "along edges")
        log.add("dijkstra", upper, wave)
        path = edge_path.vertices_to(wave.winner_ints[:, FROM], start)
        prune.forget(topology, wave, bounds)
        # Unfolding rounds: by more than the slack of the searches, where faces are slivers.
        upper = min(upper, straighten.shortened(topology, path) * (1.0 + STRAIGHT))
        log.add("shorten", upper)
        return upper

    def _sweep_toward(
        self, start: int, end: int, upper: float, slack: float, control: Control, log: "_Log"
    ) -> tuple[float, Goal]:
        """Return a tighter upper bound, and the goal of the next sweep (steps 2 and 3)."""
        limit = upper * (1.0 + slack) + self._margin
        bounds = wavefront.merging_bounds(math.inf, GUIDE_ERROR, math.inf, self._goal(start, limit))
        self._toward = self._run(self._toward, end, bounds, control, _AFTER_EDGES)
        if math.isinf(self._toward.distance[start]):
            raise self._lost(start, end, "by the merging sweep")
        self._touched += int(self._toward.counters[TOUCHED])
        log.add("approximate", upper, self._toward)
        winners = self._winners(self._toward)
        points = traced_path(self.mesh, winners, start, EXACT).points
        upper = min(upper, length_of(points))
        log.add("backtrace", upper)
        known = self._goal(start, upper * (1.0 + slack))
        return upper, known._replace(known=self._toward.distance, ceiling=limit)

    def _sweep_outward(
        self,
        start: int,
        end: int,
        upper: float,
        slack: float,
        goal: Goal,
        control: Control,
        log: "_Log",
    ) -> GeodesicPath:
        """Return the path (steps 4 and 5)."""
        bounds = wavefront.exact_bounds(math.inf, goal)
        self._outward = self._run(self._outward, start, bounds, control, _AFTER_APPROXIMATE)
        distance = float(self._outward.distance[end])
        if not distance <= upper * (1.0 + slack):
            raise self._lost(start, end, "by the exact sweep")
        log.add("exact", distance, self._outward)
        path = traced_path(self.mesh, self._winners(self._outward), end, EXACT)
        if abs(path.length - distance) > PATH_LENGTH * distance:
            raise self._lost(start, end, f"by backtracing, at {path.length} for {distance},")
        log.add("path", distance)
        return path

    def _run(
        self, wave: Wavefront, begin: int, bounds: Bounds, control: Control, share: float
    ) -> Wavefront:
        starts = np.array([begin], np.int32)
        sweep.start_sweep(self.mesh.topology, wave, starts, np.zeros(1), bounds)
        beside = self.nbytes - wavefront.bytes_of(wave)
        return run_sweep(self.mesh, wave, bounds, control, lambda _: share, beside)

    def _winners(self, wave: Wavefront) -> Winners:
        return Winners(
            nearest=self._nearest,
            distance=wave.distance,
            winner=wave.winner,
            winner_ints=wave.winner_ints,
            reference=wave.reference,
            merges=wave.merges,
            merge_ints=wave.merge_ints,
        )

    def _forget(self) -> None:
        topology = self.mesh.topology
        merging = wavefront.merging_bounds(math.inf, GUIDE_ERROR, math.inf)
        prune.forget(topology, self._toward, merging)
        prune.forget(topology, self._outward, wavefront.exact_bounds(math.inf))

    def _lost(self, start: int, end: int, how: str) -> "_LostError":
        source, target = self.mesh.topology.outer_vertex[[start, end]]
        return _LostError(
            f"vertex {target} was not reached {how} from vertex {source}, though the two are "
            f"connected; please report this mesh"
        )


class _LostError(InternalError):
    """A search did not reach its target."""


class _Log:
    """Notes what each step did, where that is asked for."""

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
            touched = wave.touched[: wave.counters[TOUCHED]]
            prune.mark_visited(self._mesh.topology, wave.distance, touched, visited)
            faces = np.flatnonzero(visited).astype(np.int32)
        windows = 0 if wave is None else int(wave.counters[CREATED])
        self.steps += (SearchStep(0, name, seconds, bound, windows, faces),)
        self._began = time.perf_counter()
