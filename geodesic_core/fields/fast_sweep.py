"""Fast sweeps, run to their end: distances that are lengths of paths, with an estimated error."""

import time
from dataclasses import dataclass

import numpy as np

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InternalError
from geodesic_core.fields.path import ErrorBound
from geodesic_core.fields.repeatable_sweep import RepeatableSweep, all_winners
from geodesic_core.kernels.fast import sweep
from geodesic_core.kernels.fast.state import fast_bounds, new_wavefront
from geodesic_core.kernels.front.counters import REACHED, WORK
from geodesic_core.kernels.front.state import Wavefront, bytes_of, with_larger_pool
from geodesic_core.kernels.mesh.half_edges import LENGTH
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import Winners
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
        topology, bounds = mesh.topology, fast_bounds(self.exact.bounds)
        wave = new_wavefront(
            topology, nodes.sites, self.effort, self._bucket_width, nodes.first_target
        )
        while len(wave.pool.windows) < len(nodes.sources) + nodes.sites.windows:
            wave = with_larger_pool(wave)
        control.check_memory(bytes_of(wave))
        control.checkpoint(0.0)
        sweep.start_sweep(topology, wave, nodes.sources, nodes.source_indices, starts, bounds)
        reachable = max(int(np.isin(mesh.components, nodes.components).sum()), 1)
        budget, outcome, left = _FIRST_BUDGET, Outcome.RUNNING, MOST_CROSSINGS * len(topology.links)
        while outcome != Outcome.FINISHED:
            control.checkpoint(min(float(wave.counters[REACHED]) / reachable, 1.0))
            began = time.perf_counter()
            outcome = sweep.advance(topology, wave, bounds, budget)
            took = time.perf_counter() - began
            left -= int(wave.counters[WORK])
            if outcome != Outcome.FINISHED and left < 0:
                raise InternalError(
                    "the sweep does not end: its windows go in circles; please report this mesh, "
                    "and use exact_distance for it"
                )
            if outcome == Outcome.POOL_FULL:
                wave = with_larger_pool(wave)
                control.check_memory(bytes_of(wave))
            elif outcome == Outcome.RUNNING:
                faster = min(max(SLICE_SECONDS / took, 0.5), 2.0)
                budget = max(int(budget * faster), _SMALLEST_BUDGET)
        if nodes.has_site_targets:
            sweep.reach_sites_inside(topology, wave, bounds, nodes.first_target)
        wave.vertices.distance[wave.vertices.distance > bounds.max_distance] = np.inf
        if control.progress is not None:
            control.progress(1.0)
        return wave

    def find_winners(self, control: Control) -> Winners:
        """Run the sweep for the data of paths."""
        return all_winners(self.run(control))

    @property
    def _bucket_width(self) -> float:
        """Width of a bucket, mesh units."""
        lengths = self.exact.mesh.topology.geometry[:, LENGTH]
        return float(lengths[:: max(len(lengths) // _SAMPLES, 1)].mean())


def estimated_error(effort: int) -> ErrorBound:
    """Return the estimated error of the distances of fast sweeps."""
    return ErrorBound("relative", ESTIMATES[effort], "estimated")
