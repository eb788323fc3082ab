"""Timing of calls."""

import gc
import math
import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any, TypeVar

Result = TypeVar("Result")


def timed(
    call: Callable[[], Result], clock: Callable[[], float] = time.perf_counter
) -> tuple[float, Result]:
    """Return the wall-clock seconds of a call, or those of another clock, and its result."""
    gc.collect()
    gc.freeze()  # the next collection then leaves out all that is imported: 1 ms instead of 90
    start = clock()
    result = call()
    return clock() - start, result


def by_turns(
    calls: Sequence[Callable[[], Any]],
    runs: int,
    patience: float = math.inf,
    clock: Callable[[], float] = time.perf_counter,
) -> list[tuple[float, Any]]:
    """Time calls by turns; return for each the median of its seconds, and its last result.

    There are at most ``runs`` rounds, and none begins more than ``patience`` seconds after the
    first.
    """
    seconds: list[list[float]] = [[] for _ in calls]
    results: list[Any] = [None] * len(calls)
    began = time.perf_counter()
    for _ in range(runs):
        for i, call in enumerate(calls):
            took, results[i] = timed(call, clock)
            seconds[i].append(took)
        if time.perf_counter() - began > patience:
            break
    return [(median(some), result) for some, result in zip(seconds, results, strict=True)]


def paired(
    plain: Callable[[], Any],
    other: Callable[[], Result],
    pairs: int,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[list[float], list[float], Result]:
    """Return the seconds of two calls by turns, each first every other time; and the last result.

    The result is that of the other call.
    """
    plain_s, other_s = [], []
    for i in range(pairs):
        if i % 2:
            plain_s.append(timed(plain, clock)[0])
        seconds, result = timed(other, clock)
        other_s.append(seconds)
        if not i % 2:
            plain_s.append(timed(plain, clock)[0])
    return plain_s, other_s, result


def ratio(these_s: Sequence[float], those_s: Sequence[float]) -> float:
    """Return the median of the ratios of seconds in pairs."""
    return median(this / that for this, that in zip(these_s, those_s, strict=True))
