"""Requests while workers are busy, slow or killed."""

import asyncio
import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
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
from tests.support.processes import are_gone, processor_time, stopped
from tests.support.service import (
    SLOW_FACES,
    ServiceClient,
    check_problem,
    is_ready,
    serving,
    store_mesh,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    """A service of two workers and the one for small work, with places for two to wait."""
    store = tmp_path_factory.mktemp("two")
    patient = {"cancel_grace_s": LONG_S, "deadline_s": LONG_S}
    with serving(store, workers=2, queue_size=2, **patient) as client:
        client.wait_until_idle()
        yield client


@pytest.fixture(scope="module")
def small(two: ServiceClient) -> str:
    return upload_sample(two, "plane", 200)


@pytest.fixture(scope="module")
def medium(two: ServiceClient) -> str:
    """The id of a mesh on which distances are no small work, but take a tenth of a second."""
    return upload_sample(two, "sphere", 80_000)


@pytest.fixture(scope="module")
def slow(two: ServiceClient) -> str:
    return upload_sample(two, "sphere", SLOW_FACES)


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(16) as pool:
        yield pool


_starts = count()


def ask(client: ServiceClient, mesh_id: str, **headers: str) -> Any:
    """Ask for distances that nobody has asked for before."""
    body = {"sources": [{"vertex": 0, "start_distance": next(_starts)}], "targets": [{"vertex": 1}]}
    return client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)


@pytest.fixture(autouse=True)
def _idle(request: pytest.FixtureRequest) -> None:
    if "two" in request.fixturenames:
        request.getfixturevalue("two").wait_until_idle()


def ask_at_once(
    client: ServiceClient, mesh_id: str, pool: ThreadPoolExecutor, **load: int
) -> list[Future]:
    """Ask twice; wait until the engine is as busy as told, or has as many waiting."""
    asked = [pool.submit(ask, client, mesh_id) for _ in range(2)]
    wait_until(lambda: all(getattr(client.load, name) == many for name, many in load.items()))
    return asked


def at_work(before: dict[int, Counter[int]]) -> set[int]:
    """Return the workers that have taken up work since."""
    return {pid for pid, then in before.items() if (processor_time(pid) - then).total() > 20e6}


@contextmanager
def under_way(
    two: ServiceClient, slow: str, pool: ThreadPoolExecutor
) -> Iterator[tuple[list[Future], set[int]]]:
    """Have both workers stopped in the midst of a query; they go on afterwards."""
    before = {pid: processor_time(pid) for pid in two.workers()}
    running = ask_at_once(two, slow, pool, busy=2)
    wait_until(lambda: len(at_work(before)) == 2)
    busy = at_work(before)
    with stopped(busy):
        yield running, busy


def test_workers_can_be_told_apart(two: ServiceClient) -> None:
    titles = [Path(f"/proc/{pid}/cmdline").read_text().strip("\0") for pid in two.workers()]

    assert titles == 3 * ["geodesic-worker"]


@pytest.mark.parametrize(
    ("kind", "how_many"), [(signal.SIGKILL, 1), (signal.SIGTERM, 2), (signal.SIGSEGV, 2)]
)
def test_idle_workers_killed(
    two: ServiceClient, small: str, kind: signal.Signals, how_many: int
) -> None:
    before, lost = two.workers(), two.load.lost
    for pid in sorted(before)[:how_many]:
        os.kill(pid, kind)

    assert ask(two, small).status_code == 200
    wait_until(lambda: two.load.lost == lost + how_many)
    two.wait_until_idle()
    assert len(two.workers() - before) == how_many


def test_workers_leave_an_interrupt_to_the_service(two: ServiceClient, small: str) -> None:
    """Ctrl-C in a terminal comes to all processes there."""
    before = two.workers()
    for pid in before:
        os.kill(pid, signal.SIGINT)

    for _ in range(6):
        assert ask(two, small).status_code == 200
    assert two.workers() == before


def test_a_query_right_after_the_kill_is_not_lost(two: ServiceClient, small: str) -> None:
    for _ in range(2):
        lost = two.load.lost
        for pid in two.workers():
            os.kill(pid, signal.SIGKILL)
        assert ask(two, small).status_code == 200
        wait_until(lambda lost=lost: two.load.lost == lost + 3)
        two.wait_until_idle()


def test_a_busy_worker_killed(
    two: ServiceClient, small: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    with under_way(two, slow, threads) as (running, busy):
        os.kill(min(busy), signal.SIGKILL)
    responses = sorted((future.result() for future in running), key=lambda r: r.status_code)

    assert responses[0].status_code == 200
    check_problem(responses[1], 500, "worker_died")
    assert ask(two, small).status_code == 200


def test_all_killed_while_others_wait(
    two: ServiceClient, medium: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    with under_way(two, slow, threads) as (running, _):
        waiting = ask_at_once(two, medium, threads, waiting=2)
        for pid in two.workers():
            os.kill(pid, signal.SIGKILL)

        for future in running:
            check_problem(future.result(), 500, "worker_died")
        assert [future.result().status_code for future in waiting] == [200, 200]


def test_a_full_queue_refuses_at_once(
    two: ServiceClient, medium: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        running = ask_at_once(two, medium, threads, busy=2)
        waiting = ask_at_once(two, medium, threads, waiting=2)
        response = ask(two, medium)

    problem = check_problem(response, 503, "queue_full")
    assert response.headers["retry-after"] == "1"
    assert (problem["limit"], problem["setting"]) == (2, "GEODESIC_QUEUE_SIZE")
    assert {future.result().status_code for future in (*running, *waiting)} == {200}


def test_other_requests_are_served_meanwhile(
    two: ServiceClient, medium: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        running = ask_at_once(two, medium, threads, busy=2)
        assert [two.get("/v1").status_code for _ in range(20)] == 20 * [200]
        assert not any(future.done() for future in running)


def test_a_deadline_stops_the_query_and_spares_the_worker(two: ServiceClient, slow: str) -> None:
    before, cancelled = two.workers(), two.load.cancelled

    response = ask(two, slow, **{"X-Timeout-Ms": "100"})

    assert check_problem(response, 504, "deadline_exceeded")["limit"] == 0.1
    assert two.load.cancelled == cancelled + 1
    two.wait_until_idle()
    assert two.workers() == before


def test_a_deadline_counts_in_the_queue(
    two: ServiceClient, medium: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        ask_at_once(two, medium, threads, busy=2)
        response = ask(two, medium, **{"X-Timeout-Ms": "100"})

        check_problem(response, 504, "deadline_exceeded")
        assert two.load.waiting == 0


def test_reading_a_mesh_is_killed_at_its_deadline(two: ServiceClient, small: str) -> None:
    before, lost = two.workers(), two.load.lost

    response = two.post(
        "/v1/meshes",
        params={"sample": "sphere", "faces": 2_000_000},
        headers={"X-Timeout-Ms": "200"},
    )

    check_problem(response, 504, "deadline_exceeded")
    wait_until(lambda: two.load.lost == lost + 1)
    two.wait_until_idle()
    assert len(two.workers() & before) == 2
    assert ask(two, small).status_code == 200


def test_a_query_goes_where_its_mesh_is_open(two: ServiceClient, small: str) -> None:
    """No other worker could answer: the files are gone."""
    settings: Settings = two.app.state.service.settings  # type: ignore[attr-defined]
    ids = [upload_sample(two, "plane", faces) for faces in (300, 400, 500)]
    for mesh_id in ids[:2]:
        assert ask(two, mesh_id).status_code == 200
    for mesh_id in ids:
        (settings.store / "meshes" / mesh_id / "vertices.npy").unlink()

    for _ in range(4):
        for mesh_id in (*ids[:2], small):
            assert ask(two, mesh_id).status_code == 200
    check_problem(ask(two, ids[2]), 500, "mesh_damaged")


def test_small_work_does_not_wait_behind_long_work(
    two: ServiceClient, small: str, slow: str, medium: str, threads: ThreadPoolExecutor
) -> None:
    with under_way(two, slow, threads) as (running, _):
        waiting = ask_at_once(two, medium, threads, waiting=2)

        for _ in range(10):
            assert ask(two, small).status_code == 200

        assert not any(future.done() for future in [*running, *waiting])


def test_small_work_may_use_any_worker_but_not_all_at_once(
    two: ServiceClient, small: str, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin, at_once, seen = Slot.begin, set(), []

    def begin_and_note(slot: Slot, *rest: Any, **options: Any) -> Any:
        outcome = begin(slot, *rest, **options)
        at_once.add(slot)
        seen.append(frozenset(at_once))
        outcome.add_done_callback(lambda _: at_once.discard(slot))
        return outcome

    monkeypatch.setattr(Slot, "begin", begin_and_note)

    with stopped(two.workers()):
        asked = [threads.submit(lambda: [ask(two, small) for _ in range(25)]) for _ in range(4)]
        wait_until(lambda: two.load.waiting == 2)

    assert {answer.status_code for future in asked for answer in future.result()} == {200}
    assert max(map(len, seen)) == 2
    assert len(frozenset().union(*seen)) >= 2


def test_small_work_that_waits_goes_on_when_a_worker_dies(
    two: ServiceClient,
    small: str,
    slow: str,
    threads: ThreadPoolExecutor,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    is_over, open_slot = threading.Event(), Slot.open

    async def open_later(slot: Slot) -> None:
        await asyncio.to_thread(is_over.wait)
        await open_slot(slot)

    monkeypatch.setattr(Slot, "open", open_later)
    monkeypatch.setattr(local, "_SMALL_S", LONG_S)
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(DistancesQuery, "is_small", lambda *_: True)
            before = {pid: processor_time(pid) for pid in two.workers()}
            running = ask_at_once(two, slow, threads, busy=2)
            wait_until(lambda: len(at_work(before)) == 2)
        busy = at_work(before)
        with stopped(busy):
            waiting = threads.submit(ask, two, small)
            wait_until(lambda: two.load.waiting == 1)
            assert two.load.idle == 1, "small work may have two workers, not all three"

            os.kill(min(busy), signal.SIGKILL)

            assert waiting.result(LONG_S).status_code == 200
            wait_until(lambda: any(future.done() for future in running))
    finally:
        is_over.set()
    assert sorted(future.result().status_code for future in running) == [200, 500]


@pytest.mark.skipif(sys.platform != "linux", reason="niceness is a thread's own on Linux only")
def test_work_that_is_not_small_lets_others_go_first(
    two: ServiceClient, small: str, medium: str
) -> None:
    def ask_path(vertex: int) -> Any:
        body = {"source": {"vertex": 0}, "target": {"vertex": vertex}}
        return two.post(f"/v1/meshes/{small}/path", json=body)

    def ask_more(_: int) -> Any:
        return ask(two, medium)

    for work, times, niceness in ((ask_more, 3, 10), (ask_path, 40, 0), (ask_more, 3, 10)):
        before = {pid: processor_time(pid) for pid in two.workers()}
        asked = [work(number) for number in range(times)]
        taken = sum((processor_time(pid) - before[pid] for pid in before), Counter())

        assert {answer.status_code for answer in asked} == {200}
        assert taken[niceness] > 0.8 * taken.total()


def test_what_proves_not_to_be_small_begins_anew(
    two: ServiceClient, slow: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin, tries = Slot.begin, []

    def begin_and_note(slot: Slot, work: Any, *, is_small: bool) -> Any:
        tries.append(is_small)
        return begin(slot, work, is_small=is_small)

    monkeypatch.setattr(Slot, "begin", begin_and_note)
    monkeypatch.setattr(DistancesQuery, "is_small", lambda *_: True)
    monkeypatch.setattr(local, "_SMALL_S", 0.05)

    response = ask(two, slow)

    assert response.status_code == 200
    assert tries == [True, False]
    queued = float(response.headers["server-timing"].split("queue;dur=")[1].split(",")[0])
    assert queued > 1e3 * 0.05, "the first try counts as waiting"


def test_clients_take_turns(two: ServiceClient, medium: str) -> None:
    """A client that asks for much keeps no other waiting for all of it."""
    begun: list[str] = []

    async def ask_as(client: str) -> None:
        vertex = next(_starts)
        work = RunQuery(
            asked(medium, vertex=vertex), Representation("application/json"), f"{medium}/{vertex}"
        )

        def note(share: float) -> None:
            if share == 0.0 and client not in begun[-1:]:
                begun.append(client)

        await two.engine.run(Task(work, client, (medium,)), note)

    async def ask_and_wait(client: str, **load: int) -> "asyncio.Task[None]":
        asking = asyncio.create_task(ask_as(client))
        while any(getattr(two.load, name) != many for name, many in load.items()):
            await asyncio.sleep(0.01)
        return asking

    async def ask_all() -> None:
        with stopped(two.workers()):
            asking = [await ask_and_wait("greedy", busy=busy) for busy in (1, 2)]
            begun.clear()
            asking += [await ask_and_wait("greedy", waiting=waiting) for waiting in (1, 2)]
            asking.append(await ask_and_wait("modest", waiting=3))
        await asyncio.gather(*asking)

    two.portal.call(ask_all)

    assert begun == ["greedy", "modest", "greedy"], "the modest one came last, and goes not last"


def test_many_at_once(two: ServiceClient, small: str) -> None:
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
        client.wait_until_idle()
        before = client.workers()

        check_problem(ask(client, mesh_id, **{"X-Timeout-Ms": "100"}), 504, "deadline_exceeded")

        wait_until(lambda: client.load.lost == 1)
        client.wait_until_idle()
        assert len(client.workers() - before) == 1
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
    begun: list[int] = []

    async def call_off() -> None:
        slot = Slot(config(tmp_path))
        others = set(multiprocessing.active_children())
        opening = asyncio.create_task(slot.open())
        await asyncio.sleep(0)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        (process,) = set(multiprocessing.active_children()) - others
        begun.append(int(process.pid or 0))
        await slot.close()

    asyncio.run(call_off())

    gc.collect()  # a socket that nobody closed would fail the test
    wait_until(lambda: are_gone(begun))


def test_an_interrupt_while_workers_start_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    closed, close = threading.Event(), Slot.close

    async def close_and_tell(slot: Slot) -> None:
        closed.set()
        await close(slot)

    monkeypatch.setattr("app.engine.worker.run", die)
    monkeypatch.setattr(Slot, "close", close_and_tell)
    app = create_app(Settings(store=tmp_path, workers=1))
    app.state.service.engine.drain()
    with TestClient(app):
        assert closed.wait(LONG_S), "as is done when a worker has not started"

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
    start = time.perf_counter()
    with clock.phase("load"):
        time.sleep(0.01)

    assert 0.01 <= clock.seconds["load"] <= time.perf_counter() - start


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
