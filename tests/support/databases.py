"""Databases of both kinds, each empty."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypeVar

import pytest

from app.state import Database, SqliteDatabase

AnyDatabase = TypeVar("AnyDatabase", bound=Database)


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.service)])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Database:
    """A database that is prepared, and not open."""
    if request.param == "sqlite":
        database: Database = SqliteDatabase(tmp_path / "jobs.sqlite3")
    else:
        url = request.getfixturevalue("postgres").new_database()
        from app.state.postgres import PostgresDatabase

        database = PostgresDatabase(url)
    database.prepare()
    return database


@asynccontextmanager
async def opened(database: AnyDatabase) -> AsyncIterator[AnyDatabase]:
    """Open a database inside the block."""
    await database.open()
    try:
        yield database
    finally:
        await database.close()
