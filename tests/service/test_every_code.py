"""Every code of the error table, met by a client of a service that runs."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from starlette.routing import compile_path
from starlette.testclient import TestClient

from app.engine.slot import Slot
from app.errors import CODES, StateUnavailableError, StoreUnavailableError
from app.jobs import JobRepository
from app.main import create_app
from app.settings import Settings
from app.store.mesh_home import MeshHome
from tests.support.disks import fill_disk
from tests.support.listening import listening, read_answer
from tests.support.processes import stopped
from tests.support.service import (
    SLOW_FACES,
    TWO_TRIANGLES,
    ServiceClient,
    check_problem,
    serving,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until

ALICE, BOB = ({"Authorization": f"Bearer {name}-0123456789abc"} for name in ("alice", "bob"))
ASYNC = {"Prefer": "respond-async"}
TARGET = [{"vertex": 1}]


class Site:
    """A service with low limits, a small mesh and a large one; Alice stored them."""

    def __init__(self, client: ServiceClient, store: Path) -> None:
        client.headers.update(ALICE)
        self.client, self.store = client, store
        self.small = upload_sample(client, "plane", 200)
        self.slow = upload_sample(client, "sphere", SLOW_FACES)
        self.start_distances = count(1)
        self.patch = pytest.MonkeyPatch()

    def ask(self, mesh_id: str, headers: Any = None, **body: Any) -> Any:
        """Ask for distances that were not asked for before."""
        source = {"vertex": 0, "start_distance": next(self.start_distances)}
        body.setdefault("sources", [source])
        return self.client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)

    def send(self, content: str, media_type: str = "application/json") -> Any:
        link, headers = f"/v1/meshes/{self.small}/distances", {"Content-Type": media_type}
        return self.client.post(link, content=content, headers=headers)

    @contextmanager
    def job(self) -> Iterator[str]:
        """Have a job that gets no further, while inside."""
        with stopped(self.client.workers()):
            link = self.submit()
            yield link
            self.client.delete(link)

    def submit(self) -> str:
        response = self.ask(self.slow, ASYNC, targets=TARGET)
        assert response.status_code == 202, response.text
        return str(response.headers["location"])

    def is_running(self, link: str) -> bool:
        return bool(self.client.get(link).json()["status"] == "running")

    def reset(self) -> None:
        """Leave nothing running, nothing patched."""
        self.patch.undo()
        for job in self.client.get("/v1/jobs").json()["jobs"]:
            self.client.delete(f"/v1/jobs/{job['id']}")
        self.client.wait_until_idle()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    store = tmp_path_factory.mktemp("site")
    limits = {
        "api_keys": "alice:alice-0123456789abc,bob:bob-0123456789abc",
        "max_concurrent": 2,
        "queue_size": 1,
        "max_query_bytes": 2000,
        "max_json_values": 5000,
        "max_sources": 2,
        "query_memory_bytes": 50_000_000,
        "cancel_grace_s": LONG_S,
        "quota_uploads": 1,
        "quota_results_bytes": 100_000,
        "allowed_hosts": ["testserver"],
    }
    with serving(store, **limits) as client:
        yield Site(client, store)


def not_finished(site: Site) -> Any:
    with site.job() as job:
        return site.client.get(f"{job}/results")


def dismissed(site: Site) -> Any:
    with site.job() as job:
        site.client.post(f"{job}/cancel")
        return site.client.get(f"{job}/results")


def too_large(site: Site) -> Any:
    mesh_id = upload_sample(site.client, "knot", 30_000)
    lines = {"sources": [{"vertex": 0}], "count": 500}  # windows are kept for each level
    return site.client.post(f"/v1/meshes/{mesh_id}/isolines", json=lines)


def without_positions(site: Site) -> Any:
    triangle = {"faces": [[0, 1, 2]], "lengths": [[1, 1, 1]]}
    made = site.client.post("/v1/meshes", json=triangle)
    assert made.status_code < 300, made.text
    return site.ask(made.json()["id"], sources=[{"position": [0, 0, 0]}])


def limited(site: Site) -> Any:
    with ThreadPoolExecutor() as threads, stopped(site.client.workers()):
        for _ in range(2):
            threads.submit(site.ask, site.small, BOB)
        wait_until(lambda: site.client.load.busy + site.client.load.waiting == 2)
        return site.client.get("/v1", headers=BOB)


def uploading(site: Site) -> Any:
    upload = partial(site.client.post, "/v1/meshes", params={"sample": "plane", "faces": 8})
    with ThreadPoolExecutor() as threads, stopped(site.client.workers()):
        threads.submit(upload)
        wait_until(lambda: site.client.load.busy == 1)
        return upload()


def full(site: Site) -> Any:
    with site.job() as first:
        wait_until(lambda: site.is_running(first))
        with site.job():
            wait_until(lambda: site.client.load.waiting == 1)
            return site.ask(site.slow, targets=TARGET)


def defect(site: Site) -> Any:
    site.patch.setattr("app.http.routes.about.Index", None)
    return site.client.get("/")


def killed(site: Site) -> Any:
    workers, job = site.client.workers(), site.submit()
    # Work that its worker had not taken up yet goes to another one, and succeeds.
    wait_until(lambda: site.client.get(job).json()["progress"] > 0)
    for pid in workers:
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: not site.is_running(job))
    return site.client.get(f"{job}/results")


def damaged(site: Site) -> Any:
    mesh_id = upload_sample(site.client, "plane", 300)
    path = site.store / "meshes" / mesh_id / "vertices.npy"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    return site.ask(mesh_id)


def no_state(site: Site) -> Any:
    async def away(_repository: JobRepository, *_arguments: Any) -> Any:
        raise StateUnavailableError

    site.patch.setattr(JobRepository, "page", away)
    return site.client.get("/v1/jobs")


def no_store(site: Site) -> Any:
    async def away(_meshes: MeshHome, _mesh_id: str) -> Any:
        raise StoreUnavailableError

    site.patch.setattr(MeshHome, "manifest", away)
    return site.client.get(f"/v1/meshes/{site.small}")


def no_disk(site: Site) -> Any:
    fill_disk(site.patch, "upload")
    return site.client.post("/v1/meshes", json=TWO_TRIANGLES)


async def never_open(_slot: Slot) -> None:
    await asyncio.Event().wait()


def not_started(site: Site) -> Any:
    site.patch.setattr(Slot, "open", never_open)
    with TestClient(create_app(Settings(store=site.store / "other", workers=1))) as client:
        return client.get("/readyz")


def late(site: Site) -> Any:
    with stopped(site.client.workers()):
        return site.ask(site.small, {"X-Timeout-Ms": "100"})


def draining(site: Site) -> Any:
    app = create_app(Settings(store=site.store / "other", workers=1))
    with TestClient(app) as client:
        app.state.service.drain()
        return client.post("/v1/meshes", json=TWO_TRIANGLES)


MANY = [{"vertex": 0}] * 3
BROKEN = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 3]]}


def on_a_connection(data: bytes, **limits: int) -> Callable[[Site], Any]:
    """Return the provocation that sends bytes beside an open connection."""

    def provoke(site: Site) -> Any:
        few = Settings(store=site.store / "other", **limits)
        with listening(few) as listener, listener.connect(b"GET / HTTP/1.1\r\n\r\n") as first:
            read_answer(first)
            return listener.send(data)

    return provoke


PROVOKED: dict[str, Callable[[Site], Any]] = {
    "malformed_body": lambda site: site.send("{"),
    "idempotency_key_unused": lambda site: site.ask(site.small, {"Idempotency-Key": "k"}),
    "malformed_request": on_a_connection(b"nonsense\r\n\r\n"),
    "unauthorized": lambda site: site.client.get("/v1", headers={"Authorization": "Bearer no"}),
    "origin_not_allowed": lambda site: site.client.post(
        "/v1/meshes", json=TWO_TRIANGLES, headers={"Origin": "https://evil.example"}
    ),
    "not_found": lambda site: site.client.get("/nowhere"),
    "mesh_not_found": lambda site: site.client.get("/v1/meshes/nonsense"),
    "job_not_found": lambda site: site.client.get("/v1/jobs/nonsense"),
    "method_not_allowed": lambda site: site.client.put("/v1/meshes"),
    "not_acceptable": lambda site: site.ask(site.small, {"Accept": "image/png"}),
    "job_not_finished": not_finished,
    "job_dismissed": dismissed,
    "upload_too_large": lambda site: site.send(" " * 2001),
    "result_too_large": lambda site: site.ask(site.slow),
    "unsupported_media_type": lambda site: site.send("{}", "text/plain"),
    "range_not_satisfiable": lambda site: site.client.get(
        f"/v1/meshes/{site.small}/arrays/faces", headers={"Range": "bytes=99999999-"}
    ),
    "host_not_allowed": lambda site: site.client.get("/v1", headers={"Host": "evil.example"}),
    "invalid_request": lambda site: site.ask(site.small, colour="red"),
    "invalid_mesh": lambda site: site.client.post("/v1/meshes", json=BROKEN),
    "invalid_point": lambda site: site.ask(site.small, sources=[{"vertex": -1}]),
    "not_embedded": without_positions,
    "limit_exceeded": lambda site: site.ask(site.small, sources=MANY),
    "memory_limit": too_large,
    "rate_limited": limited,
    "quota_exceeded": uploading,
    "header_too_large": on_a_connection(b"GET / HTTP/1.1\r\n" + b"a:b\r\n" * 10_000),
    "internal_error": defect,
    "worker_died": killed,
    "mesh_damaged": damaged,
    "queue_full": full,
    "too_many_connections": on_a_connection(
        b"GET / HTTP/1.1\r\n\r\n", max_connections=1, max_caller_connections=1
    ),
    "engine_unavailable": not_started,
    "state_unavailable": no_state,
    "store_unavailable": no_store,
    "draining": draining,
    "deadline_exceeded": late,
    "storage_full": no_disk,
}


PROVOKED_OTHERWISE: dict[tuple[str, int], Callable[[Site], Any]] = {
    ("quota_exceeded", 507): lambda site: site.ask(
        site.slow, {**ASYNC, "Accept": "application/x-npy"}
    ),
}
"""Provocations of statuses that are not the first of their code"""

CASES = {(code, CODES[code].status): provoke for code, provoke in PROVOKED.items()}
CASES |= PROVOKED_OTHERWISE


def test_the_table_is_whole() -> None:
    assert list(PROVOKED) == list(CODES)
    assert set(CASES) == {(name, status) for name, row in CODES.items() for status in row.statuses}


@pytest.mark.parametrize(("code", "status"), CASES)
def test_every_code_is_answered_by_an_operation_that_documents_it(
    site: Site, code: str, status: int
) -> None:
    try:
        response = CASES[code, status](site)
        check_problem(response, status, code)
        if code != "method_not_allowed":
            check_documented(site, response, code)
        if status in (409, 429, 503):
            assert int(response.headers["retry-after"]) >= 1
    finally:
        site.reset()


def check_documented(site: Site, response: Any, code: str) -> None:
    method = response.request.method.lower()
    for template, path in site.client.get("/openapi.json").json()["paths"].items():
        if compile_path(template)[0].match(response.url.path) and method in path:
            described = path[method]["responses"][str(response.status_code)]["description"]
            assert code in described.split(", ")
            return
    assert response.url.path == "/nowhere"
