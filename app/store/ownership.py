"""Ownership of the store: it belongs to one service at a time, or to several that share state.

Whoever comes first brings it up to date.
"""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from app.settings import variable_of
from app.store.atomic import sync
from app.store.conversion import convert
from app.store.layout import LAYOUT, WITH_OLDER_MESHES, StoreError, layout_of


@contextmanager
def owned(root: Path) -> Iterator[None]:
    """Own the store in the folder ``root`` inside the block; the folder is created if missing.

    The lock ends with the process, however that ends.

    Raises
    ------
    StoreError
        Another process owns the store, its layout is not readable by this code, or its folder is
        not writable.
    """
    # The soft fallback is a mere file, which would outlive the process.
    lock = FileLock(root / "lock", timeout=0, thread_local=False, fallback_to_soft=False)
    try:
        root.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout:
        setting = variable_of("store")
        raise StoreError(
            f"the store {root} is in use by another process: stop that process first. To run a "
            f"second service, give it its own store, see {setting}, or make both services of a "
            f"cluster with the same PostgreSQL database, see {variable_of('state')}"
        ) from None
    except OSError as error:
        raise StoreError(f"the store {root} cannot be written: {error.strerror}") from error
    try:
        _bring_up_to_date(root)
        yield
    finally:
        lock.release()


class Share:
    """The share of a service in a store that several use.

    Until `let_others_in` the first one is alone: it brings the store up to date, and removes what
    was left unfinished.
    """

    def __init__(self, lock: int, *, is_first: bool) -> None:
        self._lock = lock
        self.is_first = is_first

    def let_others_in(self) -> None:
        """Let other services use the store."""
        fcntl.flock(self._lock, fcntl.LOCK_SH)


@contextmanager
def shared(root: Path) -> Iterator[Share]:
    """Share the store in the folder ``root`` inside the block, with services that do so as well.

    Raises
    ------
    StoreError
        As `owned` does; or its owner does not share it.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        lock = os.open(root / "lock", os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise StoreError(f"the store {root} cannot be written: {error.strerror}") from error
    try:
        is_first = _is_locked(lock, fcntl.LOCK_EX)
        if is_first:
            _bring_up_to_date(root)
        elif not _is_locked(lock, fcntl.LOCK_SH, wait_s=_OTHERS_START_S):
            raise StoreError(
                f"the store {root} is in use by another process: stop that process first, or give "
                f"both the same {variable_of('state')}"
            )
        yield Share(lock, is_first=is_first)
    finally:
        os.close(lock)


_OTHERS_START_S = 20.0
"""Seconds that a service waits for another one to bring the store up to date"""


def _is_locked(number: int, kind: int, wait_s: float = 0.0) -> bool:
    until = time.monotonic() + wait_s
    while True:
        with suppress(BlockingIOError):
            fcntl.flock(number, kind | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= until:
            return False
        time.sleep(0.05)


def _bring_up_to_date(root: Path) -> None:
    try:
        if layout_of(root) in WITH_OLDER_MESHES:
            convert(root)
        _write_layout(root)
    except OSError as error:
        raise StoreError(
            f"the store {root} cannot be brought up to date: {error.strerror}"
        ) from error


def _write_layout(root: Path) -> None:
    if _layout_is_written(root):
        return
    aside = root / "VERSION.new"
    aside.write_text(f"{LAYOUT}\n")
    sync(aside)
    aside.replace(root / "VERSION")
    sync(root)


def _layout_is_written(root: Path) -> bool:
    path = root / "VERSION"
    return path.is_file() and path.read_text().strip() == str(LAYOUT)
