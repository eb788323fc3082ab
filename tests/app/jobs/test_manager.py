"""The life of jobs: what clients are told, and when."""

import asyncio
from typing import Any, NoReturn, cast

from app.errors import problem
from app.jobs.job import Job
from app.jobs.manager import JobManager
from app.jobs.repository import JobRepository
from app.state import Database
from tests.support.databases import opened
from tests.support.jobs import SPEC

QUERY = b"{}"


class SlowEnds(JobRepository):
    """Records the end of a job only when it may."""

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self.ending, self.may_end = asyncio.Event(), asyncio.Event()

    async def update(self, job: Job, holder: str | None) -> bool:
        if job.is_finished:
            self.ending.set()
            await self.may_end.wait()
        return await super().update(job, holder)


async def fail(*_: object) -> NoReturn:
    raise problem("invalid_mesh", "as it should")


def test_an_end_is_told_once_it_is_recorded(database: Database) -> None:
    """Else another replica, which reads the record, would say that the job still runs."""

    async def main() -> None:
        async with opened(database):
            repository, others = SlowEnds(database), JobRepository(database)
            jobs = JobManager(repository, cast(Any, "not used"), 60.0, None)
            async with jobs.running(fail):
                job = await jobs.submit(SPEC, QUERY, fail)
                await repository.ending.wait()
                asked = [
                    asyncio.create_task(jobs.find(None, job.id)),
                    asyncio.create_task(anext(jobs.watch(job, job.version))),  # type: ignore[arg-type]
                ]
                page = asyncio.create_task(jobs.page(None, 1, None))
                await asyncio.sleep(0.05)
                told = [task.done() for task in (*asked, page)]
                recorded = await others.find(None, job.id)
                repository.may_end.set()
                assert not any(told)
                assert recorded is not None
                assert not recorded.is_finished

                found = [await task for task in asked] + (await page)[0]
                assert [each.status for each in found] == ["failed"] * 3
                assert await others.find(None, job.id) == found[0]

    asyncio.run(main())
