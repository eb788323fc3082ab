"""Promises of both databases, and files of SQLite that are older, damaged or full."""

import asyncio
import errno
import resource
import sqlite3
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing, suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, insert, select, text

from app.jobs import JobRepository, read_jobs
from app.state import Database, StateError, migrations
from app.state.schema import HEAD, metadata, queries
from tests.support.jobs import new_job

pytestmark = pytest.mark.anyio

OLDER_FILE = Path(__file__).with_name("before_alembic.sql")
"""A file as it was then: three jobs, of which the first has finished, and the last runs"""


async def test_blocks_with_one_lock_never_overlap(database: Database) -> None:
    inside: list[int] = []

    async def enter_twice(number: int) -> None:
        for _ in range(2):
            async with database.transaction("a name"):
                inside.append(number)
                assert inside == [number]
                await asyncio.sleep(0)
                inside.remove(number)

    await asyncio.gather(*map(enter_twice, range(3)))


async def test_a_transaction_that_fails_or_is_cancelled_leaves_nothing(database: Database) -> None:
    has_changed = asyncio.Event()

    async def change(error: BaseException | None) -> None:
        async with database.transaction() as connection:
            await connection.execute(insert(queries).values(job_id="x", query=b""))
            has_changed.set()
            if error is not None:
                raise error
            await asyncio.Event().wait()

    with suppress(KeyError):
        await change(KeyError())
    has_changed.clear()
    task = asyncio.create_task(change(None))
    await has_changed.wait()
    task.cancel()
    await asyncio.wait({task})
    async with database.transaction() as connection:
        assert (await connection.execute(select(queries))).all() == []


async def test_transactions_cancelled_at_any_moment_leave_the_connections_to_others(
    database: Database,
) -> None:
    """While they wait for a connection, while they have one, and between; in any order."""
    random = Random(1)

    async def look() -> None:
        async with database.transaction() as connection:
            await connection.execute(select(queries))
            await asyncio.sleep(0)

    for _ in range(40):
        tasks = [asyncio.create_task(look()) for _ in range(12)]
        for _ in range(random.randrange(40)):
            await asyncio.sleep(random.choice((0.0, 0.0, 1e-3 * random.random())))
            random.choice(tasks).cancel()
        found = await asyncio.gather(*tasks, return_exceptions=True)
        assert {type(each) for each in found} <= {type(None), asyncio.CancelledError}
    await look()


def differences(connection: Connection) -> list[Any]:
    """Return which tables, columns and indexes differ from the schema; SQLite has no more."""
    found = compare_metadata(MigrationContext.configure(connection), metadata)
    return [each for each in found if isinstance(each, tuple)]


async def test_revisions_lead_to_the_tables_of_the_schema(
    database: Database, state_url: str | None, tmp_path: Path
) -> None:
    async with database.transaction() as connection:
        assert await connection.run_sync(differences) == []
        await connection.execute(text("DROP INDEX jobs_by_key"))
        await connection.execute(text("CREATE INDEX jobs_of_key ON jobs (status)"))
        for table in ("jobs", "meshes"):
            await connection.execute(text(f"ALTER TABLE {table} ADD COLUMN owner TEXT"))
        await connection.execute(text("CREATE TABLE rates (caller TEXT PRIMARY KEY)"))
        await connection.execute(text("UPDATE alembic_version SET version_num = '0002'"))
        assert await connection.run_sync(differences) != []
    Database(tmp_path / "jobs.sqlite3", state_url).prepare()
    async with database.transaction() as connection:
        assert await connection.run_sync(differences) == []
    scripts = ScriptDirectory(str(Path(migrations.__file__).parent))
    assert scripts.get_current_head() == HEAD


async def test_the_tables_of_a_newer_release_are_refused(
    database: Database, state_url: str | None, tmp_path: Path
) -> None:
    async with database.transaction() as connection:
        await connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(StateError, match="newer release"):
        Database(tmp_path / "jobs.sqlite3", state_url).prepare()


async def test_a_file_of_the_release_before_alembic(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite3"
    with closing(sqlite3.connect(path)) as older:
        older.executescript(OLDER_FILE.read_text())
    database, repository = Database(path), JobRepository(Database(path))
    database.prepare()
    done, waiting, running = read_jobs(database)
    assert (done.result, running.progress, waiting.status) == ("m/a", 0.5, "accepted")
    assert await repository.unfinished() == [waiting.id, running.id]
    assert await repository.load_with_query(waiting.id) == (waiting, b'{"sources":[0]}')
    assert await repository.add(new_job("alice", "a key"), b"") == done
    last = running.dismissed()
    assert await repository.update(last, running.version)
    assert await repository.load_with_query(running.id) == (last, None)
    async with repository._database.transaction() as connection:
        assert await connection.run_sync(differences) == []
    await repository._database.aclose()


async def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    database = Database(tmp_path / "jobs.sqlite3")
    (tmp_path / "jobs.sqlite3").write_bytes(b"no database" * 1000)
    for use in (database.prepare, lambda: read_jobs(database)):
        with pytest.raises(StateError, match=r"jobs.sqlite3 is damaged .*: move it away"):
            use()
    with pytest.raises(OSError, match="not a database") as refused:
        await JobRepository(database).unfinished()
    assert refused.value.errno == errno.EIO
    await database.aclose()


@asynccontextmanager
async def refusing(database: Database, statement: str | None) -> AsyncIterator[None]:
    """Have SQLite, or for None the system, refuse to let the file grow or change."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    if statement is None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    else:
        async with database.transaction() as connection:
            await connection.exec_driver_sql(statement)
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    await database.aclose()  # what SQLite was told goes with its connection


@pytest.mark.parametrize(
    ("statement", "number"),
    [
        ("PRAGMA max_page_count = 1", errno.ENOSPC),
        ("PRAGMA query_only = ON", errno.EROFS),
        (None, errno.ENOSPC),
    ],
)
async def test_a_disk_that_refuses_changes_loses_no_job(
    tmp_path: Path, statement: str | None, number: int
) -> None:
    database = Database(tmp_path / "jobs.sqlite3")
    database.prepare()
    repository, job = JobRepository(database), new_job()
    await repository.add(job, b"a query")
    async with refusing(database, statement):
        for _ in range(2):
            with pytest.raises(OSError) as refused:  # noqa: PT011 - its number is checked
                await repository.add(new_job(), bytes(100_000))
            assert refused.value.errno == number
        assert await repository.unfinished() == [job.id]
        assert await repository.load_with_query(job.id) == (job, b"a query")
    assert read_jobs(database) == [job]
    assert await repository.update(job.dismissed(), job.version)
    await database.aclose()
