"""Blocks of finished rows in a scratch folder, from which an interrupted table goes on."""

import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from geodesic_core.errors import InvalidArgument

_QUESTION = "question.json"


@dataclass(frozen=True)
class Blocks:
    """The folder of a table in the making; each block is an array: checked, or missing."""

    folder: Path

    @classmethod
    def beside(cls, out: Path) -> "Blocks":
        """Return the blocks of an output file."""
        return cls(out.with_name(f".{out.name}.part"))

    def open(self, question: Mapping[str, Any]) -> FileLock:
        """Lock the folder, which is made where there is none; return the lock.

        Raises
        ------
        InvalidArgument
            It holds blocks of another question, another process works on it, or it cannot be
            written.
        """
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

    def remove(self) -> None:
        """Remove the folder: the table is finished."""
        shutil.rmtree(self.folder)
        self.folder.with_suffix(".lock").unlink(missing_ok=True)


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
