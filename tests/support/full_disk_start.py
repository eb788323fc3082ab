"""Starts of a service on a full disk: ``python full_disk_start.py``, where ``/mnt`` is its own."""

import os
import sqlite3
import subprocess
import sys
from contextlib import closing, suppress
from pathlib import Path

from tests.app.jobs.test_repository import TABLES_OF_LAYOUT_6
from tests.support.processes import COMMAND_LINE, Server
from tests.support.service import check_problem, upload_sample
from tests.support.waiting import wait_until

STORE = Path("/mnt/store")
FILLER = Path("/mnt/filler")
ASYNC = {"Prefer": "respond-async"}


def fill() -> None:
    """Write a file until not a byte is left."""
    with FILLER.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))


def submit(server: Server, link: str) -> str:
    query = {"sources": [{"vertex": 0}]}
    response = server.client.post(f"{link}/distances", json=query, headers=ASYNC)
    assert response.status_code == 202, response.text
    return str(response.headers["location"])


def check_start_of_an_older_store() -> None:
    """Start after an upgrade: it is refused in one line, and nothing has changed."""
    (STORE / "VERSION").write_text("6\n")
    database = STORE / "jobs.sqlite3"
    records = read(database)
    database.unlink()
    with closing(sqlite3.connect(database)) as older:
        older.executescript(TABLES_OF_LAYOUT_6)
        older.executemany("INSERT INTO jobs (record) VALUES (?)", records)
        older.commit()
    fill()
    ran = subprocess.run(  # noqa: S603 - this Python
        [*COMMAND_LINE, "serve", "--port", "0"],
        env=os.environ | {"GEODESIC_STORE": str(STORE)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert "cannot be brought up to date: No space left on device" in ran.stderr
    assert "Traceback" not in ran.stderr
    assert (STORE / "VERSION").read_text() == "6\n"
    assert read(database) == records


def read(database: Path) -> list[tuple[str]]:
    with closing(sqlite3.connect(f"{database.as_uri()}?immutable=1", uri=True)) as connection:
        return connection.execute("SELECT record FROM jobs ORDER BY number").fetchall()


def check_start_without_a_table() -> None:
    """Start as if the first start after an upgrade had been killed; jobs can be removed."""
    with closing(sqlite3.connect(STORE / "jobs.sqlite3")) as database:
        database.execute("DROP TABLE queries")
    fill()
    with closing(Server(STORE)) as server:
        (job, *others) = server.client.get("/v1/jobs").json()["jobs"]
        link = f"/v1/meshes/{job['mesh_id']}"
        assert server.client.get(job["links"]["results"]).status_code == 200
        assert server.client.delete(f"/v1/jobs/{job['id']}").status_code == 200
        assert server.client.get("/v1/jobs").json()["jobs"] == others
        sample = {"sample": "plane", "faces": 20_000}
        check_problem(server.client.post("/v1/meshes", params=sample), 507, "storage_full")
        FILLER.unlink()
        assert server.client.post("/v1/meshes", params=sample).status_code == 201
        submit(server, link)
        assert (STORE / "jobs.reserve").exists()
        end(server)


def end(server: Server) -> None:
    server.process.terminate()
    server.process.wait()


def main() -> None:
    with closing(Server(STORE)) as server:
        link = f"/v1/meshes/{upload_sample(server.client, 'plane', 200)}"
        for _ in range(3):
            job = submit(server, link)
            wait_until(lambda job=job: server.client.get(job).json()["status"] == "successful")
        end(server)
    check_start_without_a_table()
    check_start_of_an_older_store()


if __name__ == "__main__":
    main()
    sys.stdout.write("done\n")
