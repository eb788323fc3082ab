"""The records of jobs: counted by owner, and on a disk that is full, of 16 megabytes in memory."""

import errno
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import anyio
import pytest

from app.jobs.sqlite_repository import SqliteJobRepository
from tests.support.disks import run_on_own_disk
from tests.support.jobs import new_job

QUERY = b'{"sources":[{"vertex":0}]}'


def test_the_jobs_of_an_owner_are_counted_in_every_state(tmp_path: Path) -> None:
    anyio.run(count_jobs, tmp_path / "jobs.sqlite3")


async def count_jobs(path: Path) -> None:
    repository = SqliteJobRepository(path)
    await repository.open()
    mine = [new_job("alice") for _ in range(4)]
    for job in (*mine, new_job("bob"), new_job()):
        await repository.add(job, QUERY)
    assert await repository.finished() == []

    ended = [job.dismissed() for job in mine[:3]]
    for job in ended:
        await repository.update(job)
    await repository.close()
    await repository.open()
    assert await repository.count("alice") == 4
    assert await repository.finished() == ended
    await repository.remove(mine[1].id)
    assert await repository.count("alice") == 3
    assert await repository.count("bob") == await repository.count(None) == 1
    assert await repository.count("carol") == 0
    await repository.close()


def test_the_query_of_a_job_is_stored_until_the_job_has_finished(tmp_path: Path) -> None:
    anyio.run(store_queries, tmp_path / "jobs.sqlite3")


async def store_queries(path: Path) -> None:
    repository = SqliteJobRepository(path)
    await repository.open()
    first, second, third = (new_job() for _ in range(3))
    for number, job in enumerate((first, second, third)):
        await repository.add(job, QUERY + bytes([number]))
    await repository.update(first.running(0.0))
    await repository.update(second.dismissed())
    assert await repository.query(first.id) == QUERY + b"\x00"
    assert await repository.query(second.id) is None
    assert [job.id for job in await repository.unfinished()] == [first.id, third.id]
    await repository.close()

    with sqlite3.connect(path) as database:  # as if killed between the record and its query
        record = third.dismissed().model_dump_json()
        database.execute("UPDATE jobs SET record = ? WHERE id = ?", (record, third.id))
        database.execute("INSERT INTO queries VALUES ('of no job', 'x')")
    database.close()
    await repository.open()
    assert await repository.query(first.id) == QUERY + b"\x00"
    await repository.close()
    with sqlite3.connect(path) as database:
        assert database.execute("SELECT job_id FROM queries").fetchall() == [(first.id,)]
    database.close()


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
    repository = SqliteJobRepository(path)
    await repository.open()
    (job,) = await repository.unfinished()
    assert (job.id, job.spec.owner, job.runs) == ("1f", "alice", 0)
    assert await repository.query(job.id) is None
    await repository.update(job.dismissed())
    assert await repository.unfinished() == []
    await repository.close()


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
        anyio.run(SqliteJobRepository(tmp_path / "jobs.sqlite3").open)
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
    repository = SqliteJobRepository(folder / "jobs.sqlite3")
    await repository.open()
    try:
        await use(repository, folder)
    finally:
        await repository.close()


async def use(repository: SqliteJobRepository, folder: Path) -> None:
    jobs = [new_job() for _ in range(100)]
    for job in jobs:
        await repository.add(job, bytes(10_000))
    await repository.close()  # empties SQLite's log
    await repository.open()
    fill(folder / "others")

    with refused_for_want_of_room():
        await repository.add(new_job(), QUERY)
    for job in jobs:
        await repository.update(job.dismissed())
    assert await repository.count_finished() == {"dismissed": 100}
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


def test_on_a_full_disk_jobs_end_and_are_removed_but_none_is_accepted() -> None:
    ran = run_on_own_disk(f"{sys.executable} -m {__name__}")
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr


if __name__ == "__main__":
    anyio.run(use_full_disk, Path("/mnt"))
    sys.stdout.write("done\n")
