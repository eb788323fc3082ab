"""The life of jobs: accepted, run, finished or dismissed, and removed after a while."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

import structlog
from structlog.contextvars import bound_contextvars

from app.engine.interface import ProgressCallback
from app.errors import Fault, Problem, ProblemError, over_limit, problem, problem_of
from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRepository
from app.jobs.retention import FinishedJob, Retention
from app.settings import variable_of
from app.store.results import Result, ResultStore

logger = structlog.get_logger(module=__name__)

Solve = Callable[[ProgressCallback], Awaitable[Result]]
"""The computation of a job, which reports its progress"""

SolveAgain = Callable[[JobSpec, bytes, ProgressCallback], Awaitable[Result]]
"""The same for a stored job, from its query as JSON"""

_TIDY_PERIOD_S = 60.0
"""Seconds between two removals of expired jobs"""

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
    hint="ask for less at once, if it was the job that took too much",
)
_SIGNS_OF_THE_END = frozenset({"draining", "engine_unavailable", "worker_died"})
"""Problems of jobs that the end of the service interrupts: a signal may have gone to workers too"""
_NO_ROOM = Problem(
    "storage_full",
    "the answers that jobs hold leave no room for this one",
    setting=variable_of("results_bytes"),
    hint="delete jobs whose answers you have",
)


class _LiveJob:
    """A job whose end is not recorded yet, its tasks, and an event for those who watch it."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.changed = asyncio.Event()
        self.tasks: list[asyncio.Task[None]] = []
        self.recording = asyncio.Lock()
        """Held while the state is written to the repository"""

    def update(self, job: Job) -> None:
        """Change the state, and notify watchers."""
        self.job = job
        self.notify()

    def notify(self) -> None:
        """Wake all watchers, whether the state has changed or not."""
        changed, self.changed = self.changed, asyncio.Event()
        changed.set()

    def cancel(self) -> None:
        """Stop the work."""
        for task in self.tasks:
            task.cancel()

    def on_progress(self, share: float) -> None:
        """Note the share of the work that is done."""
        share = round(share, 4)
        if not self.job.is_finished and (share > self.job.progress or self.job.started is None):
            self.update(self.job.running(share))


class JobManager:
    """The jobs of a service. Each pins its answer in ``results`` until it is removed.

    An owner has at most ``quota`` jobs, finished ones included; None stands for no quota.
    """

    def __init__(
        self,
        repository: JobRepository,
        results: ResultStore,
        ttl_s: float,
        quota: int | None,
    ) -> None:
        self._repository = repository
        self._results = results
        self._tidy_period_s = min(_TIDY_PERIOD_S, ttl_s)
        self._retention = Retention(ttl_s)
        self._quota = quota
        self._live: dict[str, _LiveJob] = {}
        self._submitting = asyncio.Lock()
        self._is_stopping = False

    @asynccontextmanager
    async def running(self, solve_again: SolveAgain) -> AsyncIterator[None]:
        """Open the repository, run jobs, and remove expired ones, inside the block.

        Jobs that are under way at its end are run again, by ``solve_again``, inside the next one.
        """
        await self._repository.open()
        for job in await self._repository.finished():
            self._retention.add_older(job)
            if job.result is not None:
                self._results.pin(job.result)
        for job in await self._repository.unfinished():
            await self._resume(job.accepted_again(), solve_again)
        tidying = asyncio.create_task(self._tidy())
        try:
            yield
        finally:
            tidying.cancel()
            self.end_events()
            await self._interrupt()
            await self._repository.close()

    def end_events(self) -> None:
        """End every `watch`, since the service is about to stop."""
        self._is_stopping = True
        for live in self._live.values():
            live.notify()

    async def submit(self, spec: JobSpec, query: bytes, solve: Solve) -> Job:
        """Accept a job, or return the job that has the idempotency key of ``spec``.

        The key of a job that failed or was dismissed is free again. The ``query`` as JSON is stored
        until the job has finished.

        Raises
        ------
        ProblemError
            The key belongs to another question, or the owner has as many jobs as it may.
        """
        async with self._submitting:  # two requests with one key at the same time are one job, too
            known = await self._find_by_key(spec)
            if known is not None:
                return known
            await self._refuse_over_quota(spec.owner)
            job = Job(spec=spec)
            await self._repository.add(job, query)
            self._begin(job, solve)
            return job

    async def find(self, owner: str | None, job_id: str) -> Job:
        """Return the present state of a job; raises ``ProblemError`` where the owner has none."""
        live = self._live.get(job_id)
        if live is not None and live.job.spec.owner == owner:
            return live.job
        job = await self._repository.find(owner, job_id)
        if job is None:
            raise problem("job_not_found", f"there is no job {job_id!r}")
        return job

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, the newest first, and the number to go on before."""
        jobs, after = await self._repository.page(owner, limit, before)
        return [self._live[job.id].job if job.id in self._live else job for job in jobs], after

    async def count(self) -> Counter[str]:
        """Return the number of jobs of all owners by status."""
        finished = Counter(await self._repository.count_finished())
        jobs = [live.job for live in self._live.values()]
        return finished + Counter(job.status for job in jobs if not job.is_finished)

    async def dismiss(self, owner: str | None, job_id: str) -> Job:
        """Stop a job, or remove it where it has finished; return its last state."""
        job = await self.find(owner, job_id)
        live = self._live.get(job_id)
        if live is not None and not live.job.is_finished:
            live.update(live.job.dismissed())
            live.cancel()
            await self._record_end(live)
            return live.job
        await self._remove(job)
        return job

    async def result(self, owner: str | None, job_id: str) -> tuple[Job, Result]:
        """Acquire the answer of a job.

        Raises
        ------
        ProblemError
            There is no such job, it has not finished, it was dismissed, or it failed: then its own
            problem is raised.
        """
        job = await self.find(owner, job_id)
        if job.problem is not None:
            raise problem(**vars(job.problem))
        if job.status == "dismissed":
            raise problem("job_dismissed", f"job {job_id} was dismissed")
        if job.result is None:
            detail = f"job {job_id} is {job.status}: {job.progress:.0%} done"
            raise problem("job_not_finished", detail, headers={"Retry-After": "1"})
        result = await self._results.find(job.result)
        if result is None:
            hint = "send the query again"
            raise problem("mesh_damaged", f"the answer of job {job_id} is damaged", hint=hint)
        return job, result

    async def watch(self, job: Job, seen: int) -> AsyncIterator[Job]:
        """Yield the present and the following states of a job, except versions up to ``seen``."""
        live = self._live.get(job.id)
        while True:
            now, changed = (live.job, live.changed) if live else (job, None)
            if now.version > seen:
                seen = now.version
                yield now
            if changed is None or now.is_finished or self._is_stopping:
                return
            await changed.wait()

    async def _find_by_key(self, spec: JobSpec) -> Job | None:
        key = spec.idempotency_key
        if key is None:
            return None
        job = await self._repository.find_by_key(spec.owner, key)
        if job is None or job.status in ("failed", "dismissed"):
            return None
        if job.spec.fingerprint != spec.fingerprint:
            message = f"{key!r} stands for another question, asked by job {job.id}"
            fault = Fault("/header/Idempotency-Key", message)
            raise problem("invalid_request", message, errors=(fault,))
        return self._live[job.id].job if job.id in self._live else job

    async def _refuse_over_quota(self, owner: str | None) -> None:
        if self._quota is None:
            return
        count = await self._repository.count(owner)
        if count < self._quota:
            return
        wait_s = self._retention.seconds_to_first(owner) or 1
        raise over_limit(
            "quota_exceeded",
            "jobs of one owner",
            count + 1,
            self._quota,
            "quota_jobs",
            hint="delete jobs that are not needed any more, and those whose answers you have",
            headers={"Retry-After": str(wait_s)},
        )

    async def _resume(self, job: Job, solve_again: SolveAgain) -> None:
        """Run a stored job, unless it has been run too often."""
        if job.runs >= _MOST_RUNS:
            last = job.failed(_STOPPED_TOO_OFTEN)
            await self._repository.update(last)
            self._retention.add(last)
            return

        async def solve(on_progress: ProgressCallback) -> Result:
            query = await self._repository.query(job.id)
            if query is None:  # an older release accepted the job
                raise ProblemError(_STOPPED)
            return await solve_again(job.spec, query, on_progress)

        await self._repository.update(job)
        with bound_contextvars(request_id=job.spec.request_id):
            self._begin(job, solve)

    def _begin(self, job: Job, solve: Solve) -> None:
        live = self._live[job.id] = _LiveJob(job)
        for work in (self._run(live, solve), self._record_start(live)):
            live.tasks.append(asyncio.create_task(work, name=f"job {job.id}"))

    async def _interrupt(self) -> None:
        """Stop all jobs, and leave their records as they are: the next start runs them again."""
        jobs = list(self._live.values())
        for live in jobs:
            if not live.job.is_finished:
                live.cancel()
        tasks = (task for live in jobs for task in live.tasks)
        await asyncio.gather(*tasks, return_exceptions=True)
        with suppress(OSError):  # logged when it failed first; the job is run again
            await self._record_ends()

    async def _run(self, live: _LiveJob, solve: Solve) -> None:
        try:
            result = await self._results.with_files(await solve(live.on_progress))
        except Exception as error:
            problem = problem_of(error)
            if self._is_stopping and problem.code in _SIGNS_OF_THE_END:
                return
            if problem.code == "internal_error":
                logger.exception("job failed", job_id=live.job.id)
            await self._end(live, live.job.failed(problem))
            return
        if self._results.can_pin(result.name):
            self._results.pin(result.name)
            last = live.job.successful(result.name)
        else:
            last = live.job.failed(_NO_ROOM)
        self._results.release(result)
        await self._end(live, last)

    async def _end(self, live: _LiveJob, last: Job) -> None:
        """Give a job its last state; record it later where the disk refuses that now."""
        if live.job.is_finished:
            return
        live.update(last)
        try:
            await self._record_end(live)
        except OSError:
            logger.exception("end of a job not recorded, to be tried again", job_id=last.id)

    async def _record_start(self, live: _LiveJob) -> None:
        """Record the run of a job once a worker has begun it."""
        while live.job.started is None and not live.job.is_finished:
            await live.changed.wait()
        async with live.recording:
            if live.job.is_finished:
                return
            try:
                await self._repository.update(live.job)
            except OSError:  # a run that is not counted does no harm, unless the service dies of it
                logger.exception("start of a job not recorded", job_id=live.job.id)

    async def _record_end(self, live: _LiveJob) -> None:
        async with live.recording:
            await self._repository.update(live.job)
            self._live.pop(live.job.id, None)
            self._retention.add(live.job)

    async def _record_ends(self) -> None:
        """Record the ends of jobs that could not be recorded when they came."""
        for live in list(self._live.values()):
            if live.job.is_finished:
                await self._record_end(live)

    async def _tidy(self) -> None:
        """Record what could not be recorded before, and remove expired jobs; again and again."""
        while True:
            try:
                await self._record_ends()
                for job in self._retention.due():
                    await self._remove(job)
            except OSError:  # such as a full disk: there may be room the next time
                logger.exception("jobs neither recorded nor removed")
            await asyncio.sleep(self._tidy_period_s)

    async def _remove(self, job: Job | FinishedJob) -> None:
        await self._repository.remove(job.id)
        self._live.pop(job.id, None)
        self._retention.discard(job.id)
        if job.result is not None:
            self._results.unpin(job.result)
