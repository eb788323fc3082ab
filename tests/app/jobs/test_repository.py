"""The records of jobs in both databases; in SQLite also on a full disk, of 16 MB in memory."""

import errno
import sqlite3
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import anyio
import pytest

from app.jobs.job import Job
from app.jobs.repository import JobRepository
from app.state import Database, SqliteDatabase
from tests.support.databases import opened
from tests.support.disks import run_on_own_disk
from tests.support.jobs import SPEC, new_job

QUERY = b'{"sources":[{"vertex":0}]}'

Check = Callable[[JobRepository], Awaitable[None]]


def run(database: Database, check: Check) -> None:
    async def check_opened() -> None:
        async with opened(database):
            await check(JobRepository(database))

    anyio.run(check_opened)


def test_the_jobs_of_an_owner_are_counted_in_every_state(database: Database) -> None:
    run(database, count_jobs)


async def count_jobs(repository: JobRepository) -> None:
    mine = [new_job("alice") for _ in range(4)]
    for job in (*mine, new_job("bob"), new_job()):
        await repository.add(job, QUERY)
    assert await repository.ended() == []

    ended = [job.dismissed() for job in mine[:3]]
    for job in ended:
        assert await repository.update(job, 1)
    assert await repository.count("alice") == 4
    assert {job.id for job in await repository.ended()} == {job.id for job in ended}
    assert await repository.count_by_status() == {"accepted": 3, "dismissed": 3}
    await repository.remove(mine[1].id)
    assert await repository.count("alice") == 3
    assert await repository.count("bob") == await repository.count(None) == 1
    assert await repository.count("carol") == 0


def test_ends_are_found_whatever_else_a_record_says(database: Database) -> None:
    run(database, partial(find_ends, database))


async def find_ends(database: Database, repository: JobRepository) -> None:
    jobs = [new_job("alice"), new_job(), new_job()]
    for job in jobs:
        await repository.add(job, QUERY)
    last = jobs[0].running(0.0).successful("its answer")
    assert await repository.update(last, 1)
    record = last.model_dump_json().replace('"successful"', '"unheard-of"')
    await database.run("UPDATE jobs SET record = ? WHERE id = ?", record, last.id)
    assert await repository.update(jobs[1].dismissed(), 1)
    ended = {job.id: job for job in await repository.ended()}
    assert ended.keys() == {job.id for job in jobs[:2]}
    assert ended[last.id] == (last.id, "alice", "its answer", last.finished)
    assert ended[jobs[1].id][:3] == (jobs[1].id, None, None)


def test_jobs_are_found_by_owner_id_and_key(database: Database) -> None:
    run(database, find_jobs)


async def find_jobs(repository: JobRepository) -> None:
    keyed = [
        Job(spec=SPEC.model_copy(update={"owner": owner, "idempotency_key": "a key"}))
        for owner in (None, "alice", "alice")
    ]
    for job in keyed:
        await repository.add(job, QUERY)
    nobodys, first, second = keyed
    assert await repository.find("alice", first.id) == first
    assert await repository.find(None, nobodys.id) == nobodys
    assert await repository.find(None, first.id) is None
    assert await repository.find("bob", first.id) is None
    assert await repository.find_by_key("alice", "a key") == second
    assert await repository.find_by_key(None, "a key") == nobodys
    assert await repository.find_by_key("alice", "another") is None


def test_pages_begin_with_the_newest(database: Database) -> None:
    run(database, turn_pages)


async def turn_pages(repository: JobRepository) -> None:
    jobs = [new_job("alice") for _ in range(5)]
    for job in jobs:
        await repository.add(job, QUERY)
        await repository.add(new_job("bob"), QUERY)
    seen, before = [], None
    while True:
        page, before = await repository.page("alice", 2, before)
        seen.append(page)
        if before is None:
            break
    assert seen == [jobs[4:2:-1], jobs[2:0:-1], jobs[:1]]
    assert await repository.page("carol", 2, None) == ([], None)


def test_a_job_is_changed_by_whoever_knows_its_state_until_it_has_finished(
    database: Database,
) -> None:
    run(database, change_jobs)


async def change_jobs(repository: JobRepository) -> None:
    job = new_job("alice")
    await repository.add(job, QUERY)
    running = job.running(0.5)
    assert not await repository.update(running, 2)
    assert await repository.update(running, 1)
    assert not await repository.update(job.successful("late"), 1)
    assert await repository.query(job.id) == QUERY, "an end that is refused leaves the query"
    last = running.successful("a result")
    assert await repository.update(last, running.version)
    assert await repository.query(job.id) is None
    assert not await repository.update(last.dismissed(), last.version)
    assert await repository.find("alice", job.id) == last
    await repository.remove(job.id)
    assert not await repository.update(last, running.version)


def test_of_two_who_change_a_job_one_does(database: Database) -> None:
    run(database, change_together)


async def change_together(repository: JobRepository) -> None:
    job = new_job()
    await repository.add(job, QUERY)
    changed = []

    async def change(share: float) -> None:
        if await repository.update(job.running(share), job.version):
            changed.append(share)

    async with anyio.create_task_group() as tasks:
        for number in range(10):
            tasks.start_soon(change, number / 10)
    assert len(changed) == 1
    found = await repository.load(job.id)
    assert found is not None
    assert [found.progress] == changed


def test_blocks_of_one_owner_come_one_after_the_other(database: Database) -> None:
    run(database, submit_together)


async def submit_together(repository: JobRepository) -> None:
    async def add_if_first(owner: str) -> None:
        async with repository.alone(owner) as records:
            if not await records.count(owner):
                await anyio.sleep(0)
                await records.add(new_job(owner), QUERY)

    async with anyio.create_task_group() as tasks:
        for _ in range(6):
            for owner in ("alice", "bob"):
                tasks.start_soon(add_if_first, owner)
    assert await repository.count("alice") == await repository.count("bob") == 1


def test_the_query_of_a_job_is_stored_until_the_job_has_finished(database: Database) -> None:
    run(database, partial(store_queries, database))


async def store_queries(database: Database, repository: JobRepository) -> None:
    first, second, third = (new_job() for _ in range(3))
    for number, job in enumerate((first, second, third)):
        await repository.add(job, QUERY + bytes([number]))
    await repository.update(first.running(0.0), 1)
    await repository.update(second.dismissed(), 1)
    assert await repository.query(first.id) == QUERY + b"\x00"
    assert await repository.query(second.id) is None
    assert await repository.unfinished() == [first.id, third.id]

    # As if killed between the record and its query.
    record = third.dismissed().model_dump_json()
    await database.run("UPDATE jobs SET record = ? WHERE id = ?", record, third.id)
    await database.run("INSERT INTO queries VALUES (?, ?)", "of no job", b"x")
    await repository.tidy()
    assert await repository.query(first.id) == QUERY + b"\x00"
    assert await database.rows("SELECT job_id FROM queries") == [(first.id,)]


def test_jobs_of_a_database_without_queries_are_read(tmp_path: Path) -> None:
    """That of layout 6, as its last release made it."""
    anyio.run(read_older, tmp_path / "jobs.sqlite3")


async def read_older(path: Path) -> None:
    record = (
        '{"id":"1f","errand":{"owner":"alice","kind":"distances","mesh_id":"00","media_type":'
        '"text/csv","fingerprint":"ab","idempotency_key":null,"request_id":"r"},'
        '"status":"accepted","progress":0.0,"version":1,"created":"2005-07-01T12:00:00Z",'
        '"started":null,"finished":null,"problem":null,"result":null}'
    )
    with sqlite3.connect(path) as database:
        database.executescript(TABLES_OF_LAYOUT_6)
        database.execute("INSERT INTO jobs (record) VALUES (?)", (record,))
    database.close()
    async with opened(SqliteDatabase(path)) as database:
        repository = JobRepository(database)
        (job_id,) = await repository.unfinished()
        job = await repository.load(job_id)
        assert job is not None
        assert (job.id, job.spec.owner, job.runs) == ("1f", "alice", 0)
        assert await repository.find("alice", "1f") == job
        assert await repository.query(job.id) is None
        await repository.update(job.dismissed(), job.version)
        assert await repository.unfinished() == []


TABLES_OF_LAYOUT_6 = """
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    record TEXT NOT NULL,
    id TEXT UNIQUE AS (record ->> '$.id'),
    owner TEXT AS (record ->> '$.errand.owner'),
    idempotency_key TEXT AS (record ->> '$.errand.idempotency_key'),
    status TEXT AS (record ->> '$.status'),
    finished TEXT AS (record ->> '$.finished')
);
CREATE INDEX jobs_by_owner ON jobs (owner, number);
CREATE INDEX jobs_by_key ON jobs (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX jobs_by_end ON jobs (finished);
"""


def test_a_database_that_cannot_be_read_is_an_os_error(tmp_path: Path) -> None:
    (tmp_path / "jobs.sqlite3").write_bytes(b"no database" * 1000)

    with pytest.raises(OSError, match="not a database") as refusal:
        anyio.run(SqliteDatabase(tmp_path / "jobs.sqlite3").open)
    assert refusal.value.errno == errno.EIO


@contextmanager
def refused_for_want_of_room() -> Iterator[None]:
    with pytest.raises(OSError, match="disk is full") as refusal:
        yield
    assert refusal.value.errno == errno.ENOSPC


def fill(path: Path) -> None:
    """Write a file until the disk is full."""
    with path.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))


async def use_full_disk(folder: Path) -> None:
    database = SqliteDatabase(folder / "jobs.sqlite3")
    async with opened(database):
        await use(database, folder)


async def use(database: SqliteDatabase, folder: Path) -> None:
    repository = JobRepository(database)
    jobs = [new_job() for _ in range(100)]
    for job in jobs:
        await repository.add(job, bytes(10_000))
    await database.close()  # empties SQLite's log
    await database.open()
    fill(folder / "others")

    with refused_for_want_of_room():
        await repository.add(new_job(), QUERY)
    for job in jobs:
        await repository.update(job.dismissed(), job.version)
    assert await repository.count_by_status() == {"dismissed": 100}
    for job in jobs:
        await repository.remove(job.id)
    assert await repository.page(None, 1, None) == ([], None)
    with refused_for_want_of_room():
        await repository.add(new_job(), bytes(10_000))

    (folder / "jobs.reserve").unlink()
    fill(folder / "more")
    (folder / "others").unlink()
    await repository.add(new_job(), QUERY)
    assert (folder / "jobs.reserve").exists(), "there is room again"


@pytest.mark.slow
def test_on_a_full_disk_jobs_end_and_are_removed_but_none_is_accepted() -> None:
    ran = run_on_own_disk(f"{sys.executable} -m {__name__}")
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr


if __name__ == "__main__":
    anyio.run(use_full_disk, Path("/mnt"))
    sys.stdout.write("done\n")
