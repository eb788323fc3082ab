"""Sweeps run to their end, slice by slice, under the control of the caller."""

import math
import time
from collections.abc import Callable

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import NotConverged
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.sweep import continuous_dijkstra, state, surface_points
from geodesic_core.kernels.sweep.bounds import Bounds
from geodesic_core.kernels.sweep.state import Wavefront
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import RUNS

_FIRST_BUDGET = 1_000_000

_FIRST_LIMITED_BUDGET = 10_000
_LIMITED_GROWTH = 1.25
"""Of the slices of a sweep whose limit shrinks: each is a quarter of all before it, so that a sweep
does not go on for longer than that once it has found enough."""


_GROW: dict[Outcome, Callable[[Wavefront], Wavefront]] = {
    Outcome.POOL_FULL: state.with_larger_pool,
    Outcome.SCRATCH_FULL: state.with_larger_scratch,
    Outcome.RETAINED_FULL: state.with_more_retained,
    Outcome.MERGES_FULL: state.with_more_merges,
}
"""How a wavefront grows where a sweep ended for want of room."""


def sweep_nodes(
    mesh: TriangleMesh,
    wave: Wavefront,
    nodes: Nodes,
    start_distances: Floats,
    bounds: Bounds,
    control: Control,
    share_done: Callable[[Wavefront], float],
    limit_of: Callable[[Wavefront], float] | None = None,
) -> Wavefront:
    """Start a sweep at the sources of ``nodes``, run it to its end, and reach its targets.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded, NotConverged
        As in `run_sweep`.
    """
    topology = mesh.topology
    continuous_dijkstra.start_sweep(
        topology, wave, nodes.sources, nodes.source_indices, start_distances, bounds
    )
    if not nodes.has_site_targets:
        return run_sweep(mesh, wave, bounds, control, share_done, limit_of)
    surface_points.watch_sites(wave.sites.ints, wave.pool.lists, nodes.first_target)
    wave = run_sweep(mesh, wave, bounds, control, share_done, limit_of)
    surface_points.reach_sites_inside(topology, wave, bounds, nodes.first_target)
    return wave


def run_sweep(
    mesh: TriangleMesh,
    wave: Wavefront,
    bounds: Bounds,
    control: Control,
    share_done: Callable[[Wavefront], float],
    limit_of: Callable[[Wavefront], float] | None = None,
) -> Wavefront:
    """Run a sweep that has started to its end; return its state, which may have grown.

    ``share_done`` tells how much of the call is done. ``limit_of`` tells, from what is known so
    far, how far the sweep still has to look: never farther than ``bounds``. It is asked after fixed
    amounts of work, so that the sweep stays the same to the bit.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    NotConverged
        The windows of an edge came up too often.
    """
    budget = _FIRST_BUDGET if limit_of is None else _FIRST_LIMITED_BUDGET
    left, shown, outcome = budget, 0.0, Outcome.RUNNING
    while outcome != Outcome.FINISHED:
        shown = max(shown, share_done(wave))
        control.checkpoint(shown)
        began = time.perf_counter()
        outcome = continuous_dijkstra.advance(mesh.topology, wave, bounds, left)
        took = time.perf_counter() - began
        if outcome == Outcome.RUNAWAY:
            raise _not_converged(mesh, wave)
        if outcome in _GROW:
            left -= int(wave.counters[state.WORK])  # slices do not depend on the room there was
            wave = _GROW[outcome](wave)
            control.check_memory(state.bytes_of(wave))
            continue
        if outcome == Outcome.RUNNING and limit_of is not None:
            limit = min(bounds.max_distance, limit_of(wave))
            bounds = bounds._replace(max_distance=limit)
            budget = min(int(_LIMITED_GROWTH * budget), _FIRST_BUDGET)
        elif outcome == Outcome.RUNNING:
            budget = int(budget * min(max(SLICE_SECONDS / took, 0.5), 2.0))
        left = budget
    return wave


def winners_of(wave: Wavefront, nearest: Ints) -> Winners:
    """Return what backtracing needs of a sweep that has finished; ``nearest`` as in `Winners`."""
    count = wave.counters[state.MERGES]
    return Winners(
        nearest=nearest,
        distance=wave.vertices.distance,
        winner=wave.vertices.winner,
        winner_ints=wave.vertices.winner_ints,
        reference=wave.vertices.reference,
        merges=wave.pool.merges[:count],
        merge_ints=wave.pool.merge_ints[:count],
        site_ints=wave.sites.ints,
        site_weights=wave.sites.weights,
        piece_ints=wave.sites.segment_ints,
        piece_ends=wave.sites.segment_ends,
    )


def _not_converged(mesh: TriangleMesh, wave: Wavefront) -> NotConverged:
    half_edge = int(np.argmax(wave.pool.runs))
    ends = mesh.topology.links[half_edge, [TAIL, HEAD]]
    u, v = mesh.topology.outer_vertex[ends]
    return NotConverged(
        f"the windows of the edge between vertices {u} and {v} came up more than {RUNS} times; "
        f"ask for a smaller error, or for exact distances"
    )


def share_of_vertices(reachable: int, limit: float) -> Callable[[Wavefront], float]:
    """Return the share done as a function of the state: of the vertices, or of a limit."""

    def share(wave: Wavefront) -> float:
        done = float(wave.counters[state.SETTLED_VERTICES]) / reachable
        if math.isfinite(limit) and wave.counters[0] > 0:
            done = max(
                done, float(wave.vertices.distance[wave.queues.heap[0]]) / limit if limit else 1.0
            )
        return min(done, 1.0)

    return share
