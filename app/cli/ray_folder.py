"""The folder of a command that joins a cluster: Ray's sockets and logs, while the command lives."""

import fcntl
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

_PREFIX = "geodesic-ray-"
_LOCK = "owner.lock"
"""Locked by the owner of the folder; the lock ends with its process, however that ends"""


@contextmanager
def ray_folder() -> Iterator[Path]:
    """Lend a new folder for the block, and remove those of commands that were killed."""
    _remove_abandoned()
    with TemporaryDirectory(prefix=_PREFIX) as name:
        folder = Path(name)
        aside = folder / f"{_LOCK}.new"
        with aside.open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            aside.rename(folder / _LOCK)  # nobody sees it unlocked
            yield folder


def _remove_abandoned() -> None:
    for path in Path(gettempdir()).glob(f"{_PREFIX}*/{_LOCK}"):
        with suppress(OSError), path.open() as lock:  # its owner lives, or is another user
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path.parent, ignore_errors=True)
