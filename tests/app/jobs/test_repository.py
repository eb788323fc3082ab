"""The records of jobs, in both databases."""

import asyncio

import pytest
from sqlalchemy import update

from app.jobs.job import Job
from app.jobs.repository import JobRepository
from app.state import Database
from app.state.schema import jobs
from tests.support.jobs import new_job

pytestmark = pytest.mark.anyio

QUERY = b'{"sources":[{"vertex":0}]}'


@pytest.fixture
def repository(database: Database) -> JobRepository:
    return JobRepository(database)


async def test_jobs_are_counted_by_status(repository: JobRepository) -> None:
    found = [await repository.add(new_job(), QUERY) for _ in range(3)]
    assert await repository.update(found[1].dismissed(), 1)
    assert await repository.count_by_status() == {"accepted": 2, "dismissed": 1}
    assert await repository.unfinished() == [found[0].id, found[2].id]
    await repository.remove(found[1].id)
    assert await repository.count_by_status() == {"accepted": 2}


async def test_ends_are_found_whatever_else_a_record_says(
    database: Database, repository: JobRepository
) -> None:
    found = [await repository.add(new_job(client), QUERY) for client in ("alice", "", "")]
    assert await repository.ended() == []
    last = found[0].running(0.0).successful("its answer")
    assert await repository.update(last, 1)
    assert await repository.update(found[1].dismissed(), 1)
    record = last.model_dump(mode="json") | {"status": "unheard-of"}
    async with database.transaction() as connection:
        await connection.execute(update(jobs).where(jobs.c.id == last.id).values(record=record))
    ended = {job.id: job for job in await repository.ended()}
    assert ended.keys() == {job.id for job in found[:2]}
    assert ended[last.id] == (last.id, "alice", "its answer", last.finished)
    assert ended[found[1].id][:3] == (found[1].id, "", None)


async def test_a_key_is_one_job_until_that_has_failed(repository: JobRepository) -> None:
    async def submit(client: str) -> Job:
        return await repository.add(new_job(client, "a key"), QUERY)

    first, *others = await asyncio.gather(*(submit(f"client {number}") for number in range(6)))
    assert others == [first] * 5, "all clients share their jobs"
    assert await repository.update(first.dismissed(), 1)
    again = await submit("alice")
    assert again.id != first.id
    last = again.running(0.0).successful("a result")
    assert await repository.update(last, 1)
    assert await submit("bob") == last
    assert await repository.unfinished() == []


async def test_pages_begin_with_the_newest(repository: JobRepository) -> None:
    assert await repository.page(2, None) == ([], None)
    added = [await repository.add(new_job(f"client {number}"), QUERY) for number in range(5)]
    seen, before = [], None
    while True:
        page, before = await repository.page(2, before)
        seen.append(page)
        if before is None:
            break
    assert seen == [added[4:2:-1], added[2:0:-1], added[:1]]


async def test_a_job_is_changed_by_whoever_knows_its_state_until_it_has_finished(
    repository: JobRepository,
) -> None:
    job = await repository.add(new_job("alice"), QUERY)
    running = job.running(0.5)
    assert not await repository.update(running, 2)
    assert await repository.update(running, 1)
    assert not await repository.update(job.successful("late"), 1)
    refused = await repository.load_with_query(job.id)
    assert refused == (running, QUERY), "an end that is refused leaves the query"
    last = running.successful("a result")
    assert await repository.update(last, running.version)
    assert await repository.load_with_query(job.id) == (last, None)
    assert not await repository.update(last.dismissed(), last.version)
    assert await repository.find(job.id) == last
    await repository.remove(job.id)
    assert not await repository.update(last, running.version)


async def test_of_those_who_change_a_job_one_does(repository: JobRepository) -> None:
    job = await repository.add(new_job(), QUERY)
    states = [job.running(number / 10) for number in range(10)]
    changed = await asyncio.gather(*(repository.update(state, job.version) for state in states))
    assert changed.count(True) == 1
    assert await repository.find(job.id) == states[changed.index(True)]
