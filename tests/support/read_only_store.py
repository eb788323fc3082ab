"""A service whose disk turns read-only and back: ``python read_only_store.py`` with root's rights.

It runs in a mount namespace of its own, where ``/mnt`` is a disk that no one else sees.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.support.processes import Server
from tests.support.service import check_problem, upload_sample
from tests.support.waiting import wait_until

DISK = "/mnt"


@contextmanager
def read_only() -> Iterator[None]:
    """Have all that is opened by name on the disk find it read-only meanwhile."""
    # A disk whose files are open for writing cannot be made read-only. So it is mounted once more,
    # where nobody writes, and then moved above itself.
    with TemporaryDirectory() as aside:
        _mount("--bind", DISK, aside)
        _mount("-o", "remount,bind,ro", aside)
        _mount("--move", aside, DISK)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", DISK], check=True)  # noqa: S603, S607 - as above


def _mount(*words: str) -> None:
    subprocess.run(["mount", *words], check=True)  # noqa: S603, S607 - our own words


def check(server: Server) -> None:
    client = server.client
    mesh_id = upload_sample(client, "sphere", 80_000)
    link = f"/v1/meshes/{mesh_id}"
    body = {"sources": [{"vertex": 0}], "targets": [{"vertex": 9}]}
    before = client.post(f"{link}/distances", json=body).json()
    whole = {"sources": [{"vertex": 1}]}
    other = {"sources": [{"vertex": 2}], "targets": [{"vertex": 9}]}

    with read_only():
        assert client.get("/readyz").status_code == 200
        assert client.get(link).json()["id"] == mesh_id
        assert client.get(f"{link}/arrays/faces").status_code == 200
        assert client.post(f"{link}/distances", json=body).json() == before
        assert client.get(f"{link}/path?from=v0&to=v9").status_code == 200
        assert client.post(f"{link}/distances", json=other).status_code == 200
        check_problem(client.post(f"{link}/distances", json=whole), 507, "storage_full")
        sample = "/v1/meshes?sample=plane&faces=50"
        check_problem(client.post(sample), 507, "storage_full")
        check_problem(client.delete(link), 507, "storage_full")
        assert client.get(link).status_code == 200

    assert client.post(sample).status_code == 201
    assert client.post(f"{link}/distances", json=whole).status_code == 200
    job = client.post(f"{link}/distances", json=other, headers={"Prefer": "respond-async"})
    location = job.headers["location"]
    wait_until(lambda: client.get(location).json()["status"] == "successful")
    assert client.get(f"{location}/results").status_code == 200
    assert not any((server.store / "tmp").iterdir())


if __name__ == "__main__":
    with closing(Server(Path(DISK, "store"))) as server:
        check(server)
    sys.stdout.write("done\n")
