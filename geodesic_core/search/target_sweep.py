"""Sweeps from one point to some others, one after another in the same memory."""

import math
from collections.abc import Callable

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.fields.sources import Ends
from geodesic_core.fields.sweep import share_of_vertices, sweep_nodes
from geodesic_core.kernels.front import pruning, state
from geodesic_core.kernels.front.bounds import exact_bounds
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.state import NO_SITES, Sites, Wavefront, new_wavefront, with_sites
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SEARCH_SLACK

_RESET = 3
"""Cost of resetting a vertex, in those of allocating it. Resetting all takes 3 % of a whole sweep,
which therefore allocates anew."""


class TargetSweep:
    """Exact distances between points of one mesh, by sweeps in reused memory; for one thread.

    A short sweep resets the vertices that it touched, so that its cost does not depend on the size
    of the mesh. Each stops once it has found its targets.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self._room = 0
        self._wave = self._new_wave()
        self._vertices = np.bincount(mesh.components)

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, the mesh not counted."""
        return state.bytes_of(self._wave)

    def distances(
        self, ends: Ends, source: int, targets: Ints, count: int, limit: float, control: Control
    ) -> Floats:
        """Return the exact distances of the nearest ``count`` targets from a source of ``ends``.

        Distances of other targets, which are farther, may be too large; those beyond ``limit`` are
        infinite. A ``count`` beyond the targets that can be reached costs time only.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `run_sweep`.
        """
        nodes = ends.between(source, targets)
        self._make_room(nodes.sites.nodes)
        bounds = exact_bounds(limit)
        wave = self._wave = with_sites(self._wave, nodes.sites)
        control.check_memory(self.nbytes)
        share = share_of_vertices(int(self._vertices[nodes.components[0]]), limit)
        limit_of = _limit_of(nodes.targets, ends.corners[targets], ends.reaches[targets], count)
        try:
            wave = self._wave = sweep_nodes(
                self.mesh, wave, nodes, np.zeros(1), bounds, control, share, limit_of
            )
            distances: Floats = wave.vertices.distance[nodes.targets]
        finally:
            if _RESET * wave.counters[TOUCHED] < len(self.mesh.vertices):
                pruning.forget(self.mesh.topology, wave)
            else:
                self._wave = self._new_wave()
        distances[distances > limit] = np.inf
        return distances

    def _make_room(self, nodes: int) -> None:
        if nodes > self._room:
            self._room = nodes
            self._wave = self._new_wave()

    def _new_wave(self) -> Wavefront:
        return new_wavefront(self.mesh.topology, Sites(self._room, *NO_SITES[1:]))


def _limit_of(
    nodes: Ints, corners: Ints, reaches: Floats, count: int
) -> Callable[[Wavefront], float]:
    """Return the limit of a sweep for its nearest ``count`` targets, as a function of its state.

    A distance known so far is that of a path: nothing beyond it can be nearer. While a target that
    counts has none, there is no limit. So where all count, one of these is looked at first: to look
    at all each time takes 2 % of a sweep to 30 000 vertices.
    """
    others = np.flatnonzero(reaches.any(axis=1))  # than vertices, whose corner is the vertex itself
    corners, reaches = corners[others], reaches[others]
    all_count, vertices = count >= len(nodes), np.delete(np.arange(len(nodes)), others)
    waited_for = -1

    def limit(wave: Wavefront) -> float:
        nonlocal waited_for
        distance = wave.vertices.distance
        if waited_for >= 0 and math.isinf(distance[waited_for]):
            return math.inf
        known = distance[nodes]
        if len(others):
            past_corners = (distance[corners] + reaches).min(axis=1)
            known[others] = np.minimum(known[others], past_corners)
        if all_count:
            unreached = vertices[np.isinf(known[vertices])]
            waited_for = int(nodes[unreached[-1]]) if len(unreached) else -1
        last = known.max() if all_count else np.partition(known, count - 1)[count - 1]
        return float(last) * (1.0 + SEARCH_SLACK)

    return limit
