"""Which meshes there are, how large they are and when they were used: kept by one process.

What is on disk are the books: each change is one rename, made together with its entry here, so that
a crash leaves a mesh either there or not, and the next start counts anew. Workers write meshes
aside, in a folder that is lent to them; what they leave there, killed or not, is removed with it.
"""

import asyncio
import shutil
import tempfile
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Collection, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from app.errors import over_limit
from app.store.atomic import sync, sync_all
from app.store.layout import TEMPORARY
from app.store.meshes import MeshStore, WrittenMesh, unknown


@dataclass(frozen=True)
class Kept:
    """What has become of a mesh that was written aside."""

    is_new: bool
    evicted: Sequence[str] = ()
    """The meshes that went, so that it had room"""


class MeshCatalog:
    """The meshes of a store, at most ``capacity`` bytes.

    What finds no room is refused; or, where it ``evicts``, the meshes go that were used least
    recently, but none that is held.
    """

    def __init__(self, root: Path, store: MeshStore, capacity: int, *, evicts: bool) -> None:
        self._store = store
        self._temporary = root / TEMPORARY
        self._capacity = capacity
        self._evicts = evicts
        self._sizes: OrderedDict[str, int] = OrderedDict()  # the least recently used first
        self._held: Counter[str] = Counter()

    def prepare(self) -> None:
        """Sweep what a former service left half-written, and count what is there."""
        self._store.folder.mkdir(exist_ok=True)
        self._temporary.mkdir(exist_ok=True)
        _remove(*self._temporary.iterdir())
        self._sizes = OrderedDict(self._store.sizes())

    @property
    def ids(self) -> Collection[str]:
        """Which meshes there are."""
        return self._sizes.keys()

    @property
    def total(self) -> int:
        """Bytes of all meshes."""
        return sum(self._sizes.values())

    @asynccontextmanager
    async def scratch_folder(self) -> AsyncIterator[Path]:
        """Lend an empty folder on the store's disk; all that is in it goes afterwards."""
        folder = Path(tempfile.mkdtemp(dir=self._temporary))
        try:
            yield folder
        finally:
            # Renamed first: a worker that is about to be killed has no place to write to any more.
            gone = self._new_name()
            try:
                folder.rename(gone)
            except OSError:  # no room for another name
                gone = folder
            await asyncio.to_thread(_remove, gone)

    async def keep(self, written: WrittenMesh) -> Kept:
        """Move in what has been written aside, for good; a mesh that is there already is used.

        Raises
        ------
        ProblemError
            There is no room.
        """
        mesh_id = written.mesh_id
        if written.folder is None or mesh_id in self._sizes:
            self.use(mesh_id)
            return Kept(is_new=False)
        await asyncio.to_thread(sync_all, written.folder)
        if mesh_id in self._sizes:  # another was faster
            return Kept(is_new=False)
        evicted = self._chosen_to_go(written.size)
        gone: list[Path] = []
        try:
            gone.extend(self._move_out(old) for old in evicted)
            written.folder.rename(self._store.folder / mesh_id)
            self._sizes[mesh_id] = written.size
            await asyncio.to_thread(sync, self._store.folder)
        except OSError:
            if mesh_id in self._sizes:
                gone.append(self._move_out(mesh_id))  # a power cut might take it: better told now
            raise
        finally:
            await asyncio.to_thread(_remove, *gone)
        return Kept(is_new=True, evicted=evicted)

    async def delete(self, mesh_id: str) -> None:
        """Remove a mesh at once; processes that have it open keep what they mapped."""
        if mesh_id not in self._sizes:
            raise unknown(mesh_id)
        gone = self._move_out(mesh_id)
        await asyncio.to_thread(_remove, gone)

    def use(self, mesh_id: str) -> None:
        """Note that a mesh is used now, if it is there."""
        if mesh_id in self._sizes:
            self._sizes.move_to_end(mesh_id)
            self._store.note_use(mesh_id)

    @contextmanager
    def held(self, mesh_id: str) -> Iterator[None]:
        """Do not let a mesh go while inside, unless it is deleted."""
        self.use(mesh_id)
        self._held[mesh_id] += 1
        try:
            yield
        finally:
            self._held[mesh_id] -= 1
            if not self._held[mesh_id]:
                del self._held[mesh_id]

    def _chosen_to_go(self, size: int) -> list[str]:
        """Return the meshes that have to go for so many bytes more, or refuse these."""
        free = [mesh_id for mesh_id in self._sizes if mesh_id not in self._held]
        going: list[str] = []
        total = self.total + size
        if self._evicts and size <= self._capacity:
            while total > self._capacity and len(going) < len(free):
                going.append(free[len(going)])
                total -= self._sizes[going[-1]]
        if total > self._capacity:
            hint = "delete meshes that are not needed any more"
            raise over_limit(
                "storage_full", "bytes of meshes", total, self._capacity, "store_bytes", hint=hint
            )
        return going

    def _move_out(self, mesh_id: str) -> Path:
        gone = self._new_name()
        (self._store.folder / mesh_id).rename(gone)
        del self._sizes[mesh_id]
        return gone

    def _new_name(self) -> Path:
        return self._temporary / f"{uuid4().hex}.gone"


def _remove(*entries: Path) -> None:
    for entry in entries:
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)
