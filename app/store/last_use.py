"""The last use of a file or folder: its time of change, which workers and later starts read."""

import errno
import os
import time
from pathlib import Path

_AHEAD_NS = 60 * 10**9
"""A file server's clock may be so much ahead of ours, ns"""


def note_use(path: str | Path) -> None:
    """Set the time of a file or folder to now.

    On a disk that can only be read the order of use stays as it was.
    """
    try:
        os.utime(path)
    except OSError as error:
        if error.errno != errno.EROFS:
            raise


def order_of_use(status: os.stat_result) -> tuple[bool, int]:
    """Return the place of a file in the order of use; the lowest was used least recently.

    A time to come is one from before the clock was set back. All that was used since comes after.
    """
    return status.st_mtime_ns <= time.time_ns() + _AHEAD_NS, status.st_mtime_ns
