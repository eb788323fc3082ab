"""Fast sweeps: distances that are lengths of paths, with an estimated error."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.errors import InternalError
from geodesic_core.fields.path import ErrorBound
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweep import Engine, RowMethod, run_sweep
from geodesic_core.fields.sweep_result import Retain
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.fast import rows, sweep
from geodesic_core.kernels.fast.state import fast_bounds, new_wavefront
from geodesic_core.kernels.front.bounds import Bounds, exact_bounds
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.state import Wavefront, bytes_of, with_larger_pool
from geodesic_core.kernels.mesh.half_edges import LENGTH, Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.tolerances import MOST_CROSSINGS

ESTIMATES = {1: 0.03, 2: 0.01, 4: 0.005, 8: 0.002}
"""Estimated relative errors by effort, the number of places of a half-edge.

In 19 of 20 fields that were measured, 99 of 100 vertices lie within; see docs/accuracy.md.
"""

_FIRST_BUDGET = 50_000
_SAMPLES = 1024
"""Edges whose mean length is the width of a bucket, about: it hardly matters"""


@dataclass(frozen=True, eq=False)
class FastSweep:
    """A sweep that keeps a window only where it is nearest at one of some places of its edge."""

    question: Question
    effort: int
    """Number of places of a half-edge"""

    @property
    def promise(self) -> ErrorBound:
        """The estimated error."""
        return estimated(self.effort)

    @property
    def exact(self) -> ExactSweep:
        """The exact sweep of the same question."""
        return ExactSweep(self.question)

    @property
    def covering(self) -> None:
        """None: its windows do not cover the faces."""

    def run(self, control: Control, retain: Retain = "distances") -> Wavefront:  # noqa: ARG002
        """Return the state after the sweep, always with the data of paths; see `Sweep.run`.

        Raises
        ------
        InternalError
            If it crosses more than `MOST_CROSSINGS` windows per half-edge: else it might never end.
        """
        question = self.question
        mesh, nodes, topology = question.mesh, question.nodes, question.mesh.topology
        limits, wave = self._bounds, self.row_state()
        while len(wave.pool.windows) < len(nodes.sources) + nodes.sites.windows:
            wave = with_larger_pool(wave)
        control.check_memory(bytes_of(wave))
        control.checkpoint(0.0)
        starts = question.start_distances
        sweep.start_sweep(topology, wave, nodes.sources, nodes.source_indices, starts, limits)
        reachable = max(question.reachable, 1)
        wave, outcome = run_sweep(
            mesh,
            wave,
            limits,
            control,
            lambda wave: min(float(wave.counters[TOUCHED]) / reachable, 1.0),
            engine=engine_on(topology),
        )
        if outcome == Outcome.RUNAWAY:
            raise endless()
        if nodes.has_site_targets:
            sweep.reach_sites_inside(topology, wave, limits, nodes.first_target)
        wave.vertices.distance[wave.vertices.distance > question.max_distance] = np.inf
        control.finish()
        return wave

    def row_state(self) -> Wavefront:
        """Allocate the state of the sweep, nothing reached yet."""
        question = self.question
        return new_wavefront(
            question.mesh.topology,
            question.nodes.sites,
            self.effort,
            bucket_width(question.mesh.topology),
            question.nodes.first_target,
        )

    def row_method(self) -> RowMethod:
        """Return the means to sweep from each source, see `Sweep.row_method`."""
        return RowMethod(
            self._bounds,
            rows.advance_rows,
            _FIRST_BUDGET,
            ends_early=False,
            most_work=_most_work(self.question.mesh.topology),
        )

    def upper_bounds(self, distances: Floats) -> None:
        """Return None: its distances are no lower bounds."""

    def error_of_path(self, excess: float, distance: float, rounding: float) -> ErrorBound:  # noqa: ARG002
        """Return the estimate, for any length: a path follows what was found after its distance."""
        return self.promise

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the effort."""
        return {"effort": np.array(self.effort)}

    @property
    def _bounds(self) -> Bounds:
        return fast_bounds(self.question.bounds(exact_bounds(self.question.max_distance)))


def engine_on(topology: Topology) -> Engine:
    """Return what advances a fast sweep."""
    return Engine(sweep.advance, _FIRST_BUDGET, _most_work(topology))


def _most_work(topology: Topology) -> int:
    return MOST_CROSSINGS * len(topology.links)


def bucket_width(topology: Topology) -> float:
    """Return the width of a bucket, mesh units."""
    lengths = topology.geometry[:, LENGTH]
    return float(lengths[:: max(len(lengths) // _SAMPLES, 1)].mean())


def estimated(effort: int) -> ErrorBound:
    """Return the estimated error of fast distances."""
    return ErrorBound("relative", ESTIMATES[effort], "estimated")


def endless() -> InternalError:
    """Return the error of a fast sweep that has crossed too many windows."""
    return InternalError(
        "the sweep does not end: its windows go in circles; please report this mesh, and use "
        "exact_distance for it"
    )
