"""The driver of all matrices: sweeps, in threads, whose rows go into a sink."""

from collections.abc import Callable, Sequence
from itertools import chain, repeat
from typing import Protocol

import numpy as np

from geodesic_core.arrays import Ints, Longs
from geodesic_core.control import Control
from geodesic_core.fields.methods import SweepOf
from geodesic_core.fields.sources import Ends
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.matrices.threads import share_within_memory
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import Entries, TargetSweep

_PART_ROWS = 256
"""Sweeps of a part of a call, at most"""
_PARTS = 8
"""Parts for each thread, about, so that none waits long for the last"""


class Sink(Protocol):
    """A place for the rows of a matrix: an array, a file, or a part of one."""

    @property
    def sweeps(self) -> Sequence[int]:
        """The sweeps to run."""

    @property
    def nbytes(self) -> int:
        """Its memory, bytes; it may grow."""

    def columns_of(self, sweeps: Longs) -> tuple[Ints, Ints]:
        """Return the first target of each of some sweeps, and one beyond its last."""

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps; several threads may call it at once."""


def fill(
    sink: Sink,
    mesh: TriangleMesh,
    ends: Ends,
    limit: float,
    sweep_of: SweepOf,
    threads: int,
    control: Control,
    target_sweep: Callable[[], TargetSweep] | None = None,
) -> None:
    """Run the sweeps of a sink between some ends, in as many threads as memory allows.

    ``target_sweep`` returns the memory of the first thread, where the caller has some for exact
    sweeps.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    sweeps = np.asarray(sink.sweeps, np.int64)
    if not len(sweeps):
        return
    size = min(max(len(sweeps) // (_PARTS * threads), 1), _PART_ROWS)

    def new() -> TargetSweep:
        return TargetSweep(mesh, sweep_of)

    def prepared(make: Callable[[], TargetSweep]) -> TargetSweep:
        memory = make()
        memory.prepare(ends, limit)
        return memory

    def work(memory: TargetSweep, part: int, control: Control) -> None:
        some = sweeps[part * size : (part + 1) * size]
        for entries in memory.rows(ends, limit, some, sink.columns_of(some), control):
            sink.put(entries)

    first = target_sweep if target_sweep is not None and sweep_of is ExactSweep else new
    states = map(prepared, chain([first], repeat(new)))
    parts = -(-len(sweeps) // size)
    share_within_memory(parts, states, work, threads, control, held=lambda: sink.nbytes)
