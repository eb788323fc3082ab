"""A line on standard error when compiling kernels takes longer than a second."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

KERNELS = 38
"""Compiled kernels, where all questions were asked."""
_FIRST_S, _PERIOD_S = 1.0, 3.0


@contextmanager
def of_folder(folder: Path) -> Iterator[None]:
    """Tell how many kernels a folder has, whenever there are more, until the block is left.

    ``GEODESIC_QUIET`` in the environment silences it.
    """
    over = threading.Event()

    def tell() -> None:
        told, pause = -1, _FIRST_S
        while not over.wait(pause):
            done = min(len(list(folder.glob("*.kernel"))), KERNELS)
            if done != told:
                line = f"Compiling kernels for this machine, once: {done} of {KERNELS}"
                print(line, file=sys.stderr, flush=True)  # noqa: T201 - for who waits
            told, pause = done, _PERIOD_S

    if os.environ.get("GEODESIC_QUIET"):
        yield
        return
    thread = threading.Thread(target=tell, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
