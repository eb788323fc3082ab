"""Layout of the store: one folder, and the number that tells what is in it.

::

    store/
        VERSION         the number of this layout
        lock            locked by the owner of the store while its process lives
        meshes/         see ``app.store.meshes``
        results/        see ``app.store.results``
        fields/         see ``app.store.fields``
        jobs.sqlite3    see ``app.state.schema``
        state           names the shared database that has the jobs instead, if any
        identity        a random id, by which machines tell this store from others
        tmp/            meshes that are being written
"""

from contextlib import suppress
from pathlib import Path
from uuid import uuid4

import orjson

LAYOUT = 7
"""Number of the layout that this code reads and writes. Raise it with every change of any file,
including the tables of jobs."""

STATE, IDENTITY = "state", "identity"
JOB_DATABASE = "jobs.sqlite3"
MESHES, RESULTS, FIELDS = "meshes", "results", "fields"
TEMPORARY = "tmp"

WITH_OLDER_MESHES = (4, 5)
"""Layouts whose meshes `app.store.conversion` makes current; in 4, each manifest had the number."""
CONVERTIBLE = (*WITH_OLDER_MESHES, 6)
"""Older layouts that this code takes over; in 6, the queries of jobs were not stored."""


class StoreError(Exception):
    """An unusable store; the message says why, and what to do."""


def layout_of(root: Path) -> int:
    """Return the layout of the store in ``root``: the present one, or one that can be converted.

    Raises
    ------
    StoreError
        It has another layout.
    """
    found = _layout(root)
    if found is None:
        return LAYOUT
    if found == LAYOUT or found in CONVERTIBLE:
        return int(found)
    raise StoreError(
        f"the store {root} has layout {found}, but this release reads {LAYOUT}: use the release "
        "that wrote it, or move the store away and upload its meshes again"
    )


def require_layout(root: Path) -> None:
    """Raise ``StoreError`` where the store in ``root`` does not have the present layout."""
    found = layout_of(root)
    if found != LAYOUT:
        raise StoreError(
            f"the store {root} has layout {found}, but this release reads {LAYOUT}: start the "
            "service on it once, which converts it"
        )


def note_state(root: Path, service: str | None) -> None:
    """Note what names the shared database with the jobs of a store; None where it has a file.

    Raises ``StoreError`` where the store cannot be written.
    """
    if service == noted_state(root):
        return
    aside = root / f"{STATE}.new"
    try:
        if service is None:
            (root / STATE).unlink()
        else:
            aside.write_text(service)
            aside.replace(root / STATE)
    except OSError as error:
        raise _unwritable(root, error) from error


def noted_state(root: Path) -> str | None:
    """Return what `note_state` noted last."""
    return _read(root, STATE)


def make_identity(root: Path) -> str:
    """Return the id of the store in ``root``, which gets one if it has none.

    Of machines that come at the same time one gives it. Raises ``StoreError`` where the store
    cannot be written.
    """
    known = _read(root, IDENTITY)
    if known is not None:
        return known
    identity = uuid4().hex
    aside = root / f"{IDENTITY}.{identity}"
    try:
        aside.write_text(identity)
        with suppress(FileExistsError):
            (root / IDENTITY).hardlink_to(aside)
        aside.unlink()
        return (root / IDENTITY).read_text()
    except OSError as error:
        raise _unwritable(root, error) from error


def _read(root: Path, name: str) -> str | None:
    try:
        return (root / name).read_text().strip()
    except FileNotFoundError:
        return None


def _unwritable(root: Path, error: OSError) -> StoreError:
    return StoreError(f"the store {root} cannot be written: {error.strerror}")


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
        return version
    return None
