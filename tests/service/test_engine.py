"""What becomes of requests when workers are busy, slow or killed."""

import asyncio
import gc
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.encoding import Representation
from app.engine import local, worker
from app.engine.slot import Slot
from app.engine.work import MeshFromSample, RunQuery, StoreMesh, Task
from app.engine.worker import Clock, Signals, Worker, WorkerConfig
from app.errors import Problem
from app.main import create_app
from app.queries import DistancesQuery, PathQuery
from app.schemas.points import VertexPoint
from app.schemas.requests import DistancesRequest, PathRequest
from app.settings import Settings
from geodesic_core import TriangleMesh, samples
from tests.support.service import (
    check_problem,
    is_ready,
    processor_time,
    serving,
    store_mesh,
    upload_sample,
    wait_until,
)

SLOW_FACES = 300_000
"""Distances on a sphere of so many faces take seconds."""


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service of two workers and the one for small work, with places for two to wait."""
    store = tmp_path_factory.mktemp("two")
    with serving(store, workers=2, queue_size=2, cancel_grace_s=5) as client:
        wait_until(lambda: len(workers(client)) == 3)
        yield client


@pytest.fixture(scope="module")
def small(two: TestClient) -> str:
    return upload_sample(two, "plane", 200)


@pytest.fixture(scope="module")
def medium(two: TestClient) -> str:
    """The id of a mesh on which distances are no small work, but take a tenth of a second."""
    return upload_sample(two, "sphere", 80_000)


@pytest.fixture(scope="module")
def slow(two: TestClient) -> str:
    return upload_sample(two, "sphere", SLOW_FACES)


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(16) as pool:
        yield pool


_starts = count()


def ask(client: TestClient, mesh_id: str, **headers: str) -> Any:
    """Ask for distances that nobody has asked for before."""
    body = {"sources": [{"vertex": 0, "start_distance": next(_starts)}], "targets": [{"vertex": 1}]}
    return client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)


def engine_of(client: TestClient) -> Any:
    return client.app.state.service.engine


def workers(client: TestClient) -> set[int]:
    return {slot._process.pid for slot in engine_of(client)._open}


def busy_workers(client: TestClient) -> set[int]:
    engine = engine_of(client)
    return {slot._process.pid for slot in engine._open - set(engine._idle)}


def wait_until_busy(client: TestClient, running: int = 2, waiting: int = 0) -> None:
    engine = engine_of(client)
    wait_until(
        lambda: len(engine._open) - len(engine._idle) == running and len(engine._waiting) == waiting
    )


def wait_until_begun(client: TestClient) -> None:
    """Wait until all busy workers have taken up their work; before, it would go to others."""
    engine = engine_of(client)
    wait_until(lambda: all(slot.progress > 0 for slot in engine._open - set(engine._idle)))


def wait_until_whole(client: TestClient) -> None:
    wait_until(lambda: len(engine_of(client)._idle) == 3)


@pytest.fixture(autouse=True)
def whole(request: pytest.FixtureRequest) -> None:
    if "two" in request.fixturenames:
        wait_until_whole(request.getfixturevalue("two"))


def start_slow(
    two: TestClient, slow: str, pool: ThreadPoolExecutor, timeout_ms: int = 60_000
) -> list[Future]:
    """Keep both workers busy, for the time of the query or for ``timeout_ms``."""
    futures = [pool.submit(ask, two, slow, **{"X-Timeout-Ms": str(timeout_ms)}) for _ in range(2)]
    wait_until_busy(two)
    return futures


def test_workers_can_be_told_apart(two: TestClient) -> None:
    titles = {Path(f"/proc/{pid}/cmdline").read_text().strip("\0") for pid in workers(two)}

    assert titles == {"geodesic-worker"}


@pytest.mark.parametrize(
    ("kind", "how_many"), [(signal.SIGKILL, 1), (signal.SIGTERM, 2), (signal.SIGSEGV, 2)]
)
def test_idle_workers_killed(
    two: TestClient, small: str, kind: signal.Signals, how_many: int
) -> None:
    before = workers(two)
    for pid in sorted(before)[:how_many]:
        os.kill(pid, kind)

    assert ask(two, small).status_code == 200
    wait_until(lambda: len(workers(two) - before) == how_many)


def test_workers_leave_an_interrupt_to_the_service(two: TestClient, small: str) -> None:
    """Ctrl-C in a terminal comes to all processes there."""
    before = workers(two)
    for pid in before:
        os.kill(pid, signal.SIGINT)

    for _ in range(6):
        assert ask(two, small).status_code == 200
    assert workers(two) == before


def test_a_query_right_after_the_kill_is_not_lost(two: TestClient, small: str) -> None:
    for _ in range(2):
        for pid in workers(two):
            os.kill(pid, signal.SIGKILL)
        assert ask(two, small).status_code == 200
        wait_until_whole(two)


def test_a_busy_worker_killed(
    two: TestClient, small: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    running = start_slow(two, slow, threads)
    wait_until_begun(two)
    os.kill(min(busy_workers(two)), signal.SIGKILL)
    responses = sorted((future.result() for future in running), key=lambda r: r.status_code)

    assert responses[0].status_code == 200
    check_problem(responses[1], 500, "worker_died")
    assert ask(two, small).status_code == 200


def test_all_killed_while_others_wait(
    two: TestClient, medium: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    running = start_slow(two, slow, threads)
    waiting = [threads.submit(ask, two, medium) for _ in range(2)]
    wait_until_busy(two, 2, 2)
    wait_until_begun(two)
    for pid in workers(two):
        os.kill(pid, signal.SIGKILL)

    for future in running:
        check_problem(future.result(), 500, "worker_died")
    assert [future.result().status_code for future in waiting] == [200, 200]


def test_a_full_queue_refuses_at_once(
    two: TestClient, medium: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    running = start_slow(two, slow, threads, timeout_ms=2000)
    waiting = [threads.submit(ask, two, medium) for _ in range(2)]
    wait_until_busy(two, 2, 2)

    response = ask(two, medium)

    assert not any(future.done() for future in (*running, *waiting))
    problem = check_problem(response, 503, "queue_full")
    assert response.headers["retry-after"] == "1"
    assert (problem["limit"], problem["setting"]) == (2, "GEODESIC_QUEUE_SIZE")
    assert {future.result().status_code for future in waiting} == {200}


def test_other_requests_are_served_meanwhile(
    two: TestClient, slow: str, threads: ThreadPoolExecutor
) -> None:
    start_slow(two, slow, threads, timeout_ms=1000)
    times = []
    for _ in range(20):
        start = time.monotonic()
        assert two.get("/v1").status_code == 200
        times.append(time.monotonic() - start)

    assert sorted(times)[10] < 0.05


def test_a_deadline_stops_the_query_and_spares_the_worker(two: TestClient, slow: str) -> None:
    before = workers(two)
    start = time.monotonic()

    response = ask(two, slow, **{"X-Timeout-Ms": "300"})

    assert time.monotonic() - start < 0.6
    assert check_problem(response, 504, "deadline_exceeded")["limit"] == 0.3
    wait_until(lambda: len(engine_of(two)._idle) == 3, seconds=1)
    assert workers(two) == before


def test_a_deadline_counts_in_the_queue(
    two: TestClient, medium: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    start_slow(two, slow, threads, timeout_ms=1000)

    response = ask(two, medium, **{"X-Timeout-Ms": "100"})

    check_problem(response, 504, "deadline_exceeded")
    assert len(engine_of(two)._waiting) == 0


def test_reading_a_mesh_is_killed_at_its_deadline(two: TestClient, small: str) -> None:
    before = workers(two)

    response = two.post(
        "/v1/meshes",
        params={"sample": "sphere", "faces": 2_000_000},
        headers={"X-Timeout-Ms": "200"},
    )

    check_problem(response, 504, "deadline_exceeded")
    wait_until_whole(two)
    assert len(workers(two) & before) == 2
    assert ask(two, small).status_code == 200


def test_a_query_goes_where_its_mesh_is_open(two: TestClient, small: str) -> None:
    other = upload_sample(two, "plane", 300)
    for mesh_id in (small, other):
        for _ in range(3):
            assert ask(two, mesh_id).status_code == 200
    known = [slot.affinity_keys for slot in engine_of(two)._slots]

    assert all(sum(mesh_id in slot for slot in known) >= 1 for mesh_id in (small, other))
    for _ in range(4):
        for mesh_id in (small, other):
            load = ask(two, mesh_id).headers["server-timing"].split("load;dur=")[1]
            assert float(load.split(",")[0]) < 1


def test_small_work_does_not_wait_behind_long_work(
    two: TestClient, small: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    running = start_slow(two, slow, threads, timeout_ms=2000)
    waiting = threads.submit(ask, two, slow, **{"X-Timeout-Ms": "2000"})
    wait_until_busy(two, 2, 1)

    for _ in range(10):
        assert ask(two, small).status_code == 200

    assert not any(future.done() for future in [*running, waiting])


def test_small_work_may_use_any_worker_but_not_all_at_once(
    two: TestClient, small: str, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, run_in = engine_of(two), engine_of(two)._run_in
    at_once, seen = set(), []

    async def run_and_note(slot: Slot, *rest: Any) -> Any:
        at_once.add(slot)
        seen.append(frozenset(at_once))
        try:
            return await run_in(slot, *rest)
        finally:
            at_once.discard(slot)

    monkeypatch.setattr(engine, "_run_in", run_and_note)

    asked = [threads.submit(lambda: [ask(two, small) for _ in range(25)]) for _ in range(4)]

    assert {answer.status_code for future in asked for answer in future.result()} == {200}
    assert max(map(len, seen)) == 2
    assert len(frozenset().union(*seen)) >= 2


def test_small_work_that_waits_goes_on_when_a_worker_dies(
    two: TestClient, small: str, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, is_over = engine_of(two), threading.Event()
    open_slot = Slot.open

    async def open_later(slot: Slot) -> None:
        await asyncio.to_thread(is_over.wait)
        await open_slot(slot)

    monkeypatch.setattr(Slot, "open", open_later)
    held = workers(two)
    try:
        for pid in held:
            os.kill(pid, signal.SIGSTOP)
        running = [threads.submit(ask, two, small) for _ in range(2)]
        wait_until_busy(two, 2)
        waiting = threads.submit(ask, two, small)
        wait_until_busy(two, 2, 1)
        (idle,) = engine._idle
        os.kill(idle._process.pid, signal.SIGCONT)
        assert not waiting.done(), "there is room for two"

        victim = next(slot for slot in engine._open if slot is not idle)
        os.kill(victim._process.pid, signal.SIGKILL)

        assert waiting.result(10).status_code == 200
        assert not all(future.done() for future in running)
    finally:
        for slot in engine._open:
            os.kill(slot._process.pid, signal.SIGCONT)
        is_over.set()
    assert [future.result().status_code for future in running] == [200] * 2


@pytest.mark.skipif(sys.platform != "linux", reason="niceness is a thread's own on Linux only")
def test_work_that_is_not_small_lets_others_go_first(
    two: TestClient, small: str, slow: str
) -> None:
    def ask_path(vertex: int) -> Any:
        body = {"source": {"vertex": 0}, "target": {"vertex": vertex}}
        return two.post(f"/v1/meshes/{small}/path", json=body)

    def ask_slow(_: int) -> Any:
        return ask(two, slow)

    for work, times, niceness in ((ask_slow, 2, 10), (ask_path, 40, 0), (ask_slow, 2, 10)):
        before = {pid: processor_time(pid) for pid in workers(two)}
        asked = [work(number) for number in range(times)]
        taken = sum((processor_time(pid) - before[pid] for pid in before), Counter())

        assert {answer.status_code for answer in asked} == {200}
        assert taken[niceness] > 0.8 * taken.total()


def test_what_proves_not_to_be_small_begins_anew_elsewhere(
    two: TestClient, slow: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DistancesQuery, "is_small", lambda *_: True)
    engine = engine_of(two)
    engine._idle.sort(key=lambda slot: slot is not engine._small)
    for slot in engine._slots:
        slot.affinity_keys.clear()

    response = ask(two, slow)

    assert response.status_code == 200
    queued = float(response.headers["server-timing"].split("queue;dur=")[1].split(",")[0])
    assert queued > 1e3 * local._SMALL_S, "the first try counts as waiting"


def test_clients_take_turns(two: TestClient, slow: str, medium: str) -> None:
    """A client that asks for much keeps no other waiting for all of it."""
    begun: list[str] = []

    async def ask_as(client: str, mesh_id: str) -> None:
        vertex = next(_starts)
        work = RunQuery(
            asked(mesh_id, vertex=vertex), Representation("application/json"), f"{mesh_id}/{vertex}"
        )

        def note(share: float) -> None:
            if share == 0.0:
                begun.append(client)

        await engine_of(two).run(Task(work, client, (mesh_id,)), note)

    async def ask_all() -> None:
        running = [asyncio.create_task(ask_as("greedy", slow)) for _ in range(2)]
        await asyncio.sleep(0.2)
        begun.clear()
        greedy = [asyncio.create_task(ask_as("greedy", medium)) for _ in range(2)]
        await asyncio.sleep(0.05)
        await asyncio.gather(*running, *greedy, ask_as("modest", medium))

    two.portal.call(ask_all)

    assert list(dict.fromkeys(begun)) == ["greedy", "modest"]
    assert begun[-1] == "greedy", "the modest one came last, and does not go last"


def test_many_at_once(two: TestClient, small: str) -> None:
    with ThreadPoolExecutor(4) as pool:
        responses = list(pool.map(lambda _: ask(two, small), range(100)))

    assert {response.status_code for response in responses} == {200}


def test_the_server_s_own_deadline_names_its_setting(tmp_path: Path) -> None:
    with serving(tmp_path, deadline_s=0.2) as client:
        params = {"sample": "sphere", "faces": 2_000_000}
        problem = check_problem(client.post("/v1/meshes", params=params), 504, "deadline_exceeded")

        assert problem["setting"] == "GEODESIC_DEADLINE_S"


def test_a_query_that_does_not_stop_is_killed(tmp_path: Path) -> None:
    with serving(tmp_path, cancel_grace_s=1e-6) as client:
        mesh_id = upload_sample(client, "sphere", SLOW_FACES)
        before = workers(client)

        check_problem(ask(client, mesh_id, **{"X-Timeout-Ms": "300"}), 504, "deadline_exceeded")

        wait_until(lambda: workers(client) - before)
        small = upload_sample(client, "plane", 50)
        assert ask(client, small).status_code == 200


def die(*_: Any) -> None:
    os._exit(3)


def test_workers_that_cannot_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.engine.worker.run", die)
    sample = {"sample": "plane", "faces": 10}
    with TestClient(create_app(Settings(store=tmp_path, workers=1))) as client:
        # The first asks before it is known that none can start, the second after.
        for _ in range(2):
            response = client.post("/v1/meshes", params=sample)
            check_problem(response, 503, "engine_unavailable")
            assert response.headers["retry-after"] == "1"
        check_problem(client.get("/readyz"), 503, "engine_unavailable")
        assert client.get("/livez").status_code == 200

        monkeypatch.undo()
        wait_until(lambda: is_ready(client))
        assert client.post("/v1/meshes", params=sample).status_code == 201


def test_a_start_that_is_called_off_leaves_nothing(tmp_path: Path) -> None:
    async def call_off() -> int:
        slot = Slot(config(tmp_path))
        opening = asyncio.create_task(slot.open())
        await asyncio.sleep(0.001)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        process = slot._process
        assert process is not None
        assert process.is_alive()
        pid = int(process.pid or 0)
        await slot.close()
        return pid

    pid = asyncio.run(call_off())

    gc.collect()  # a socket that nobody closed would fail the test
    wait_until(lambda: not Path(f"/proc/{pid}").exists())


def test_an_interrupt_while_workers_start_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("app.engine.worker.run", die)
    app = create_app(Settings(store=tmp_path, workers=1))
    engine = app.state.service.engine
    engine.drain()
    with TestClient(app):
        wait_until(lambda: engine._is_failing)

    assert "could not be started" not in caplog.text


def config(store: Path, **settings: Any) -> WorkerConfig:
    return WorkerConfig(Settings(store=store, **settings), store / "results")


def asked(mesh_id: str, *barriers: int, vertex: int = 0, **rest: Any) -> DistancesQuery:
    return DistancesQuery(
        mesh_id, DistancesRequest(sources=[{"vertex": vertex}], barriers=list(barriers), **rest)
    )


def test_a_worker_closes_meshes_that_do_not_fit(tmp_path: Path) -> None:
    meshes = [TriangleMesh(*samples.plane(faces)) for faces in (100, 200, 300)]
    ids = [store_mesh(tmp_path, mesh) for mesh in meshes]
    room = meshes[1].nbytes + meshes[2].nbytes
    state = Worker(config(tmp_path, worker_mesh_bytes=room), Signals())

    for mesh_id in ids:
        state._open(asked(mesh_id))

    assert list(state.meshes) == [(mesh_id, b"") for mesh_id in ids[1:]]


def test_a_worker_keeps_meshes_with_barriers_as_it_keeps_others(tmp_path: Path) -> None:
    mesh = TriangleMesh(*samples.plane(200))
    mesh_id = store_mesh(tmp_path, mesh)
    state = Worker(config(tmp_path, worker_mesh_bytes=2 * mesh.nbytes), Signals())

    blocked = state._open(asked(mesh_id, 3, 9))

    assert blocked.mesh.barriers.tolist() == [3, 9]
    assert state._open(asked(mesh_id, 3, 9)) is blocked
    assert len(state._open(asked(mesh_id)).mesh.barriers) == 0
    assert state._open(asked(mesh_id, 5)) is not blocked
    assert [len(name[1]) // 8 for name in state.meshes] == [0, 1], "the first had to go"


def test_what_paths_need_counts_as_part_of_an_open_mesh(tmp_path: Path) -> None:
    meshes = [TriangleMesh(*samples.plane(faces)) for faces in (200, 300)]
    ids = [store_mesh(tmp_path, mesh) for mesh in meshes]
    room = sum(mesh.nbytes for mesh in meshes) + 100
    state = Worker(config(tmp_path, worker_mesh_bytes=room), Signals())

    for mesh_id in ids:
        opened = state._open(asked(mesh_id))
    assert list(state.meshes) == [(mesh_id, b"") for mesh_id in ids]
    opened.solver.shortest_path(0, 60)
    state._open(asked(ids[1]))

    assert list(state.meshes) == [(ids[1], b"")]


def test_the_clock_measures_each_phase() -> None:
    clock = Clock()
    with clock.phase("load"):
        time.sleep(0.01)

    assert 0.01 <= clock.seconds["load"] < 0.1


def test_a_defect_in_a_worker_is_logged_there_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(worker, "_make_mesh", lambda *_: 1 / 0)
    state = Worker(config(tmp_path), Signals())

    outcome = state.do(1, StoreMesh(MeshFromSample("plane", 10, "none"), tmp_path / "mesh"))

    assert isinstance(outcome, Problem)
    assert outcome.code == "internal_error"
    assert "ZeroDivisionError" in caplog.text


@pytest.mark.parametrize("accuracy", [{}, {"method": "approximate", "relative_error": 0.01}])
def test_work_that_was_asked_to_stop_stops(tmp_path: Path, accuracy: dict[str, Any]) -> None:
    signals = Signals()
    state = Worker(config(tmp_path), signals)
    mesh_id = store_mesh(tmp_path, TriangleMesh(*samples.sphere(100_000)))
    ends = {"source": VertexPoint(vertex=0), "target": VertexPoint(vertex=1)}
    query = PathQuery(mesh_id, PathRequest(**ends, **accuracy))
    work = RunQuery(query, Representation("application/json"), f"{mesh_id}/key")
    (tmp_path / "results").mkdir()

    signals.stop_number = 2
    assert state.do(2, work) is None
    assert not list((tmp_path / "results").rglob("*"))
    assert "encode" in state.do(3, work).seconds
