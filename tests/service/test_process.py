"""The service as a process of its own: how it ends, and what becomes of clients that leave."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from tests.service.test_engine import SLOW_FACES
from tests.support.paths import ROOT
from tests.support.service import is_ready, processor_time, upload_sample, wait_until

SERVE = "from app.cli import main; main()"


class Server:
    def __init__(self, store: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        environment = os.environ | {"GEODESIC_STORE": str(store), "GEODESIC_WORKERS": "1"}
        self.process = subprocess.Popen(  # noqa: S603 - this Python, and the text above
            [sys.executable, "-c", SERVE, "serve", "--port", str(port)],
            env=environment,
            cwd=ROOT,
        )
        self.address = ("127.0.0.1", port)
        self.client = httpx2.Client(base_url=f"http://127.0.0.1:{port}", timeout=60)
        wait_until(self.listens)
        wait_until(lambda: is_ready(self.client))

    def listens(self) -> bool:
        try:
            return bool(self.client.get("/livez").status_code == 200)
        except httpx2.TransportError:
            return False

    def workers(self) -> set[int]:
        """Ids of the worker processes: those that the process forks which this one keeps for it."""
        found = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    is_worker = (entry / "cmdline").read_bytes().startswith(b"geodesic-worker")
                    forker = parent_of(int(entry.name))
                    if is_worker and parent_of(forker) == self.process.pid:
                        found.add(int(entry.name))
                except (FileNotFoundError, ProcessLookupError):
                    continue
        return found

    def begin_slow_query(self, mesh_id: str) -> socket.socket:
        body = b'{"sources": [{"vertex": 0}], "targets": [{"vertex": 1}]}'
        head = (
            f"POST /v1/meshes/{mesh_id}/distances HTTP/1.1\r\nHost: x\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        connection = socket.create_connection(self.address)
        connection.sendall(head.encode() + body)
        time.sleep(0.5)
        return connection

    def close(self) -> None:
        self.client.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    server = Server(tmp_path)
    yield server
    server.close()


def are_gone(pids: set[int]) -> bool:
    return not any(is_running(pid) for pid in pids)


def is_running(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_workers_die_with_their_parent_however_busy(server: Server) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    wait_until(lambda: len(server.workers()) == 2)
    workers = server.workers()

    with server.begin_slow_query(mesh_id):
        server.process.kill()
        wait_until(lambda: are_gone(workers), seconds=2)


def test_the_process_that_workers_are_forked_from_killed(server: Server) -> None:
    """Workers go on without it; one that is killed then is forked from another; none is left."""
    wait_until(lambda: len(server.workers()) == 2)
    workers = server.workers()
    os.kill(parent_of(min(workers)), signal.SIGKILL)

    mesh_id = upload_sample(server.client, "plane", 200)
    too_long = server.client.post(
        "/v1/meshes?sample=sphere&faces=2000000", headers={"X-Timeout-Ms": "200"}
    )
    assert too_long.status_code == 504, "work that can only be killed"
    wait_until(lambda: len(server.workers()) == 1)
    (kept,) = (pid for pid in workers if is_running(pid))
    assert server.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v9").status_code == 200

    server.process.send_signal(signal.SIGTERM)
    server.process.wait(5)
    wait_until(lambda: are_gone({kept}))


def test_a_client_that_hangs_up_stops_its_query(server: Server) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    wait_until(lambda: len(server.workers()) == 2)
    workers = server.workers()

    def taken() -> int:
        return sum(processor_time(pid).total() for pid in workers)

    def metrics() -> list[str]:
        return server.client.get("/metrics").text.splitlines()

    before, other = taken(), {"sources": [{"vertex": 2}], "targets": [{"vertex": 1}]}
    assert server.client.post(f"/v1/meshes/{mesh_id}/distances", json=other).status_code == 200
    whole = taken() - before

    server.begin_slow_query(mesh_id).close()
    before = taken()

    wait_until(lambda: "geodesic_cancellations_total 1.0" in metrics())
    wait_until(lambda: 'geodesic_workers{state="idle"} 2.0' in metrics())
    assert taken() - before < whole / 4
    assert 'geodesic_solves_total{kind="distances"} 1.0' in metrics()
    assert server.workers() == workers


def test_a_client_that_hangs_up_while_it_uploads(server: Server, tmp_path: Path) -> None:
    with socket.create_connection(server.address) as connection:
        connection.sendall(
            b"POST /v1/meshes?format=obj HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\nv 0 0 0"
        )
        wait_until(lambda: any((tmp_path / "tmp").iterdir()))

    wait_until(lambda: not any((tmp_path / "tmp").iterdir()))
    assert server.listens()


def test_ends_in_good_order(server: Server) -> None:
    workers = server.workers()

    server.process.send_signal(signal.SIGTERM)

    assert server.process.wait(5) in (0, -signal.SIGTERM)
    assert are_gone(workers)


def test_what_runs_when_the_service_is_to_stop_ends_well_and_all_else_is_refused(
    server: Server,
) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    with server.begin_slow_query(mesh_id) as running:
        server.process.send_signal(signal.SIGTERM)
        answer = running.recv(20)

    assert answer.startswith(b"HTTP/1.1 200")
    assert server.process.wait(5) in (0, -signal.SIGTERM)


ASYNC = {"Prefer": "respond-async"}
SLOW_QUERY = {"sources": [{"vertex": 0}], "targets": [{"vertex": 1}]}


def submit(server: Server, mesh_id: str) -> str:
    asked = server.client.post(f"/v1/meshes/{mesh_id}/distances", json=SLOW_QUERY, headers=ASYNC)
    assert asked.status_code == 202
    return str(asked.headers["location"])


def test_jobs_survive_a_restart(tmp_path: Path) -> None:
    """One that had finished has its answer still, one that ran says why it failed."""
    first = Server(tmp_path)
    small = upload_sample(first.client, "plane", 200)
    slow = upload_sample(first.client, "sphere", SLOW_FACES)
    done, lost = submit(first, small), submit(first, slow)
    wait_until(lambda: first.client.get(done).json()["status"] == "successful")
    answer = first.client.get(f"{done}/results").json()
    assert first.client.get(lost).json()["status"] == "running"
    first.process.kill()
    first.close()

    second = Server(tmp_path)
    try:
        assert second.client.get(f"{done}/results").json() == answer
        job = second.client.get(lost).json()
        assert job["status"] == "failed"
        assert job["problem"]["code"] == "engine_unavailable"
        assert job["problem"]["hint"] == "send the query again"
        response = second.client.get(f"{lost}/results")
        assert (response.status_code, response.json()["code"]) == (503, "engine_unavailable")
        again = submit(second, slow)
        wait_until(lambda: second.client.get(again).json()["status"] == "successful")
    finally:
        second.close()


def test_who_watches_a_job_does_not_keep_the_service_from_stopping(server: Server) -> None:
    job = submit(server, upload_sample(server.client, "sphere", 4 * SLOW_FACES))
    with server.client.stream("GET", f"{job}/events") as events:
        lines = events.iter_lines()
        next(lines)
        server.process.send_signal(signal.SIGTERM)

        assert server.process.wait(5) in (0, -signal.SIGTERM)
        assert not any('"status": "failed"' in line for line in lines), "it is still to be told"


def test_exact_distances_of_a_real_mesh(server: Server, horse: bytes) -> None:
    report = server.client.post("/v1/meshes", params={"format": "ply"}, content=horse).json()
    assert (report["vertices"], report["faces"]) == (48485, 96966)

    query = {"sources": [{"vertex": 0}]}
    answer = server.client.post(f"/v1/meshes/{report['id']}/distances", json=query).json()

    assert len(answer["distances"]) == 48485
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    path = server.client.get(f"/v1/meshes/{report['id']}/path?from=v0&to=v99").json()
    assert path["length"] == pytest.approx(answer["distances"][99], rel=1e-10)
