"""The lock of a solver: calls that use its memory run one after the other."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InvalidArgument


class CallLock:
    """A lock that a call holds, and that it waits for as its control says."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holder: int | None = None
        """The thread that holds it"""

    @contextmanager
    def held(self, control: Control) -> Iterator[None]:
        """Wait for the lock, and hold it until the block ends.

        Raises
        ------
        Cancelled, DeadlineExceeded
            As the control says, while the call waits.
        InvalidArgument
            A callback of the call that holds the lock asks for it again.
        """
        if self._holder == threading.get_ident():
            raise InvalidArgument(
                "a callback cannot use the Solver that is calling it; use another Solver of the "
                "mesh"
            )
        while not self._lock.acquire(timeout=SLICE_SECONDS):
            control.checkpoint(0.0)
        self._holder = threading.get_ident()
        try:
            yield
        finally:
            self._holder = None
            self._lock.release()
