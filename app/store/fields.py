"""Distance fields on disk, shared by all workers and by the next start.

``fields/{mesh id}/{key}.npz`` holds the arrays of a field, their checksums, and the version of the
code that solved it. There is no index: workers write, and each removes files beyond the bound.
"""

import shutil
import struct
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from app.store.atomic import atomic_write, remove_partial
from app.store.folder import Folder
from app.store.layout import FIELDS
from app.store.log import warn

_DAMAGED = (BadZipFile, EOFError, KeyError, RuntimeError, ValueError, struct.error, zlib.error)
_CODE = "code"

Arrays = Mapping[str, NDArray[Any]]


class FieldStore:
    """The fields in the store ``root``, at most ``capacity`` bytes, for any number of processes.

    The least recently used go first. A field may be removed while it is read: the open file stays.
    """

    def __init__(self, root: Path, capacity: int) -> None:
        self._files = Folder(root)
        self._root = root
        self.folder = root / FIELDS
        self._capacity = capacity
        self.evictions = 0
        """Fields that this process removed so far to make room"""

    def prepare(self, meshes: Collection[str]) -> None:
        """Remove unfinished files, and the fields of meshes that are gone."""
        remove_partial(self.folder)
        for folder in self.folder.glob("*"):
            if folder.name not in meshes:
                self.forget_mesh(folder.name)

    def read(self, mesh_id: str, key: str) -> Arrays | None:
        """Return the arrays of a field; None where it is missing or damaged."""
        path = self._path(mesh_id, key)
        try:
            arrays = {name: array for name, array in _read(path).items() if name != _CODE}
            self._files.note_use(f"{FIELDS}/{mesh_id}/{key}.npz")
        except FileNotFoundError:
            return None
        except (*_DAMAGED, OSError) as error:
            warn("stored field unreadable, solved again", path=path, error=repr(error))
            path.unlink(missing_ok=True)
            return None
        return arrays

    def write(self, mesh_id: str, key: str, arrays: Arrays, code: str) -> None:
        """Store a field, if there is room for it; a failure is only logged."""
        if sum(array.nbytes for array in arrays.values()) > self._capacity:
            return
        try:
            with atomic_write(self._path(mesh_id, key)) as file:
                np.savez(file, allow_pickle=False, **arrays, **{_CODE: np.array(code)})
            self._evict()
        except (OSError, MemoryError) as error:
            warn("field not stored", mesh_id=mesh_id, key=key, error=repr(error))

    def forget_mesh(self, mesh_id: str) -> None:
        """Remove the fields of a mesh; one that is being written may be left to `prepare`."""
        shutil.rmtree(self.folder / mesh_id, ignore_errors=True)

    def _evict(self) -> None:
        sizes = field_files(self._root)
        total = sum(sizes.values())
        for path, size in sizes.items():
            if total <= self._capacity:
                return
            path.unlink(missing_ok=True)
            total -= size
            self.evictions += 1

    def _path(self, mesh_id: str, key: str) -> Path:
        return self.folder / mesh_id / f"{key}.npz"


def field_files(root: Path) -> dict[Path, int]:
    """Return the size of each field file in a store, the least recently used first."""
    found = Folder(root).found(FIELDS)
    return {root / each.name: each.size for each in found if each.name.endswith(".npz")}


def code_of_field(path: Path) -> str | None:
    """Return the version of the code that solved the field in a file; None where it is damaged."""
    try:
        return str(_read(path)[_CODE])
    except (*_DAMAGED, OSError):
        return None


def _read(path: Path) -> Arrays:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        bad = archive.zip.testzip()  # loading an array does not read all of its file
        if bad is not None or _CODE not in archive:  # written last
            raise BadZipFile(f"{bad or _CODE} is not what was written")
        return dict(archive)
