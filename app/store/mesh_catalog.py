"""The catalog of stored meshes: sizes and order of use.

One process knows it, or the catalogs of several services share a table. Their home is the source of
truth: a folder, or an object store. Each change there is made together with its entry here: a crash
leaves a mesh either there or not, and the next start counts anew. The files of a damaged mesh are
replaced: until the last one is there, it is still damaged.
"""

import asyncio
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from dataclasses import dataclass
from typing import Protocol

from app.errors import ProblemError, over_limit
from app.store.mesh_home import MeshHome, MeshRecord
from app.store.meshes import WrittenMesh, mesh_not_found


@dataclass(frozen=True)
class CatalogChange:
    """The effect of adding a mesh."""

    is_new: bool
    is_healed: bool = False
    """Whether the mesh was there, but damaged"""
    evicted: Sequence[str] = ()
    """Ids of the meshes that were removed to make room"""


class MeshTable(Protocol):
    """A table of meshes, which nobody else changes meanwhile."""

    async def all(self) -> Mapping[str, MeshRecord]:
        """Return all records by id, the least recently used first."""

    async def add(self, mesh_id: str, record: MeshRecord) -> None:
        """Insert a record, unless it is there."""

    async def remove(self, mesh_id: str) -> None:
        """Remove a record, if it is there."""


class MeshTables(Protocol):
    """The table that the catalogs of several services share."""

    def alone(self) -> AbstractAsyncContextManager[MeshTable]:
        """Yield the table for the block, which no other catalog changes meanwhile."""

    async def note_uses(self, used: Iterable[str], pinned: Collection[str]) -> None:
        """Note that meshes were used, the last one last, and that some are in use for a while."""


class MeshCatalog:
    """The meshes of a store, at most ``capacity`` bytes.

    A mesh that finds no room is refused. With ``evicts``, the least recently used meshes are
    removed instead, but none that is pinned.

    Where services share the meshes, ``shared`` is their table. What is here is a copy of it, as old
    as the last change or `keep_up`.
    """

    def __init__(
        self,
        home: MeshHome,
        capacity: int,
        *,
        evicts: bool,
        shared: MeshTables | None = None,
    ) -> None:
        self._home = home
        self._lock = asyncio.Lock()
        self._shared = shared
        self._used: dict[str, None] = {}
        """Meshes used since the shared table was told, the last one last"""
        self._capacity = capacity
        self._evicts = evicts
        self._entries: OrderedDict[str, MeshRecord] = OrderedDict()  # the least recently used first
        self._pins: Counter[str] = Counter()
        self.evictions = 0
        """Meshes removed so far to make room"""

    def prepare(self) -> None:
        """Measure the meshes."""
        self._entries = OrderedDict(self._home.found())

    async def reconcile(self) -> None:
        """Bring the shared table up to date with what is there."""
        if self._shared is not None:
            async with self._table():
                self._entries = OrderedDict(await asyncio.to_thread(self._home.found))

    async def keep_up(self) -> None:
        """Tell the shared table of uses, and take over what other services changed."""
        if self._shared is not None:
            await self._tell_uses(self._shared)
            async with self._table():
                pass

    @asynccontextmanager
    async def _table(self) -> AsyncIterator[None]:
        """Be alone in changing meshes inside the block; the shared table follows."""
        if self._shared is None:
            async with self._lock:
                yield
            return
        failure: BaseException | None = None
        # Whoever waits for the table holds a connection: at most one of them is of this service.
        async with self._lock, self._shared.alone() as table:
            before = await table.all()
            self._entries = OrderedDict(before)
            for mesh_id in self._used:
                if mesh_id in before:
                    self._entries.move_to_end(mesh_id)
            try:
                yield
            except BaseException as error:  # noqa: BLE001 - raised once the table knows what happened
                failure = error
            for mesh_id in before.keys() - self._entries.keys():
                await table.remove(mesh_id)
            for mesh_id, record in list(self._entries.items()):  # queries change their order
                if mesh_id not in before:
                    await table.add(mesh_id, record)
        if failure is not None:
            raise failure

    async def _tell_uses(self, shared: MeshTables) -> None:
        used, self._used = self._used, {}
        try:
            await shared.note_uses(used, list(self._pins))
        except BaseException:
            self._used = {**used, **self._used}
            raise

    async def _find(self, mesh_id: str) -> None:
        """Note a mesh that is there, though the shared table was not told."""
        if self._shared is not None and mesh_id not in self._entries:
            record = await self._home.record(mesh_id)
            if record is not None:
                self._entries[mesh_id] = record

    @property
    def ids(self) -> Collection[str]:
        """Ids of all meshes."""
        return self._entries.keys()

    @property
    def total(self) -> int:
        """Bytes of all meshes."""
        return sum(entry.size for entry in self._entries.values())

    async def add(self, written: WrittenMesh) -> CatalogChange | None:
        """Move a mesh from its scratch folder into the store; if it is there, mark it as used.

        The files of one that is there and damaged are replaced. None means that the mesh was in
        the store when it was to be written, and has been removed since: write it again.

        Raises
        ------
        ProblemError
            There is no room.
        """
        mesh_id = written.mesh_id
        if written.folder is None:
            async with self._table():  # it may be on its way out
                await self._find(mesh_id)
                return self._use_again(mesh_id)
        try:
            async with self._table():
                change = await self._add(written)
        except ProblemError:  # after any other error, the mesh may be there
            await self._home.discard(written)
            raise
        if not (change.is_new or change.is_healed):
            await self._home.discard(written)
        return change

    async def _add(self, written: WrittenMesh) -> CatalogChange:
        mesh_id = written.mesh_id
        await self._find(mesh_id)
        if await self._home.is_intact(mesh_id):  # another upload was faster
            change = self._use_again(mesh_id)
            if change is not None:
                return change
        is_new = mesh_id not in self._entries
        entry = MeshRecord(written.size)
        evicted = self._choose_evicted(mesh_id, entry.size)
        for old in evicted:
            await self._remove(old)
        self._entries[mesh_id] = entry
        try:
            await self._home.put(written)
        except OSError:
            if is_new:
                await self._remove(mesh_id)  # a power cut might lose it: fail now
            raise
        self.use(mesh_id)
        self.evictions += len(evicted)
        return CatalogChange(is_new, is_healed=not is_new, evicted=evicted)

    def _use_again(self, mesh_id: str) -> CatalogChange | None:
        """Mark a mesh that was in the store as used; None if it has been removed since."""
        self.use(mesh_id)
        return CatalogChange(is_new=False) if mesh_id in self._entries else None

    async def delete(self, mesh_id: str) -> None:
        """Remove a mesh at once; processes that have it open can go on reading it."""
        async with self._table():
            await self._find(mesh_id)
            if mesh_id not in self._entries:
                raise mesh_not_found(mesh_id)
            await self._remove(mesh_id)

    def use(self, mesh_id: str) -> None:
        """Mark a mesh as the most recently used, if it is there."""
        if mesh_id in self._entries:
            self._entries.move_to_end(mesh_id)
            self._home.note_use(mesh_id)
            if self._shared is not None:
                self._used.pop(mesh_id, None)
                self._used[mesh_id] = None

    @contextmanager
    def pinned(self, mesh_id: str) -> Iterator[None]:
        """Protect a mesh from eviction inside the block; it can still be deleted."""
        self.use(mesh_id)
        self._pins[mesh_id] += 1
        try:
            yield
        finally:
            self._pins[mesh_id] -= 1
            if not self._pins[mesh_id]:
                del self._pins[mesh_id]

    def _choose_evicted(self, mesh_id: str, size: int) -> list[str]:
        """Return the meshes to evict for one of ``size`` bytes; raise where that is not enough."""
        free = [
            old
            for old, record in self._entries.items()
            if old not in self._pins and not record.is_pinned and old != mesh_id
        ]
        evicted: list[str] = []
        total = self.total + size
        if mesh_id in self._entries:
            total -= self._entries[mesh_id].size
        if self._evicts and size <= self._capacity:
            while total > self._capacity and len(evicted) < len(free):
                evicted.append(free[len(evicted)])
                total -= self._entries[evicted[-1]].size
        if total > self._capacity:
            hint = "delete meshes that you no longer need"
            raise over_limit(
                "storage_full", "bytes of meshes", total, self._capacity, "store_bytes", hint=hint
            )
        return evicted

    async def _remove(self, mesh_id: str) -> None:
        await self._home.remove(mesh_id)
        del self._entries[mesh_id]
