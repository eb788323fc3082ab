"""The records of jobs, in a database: they outlive the process that wrote them."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Executable, Row, delete, func, insert, select, update

from app.jobs.job import EndedJob, Job
from app.state import Database
from app.state.schema import jobs, queries

_IS_UNFINISHED = jobs.c.finished.is_(None)
_KEY_IS_FREE = jobs.c.status.in_(("failed", "dismissed"))


class JobRepository:
    """The records of jobs in a database. Errors are those of `Database.transaction`."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def add(self, job: Job, query: bytes) -> Job:
        """Insert a new job with its query as JSON; return it, or the job that has its key.

        The key of a job that failed or was dismissed is free again.
        """
        key = job.spec.idempotency_key
        has_key = jobs.c.idempotency_key == key, ~_KEY_IS_FREE
        async with self._database.transaction("new jobs") as connection:
            if key is not None:
                known = await connection.scalar(select(jobs.c.record).where(*has_key))
                if known is not None:
                    return Job.model_validate(known)
            await connection.execute(insert(jobs).values(record=_record_of(job)))
            await connection.execute(insert(queries).values(job_id=job.id, query=query))
        return job

    async def update(self, job: Job, version: int) -> bool:
        """Replace the record of a job that has not finished, and that still has a ``version``.

        The query goes with the end of its job. False means that another process was faster.
        """
        is_same = jobs.c.record["version"].as_integer() == version
        change = update(jobs).where(jobs.c.id == job.id, _IS_UNFINISHED, is_same)
        async with self._database.transaction() as connection:
            changed = await connection.execute(change.values(record=_record_of(job)))
            if changed.rowcount and job.is_finished:
                await connection.execute(delete(queries).where(queries.c.job_id == job.id))
        return bool(changed.rowcount)

    async def remove(self, job_id: str) -> None:
        """Remove the record of a job that has finished."""
        async with self._database.transaction() as connection:
            await connection.execute(delete(jobs).where(jobs.c.id == job_id))

    async def find(self, job_id: str) -> Job | None:
        """Return the job with this id; None where there is none."""
        rows = await self._rows(select(jobs.c.record).where(jobs.c.id == job_id))
        return Job.model_validate(rows[0].record) if rows else None

    async def page(self, limit: int, before: int | None) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs, the newest first, and the number to go on before, if any."""
        statement = select(jobs.c.number, jobs.c.record)
        if before is not None:
            statement = statement.where(jobs.c.number < before)
        rows = await self._rows(statement.order_by(jobs.c.number.desc()).limit(limit + 1))
        found = [Job.model_validate(row.record) for row in rows[:limit]]
        return found, rows[limit - 1].number if len(rows) > limit else None

    async def count_by_status(self) -> dict[str, int]:
        """Return the number of jobs by status."""
        rows = await self._rows(
            select(jobs.c.status, func.count().label("number")).group_by(jobs.c.status)
        )
        return {row.status: row.number for row in rows}

    async def unfinished(self) -> list[str]:
        """Return the ids of the jobs that have not finished, the oldest first."""
        statement = select(jobs.c.id).where(_IS_UNFINISHED).order_by(jobs.c.number)
        return [row.id for row in await self._rows(statement)]

    async def ended(self) -> list[EndedJob]:
        """Return the jobs that have finished."""
        client = jobs.c.record["errand", "client"].as_string()
        result = jobs.c.record["result"].as_string()
        statement = select(jobs.c.id, client, result, jobs.c.finished)
        rows: Sequence[Any] = await self._rows(statement.where(~_IS_UNFINISHED))
        return [
            EndedJob(job_id, client, result, datetime.fromisoformat(finished))
            for job_id, client, result, finished in rows
        ]

    async def load_with_query(self, job_id: str) -> tuple[Job, bytes | None] | None:
        """Return a job, and its query unless it has finished; None where there is none."""
        both = jobs.outerjoin(queries, queries.c.job_id == jobs.c.id)
        statement = select(jobs.c.record, queries.c.query).select_from(both)
        rows = await self._rows(statement.where(jobs.c.id == job_id))
        return (Job.model_validate(rows[0].record), rows[0].query) if rows else None

    async def _rows(self, statement: Executable) -> Sequence[Row[Any]]:
        async with self._database.transaction() as connection:
            return (await connection.execute(statement)).all()


def read_jobs(database: Database) -> list[Job]:
    """Return the jobs of a database that a service may use, the oldest first.

    Raises ``StateError`` where it cannot be used.
    """
    rows = database.read(select(jobs.c.record).order_by(jobs.c.number))
    return [Job.model_validate(row.record) for row in rows]


def _record_of(job: Job) -> dict[str, Any]:
    return job.model_dump(mode="json")
