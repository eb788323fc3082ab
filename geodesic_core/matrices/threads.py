"""Threads that share the parts of a call; kernels release the interpreter."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Protocol, TypeVar

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.validation import is_index

Worker = Callable[[int, Control], None]
"""Function that does the part of a given number"""

_GROWTH = 2
"""Growth of the state of a thread that is allowed for where memory is scarce."""


class State(Protocol):
    """What a thread works with, and no other thread at the same time."""

    @property
    def nbytes(self) -> int:
        """Its memory, bytes; it may grow."""


S = TypeVar("S", bound=State)


def available_cores() -> int:
    """Return the number of cores that this process may use, or else of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def as_threads(threads: int | None) -> int:
    """Return the largest number of threads: one per core that the process may use for None.

    Raises
    ------
    InvalidArgument
        It is not an integer, 1 or more.
    """
    if threads is None:
        return available_cores()
    if not is_index(threads) or threads < 1:
        raise InvalidArgument(f"threads is {threads!r}; it must be an integer, 1 or more, or None")
    return int(threads)


def share_within_memory(
    parts: int,
    states: Iterator[S],
    work: Callable[[S, int, Control], None],
    threads: int,
    control: Control,
    held: Callable[[], int],
) -> None:
    """Do the parts of a call in as many threads as parts and memory allow, each with its state.

    ``held`` tells the bytes that the call holds beside the states.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    first = next(states)
    count = min(threads, parts)
    if control.memory_limit is not None:
        room = control.memory_limit - control.bytes_beside - held()
        count = max(1, min(count, int(room // (_GROWTH * first.nbytes))))

    def do(state: S, part: int, control: Control) -> None:
        if control.memory_limit is not None:
            # The states of other threads are about as large as the first.
            control = control.holding(held() + (count - 1) * first.nbytes)
        work(state, part, control)

    share_out(parts, [partial(do, each) for each in (first, *islice(states, count - 1))], control)


def share_out(parts: int, workers: Sequence[Worker], control: Control) -> None:
    """Do the parts of a call with some workers, each in a thread of its own.

    The caller's callbacks are called in the caller's thread only.

    Raises
    ------
    Cancelled, DeadlineExceeded
        As the control says.
    Exception
        The exception of the first worker to fail.
    """
    stop = threading.Event()
    shares = [0.0] * parts
    todo = iter(range(parts))  # whose `next` is atomic
    watched = replace(control, cancel=stop.is_set, deadline_s=None)

    def work(worker: Worker) -> None:
        while not stop.is_set() and (part := next(todo, None)) is not None:
            worker(part, replace(watched, progress=partial(shares.__setitem__, part)))
            shares[part] = 1.0

    with ThreadPoolExecutor(len(workers)) as pool:
        try:
            working = {pool.submit(work, worker) for worker in workers}
            while working:
                control.checkpoint(sum(shares) / parts)
                done, working = wait(working, SLICE_SECONDS, FIRST_EXCEPTION)
                for future in done:
                    future.result()
        finally:
            stop.set()
