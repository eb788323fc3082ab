"""PostgreSQL, by psycopg: a database that several services share."""

from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from functools import lru_cache
from typing import Any

import psycopg
from psycopg import AsyncConnection, Connection
from psycopg_pool import AsyncConnectionPool

from app.errors import StateUnavailableError
from app.settings import variable_of
from app.state.database import StateError, Statements
from app.state.migrations import upgrade

_WAIT_S = 3.0
"""Seconds that a request waits for a connection"""
_STATEMENT_S = 5
"""Seconds that a statement may take, waiting for others included"""
_CONNECTIONS = 8
"""Most connections of a service"""
_NAME = """
    SELECT system_identifier || '/' || oid FROM pg_control_system(), pg_database
    WHERE datname = current_database()
"""
"""Names the database, by whatever address it is reached"""
_OPTIONS: dict[str, Any] = {
    "autocommit": True,
    "connect_timeout": 3,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 5000,  # ms; a server that is cut off is noticed within it
}


class PostgresDatabase:
    """The database at a URL; see ``Database``."""

    is_shared = True
    clock = "CAST(EXTRACT(EPOCH FROM clock_timestamp()) AS DOUBLE PRECISION)"

    def __init__(self, url: str) -> None:
        self._url = url
        self.service: str | None = None
        self._pool: AsyncConnectionPool[AsyncConnection[Any]] | None = None

    def prepare(self) -> None:
        """Bring the tables up to date; raises ``StateError`` where the server cannot be used."""
        with _connected(self._url) as connection:
            upgrade(connection)
            self.service = _name_of(connection)

    async def open(self) -> None:
        """Open a pool of connections."""
        self._pool = AsyncConnectionPool(
            self._url,
            kwargs=_OPTIONS,
            min_size=1,
            max_size=_CONNECTIONS,
            open=False,
            configure=_configure,
            check=AsyncConnectionPool.check_connection,  # it may be of before a restart
            timeout=_WAIT_S,
            reconnect_timeout=1.0,  # later waits grow; the next request tries again anyway
        )
        with _as_os_errors():
            await self._pool.open(wait=True, timeout=_WAIT_S)

    async def close(self) -> None:
        """Close the connections."""
        if self._pool is not None:
            await self._pool.close()
            self._pool = None

    async def rows(self, statement: str, *values: Any) -> Sequence[Any]:
        """Return the rows that a statement yields."""
        async with self._session() as session:
            return await session.rows(statement, *values)

    async def run(self, statement: str, *values: Any) -> int:
        """Run a statement; return the number of rows that it changed."""
        async with self._session() as session:
            return await session.run(statement, *values)

    run_on_reserve = run

    @asynccontextmanager
    async def alone(self, name: str) -> AsyncIterator[Statements]:
        """Run the statements of the block as one transaction, one of this name at a time."""
        async with self._session() as session, session.connection.transaction():
            await session.rows("SELECT pg_advisory_xact_lock(hashtextextended(?, 0))", name)
            yield session

    @asynccontextmanager
    async def _session(self) -> AsyncIterator["_Session"]:
        assert self._pool is not None, "the database is open while the service runs"  # noqa: S101
        with _as_os_errors():
            async with self._pool.connection() as connection:
                yield _Session(connection)


class _Session:
    """Statements on one connection."""

    def __init__(self, connection: AsyncConnection[Any]) -> None:
        self.connection = connection

    async def rows(self, statement: str, *values: Any) -> Sequence[Any]:
        cursor = await self.connection.execute(_translated(statement), values)
        return await cursor.fetchall()

    async def run(self, statement: str, *values: Any) -> int:
        cursor = await self.connection.execute(_translated(statement), values)
        return cursor.rowcount

    run_on_reserve = run


def read(url: str, statement: str) -> tuple[str, list[Any]]:
    """Return what names the services of a database, and the rows that a statement yields.

    Raises ``StateError`` where the server cannot be used, or no service has prepared the database.
    """
    with _connected(url) as connection:
        return _name_of(connection), connection.execute(statement.encode()).fetchall()


@contextmanager
def _connected(url: str) -> Iterator[Connection[Any]]:
    """Connect for the block; raise ``StateError`` where the server cannot be used."""
    setting = variable_of("state")
    try:
        with psycopg.connect(url, **_OPTIONS) as connection:
            yield connection
    except psycopg.ProgrammingError as error:
        if error.sqlstate is None:  # the message could show a part of the secret
            example = "postgresql://user:secret@host:5432/database"
            raise StateError(f"{setting} is not a URL such as {example}") from None
        raise StateError(
            f"the database of {setting} refuses the request: {_line(error)}"
        ) from error
    except psycopg.Error as error:
        raise StateError(f"the database of {setting} cannot be used: {_line(error)}") from error


def _name_of(connection: Connection[Any]) -> str:
    ((name,),) = connection.execute(_NAME).fetchall()
    return str(name)


async def _configure(connection: AsyncConnection[Any]) -> None:
    await connection.execute(f"SET statement_timeout = '{_STATEMENT_S}s'")


@lru_cache(maxsize=256)
def _translated(statement: str) -> bytes:
    return statement.replace("?", "%s").encode()


@contextmanager
def _as_os_errors() -> Iterator[None]:
    """Raise the errors of a server that is away, or that can only be read, as one of the system."""
    try:
        yield
    except (
        psycopg.OperationalError,
        psycopg.InterfaceError,
        psycopg.errors.ReadOnlySqlTransaction,
    ) as error:
        raise StateUnavailableError(_line(error)) from error


def _line(error: psycopg.Error) -> str:
    return " ".join(str(error).split())
