"""The database of a service: SQLite in a file of its store, or PostgreSQL that several share."""

import sqlite3
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import (
    URL,
    Connection,
    Executable,
    NullPool,
    Row,
    Select,
    create_engine,
    event,
    func,
    select,
    text,
)
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine, create_async_engine

from app.settings import variable_of
from app.state.errors import StateError, as_os_errors, is_of_disk, line_of
from app.state.migrations import bring_up_to_date

_WAIT_S = 3.0
"""Seconds that a request waits for a connection to PostgreSQL"""
_CONNECTIONS = 8
"""Most connections of a service to PostgreSQL"""
_POSTGRESQL: dict[str, Any] = {
    "connect_timeout": 3,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 5000,  # ms; a server that is cut off is noticed within it
}
_STATEMENT_LIMIT = {"options": "-c statement_timeout=5s"}
"""For statements of requests, waiting for others included"""
_NAME = text(
    "SELECT system_identifier || '/' || oid FROM pg_control_system(), pg_database "
    "WHERE datname = current_database()"
)
"""Names a database of PostgreSQL, by whatever address it is reached"""


class Database:
    """SQLite in the file ``path``; where there is a URL, PostgreSQL instead.

    Raises
    ------
    StateError
        The extra that PostgreSQL needs is not installed, or the URL is none.
    """

    def __init__(self, path: Path, url: str | None = None) -> None:
        self.is_shared = url is not None
        """Whether several services may use it at the same time"""
        self.service: str | None = None
        """What names the services that share it, once it was prepared or read"""
        self._path = path
        self._arguments = {} if url is None else _POSTGRESQL | _arguments_of(url)
        self._engine = self._asynchronous()

    def _asynchronous(self) -> AsyncEngine:
        if self.is_shared:
            return create_async_engine(
                "postgresql+psycopg://",
                connect_args=_STATEMENT_LIMIT | self._arguments,
                pool_size=_CONNECTIONS,
                max_overflow=0,
                pool_timeout=_WAIT_S,
                pool_pre_ping=True,  # the server may have been started again
            )
        # With one connection, transactions come one after the other.
        url = _file_url("sqlite+aiosqlite", self._path, "rwc")
        engine = create_async_engine(
            url,
            connect_args={"factory": _SelfClosing},
            pool_size=1,
            max_overflow=0,
            pool_reset_on_return=None,
        )
        event.listen(engine.sync_engine, "connect", _configure)
        return engine

    def prepare(self) -> None:
        """Bring the tables up to date, and verify that the database can be used.

        Raises
        ------
        StateError
            It is damaged, cannot be used, or is of a newer release.
        """
        with self._connected("rwc") as connection:
            if self.is_shared:
                connection.execute(_alone("schema"))
            else:
                connection.exec_driver_sql("PRAGMA journal_mode = WAL")
                connection.exec_driver_sql("BEGIN IMMEDIATE")  # Python begins too late
            bring_up_to_date(connection)
        if not self.is_shared:
            require_intact(self._path)

    def read(self, statement: Executable) -> Sequence[Row[Any]]:
        """Return the rows of a statement, beside a service that may run; none of a missing file.

        Raises
        ------
        StateError
            The database is damaged, or cannot be used.
        """
        if not self.is_shared and not self._path.is_file():
            return []
        with self._connected("ro") as connection:
            return connection.execute(statement).all()

    @contextmanager
    def _connected(self, mode: str) -> Iterator[Connection]:
        """Run a block in a transaction, and refuse the database where that fails."""
        if self.is_shared:
            engine = create_engine(
                "postgresql+psycopg://", connect_args=self._arguments, poolclass=NullPool
            )
        else:
            engine = create_engine(_file_url("sqlite", self._path, mode), poolclass=NullPool)
        try:
            with engine.begin() as connection:
                yield connection
                if self.is_shared:
                    self.service = connection.scalar(_NAME)
        except DBAPIError as error:
            raise self._refusal(error) from error

    def _refusal(self, error: DBAPIError) -> StateError:
        reason = line_of(error)
        if self.is_shared:
            return StateError(f"the database of {variable_of('state')} cannot be used: {reason}")
        if is_of_disk(error):
            return StateError(f"{self._path} cannot be used: {reason}")
        return _damaged(self._path, reason)

    async def aclose(self) -> None:
        """Close all connections."""
        await self._engine.dispose()

    @asynccontextmanager
    async def transaction(self, lock: str | None = None) -> AsyncIterator[AsyncConnection]:
        """Run a block in a transaction; of those with one ``lock``, one at a time.

        Errors are raised as `as_os_errors` says.
        """
        with as_os_errors():
            async with self._engine.begin() as connection:
                if self.is_shared and lock is not None:
                    await connection.execute(_alone(lock))
                yield connection


class _SelfClosing(sqlite3.Connection):
    """A connection that closes once nothing refers to it.

    If a request is cancelled while its connection opens, aiosqlite drops the connection unclosed.
    """

    def __del__(self) -> None:
        self.close()


def require_intact(path: Path) -> None:
    """Raise ``StateError`` where SQLite's file ``path`` is damaged."""
    rows = Database(path).read(text("PRAGMA quick_check(1)"))
    if rows and rows[0][0] != "ok":
        raise _damaged(path, rows[0][0])


def _damaged(path: Path, reason: str) -> StateError:
    advice = "move it away to start with an empty list of jobs"
    return StateError(f"{path} is damaged ({' '.join(reason.split())}): {advice}")


def _file_url(driver: str, path: Path, mode: str) -> URL:
    return URL.create(
        driver, database=path.absolute().as_uri(), query={"mode": mode, "uri": "true"}
    )


def _configure(connection: Any, _record: object) -> None:
    cursor = connection.cursor()
    cursor.execute("PRAGMA synchronous = NORMAL")
    cursor.close()


def _arguments_of(url: str) -> dict[str, Any]:
    """Return the arguments of a connection that are in the URL of a server."""
    setting = variable_of("state")
    try:
        from psycopg import ProgrammingError, conninfo  # an extra
    except ImportError as error:
        extra = "pip install geodesic[cluster]"
        raise StateError(f"{setting} needs {error.name}: {extra}") from error
    try:
        return conninfo.conninfo_to_dict(url)
    except ProgrammingError:  # its message could show a part of the secret
        example = "postgresql://user:secret@host:5432/database"
        raise StateError(f"{setting} is not a URL such as {example}") from None


def _alone(name: str) -> Select[Any]:
    """Return a statement that waits until no other transaction has a lock of PostgreSQL."""
    return select(func.pg_advisory_xact_lock(func.hashtextextended(name, 0)))
