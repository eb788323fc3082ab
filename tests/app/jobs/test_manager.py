"""The life of jobs: what clients are told, and when."""

import asyncio
import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, cast

import pytest

from app.errors import ProblemError, StateUnavailableError, problem
from app.jobs.job import Job
from app.jobs.manager import JobManager
from app.jobs.repository import JobRepository
from app.state import Database
from app.store.results import FolderResults, Result, ResultStore, write_result
from tests.support.databases import opened
from tests.support.jobs import SPEC, SlowSubmissions, new_job
from tests.support.waiting import LONG_S

QUERY = b"{}"
HOUR_S = 3600.0


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


def test_a_submission_that_is_cancelled_leaves_a_job_that_runs_or_none(database: Database) -> None:
    """Else the next request with the same key would get a job that never ends."""
    spec = SPEC.model_copy(update={"idempotency_key": "a key"})

    async def main() -> None:
        may_end = asyncio.Event()

        async def solve(_on_progress: object) -> Result:
            await may_end.wait()
            return await fail()

        async with opened(database):
            repository = SlowSubmissions(database)
            jobs = JobManager(repository, cast(Any, "not used"), 60.0, None)
            async with jobs.running(fail):
                submission = asyncio.create_task(jobs.submit(spec, QUERY, solve))
                await repository.written.wait()
                submission.cancel()
                await asyncio.wait({submission})
                assert submission.cancelled()
                repository.may_say.set()

                again = await jobs.submit(spec, QUERY, solve)
                may_end.set()
                *_, last = [state.status async for state in jobs.watch(again, 0)]
                assert last == "failed", "as it should"

    asyncio.run(main())


class FailingRemoval(JobRepository):
    """Fails once to remove a job, in a way that nobody has thought of."""

    fails = True

    async def remove(self, job_id: str) -> None:
        if self.fails:
            self.fails = False
            raise ValueError(job_id)
        await super().remove(job_id)


def test_jobs_expire_after_any_failure(database: Database) -> None:
    async def main() -> None:
        async with asyncio.timeout(LONG_S), opened(database):
            repository = FailingRemoval(database)
            jobs = JobManager(repository, cast(Any, "not used"), 0.01, None)
            async with jobs.running(fail):
                await jobs.submit(SPEC, QUERY, fail)
                while await repository.count(None):
                    await asyncio.sleep(0.01)
        assert not repository.fails

    asyncio.run(main())


class LivingReplica:
    """One of the replicas ``one`` and ``two``, which both live."""

    def __init__(self, name: str = "one") -> None:
        self.id = name

    async def beat(self) -> set[str]:
        return {"one", "two"}

    async def leave(self) -> None:
        pass


@pytest.mark.slow
def test_all_replicas_tell_the_same_progress(database: Database) -> None:
    async def main() -> None:
        told: list[Callable[[float], None]] = []

        async def solve(on_progress: Callable[[float], None]) -> Result:
            told.append(on_progress)
            on_progress(0.25)
            await asyncio.sleep(3600)
            raise AssertionError

        async with opened(database):
            repository, others = JobRepository(database), JobRepository(database)
            replicas = cast(Any, LivingReplica())
            jobs = JobManager(repository, cast(Any, "not used"), 60.0, None, replicas)

            async def shares() -> set[float]:
                """Return what this replica says, twice, and another one, which reads the record."""
                (listed,), _ = await jobs.page(None, 1, None)
                record = await others.find(None, job.id)
                assert record is not None
                found = await jobs.find(None, job.id)
                return {listed.progress, record.progress, found.progress}

            async with jobs.running(fail):
                job = await jobs.submit(SPEC, QUERY, solve)
                while await shares() != {0.25}:
                    await asyncio.sleep(0.01)
                told[0](0.5)
                assert await shares() == {0.25}
                while await shares() == {0.25}:
                    await asyncio.sleep(0.01)
                assert await shares() == {0.5}

    asyncio.run(main())


def results_in(folder: Path) -> ResultStore:
    """Return a store with room for one of two answers of 60 bytes, ``m/one`` and ``m/two``."""
    results = ResultStore(FolderResults(folder), 100, memory=0)
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
    return write_result(folder, name, [b"x" * 60], {}, "code", is_cheap=False)


@pytest.mark.parametrize("runs_for_a_while", [False, True])
def test_the_answer_of_a_job_is_soon_held_by_all_replicas(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, runs_for_a_while: bool
) -> None:
    """Else one of them might remove it to make room."""
    monkeypatch.setattr("app.jobs.manager.BEAT_S", 0.01)
    monkeypatch.setattr("app.jobs.manager._TIDY_PERIOD_S", HOUR_S)

    async def main() -> None:
        stores = [results_in(tmp_path) for _ in range(2)]
        one, other = (
            JobManager(JobRepository(database), results, HOUR_S, None, cast(Any, replica))
            for results, replica in zip(stores, map(LivingReplica, ("one", "two")), strict=True)
        )

        async def solve(_on_progress: object) -> Result:
            if runs_for_a_while:
                await asyncio.sleep(0.1)
            return stores[0].add(answer(tmp_path))

        async with opened(database), one.running(fail), other.running(fail):
            answer(tmp_path, "m/two")
            await one.submit(SPEC, QUERY, solve)
            async with asyncio.timeout(LONG_S):
                while has_room(stores[1]):
                    await asyncio.sleep(0.01)
                    for name in ("m/one", "m/two"):
                        await stores[1].index(name)

    asyncio.run(main())


def test_a_job_that_is_removed_twice_leaves_the_answer_to_another_one(
    database: Database, tmp_path: Path
) -> None:
    async def main() -> None:
        results = results_in(tmp_path)
        jobs = JobManager(JobRepository(database), results, HOUR_S, None)

        async def solve(_on_progress: object) -> Result:
            return results.add(answer(tmp_path))

        async with opened(database), jobs.running(fail):
            for _ in range(2):
                job = await jobs.submit(SPEC, QUERY, solve)
                *_, last = [state.status async for state in jobs.watch(job, 0)]
                assert last == "successful"
            await asyncio.gather(*(jobs.remove(None, job.id) for _ in range(2)))
            results.release(results.add(answer(tmp_path, "m/two")))
            assert await results.find("m/one") is not None
            assert await results.find("m/two") is None

    asyncio.run(main())


class LostConfirmation(JobRepository):
    """Loses the connection after the first change, before that is confirmed."""

    fails = True

    async def update(self, job: Job, holder: str | None) -> bool:
        is_changed = await super().update(job, holder)
        if self.fails:
            self.fails = False
            raise StateUnavailableError("the connection has ended")
        return is_changed


def test_a_job_is_run_although_its_takeover_was_not_confirmed(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.jobs.manager.BEAT_S", 0.01)

    async def main() -> None:
        async with asyncio.timeout(LONG_S), opened(database):
            repository = LostConfirmation(database)
            replicas = cast(Any, LivingReplica())
            jobs = JobManager(repository, cast(Any, "not used"), HOUR_S, None, replicas)
            async with jobs.running(fail):
                await repository.add(new_job().accepted_again("dead"), QUERY)
                while not await repository.count_finished():
                    await asyncio.sleep(0.01)
        assert not repository.fails

    asyncio.run(main())


def test_a_job_that_another_replica_removed_unpins_its_answer_once(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the answer of another job, which is the same, could be evicted."""
    monkeypatch.setattr("app.jobs.manager.BEAT_S", HOUR_S)
    monkeypatch.setattr("app.jobs.manager._TIDY_PERIOD_S", HOUR_S)

    async def main() -> None:
        async with opened(database):
            results, repository = results_in(tmp_path), SlowEnds(database)
            replicas = cast(Any, LivingReplica())
            jobs = JobManager(repository, results, HOUR_S, None, replicas)

            async def solve(_on_progress: object) -> Result:
                return results.add(answer(tmp_path))

            async with jobs.running(fail):
                removed = await jobs.submit(SPEC, QUERY, solve)
                await repository.ending.wait()
                await repository.remove(removed.id)
                repository.may_end.set()
                assert [state.status async for state in jobs.watch(removed, 0)] == ["dismissed"]
                other = await jobs.submit(SPEC, QUERY, solve)
                *_, last = [state.status async for state in jobs.watch(other, 0)]
                assert last == "successful"
                await jobs._note_finished()
                results.release(results.add(answer(tmp_path, "m/two")))
                assert await results.find("m/one") is not None

    asyncio.run(main())


def test_the_key_of_a_job_is_free_as_soon_as_the_job_has_failed(database: Database) -> None:
    """Though the database could not record that yet."""
    spec = SPEC.model_copy(update={"idempotency_key": "a key"})

    class Failing(JobRepository):
        async def update(self, job: Job, holder: str | None) -> bool:
            raise OSError(errno.EIO, f"no end of {job.id} for {holder}")

    async def main() -> None:
        async with opened(database):
            jobs = JobManager(Failing(database), cast(Any, "not used"), HOUR_S, None)
            async with jobs.running(fail):
                first = await jobs.submit(spec, QUERY, fail)
                while not (await jobs.find(None, first.id)).is_finished:
                    await asyncio.sleep(0.01)
                again = await jobs.submit(spec, QUERY, fail)
                assert again.id != first.id

    asyncio.run(main())


def test_the_key_of_a_job_is_free_as_soon_as_another_replica_has_dismissed_it(
    database: Database,
) -> None:
    spec = SPEC.model_copy(update={"idempotency_key": "a key"})

    async def go_on(*_: Any) -> Any:
        await asyncio.sleep(LONG_S)

    async def main() -> None:
        async with opened(database):
            here, there = (
                JobManager(JobRepository(database), cast(Any, "not used"), HOUR_S, None)
                for _ in range(2)
            )
            async with here.running(fail):
                first = await here.submit(spec, QUERY, go_on)
                assert (await here.submit(spec, QUERY, go_on)).id == first.id
                await there.cancel(None, first.id)
                assert (await here.submit(spec, QUERY, go_on)).id != first.id

    asyncio.run(main())


def test_a_record_of_a_newer_release_keeps_no_job_from_expiring(
    database: Database, tmp_path: Path
) -> None:
    async def main() -> None:
        async with asyncio.timeout(LONG_S), opened(database):
            repository = JobRepository(database)
            await repository.add(job := new_job(), QUERY)
            record = job.dismissed().model_dump_json().replace('"dismissed"', '"unheard-of"')
            await database.run("UPDATE jobs SET record = ?", record)
            replicas = cast(Any, LivingReplica())
            jobs = JobManager(repository, results_in(tmp_path), 0.01, None, replicas)
            async with jobs.running(fail):
                while await repository.count(None):
                    await asyncio.sleep(0.01)

    asyncio.run(main())
