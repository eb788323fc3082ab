"""A start of a service on a full disk: ``python full_disk_start.py``, where ``/mnt`` is its own."""

import os
import subprocess
import sys
from contextlib import closing, suppress
from pathlib import Path

from tests.support.processes import COMMAND_LINE, Server
from tests.support.service import upload_sample
from tests.support.waiting import wait_until

STORE = Path("/mnt/store")
FILLER = Path("/mnt/filler")


def fill() -> None:
    """Write a file until not a byte is left."""
    with FILLER.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))


def submit(server: Server, link: str) -> str:
    query = {"sources": [{"vertex": 0}]}
    headers = {"Prefer": "respond-async"}
    response = server.client.post(f"{link}/distances", json=query, headers=headers)
    assert response.status_code == 202, response.text
    return str(response.headers["location"])


def end(server: Server) -> None:
    server.process.terminate()
    server.process.wait()


def main() -> None:
    with closing(Server(STORE)) as server:
        link = f"/v1/meshes/{upload_sample(server.client, 'plane', 200)}"
        job = submit(server, link)
        wait_until(lambda: server.client.get(job).json()["status"] == "successful")
        before = server.client.get("/v1/jobs").json()
        end(server)
    fill()
    ran = subprocess.run(  # noqa: S603 - this Python
        [*COMMAND_LINE, "serve", "--port", "0"],
        env=os.environ | {"GEODESIC_STORE": str(STORE)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert "jobs.sqlite3 cannot be used: " in ran.stderr
    assert "Traceback" not in ran.stderr
    FILLER.unlink()
    with closing(Server(STORE)) as server:
        assert server.client.get("/v1/jobs").json() == before
        assert server.client.get(f"{job}/results").status_code == 200
        submit(server, link)
        end(server)


if __name__ == "__main__":
    main()
    sys.stdout.write("done\n")
