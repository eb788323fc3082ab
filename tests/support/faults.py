"""Faults of files: what disks and people do to a file that is never to change."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

Fault = Callable[[Path], None]


def flip_bytes(path: Path) -> None:
    """Change the last eight bytes in place."""
    _overwrite(path, -8, os.SEEK_END)


def flip_header(path: Path) -> None:
    """Change eight bytes of the shape that numpy's header tells."""
    _overwrite(path, path.read_bytes().index(b"'shape': (") + 10, os.SEEK_SET)


def flip_bytes_and_restore_times(path: Path) -> None:
    """Change bytes in place, as if at the time of the last change."""
    status = path.stat()
    flip_bytes(path)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size - 8)


def extend(path: Path) -> None:
    with path.open("ab") as file:
        file.write(bytes(8))


def replace(path: Path) -> None:
    """Move in another file, of the same size and time."""
    status, content = path.stat(), path.read_bytes()
    other = path.with_name("other")
    other.write_bytes(content[:-8] + _flipped(content[-8:]))
    os.utime(other, ns=(status.st_atime_ns, status.st_mtime_ns))
    other.rename(path)


def remove(path: Path) -> None:
    path.unlink()


FAULTS: Mapping[str, Fault] = {
    fault.__name__: fault
    for fault in (
        flip_bytes,
        flip_header,
        flip_bytes_and_restore_times,
        truncate,
        extend,
        replace,
        remove,
    )
}
"""All faults of an array's file, by name"""


def edit_counts(path: Path) -> None:
    """Have a manifest tell of one face more."""
    content = path.read_bytes()
    count = content.partition(b'"faces":')[2].partition(b",")[0]
    path.write_bytes(content.replace(b'"faces":' + count, b'"faces":%d' % (int(count) + 1)))


def break_json(path: Path) -> None:
    path.write_bytes(b"{")


MANIFEST_FAULTS: Mapping[str, Fault] = {
    fault.__name__: fault for fault in (edit_counts, break_json, truncate, extend, remove)
}
"""All faults of a manifest, by name"""


def _overwrite(path: Path, offset: int, whence: int) -> None:
    with path.open("r+b") as file:
        start = file.seek(offset, whence)
        content = file.read(8)
        file.seek(start)
        file.write(_flipped(content))


def _flipped(content: bytes) -> bytes:
    return bytes(byte ^ 255 for byte in content)
