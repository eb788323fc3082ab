"""The catalogue of meshes in a database: what each takes, and when it was used."""

from collections.abc import AsyncIterator, Collection, Iterable
from contextlib import asynccontextmanager
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.ext.asyncio import AsyncConnection

from app.state.database import Database
from app.state.schema import CLOCK, meshes
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
        async with self._database.transaction("meshes") as connection:
            yield _Table(connection)

    async def note_uses(self, used: Iterable[str], pinned: Collection[str]) -> None:
        """Note that meshes were used, the last one last, and that some are in use."""
        for mesh_id in used:
            await self._note(mesh_id, used=CLOCK)
        for mesh_id in pinned:
            await self._note(mesh_id, pinned=CLOCK + PINNED_S)

    async def _note(self, mesh_id: str, **values: Any) -> None:
        """Change one row: whoever changes several in one transaction may wait for each other."""
        async with self._database.transaction() as connection:
            await connection.execute(update(meshes).where(meshes.c.id == mesh_id).values(values))


class _Table:
    def __init__(self, connection: AsyncConnection) -> None:
        self._connection = connection

    async def all(self) -> dict[str, MeshRecord]:
        columns = meshes.c.id, meshes.c.size, meshes.c.pinned > CLOCK
        rows = await self._connection.execute(select(*columns).order_by(meshes.c.used, meshes.c.id))
        return {mesh_id: MeshRecord(*record) for mesh_id, *record in rows}

    async def add(self, mesh_id: str, record: MeshRecord) -> None:
        row = {"id": mesh_id, "size": record.size, "used": CLOCK, "pinned": 0}
        await self._connection.execute(insert(meshes).values(row).on_conflict_do_nothing())

    async def remove(self, mesh_id: str) -> None:
        await self._connection.execute(delete(meshes).where(meshes.c.id == mesh_id))
