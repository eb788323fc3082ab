"""Meshes shared out among processes, in parcels, several of them at a time."""

import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import chain
from multiprocessing import active_children
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

_PARCEL_BYTES, _PARCELS = 1 << 22, 8
"""Bytes of the files that a process is handed together, at most, but for a larger one; and parcels
for each process of what is left, at least. Handed meshes of 2 ms one by one, processes wait for
half of the time"""
_AHEAD = 3
"""Parcels for each process that it is at, or gets next"""
_CHECK_PERIOD_S = 0.1
"""Seconds between two checks whether to stop"""


class Pool(ProcessPoolExecutor):
    """A pool whose processes have all started, and have loaded the kernels."""

    def __init__(self, processes: int) -> None:
        from app.engine import fork_server

        self.size = processes
        others = set(active_children())
        all_are_there = fork_server.CONTEXT.Barrier(processes)
        super().__init__(processes, fork_server.CONTEXT, _begin, (all_are_there,))
        for begun in [self.submit(_begun) for _ in range(processes)]:  # each starts one process
            begun.result()
        self._children = set(active_children()) - others

    def kill(self) -> None:
        """End all processes at once: nobody waits for their answers."""
        for child in self._children:
            child.kill()


def answers_of(
    ask: Callable[[Path], T], meshes: Sequence[Path], pool: Pool, check: Callable[[], None]
) -> Iterator[tuple[Path, T | None]]:
    """Yield the answer for each mesh, as they come from a pool, which is shut down.

    A process that dies takes all that run with it: those are asked again, each by itself. The
    answer is None for a mesh at which the process dies then, too. ``check`` is called often, and
    raises what ends the work at once.
    """
    size = pool.size
    left, lost = deque(parcels_of(meshes, size)), list[Path]()
    yield from _answers_of_pool(ask, left, lost, pool, check)
    while left:
        yield from _answers_of_pool(ask, left, lost, Pool(size), check)
    for mesh in lost:
        died: list[Path] = []
        yield from _answers_of_pool(ask, deque([[mesh]]), died, Pool(1), check)
        if died:
            yield mesh, None


def parcels_of(meshes: Sequence[Path], processes: int) -> Iterator[list[Path]]:
    """Yield meshes that are handed over together: fewer at the end, so that all end together."""
    sizes = [_size(mesh) for mesh in meshes]
    left = sum(sizes)
    parcel, total = list[Path](), 0
    for mesh, size in zip(meshes, sizes, strict=True):
        if parcel and total + size > min(_PARCEL_BYTES, left // (_PARCELS * processes)):
            yield parcel
            left -= total
            parcel, total = [], 0
        parcel.append(mesh)
        total += size
    yield parcel


def _size(mesh: Path) -> int:
    """Return the bytes of a file, 0 where there is none; who reads it says why."""
    try:
        return mesh.stat().st_size
    except OSError:
        return 0


def _answers_of_pool(
    ask: Callable[[Path], T],
    left: deque[list[Path]],
    lost: list[Path],
    pool: Pool,
    check: Callable[[], None],
) -> Iterator[tuple[Path, T]]:
    """Take parcels that are left, and yield the answers for their meshes.

    Stop where a process dies: the meshes that are under way then are lost.
    """
    waiting: dict[Future[list[T]], list[Path]] = {}
    with pool:
        try:
            while left or waiting:
                check()
                while left and len(waiting) < _AHEAD * pool.size:
                    future = pool.submit(_ask_each, ask, left[0])
                    waiting[future] = left.popleft()
                for future in wait(waiting, _CHECK_PERIOD_S, FIRST_COMPLETED).done:
                    answers = future.result()
                    yield from zip(waiting.pop(future), answers, strict=True)
        except BrokenProcessPool:
            lost += chain.from_iterable(waiting.values())
        except BaseException:
            pool.kill()
            raise


def _ask_each(ask: Callable[[Path], T], meshes: Sequence[Path]) -> list[T]:
    """Return the answer for each mesh of a parcel."""
    return [ask(mesh) for mesh in meshes]


def _begin(all_are_there: Barrier) -> None:
    """Load the kernels, unless the fork server has, and wait for the other processes."""
    from geodesic_core import warm_up

    # Ctrl-C is for the command, which ends its processes.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm_up(["exact", "paths"])
    all_are_there.wait()


def _begun() -> None:
    """Do nothing, in a process that has begun."""
