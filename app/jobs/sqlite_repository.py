"""The repository of jobs in SQLite.

SQLite needs room on the disk for every change, even to remove a record. So some is held in reserve
for changes of jobs that exist: on a full disk they can still end and be removed.
"""

import errno
import os
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import aiosqlite
from anyio import to_thread

from app.jobs.job import Job
from app.store.layout import JOB_RESERVE, StoreError
from app.store.reserve import Reserve

_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    record TEXT NOT NULL,
    id TEXT UNIQUE AS (record ->> '$.id'),
    owner TEXT AS (record ->> '$.errand.owner'),
    idempotency_key TEXT AS (record ->> '$.errand.idempotency_key'),
    status TEXT AS (record ->> '$.status'),
    finished TEXT AS (record ->> '$.finished')
);
CREATE INDEX IF NOT EXISTS jobs_by_owner ON jobs (owner, number);
CREATE INDEX IF NOT EXISTS jobs_by_key ON jobs (owner, idempotency_key)
    WHERE idempotency_key IS NOT NULL;
CREATE INDEX IF NOT EXISTS jobs_by_end ON jobs (finished);
CREATE TABLE IF NOT EXISTS queries (job_id TEXT PRIMARY KEY, query BLOB NOT NULL) WITHOUT ROWID;
"""
_FORGET_UNNEEDED = """
DELETE FROM queries WHERE job_id NOT IN (SELECT id FROM jobs WHERE finished IS NULL)
"""
"""Queries have a table of their own, since they may be large, and records change often. A crash
between changes of both leaves a query too many, and never one too few."""


_RESERVED = 2**20
"""Bytes of the reserve: a change takes some pages of 4 kB, and clearing SQLite's log perhaps 40"""


class SqliteJobRepository:
    """A row for each job, in the database at ``path``; see ``JobRepository``."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._database: aiosqlite.Connection | None = None
        self._reserve = _reserve_of(path)

    async def open(self) -> None:
        """Open the database, which is created if missing."""
        await to_thread.run_sync(_create_on_reserve, self._path)
        with _as_os_errors(self._path.parent):
            self._database = await aiosqlite.connect(self._path, isolation_level=None)
            await self._database.execute("PRAGMA synchronous = NORMAL")
        await to_thread.run_sync(self._reserve.restore)
        await self._run_on_reserve(_FORGET_UNNEEDED)

    async def close(self) -> None:
        """Close the database."""
        if self._database is not None:
            await self._database.close()
            self._database = None

    async def add(self, job: Job, query: bytes) -> None:
        """Insert the record of a new job, and its query as JSON."""
        await self._run("INSERT INTO queries VALUES (?, ?)", job.id, query)
        try:
            await self._run("INSERT INTO jobs (record) VALUES (?)", job.model_dump_json())
        except OSError:
            await self._forget_query(job.id)
            raise
        await to_thread.run_sync(self._reserve.restore)  # now there is room

    async def update(self, job: Job) -> None:
        """Replace the record of a job; this works on a full disk as well.

        The query of one that has finished is forgotten.
        """
        statement = "UPDATE jobs SET record = ? WHERE id = ?"
        await self._run_on_reserve(statement, job.model_dump_json(), job.id)
        if job.is_finished:
            await self._forget_query(job.id)

    async def remove(self, job_id: str) -> None:
        """Remove the record of a job; this works on a full disk as well."""
        await self._run_on_reserve("DELETE FROM jobs WHERE id = ?", job_id)

    async def query(self, job_id: str) -> bytes | None:
        """Return the query of a job that has not finished; None where it was not stored."""
        rows = await self._rows("SELECT query FROM queries WHERE job_id = ?", job_id)
        return rows[0][0] if rows else None

    async def find(self, owner: str | None, job_id: str) -> Job | None:
        """Return the job of an owner with this id; None where there is none."""
        jobs = await self._jobs("WHERE owner IS ? AND id = ?", owner, job_id)
        return jobs[0] if jobs else None

    async def find_by_key(self, owner: str | None, key: str) -> Job | None:
        """Return the newest job of an owner with this idempotency key; None where there is none."""
        jobs = await self._jobs(
            "WHERE owner IS ? AND idempotency_key = ? ORDER BY number DESC LIMIT 1", owner, key
        )
        return jobs[0] if jobs else None

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, and the number to go on before; None at the end."""
        rows = await self._rows(
            "SELECT number, record FROM jobs WHERE owner IS ? AND number < ? "
            "ORDER BY number DESC LIMIT ?",
            owner,
            2**62 if before is None else before,
            limit + 1,
        )
        jobs = [Job.model_validate_json(record) for _, record in rows[:limit]]
        return jobs, rows[limit - 1][0] if len(rows) > limit else None

    async def count(self, owner: str | None) -> int:
        """Return the number of an owner's jobs."""
        ((count,),) = await self._rows("SELECT COUNT(*) FROM jobs WHERE owner IS ?", owner)
        return int(count)

    async def count_finished(self) -> dict[str, int]:
        """Return the number of finished jobs by status."""
        statement = "SELECT status, COUNT(*) FROM jobs WHERE finished IS NOT NULL GROUP BY status"
        return dict(await self._rows(statement))

    async def unfinished(self) -> list[Job]:
        """Return the jobs that have not finished, the oldest first."""
        return await self._jobs("WHERE finished IS NULL ORDER BY number")

    async def finished(self) -> list[Job]:
        """Return the jobs that have finished."""
        return await self._jobs("WHERE finished IS NOT NULL")

    async def _forget_query(self, job_id: str) -> None:
        await self._run_on_reserve("DELETE FROM queries WHERE job_id = ?", job_id)

    async def _jobs(self, condition: str, *values: Any) -> list[Job]:
        rows = await self._rows(f"SELECT record FROM jobs {condition}", *values)  # noqa: S608
        return [Job.model_validate_json(record) for (record,) in rows]

    async def _rows(self, statement: str, *values: Any) -> Sequence[Any]:
        with _as_os_errors(self._path.parent):
            return list(await self._connection.execute_fetchall(statement, values))

    async def _run(self, statement: str, *values: Any) -> None:
        with _as_os_errors(self._path.parent):
            async with self._connection.execute(statement, values):
                pass

    async def _run_on_reserve(self, statement: str, *values: Any) -> None:
        """Run a statement; where the disk has no room for it, in that of the reserve."""
        try:
            await self._run(statement, *values)
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            await to_thread.run_sync(self._reserve.give_up)
            await self._run(statement, *values)
            with suppress(OSError):  # the change is made, and the log only longer
                await self._run("PRAGMA wal_checkpoint(TRUNCATE)")
            await to_thread.run_sync(self._reserve.restore)

    @property
    def _connection(self) -> aiosqlite.Connection:
        assert self._database is not None, "the database is open while the service runs"  # noqa: S101
        return self._database


def prepare_database(path: Path) -> None:
    """Create the database at ``path``, or the tables that it lacks, and verify it.

    Raises
    ------
    StoreError
        It is damaged, or cannot be written.
    """
    try:
        _create_on_reserve(path)
    except OSError as error:
        require_intact(path)
        raise StoreError(f"{path} cannot be written: {error.strerror}") from error
    require_intact(path)


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
        database.executescript(_SCHEMA)


def _reserve_of(path: Path) -> Reserve:
    return Reserve(path.with_name(JOB_RESERVE), _RESERVED)


_ERRORS = {sqlite3.SQLITE_FULL: errno.ENOSPC, sqlite3.SQLITE_READONLY: errno.EROFS}
"""System errors by the primary codes of SQLite"""
_ERRORS_OF_THE_DISK = frozenset({sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN})
"""Codes that many system errors have in common, such as those of read-only disks and of quotas"""


@contextmanager
def _as_os_errors(folder: Path) -> Iterator[None]:
    """Raise the errors of SQLite as ``JobRepository`` promises them, for a database in a folder."""
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


def read_jobs(path: Path) -> list[Job]:
    """Return the jobs in the database at ``path``, the oldest first; none where it is missing."""
    rows = _read(path, "SELECT record FROM jobs ORDER BY number")
    return [Job.model_validate_json(record) for (record,) in rows]


def require_intact(path: Path) -> None:
    """Raise ``StoreError`` where the database at ``path`` is damaged."""
    rows = _read(path, "PRAGMA quick_check(1)")
    if rows not in ([], [("ok",)]):
        raise _damaged(path, rows[0][0])


def _read(path: Path, statement: str) -> list[Any]:
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
    return StoreError(f"{path} is damaged ({line}): move it away, and jobs begin anew")
