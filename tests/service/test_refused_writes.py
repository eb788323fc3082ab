"""Disks that refuse writes: full at the start, or all at once while files are open."""

import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.jobs import read_jobs
from app.state import Database
from tests.support.disks import run_on_own_disk
from tests.support.processes import Server, stopped
from tests.support.service import check_problem, upload_sample
from tests.support.waiting import LONG_S, wait_until

pytestmark = pytest.mark.file_slice(1)

ASYNC = {"Prefer": "respond-async"}


def test_a_start_on_a_full_disk() -> None:
    """It is refused in one line, and nothing is lost."""
    command = f"{sys.executable} -m tests.support.full_disk_start"
    ran = run_on_own_disk(command, megabytes=64)
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr


@contextmanager
def writing_refused(pid: int) -> Iterator[None]:
    """Have the system refuse all that a process writes to files, those that are open included.

    The number of the error is one that SQLite does not tell apart.
    """
    _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, most))
    try:
        yield
    finally:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (most, most))


def submit(server: Server, mesh_id: str, source: int) -> Any:
    query = {"sources": [{"vertex": source}]}
    return server.client.post(f"/v1/meshes/{mesh_id}/distances", json=query, headers=ASYNC)


def test_the_database_of_jobs_cannot_be_written_for_a_while(tmp_path: Path) -> None:
    database = Database(tmp_path / "jobs.sqlite3")
    with closing(Server(tmp_path)) as server:
        mesh_id = upload_sample(server.client, "sphere", 20_000)
        done = submit(server, mesh_id, 0).headers["location"]
        get = lambda job: server.client.get(job).json()["status"]  # noqa: E731
        wait_until(lambda: get(done) == "successful")
        wait_until(lambda: read_jobs(database)[0].is_finished)
        with stopped(server.both_workers()):
            running = submit(server, mesh_id, 1).headers["location"]
            with writing_refused(server.process.pid):
                check_problem(submit(server, mesh_id, 2), 507, "storage_full")
                check_problem(server.client.delete(done), 507, "storage_full")
                assert server.client.get(f"{done}/results").status_code == 200
                check_problem(server.client.post(f"{running}/cancel"), 507, "storage_full")
                assert get(running) == "accepted"
                assert not read_jobs(database)[1].is_finished
            assert server.client.post(f"{running}/cancel").json()["status"] == "dismissed"
        assert submit(server, mesh_id, 2).status_code == 202
        assert server.client.delete(done).status_code == 200
        server.process.send_signal(signal.SIGTERM)
        server.process.wait(LONG_S)

    dismissed, _ = read_jobs(database)
    assert (f"/v1/jobs/{dismissed.id}", dismissed.status) == (running, "dismissed")
