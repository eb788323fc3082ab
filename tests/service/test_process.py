"""The service as a process of its own: clients that leave, restarts, and how it ends."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from select import select
from typing import Any

import httpx2
import pytest

import geodesic_core as gc
from app.settings import MIB
from app.store.layout import StoreError
from app.store.meshes import MeshStore
from app.store.ownership import owned
from tests.support.listening import read_answer
from tests.support.meshes import named_mesh, real_mesh
from tests.support.processes import (
    Server,
    are_gone,
    compilers_of,
    parent_of,
    processor_time,
    stopped,
    total_time,
)
from tests.support.service import SLOW_FACES, upload_sample
from tests.support.waiting import LONG_S, wait_until

pytestmark = pytest.mark.file_slice(4)

PATIENT = {"GEODESIC_DRAIN_S": str(10 * LONG_S), "GEODESIC_CANCEL_GRACE_S": str(10 * LONG_S)}
"""What runs at the end, and what is to stop, has longer than any test waits."""

PLY = {"Content-Type": "model/ply"}

LARGE_FACES = 60_000
"""No small work: all of it waits for the same worker"""

ENDED_WELL = (0, -signal.SIGTERM)


@pytest.fixture(scope="module")
def started() -> Iterator[list[Server]]:
    """The services that were started for these tests, the latest one last."""
    servers: list[Server] = []
    yield servers
    for server in servers:
        server.close()


def latest_server(started: list[Server], stores: pytest.TempPathFactory) -> Server:
    """Return the latest service, or a new one where that has ended: a start takes 3 s."""
    if not started or not started[-1].listens():
        started.append(Server(stores.mktemp("store"), **PATIENT))
    return started[-1]


@pytest.fixture
def server(started: list[Server], tmp_path_factory: pytest.TempPathFactory) -> Server:
    """A service that runs: that of the test before, unless it has ended."""
    return latest_server(started, tmp_path_factory)


# It goes on


def test_a_client_that_hangs_up_stops_its_query(server: Server) -> None:
    cancelled, solved = "geodesic_cancellations_total", 'geodesic_solves_total{kind="distances"}'
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    workers = server.both_workers()
    before, metrics = total_time(workers), [server.metric(name) for name in (cancelled, solved)]

    with server.begin_query(mesh_id) as connection:
        wait_until(lambda: total_time(workers) - before > 20e6)  # it has begun
        with stopped([max(workers, key=lambda pid: processor_time(pid)[10])]):
            connection.close()
            wait_until(lambda: server.metric(cancelled) == metrics[0] + 1)

    wait_until(lambda: server.metric('geodesic_workers{state="idle"}') == 2)
    assert server.metric(solved) == metrics[1]
    assert server.workers() == workers


def test_a_client_that_hangs_up_while_it_uploads(server: Server) -> None:
    with server.connect("/v1/meshes?format=obj", b"v 0 0 0\n" * 100, leave_out=9):
        wait_until(lambda: any((server.store / "tmp").iterdir()))

    wait_until(lambda: not any((server.store / "tmp").iterdir()))
    assert server.listens()


def test_a_worker_is_killed_while_it_writes_a_mesh(server: Server) -> None:
    meshes = server.client.get("/v1/meshes").json()

    while (answer := _answer_of_killed_workers(server)).status_code == 201:
        # The mesh was complete before they were killed.
        server.client.delete(f"/v1/meshes/{answer.json()['id']}")

    assert (answer.status_code, answer.json()["code"]) == (500, "worker_died")
    wait_until(lambda: not any((server.store / "tmp").iterdir()))
    assert server.client.get("/v1/meshes").json() == meshes


def _answer_of_killed_workers(server: Server) -> httpx2.Response:
    """Have a mesh made, kill the workers once its files are being written; return the answer."""
    workers = server.both_workers()
    with server.connect("/v1/meshes?sample=sphere&faces=400000", b"") as connection:
        files = (server.store / "tmp").glob
        wait_until(lambda: any(files("*/mesh/*")) or select([connection], [], [], 0)[0])
        for pid in workers:
            os.kill(pid, signal.SIGKILL)
        return read_answer(connection)


@pytest.mark.parametrize("name", ["rough_scan", "horse97k.ply"])
def test_exact_distances_of_a_scan(server: Server, name: str) -> None:
    mesh = named_mesh(name)
    if name.endswith(".ply"):
        upload: dict[str, Any] = {"content": real_mesh(name).read_bytes(), "headers": PLY}
    else:
        upload = {"json": {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}}
    report = server.client.post("/v1/meshes", **upload).json()
    assert (report["vertices"], report["faces"]) == (len(mesh.vertices), len(mesh.faces))

    link, query = f"/v1/meshes/{report['id']}", {"sources": [{"vertex": 0}]}
    answer = server.client.post(f"{link}/distances", json=query).json()

    assert answer["distances"] == gc.exact_distance(mesh, 0).distances.tolist()
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    path = server.client.get(f"{link}/path?from=v0&to=v99").json()
    assert path["length"] == pytest.approx(answer["distances"][99], rel=1e-10)


# It starts again


ASYNC = {"Prefer": "respond-async"}


def submit(server: Server, mesh_id: str, source: int = 0) -> str:
    query = {"sources": [{"vertex": source}], "targets": [{"vertex": 1}]}
    response = server.client.post(f"/v1/meshes/{mesh_id}/distances", json=query, headers=ASYNC)
    assert response.status_code == 202
    return str(response.headers["location"])


def status_of(server: Server, job: str) -> str:
    return str(server.client.get(job).json()["status"])


def events_of(server: Server, job: str, seen: int | None = None) -> Iterator[tuple[int, Any]]:
    """Yield id and document of each event of a job, but for those up to ``seen``."""
    headers = {} if seen is None else {"Last-Event-ID": str(seen)}
    with server.client.stream("GET", f"{job}/events", headers=headers) as events:
        document = None
        for line in events.iter_lines():
            field, _, value = line.partition(": ")
            if field == "data":
                document = json.loads(value)
            elif field == "id":
                yield int(value), document


@dataclass
class Restart:
    """What a service was doing when it was killed, and the one that was started on its store."""

    meshes: Any
    done: str
    """A job that had finished"""
    answer: Any
    interrupted: str
    """A job that ran"""
    seen: int
    """Id of the last event of that job which a client saw"""
    waiting: str
    """A job that waited for the same worker"""
    server: Server


@pytest.fixture(scope="module")
def restart(started: list[Server], tmp_path_factory: pytest.TempPathFactory) -> Restart:
    """Kill a service while a body arrives and a job keeps a worker busy, and start another."""
    first = latest_server(started, tmp_path_factory)
    small, large = (
        upload_sample(first.client, name, faces)
        for name, faces in (("plane", 200), ("sphere", LARGE_FACES))
    )
    meshes = first.client.get("/v1/meshes").json()
    done = submit(first, small)
    wait_until(lambda: status_of(first, done) == "successful")
    answer = first.client.get(f"{done}/results").json()
    workers = first.both_workers()
    with first.connect("/v1/meshes?format=obj", b"v 0 0 0\n" * (MIB // 4), leave_out=9):
        wait_until(lambda: any(first.store.glob("tmp/*/upload")))
        with pytest.raises(StoreError, match="in use by another process"):
            owned(first.store).__enter__()
        with stopped(workers):
            interrupted = submit(first, large, 5)
            wait_until(lambda: status_of(first, interrupted) == "running")
            waiting = submit(first, large, 6)
            assert status_of(first, waiting) == "accepted"
            ((seen, state),) = islice(events_of(first, interrupted), 1)
            assert state["status"] == "running"
            first.kill()
    wait_until(lambda: are_gone(workers))  # however busy they are
    assert any(first.store.glob("tmp/*/upload"))
    started.append(Server(first.store, **PATIENT))
    return Restart(meshes, done, answer, interrupted, seen, waiting, started[-1])


def test_a_body_that_arrived_when_the_service_was_killed_is_removed(restart: Restart) -> None:
    store = restart.server.store

    assert list((store / "tmp").iterdir()) == []
    assert restart.server.client.get("/v1/meshes").json() == restart.meshes
    for mesh in restart.meshes["meshes"]:
        assert not any(MeshStore(store).inspect(mesh["id"]))


def test_a_job_that_had_finished_has_its_answer_after_a_restart(restart: Restart) -> None:
    assert restart.server.client.get(f"{restart.done}/results").json() == restart.answer


def test_jobs_that_were_under_way_are_run_again_after_a_restart(restart: Restart) -> None:
    mesh = gc.samples.sphere(LARGE_FACES)
    for job, source in ((restart.interrupted, 5), (restart.waiting, 6)):
        wait_until(lambda job=job: status_of(restart.server, job) == "successful")
        answer = restart.server.client.get(f"{job}/results").json()
        assert answer["distances"] == [gc.exact_distance(mesh, source).distances[1]]


def test_a_client_that_watched_a_job_goes_on_after_a_restart(restart: Restart) -> None:
    """It sees the job accepted again or further, once each state, and its end."""
    events = list(events_of(restart.server, restart.interrupted, restart.seen))

    ids = [number for number, _ in events]
    assert ids == sorted(set(ids))
    assert ids[0] > restart.seen
    assert events[-1][1] == restart.server.client.get(restart.interrupted).json()
    assert events[-1][1]["status"] == "successful"
    last = ids[-1]
    assert list(events_of(restart.server, restart.interrupted, last)) == []
    assert [number for number, _ in events_of(restart.server, restart.interrupted)] == [last]


# It ends


def test_ends_in_good_order(server: Server) -> None:
    workers = server.workers()

    server.process.send_signal(signal.SIGTERM)

    assert server.process.wait(LONG_S) in ENDED_WELL
    assert are_gone(workers)


def test_the_process_that_workers_are_forked_from_killed(server: Server) -> None:
    """Workers go on without it; one that is killed then is forked from another; none is left."""
    workers = server.both_workers()
    os.kill(parent_of(min(workers)), signal.SIGKILL)

    mesh_id = upload_sample(server.client, "plane", 200)
    survivor, victim = sorted(workers)
    os.kill(victim, signal.SIGKILL)
    wait_until(lambda: len(server.workers()) == 1)
    assert server.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v9").status_code == 200

    server.process.send_signal(signal.SIGTERM)
    assert server.process.wait(LONG_S) in ENDED_WELL
    wait_until(lambda: are_gone({survivor}))


def test_what_runs_when_the_service_is_to_stop_ends_well_and_all_else_is_refused(
    server: Server,
) -> None:
    mesh_id = upload_sample(server.client, "plane", 200)
    link, body = f"/v1/meshes/{mesh_id}/distances", b'{"sources": [{"vertex": 3}]}'
    with server.connect(link, body, leave_out=9) as arriving, stopped(server.both_workers()):
        running = server.begin_query(mesh_id)
        server.process.send_signal(signal.SIGTERM)
        wait_until(lambda: not server.listens())
        arriving.sendall(body[-9:])
        refusal = b"".join(iter(lambda: arriving.recv(65536), b""))
        assert server.process.poll() is None

    assert refusal.startswith(b"HTTP/1.1 503")
    assert b'"code":"draining"' in refusal
    with running:
        assert running.recv(20).startswith(b"HTTP/1.1 200")
    assert server.process.wait(LONG_S) in ENDED_WELL


def test_what_takes_too_long_when_the_service_is_to_stop_is_told_so(tmp_path: Path) -> None:
    with closing(Server(tmp_path, GEODESIC_DRAIN_S="1")) as server:
        mesh_id = upload_sample(server.client, "plane", 200)
        with stopped(server.both_workers()), server.begin_query(mesh_id) as running:
            server.process.send_signal(signal.SIGTERM)
            answer = b"".join(iter(lambda: running.recv(65536), b""))
        assert server.process.wait(LONG_S) in ENDED_WELL
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 503")
    assert b"retry-after: 1" in head.lower()
    assert b'"code":"draining"' in body


@pytest.mark.parametrize("told", [signal.SIGTERM, signal.SIGHUP])
def test_for_a_while_it_is_not_ready_and_answers_all_the_same(
    tmp_path: Path, told: signal.Signals
) -> None:
    with closing(Server(tmp_path, GEODESIC_DRAIN_DELAY_S=str(10 * LONG_S))) as server:
        mesh_id = upload_sample(server.client, "plane", 200)
        server.process.send_signal(told)
        wait_until(lambda: server.client.get("/readyz").status_code == 503)
        assert server.client.get("/readyz").json()["code"] == "draining"
        assert server.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v9").status_code == 200
        server.process.send_signal(told)
        assert server.process.wait(LONG_S) in ENDED_WELL


def test_a_client_that_watches_a_job_does_not_keep_the_service_from_stopping(
    server: Server,
) -> None:
    mesh_id = upload_sample(server.client, "plane", 200)
    with stopped(server.both_workers()):
        job = submit(server, mesh_id)
        with server.client.stream("GET", f"{job}/events") as events:
            lines = events.iter_lines()
            next(lines)
            server.process.send_signal(signal.SIGTERM)

            assert server.process.wait(LONG_S) in ENDED_WELL
            assert not any('"status": "failed"' in line for line in lines)

    with closing(Server(server.store)) as next_server:
        wait_until(lambda: status_of(next_server, job) == "successful")


def test_processes_that_compile_kernels_end_with_the_service(tmp_path):
    server = Server(
        tmp_path / "store", waits_for_workers=False, NUMBA_CACHE_DIR=str(tmp_path / "kernels")
    )
    try:
        wait_until(lambda: len(compilers_of(server.process.pid)) > 0)
        compilers = compilers_of(server.process.pid)
        server.process.send_signal(signal.SIGTERM)
        server.process.wait()
        assert are_gone(compilers)
    finally:
        server.close()
