"""Meshes shared out among processes, in parcels, several of them at a time."""

import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import chain
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


def answers_of(
    ask: Callable[[Path], T], meshes: Sequence[Path], processes: int, pool: ProcessPoolExecutor
) -> Iterator[tuple[Path, T | None]]:
    """Yield the answer for each mesh, as they come from a pool, which is shut down.

    A process that dies takes all that run with it: those are asked again, each by itself. The
    answer is None for a mesh at which the process dies then, too.
    """
    left, lost = deque(parcels_of(meshes, processes)), list[Path]()
    yield from _answers_of_pool(ask, left, lost, processes, pool)
    while left:
        yield from _answers_of_pool(ask, left, lost, processes, pool_of(processes))
    for mesh in lost:
        died: list[Path] = []
        yield from _answers_of_pool(ask, deque([[mesh]]), died, 1, pool_of(1))
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
    processes: int,
    pool: ProcessPoolExecutor,
) -> Iterator[tuple[Path, T]]:
    """Take parcels that are left, and yield the answers for their meshes.

    Stop where a process dies: the meshes that are under way then are lost.
    """
    waiting: dict[Future[list[T]], list[Path]] = {}
    with pool:
        try:
            while left or waiting:
                while left and len(waiting) < _AHEAD * processes:
                    future = pool.submit(_ask_each, ask, left[0])
                    waiting[future] = left.popleft()
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    answers = future.result()
                    yield from zip(waiting.pop(future), answers, strict=True)
        except BrokenProcessPool:
            lost += chain.from_iterable(waiting.values())
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _ask_each(ask: Callable[[Path], T], meshes: Sequence[Path]) -> list[T]:
    """Return the answer for each mesh of a parcel."""
    return [ask(mesh) for mesh in meshes]


def pool_of(processes: int) -> ProcessPoolExecutor:
    """Return a pool whose processes are all there, and have loaded the kernels."""
    from app.engine import fork_server

    all_are_there = fork_server.CONTEXT.Barrier(processes)
    pool = ProcessPoolExecutor(processes, fork_server.CONTEXT, _begin, (all_are_there,))
    for begun in [pool.submit(_begun) for _ in range(processes)]:  # each starts one process
        begun.result()
    return pool


def _begin(all_are_there: Barrier) -> None:
    """Load the kernels, unless the fork server has, and wait for the other processes."""
    from geodesic_core import warm_up

    # Ctrl-C is for the command: processes end with the question that they are at.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm_up(["exact", "paths"])
    all_are_there.wait()


def _begun() -> None:
    """Do nothing, in a process that has begun."""
