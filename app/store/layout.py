"""Layout and ownership of the store: one folder, which belongs to one process at a time.

::

    store/
        VERSION         the number of this layout
        lock            locked by the owner of the store while its process lives
        meshes/         see ``app.store.meshes``
        results/        see ``app.store.results``
        fields/         see ``app.store.fields``
        jobs.sqlite3    see ``app.jobs.repository``
        jobs.reserve    see ``app.store.reserve``
        tmp/            meshes that are being written
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import orjson
from filelock import FileLock, Timeout

from app.settings import variable_of
from app.store.atomic import sync

LAYOUT = 5
"""Number of the layout that this code reads and writes. Raise it with every change of any file,
including the tables of jobs."""

JOB_DATABASE, JOB_RESERVE = "jobs.sqlite3", "jobs.reserve"
MESHES, RESULTS, FIELDS = "meshes", "results", "fields"
TEMPORARY = "tmp"

_READABLE = (4, LAYOUT)
"""Layouts that differ only in this number: up to 4, each mesh's manifest had it."""


class StoreError(Exception):
    """An unusable store; the message says why, and what to do."""


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
        require_layout(root)
        _write_layout(root)
        yield
    finally:
        lock.release()


def require_layout(root: Path) -> None:
    """Raise ``StoreError`` where the store in ``root`` has a layout that this code cannot read."""
    found = _layout(root)
    if found is not None and found not in _READABLE:
        raise StoreError(
            f"the store {root} has layout {found}, and this release reads {LAYOUT}: "
            f"use the release that wrote it, or move it away and upload its meshes again"
        )


def is_store(root: Path) -> bool:
    """Tell whether ``root`` holds a store."""
    return (root / "VERSION").is_file() or (root / MESHES).is_dir()


def _layout(root: Path) -> int | str | None:
    try:
        written = (root / "VERSION").read_text().strip()
    except FileNotFoundError:
        return _layout_of_manifests(root)
    return int(written) if written.isdecimal() else repr(written)


def _layout_of_manifests(root: Path) -> int | str | None:
    """Return the layout of a store older than 5, where a mesh of it tells; None elsewhere."""
    for path in (root / MESHES).glob("*/manifest.json"):
        try:
            version: int | str = orjson.loads(path.read_bytes())["version"]
        except (ValueError, TypeError, KeyError):
            continue  # damaged: reported when the mesh is read
        if version not in _READABLE:
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
