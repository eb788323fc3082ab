"""The store as a whole: one folder, of one layout, that belongs to one process at a time.

::

    store/
        VERSION         the layout of all that is here
        lock            held by whoever owns the store, for as long as its process lives
        meshes/         see ``mesh_store``
        results/        see ``result_store``
        fields/         see ``field_store``
        jobs.sqlite3    see ``jobs.book``
        tmp/            what is being written
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import orjson
from filelock import FileLock, Timeout

from app.settings import variable_of
from app.store.atomic import sync

LAYOUT = 5
"""Of the store that this code reads and writes. To be raised with every change of any of its files,
the job book's tables among them."""

JOB_BOOK, MESHES, RESULTS, FIELDS = "jobs.sqlite3", "meshes", "results", "fields"
TEMPORARY = "tmp"

_READ_AS_THEY_ARE = (4, LAYOUT)
"""Layouts that differ by this number alone: up to 4 it was in each mesh's manifest."""


class StoreError(Exception):
    """The store cannot be used as it is; the message says why, and what to do."""


@contextmanager
def owned(root: Path) -> Iterator[None]:
    """Own the store in the folder ``root`` while inside; it is made where it is not there.

    The lock goes with the process, however that ends.

    Raises
    ------
    StoreError
        Another process owns it, it has a layout that this code does not read, or its folder cannot
        be written.
    """
    # A lock that is a mere file would outlive the process: better none.
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
        require_layout(root)
        _write_layout(root)
        yield
    finally:
        lock.release()


def require_layout(root: Path) -> None:
    """Raise ``StoreError`` where the store in ``root`` has a layout that is not read here."""
    found = _layout(root)
    if found is not None and found not in _READ_AS_THEY_ARE:
        raise StoreError(
            f"the store {root} has layout {found}, and this release reads {LAYOUT}: "
            f"use the release that wrote it, or move it away and upload its meshes again"
        )


def is_store(root: Path) -> bool:
    """Tell whether there is a store in ``root``."""
    return (root / "VERSION").is_file() or (root / MESHES).is_dir()


def _layout(root: Path) -> int | str | None:
    try:
        written = (root / "VERSION").read_text().strip()
    except FileNotFoundError:
        return _layout_of_manifests(root)
    return int(written) if written.isdecimal() else repr(written)


def _layout_of_manifests(root: Path) -> int | str | None:
    """Return the layout of a store of before 5, where it has any mesh that tells."""
    for path in (root / MESHES).glob("*/manifest.json"):
        try:
            version: int | str = orjson.loads(path.read_bytes())["version"]
        except (ValueError, TypeError, KeyError):
            continue  # damaged: it will say so when it is asked for
        if version not in _READ_AS_THEY_ARE:
            return version
    return None


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
