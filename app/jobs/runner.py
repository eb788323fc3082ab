"""The runner of jobs: the table of their records is its queue.

There is one runner, in the service or in a process of the cluster. When it starts, it runs again
what had not finished.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

import structlog
from structlog.contextvars import bound_contextvars

from app.engine.interface import ProgressCallback
from app.errors import Problem, ProblemError, problem_of
from app.jobs.job import EndedJob, Job, JobSpec
from app.jobs.repository import JobRepository
from app.jobs.retention import Retention
from app.repeating import repeat
from app.store.results import Result, ResultStore

logger = structlog.get_logger(module=__name__)

Solve = Callable[[JobSpec, bytes, ProgressCallback], Awaitable[Result]]
"""The computation of a job from its query as JSON; its result has files"""

_LOOK_S = 5.0
"""Seconds between two looks at the table, unless somebody says that it has changed"""
_TIDY_PERIOD_S = 60.0
"""Seconds between two rounds of upkeep, such as the removal of expired jobs"""
_PROGRESS_S = 0.25
"""Seconds between two records of the progress of a job"""
_RETRY_S = 1.0
"""Seconds between two attempts to record a state"""
_MOST_RUNS = 3
"""Runs of a job: the first, and two more where the service ended while it ran. A job may itself be
the reason why the service ends."""

_STOPPED = Problem(
    "engine_unavailable",
    "the service stopped while the job was under way",
    hint="send the query again",
)
_STOPPED_TOO_OFTEN = Problem(
    "engine_unavailable",
    f"the service stopped while the job ran, {_MOST_RUNS} times",
    hint="if the job itself used too much, ask for less at once",
)
_SIGNS_OF_THE_END = frozenset({"engine_unavailable", "worker_died"})
"""Problems of jobs that the end of the service interrupts: a signal may have gone to workers too"""


class JobRunner:
    """Runs all jobs that are recorded; ``on_change`` hears of each new state of one."""

    def __init__(
        self,
        repository: JobRepository,
        results: ResultStore,
        retention: Retention,
        ttl_s: float,
        solve: Solve,
        on_change: Callable[[], None],
    ) -> None:
        self._repository = repository
        self._results = results
        self._retention = retention
        self._tidy_period_s = min(_TIDY_PERIOD_S, ttl_s)
        self._solve = solve
        self._on_change = on_change
        self._live: dict[str, asyncio.Task[None]] = {}
        self._dismissed: set[asyncio.Task[None]] = set()
        """Tasks of jobs that are no longer to be run, until they have ended"""
        self._ending: set[str] = set()
        """Those of them whose end is being recorded"""
        self._nudged = asyncio.Event()
        self._is_stopping = False

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Run jobs, and remove expired ones, inside the block; the repository is open.

        Jobs that are under way at its end are run again inside the next one.
        """
        await self._retention.keep_up(self._repository.ended)
        self.nudge()
        loops = [
            asyncio.create_task(repeat(self._look, 0.0, "jobs not looked for")),
            asyncio.create_task(repeat(self._tidy, self._tidy_period_s, "jobs not tidied")),
        ]
        try:
            yield
        finally:
            self._is_stopping = True
            for task in (*loops, *self._live.values()):
                task.cancel()
            tasks = (*loops, *self._live.values(), *self._dismissed)
            await asyncio.gather(*tasks, return_exceptions=True)

    def start(self, job: Job, query: bytes) -> None:
        """Begin a job at once: the next request is to find it in the queue, see ``Runner``."""
        if job.id not in self._live:
            self._live[job.id] = asyncio.create_task(self._run(job, query))

    def nudge(self) -> None:
        """Have the table looked at, see ``Runner``."""
        self._nudged.set()

    def forget(self, job_id: str) -> None:
        """Forget a job, see ``Runner``."""
        self._retention.discard(job_id)

    async def _look(self) -> None:
        """Begin jobs that were added, and stop those that were dismissed."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._nudged.wait(), _LOOK_S)
        self._nudged.clear()
        before = set(self._live)
        unfinished = await self._repository.unfinished()
        for job_id in before - set(unfinished) - self._ending:
            task = self._live.pop(job_id)
            self._dismissed.add(task)
            task.add_done_callback(self._dismissed.discard)
            task.cancel()
        for job_id in unfinished:
            if job_id not in self._live or self._live[job_id].done():
                taken = await self._take(job_id)  # one after the other: the oldest goes first
                if taken is not None:
                    self._live[job_id] = asyncio.create_task(self._run(*taken))

    async def _tidy(self) -> None:
        await self._retention.keep_up(self._repository.ended)
        for job_id in self._retention.due():
            await self._repository.remove(job_id)
            self._retention.discard(job_id)

    async def _take(self, job_id: str) -> tuple[Job, bytes | None] | None:
        """Return a job that is to be run, in a new state if it was under way, and its query."""
        found = await self._repository.load_with_query(job_id)
        if found is None or found[0].is_finished:
            return None
        job, query = found
        if job.started is None or job.runs >= _MOST_RUNS:
            return job, query
        again = job.accepted_again()
        return (again, query) if await self._record(job, again) else None

    async def _run(self, job: Job, query: bytes | None) -> None:
        """Run a job to its end; leave it where another process has ended it, or runs it."""
        with bound_contextvars(request_id=job.spec.request_id):
            if job.runs >= _MOST_RUNS:
                await self._end(job, job.failed(_STOPPED_TOO_OFTEN))
            elif query is None:  # an older release accepted the job
                await self._end(job, job.failed(_STOPPED))
            else:
                await self._work(job, query)

    async def _work(self, job: Job, query: bytes) -> None:
        changed, share = asyncio.Event(), -1.0

        def note(now: float) -> None:
            nonlocal share
            share = round(now, 4)
            changed.set()

        working = asyncio.ensure_future(self._solve(job.spec, query, note))
        working.add_done_callback(lambda _: changed.set())
        try:
            while True:
                await changed.wait()
                changed.clear()
                if working.done():
                    break
                if job.started is None or share > job.progress:
                    running = job.running(share)
                    if not await self._record(job, running):
                        self._abandon(working)
                        return
                    job = running
                await asyncio.wait({working}, timeout=_PROGRESS_S)
        except BaseException:
            self._abandon(working)
            raise
        await self._finish(job, working)

    def _abandon(self, working: "asyncio.Future[Result]") -> None:
        working.cancel()
        working.add_done_callback(self._release)

    def _release(self, worked: "asyncio.Future[Result]") -> None:
        if not worked.cancelled() and worked.exception() is None:
            self._results.release(worked.result())

    async def _finish(self, job: Job, working: "asyncio.Future[Result]") -> None:
        try:
            result = working.result()
        except Exception as error:
            problem = problem_of(error)
            if problem.code == "draining":  # the engine hears of the end first
                return
            if self._is_stopping and problem.code in _SIGNS_OF_THE_END:
                return
            if problem.code == "internal_error":
                logger.exception("job failed", job_id=job.id)
            await self._end(job, job.failed(problem))
            return
        try:
            self._results.pin_within_quota(result.name, job.spec.client)
        except ProblemError as error:
            self._results.release(result)
            await self._end(job, job.failed(error.problem))
            return
        self._results.release(result)
        try:
            await self._end(job, job.successful(result.name))  # which pins it as well
        finally:
            self._results.unpin(result.name, job.spec.client)

    async def _end(self, job: Job, last: Job) -> None:
        self._ending.add(job.id)
        try:
            if await self._record(job, last):
                self._retention.add(EndedJob.of(last))
            else:
                self._retention.discard(job.id)
        finally:
            self._ending.discard(job.id)

    async def _record(self, before: Job, job: Job) -> bool:
        """Record a state, as soon as that is possible; False where the job is no longer ours."""
        while True:
            try:
                is_ours = await self._repository.update(job, before.version)
                if not is_ours:  # it may have been recorded, although the database could not say so
                    is_ours = await self._repository.find(job.id) == job
            except OSError:
                logger.exception("state of a job not recorded, to be tried again", job_id=job.id)
                await asyncio.sleep(_RETRY_S)
            else:
                self._on_change()
                return is_ours
