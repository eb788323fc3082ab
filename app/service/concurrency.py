"""Concurrency of each caller: how much it may do at the same time."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from app.access import Caller
from app.errors import over_limit


class ConcurrencyLimit:
    """A count of what each caller does at the same time.

    Parameters
    ----------
    limit
        The most that one caller may do at the same time; None for no limit.
    code
        Code of the problem beyond it.
    what
        Name of what is counted, plural.
    setting
        The setting that has the limit.
    """

    def __init__(self, limit: int | None, code: str, what: str, setting: str) -> None:
        self._limit = limit
        self._code = code
        self._what = what
        self._setting = setting
        self._running: Counter[str] = Counter()

    @contextmanager
    def counting(self, caller: Caller) -> Iterator[None]:
        """Count the block, or refuse it with a problem."""
        name = caller.name
        running = self._running[name] + 1
        if self._limit is not None and running > self._limit:
            what, headers = f"{self._what} at the same time", {"Retry-After": "1"}
            raise over_limit(self._code, what, running, self._limit, self._setting, headers=headers)
        self._running[name] = running
        try:
            yield
        finally:
            self._running[name] -= 1
            if not self._running[name]:
                del self._running[name]
