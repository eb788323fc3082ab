"""A line on standard error when compiling kernels takes longer than a second."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

KERNELS = 89
"""Number of compiled kernels, once all workloads have run."""
_FIRST_S, _PERIOD_S = 1.0, 3.0


@contextmanager
def shown(folder: Path) -> Iterator[None]:
    """Print how many kernels a folder has, whenever there are more, until the block ends.

    Nothing is printed where ``GEODESIC_QUIET`` is set in the environment.
    """
    over = threading.Event()

    def report() -> None:
        reported, pause = -1, _FIRST_S
        while not over.wait(pause):
            done = min(len(list(folder.glob("*.kernel"))), KERNELS)
            if done != reported:
                line = f"Compiling kernels for this machine, once: {done} of {KERNELS}"
                print(line, file=sys.stderr, flush=True)  # noqa: T201 - the message
            reported, pause = done, _PERIOD_S

    if os.environ.get("GEODESIC_QUIET"):
        yield
        return
    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
