"""Resources of the machine that the service takes: memory, open files, room on the disk."""

import resource
import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from ctypes import CDLL
from dataclasses import dataclass
from pathlib import Path

from psutil import NoSuchProcess, Process

_M_ARENA_MAX, _ARENAS = -8, 2
"""glibc's number for the option, and how many arenas are enough: threads here mostly wait"""


@dataclass(frozen=True)
class Resources:
    """The resources in use at one moment."""

    memory: Mapping[str, int]
    """Resident bytes by kind of process: ``api``, ``worker``, and ``other`` for the fork server,
    and for processes that compile kernels"""
    open_fds: int
    """Open file descriptors of the API process"""
    max_fds: float
    """Most descriptors that it may have"""
    free_bytes: int
    """Bytes that can still be written to the disk of the store"""


def measure(workers: Collection[int], store: Path) -> Resources:
    """Return the resources of this process, the API process, and of all processes below it."""
    api = Process()
    memory = {"api": api.memory_info().rss, "worker": 0, "other": 0}
    for process in api.children(recursive=True):
        with suppress(NoSuchProcess):  # it has just ended
            memory["worker" if process.pid in workers else "other"] += process.memory_info().rss
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    max_fds = float("inf") if limit == resource.RLIM_INFINITY else limit
    return Resources(memory, api.num_fds(), max_fds, shutil.disk_usage(store).free)


def share_arenas() -> None:
    """Have the threads of this process share arenas, from which glibc allocates.

    Otherwise up to eight for each core grow side by side, and what was freed in one is of no use to
    the others: under mixed traffic that took 53 MB instead of 34, still growing after minutes.
    Other C libraries have no such option.
    """
    with suppress(AttributeError):
        CDLL(None).mallopt(_M_ARENA_MAX, _ARENAS)
