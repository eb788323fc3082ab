"""Waiting for a state: tests never ask how soon it comes, only that it does."""

import faulthandler
import time
from collections.abc import Callable

LONG_S = 300.0
"""Longer than anything takes that does happen, on a machine however busy."""


def wait_until(condition: Callable[[], object]) -> None:
    """Wait for something that happens in another thread or process."""
    start = time.monotonic()
    while not condition():
        waited = time.monotonic() - start
        if waited > LONG_S:
            faulthandler.dump_traceback()  # pytest shows it: the cause is seldom in this thread
            raise AssertionError("it did not happen")
        # The longer it takes, the less often: to ask is work for the service.
        time.sleep(min(0.02 + waited / 10, 0.3))
