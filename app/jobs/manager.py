"""What becomes of jobs: accepted, run, finished, dismissed, and forgotten after a while."""

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta

from app.engine.interface import ProgressCallback
from app.errors import Fault, Problem, problem, problem_of
from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRepository
from app.settings import variable_of
from app.store.results import Result, ResultStore

logger = logging.getLogger(__name__)

Solve = Callable[[ProgressCallback], Awaitable[Result]]
"""Does what a job is for, telling which share is done"""

_SWEEP_S = 60.0
"""How often jobs are looked for that are kept long enough"""

_STOPPED = Problem(
    "engine_unavailable",
    "the service stopped while the job was under way",
    hint="send the query again",
)
_NO_ROOM = Problem(
    "storage_full",
    "the answers that jobs hold leave no room for this one",
    setting=variable_of("results_bytes"),
    hint="delete jobs whose answers you have",
)


class _Live:
    """A job of which something is still to become."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.changed = asyncio.Event()
        self.task: asyncio.Task[None] | None = None

    def become(self, job: Job) -> None:
        """Change the state, and wake who watches."""
        self.job = job
        self.wake()

    def wake(self) -> None:
        """Let those who watch look at the state, changed or not."""
        changed, self.changed = self.changed, asyncio.Event()
        changed.set()

    def tell(self, share: float) -> None:
        """Note which share is done, once work has begun."""
        share = round(share, 4)
        if not self.job.is_finished and (share > self.job.progress or self.job.started is None):
            self.become(self.job.running(share))


class Jobs:
    """The jobs of a service. Each holds its answer in ``results`` until it is forgotten."""

    def __init__(self, book: JobRepository, results: ResultStore, ttl_s: float) -> None:
        self._book = book
        self._results = results
        self._ttl = timedelta(seconds=ttl_s)
        self._live: dict[str, _Live] = {}
        self._submitting = asyncio.Lock()
        self._is_stopping = False

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Keep the book open, and forget what is old, while inside."""
        await self._book.open()
        for job in await self._book.unfinished():
            await self._book.write(job.failed(_STOPPED))
        for job in await self._book.with_results():
            assert job.result is not None, "successful jobs have one"  # noqa: S101
            self._results.hold(job.result)
        sweeping = asyncio.create_task(self._sweep())
        try:
            yield
        finally:
            sweeping.cancel()
            self.end_events()
            for live in list(self._live.values()):
                await self._end(live, live.job.failed(_STOPPED))
            await self._book.close()

    def end_events(self) -> None:
        """End all that is being watched, since the service is about to stop."""
        self._is_stopping = True
        for live in self._live.values():
            live.wake()

    async def submit(self, errand: JobSpec, solve: Solve) -> Job:
        """Accept a job, or return the one that the errand's idempotency key already stands for.

        The key of a job that failed or was dismissed stands for nothing: it can be sent again.

        Raises
        ------
        ProblemError
            The key stands for another question.
        """
        async with self._submitting:  # two with one key at the same time are one job, too
            known = await self._known(errand)
            if known is not None:
                return known
            live = _Live(Job(errand=errand))
            await self._book.write(live.job)
            self._live[live.job.id] = live
            live.task = asyncio.create_task(self._run(live, solve), name=f"job {live.job.id}")
            return live.job

    async def find(self, owner: str | None, job_id: str) -> Job:
        """Return a job as it is now; raises ``ProblemError`` where the owner has none such."""
        live = self._live.get(job_id)
        if live is not None and live.job.errand.owner == owner:
            return live.job
        job = await self._book.find(owner, job_id)
        if job is None:
            raise problem("job_not_found", f"there is no job {job_id!r}")
        return job

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, the newest first, and where to go on, if anywhere."""
        jobs, after = await self._book.page(owner, limit, before)
        return [self._live[job.id].job if job.id in self._live else job for job in jobs], after

    async def count(self) -> Counter[str]:
        """Return how many jobs there are, of all owners, by status."""
        finished = Counter(await self._book.count_finished())
        jobs = [live.job for live in self._live.values()]
        return finished + Counter(job.status for job in jobs if not job.is_finished)

    async def dismiss(self, owner: str | None, job_id: str) -> Job:
        """Stop a job, or forget it where it has finished; return it as it was left."""
        job = await self.find(owner, job_id)
        live = self._live.get(job_id)
        if live is not None and not live.job.is_finished:
            await self._end(live, live.job.dismissed())
            return live.job
        await self._forget(job)
        return job

    async def result(self, owner: str | None, job_id: str) -> tuple[Job, Result]:
        """Take the answer of a job.

        Raises
        ------
        ProblemError
            There is no such job; it has not finished; it was dismissed; or its own problem, where
            it failed.
        """
        job = await self.find(owner, job_id)
        if job.problem is not None:
            raise problem(**vars(job.problem))
        if job.status == "dismissed":
            raise problem("job_dismissed", f"job {job_id} was dismissed")
        if job.result is None:
            detail = f"job {job_id} is {job.status}: {job.progress:.0%} done"
            raise problem("job_not_finished", detail, headers={"Retry-After": "1"})
        found = await self._results.find(job.result)
        if found is None:
            hint = "send the query again"
            raise problem("mesh_damaged", f"the answer of job {job_id} is damaged", hint=hint)
        return job, found

    async def watch(self, job: Job, seen: int) -> AsyncIterator[Job]:
        """Yield the states of a job from now on, those up to version ``seen`` left out."""
        live = self._live.get(job.id)
        while True:
            now, changed = (live.job, live.changed) if live else (job, None)
            if now.version > seen:
                seen = now.version
                yield now
            if changed is None or now.is_finished or self._is_stopping:
                return
            await changed.wait()

    async def _known(self, errand: JobSpec) -> Job | None:
        key = errand.idempotency_key
        if key is None:
            return None
        job = await self._book.find_by_key(errand.owner, key)
        if job is None or job.status in ("failed", "dismissed"):
            return None
        if job.errand.fingerprint != errand.fingerprint:
            message = f"{key!r} stands for another question, asked by job {job.id}"
            fault = Fault("/header/Idempotency-Key", message)
            raise problem("invalid_request", message, errors=(fault,))
        return self._live[job.id].job if job.id in self._live else job

    async def _run(self, live: _Live, solve: Solve) -> None:
        try:
            result = await self._results.with_files(await solve(live.tell))
        except Exception as error:
            problem = problem_of(error)
            if problem.code == "internal_error":
                logger.exception("job %s failed", live.job.id)
            await self._end(live, live.job.failed(problem))
            return
        if self._results.has_room_to_hold(result.name):
            self._results.hold(result.name)
            ended = live.job.successful(result.name)
        else:
            ended = live.job.failed(_NO_ROOM)
        self._results.give_back(result)
        await self._end(live, ended)

    async def _end(self, live: _Live, ended: Job) -> None:
        """Let a job have finished, whatever it does."""
        if live.job.is_finished:
            return
        live.become(ended)
        assert live.task is not None, "a job has begun before it can end"  # noqa: S101
        if live.task is not asyncio.current_task():
            live.task.cancel()
        await self._book.write(ended)
        self._live.pop(ended.id, None)

    async def _sweep(self) -> None:
        while True:
            for job in await self._book.finished_before(datetime.now(UTC) - self._ttl):
                await self._forget(job)
            await asyncio.sleep(min(_SWEEP_S, self._ttl.total_seconds()))

    async def _forget(self, job: Job) -> None:
        await self._book.remove(job.id)
        if job.result is not None:
            self._results.release(job.result)
