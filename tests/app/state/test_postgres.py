"""PostgreSQL: its tables, what is said where it cannot be used, and a server that goes away."""

import socket
import subprocess
import sys
from contextlib import aclosing, suppress
from pathlib import Path

import anyio
import pytest
from sqlalchemy import select

from app.errors import StateUnavailableError, problem_of
from app.state import Database, StateError
from app.state.mesh_records import MeshRecords
from app.state.schema import HEAD
from app.store.mesh_catalog import MeshCatalog
from app.store.store import Store
from tests.support.paths import ROOT
from tests.support.postgres import SECRET, Server

psycopg = pytest.importorskip("psycopg", reason="needs the extra cluster")

pytestmark = [pytest.mark.service, pytest.mark.file_slice(4)]

NO_FILE = Path("no file")


def refusal(url: str) -> str:
    with pytest.raises(StateError) as refused:
        Database(NO_FILE, url).prepare()
    message = str(refused.value)
    assert "GEODESIC_STATE" in message
    assert SECRET not in message
    assert "\n" not in message
    return message


def test_a_wrong_secret(postgres: Server) -> None:
    assert "password authentication failed" in refusal(postgres.url("postgres", "wrong"))


def test_a_database_that_does_not_exist(postgres: Server) -> None:
    assert 'database "nowhere" does not exist' in refusal(postgres.url("nowhere"))


def test_a_server_that_does_not_exist() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    assert "Connection refused" in refusal(f"postgresql://geodesic@127.0.0.1:{port}/state")


@pytest.mark.parametrize("rest", ["[", "host:port/x", f"u:{SECRET}@h/d?no=option"])
def test_what_is_no_url(rest: str) -> None:
    refusal(f"postgresql://{rest}")


def test_rights_that_are_missing(postgres: Server) -> None:
    url = postgres.new_database()
    name = url.rpartition("/")[2]
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute(f"CREATE ROLE reader_{name} LOGIN PASSWORD '{SECRET}'")
    assert "permission denied" in refusal(url.replace("//geodesic:", f"//reader_{name}:"))


def test_services_that_start_together_create_the_tables_once(postgres: Server) -> None:
    url = postgres.new_database()
    prepare = f"from app.state import Database; Database(None, {url!r}).prepare()"
    command = [sys.executable, "-c", prepare]
    started = [subprocess.Popen(command, cwd=ROOT) for _ in range(3)]  # noqa: S603 - this Python
    assert [each.wait() for each in started] == 3 * [0]
    with psycopg.connect(url) as connection:
        assert connection.execute("SELECT version_num FROM alembic_version").fetchall() == [(HEAD,)]


async def select_one(database: Database) -> None:
    async with database.transaction() as connection:
        assert await connection.scalar(select(1)) == 1


@pytest.mark.anyio
async def test_a_server_that_goes_away_and_comes_back(postgres: Server) -> None:
    database = Database(NO_FILE, postgres.new_database())
    database.prepare()
    await select_one(database)
    await anyio.to_thread.run_sync(postgres.stop)
    try:
        for _ in range(2):
            with pytest.raises(StateUnavailableError) as refused:
                await select_one(database)
            assert problem_of(refused.value).status == 503
    finally:
        await anyio.to_thread.run_sync(postgres.start)
    await select_one(database)
    await anyio.to_thread.run_sync(postgres.stop)  # while connections are idle
    await anyio.to_thread.run_sync(postgres.start)
    await select_one(database)
    await database.aclose()


@pytest.mark.anyio
async def test_those_who_wait_for_the_meshes_leave_connections_to_others(
    postgres: Server, tmp_path: Path
) -> None:
    """Else a replica could not accept a job while another one writes a large mesh."""
    url = postgres.new_database()
    ours, others = Database(NO_FILE, url), Database(NO_FILE, url)
    ours.prepare()
    catalog = MeshCatalog(Store(tmp_path).meshes, 2**30, evicts=True, shared=MeshRecords(ours))

    async def wait_for_meshes() -> None:
        with suppress(StateUnavailableError):  # it may take too long
            await catalog.keep_up()

    async with (
        aclosing(ours),
        aclosing(others),
        anyio.create_task_group() as tasks,
        MeshRecords(others).alone(),
    ):
        for _ in range(10):
            tasks.start_soon(wait_for_meshes)
        await anyio.sleep(0)  # they come first
        await select_one(ours)
