"""Control of a call by its caller: progress, cancelling, a deadline and a memory limit."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InvalidArgument,
    MemoryLimitExceeded,
)
from geodesic_core.validation import is_number

SLICE_SECONDS = 0.05
"""About how long a call computes between two checkpoints: what cancelling takes, at most."""

_FIRST_ITEMS = 256


@dataclass(frozen=True)
class Control:
    """How a caller watches a call and stops it."""

    progress: Callable[[float], None] | None = None
    """Called about every 50 ms with the share that is done, from 0 to 1, never decreasing."""
    cancel: Callable[[], bool] | None = None
    """Asked about every 50 ms; the call stops once it answers true."""
    deadline_s: float | None = None
    """Seconds granted, from the call."""
    memory_limit: int | None = None
    """Bytes granted for the state of the call, the mesh itself not counted."""
    bytes_beside: int = 0
    """Bytes that the call holds besides the state of its present sweep."""
    began: float = field(default_factory=time.perf_counter)
    """When the call began."""

    def __post_init__(self) -> None:
        for name in ("deadline_s", "memory_limit"):
            value = getattr(self, name)
            if value is not None and (not is_number(value) or not value > 0):
                raise InvalidArgument(f"{name} is {value!r}; it must be a number above 0")

    def checkpoint(self, share: float) -> None:
        """Report progress; raise if the call is to stop."""
        if self.progress is not None:
            self.progress(share)
        if self.cancel is not None and self.cancel():
            raise Cancelled(f"cancelled with {share:.0%} done")
        if self.deadline_s is not None and time.perf_counter() - self.began > self.deadline_s:
            raise DeadlineExceeded(f"not finished within {self.deadline_s:g} s: {share:.0%} done")

    def for_part(self, part: int, parts: int, count: int = 1) -> "Control":
        """Return the control of one of several equal parts of the call, or of some in a row."""
        progress = self.progress
        if progress is None:
            return self
        return replace(self, progress=lambda share: progress((part + count * share) / parts))

    def holding(self, bytes_beside: int) -> "Control":
        """Return the control of a sweep beside which the call holds so many more bytes."""
        return replace(self, bytes_beside=self.bytes_beside + bytes_beside)

    def check_memory(self, needed: int) -> None:
        """Raise if the call needs more memory than it may take."""
        needed += self.bytes_beside
        if self.memory_limit is not None and needed > self.memory_limit:
            raise MemoryLimitExceeded(needed, self.memory_limit)


def in_slices(count: int, work: Callable[[int, int], int], control: Control) -> None:
    """Do ``work`` on all of some items, from a first up to a last of them at a time.

    It returns how many there are by then: there may be more than at first.

    Raises
    ------
    Cancelled, DeadlineExceeded
        As the control says, which is asked before each slice.
    """
    done, size, shown = 0, _FIRST_ITEMS, 0.0
    while done < count:
        shown = max(shown, done / count)
        control.checkpoint(shown)
        last = min(done + size, count)
        began = time.perf_counter()
        count = work(done, last)
        took = time.perf_counter() - began
        done, size = last, max(int(size * min(max(SLICE_SECONDS / took, 0.5), 2.0)), 1)
