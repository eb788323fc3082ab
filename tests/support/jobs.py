"""Jobs for tests."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRecords, JobRepository
from app.state import Database

SPEC = JobSpec(
    owner=None,
    kind="distances",
    mesh_id="0" * 32,
    media_type="application/json",
    fingerprint="",
    idempotency_key=None,
    request_id="",
)


def new_job(owner: str | None = None) -> Job:
    return Job(spec=SPEC.model_copy(update={"owner": owner}))


class SlowSubmissions(JobRepository):
    """Says that the record of a new job is written only when it may."""

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self.written, self.may_say = asyncio.Event(), asyncio.Event()

    @asynccontextmanager
    async def alone(self, owner: str | None) -> AsyncIterator[JobRecords]:
        async with super().alone(owner) as records:
            yield records
            self.written.set()
            await self.may_say.wait()
