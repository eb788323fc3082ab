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
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.engine.interface import ProgressCallback
from app.engine.local import LocalEngine
from app.engine.slot import Slot
from app.engine.work import Task, TaskResult
from app.main import create_app
from app.queries import DistancesQuery
from app.service.progress import ignore_progress
from app.service.service import Service
from app.settings import Settings
from tests.support.clocks import Clock
from tests.support.dying import die
from tests.support.logs import Log
from tests.support.processes import are_gone, processor_time, stopped
from tests.support.service import (
    SLOW_FACES,
    ServiceClient,
    check_problem,
    is_ready,
    serving,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until
from tests.support.workers import distances_query, run_query, worker_config

pytestmark = pytest.mark.file_slice(10)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    """A service of two workers and the one for small work, with places for two to wait."""
    store = tmp_path_factory.mktemp("two")
    with serving(store, workers=2, queue_size=2, cancel_grace_s=LONG_S) as client:
        client.wait_until_idle()
        yield client


@pytest.fixture(scope="module")
def small(two: ServiceClient) -> str:
    return upload_sample(two, "plane", 200)


@pytest.fixture(scope="module")
def medium(two: ServiceClient) -> str:
    """The id of a mesh on which distances are no small work, but take a few tenths of a second."""
    return upload_sample(two, "sphere", 80_000)


@pytest.fixture(scope="module")
def slow(two: ServiceClient) -> str:
    return upload_sample(two, "sphere", SLOW_FACES)


@pytest.fixture
def distances_are_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Distances are no small work, on whatever mesh."""
    monkeypatch.setattr(DistancesQuery, "is_small", False)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The engine's clock: while it stands, small work stays small work on the slowest machine."""
    clock = Clock()
    monkeypatch.setattr("app.engine.local.perf_counter", clock)
    return clock


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(16) as pool:
        yield pool


start_distances = count()


def ask(client: ServiceClient, mesh_id: str, **headers: str) -> Any:
    """Ask for distances that were not asked for before."""
    source = {"vertex": 0, "start_distance": next(start_distances)}
    body = {"sources": [source], "targets": [{"vertex": 1}]}
    return client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)


def ask_path(client: ServiceClient, mesh_id: str, target: int) -> Any:
    """Ask for a path, which is small work."""
    body = {"source": {"vertex": 0}, "target": {"vertex": target}}
    return client.post(f"/v1/meshes/{mesh_id}/path", json=body)


@pytest.fixture(autouse=True)
def all_workers_are_idle(request: pytest.FixtureRequest) -> None:
    if "two" in request.fixturenames:
        request.getfixturevalue("two").wait_until_idle()


def ask_at_once(
    client: ServiceClient, mesh_id: str, pool: ThreadPoolExecutor, **load: int
) -> list[Future]:
    """Ask twice, and wait until the engine has this load."""
    futures = [pool.submit(ask, client, mesh_id) for _ in range(2)]
    wait_until(lambda: all(getattr(client.load, name) == many for name, many in load.items()))
    return futures


def processor_times(client: ServiceClient) -> dict[int, Counter[int]]:
    return {pid: processor_time(pid) for pid in client.workers()}


def at_work(before: dict[int, Counter[int]]) -> set[int]:
    """Return the workers that have taken up work since."""
    return {pid for pid, then in before.items() if (processor_time(pid) - then).total() > 20e6}


def submit(client: ServiceClient, mesh_id: str) -> str:
    """Have a job begin, and return its address."""
    job = ask(client, mesh_id, Prefer="respond-async").headers["location"]
    wait_until(lambda: client.get(job).json()["status"] == "running")
    return str(job)


@contextmanager
def under_way(two: ServiceClient, slow: str) -> Iterator[tuple[list[str], set[int]]]:
    """Have two jobs under way, and both workers stopped in the midst; dismiss them afterwards."""
    before = processor_times(two)
    jobs = [submit(two, slow) for _ in range(2)]
    wait_until(lambda: len(at_work(before)) == 2)
    busy = at_work(before)
    with stopped(busy):
        yield jobs, busy
        for job in jobs:
            two.delete(job)


def wait_for_failures(two: ServiceClient, jobs: list[str], count: int) -> None:
    """Wait until so many jobs have failed because their worker died; the others run."""
    wait_until(lambda: [two.get(job).json()["status"] for job in jobs].count("failed") == count)
    documents = [two.get(job).json() for job in jobs]
    problems = [each["problem"]["code"] for each in documents if each["status"] == "failed"]
    assert problems == ["worker_died"] * count
    assert [each["status"] for each in documents].count("running") == len(jobs) - count


def test_workers_have_a_title(two: ServiceClient) -> None:
    titles = [Path(f"/proc/{pid}/cmdline").read_text().strip("\0") for pid in two.workers()]

    assert titles == 3 * ["geodesic-worker"]


@pytest.mark.parametrize(
    ("kind", "how_many"), [(signal.SIGKILL, 3), (signal.SIGTERM, 1), (signal.SIGSEGV, 1)]
)
def test_idle_workers_killed(
    two: ServiceClient, small: str, kind: signal.Signals, how_many: int
) -> None:
    before, lost = two.workers(), two.load.lost
    for pid in sorted(before)[:how_many]:
        os.kill(pid, kind)

    assert ask(two, small).status_code == 200, "a query right after the kill is not lost"
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


def test_a_busy_worker_killed(two: ServiceClient, small: str, slow: str) -> None:
    with under_way(two, slow) as (jobs, busy):
        os.kill(min(busy), signal.SIGKILL)

        wait_for_failures(two, jobs, 1)
        assert ask(two, small).status_code == 200


@pytest.mark.usefixtures("distances_are_long")
def test_all_killed_while_others_wait(
    two: ServiceClient, small: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    with under_way(two, slow) as (jobs, _):
        waiting = ask_at_once(two, small, threads, waiting=2)
        for pid in two.workers():
            os.kill(pid, signal.SIGKILL)

        wait_for_failures(two, jobs, 2)
        assert [future.result().status_code for future in waiting] == [200, 200]


@pytest.mark.usefixtures("distances_are_long")
def test_a_full_queue_refuses_at_once(
    two: ServiceClient, small: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        running = ask_at_once(two, small, threads, busy=2)
        waiting = ask_at_once(two, small, threads, waiting=2)
        response = ask(two, small)

    problem = check_problem(response, 503, "queue_full")
    assert response.headers["retry-after"] == "1"
    assert (problem["limit"], problem["setting"]) == (2, "queue_size")
    assert {future.result().status_code for future in (*running, *waiting)} == {200}


@pytest.mark.usefixtures("distances_are_long")
def test_other_requests_are_served_meanwhile(
    two: ServiceClient, small: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        running = ask_at_once(two, small, threads, busy=2)
        assert [two.get("/v1").status_code for _ in range(20)] == 20 * [200]
        assert not any(future.done() for future in running)


def test_a_deadline_stops_the_query_and_spares_the_worker(two: ServiceClient, slow: str) -> None:
    before, cancelled = two.workers(), two.load.cancelled

    response = ask(two, slow, **{"X-Timeout-Ms": "100"})

    assert check_problem(response, 504, "deadline_exceeded")["limit"] == 0.1
    assert two.load.cancelled == cancelled + 1
    two.wait_until_idle()
    assert two.workers() == before


@pytest.mark.usefixtures("distances_are_long")
def test_a_deadline_counts_in_the_queue(
    two: ServiceClient, small: str, threads: ThreadPoolExecutor
) -> None:
    with stopped(two.workers()):
        ask_at_once(two, small, threads, busy=2)
        response = ask(two, small, **{"X-Timeout-Ms": "100"})

        check_problem(response, 504, "deadline_exceeded")
        assert two.load.waiting == 0


def test_a_mesh_read_past_its_deadline_costs_no_worker(two: ServiceClient, small: str) -> None:
    before, stored = two.workers(), two.get("/v1/meshes").json()

    for faces, timeout in (*((20, each) for each in range(1, 9)), (200_000, 20)):
        sample = {"sample": "sphere", "faces": faces}
        response = two.post("/v1/meshes", params=sample, headers={"X-Timeout-Ms": str(timeout)})
        if response.status_code == 201:
            assert faces == 20, "it takes longer"
            two.delete(f"/v1/meshes/{response.json()['id']}")
        else:
            check_problem(response, 504, "deadline_exceeded")

    two.wait_until_idle()
    assert two.workers() == before
    assert two.get("/v1/meshes").json() == stored
    assert ask(two, small).status_code == 200


def test_a_query_goes_where_its_mesh_is_open(two: ServiceClient, small: str) -> None:
    """No other worker maps the files of the mesh."""
    ids = [upload_sample(two, "plane", faces) for faces in (300, 400)]
    for mesh_id in ids:
        assert ask(two, mesh_id).status_code == 200
    before = [that_map(two, mesh_id) for mesh_id in ids]
    assert [len(workers) for workers in before] == [1, 1]

    for _ in range(4):
        for mesh_id in (*ids, small):
            assert ask(two, mesh_id).status_code == 200
    assert [that_map(two, mesh_id) for mesh_id in ids] == before


def that_map(client: ServiceClient, mesh_id: str) -> set[int]:
    """Return the workers that have a mesh open, as Linux tells."""
    name = f"{mesh_id}/vertices.npy"
    return {pid for pid in client.workers() if name in Path(f"/proc/{pid}/maps").read_text()}


@pytest.mark.usefixtures("distances_are_long", "clock")
def test_small_work_does_not_wait_behind_long_work(
    two: ServiceClient, small: str, slow: str, threads: ThreadPoolExecutor
) -> None:
    with under_way(two, slow) as (jobs, _):
        waiting = ask_at_once(two, small, threads, waiting=2)

        for target in range(1, 11):
            assert ask_path(two, small, target).status_code == 200

        wait_for_failures(two, jobs, 0)
        assert not any(future.done() for future in waiting)
    assert [future.result().status_code for future in waiting] == [200, 200]


@pytest.mark.usefixtures("clock")
def test_small_work_may_use_any_worker_but_not_all_at_once(
    two: ServiceClient, small: str, threads: ThreadPoolExecutor
) -> None:
    before = processor_times(two)
    with stopped(two.workers()):
        futures = [threads.submit(lambda: [ask(two, small) for _ in range(25)]) for _ in range(4)]
        wait_until(lambda: two.load.waiting == 2)
        assert (two.load.busy, two.load.idle) == (2, 1)
    most = 0
    while not all(future.done() for future in futures):
        most = max(most, two.load.busy)
        time.sleep(0.001)

    assert {answer.status_code for future in futures for answer in future.result()} == {200}
    assert most <= 2
    times = [(processor_time(pid) - then)[0] for pid, then in before.items()]
    assert sum(time > 0 for time in times) >= 2


@pytest.mark.usefixtures("clock")
def test_small_work_that_waits_goes_on_when_a_worker_dies(
    two: ServiceClient,
    small: str,
    slow: str,
    threads: ThreadPoolExecutor,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    may_open, open_slot = threading.Event(), Slot.open

    async def open_later(slot: Slot) -> None:
        await asyncio.to_thread(may_open.wait)
        await open_slot(slot)

    monkeypatch.setattr(Slot, "open", open_later)
    monkeypatch.setattr(DistancesQuery, "is_small", True)
    try:
        with under_way(two, slow) as (jobs, busy):
            waiting = threads.submit(ask, two, small)
            wait_until(lambda: two.load.waiting == 1)
            assert two.load.idle == 1, "small work may have two workers, not all three"

            os.kill(min(busy), signal.SIGKILL)

            assert waiting.result(LONG_S).status_code == 200
            wait_for_failures(two, jobs, 1)
    finally:
        may_open.set()


@pytest.mark.skipif(sys.platform != "linux", reason="niceness is a thread's own on Linux only")
@pytest.mark.usefixtures("clock")
def test_work_that_is_not_small_lets_others_go_first(
    two: ServiceClient, small: str, medium: str
) -> None:
    def long_work() -> None:
        assert ask(two, medium).status_code == 200

    def small_work() -> None:
        assert [ask_path(two, small, i).status_code for i in range(1, 31)] == [200] * 30

    for work, niceness in ((long_work, 10), (small_work, 0), (long_work, 10)):
        before = processor_times(two)
        work()
        taken = sum((processor_time(pid) - before[pid] for pid in before), Counter())
        assert taken[niceness] > 0.8 * taken.total()


def new_task(mesh_id: str, client: str = "someone", *, is_small: bool = False) -> Task:
    query = distances_query(mesh_id, start_distance=next(start_distances))
    return Task(run_query(query), client, (mesh_id,), is_small)


async def until(condition: Callable[[], object]) -> None:
    """Wait for a state, on the event loop."""
    while not condition():
        await asyncio.sleep(0.01)


def test_what_proves_not_to_be_small_begins_anew(
    two: ServiceClient, small: str, clock: Clock
) -> None:
    reports: list[float] = []

    async def run() -> TaskResult:
        with stopped(two.workers()):
            task = new_task(small, is_small=True)
            running = asyncio.create_task(two.engine.run(task, reports.append))
            await until(lambda: two.load.busy == 1)
            clock.now += 10.0
            before_now = len(reports)
            await until(lambda: len(reports) > before_now)  # the engine has looked at its clock
        return await running

    before = processor_times(two)
    result = two.portal.call(run)

    assert result.seconds["queue"] == 10.0, "the first try counts as waiting"
    assert result.result is not None
    assert sum((processor_time(pid) - before[pid])[10] for pid in before) > 0, "the second is long"


def test_what_proves_not_to_be_small_waits_however_full_the_queue_is(
    two: ServiceClient, small: str, clock: Clock
) -> None:
    reports: list[float] = []

    async def begin(
        task: Task, on_progress: ProgressCallback = ignore_progress, **load: int
    ) -> "asyncio.Task[TaskResult]":
        running = asyncio.create_task(two.engine.run(task, on_progress))
        await until(lambda: all(getattr(two.load, name) == many for name, many in load.items()))
        return running

    async def run() -> list[TaskResult]:
        with stopped(two.workers()):
            running = [await begin(new_task(small), busy=busy) for busy in (1, 2)]
            not_small = await begin(new_task(small, is_small=True), reports.append, busy=3)
            running += [await begin(new_task(small), waiting=waiting) for waiting in (1, 2)]
            clock.now += 10.0
            before_now = len(reports)
            await until(lambda: len(reports) > before_now)  # the engine has looked at its clock
            os.kill(pid_for_small_work, signal.SIGCONT)
            await until(lambda: two.load.waiting == 3 or not_small.done())
        return await asyncio.gather(not_small, *running)

    assert isinstance(two.engine, LocalEngine)
    pid_for_small_work = two.engine._small.pid or 0

    assert len(two.portal.call(run)) == 5, "and none was refused"


def test_clients_take_turns(two: ServiceClient, small: str) -> None:
    """A client that asks for much keeps no other waiting for all of it."""
    begun: list[str] = []

    async def run(client: str) -> None:
        shares: list[float] = []

        def note(share: float) -> None:
            shares.append(share)
            # What takes long begins anew, in another thread, and tells so again.
            if shares == [0.0] and client not in begun[-1:]:
                begun.append(client)

        await two.engine.run(new_task(small, client), note)

    async def begin(client: str, **load: int) -> "asyncio.Task[None]":
        running = asyncio.create_task(run(client))
        await until(lambda: all(getattr(two.load, name) == many for name, many in load.items()))
        return running

    async def run_all() -> None:
        with stopped(two.workers()):
            running = [await begin("greedy", busy=busy) for busy in (1, 2)]
            begun.clear()
            running += [await begin("greedy", waiting=waiting) for waiting in (1, 2)]
            running.append(await begin("modest", waiting=3))
        await asyncio.gather(*running)

    two.portal.call(run_all)

    assert begun == ["greedy", "modest", "greedy"], "the modest one came last, and goes not last"


def test_many_at_once(two: ServiceClient, small: str) -> None:
    with ThreadPoolExecutor(4) as pool:
        responses = list(pool.map(lambda _: ask(two, small), range(100)))

    assert {response.status_code for response in responses} == {200}


def test_an_answer_that_comes_too_late_counts_and_is_found(
    two: ServiceClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ask_all(**headers: str) -> Any:
        body = {"sources": [{"vertex": 0, "start_distance": start}]}
        return two.post(link, json=body, headers={"Accept": "application/x-npy", **headers})

    service: Service = two.app.state.service  # type: ignore[attr-defined]
    link = f"/v1/meshes/{upload_sample(two, 'plane', 50_000)}/distances"
    start, before = next(start_distances), service.results.nbytes
    monkeypatch.setattr(Slot, "ask_to_stop", lambda _: None)  # as if its work was over by then

    with stopped(two.workers()):
        check_problem(ask_all(**{"X-Timeout-Ms": "100"}), 504, "deadline_exceeded")
    wait_until(lambda: service.results.nbytes > before)

    hits = service.answering.lookups["hit"]
    assert len(ask_all().content) == service.results.nbytes - before
    assert service.answering.lookups["hit"] == hits + 1


def test_the_server_s_own_deadline_names_its_setting(tmp_path: Path) -> None:
    client = ServiceClient(tmp_path, deadline_s=0.2)  # is not started: no worker comes
    client.app.state.service.scratch.prepare()

    response = client.post("/v1/meshes", params={"sample": "plane", "faces": 8})

    problem = check_problem(response, 504, "deadline_exceeded")
    assert (problem["limit"], problem["setting"]) == (0.2, "deadline_s")


def test_work_that_does_not_stop_is_killed(tmp_path: Path) -> None:
    with serving(tmp_path, cancel_grace_s=1e-6) as client:
        mesh_id = upload_sample(client, "plane", 50)
        client.wait_until_idle()
        before = client.workers()

        with stopped(before):
            response = ask(client, mesh_id, **{"X-Timeout-Ms": "100"})
            check_problem(response, 504, "deadline_exceeded")
            wait_until(lambda: client.load.lost == 1)

        client.wait_until_idle()
        assert len(client.workers() - before) == 1
        assert ask(client, mesh_id).status_code == 200


def test_short_deadlines_kill_no_worker_that_makes_a_mesh(tmp_path: Path) -> None:
    """Its steps take longer than sweeps need to stop; others' meshes and fields would go with it.

    The workers stand still, so that none of them stops within the grace.
    """
    with serving(tmp_path, cancel_grace_s=1e-6) as client:
        client.wait_until_idle()
        for faces in range(8, 58, 10):
            with stopped(client.workers()):
                sample = {"sample": "plane", "faces": faces}
                headers = {"X-Timeout-Ms": "50"}
                response = client.post("/v1/meshes", params=sample, headers=headers)
                check_problem(response, 504, "deadline_exceeded")
                wait_until(lambda: client.load.busy > 0)
            client.wait_until_idle()
        assert (client.load.cancelled, client.load.lost) == (5, 0)
        assert client.get("/v1/meshes").json()["meshes"] == []


def test_a_worker_that_makes_a_mesh_for_ever_is_killed(tmp_path: Path) -> None:
    with serving(tmp_path, deadline_s=0.2) as client:
        client.wait_until_idle()
        with stopped(client.workers()):
            response = client.post("/v1/meshes", params={"sample": "plane", "faces": 8})
            check_problem(response, 504, "deadline_exceeded")
            wait_until(lambda: client.load.lost == 1)


def test_workers_that_cannot_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.engine.worker_process.run", die)
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
        slot = Slot(worker_config(tmp_path))
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
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    closed, close = threading.Event(), Slot.close

    async def close_and_tell(slot: Slot) -> None:
        closed.set()
        await close(slot)

    monkeypatch.setattr("app.engine.worker_process.run", die)
    monkeypatch.setattr(Slot, "close", close_and_tell)
    app = create_app(Settings(store=tmp_path, workers=1))
    app.state.service.engine.drain()
    with TestClient(app):
        assert closed.wait(LONG_S), "as is done when a worker has not started"

    assert "worker not started" not in {line["event"] for line in log}
