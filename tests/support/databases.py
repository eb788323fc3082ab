"""Databases of both kinds, each empty."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from app.state import Database


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.service)])
def state_url(request: pytest.FixtureRequest) -> str | None:
    """The URL of a new database of PostgreSQL; None for SQLite."""
    if request.param == "sqlite":
        return None
    url: str = request.getfixturevalue("postgres").new_database()
    return url


@pytest.fixture
async def database(
    state_url: str | None, tmp_path: Path, anyio_backend: str
) -> AsyncIterator[Database]:
    """A database that is prepared."""
    assert anyio_backend == "asyncio"
    database = Database(tmp_path / "jobs.sqlite3", state_url)
    database.prepare()
    yield database
    await database.aclose()
