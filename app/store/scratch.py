"""Scratch: unfinished files on the disk of the store, and a budget for those of uploads.

What a worker writes there is bounded by the number of workers and the limits of a mesh. What
clients send is not, so that its bytes are reserved before they are written.
"""

import asyncio
import shutil
import tempfile
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from uuid import uuid4

from app.errors import over_limit
from app.store.layout import TEMPORARY

_MOST_UNPACKED = 100
"""Times that a packed file may grow. Text of vertices and faces grows 3 to 30 times."""
_FREE_UNPACKED = 2**20
"""Bytes that every packed file may have"""


def most_unpacked(packed_bytes: int, max_bytes: int) -> int:
    """Return the most bytes that a file of so many may have once it is unpacked."""
    return min(max_bytes, _FREE_UNPACKED + _MOST_UNPACKED * packed_bytes)


class Scratch:
    """The scratch folders under ``root``, for uploads of ``capacity`` bytes at a time.

    A caller that has reserved bytes already gets no more than half of them all.
    """

    def __init__(self, root: Path, capacity: int) -> None:
        self._root = root / TEMPORARY
        self._capacity = capacity
        self._reserved: Counter[str] = Counter()

    def prepare(self, *, is_alone: bool = True) -> None:
        """Remove what a former service left, unless another one may be writing it."""
        self._root.mkdir(exist_ok=True)
        if is_alone:
            _remove(*self._root.iterdir())

    @property
    def reserved(self) -> int:
        """Bytes that are reserved at the moment."""
        return self._reserved.total()

    @asynccontextmanager
    async def folder(self, caller: str) -> AsyncIterator["ScratchFolder"]:
        """Lend an empty folder to a caller, and remove it after the block."""
        folder = ScratchFolder(Path(tempfile.mkdtemp(dir=self._root)), self, caller)
        try:
            yield folder
        finally:
            # Rename first: then a worker that is about to be killed can no longer write into it.
            gone = self._root / f"{uuid4().hex}.gone"
            try:
                folder.path.rename(gone)
            except OSError:  # the disk has no room for another name
                gone = folder.path
            try:
                await asyncio.to_thread(_remove, gone)
            finally:
                folder.reserve(0)

    def change(self, caller: str, nbytes: int) -> None:
        """Reserve more bytes for a caller, or fewer; raises ``ProblemError`` without room."""
        own, total = self._reserved[caller] + nbytes, self.reserved + nbytes
        is_greedy = own > nbytes and 2 * own > self._capacity
        if nbytes > 0 and (is_greedy or total > self._capacity):
            what = "bytes of one caller's uploads" if is_greedy else "bytes of uploads"
            actual, limit = (own, self._capacity // 2) if is_greedy else (total, self._capacity)
            raise over_limit(
                "queue_full", what, actual, limit, "scratch_bytes", headers={"Retry-After": "1"}
            )
        self._reserved[caller] = own
        if not own:
            del self._reserved[caller]


class ScratchFolder:
    """An empty folder, and the bytes that are reserved for it."""

    def __init__(self, path: Path, scratch: Scratch, caller: str) -> None:
        self.path = path
        self.reserved = 0
        self._scratch = scratch
        self._caller = caller

    def reserve(self, nbytes: int) -> None:
        """Reserve so many bytes in all; raises ``ProblemError`` where there is no room."""
        self._scratch.change(self._caller, nbytes - self.reserved)
        self.reserved = nbytes


def _remove(*entries: Path) -> None:
    for entry in entries:
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)
