"""The records of jobs, in a database: they outlive the process that wrote them."""

from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from app.jobs.job import EndedJob, Job
from app.state import Database, Statements, read_database, read_shared_database

_RECORD = "CAST(record AS TEXT)"


class JobRecords:
    """The records of jobs; pages begin with the newest. Errors are those of ``Statements``.

    ``update`` and ``remove`` work on a full disk as well.
    """

    def __init__(self, statements: Statements) -> None:
        self._statements = statements

    async def add(self, job: Job, query: bytes) -> None:
        """Insert the record of a new job, and its query as JSON.

        A crash between both leaves a query too many, and never one too few.
        """
        await self._statements.run("INSERT INTO queries VALUES (?, ?)", job.id, query)
        try:
            await self._statements.run(
                "INSERT INTO jobs (record) VALUES (?)", job.model_dump_json()
            )
        except OSError:
            await self._forget_query(job.id)
            raise

    async def update(self, job: Job, version: int) -> bool:
        """Replace the record of a job that has not finished, and that still has a ``version``.

        Its query is removed once its end is recorded. False means that another process was faster.
        """
        changed = await self._statements.run_on_reserve(
            "UPDATE jobs SET record = ? WHERE id = ? AND finished IS NULL "
            "AND CAST(record ->> 'version' AS TEXT) = ?",
            job.model_dump_json(),
            job.id,
            str(version),
        )
        if job.is_finished:
            await self._forget_query(job.id)
        return changed == 1

    async def remove(self, job_id: str) -> None:
        """Remove the record of a job."""
        await self._statements.run_on_reserve("DELETE FROM jobs WHERE id = ?", job_id)

    async def query(self, job_id: str) -> bytes | None:
        """Return the query of a job that has not finished; None where it was not stored."""
        rows = await self._statements.rows("SELECT query FROM queries WHERE job_id = ?", job_id)
        return rows[0][0] if rows else None

    async def find(self, owner: str | None, job_id: str) -> Job | None:
        """Return the job of an owner with this id; None where there is none."""
        jobs = await self._jobs("WHERE COALESCE(owner, '') = ? AND id = ?", owner or "", job_id)
        return jobs[0] if jobs else None

    async def find_by_key(self, owner: str | None, key: str) -> Job | None:
        """Return the newest job of an owner with this idempotency key; None where there is none."""
        jobs = await self._jobs(
            "WHERE COALESCE(owner, '') = ? AND idempotency_key = ? ORDER BY number DESC LIMIT 1",
            owner or "",
            key,
        )
        return jobs[0] if jobs else None

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, and the number to go on before; None at the end."""
        rows = await self._statements.rows(
            f"SELECT number, {_RECORD} FROM jobs WHERE COALESCE(owner, '') = ? AND number < ? "  # noqa: S608 - no value
            "ORDER BY number DESC LIMIT ?",
            owner or "",
            2**62 if before is None else before,
            limit + 1,
        )
        jobs = [Job.model_validate_json(record) for _, record in rows[:limit]]
        return jobs, rows[limit - 1][0] if len(rows) > limit else None

    async def count(self, owner: str | None) -> int:
        """Return the number of an owner's jobs."""
        statement = "SELECT COUNT(*) FROM jobs WHERE COALESCE(owner, '') = ?"
        ((count,),) = await self._statements.rows(statement, owner or "")
        return int(count)

    async def count_by_status(self) -> dict[str, int]:
        """Return the number of jobs of all owners by status."""
        return dict(
            await self._statements.rows("SELECT status, COUNT(*) FROM jobs GROUP BY status")
        )

    async def unfinished(self) -> list[str]:
        """Return the ids of the jobs that have not finished, the oldest first."""
        rows = await self._statements.rows(
            "SELECT id FROM jobs WHERE finished IS NULL ORDER BY number"
        )
        return [job_id for (job_id,) in rows]

    async def load(self, job_id: str) -> Job | None:
        """Return a job, whoever owns it; None where there is none."""
        jobs = await self._jobs("WHERE id = ?", job_id)
        return jobs[0] if jobs else None

    async def ended(self) -> list[EndedJob]:
        """Return the jobs that have finished."""
        rows = await self._statements.rows(
            "SELECT id, owner, record ->> 'result', finished FROM jobs WHERE finished IS NOT NULL"
        )
        return [
            EndedJob(job_id, owner, result, datetime.fromisoformat(finished))
            for job_id, owner, result, finished in rows
        ]

    async def _forget_query(self, job_id: str) -> None:
        """Remove the query of a job, unless the job is unfinished: another replica may run it."""
        await self._statements.run_on_reserve(
            "DELETE FROM queries WHERE job_id = ? "
            "AND job_id NOT IN (SELECT id FROM jobs WHERE finished IS NULL)",
            job_id,
        )

    async def _jobs(self, condition: str, *values: Any) -> list[Job]:
        rows = await self._statements.rows(f"SELECT {_RECORD} FROM jobs {condition}", *values)  # noqa: S608 - no value
        return _jobs_of(rows)


class JobRepository(JobRecords):
    """The records of jobs in a database that is open."""

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._database = database

    async def tidy(self) -> None:
        """Forget the queries that a crash left without a job."""
        await self._database.run_on_reserve(
            "DELETE FROM queries WHERE job_id NOT IN (SELECT id FROM jobs WHERE finished IS NULL)"
        )

    @asynccontextmanager
    async def alone(self, owner: str | None) -> AsyncIterator[JobRecords]:
        """Yield the records for the block, one block of an owner at a time."""
        async with self._database.alone(f"jobs of {owner or ''}") as statements:
            yield JobRecords(statements)


_ALL = f"SELECT {_RECORD} FROM jobs ORDER BY number"  # noqa: S608 - no value


def read_jobs(path: Path) -> list[Job]:
    """Return the jobs in SQLite's file ``path``, the oldest first; none where it is missing."""
    return _jobs_of(read_database(path, _ALL))


def read_shared_jobs(url: str) -> tuple[str, list[Job]]:
    """Return what names the services of a shared database, and their jobs, the oldest first.

    Raises ``StateError`` where the database cannot be used.
    """
    service, rows = read_shared_database(url, _ALL)
    return service, _jobs_of(rows)


def _jobs_of(rows: Iterable[tuple[str]]) -> list[Job]:
    return [Job.model_validate_json(record) for (record,) in rows]
