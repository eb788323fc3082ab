"""The life of jobs: what clients are told, and what a runner does."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NoReturn

import pytest
from sqlalchemy import update

from app.errors import ProblemError, StateUnavailableError, problem
from app.jobs import Job, JobManager, JobRepository, JobRunner, Retention
from app.jobs.runner import Solve
from app.state import Database
from app.state.schema import jobs as records
from app.store.folder import Folder
from app.store.results import Result, ResultFiles, ResultStore, write_result
from tests.support.jobs import SPEC, SlowSubmissions, new_job
from tests.support.waiting import LONG_S

pytestmark = pytest.mark.anyio

QUERY = b"{}"
HOUR_S = 3600.0
WITH_KEY = SPEC.model_copy(update={"idempotency_key": "a key"})


def results_in(folder: Path) -> ResultStore:
    """Return a store with room for one of two answers of 60 bytes, ``m/one`` and ``m/two``."""
    results = ResultStore(ResultFiles(Folder(folder)), 100, memory=0)
    results.prepare()
    return results


def has_room(results: ResultStore) -> bool:
    """Tell whether a second answer could be held."""
    try:
        results.refuse_without_room(None, 60)
    except ProblemError:
        return False
    return True


def answer(folder: Path, name: str = "m/one") -> Result:
    return write_result(folder / "results", name, [b"x" * 60], {}, "code", is_cheap=False)


async def fail(*_: object) -> NoReturn:
    raise problem("invalid_mesh", "as it should")


async def go_on(*_: object) -> NoReturn:
    await asyncio.sleep(LONG_S)
    raise AssertionError


@asynccontextmanager
async def running(
    repository: JobRepository, results: ResultStore, solve: Solve, ttl_s: float = HOUR_S
) -> AsyncIterator[JobManager]:
    """Have jobs run as the service does."""
    retention = Retention(results, ttl_s)
    jobs = JobManager(repository, results, retention)
    runner = JobRunner(repository, results, retention, ttl_s, solve, jobs.notify)
    jobs.runner = runner
    async with asyncio.timeout(LONG_S), runner.running():
        yield jobs


async def last_of(jobs: JobManager, job: Job) -> Job:
    *_, last = [state async for state in jobs.watch(job, 0)]
    return last


async def test_what_is_told_is_recorded(database: Database, tmp_path: Path) -> None:
    """Else another service, which reads the record, would tell something else."""
    notes: list[Callable[[float], None]] = []

    async def solve(_spec: object, _query: object, note: Callable[[float], None]) -> Result:
        notes.append(note)
        note(0.25)
        return await go_on()

    repository, others = JobRepository(database), JobRepository(database)
    async with running(repository, results_in(tmp_path), solve) as jobs:
        job = await jobs.submit(SPEC, QUERY)
        states = aiter(jobs.watch(job, job.version))
        for share in (0.25, 0.5):
            state = await anext(states)
            assert (state.status, state.progress, state.runs) == ("running", share, 1)
            assert await others.find(job.id) == state
            notes[0](0.5)
        assert (await jobs.cancel(job.id)).status == "dismissed"
        assert (await anext(states)).status == "dismissed"


async def test_a_job_that_another_process_dismisses_stops(
    database: Database, tmp_path: Path
) -> None:
    stopped = asyncio.Event()

    async def solve(_spec: object, _query: object, note: Callable[[float], None]) -> Result:
        try:
            note(0.0)
            return await go_on()
        finally:
            stopped.set()

    repository, others = JobRepository(database), JobRepository(database)
    async with running(repository, results_in(tmp_path), solve) as jobs:
        job = await jobs.submit(WITH_KEY, QUERY)
        while (state := await jobs.find(job.id)).status != "running":
            await asyncio.sleep(0.01)
        assert (await jobs.submit(WITH_KEY, QUERY)).id == job.id
        assert await others.update(state.dismissed(), state.version)
        jobs.runner.nudge()
        await stopped.wait()
        assert (await jobs.find(job.id)).status == "dismissed"
        assert (await jobs.submit(WITH_KEY, QUERY)).id != job.id, "its key is free"


async def test_a_submission_that_is_cancelled_leaves_a_job_that_runs_or_none(
    database: Database, tmp_path: Path
) -> None:
    """Else the next request with the same key would get a job that never ends."""

    repository = SlowSubmissions(database)
    async with running(repository, results_in(tmp_path), fail) as jobs:
        submission = asyncio.create_task(jobs.submit(WITH_KEY, QUERY))
        await repository.written.wait()
        submission.cancel()
        await asyncio.wait({submission})
        repository.may_say.set()

        again = await jobs.submit(WITH_KEY, QUERY)
        assert (await last_of(jobs, again)).status == "failed", "as it should"


@pytest.mark.parametrize("runs", [0, 1, 2, 3])
async def test_a_job_that_was_under_way_is_run_again_but_not_for_ever(
    database: Database, tmp_path: Path, runs: int
) -> None:
    async def solve(*_: object) -> Result:
        return results.add(answer(tmp_path))

    results = results_in(tmp_path)

    repository = JobRepository(database)
    job = new_job()
    for _ in range(runs):
        job = job.accepted_again().running(0.5)
    await repository.add(job, QUERY)
    async with running(repository, results, solve) as jobs:
        last = await last_of(jobs, job)
        assert last.version > job.version
        assert last.status == ("failed" if runs == 3 else "successful")


class FailingOnce(JobRepository):
    """Fails at the first removal, and loses the confirmation of the first change."""

    removals = changes = 0

    async def remove(self, job_id: str) -> None:
        self.removals += 1
        if self.removals == 1:
            raise ValueError(job_id)
        await super().remove(job_id)

    async def update(self, job: Job, version: int) -> bool:
        is_changed = await super().update(job, version)
        self.changes += 1
        if self.changes == 1:
            raise StateUnavailableError("the connection has ended")
        return is_changed


async def test_jobs_end_and_expire_after_any_failure(database: Database, tmp_path: Path) -> None:
    repository = FailingOnce(database)
    async with running(repository, results_in(tmp_path), fail, ttl_s=0.01) as jobs:
        await jobs.submit(SPEC, QUERY)
        while await repository.count_by_status():
            await asyncio.sleep(0.01)
    assert repository.removals > 1


async def test_the_answer_of_a_job_is_held_by_all_services(
    database: Database, tmp_path: Path
) -> None:
    """Else one of them might remove it to make room."""

    async def solve(*_: object) -> Result:
        return stores[0].add(answer(tmp_path))

    stores = [results_in(tmp_path) for _ in range(2)]

    async with running(JobRepository(database), stores[0], solve) as jobs:
        retention = Retention(stores[1], HOUR_S)
        other = JobManager(JobRepository(database), stores[1], retention)
        other.runner = jobs.runner
        answer(tmp_path, "m/two")
        job = await last_of(jobs, await jobs.submit(SPEC, QUERY))
        await other.keep_up()
        for name in ("m/one", "m/two"):
            await stores[1].index(name)
        assert not has_room(stores[1])
        await jobs.remove(job.id)
        await other.keep_up()
        assert has_room(stores[1])


async def test_a_job_that_is_removed_twice_leaves_the_answer_to_another_one(
    database: Database, tmp_path: Path
) -> None:
    async def solve(*_: object) -> Result:
        return results.add(answer(tmp_path))

    results = results_in(tmp_path)

    async with running(JobRepository(database), results, solve) as jobs:
        for _ in range(2):
            job = await last_of(jobs, await jobs.submit(SPEC, QUERY))
            assert job.status == "successful"
        asked = [jobs.remove(job.id) for _ in range(2)]
        await asyncio.gather(*asked, return_exceptions=True)
        results.release(results.add(answer(tmp_path, "m/two")))
        assert await results.find("m/one") is not None
        assert await results.find("m/two") is None


async def test_a_record_of_a_newer_release_keeps_no_job_from_expiring(
    database: Database, tmp_path: Path
) -> None:
    repository = JobRepository(database)
    await repository.add(job := new_job(), QUERY)
    record = job.dismissed().model_dump(mode="json") | {"status": "unheard-of"}
    async with database.transaction() as connection:
        await connection.execute(update(records).values(record=record))
    async with running(repository, results_in(tmp_path), fail, ttl_s=0.01):
        while await repository.count_by_status():
            await asyncio.sleep(0.01)
