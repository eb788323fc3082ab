"""Large bodies: while they are read and checked, others are answered."""

import json
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Lock
from types import SimpleNamespace
from typing import Any

import anyio
import pytest
from starlette.requests import Request
from starlette.testclient import TestClient

import geodesic_core as gc
from app.access import Caller
from app.http import large_bodies
from app.http.large_bodies import CHECKED_AT_ONCE, READ_AT_ONCE, LargeBodies
from app.http.routes import query_route
from app.queries import DistancesQuery, LocateQuery
from tests.support.service import ServiceClient, check_problem, serving, store_mesh
from tests.support.waiting import LONG_S

POINTS = 9_000
MANY = {"sources": [{"vertex": 0}], "targets": [{"vertex": i % 100} for i in range(POINTS)]}


@pytest.mark.parametrize(
    ("owner", "name"),
    [(query_route, "read"), (DistancesQuery, "ask"), (DistancesQuery, "normalized")],
)
def test_others_are_answered_while_a_large_body_is_checked(
    client: TestClient, plane: str, owner: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the event loop this would wait for itself."""
    at_it, answered = Event(), Event()
    original = getattr(owner, name)

    def wait(*arguments: Any) -> Any:
        if not at_it.is_set():  # the first, which is the large one
            at_it.set()
            assert answered.wait(30), "nobody else was answered"
        return original(*arguments)

    monkeypatch.setattr(owner, name, wait)
    with ThreadPoolExecutor(1) as pool:
        large = pool.submit(client.post, f"/v1/meshes/{plane}/distances", json=MANY)
        assert at_it.wait(30)
        assert client.get("/livez").status_code == 200
        located = client.post(f"/v1/meshes/{plane}/locate", json={"points": [[0, 0, 0]]})
        assert located.status_code == 200
        answered.set()
        assert len(large.result().json()["distances"]) == POINTS


def test_large_bodies_of_a_caller_are_checked_one_at_a_time(
    client: TestClient, plane: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They have one interpreter; a thread each would only keep the event loop from it."""
    lock, original = Lock(), query_route.read

    def alone(*arguments: Any) -> Any:
        assert lock.acquire(blocking=False), "two at a time"
        try:
            return original(*arguments)
        finally:
            lock.release()

    monkeypatch.setattr(query_route, "read", alone)
    link = f"/v1/meshes/{plane}/distances"
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: client.post(link, json=MANY).status_code, range(4)))
    assert answers == [200] * 4


def test_bodies_of_one_caller_hold_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One caller sends six large bodies, of which the first is never checked to its end."""
    mesh_id = store_mesh(tmp_path, gc.samples.plane(200))
    keys = {name: {"Authorization": f"Bearer {name * 16}"} for name in "ab"}
    at_it, answered, original = Event(), Event(), query_route.read

    def read(model: Any, head: Any, *more: Any) -> Any:
        if head["header"]["authorization"] == keys["a"]["Authorization"]:
            at_it.set()
            assert answered.wait(LONG_S), "nobody else was answered"
        return original(model, head, *more)

    monkeypatch.setattr(query_route, "read", read)
    api_keys = ",".join(f"{name}:{name * 16}" for name in keys)
    with serving(tmp_path, api_keys=api_keys) as client, ThreadPoolExecutor(6) as pool:

        def ask(name: str) -> int:
            link = f"/v1/meshes/{mesh_id}/distances"
            return client.post(link, json=MANY, headers=keys[name]).status_code

        held = [pool.submit(ask, "a") for _ in range(6)]
        assert at_it.wait(LONG_S)
        assert ask("b") == 200
        assert not any(each.done() for each in held)
        answered.set()
        assert [each.result() for each in held] == [200] * 6


def test_few_large_bodies_of_a_caller_are_in_memory() -> None:
    """Those beyond wait unread, and other callers are read at once."""
    bodies, read, done = LargeBodies(), [], anyio.Event()

    async def read_one(caller: str) -> None:
        scope = {
            "type": "http",
            "headers": [],
            "app": SimpleNamespace(state=SimpleNamespace(service=SimpleNamespace(settings=None))),
            "state": {"caller": Caller(caller, has_key=True)},
        }
        async with bodies.reading(Request(scope), LONG_S):
            read.append(caller)
            await done.wait()

    async def read_all() -> None:
        async with anyio.create_task_group() as tasks:
            for caller in "a" * 10 + "b":
                tasks.start_soon(read_one, caller)
            await anyio.wait_all_tasks_blocked()
            assert read == ["a"] * READ_AT_ONCE + ["b"]
            done.set()
        assert Counter(read) == {"a": 10, "b": 1}

    anyio.run(read_all)


@contextmanager
def others_are_checked(client: ServiceClient) -> Iterator[None]:
    """Let large bodies wait, as while those of other callers are checked."""
    limiter = client.app.state.large_bodies.checking
    for number in range(CHECKED_AT_ONCE):
        client.portal.call(limiter.acquire_on_behalf_of, number)
    try:
        yield
    finally:
        for number in range(CHECKED_AT_ONCE):
            client.portal.call(limiter.release_on_behalf_of, number)


def test_a_large_body_waits_no_longer_than_its_deadline(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, gc.samples.plane(200))
    with serving(tmp_path, deadline_s=0.3) as client, others_are_checked(client):
        refused = client.post(f"/v1/meshes/{mesh_id}/distances", json=MANY)

    check_problem(refused, 504, "deadline_exceeded")


def scope_of(path: str, *headers: tuple[bytes, bytes]) -> dict[str, Any]:
    return {
        "type": "http",
        "method": "POST",
        "path": path,
        "query_string": b"",
        "headers": headers,
        "client": None,
        "server": None,
        "state": {},
    }


def status_after(client: ServiceClient, scope: Any, *messages: Any) -> int:
    """Return the status of the answer to a request that comes in these messages."""
    coming, sent = iter(messages), []

    async def receive() -> Any:
        return next(coming)

    async def send(message: Any) -> None:
        sent.append(message)

    client.portal.call(client.app, scope, receive, send)
    return int(sent[0]["status"])


HANGS_UP = {"type": "http.disconnect"}


def test_a_large_body_waits_no_longer_than_its_client(client: ServiceClient, plane: str) -> None:
    body = json.dumps(MANY).encode()
    scope = scope_of(f"/v1/meshes/{plane}/distances", (b"content-type", b"application/json"))
    with others_are_checked(client):
        message = {"type": "http.request", "body": body}
        assert status_after(client, scope, message, HANGS_UP) == 499


@pytest.mark.parametrize("path", ["/v1/meshes", f"/v1/meshes/{'0' * 32}/distances"])
def test_who_hangs_up_within_a_body_holds_nothing(client: ServiceClient, path: str) -> None:
    """As often as it does: no place of its caller, and no room for its upload."""
    headers = (b"content-type", b"application/json"), (b"content-length", b"1000000")
    begun = {"type": "http.request", "body": b"{", "more_body": True}
    for _ in range(READ_AT_ONCE + 1):
        assert status_after(client, scope_of(path, *headers), begun, HANGS_UP) == 499
    assert client.app.state.service.scratch.reserved == 0


def test_small_bodies_need_no_thread(
    client: TestClient, plane: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    no_threads = SimpleNamespace(run_sync=lambda *_, **__: pytest.fail("a thread"))
    monkeypatch.setattr(large_bodies, "to_thread", no_threads)
    body = LocateQuery.model.model_validate({"points": [[0, 0, 0]]}).model_dump()
    assert client.post(f"/v1/meshes/{plane}/locate", json=body).status_code == 200


@pytest.mark.parametrize("count", [1, POINTS])
def test_faults_are_named_in_bodies_of_any_size(client: TestClient, plane: str, count: int) -> None:
    link = f"/v1/meshes/{plane}/distances"
    headers = {"Content-Type": "application/json"}
    targets = [{"vertex": i % 100} for i in range(count)]

    def places(body: Any, code: str = "invalid_request") -> list[str]:
        problem = check_problem(client.post(link, json=body), 422, code)
        return [fault["pointer"] for fault in problem["errors"]]

    sources = MANY["sources"]
    assert places({"targets": targets}) == ["/sources"]
    assert places({"sources": sources, "targets": targets, "body": 1}) == ["/body"]
    wrong = {"sources": sources, "targets": [*targets, {"vertex": "0"}]}
    assert places(wrong) == [f"/targets/{count}/vertex"]
    assert places({**wrong, "targets": [*targets, {}]}) == [f"/targets/{count}"]
    outside = {"sources": sources, "targets": [*targets, {"vertex": 10**6}]}
    assert places(outside, "invalid_point") == [f"/targets/{count}/vertex"]
    cut = json.dumps({"sources": sources, "targets": targets})[:-1]
    problem = check_problem(client.post(link, content=cut, headers=headers), 400, "malformed_body")
    assert f"at line 1 column {len(cut)}" in problem["detail"]
    array = client.post(link, json=targets)
    assert check_problem(array, 422, "invalid_request")["errors"][0]["pointer"] == ""
