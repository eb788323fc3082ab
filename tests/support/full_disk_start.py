"""Starts of a service on a full disk: ``python full_disk_start.py``, where ``/mnt`` is its own."""

import sqlite3
import sys
from contextlib import closing, suppress
from pathlib import Path

from tests.support.processes import Server
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


if __name__ == "__main__":
    main()
    sys.stdout.write("done\n")
