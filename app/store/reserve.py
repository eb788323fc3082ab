"""A reserve of disk space: a file of no use but to be given up when the disk is full."""

import os
from pathlib import Path

from app.store.atomic import sync
from app.store.log import warn


class Reserve:
    """The file ``path`` of ``size`` bytes."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._size = size

    def is_there(self) -> bool:
        """Tell whether the file is there, and whole."""
        try:
            return self._path.stat().st_size == self._size
        except OSError:
            return False

    def restore(self) -> None:
        """Write the file, unless it is there; a failure is only logged."""
        if self.is_there():
            return
        try:
            self._path.write_bytes(os.urandom(self._size))  # zeros could be stored as a hole
            sync(self._path)
        except OSError as error:
            warn("no space reserved", path=self._path, error=repr(error))
            self.give_up()

    def give_up(self) -> None:
        """Remove the file, if it is there."""
        self._path.unlink(missing_ok=True)
