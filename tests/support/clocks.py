"""Clocks for tests: nothing depends on how fast the machine is, or on what its clock says."""

from datetime import datetime, timedelta, tzinfo


class Clock:
    """A clock that shows ``now``, in seconds, and goes on only when a test sets it."""

    def __init__(self) -> None:
        self.now = 1e6

    def __call__(self) -> float:
        return self.now


class Calendar:
    """Stands for ``datetime`` in a module, with a clock that was ``moved``."""

    def __init__(self) -> None:
        self.moved = timedelta()

    def now(self, zone: tzinfo) -> datetime:
        return datetime.now(zone) + self.moved


TEN_YEARS = timedelta(days=3653)
