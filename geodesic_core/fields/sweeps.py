"""Sweeps over all of a mesh, exact or merging, run again for what was not retained."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Flags, Floats
from geodesic_core.control import Control
from geodesic_core.fields.isolines import crossed_faces
from geodesic_core.fields.path import EXACT, ErrorBound
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweep import (
    NEVER,
    Engine,
    RowMethod,
    share_of_vertices,
    sweep_nodes,
)
from geodesic_core.fields.sweep_result import Retain, all_winners, peak_bytes
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import (
    Bounds,
    exact_bounds,
    merging_bounds,
    with_directions,
)
from geodesic_core.kernels.front.state import Wavefront
from geodesic_core.kernels.mesh.half_edges import SEAM
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows, face_windows_of
from geodesic_core.kernels.sweep import rows, site_targets
from geodesic_core.tolerances import WIDEST_ERROR


class Sweep(Protocol):
    """A sweep that can be run any number of times, with the same result to the bit."""

    @property
    def question(self) -> Question:
        """The question that it answers."""

    @property
    def promise(self) -> ErrorBound:
        """The error of its distances."""

    @property
    def exact(self) -> "ExactSweep":
        """The exact sweep of the same question; itself where it is exact."""

    @property
    def covering(self) -> "WholeSweep | None":
        """The sweep itself where its windows cover the faces, so that isolines follow them."""

    def run(self, control: Control, retain: Retain = "distances") -> Wavefront:
        """Return the state after the sweep.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As the control says.
        InternalError
            The sweep does not end.
        """

    def row_method(self) -> RowMethod:
        """Return the means to sweep from each source of the question, one after the other."""

    def row_state(self) -> Wavefront:
        """Allocate the state of these sweeps, which reach all targets of the question."""

    def upper_bounds(self, distances: Floats) -> Floats | None:
        """Return upper bounds of the exact distances, of which its own are lower bounds.

        None where its own are none.
        """

    def error_of_path(self, excess: float, distance: float, rounding: float) -> ErrorBound | None:
        """Return the error of a path that is longer than its distance by so much, mesh units.

        None where the sweep cannot have found both.
        """

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return what sets it apart from the exact sweep, as arrays."""


@dataclass(frozen=True, eq=False)
class WholeSweep(ABC):
    """Continuous Dijkstra over all of a mesh."""

    question: Question

    @property
    def covering(self) -> "WholeSweep":
        """The sweep itself."""
        return self

    @property
    def bounds(self) -> Bounds:
        """The bounds of the sweep."""
        return self.question.bounds(self._bounds())

    @property
    def all_faces(self) -> Flags:
        """Flags (F,), by inner face, that are all set."""
        return np.ones(len(self.question.mesh.topology.links) // 3, np.bool_)

    def run(self, control: Control, retain: Retain = "distances") -> Wavefront:
        """Return the state after the sweep, see `Sweep.run`."""
        windows = self.all_faces if retain == "windows" else None
        return self.run_for(control, paths=retain != "distances", windows=windows)

    def run_for(
        self,
        control: Control,
        *,
        paths: bool = False,
        windows: Flags | None = None,
        engine: Engine | None = None,
    ) -> Wavefront:
        """Return the state after the sweep, with the data of paths and the windows of some faces.

        The ``engine`` is as in `run_sweep`.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `run_sweep`; the memory of `face_windows_of` counts as well.
        """
        question, bounds = self.question, self.bounds
        mesh, nodes, limit = question.mesh, question.nodes, question.max_distance
        wave = self._new_wave(paths=paths, windows=windows)
        control.check_memory(state.bytes_of(wave))
        share = share_of_vertices(question.reachable, limit)
        starts = question.start_distances
        wave = sweep_nodes(mesh, wave, nodes, starts, bounds, control, share, engine)
        control.check_memory(peak_bytes(wave))
        wave.vertices.distance[wave.vertices.distance > limit] = math.inf
        control.finish()
        return wave

    def row_state(self) -> Wavefront:
        """Allocate the state of these sweeps, see `Sweep.row_state`."""
        wave, nodes = self._new_wave(), self.question.nodes
        site_targets.watch_sites(wave.sites.ints, wave.pool.lists, nodes.first_target)
        return wave

    def _new_wave(self, *, paths: bool = False, windows: Flags | None = None) -> Wavefront:
        bounds = self.bounds
        merges = bool(bounds.merging)
        return state.new_wavefront(
            self.question.mesh.topology,
            self.question.nodes.sites,
            merges=merges,
            paths=merges and paths,
            windows=windows,
            directed=bool(bounds.directed),
        )

    def row_method(self) -> RowMethod:
        """Return the means to sweep from each source, see `Sweep.row_method`."""
        bounds = self.bounds
        ends_early = not bounds.merging
        return RowMethod(bounds, rows.advance_rows, None, ends_early, most_work=NEVER)

    def find_windows(self, faces: Flags, control: Control) -> FaceWindows:
        """Run the sweep for the windows of some inner faces, flags (F,)."""
        return face_windows_of(self.run_for(control, windows=faces))

    @abstractmethod
    def upper_bounds(self, distances: Floats) -> Floats:
        """Return upper bounds of the exact distances, of which its own are lower bounds."""

    @abstractmethod
    def faces_passed(self, distances: Floats, levels: Sequence[float]) -> Flags:
        """Return the inner faces that isolines may pass, by the sweep's distances; flags (F,)."""

    @abstractmethod
    def _bounds(self) -> Bounds:
        """Return the bounds of the sweep from points."""


class ExactSweep(WholeSweep):
    """The exact sweep (section 3)."""

    @property
    def promise(self) -> ErrorBound:
        """No error."""
        return EXACT

    @property
    def exact(self) -> "ExactSweep":
        """The sweep itself."""
        return self

    def upper_bounds(self, distances: Floats) -> Floats:
        """Return the distances themselves."""
        return distances

    def error_of_path(
        self,
        excess: float,
        distance: float,  # noqa: ARG002
        rounding: float,
    ) -> ErrorBound | None:
        """Return no error: a path is as long as its distance."""
        return EXACT if abs(excess) <= rounding else None

    def faces_passed(self, distances: Floats, levels: Sequence[float]) -> Flags:
        """Return the faces whose corners allow one of the levels."""
        question = self.question
        return crossed_faces(question.mesh, distances, question.max_distance, levels)

    def find_winners_and_windows(self, control: Control) -> tuple[Winners, FaceWindows]:
        """Run the sweep for the data of paths and for all windows."""
        wave = self.run(control, "windows")
        return all_winners(wave), face_windows_of(wave)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return nothing."""
        return {}

    def _bounds(self) -> Bounds:
        return exact_bounds(self.question.max_distance)


@dataclass(frozen=True, eq=False)
class DirectedSweep(ExactSweep):
    """The exact sweep whose windows carry the directions in which paths leave their source."""

    from_bends: bool = False
    """Whether those of paths that leave a bend are carried from there as well"""

    def _bounds(self) -> Bounds:
        is_mirrored = bool((self.question.mesh.topology.flags & SEAM).any())
        return with_directions(super()._bounds(), is_mirrored, self.from_bends)


@dataclass(frozen=True, eq=False)
class MergingSweep(WholeSweep):
    """The approximate sweep, which merges windows within both errors (section 4)."""

    relative_error: float
    """A share of the exact distance; infinite for none"""
    absolute_error: float
    """Mesh units; infinite for none"""

    @property
    def promise(self) -> ErrorBound:
        """The relative error, or else the absolute one."""
        return guaranteed(self.relative_error, self.absolute_error)

    @property
    def exact(self) -> ExactSweep:
        """The exact sweep of the same question."""
        return ExactSweep(self.question)

    def upper_bounds(self, distances: Floats) -> Floats:
        """Return the distances and the errors that they may have: the stricter one counts."""
        return np.minimum(distances / (1.0 - self._relative), distances + self.absolute_error)

    def error_of_path(self, excess: float, distance: float, rounding: float) -> ErrorBound | None:
        """Return the share of its distance by which a path is longer."""
        if excess < -rounding:
            return None
        share = max(excess, 0.0) / distance if distance > rounding else 0.0
        return ErrorBound("relative", share, "guaranteed")

    def faces_passed(self, distances: Floats, levels: Sequence[float]) -> Flags:  # noqa: ARG002
        """Return all faces: merged windows bound the distances in a face by no corner."""
        return self.all_faces

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return both errors."""
        return {"errors": np.array([self.relative_error, self.absolute_error])}

    @property
    def _relative(self) -> float:
        return min(self.relative_error, WIDEST_ERROR)

    def _bounds(self) -> Bounds:
        return merging_bounds(self.question.max_distance, self._relative, self.absolute_error)


def guaranteed(relative: float, absolute: float) -> ErrorBound:
    """Return what a merging sweep within both errors promises: the relative one if it is finite."""
    if math.isfinite(relative):
        return ErrorBound("relative", min(relative, WIDEST_ERROR), "guaranteed")
    return ErrorBound("absolute", absolute, "guaranteed")
