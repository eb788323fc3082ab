"""Checksums of files, each read once for every version of its file.

Files of the store are written once and never changed. One that has changed all the same shows it in
its status, which costs a microsecond to ask for; only then is it read again.
"""

import errno
import os
import time
import zlib
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

_CHUNK = 2**20

_TICK_NS = 10_000_000
"""The longest time in which two changes of a file may get the same time stamp, ns"""


class FileVersion(NamedTuple):
    """The part of a file's status that tells whether the file was changed or replaced."""

    inode: int
    size: int
    mtime_ns: int
    ctime_ns: int
    """Unlike the other times, nobody can set it back"""


def version_of(path: str) -> FileVersion | None:
    """Return the present version of a file; None where there is none."""
    try:
        status = os.stat(path)  # noqa: PTH116 - each request needs it, and a `Path` is slow
    except FileNotFoundError:
        return None
    return FileVersion(status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


def changed_files(versions: Mapping[str, FileVersion | None]) -> list[str]:
    """Return the paths of the files that no longer have these versions; None for no file.

    Each query asks this twice, of every array: `version_of` would take twice as long.
    """
    changed = []
    for path, version in versions.items():
        try:
            status = os.stat(path)  # noqa: PTH116 - as above
        except FileNotFoundError:
            now = None
        else:
            now = status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
        if now != version:
            changed.append(path)
    return changed


def checksum_of(path: str) -> int | None:
    """Return the CRC-32 of a file, read at most once for each version of it.

    None where the file is missing or the disk cannot read it.
    """
    version = version_of(path)
    return None if version is None else _checksum_of_version(path, version)


def read_checksum(path: str) -> int | None:
    """Return the CRC-32 of a file as it is now; None as in `checksum_of`."""
    checksum = 0
    try:
        with open(path, "rb") as file:  # noqa: PTH123 - see `version_of`
            while chunk := file.read(_CHUNK):
                checksum = zlib.crc32(chunk, checksum)
    except OSError as error:
        if error.errno not in (errno.ENOENT, errno.EIO):
            raise  # such as too many open files: that says nothing about this one
        return None
    return checksum


@lru_cache(maxsize=2**14)
def _checksum_of_version(path: str, version: FileVersion) -> int | None:
    # Read in the tick of its last change, the file could change once more without a new time.
    rest = version.ctime_ns + _TICK_NS - time.time_ns()
    if rest > 0:
        time.sleep(min(rest, _TICK_NS) / 1e9)
    return read_checksum(path)
