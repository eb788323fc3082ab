"""Jobs for tests."""

import asyncio

from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRepository
from app.state import Database

SPEC = JobSpec(
    kind="distances",
    mesh_id="0" * 32,
    media_type="application/json",
    fingerprint="",
    idempotency_key=None,
    request_id="",
)


def new_job(client: str = "", key: str | None = None) -> Job:
    return Job(spec=SPEC.model_copy(update={"client": client, "idempotency_key": key}))


class SlowSubmissions(JobRepository):
    """Says that a new job is recorded only when it may."""

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self.written, self.may_say = asyncio.Event(), asyncio.Event()

    async def add(self, job: Job, query: bytes) -> Job:
        added = await super().add(job, query)
        self.written.set()
        await self.may_say.wait()
        return added
