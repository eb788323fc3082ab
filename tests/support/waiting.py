"""Waiting for a state: tests never ask how soon it comes, only that it does."""

import faulthandler
import time
from collections.abc import Callable

LONG_S = 300.0
"""Longer than anything takes that does happen, on a machine however busy."""


def wait_until(condition: Callable[[], object]) -> None:
    """Wait for something that happens in another thread or process."""
    end = time.monotonic() + LONG_S
    while not condition():
        if time.monotonic() > end:
            faulthandler.dump_traceback()  # pytest shows it: the cause is seldom in this thread
            raise AssertionError("it did not happen")
        time.sleep(0.02)
