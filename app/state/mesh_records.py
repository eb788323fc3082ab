"""The catalogue of meshes in a database: what each takes, whose it is, and when it was used."""

from collections.abc import AsyncIterator, Collection, Iterable
from contextlib import asynccontextmanager

from app.state.database import Database, Statements
from app.store.mesh_catalog import MeshTable
from app.store.mesh_home import MeshRecord

PINNED_S = 10.0
"""Seconds for which a mesh stays pinned, unless it is pinned again"""


class MeshRecords:
    """The records of meshes, for the catalogues of several replicas; see ``MeshTables``."""

    def __init__(self, database: Database) -> None:
        self._database = database

    @asynccontextmanager
    async def alone(self) -> AsyncIterator[MeshTable]:
        """Yield the table for the block, which no other catalogue changes meanwhile."""
        async with self._database.alone("meshes") as statements:
            yield _Table(statements, self._database.clock)

    async def note_uses(self, used: Iterable[str], pinned: Collection[str]) -> None:
        """Note that meshes were used, the last one last, and that some are in use."""
        clock = self._database.clock
        for mesh_id in used:
            await self._database.run(f"UPDATE meshes SET used = {clock} WHERE id = ?", mesh_id)  # noqa: S608 - no value
        for mesh_id in pinned:
            await self._database.run(
                f"UPDATE meshes SET pinned = {clock} + {PINNED_S} WHERE id = ?",  # noqa: S608 - no value
                mesh_id,
            )


class _Table:
    def __init__(self, statements: Statements, clock: str) -> None:
        self._statements = statements
        self._clock = clock

    async def all(self) -> dict[str, MeshRecord]:
        is_pinned = f"CASE WHEN pinned > {self._clock} THEN 1 ELSE 0 END"
        rows = await self._statements.rows(
            f"SELECT id, size, owner, {is_pinned} FROM meshes ORDER BY used, id"  # noqa: S608 - no value
        )
        return {
            mesh_id: MeshRecord(int(size), owner, is_pinned=bool(is_pinned))
            for mesh_id, size, owner, is_pinned in rows
        }

    async def add(self, mesh_id: str, record: MeshRecord) -> None:
        await self._statements.run(
            f"INSERT INTO meshes VALUES (?, ?, ?, {self._clock}, 0) ON CONFLICT DO NOTHING",  # noqa: S608 - no value
            mesh_id,
            record.size,
            record.owner,
        )

    async def remove(self, mesh_id: str) -> None:
        await self._statements.run("DELETE FROM meshes WHERE id = ?", mesh_id)
