"""SQLite: a database of one service, in a file of its store.

SQLite needs room on the disk for every change, even to remove a record. So some is held in reserve
for changes of what exists: on a full disk, jobs can still end and be removed.
"""

import asyncio
import errno
import os
import sqlite3
import tempfile
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, closing, contextmanager, suppress
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import aiosqlite
from anyio import to_thread

from app.state.database import Statements
from app.state.schema import REVISIONS, SQLITE, statements
from app.store.layout import JOB_RESERVE, StoreError
from app.store.reserve import Reserve

_RESERVED = 2**20
"""Bytes of the reserve: a change takes some pages of 4 kB, and clearing SQLite's log perhaps 40"""


class SqliteDatabase:
    """The database in the file ``path``; see ``Database``."""

    is_shared = False
    service: str | None = None
    clock = "((JULIANDAY('now') - 2440587.5) * 86400.0)"

    def __init__(self, path: Path) -> None:
        self._path = path
        self._database: aiosqlite.Connection | None = None
        self._reserve = _reserve_of(path)
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        """Each lives as long as a block holds it or waits for it"""

    def prepare(self) -> None:
        """Create the file, or the tables that it lacks, and verify it.

        Raises
        ------
        StoreError
            It is damaged, or cannot be written.
        """
        try:
            _create_on_reserve(self._path)
        except OSError as error:
            require_intact(self._path)
            raise StoreError(f"{self._path} cannot be written: {error.strerror}") from error
        require_intact(self._path)

    async def open(self) -> None:
        """Open the file, which is created if missing."""
        await to_thread.run_sync(_create_on_reserve, self._path)
        with _as_os_errors(self._path.parent):
            self._database = await aiosqlite.connect(self._path, isolation_level=None)
            await self._database.execute("PRAGMA synchronous = NORMAL")
        await to_thread.run_sync(self._reserve.restore)

    async def close(self) -> None:
        """Close the file."""
        if self._database is not None:
            await self._database.close()
            self._database = None

    @asynccontextmanager
    async def alone(self, name: str) -> AsyncIterator[Statements]:
        """Run the statements of the block one block of this name at a time."""
        lock = self._locks.setdefault(name, asyncio.Lock())
        async with lock:
            yield self

    async def rows(self, statement: str, *values: Any) -> Sequence[Any]:
        """Return the rows that a statement yields."""
        with _as_os_errors(self._path.parent):
            return list(await self._connection.execute_fetchall(statement, values))

    async def run(self, statement: str, *values: Any) -> int:
        """Run a statement; return the number of rows that it changed."""
        changed = await self._run(statement, *values)
        if not self._reserve.is_there():  # now there is room
            await to_thread.run_sync(self._reserve.restore)
        return changed

    async def run_on_reserve(self, statement: str, *values: Any) -> int:
        """Run a statement; where the disk has no room for it, in that of the reserve."""
        try:
            return await self._run(statement, *values)
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            await to_thread.run_sync(self._reserve.give_up)
            changed = await self._run(statement, *values)
            with suppress(OSError):  # the change is made, and the log only longer
                await self._run("PRAGMA wal_checkpoint(TRUNCATE)")
            await to_thread.run_sync(self._reserve.restore)
            return changed

    async def _run(self, statement: str, *values: Any) -> int:
        with _as_os_errors(self._path.parent):
            async with self._connection.execute(statement, values) as cursor:
                return cursor.rowcount

    @property
    def _connection(self) -> aiosqlite.Connection:
        assert self._database is not None, "the database is open while the service runs"  # noqa: S101
        return self._database


def _create_on_reserve(path: Path) -> None:
    """Create what is missing of a database; where the disk is full, in the room of the reserve.

    The reserve is not restored: to open the database takes room once more.
    """
    try:
        _create(path)
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        _reserve_of(path).give_up()
        _create(path)


def _create(path: Path) -> None:
    with _as_os_errors(path.parent), closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = WAL")
        for revision in REVISIONS:
            for statement in statements(revision, SQLITE):
                database.execute(statement)


def _reserve_of(path: Path) -> Reserve:
    return Reserve(path.with_name(JOB_RESERVE), _RESERVED)


_ERRORS = {sqlite3.SQLITE_FULL: errno.ENOSPC, sqlite3.SQLITE_READONLY: errno.EROFS}
"""System errors by the primary codes of SQLite"""
_ERRORS_OF_THE_DISK = frozenset({sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN})
"""Codes that many system errors have in common, such as those of read-only disks and of quotas"""


@contextmanager
def _as_os_errors(folder: Path) -> Iterator[None]:
    """Raise the errors of SQLite as ``Statements`` promises them, for a database in a folder."""
    try:
        yield
    except sqlite3.Error as error:
        primary = _primary_code(error)
        is_of_disk = primary in _ERRORS_OF_THE_DISK
        number = _error_of_disk(folder) if is_of_disk else _ERRORS.get(primary, errno.EIO)
        raise OSError(number, str(error)) from error


def _primary_code(error: sqlite3.Error) -> int:
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF


_TRIED = 2**16
"""Bytes to write to a disk to see its error: more than SQLite needs at once, which is 32 kB"""


def _error_of_disk(folder: Path) -> int:
    """Return the number of the error that a write to the disk has now; EIO where it has none."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_TRIED))
            file.flush()
    except OSError as error:
        return error.errno or errno.EIO
    return errno.EIO


def require_intact(path: Path) -> None:
    """Raise ``StoreError`` where the database at ``path`` is damaged."""
    rows = read_database(path, "PRAGMA quick_check(1)")
    if rows not in ([], [("ok",)]):
        raise _damaged(path, rows[0][0])


def read_database(path: Path, statement: str) -> list[Any]:
    """Return the rows that a statement yields in the file ``path``; none where it is missing.

    Raises
    ------
    StoreError
        It is damaged, or cannot be read.
    """
    if not path.is_file():
        return []
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            return database.execute(statement).fetchall()
    except sqlite3.DatabaseError as error:
        if _primary_code(error) in _ERRORS_OF_THE_DISK:
            reason = os.strerror(_error_of_disk(path.parent))
            raise StoreError(f"{path} cannot be read: {reason}") from error
        raise _damaged(path, error) from error


def _damaged(path: Path, reason: object) -> StoreError:
    line = " ".join(str(reason).split())
    return StoreError(
        f"{path} is damaged ({line}): move it away to start with an empty list of jobs"
    )
