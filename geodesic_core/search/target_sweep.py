"""Sweeps from some points to others, one after another in the same memory."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.fields import fast_sweep
from geodesic_core.fields.methods import SweepOf
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Ends
from geodesic_core.fields.sweep import Engine, RowMethod, endless, run_sweep
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.front import pruning, state
from geodesic_core.kernels.front.bounds import Bounds, without_merging
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.rows import (
    ENTRIES,
    HAS_BEGUN,
    LAST_ROW,
    ROW,
    STATE,
    Rows,
    link_targets,
)
from geodesic_core.kernels.front.state import NO_PLACES, NODE, Wavefront
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep import site_targets
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_ENTRIES = 1 << 16
"""Entries for which there is room, unless a row has more"""


class Entries(NamedTuple):
    """The finite distances of some rows in succession."""

    rows: Longs
    """(R,) the rows"""
    ends: Longs
    """(R + 1,) where the entries of each begin, and the last end"""
    columns: Ints
    """(K,) the target of each, in no order"""
    distances: Floats
    """(K,) mesh units"""

    @property
    def row_of_each(self) -> Longs:
        """(K,) the row of each entry."""
        return np.repeat(self.rows, np.diff(self.ends))

    @property
    def nbytes(self) -> int:
        """Memory, bytes."""
        return sum(array.nbytes for array in self)


class TargetSweep:
    """Distances between points of one mesh, by sweeps of a method in reused memory; for one thread.

    A sweep costs what it touches, whatever the size of the mesh and the number of targets. An exact
    one ends once it has found its targets.
    """

    def __init__(self, mesh: TriangleMesh, sweep_of: SweepOf = ExactSweep) -> None:
        self.mesh = mesh
        self._sweep_of = sweep_of
        self._wave: Wavefront | None = None
        self._ends: Ends | None = None
        """Those that the memory is prepared for"""
        self._first_target = self._next_target = np.empty(0, np.int32)
        self._columns, self._distances = np.empty(0, np.int32), np.empty(0)

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, the mesh not counted."""
        own = (self._first_target, self._next_target, self._columns, self._distances)
        held = sum(array.nbytes for array in own)
        return held if self._wave is None else held + state.bytes_of(self._wave)

    def prepare(self, ends: Ends, limit: float) -> Wavefront:
        """Make memory for sweeps between some ends, or ready what there is; return their state."""
        if self._wave is not None and ends is self._ends:
            return self._wave
        nodes, wave = ends.nodes, self._wave
        count = len(self.mesh.vertices) + nodes.sites.nodes
        if wave is None or self._sweep_of is not ExactSweep or count > len(self._first_target):
            wave = self._sweep_of(self._question(ends, limit)).row_state()
            self._first_target = np.full(count, -1, np.int32)
        elif self._ends is not None:
            self._first_target[self._ends.nodes.targets] = -1
            pruning.forget(self.mesh.topology, wave)  # the sites: all else is as it was at first
            wave = state.with_sites(wave, nodes.sites._replace(ints=nodes.sites.ints.copy()))
            site_targets.watch_sites(wave.sites.ints, wave.pool.lists, nodes.first_target)
        self._next_target = np.empty(len(nodes.targets), np.int32)
        link_targets(nodes.targets, self._first_target, self._next_target)
        room = max(len(nodes.targets), min(len(nodes.sources) * len(nodes.targets), _ENTRIES))
        if room > len(self._columns):
            self._columns, self._distances = np.empty(room, np.int32), np.empty(room)
        self._wave, self._ends = wave, ends
        return wave

    def rows(
        self,
        ends: Ends,
        limit: float,
        sweeps: Longs,
        columns: tuple[Ints, Ints],
        control: Control,
        count: int | None = None,
    ) -> Iterator[Entries]:
        """Yield the distances of rows, those of successive rows together as they are found.

        Parameters
        ----------
        ends
            Sources and targets.
        limit
            Distances beyond it are left out, mesh units.
        sweeps
            (R,) index of the source of each row.
        columns
            (R,) the first target of each row, and one beyond its last.
        control
            Of the call.
        count
            Nearest targets of each row that are wanted, where the method is exact; None for all.
            The others, which are farther, may be too far or left out.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded, InternalError
            As in `sweep_nodes`.
        """
        wave = self.prepare(ends, limit)
        control.check_memory(self.nbytes)
        beside = control.holding(self.nbytes - state.bytes_of(wave))
        method = self._sweep_of(self._question(ends, limit)).row_method()
        rows = self._rows(ends, limit, sweeps, columns, count, method)
        share = self._share(rows)
        done, is_exact, finished = 0, False, False
        try:
            while not finished:
                bounds = without_merging(method.bounds) if is_exact else method.bounds
                narrow = min(limit, float(rows.limit[0]))
                wave, outcome = run_sweep(
                    self.mesh,
                    wave,
                    bounds._replace(max_distance=narrow),
                    beside,
                    share,
                    _engine(method, rows),
                )
                self._wave = wave
                if outcome == Outcome.RUNAWAY:
                    self._begin_exactly(wave, rows, bounds, ends)
                    is_exact = True
                    continue
                finished = int(rows.state[ROW]) == len(sweeps)
                if is_exact and rows.state[ROW] == rows.state[LAST_ROW]:
                    rows.state[LAST_ROW], is_exact = len(sweeps), False
                if rows.state[ROW] > done:
                    yield _taken(rows, sweeps, done)
                    done = int(rows.state[ROW])
        except BaseException:
            self._wave = None  # in the middle of a sweep
            raise

    def _question(self, ends: Ends, limit: float) -> Question:
        return Question(self.mesh, (), (), (), limit, ends.nodes)

    def _rows(
        self,
        ends: Ends,
        limit: float,
        sweeps: Longs,
        columns: tuple[Ints, Ints],
        count: int | None,
        method: RowMethod,
    ) -> Rows:
        """Return the rows of a call, of which none has begun."""
        nodes = ends.nodes
        sources = nodes.sources[sweeps]  # one for each, since there are no curves
        site_nodes = nodes.sites.ints[: nodes.first_target, NODE]
        sites = np.minimum(np.searchsorted(site_nodes, sources), max(len(site_nodes) - 1, 0))
        is_site = site_nodes[sites] == sources if len(site_nodes) else np.zeros(len(sites), bool)
        progress = np.zeros(STATE, np.int64)
        progress[LAST_ROW] = len(sweeps)
        return Rows(
            sources=sources,
            source_sites=np.where(is_site, sites, -1).astype(np.int32),
            source_components=ends.source_components[sweeps],
            first_columns=columns[0],
            last_columns=columns[1],
            targets=nodes.targets,
            target_components=ends.target_components,
            corners=ends.corners,
            reaches=ends.reaches,
            next_target=self._next_target,
            first_target=self._first_target,
            ends=np.zeros(len(sweeps), np.int64),
            columns=self._columns,
            distances=self._distances,
            limit=np.full(1, np.inf),
            state=progress,
            max_distance=limit,
            wanted=len(nodes.targets) if count is None else count,
            ends_early=method.ends_early,
            most_work=method.most_work,
        )

    def _share(self, rows: Rows) -> Callable[[Wavefront], float]:
        """Return the share of the rows that is done, as a function of the state."""
        shown, sizes = 0.0, self.mesh.component_sizes

        def share(wave: Wavefront) -> float:
            nonlocal shown
            row, count = int(rows.state[ROW]), len(rows.sources)
            size = sizes[rows.source_components[row]] if row < count else math.inf
            shown = max(shown, (row + min(float(wave.counters[TOUCHED]) / size, 1.0)) / count)
            return shown

        return share

    def _begin_exactly(self, wave: Wavefront, rows: Rows, bounds: Bounds, ends: Ends) -> None:
        """Have the row whose merging sweep does not end begin anew, by itself, merging nothing."""
        if wave.places is not NO_PLACES:
            raise fast_sweep.endless()
        if not bounds.merging:
            raise endless(self.mesh.topology, wave)
        pruning.forget(self.mesh.topology, wave)
        site_targets.watch_sites(wave.sites.ints, wave.pool.lists, ends.nodes.first_target)
        rows.state[HAS_BEGUN], rows.state[LAST_ROW] = 0, rows.state[ROW] + 1


def _engine(method: RowMethod, rows: Rows) -> Engine:
    def advance(topology: Topology, wave: Wavefront, bounds: Bounds, budget: int) -> Outcome:
        return method.advance(topology, wave, bounds, rows, budget)

    return Engine(advance, method.first_budget)


def _taken(rows: Rows, sweeps: Longs, first: int) -> Entries:
    """Take the entries of the rows from the first on that are done out of the memory of a call."""
    last, size = int(rows.state[ROW]), int(rows.state[ENTRIES])
    rows.state[ENTRIES] = 0
    return Entries(
        sweeps[first:last],
        np.concatenate([[0], rows.ends[first:last]]),
        rows.columns[:size].copy(),
        rows.distances[:size].copy(),
    )
