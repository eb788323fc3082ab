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

from app.store.atomic import sync

LAYOUT = 7
"""Number of the layout that this code reads and writes. Raise it with every change of any file,
including the tables of jobs."""

STATE, IDENTITY = "state", "identity"
JOB_DATABASE = "jobs.sqlite3"
MESHES, RESULTS, FIELDS = "meshes", "results", "fields"
TEMPORARY = "tmp"


class StoreError(Exception):
    """An unusable store; the message says why, and what to do."""


def require_layout(root: Path) -> None:
    """Raise ``StoreError`` where the store in ``root`` has another layout."""
    found = _read(root, "VERSION")
    if found is None and (root / MESHES).is_dir():
        found = "4 or older"  # these had no such file
    if found not in (None, str(LAYOUT)):
        raise StoreError(
            f"the store {root} has layout {found}, but this release reads {LAYOUT}: use the "
            "release that wrote it, or move the store away and upload its meshes again"
        )


def write_layout(root: Path) -> None:
    """Note the layout of a new store; raises ``StoreError`` where it cannot be written."""
    if _read(root, "VERSION") is not None:
        return
    aside = root / "VERSION.new"
    try:
        aside.write_text(f"{LAYOUT}\n")
        sync(aside)
        aside.replace(root / "VERSION")
        sync(root)
    except OSError as error:
        raise _unwritable(root, error) from error


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
