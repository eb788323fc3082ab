"""Jobs as clients see them: their records, and the answers of those that were successful."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Protocol

from app.errors import Fault, problem
from app.jobs.job import EndedJob, Job, JobSpec
from app.jobs.repository import JobRepository
from app.jobs.retention import Retention
from app.store.results import Result, ResultStore

WATCH_S = 1.0
"""Seconds between two looks at a job that is watched, unless this process hears of a change"""


class Runner(Protocol):
    """Runs the jobs that are recorded and have not finished."""

    def start(self, job: Job, query: bytes) -> None:
        """Say that a job was added."""

    def nudge(self) -> None:
        """Say that jobs were dismissed, or may have been added."""

    def forget(self, job_id: str) -> None:
        """Say that a finished job was removed."""


class JobManager:
    """The records of jobs; what is added there, a runner runs.

    Several services may share the records, and the runner. What a client is told is recorded.
    """

    def __init__(
        self, repository: JobRepository, results: ResultStore, retention: Retention
    ) -> None:
        self.runner: Runner
        """To be set before the first job"""
        self._repository = repository
        self._results = results
        self._retention = retention
        self._changed = asyncio.Event()
        self._is_stopping = False

    def notify(self) -> None:
        """Wake those who watch jobs."""
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def end_events(self) -> None:
        """End every `watch`, since the service is about to stop."""
        self._is_stopping = True
        self.notify()

    async def keep_up(self) -> None:
        """Protect the answers of jobs that have finished elsewhere; nudge a runner that is new."""
        await self._retention.keep_up(self._repository.ended)
        self.runner.nudge()

    async def submit(self, spec: JobSpec, query: bytes) -> Job:
        """Accept a job, or return the job that has the idempotency key of ``spec``.

        The key of a job that failed or was dismissed is free again. The ``query`` as JSON is stored
        until the job has finished. If the call is cancelled, the job runs, or was never accepted.

        Raises
        ------
        ProblemError
            The key belongs to another question.
        """
        new = Job(spec=spec)
        job = await self._repository.add(new, query)
        if job.spec.fingerprint != spec.fingerprint:
            message = f"{spec.idempotency_key!r} was used for a different query, by job {job.id}"
            fault = Fault("/header/Idempotency-Key", message)
            raise problem("invalid_request", message, errors=(fault,))
        if job is new:
            self.runner.start(job, query)
        return job

    async def find(self, job_id: str) -> Job:
        """Return the present state of a job; raises ``ProblemError`` where there is none."""
        job = await self._repository.find(job_id)
        if job is None:
            raise problem("job_not_found", f"there is no job {job_id!r}")
        return job

    async def page(self, limit: int, before: int | None) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs, the newest first, and the number to go on before, if any."""
        return await self._repository.page(limit, before)

    async def count(self) -> Counter[str]:
        """Return the number of jobs by status."""
        return Counter(await self._repository.count_by_status())

    async def cancel(self, job_id: str) -> Job:
        """Stop a job, and return its last state; one that has finished stays as it is."""
        while True:
            job = await self.find(job_id)
            if job.is_finished:
                return job
            last = job.dismissed()
            if await self._repository.update(last, job.version):
                self._retention.add(EndedJob.of(last))
                self.notify()
                self.runner.nudge()
                return last

    async def remove(self, job_id: str) -> Job:
        """Remove a job with its answer, and return its last state; one that runs is stopped."""
        last = await self.cancel(job_id)
        await self._repository.remove(job_id)
        self._retention.discard(job_id)
        self.runner.forget(job_id)
        return last

    async def result(self, job_id: str) -> tuple[Job, Result]:
        """Acquire the answer of a job.

        Raises
        ------
        ProblemError
            There is no such job, it has not finished, it was dismissed, or it failed: then its own
            problem is raised.
        """
        job = await self.find(job_id)
        if job.problem is not None:
            raise problem(**vars(job.problem))
        if job.status == "dismissed":
            raise problem("job_dismissed", f"job {job_id} was dismissed")
        if job.result is None:
            detail = f"job {job_id} is {job.status}: {job.progress:.0%} done"
            raise problem("job_not_finished", detail, headers={"Retry-After": "1"})
        await self._results.index(job.result)  # another process may have run the job
        result = await self._results.find(job.result)
        if result is None:
            hint = "send the query again"
            raise problem("mesh_damaged", f"the answer of job {job_id} is damaged", hint=hint)
        return job, result

    async def watch(self, job: Job, seen: int) -> AsyncIterator[Job]:
        """Yield the present and the following states of a job, except versions up to ``seen``."""
        while True:
            changed = self._changed
            if job.version > seen:
                seen = job.version
                yield job
            if job.is_finished or self._is_stopping:
                return
            with suppress(TimeoutError):
                async with asyncio.timeout(WATCH_S):
                    await changed.wait()
            now = await self._repository.find(job.id)
            if now is None:
                return
            job = now
