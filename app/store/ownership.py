"""Ownership of the store: it belongs to one process at a time, which brings it up to date."""

from collections.abc import Iterator
from contextlib import contextmanager
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
            f"the store {root} is in use by another process, which must end first; "
            f"a second service needs a store of its own, see {setting}"
        ) from None
    except OSError as error:
        raise StoreError(f"the store {root} cannot be written: {error.strerror}") from error
    try:
        _bring_up_to_date(root)
        yield
    finally:
        lock.release()


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
