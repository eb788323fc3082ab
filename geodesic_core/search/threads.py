"""Threads that share the parts of a call; kernels release the interpreter."""

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial

from geodesic_core.control import SLICE_SECONDS, Control

Worker = Callable[[int, Control], None]
"""Function that does the part of a given number"""


def available_cores() -> int:
    """Return the number of cores that this process may use, or else of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
