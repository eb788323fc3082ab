"""The life of jobs: accepted, run, finished or dismissed, and removed after a while."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator, Set
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import Any

import structlog
from structlog.contextvars import bound_contextvars

from app.engine.interface import ProgressCallback
from app.errors import (
    Fault,
    Problem,
    ProblemError,
    StateUnavailableError,
    over_limit,
    problem,
    problem_of,
)
from app.jobs.job import Job, JobSpec
from app.jobs.repository import JobRecords, JobRepository
from app.jobs.retention import FinishedJob, Retention
from app.repeating import repeat
from app.state import Replicas
from app.state.replicas import BEAT_S
from app.store.results import Result, ResultStore

logger = structlog.get_logger(module=__name__)

Solve = Callable[[ProgressCallback], Awaitable[Result]]
"""The computation of a job, which reports its progress; its result has files"""

SolveAgain = Callable[[JobSpec, bytes, ProgressCallback], Awaitable[Result]]
"""The same for a stored job, from its query as JSON"""

_TIDY_PERIOD_S = 60.0
"""Seconds between two rounds of upkeep, such as the removal of expired jobs"""

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
_SIGNS_OF_THE_END = frozenset({"draining", "engine_unavailable", "worker_died"})
"""Problems of jobs that the end of the service interrupts: a signal may have gone to workers too"""


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

    async def shown(self) -> Job:
        """Return the state: an end only once it is recorded, or could not be.

        Else a client would be told the end here, and at another replica that the job still runs.
        """
        if self.job.is_finished:
            async with self.recording:
                pass
        return self.job

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

    Where services share the repository, they are ``replicas``, and each job is run by one of them.
    All of them show its record, which is at most a second old, and the others dismiss it there.
    Jobs of a replica that is dead are run again by another one.
    """

    def __init__(
        self,
        repository: JobRepository,
        results: ResultStore,
        ttl_s: float,
        quota: int | None,
        replicas: Replicas | None = None,
    ) -> None:
        self._repository = repository
        self._replicas = replicas
        self._replica_id = None if replicas is None else replicas.id
        self._results = results
        self._tidy_period_s = min(_TIDY_PERIOD_S, ttl_s)
        self._retention = Retention(ttl_s)
        self._quota = quota
        self._live: dict[str, _LiveJob] = {}
        self._accepting: set[asyncio.Task[Job]] = set()
        self._doubtful: set[str] = set()
        """Ids of jobs that may have been added or taken over, although an error said not"""
        self._newest = 0
        """Number of the newest job at the last beat"""
        self._unfinished: frozenset[str] = frozenset()
        """Ids of the jobs that had not finished then"""
        self._is_stopping = False

    @asynccontextmanager
    async def running(self, solve_again: SolveAgain) -> AsyncIterator[None]:
        """Run jobs, and remove expired ones, inside the block; the repository is open.

        Jobs that are under way at its end are run again, by ``solve_again``, inside the next one,
        or by another replica.
        """
        await self._repository.tidy()
        await self._note_finished()
        if self._replicas is None:
            for job in await self._repository.unfinished():
                await self._resume(job, solve_again)
        else:
            await self._keep_up(self._replicas, solve_again)
        tasks = [asyncio.create_task(loop) for loop in self._loops(solve_again)]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self.end_events()
            await asyncio.gather(*self._accepting, return_exceptions=True)
            await self._interrupt()
            if self._replicas is not None:
                with suppress(OSError):  # others find that out by themselves
                    await self._replicas.leave()

    def _loops(self, solve_again: SolveAgain) -> Iterator[Coroutine[Any, Any, None]]:
        """Yield what goes on in the background; a failure of one stops no other."""
        period_s = self._tidy_period_s
        yield repeat(self._record_ends, period_s, "ends of jobs not recorded")
        yield repeat(self._remove_expired, period_s, "expired jobs not removed")
        if self._replicas is not None:
            yield repeat(self._note_finished, period_s, "finished jobs not noted")
            yield self._beat(self._replicas, solve_again)

    def end_events(self) -> None:
        """End every `watch`, since the service is about to stop."""
        self._is_stopping = True
        for live in self._live.values():
            live.notify()

    async def submit(self, spec: JobSpec, query: bytes, solve: Solve) -> Job:
        """Accept a job, or return the job that has the idempotency key of ``spec``.

        The key of a job that failed or was dismissed is free again. The ``query`` as JSON is stored
        until the job has finished. If the call is cancelled, the job runs, or was never accepted.

        Raises
        ------
        ProblemError
            The key belongs to another question, or the owner has as many jobs as it may.
        """
        accepting = asyncio.create_task(self._accept(spec, query, solve))
        self._accepting.add(accepting)
        accepting.add_done_callback(self._accepting.discard)
        return await asyncio.shield(accepting)

    async def _accept(self, spec: JobSpec, query: bytes, solve: Solve) -> Job:
        job = Job(spec=spec, replica=self._replica_id)
        try:
            # Two requests with one key at the same time are one job, too.
            async with self._repository.alone(spec.owner) as records:
                known = await self._find_by_key(records, spec)
                if known is not None:
                    return known
                await self._refuse_over_quota(records, spec.owner)
                await records.add(job, query)
        except StateUnavailableError:
            self._doubtful.add(job.id)
            raise
        self._begin(job, solve)
        return job

    async def find(self, owner: str | None, job_id: str) -> Job:
        """Return the present state of a job; raises ``ProblemError`` where the owner has none."""
        live = self._live.get(job_id)
        if live is not None and live.job.spec.owner == owner and self._is_shown_here(live):
            return await live.shown()
        job = await self._repository.find(owner, job_id)
        if job is None:
            raise problem("job_not_found", f"there is no job {job_id!r}")
        return job

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, the newest first, and the number to go on before."""
        jobs, after = await self._repository.page(owner, limit, before)
        shown = []
        for job in jobs:
            live = self._live.get(job.id)
            shown.append(await live.shown() if live and self._is_shown_here(live) else job)
        return shown, after

    def _is_shown_here(self, live: _LiveJob) -> bool:
        """Tell whether clients see the state in this process, and not its record.

        All replicas show the record of a job that runs. Else its progress would fall for a client
        that asks one replica after the other.
        """
        return self._replicas is None or live.job.is_finished

    async def count(self) -> Counter[str]:
        """Return the number of jobs of all owners by status."""
        finished = Counter(await self._repository.count_finished())
        jobs = [live.job for live in self._live.values()]
        return finished + Counter(job.status for job in jobs if not job.is_finished)

    async def cancel(self, owner: str | None, job_id: str) -> Job:
        """Stop a job, and return its last state; one that has finished stays as it is."""
        job = await self.find(owner, job_id)
        live = self._live.get(job_id)
        if live is not None and not live.job.is_finished:
            live.update(live.job.dismissed())
            live.cancel()
            await self._record_end(live)
            return live.job
        if live is None and not job.is_finished:  # another replica runs it, and will notice
            dismissed = job.beyond_run().dismissed()
            if await self._repository.update(dismissed, job.replica):
                self._retention.add(dismissed)
                return dismissed
            return await self.cancel(owner, job_id)  # it has finished, or has been taken over
        return job

    async def remove(self, owner: str | None, job_id: str) -> Job:
        """Remove a job with its answer, and return its last state; one that runs is stopped."""
        last = await self.cancel(owner, job_id)
        await self._remove(last)
        return last

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
        if self._replicas is not None:
            await self._results.index(job.result)
        result = await self._results.find(job.result)
        if result is None:
            hint = "send the query again"
            raise problem("mesh_damaged", f"the answer of job {job_id} is damaged", hint=hint)
        return job, result

    async def watch(self, job: Job, seen: int) -> AsyncIterator[Job]:
        """Yield the present and the following states of a job, except versions up to ``seen``."""
        live = self._live.get(job.id)
        while True:
            changed = live.changed if live else None
            now = await live.shown() if live else job
            if now.version > seen:
                seen = now.version
                yield now
            if now.is_finished or self._is_stopping:
                return
            if changed is not None and self._live.get(job.id) is live:
                await changed.wait()
            elif self._replicas is not None:  # another one runs it
                await asyncio.sleep(BEAT_S)
                live, job = None, await self.find(job.spec.owner, job.id)
            else:
                return

    async def _find_by_key(self, records: JobRecords, spec: JobSpec) -> Job | None:
        key = spec.idempotency_key
        if key is None:
            return None
        job = await records.find_by_key(spec.owner, key)
        if job is None:
            return None
        known = self._live[job.id].job if job.id in self._live else job
        # The record may be behind what is known here; or ahead, if another replica dismissed it.
        if {job.status, known.status} & {"failed", "dismissed"}:
            return None
        if job.spec.fingerprint != spec.fingerprint:
            message = f"{key!r} was used for a different query, by job {job.id}"
            fault = Fault("/header/Idempotency-Key", message)
            raise problem("invalid_request", message, errors=(fault,))
        return known

    async def _refuse_over_quota(self, records: JobRecords, owner: str | None) -> None:
        if self._quota is None:
            return
        count = await records.count(owner)
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

    async def _beat(self, replicas: Replicas, solve_again: SolveAgain) -> None:
        """Keep up with the other replicas, which has been done just now, again and again."""
        await asyncio.sleep(BEAT_S)
        keep_up = partial(self._keep_up, replicas, solve_again)
        await repeat(keep_up, BEAT_S, "jobs of replicas not compared")

    async def _keep_up(self, replicas: Replicas, solve_again: SolveAgain) -> None:
        """Record progress, stop what others dismissed or took over, and take over what is left."""
        living = await replicas.beat()
        await self._record_ends()
        live_jobs, doubtful = list(self._live.values()), frozenset(self._doubtful)
        added, newest = await self._repository.added(self._newest)
        records = {job.id: job for job in await self._repository.unfinished()}
        for live in live_jobs:
            record = records.get(live.job.id)
            if live.job.is_finished:
                continue
            if record is None or record.replica != replicas.id:
                await self._let_go(live)
            elif live.job.version > record.version:
                async with live.recording:
                    if not live.job.is_finished:
                        await self._repository.update(live.job, replicas.id)
        for job in records.values():
            is_left = job.replica not in living
            if is_left or (job.id in doubtful and job.id not in self._live):
                await self._resume(job, solve_again)
        self._doubtful -= doubtful  # the others were neither added nor taken over
        await self._note_ends((self._unfinished | added) - records.keys())
        self._unfinished, self._newest = frozenset(records), newest

    async def _let_go(self, live: _LiveJob) -> None:
        """Stop a job that another replica has dismissed, removed, or taken over."""
        record = await self._repository.find(live.job.spec.owner, live.job.id)
        if live.job.is_finished:
            return
        self._live.pop(live.job.id, None)
        live.cancel()
        live.update(record or live.job.dismissed())
        await self._note_ends({live.job.id})

    async def _resume(self, job: Job, solve_again: SolveAgain) -> None:
        """Run a stored job, unless it has been run too often, or another replica was faster."""
        again = job.accepted_again(self._replica_id)
        if job.runs >= _MOST_RUNS:
            last = again.failed(_STOPPED_TOO_OFTEN)
            if await self._repository.update(last, job.replica):
                self._retention.add(last)
            return

        async def solve(on_progress: ProgressCallback) -> Result:
            query = await self._repository.query(job.id)
            if query is None:  # an older release accepted the job
                raise ProblemError(_STOPPED)
            return await solve_again(job.spec, query, on_progress)

        try:
            is_taken = await self._repository.update(again, job.replica)
        except StateUnavailableError:
            self._doubtful.add(job.id)
            raise
        if is_taken:
            with bound_contextvars(request_id=job.spec.request_id):
                self._begin(again, solve)

    async def _note_finished(self) -> None:
        """Note the jobs that have finished, by whichever replica, and forget those removed."""
        known = self._retention.jobs
        finished = await self._repository.finished()
        for job in known:
            if job.id not in finished:
                self._forget(job)
        await self._note_ends(finished)

    async def _note_ends(self, ids: Set[str]) -> None:
        """Note those of some jobs that have finished, and are not known to have."""
        unknown = [job_id for job_id in ids if not self._knows(job_id)]
        for job in await self._repository.ended(unknown):
            if not self._knows(job.id):
                self._retention.add_older(job)
                if job.result is not None:
                    self._results.pin(job.result, job.owner)

    def _knows(self, job_id: str) -> bool:
        return job_id in self._retention or job_id in self._live

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
            result = await solve(live.on_progress)
        except Exception as error:
            problem = problem_of(error)
            if self._is_stopping and problem.code in _SIGNS_OF_THE_END:
                return
            if problem.code == "internal_error":
                logger.exception("job failed", job_id=live.job.id)
            await self._end(live, live.job.failed(problem))
            return
        try:
            self._results.pin_within_quota(result.name, live.job.spec.owner)
            last = live.job.successful(result.name)
        except ProblemError as error:
            last = live.job.failed(error.problem)
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
                await self._repository.update(live.job, self._replica_id)
            except OSError:  # a run that is not counted does no harm, unless the service dies of it
                logger.exception("start of a job not recorded", job_id=live.job.id)

    async def _record_end(self, live: _LiveJob) -> None:
        async with live.recording:
            last = live.job
            if last.id not in self._live:
                return  # recorded meanwhile
            if not await self._repository.update(last, self._replica_id):
                await self._yield_to_record(live)
            self._live.pop(last.id, None)
            if live.job.is_finished:
                self._retention.add(live.job)

    async def _yield_to_record(self, live: _LiveJob) -> None:
        """Show a job as it is recorded: another replica was faster, or removed it."""
        last = live.job
        record = await self._repository.find(last.spec.owner, last.id)
        if record is not None and (record.version, record.replica) == (last.version, last.replica):
            return  # recorded before, although the database could not say so
        if last.result is not None:
            self._results.unpin(last.result, last.spec.owner)
        live.update(record or last.dismissed())
        if record is not None and record.result is not None:
            self._results.pin(record.result, record.spec.owner)

    async def _record_ends(self) -> None:
        """Record the ends of jobs that could not be recorded when they came."""
        for live in list(self._live.values()):
            if live.job.is_finished:
                await self._record_end(live)

    async def _remove_expired(self) -> None:
        for job in self._retention.due():
            await self._remove(job)

    async def _remove(self, job: Job | FinishedJob) -> None:
        await self._repository.remove(job.id)
        self._forget(job)

    def _forget(self, job: Job | FinishedJob) -> None:
        """Forget a job that has been removed, unless it is not known, or not any more."""
        was_live = self._live.pop(job.id, None) is not None
        was_retained = self._retention.discard(job.id)
        if job.result is not None and (was_live or was_retained):
            self._results.unpin(job.result, job.owner)
