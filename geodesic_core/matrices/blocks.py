"""Blocks of finished rows in a scratch folder, from which an interrupted table goes on."""

import hashlib
import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidArgument
from geodesic_core.search.target_sweep import Entries

if TYPE_CHECKING:
    from filelock import FileLock

Row = NDArray[Any]
"""The finite distances of a row: (K,) of column, int32, and distance, float64"""

_QUESTION = "question.json"
_DIGEST_BYTES = 16


def rows_of(entries: Entries) -> dict[int, Row]:
    """Return the finite distances of some sweeps row by row, by the number of the sweep."""
    found = np.empty(len(entries.columns), [("column", np.int32), ("distance", np.float64)])
    found["column"], found["distance"] = entries.columns, entries.distances
    parts = np.split(found, entries.ends[1:-1])
    return dict(zip(entries.rows.tolist(), parts, strict=True))


@dataclass(frozen=True)
class Blocks:
    """The folder of a table in the making; each block is an array: checked, or missing.

    Of a block that is not complete, the rows that are there may be kept.
    """

    folder: Path

    @classmethod
    def beside(cls, out: Path) -> "Blocks":
        """Return the blocks of an output file."""
        return cls(out.with_name(f".{out.name}.part"))

    def open(self, question: Mapping[str, Any]) -> "FileLock":
        """Lock the folder, which is made where there is none; return the lock.

        Raises
        ------
        InvalidArgument
            It holds blocks of another question, another process works on it, or it cannot be
            written.
        """
        from filelock import FileLock, Timeout

        self._check_writable()
        lock = FileLock(self.folder.with_suffix(".lock"))
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise InvalidArgument(f"another process is writing {self._out()}") from None
        self.folder.mkdir(exist_ok=True)
        path, text = self.folder / _QUESTION, json.dumps(question, sort_keys=True)
        if not path.exists():
            _write(path, text.encode())
        elif path.read_text() != text:
            lock.release()
            raise InvalidArgument(
                f"{self.folder} holds part of another table for {self._out()}: remove it, or "
                f"choose another file"
            )
        return lock

    def _check_writable(self) -> None:
        try:  # of the lock, other failures look as if another process had it
            with tempfile.TemporaryFile(dir=self.folder.parent):
                pass
        except OSError as error:
            raise InvalidArgument(f"{self._out()} cannot be written: {error.strerror}") from None

    def _out(self) -> str:
        return self.folder.name.removeprefix(".").removesuffix(".part")

    def put(self, block: int, array: NDArray[Any]) -> None:
        """Write a block."""
        with (self.folder / f"{block}.npy").open("wb") as file:
            np.save(file, array)
            file.flush()
            os.fsync(file.fileno())
        # Last: without it the block counts as missing.
        _write(self.folder / f"{block}.crc32", _checksum(array))
        self._rows_of(block).unlink(missing_ok=True)

    def get(self, block: int) -> NDArray[Any]:
        """Return a block, mapped."""
        array: NDArray[Any] = np.load(self.folder / f"{block}.npy", mmap_mode="r")
        return array

    def has(self, block: int) -> bool:
        """Read a block; tell whether it is there and as it was written."""
        try:
            checksum = (self.folder / f"{block}.crc32").read_bytes()
            return checksum == _checksum(self.get(block))
        except (OSError, ValueError):
            return False

    def keep(self, block: int, rows: Mapping[int, Row]) -> None:
        """Write those rows of a block that are there, by sweep, instead of earlier ones."""
        content = BytesIO()
        np.savez(content, allow_pickle=False, **{str(sweep): row for sweep, row in rows.items()})
        _write(self._rows_of(block), _digest(content.getvalue()) + content.getvalue())

    def kept(self, block: int) -> dict[int, Row]:
        """Return the rows that are kept of a block; none if they are not as they were written."""
        path = self._rows_of(block)
        content = path.read_bytes() if path.exists() else b""
        digest, rows = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if digest != _digest(rows):
            return {}
        with np.load(BytesIO(rows), allow_pickle=False) as file:
            return {int(sweep): row for sweep, row in file.items()}

    def _rows_of(self, block: int) -> Path:
        return self.folder / f"{block}.rows"

    def remove(self) -> None:
        """Remove the folder: the table is finished."""
        shutil.rmtree(self.folder)
        self.folder.with_suffix(".lock").unlink(missing_ok=True)


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_DIGEST_BYTES).digest()


def _checksum(array: NDArray[Any]) -> bytes:
    return str(zlib.crc32(array.tobytes())).encode()


def _write(path: Path, content: bytes) -> None:
    """Write a small file, as a whole or not at all."""
    part = path.with_suffix(".tmp")
    with part.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
