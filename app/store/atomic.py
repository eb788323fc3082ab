"""Files that are written whole or not at all, and that survive a power cut."""

import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import IO

_PARTIAL = "tmp"
"""Prefix of the names of unfinished files"""


@contextmanager
def atomic_write(path: Path) -> Iterator[IO[bytes]]:
    """Yield a file that appears at ``path`` once the block has succeeded, and not otherwise.

    A killed process may leave an unfinished file, which the next start removes.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=_PARTIAL, delete=False) as file:
        try:
            yield file
            file.close()
            Path(file.name).rename(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise


def remove_partial(folder: Path) -> None:
    """Remove the files that `atomic_write` did not finish from the folders in ``folder``."""
    for path in folder.glob(f"*/{_PARTIAL}*"):
        path.unlink()


def sync(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def sync_all(folder: Path) -> None:
    """Flush a folder and the files in it to the disk.

    The threads wait for the disk's journal together: 15 files take 10 ms, and one after the other
    64 ms.
    """
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(sync, folder.iterdir()))
    sync(folder)
