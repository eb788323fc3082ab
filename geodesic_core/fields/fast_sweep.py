"""Fast sweeps, run to their end: distances that are lengths of paths, with an estimated error."""

import time
from dataclasses import dataclass

import numpy as np

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InternalError
from geodesic_core.fields.path import ErrorBound
from geodesic_core.fields.repeatable_sweep import RepeatableSweep, SweepResult, SweepStats
from geodesic_core.kernels.fast import emission, state, sweep
from geodesic_core.kernels.fast.state import FastBounds, Wavefront
from geodesic_core.kernels.front.state import MERGE, MERGE_INTS
from geodesic_core.kernels.mesh.half_edges import LENGTH
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.sweep.continuous_dijkstra import nearest_sources
from geodesic_core.tolerances import MOST_CROSSINGS

ESTIMATES = {1: 0.03, 2: 0.01, 4: 0.005, 8: 0.002}
"""Estimated relative errors by effort, the number of places of a half-edge.

In 19 of 20 fields that were measured, 99 of 100 vertices lie within; see docs/accuracy.md.
"""

_FIRST_BUDGET = 50_000
_SMALLEST_BUDGET = 1_000
_SAMPLES = 1024
"""Edges whose mean length is the width of a bucket, about: it hardly matters"""


@dataclass(frozen=True)
class FastSweep:
    """A fast sweep that can be run any number of times, with the same result to the bit."""

    exact: RepeatableSweep
    """The same question for an exact sweep"""
    effort: int

    def run(self, control: Control) -> Wavefront:
        """Return the state after the sweep.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As the control says.
        InternalError
            If it crosses more than `MOST_CROSSINGS` windows per half-edge: else it might never end.
        """
        mesh, nodes, starts = self.exact.mesh, self.exact.nodes, self.exact.start_distances
        topology, bounds = mesh.topology, self._bounds()
        front = state.new_wavefront(topology, nodes.sites, self.effort, nodes.first_target)
        while len(front.windows) < len(nodes.sources) + nodes.sites.windows:
            front = state.with_larger_pool(front)
        control.check_memory(state.bytes_of(front))
        control.checkpoint(0.0)
        sweep.start_sweep(topology, front, nodes.sources, nodes.source_indices, starts, bounds)
        reachable = max(int(np.isin(mesh.components, nodes.components).sum()), 1)
        budget, outcome, left = _FIRST_BUDGET, Outcome.RUNNING, MOST_CROSSINGS * len(topology.links)
        while outcome != Outcome.FINISHED:
            control.checkpoint(min(float(front.counters[state.REACHED]) / reachable, 1.0))
            began = time.perf_counter()
            outcome = sweep.advance(topology, front, bounds, budget)
            took = time.perf_counter() - began
            left -= int(front.counters[state.WORK])
            if outcome != Outcome.FINISHED and left < 0:
                raise InternalError(
                    "the sweep does not end: its windows go in circles; please report this mesh, "
                    "and use exact_distance for it"
                )
            if outcome == Outcome.POOL_FULL:
                front = state.with_larger_pool(front)
                control.check_memory(state.bytes_of(front))
            elif outcome == Outcome.RUNNING:
                faster = min(max(SLICE_SECONDS / took, 0.5), 2.0)
                budget = max(int(budget * faster), _SMALLEST_BUDGET)
        if nodes.has_site_targets:
            emission.reach_sites_inside(topology, front, bounds, nodes.first_target)
        front.distance[front.distance > bounds.max_distance] = np.inf
        if control.progress is not None:
            control.progress(1.0)
        return front

    def result_of(self, front: Wavefront, *, paths: bool) -> SweepResult:
        """Return the result of a `run`."""
        winners = winners_of(front)
        return SweepResult(front.distance, winners.nearest, winners if paths else None, None)

    def find_winners(self, control: Control) -> Winners:
        """Run the sweep for the data of paths."""
        return winners_of(self.run(control))

    def stats_of(self, front: Wavefront, seconds: float) -> SweepStats:
        """Return the statistics of a `run`."""
        created, kept, peak = (
            int(front.counters[i]) for i in (state.CREATED, state.CROSSED, state.PEAK)
        )
        return SweepStats.of(self.exact.mesh, created, kept, peak, state.bytes_of(front), seconds)

    def _bounds(self) -> FastBounds:
        exact = self.exact.bounds
        lengths = self.exact.mesh.topology.geometry[:, LENGTH]
        width = float(lengths[:: max(len(lengths) // _SAMPLES, 1)].mean())
        return FastBounds(
            max_distance=exact.max_distance,
            places=self.effort,
            buckets_per_unit=1.0 / width if width > 0.0 else 1.0,
            merging=(),
            parallel=exact.parallel,
            first_segment=exact.first_segment,
        )


def estimated_error(effort: int) -> ErrorBound:
    """Return the estimated error of the distances of fast sweeps."""
    return ErrorBound("relative", ESTIMATES[effort], "estimated")


def winners_of(front: Wavefront) -> Winners:
    """Return what backtracing needs of a sweep that has finished."""
    sites = front.sites
    return Winners(
        nearest=nearest_sources(front.distance, front.winner_ints, front.source_index),
        distance=front.distance,
        winner=front.winner,
        winner_ints=front.winner_ints,
        crossing=front.crossing,
        reference=np.empty(0, np.int32),
        merges=np.empty((0, MERGE)),
        merge_ints=np.empty((0, MERGE_INTS), np.int32),
        site_ints=sites.ints,
        site_weights=sites.weights,
        piece_ints=sites.segment_ints,
        piece_ends=sites.segment_ends,
    )
