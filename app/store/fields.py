"""Distance fields on disk, where all workers find them, and those of the next start.

``fields/{mesh id}/{key}.npz`` has the arrays of a field, with their checksums, and which version of
the code found it. There are no books: workers write, and each removes what is beyond the bound.
"""

import logging
import shutil
import struct
import zlib
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from app.store.atomic import atomic_write, remove_partial
from app.store.layout import FIELDS

logger = logging.getLogger(__name__)

_DAMAGED = (BadZipFile, EOFError, KeyError, RuntimeError, ValueError, struct.error, zlib.error)
_CODE = "code"

Arrays = Mapping[str, NDArray[Any]]


class FieldStore:
    """The fields in the store ``root``, at most ``capacity`` bytes; any number of processes use it.

    Those used least recently go first. One that is being read may go: it stays until it is read.
    """

    def __init__(self, root: Path, capacity: int) -> None:
        self._root = root
        self.folder = root / FIELDS
        self._capacity = capacity

    def prepare(self, meshes: Collection[str]) -> None:
        """Remove what was left half-written, and the fields of meshes that are gone."""
        remove_partial(self.folder)
        for folder in self.folder.glob("*"):
            if folder.name not in meshes:
                self.forget_mesh(folder.name)

    def read(self, mesh_id: str, key: str) -> Arrays | None:
        """Return the arrays of a field, if it is there and whole."""
        path = self._path(mesh_id, key)
        try:
            arrays = _read(path)
            path.touch()  # the order of use
        except FileNotFoundError:
            return None
        except (*_DAMAGED, OSError) as error:
            logger.warning("a kept field cannot be read, and is solved again: %s: %s", path, error)
            path.unlink(missing_ok=True)
            return None
        return arrays

    def write(self, mesh_id: str, key: str, arrays: Arrays, code: str) -> None:
        """Keep a field, if there is room for it; what fails is told in the log only."""
        if sum(array.nbytes for array in arrays.values()) > self._capacity:
            return
        try:
            with atomic_write(self._path(mesh_id, key)) as file:
                np.savez(file, allow_pickle=False, **arrays, **{_CODE: np.array(code)})
            self._evict()
        except (OSError, MemoryError) as error:
            logger.warning("a field is not kept on disk: %s/%s: %s", mesh_id, key, error)

    def forget_mesh(self, mesh_id: str) -> None:
        """Remove the fields of a mesh; one that is being written may be left for `prepare`."""
        shutil.rmtree(self.folder / mesh_id, ignore_errors=True)

    def _evict(self) -> None:
        sizes = field_files(self._root)
        total = sum(sizes.values())
        for path, size in sizes.items():
            if total <= self._capacity:
                return
            path.unlink(missing_ok=True)
            total -= size

    def _path(self, mesh_id: str, key: str) -> Path:
        return self.folder / mesh_id / f"{key}.npz"


def field_files(root: Path) -> dict[Path, int]:
    """Return the bytes of each file of a field in a store, those used least recently first."""
    found = []
    for path in (root / FIELDS).glob("*/*.npz"):
        with suppress(FileNotFoundError):  # it has just gone
            status = path.stat()
            found.append((status.st_mtime_ns, path, status.st_size))
    return {path: size for _, path, size in sorted(found)}


def name_of_field(path: Path) -> str:
    """Return the name of the field in a file: its mesh and its key."""
    return f"{path.parent.name}/{path.stem}"


def code_of_field(path: Path) -> str | None:
    """Return which version of the code found the field in a file; None where it is damaged."""
    try:
        return str(_read(path)[_CODE])
    except (*_DAMAGED, OSError):
        return None


def _read(path: Path) -> Arrays:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
        bad = kept.zip.testzip()  # to load an array is not to read all of its file
        if bad is not None or _CODE not in kept:  # which was written last
            raise BadZipFile(f"{bad or _CODE} is not what was written")
        return dict(kept)
