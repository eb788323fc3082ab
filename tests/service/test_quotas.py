"""Quotas: a caller that has as much as it may is refused, and the others are served."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from tests.support.processes import stopped
from tests.support.service import ServiceClient, check_problem, serving
from tests.support.waiting import LONG_S, wait_until

ALICE, BOB = ({"Authorization": f"Bearer {name}-0123456789abc"} for name in ("alice", "bob"))
KEYS = "alice:alice-0123456789abc,bob:bob-0123456789abc"
ASYNC = {"Prefer": "respond-async"}


@contextmanager
def keyed(store: Path, **settings: Any) -> Iterator[ServiceClient]:
    with serving(store, api_keys=KEYS, cancel_grace_s=LONG_S, **settings) as client:
        client.wait_until_idle()
        yield client


def upload(client: TestClient, caller: Any, faces: int) -> Any:
    sample = {"sample": "plane", "faces": faces}
    return client.post("/v1/meshes", params=sample, headers=caller)


def limits_of(client: TestClient, caller: Any) -> Any:
    return client.get("/v1", headers=caller).json()["limits"]


def test_uploads_at_once(tmp_path: Path) -> None:
    with keyed(tmp_path, quota_uploads=1) as client, ThreadPoolExecutor(2) as pool:
        assert limits_of(client, ALICE)["quota_uploads"] == 1
        with stopped(client.workers()):
            of_alice = pool.submit(upload, client, ALICE, 50)
            wait_until(lambda: client.load.busy + client.load.waiting == 1)
            for again in (
                upload(client, ALICE, 72),
                client.post("/v1/meshes", content=b"off", headers=ALICE),
            ):
                problem = check_problem(again, 429, "quota_exceeded")
                assert (problem["limit"], problem["actual"]) == (1, 2)
                assert problem["setting"] == "quota_uploads"
                assert again.headers["retry-after"] == "1"
            assert client.get("/v1", headers=ALICE).status_code == 200
            of_bob = pool.submit(upload, client, BOB, 98)
            wait_until(lambda: client.load.busy + client.load.waiting == 2)

        assert (of_alice.result().status_code, of_bob.result().status_code) == (201, 201)
        assert upload(client, ALICE, 72).status_code == 201


def test_without_keys_uploads_at_once_are_counted_by_address(tmp_path: Path) -> None:
    with serving(tmp_path, quota_uploads=1) as client, ThreadPoolExecutor(2) as pool:
        client.wait_until_idle()
        other = TestClient(client.app, client=("10.0.0.2", 1))
        other.portal = client.portal
        with stopped(client.workers()):
            first = pool.submit(upload, client, None, 50)
            wait_until(lambda: client.load.busy + client.load.waiting == 1)
            check_problem(upload(client, None, 72), 429, "quota_exceeded")
            second = pool.submit(upload, other, None, 98)
            wait_until(lambda: client.load.busy + client.load.waiting == 2)
        assert (first.result().status_code, second.result().status_code) == (201, 201)


def test_answers_to_jobs_of_one_caller_leave_room_for_those_of_another(tmp_path: Path) -> None:
    """Alice fills what she may have; the next job is refused before any work, and Bob's is not."""
    with keyed(tmp_path, results_bytes=100_000, results_memory_bytes=1) as client:
        link = f"/v1/meshes/{upload(client, ALICE, 3200).json()['id']}/distances"  # 1 681 vertices
        assert limits_of(client, ALICE)["quota_results_bytes"] == 50_000

        def submit(caller: Any, vertex: int) -> Any:
            headers = {**caller, "Prefer": "respond-async", "Accept": "application/x-npy"}
            return client.post(link, json={"sources": [vertex]}, headers=headers)

        def run(caller: Any, vertex: int) -> None:
            job = submit(caller, vertex).headers["location"]
            wait_until(lambda: client.get(job, headers=caller).json()["status"] == "successful")

        for vertex in range(3):
            run(ALICE, vertex)
        solved = client.app.state.service.answering.solves["distances"]
        problem = check_problem(submit(ALICE, 3), 507, "quota_exceeded")
        assert problem["limit"] == 50_000 < problem["actual"]
        assert client.app.state.service.answering.solves["distances"] == solved
        run(BOB, 4)
