"""The service as a process of its own: how it ends, and what becomes of clients that leave."""

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

import geodesic_core as gc
from tests.support.meshes import named_mesh
from tests.support.processes import (
    Server,
    are_gone,
    is_running,
    parent_of,
    processor_time,
    stopped,
    total_time,
)
from tests.support.service import SLOW_FACES, upload_sample
from tests.support.waiting import LONG_S, wait_until

PATIENT = {"GEODESIC_DRAIN_S": str(10 * LONG_S), "GEODESIC_CANCEL_GRACE_S": str(10 * LONG_S)}
"""What runs at the end, and what is to stop, has longer than any test waits."""

ENDED_WELL = (0, -signal.SIGTERM)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    server = Server(tmp_path, **PATIENT)
    yield server
    server.close()


def test_workers_die_with_their_parent_however_busy(server: Server) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    workers = server.both_workers()

    with server.begin_query(mesh_id):
        server.process.kill()
        wait_until(lambda: are_gone(workers))


def test_the_process_that_workers_are_forked_from_killed(server: Server) -> None:
    """Workers go on without it; one that is killed then is forked from another; none is left."""
    workers = server.both_workers()
    os.kill(parent_of(min(workers)), signal.SIGKILL)

    mesh_id = upload_sample(server.client, "plane", 200)
    too_long = server.client.post(
        "/v1/meshes?sample=sphere&faces=2000000", headers={"X-Timeout-Ms": "200"}
    )
    assert too_long.status_code == 504, "work that can only be killed"
    wait_until(lambda: len(server.workers()) == 1)
    (survivor,) = (pid for pid in workers if is_running(pid))
    assert server.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v9").status_code == 200

    server.process.send_signal(signal.SIGTERM)
    server.process.wait(LONG_S)
    wait_until(lambda: are_gone({survivor}))


def test_a_client_that_hangs_up_stops_its_query(server: Server) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    workers = server.both_workers()
    before = total_time(workers)

    with server.begin_query(mesh_id):
        wait_until(lambda: total_time(workers) - before > 20e6)  # it has begun
        os.kill(busiest := max(workers, key=lambda pid: processor_time(pid)[10]), signal.SIGSTOP)
    wait_until(lambda: "geodesic_cancellations_total 1.0" in server.metrics())
    os.kill(busiest, signal.SIGCONT)

    wait_until(lambda: 'geodesic_workers{state="idle"} 2.0' in server.metrics())
    assert 'geodesic_solves_total{kind="distances"} 1.0' not in server.metrics()
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

    assert server.process.wait(LONG_S) in ENDED_WELL
    assert are_gone(workers)


def test_what_runs_when_the_service_is_to_stop_ends_well_and_all_else_is_refused(
    server: Server,
) -> None:
    mesh_id = upload_sample(server.client, "plane", 200)
    with stopped(server.both_workers()):
        running = server.begin_query(mesh_id)
        server.process.send_signal(signal.SIGTERM)
        wait_until(lambda: not server.listens())
        assert server.process.poll() is None

    with running:
        assert running.recv(20).startswith(b"HTTP/1.1 200")
    assert server.process.wait(LONG_S) in ENDED_WELL


ASYNC = {"Prefer": "respond-async"}


def submit(server: Server, mesh_id: str, source: int = 0) -> str:
    query = {"sources": [{"vertex": source}], "targets": [{"vertex": 1}]}
    asked = server.client.post(f"/v1/meshes/{mesh_id}/distances", json=query, headers=ASYNC)
    assert asked.status_code == 202
    return str(asked.headers["location"])


def status_of(server: Server, job: str) -> str:
    return str(server.client.get(job).json()["status"])


def test_jobs_survive_a_restart(tmp_path: Path) -> None:
    """One that had finished has its answer still, one that ran says why it failed."""
    first = Server(tmp_path)
    mesh_id = upload_sample(first.client, "plane", 200)
    done = submit(first, mesh_id)
    wait_until(lambda: status_of(first, done) == "successful")
    answer = first.client.get(f"{done}/results").json()
    with stopped(first.both_workers()):
        lost = submit(first, mesh_id, 5)
        wait_until(lambda: status_of(first, lost) == "running")
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
        again = submit(second, mesh_id, 5)
        wait_until(lambda: status_of(second, again) == "successful")
    finally:
        second.close()


def test_who_watches_a_job_does_not_keep_the_service_from_stopping(server: Server) -> None:
    mesh_id = upload_sample(server.client, "plane", 200)
    with stopped(server.both_workers()):
        job = submit(server, mesh_id)
        with server.client.stream("GET", f"{job}/events") as events:
            lines = events.iter_lines()
            next(lines)
            server.process.send_signal(signal.SIGTERM)

            assert server.process.wait(LONG_S) in ENDED_WELL
            assert not any('"status": "failed"' in line for line in lines), "it is still to be told"


@pytest.mark.parametrize("name", ["rough_scan", "horse97k.ply"])
def test_exact_distances_of_a_scan(server: Server, name: str) -> None:
    mesh = named_mesh(name)
    arrays = {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}
    report = server.client.post("/v1/meshes", json=arrays).json()
    assert (report["vertices"], report["faces"]) == (len(mesh.vertices), len(mesh.faces))

    query = {"sources": [{"vertex": 0}]}
    answer = server.client.post(f"/v1/meshes/{report['id']}/distances", json=query).json()

    assert answer["distances"] == gc.exact_distance(mesh, 0).distances.tolist()
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    path = server.client.get(f"/v1/meshes/{report['id']}/path?from=v0&to=v99").json()
    assert path["length"] == pytest.approx(answer["distances"][99], rel=1e-10)
