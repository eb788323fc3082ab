"""How long a call takes."""

import gc
import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


def timed(call: Callable[[], Result]) -> tuple[float, Result]:
    """Return the seconds a call took on the wall, and what it returned."""
    gc.collect()
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result
