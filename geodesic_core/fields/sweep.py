"""Sweeps run to their end, slice by slice, under the control of the caller."""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InternalError
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.front import counters, pruning, state
from geodesic_core.kernels.front.bounds import Bounds, without_merging
from geodesic_core.kernels.front.rows import Rows
from geodesic_core.kernels.front.state import PREDECESSOR, Merges, Wavefront
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import NO_END, Winners
from geodesic_core.kernels.sweep import continuous_dijkstra, further_sources, site_targets
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_FIRST_BUDGET = 1_000_000
NEVER = 1 << 62
"""More work than a sweep ever does"""
_SMALLEST_BUDGET = 1_000

_GROW: dict[Outcome, Callable[[Wavefront], Wavefront]] = {
    Outcome.POOL_FULL: state.with_larger_pool,
    Outcome.SCRATCH_FULL: state.with_larger_scratch,
    Outcome.RETAINED_FULL: state.with_more_retained,
    Outcome.MERGES_FULL: state.with_more_merges,
}
"""How a wavefront grows where a sweep ended for want of room."""


class Engine(NamedTuple):
    """The kernel that advances a sweep, and its budgets of work."""

    advance: Callable[[Topology, Wavefront, Bounds, int], Outcome]
    """Kernel that does a slice of work, of a given budget"""
    first_budget: int | None = None
    """None for the usual one"""
    most_work: float = math.inf
    """Work after which the sweep counts as one that never ends"""


class RowMethod(NamedTuple):
    """The means by which a sweep finds rows of a table."""

    bounds: Bounds
    advance: Callable[[Topology, Wavefront, Bounds, Rows, int], Outcome]
    """Kernel that does a slice of work on some rows"""
    first_budget: int | None
    """As of an `Engine`"""
    ends_early: bool
    """Whether a sweep ends once it has found all that is wanted: exact ones do"""
    most_work: int
    """Work after which a sweep counts as one that never ends"""


def sweep_nodes(
    mesh: TriangleMesh,
    wave: Wavefront,
    nodes: Nodes,
    start_distances: Floats,
    bounds: Bounds,
    control: Control,
    share_done: Callable[[Wavefront], float],
    engine: Engine | None = None,
) -> Wavefront:
    """Start a sweep at the sources of ``nodes``, run it to its end, and reach its targets.

    A merging sweep in which a list comes up more than `RUNS` times begins anew and merges nothing:
    exact distances are within every error.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `run_sweep`.
    InternalError
        If a list of an exact sweep comes up more than `MOST_RUNS` times: else it would never end.
    """
    topology, shown = mesh.topology, 0.0

    def share(wave: Wavefront) -> float:
        nonlocal shown
        shown = max(shown, share_done(wave))
        return shown

    def sweep(wave: Wavefront, bounds: Bounds) -> tuple[Wavefront, Outcome]:
        continuous_dijkstra.start_sweep(
            topology, wave, nodes.sources, nodes.source_indices, start_distances, bounds
        )
        if nodes.has_site_targets:
            site_targets.watch_sites(wave.sites.ints, wave.pool.lists, nodes.first_target)
        wave, outcome = run_sweep(mesh, wave, bounds, control, share, engine)
        if nodes.has_site_targets and outcome == Outcome.FINISHED:
            continuous_dijkstra.reach_sites_inside(topology, wave, bounds, nodes.first_target)
        return wave, outcome

    wave, outcome = sweep(wave, bounds)
    if outcome == Outcome.RUNAWAY and bounds.merging:
        pruning.forget(topology, wave)
        wave, outcome = sweep(wave, without_merging(bounds))
        wave.vertices.reference[:] = -1 - wave.vertices.winner_ints[:, PREDECESSOR]
    if outcome == Outcome.RUNAWAY:
        raise endless(topology, wave)
    return wave


def endless(topology: Topology, wave: Wavefront) -> InternalError:
    """Return the error of an exact sweep one of whose lists has come up too often."""
    half_edge = wave.queues.ring[wave.counters[counters.RING_HEAD]]
    return InternalError(
        f"the sweep does not end: its windows go in circles through face "
        f"{topology.outer_face[half_edge // 3]}; please report this mesh, and use "
        f"fast_distance for it"
    )


def add_source(
    mesh: TriangleMesh, wave: Wavefront, vertex: int, index: int, bounds: Bounds, control: Control
) -> Wavefront:
    """Extend an exact sweep that has finished by a source, an inner vertex; return its state.

    Distances and nearest sources are then as if it had been among the sources before. O(windows of
    the part that is nearer to it).

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    InternalError
        As in `sweep_nodes`.
    """
    further_sources.add_source(mesh.topology, wave, bounds, vertex, index)
    wave, outcome = run_sweep(mesh, wave, bounds, control, lambda _: 0.0)
    if outcome == Outcome.RUNAWAY:
        raise endless(mesh.topology, wave)
    return wave


def run_sweep(
    mesh: TriangleMesh,
    wave: Wavefront,
    bounds: Bounds,
    control: Control,
    share_done: Callable[[Wavefront], float],
    engine: Engine | None = None,
) -> tuple[Wavefront, Outcome]:
    """Run a sweep that has started to its end; return its state, which may have grown.

    Return also how it ended: FINISHED, RUNAWAY, or in another way of the engine's.

    ``share_done`` tells how much of the call is done. The ``engine`` is that of continuous Dijkstra
    by default.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    engine = engine or Engine(continuous_dijkstra.advance)
    budget = engine.first_budget or _FIRST_BUDGET
    left, outcome, done = budget, Outcome.RUNNING, 0
    while outcome == Outcome.RUNNING or outcome in _GROW:
        control.checkpoint(share_done(wave))
        began = time.perf_counter()
        outcome = engine.advance(mesh.topology, wave, bounds, left)
        took = time.perf_counter() - began
        work = int(wave.counters[counters.WORK])
        done += work
        if outcome != Outcome.FINISHED and done > engine.most_work:
            return wave, Outcome.RUNAWAY
        if outcome in _GROW:
            left -= work  # slices do not depend on the room there was
            wave = _GROW[outcome](wave)
            control.check_memory(state.bytes_of(wave))
            continue
        if outcome == Outcome.RUNNING:
            faster = min(max(SLICE_SECONDS / took, 0.5), 2.0)
            budget = min(max(int(budget * faster), _SMALLEST_BUDGET), NEVER)
        left = budget
    return wave, Outcome(outcome)


def winners_of(wave: Wavefront, nearest: Ints) -> Winners:
    """Return what backtracing needs of a sweep that has finished; ``nearest`` as in `Winners`."""
    count = wave.counters[counters.MERGES]
    return Winners(
        nearest=nearest,
        vertices=state.found(wave.vertices._asdict()),
        merges=Merges(wave.merges.floats[:count], wave.merges.ints[:count]),
        sites=wave.sites,
        target=NO_END,
    )


def share_of_vertices(reachable: int, limit: float) -> Callable[[Wavefront], float]:
    """Return the share done as a function of the state: of the vertices, or of a limit."""

    def share(wave: Wavefront) -> float:
        done = float(wave.counters[counters.SETTLED_VERTICES]) / reachable
        if math.isfinite(limit) and wave.counters[counters.HEAP_SIZE] > 0:
            done = max(
                done, float(wave.vertices.distance[wave.queues.heap[0]]) / limit if limit else 1.0
            )
        return min(done, 1.0)

    return share
