"""A service in this process: real worker processes, a real store."""

import os
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, asynccontextmanager, contextmanager, nullcontext
from io import BytesIO
from pathlib import Path
from typing import Any

import anyio
import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.engine.interface import Engine, Load
from app.main import create_app
from app.queries import ExecutionContext, FieldCache
from app.settings import Settings
from app.store.fields import FieldStore
from app.store.mesh_catalog import MeshCatalog
from app.store.meshes import MeshStore
from app.store.scratch import Scratch
from app.store.store import Store
from geodesic_core.fields.fast_sweep import FastSweep
from geodesic_core.fields.sweeps import WholeSweep
from tests.support import zoo
from tests.support.against import ClusterClient, is_against_cluster, serving_cluster
from tests.support.processes import workers_of
from tests.support.waiting import LONG_S, wait_until

NPY = {"Accept": "application/x-npy"}
TWO_TRIANGLES = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 0, 0], [8, 0, 0], [9, 1, 0]],
    "faces": [[0, 1, 2], [3, 4, 5]],
}

SLOW_FACES = 200_000
"""Distances on a sphere of so many faces take long enough to be stopped under way."""


def is_ready(client: Any) -> bool:
    return bool(client.get("/readyz").status_code == 200)


class ServiceClient(TestClient):
    """A client of a service in this process, which knows its engine and its workers.

    Without other settings there is one worker, and one for small work, and much time.
    """

    def __init__(self, store: Path, **settings: Any) -> None:
        own = {"workers": 1, "deadline_s": LONG_S} | settings
        app = create_app(Settings(store=store, **own))
        super().__init__(app, raise_server_exceptions=False)
        self.engine: Engine = app.state.service.engine
        self._others = workers_of(os.getpid())

    @property
    def load(self) -> Load:
        return self.engine.load

    def workers(self) -> set[int]:
        """Return the ids of the worker processes, if no other service has begun since."""
        return workers_of(os.getpid()) - self._others

    def wait_until_idle(self) -> None:
        """Wait until every worker is there and does nothing."""
        wait_until(lambda: self.load.busy == self.load.missing == self.load.waiting == 0)


@contextmanager
def serving(store: Path, **settings: Any) -> Iterator[ServiceClient]:
    """Run the service in this process, with workers of its own."""
    with ServiceClient(store, **settings) as client:
        wait_until(lambda: is_ready(client))
        yield client


Serve = Callable[..., AbstractContextManager[Any]]


@pytest.fixture(scope="session")
def serve(request: pytest.FixtureRequest) -> Serve:
    """`serving`; with ``--against cluster``, a function that runs a cluster likewise."""
    if not is_against_cluster(request.config):
        return serving
    s3, postgres = (request.getfixturevalue(name) for name in ("s3_server", "postgres"))

    def serve_cluster(folder: Path, **settings: Any) -> AbstractContextManager[ClusterClient]:
        urls = s3.new_url(), postgres.new_database()
        return serving_cluster(s3, *urls, folder, **settings)

    return serve_cluster


@pytest.fixture(scope="session")
def client(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    """A service that many tests share; they leave it as they found it, but for meshes."""
    with serve(tmp_path_factory.mktemp("store")) as client:
        yield client


@pytest.fixture
def one_replica(client: Any) -> Iterator[None]:
    """Have one replica answer all requests of a test: cheap answers are in the memory of each."""
    with client.staying() if isinstance(client, ClusterClient) else nullcontext():
        yield


@pytest.fixture(scope="session")
def plane(client: TestClient) -> str:
    """The id of a small flat mesh."""
    return upload_sample(client, "plane", 200)


@pytest.fixture(scope="module")
def terrain(client: TestClient) -> str:
    return upload_sample(client, "terrain", 800)


@pytest.fixture(scope="module")
def book(client: TestClient) -> str:
    """Three faces at one edge."""
    case = zoo.IRREGULAR["book_of_3"]
    mesh = {"vertices": case.vertices.tolist(), "faces": case.faces.tolist()}
    return str(client.post("/v1/meshes", json=mesh).json()["id"])


@pytest.fixture(scope="session")
def apart(client: TestClient) -> str:
    """The id of a mesh of two components."""
    return str(client.post("/v1/meshes", json=TWO_TRIANGLES).json()["id"])


@asynccontextmanager
async def scratch_folder(store: MeshStore) -> AsyncIterator[Path]:
    """Lend a scratch folder of a store on which no service runs."""
    scratch = Scratch(store.folder.parent, 2**60)
    scratch.prepare(is_alone=False)
    async with scratch.folder("somebody") as folder:
        yield folder.path


def store_mesh(root: Path, mesh: gc.TriangleMesh) -> str:
    """Put a mesh into a store on which no service runs."""
    store = MeshStore(root)
    own = Store(root)
    catalog = MeshCatalog(own.meshes, 2**60, evicts=False)

    async def add() -> str:
        async with scratch_folder(store) as folder:
            written = store.write_aside(mesh, folder / "mesh")
            await catalog.add(written)
            return written.mesh_id

    with own.owned():
        catalog.prepare()
        return anyio.run(add)


def upload_sample(client: TestClient, name: str, faces: int) -> str:
    response = client.post("/v1/meshes", params={"sample": name, "faces": faces})
    assert response.status_code in (200, 201), response.text
    return str(response.json()["id"])


def distances(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    """Ask for distances, from vertex 0 where ``body`` names no sources."""
    body.setdefault("sources", [{"vertex": 0}])
    return client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)


def field_cache(capacity: int = 10**9) -> FieldCache:
    """Return an empty cache of fields, over an empty store."""
    return FieldCache(capacity, FieldStore(Path("nowhere"), 10**9), "this code")


def context(
    cancel: Callable[[], bool] = lambda: False,
    memory: int = 2**40,
    fields: FieldCache | None = None,
) -> ExecutionContext:
    """Return what a query needs to run in this process, by default with an empty cache."""
    fields = field_cache() if fields is None else fields
    return ExecutionContext(cancel, lambda _: None, fields, memory, 10**7, 10**7)


def stored_mesh(client: TestClient, mesh_id: str) -> gc.TriangleMesh:
    """Return what is stored under an id, as the library has it."""
    load = lambda name: np.load(  # noqa: E731
        BytesIO(client.get(f"/v1/meshes/{mesh_id}/arrays/{name}").content)
    )
    return gc.TriangleMesh(load("vertices"), load("faces"))


def check_problem(response: Any, status: int, code: str) -> dict[str, Any]:
    """Check that a response is the problem it should be, with all that every problem has."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["code"] == code
    assert problem["status"] == status
    assert problem["type"] == f"/problems/{code}"
    assert problem["instance"] == response.url.path
    assert problem["request_id"] == response.headers["x-request-id"]
    assert response.headers["x-content-type-options"] == "nosniff"
    assert problem["detail"]
    return problem


@pytest.fixture
def sweeps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one with each sweep."""
    ran: list[int] = []

    def counted(run: Callable[..., Any]) -> Callable[..., Any]:
        def count_and_run(*arguments: Any, **options: Any) -> Any:
            ran.append(1)
            return run(*arguments, **options)

        return count_and_run

    monkeypatch.setattr(WholeSweep, "run_for", counted(WholeSweep.run_for))
    monkeypatch.setattr(FastSweep, "run", counted(FastSweep.run))
    return ran
