"""Ownership of the store: it belongs to one service at a time, or to several that share state."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.settings import variable_of
from app.store.layout import StoreError, require_layout, write_layout

_OTHERS_START_S = 20.0
"""Seconds that a service waits for another one that starts on the same store"""


class Share:
    """The share of a service in a store.

    Until `let_others_in` the first one is alone: it removes what was left unfinished.
    """

    def __init__(self, lock: int, *, is_first: bool) -> None:
        self._lock = lock
        self.is_first = is_first

    def let_others_in(self) -> None:
        """Let other services that share the store use it."""
        fcntl.flock(self._lock, fcntl.LOCK_SH)


@contextmanager
def owned(root: Path, *, is_shared: bool = False) -> Iterator[Share]:
    """Own the store in the folder ``root`` inside the block, or share it with others that do so.

    The folder is created if missing. The lock ends with the process, however that ends.

    Raises
    ------
    StoreError
        Another process owns the store and does not share it, its layout is not readable by this
        code, or its folder is not writable.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        lock = os.open(root / "lock", os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise StoreError(f"the store {root} cannot be written: {error.strerror}") from error
    try:
        is_first = _is_locked(lock, fcntl.LOCK_EX)
        if not is_first and not (is_shared and _is_locked(lock, fcntl.LOCK_SH, _OTHERS_START_S)):
            raise StoreError(
                f"the store {root} is in use by another process: stop that process first. To run "
                f"a second service, give it its own store, see {variable_of('store')}, or make "
                f"both services of a cluster with the same PostgreSQL database, see "
                f"{variable_of('state')}"
            )
        require_layout(root)
        if is_first:
            write_layout(root)
        yield Share(lock, is_first=is_first)
    finally:
        os.close(lock)


def _is_locked(number: int, kind: int, wait_s: float = 0.0) -> bool:
    until = time.monotonic() + wait_s
    while True:
        with suppress(BlockingIOError):
            fcntl.flock(number, kind | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= until:
            return False
        time.sleep(0.05)
