"""Turns: calls that use the same memory follow one another."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InvalidArgument


class Turns:
    """A lock of memory that calls in several threads use."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: int | None = None
        """The thread whose turn it is"""

    @contextmanager
    def taken(self, control: Control) -> Iterator[None]:
        """Wait for a turn, and hold it until the block ends.

        Raises
        ------
        Cancelled, DeadlineExceeded
            As the control says, while the call waits.
        InvalidArgument
            A callback of the call that has the turn asks for another one.
        """
        if self._holder == threading.get_ident():
            raise InvalidArgument(
                "a callback cannot call the solver that calls it; use another Solver of the mesh"
            )
        while not self._lock.acquire(timeout=SLICE_SECONDS):
            control.checkpoint(0.0)
        self._holder = threading.get_ident()
        try:
            yield
        finally:
            self._holder = None
            self._lock.release()
