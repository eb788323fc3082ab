"""The driver of all matrices: sweeps, in threads, whose rows go into a sink."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain, repeat
from typing import Protocol

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.fields.methods import SweepOf
from geodesic_core.fields.sources import Ends
from geodesic_core.matrices.rows import Rows, rows_of
from geodesic_core.matrices.threads import share_within_memory
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import TargetSweep


class Sink(Protocol):
    """A place for the rows of a matrix: an array, a file, or a part of one."""

    @property
    def sweeps(self) -> Sequence[int]:
        """The sweeps to run."""

    @property
    def nbytes(self) -> int:
        """Its memory, bytes; it may grow."""

    def targets_of(self, sweep: int) -> Ints:
        """Return the targets of a sweep."""

    def put(self, sweep: int, targets: Ints, distances: Floats) -> None:
        """Store the distances of a sweep; several threads may call it at once."""


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

    ``target_sweep`` returns the memory of the first thread, where the caller has some.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    if not sink.sweeps:
        return

    def work(rows: Rows, part: int, control: Control) -> None:
        sweep = sink.sweeps[part]
        targets = sink.targets_of(sweep)
        sink.put(sweep, targets, rows.distances(sweep, targets, control))

    new = partial(TargetSweep, mesh)
    states = map(
        partial(rows_of, mesh, ends, limit, sweep_of), chain([target_sweep or new], repeat(new))
    )
    share_within_memory(len(sink.sweeps), states, work, threads, control, held=lambda: sink.nbytes)
