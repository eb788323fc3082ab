"""The objects of a store in a folder: plain files."""

import errno
import os
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG

from app.store.atomic import atomic_write
from app.store.objects import ABANDONED_S, ObjectInfo

_AHEAD_S = 60.0
"""A file server's clock may be so much ahead of ours"""
_CHUNK = 2**20


class Folder:
    """The files below ``root``; see ``Objects``."""

    is_local = True

    def __init__(self, root: Path) -> None:
        self._root = root
        self.is_alone = False
        """Whether no other process writes: nobody finishes what is unfinished"""

    def write(self, name: str, content: bytes | Path) -> None:
        """Write a file, or move one here.

        A rename keeps an upload cheap: obstore's store for folders would copy it.
        """
        path = self._root / name
        if isinstance(content, Path):
            path.parent.mkdir(parents=True, exist_ok=True)
            content.replace(path)
        else:
            with atomic_write(path) as file:
                file.write(content)

    def replace(self, name: str, content: bytes) -> bytes | None:
        """Write a small file; return what was there before."""
        before = self.read(name)
        self.write(name, content)
        return before

    def read(self, name: str) -> bytes | None:
        """Return the content of a file; None where there is none."""
        try:
            return (self._root / name).read_bytes()
        except FileNotFoundError:
            return None

    def size(self, name: str) -> int | None:
        """Return the size of a file; None where there is none."""
        try:
            return (self._root / name).stat().st_size
        except FileNotFoundError:
            return None

    def checksum(self, name: str) -> int | None:
        """Return the CRC-32 of a file; None where it is missing or the disk cannot read it."""
        return checksum_of(self._root / name)

    def found(self, folder: str) -> Iterator[ObjectInfo]:
        """Yield the files in a folder, the least recently used first.

        A time to come is one from before the clock was set back. All that was used since comes
        after.
        """
        now = time.time()
        files = []
        for path in (self._root / folder).rglob("*"):
            with suppress(FileNotFoundError):  # removed meanwhile
                status = path.stat()
                if S_ISREG(status.st_mode):
                    is_past = status.st_mtime <= now + _AHEAD_S
                    files.append((is_past, status.st_mtime, str(path), status.st_size))
        for is_past, modified, file, size in sorted(files):
            is_abandoned = self.is_alone or (is_past and now - modified > ABANDONED_S)
            name = Path(file).relative_to(self._root).as_posix()
            yield ObjectInfo(name, size, modified, is_abandoned)

    def folders(self, folder: str) -> list[str]:
        """Return the names of the folders in a folder."""
        return [path.name for path in (self._root / folder).glob("*/")]

    def remove(self, *names: str) -> None:
        """Remove files, those that are there."""
        for name in names:
            (self._root / name).unlink(missing_ok=True)

    def soon(self, remove: Callable[[str], None], name: str) -> None:
        """Remove it now."""
        remove(name)

    def note_use(self, name: str) -> None:
        """Set the time of a file to now; on a disk that can only be read it stays as it was."""
        try:
            os.utime(self._root / name)
        except FileNotFoundError:
            return  # removed meanwhile
        except OSError as error:
            if error.errno != errno.EROFS:
                raise

    def body(self, name: str, _size: int, _crc32: int, _on_damage: Callable[[], None]) -> Path:
        """Return the file; it was verified when the result was found."""
        return self._root / name


def checksum_of(path: Path) -> int | None:
    """Return the CRC-32 of a file; None where it is missing or the disk cannot read it."""
    checksum = 0
    try:
        with path.open("rb") as file:
            while chunk := file.read(_CHUNK):
                checksum = zlib.crc32(chunk, checksum)
    except OSError as error:
        if error.errno not in (errno.ENOENT, errno.EIO):
            raise  # such as too many open files: that says nothing about this one
        return None
    return checksum
