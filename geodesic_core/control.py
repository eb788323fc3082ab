"""Control of a call by its caller: progress, cancelling, a deadline and a memory limit."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count as numbers
from typing import TypeVar

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

_ROUNDS_SHOWN = 40
"""Rounds after which what is left of the progress is too little to be shown."""

WATCHED_ITEMS = 100
"""Items that a call prepares between two questions whether it is to stop. The slowest, points of
curves, take 0.1 ms each."""

T = TypeVar("T")


@dataclass(frozen=True)
class Control:
    """Progress, cancelling, deadline and memory limit of a call.

    Every solver takes the first four as arguments of the same names, and so does each method of a
    field that may still have to compute.

    Parameters
    ----------
    progress
        Called about every 50 ms with the share that is done, from 0 to 1, never decreasing.
    cancel
        Called about every 50 ms, and more often while points are prepared; the call stops with
        `Cancelled` once it returns true.
    deadline_s
        Seconds granted from the start of the call, above 0; then it stops with `DeadlineExceeded`.
    memory_limit
        Bytes granted for the state of the call, above 0, not counting the mesh; a call that needs
        more stops with `MemoryLimitExceeded`.
    bytes_beside
        Bytes that the call holds beside the state of its present sweep.
    began
        Start of the call, a `time.perf_counter` value; now by default.

    Raises
    ------
    InvalidArgument
        The deadline or the limit is not a number above 0, or one of the others cannot be called.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> shares = []
    >>> field = gc.exact_distance(mesh, 0, progress=shares.append, deadline_s=60)
    >>> shares[-1]
    1.0
    >>> gc.exact_distance(mesh, 0, cancel=lambda: True)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.Cancelled: cancelled with 0% done
    """

    progress: Callable[[float], None] | None = None
    cancel: Callable[[], bool] | None = None
    deadline_s: float | None = None
    memory_limit: int | None = None
    bytes_beside: int = 0
    began: float = field(default_factory=time.perf_counter)
    _watched: Iterator[int] = field(
        default_factory=lambda: numbers(1), init=False, repr=False, compare=False
    )
    """Numbers of the items that the call watches, from 1"""

    def __post_init__(self) -> None:
        for name in ("progress", "cancel"):
            value = getattr(self, name)
            if value is not None and not callable(value):
                raise InvalidArgument(f"{name} is {value!r}; it must be a function")
        for name in ("deadline_s", "memory_limit"):
            value = getattr(self, name)
            if value is not None and (not is_number(value) or not value > 0):
                raise InvalidArgument(f"{name} is {value!r}; it must be a number above 0")

    def checkpoint(self, share: float) -> None:
        """Report progress, and stop the call if it is to stop.

        Parameters
        ----------
        share
            Share of the call that is done, 0 to 1.

        Raises
        ------
        Cancelled, DeadlineExceeded
            The call is to stop.

        Examples
        --------
        >>> gc.Control(progress=print).checkpoint(0.25)
        0.25
        """
        if self.progress is not None:
            self.progress(share)
        self._stop_if_due(share)

    def finish(self) -> None:
        """Report that the call, or the part of it, is done.

        Examples
        --------
        >>> gc.Control(progress=print).finish()
        1.0
        """
        if self.progress is not None:
            self.progress(1.0)

    def watched(self, items: Iterable[T]) -> Iterator[T]:
        """Yield what a call prepares, and stop the call if it is to stop.

        Asks before every hundredth of all the items that the call watches, so that many short
        curves are watched as one long curve is.

        Parameters
        ----------
        items
            Points or the like, each of which takes little time.

        Returns
        -------
        Iterator
            Over the same.

        Raises
        ------
        Cancelled, DeadlineExceeded
            The call is to stop.

        Examples
        --------
        >>> sum(gc.Control(cancel=lambda: True).watched(range(1000)))
        Traceback (most recent call last):
            ...
        geodesic_core.errors.Cancelled: cancelled with 0% done
        """
        for item in items:
            if next(self._watched) % WATCHED_ITEMS == 0:
                self._stop_if_due(0.0)
            yield item

    def _stop_if_due(self, share: float) -> None:
        if self.cancel is not None and self.cancel():
            raise Cancelled(f"cancelled with {share:.0%} done")
        if self.deadline_s is not None and time.perf_counter() - self.began > self.deadline_s:
            raise DeadlineExceeded(f"not finished within {self.deadline_s:g} s: {share:.0%} done")

    def for_part(self, part: int, parts: int, count: int = 1) -> "Control":
        """Return the control of one of several equal parts of the call, or of some in a row.

        Parameters
        ----------
        part
            Number of the part, from 0.
        parts
            Number of all parts.
        count
            Number of parts in a row.

        Returns
        -------
        Control
            Whose progress is a share of this one's.

        Examples
        --------
        >>> gc.Control(progress=print).for_part(1, 2).checkpoint(0.5)
        0.75
        """
        progress = self.progress
        if progress is None or count == parts:
            return self
        return replace(self, progress=lambda share: progress((part + count * share) / parts))

    def holding(self, bytes_beside: int) -> "Control":
        """Return the control of a sweep beside which the call holds more memory.

        Parameters
        ----------
        bytes_beside
            Bytes held beside the state of the sweep.

        Returns
        -------
        Control
            Whose memory limit counts them.

        Examples
        --------
        >>> gc.Control(memory_limit=1000).holding(600).bytes_beside
        600
        """
        return replace(self, bytes_beside=self.bytes_beside + bytes_beside)

    def check_memory(self, needed: int) -> None:
        """Stop the call if it needs more memory than it may take.

        Parameters
        ----------
        needed
            Bytes of the state of its present sweep.

        Raises
        ------
        MemoryLimitExceeded
            With the bytes that the call holds beside, these are too many.

        Examples
        --------
        >>> gc.Control(memory_limit=1000).check_memory(900)
        """
        needed += self.bytes_beside
        if self.memory_limit is not None and needed > self.memory_limit:
            raise MemoryLimitExceeded(needed, self.memory_limit)


def rounds(control: Control) -> Iterator[Control]:
    """Yield controls for the rounds of a call whose number is not known.

    Of the progress, each has half of what those before have left.
    """
    for i in numbers(1):
        parts = 2 ** min(i, _ROUNDS_SHOWN)
        yield control.for_part(parts - 2, parts, count=int(i < _ROUNDS_SHOWN))


def in_slices(count: int, work: Callable[[int, int], int], control: Control) -> None:
    """Do ``work`` on all of ``count`` items, slice by slice, as ``work(first, end)``.

    It returns the number of items by then, which may have grown.

    Raises
    ------
    Cancelled, DeadlineExceeded
        At the checkpoint before each slice.
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
