"""A service whose meshes and answers are in an object store."""

import threading
from base64 import b64encode
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any

import anyio
import numpy as np
import pytest
from structlog.testing import capture_logs

import geodesic_core as gc
from tests.support.azure import Azure
from tests.support.gcs import GCS
from tests.support.processes import refused_start, stopped
from tests.support.s3 import S3
from tests.support.service import (
    NPY,
    ServiceClient,
    check_problem,
    distances,
    serving,
    stored_mesh,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until

pytestmark = pytest.mark.file_slice(3)

IDENTITY = {"Accept-Encoding": "identity"}
LONG = {**NPY, **IDENTITY}
both_providers = pytest.mark.parametrize("provider", ["s3", "gcs"], indirect=True)


@pytest.fixture
def provider(request: pytest.FixtureRequest) -> S3:
    """The S3 server, or another one that a test names."""
    server: S3 = request.getfixturevalue(getattr(request, "param", "s3"))
    return server


@pytest.fixture
def url(provider: S3) -> str:
    return provider.new_url()


@pytest.fixture
def service(url: str, tmp_path: Path) -> Iterator[ServiceClient]:
    with serving(url, copies=tmp_path / "copies") as client:  # type: ignore[arg-type]
        yield client


def copies_of(service: ServiceClient) -> set[str]:
    folder = service.app.state.service.settings.folder / "meshes"  # type: ignore[attr-defined]
    return {path.name for path in folder.iterdir()}


def drop_copies(service: ServiceClient) -> None:
    """Have the service pull each mesh again, as another machine would."""
    supply = service.app.state.service.store.supply  # type: ignore[attr-defined]
    for mesh_id in copies_of(service):
        anyio.run(supply.drop_copy, mesh_id)


def test_a_mesh_that_this_machine_lacks_is_cut_and_sent(service: ServiceClient) -> None:
    mesh_id = upload_sample(service, "plane", 200)
    drop_copies(service)
    made = service.post(f"/v1/meshes/{mesh_id}/cut", json={"curves": [{"polyline": [0, 1]}]})
    assert made.status_code == 201
    drop_copies(service)
    own = gc.cut(stored_mesh(service, mesh_id), gc.Curve([0, 1]))
    parts = np.load(BytesIO(service.get(f"{made.headers['location']}/arrays/parts").content))
    np.testing.assert_array_equal(parts, own.parts)
    reached = distances(service, made.json()["cut_mesh_id"]).json()["distances"]
    assert reached == [
        each if np.isfinite(each) else None
        for each in gc.exact_distance(own.mesh, 0).distances.tolist()
    ]


@both_providers
def test_a_mesh_and_its_answers_are_objects_and_all_goes(
    service: ServiceClient, provider: S3, url: str, tmp_path: Path
) -> None:
    mesh_id = upload_sample(service, "plane", 30_000)
    answer = distances(service, mesh_id, LONG)
    assert answer.status_code == 200
    kept = provider.names(url)
    assert f"meshes/{mesh_id}/manifest.json" in kept
    assert sum(name.startswith(f"results/{mesh_id}/") for name in kept) == 2
    assert not list((tmp_path / "copies" / "results").glob("*/*"))
    assert not any(name.startswith("uploads/") for name in kept)

    again = distances(service, mesh_id, LONG)
    assert (again.content, again.headers["server-timing"]) == (answer.content, "kept")
    assert service.delete(f"/v1/meshes/{mesh_id}").status_code == 204
    wait_until(lambda: provider.names(url) == {"owner.json"})
    assert copies_of(service) == set()
    check_problem(service.get(f"/v1/meshes/{mesh_id}"), 404, "mesh_not_found")


@both_providers
def test_ranges_of_an_answer_are_streamed(service: ServiceClient) -> None:
    mesh_id = upload_sample(service, "plane", 30_000)
    job = distances(service, mesh_id, {**LONG, "Prefer": "respond-async"})
    link = job.headers["location"]
    wait_until(lambda: service.get(link).json()["status"] == "successful")
    whole = service.get(f"{link}/results").content
    assert whole == distances(service, mesh_id, LONG).content
    for text, expected in {
        "bytes=0-99": whole[:100],
        "bytes=100000-100099": whole[100_000:100_100],
        "bytes=-50": whole[-50:],
    }.items():
        part = service.get(f"{link}/results", headers={"Range": text})
        assert (part.status_code, part.content) == (206, expected)
    several = service.get(f"{link}/results", headers={"Range": "bytes=0-9,50-59"})
    assert several.status_code == 206
    assert whole[50:60] in several.content


def test_a_large_matrix_is_joined_from_objects(url: str, s3: S3, tmp_path: Path) -> None:
    settings = {"copies": tmp_path / "copies", "max_matrix_cells": 100}
    with serving(url, **settings) as service:  # type: ignore[arg-type]
        mesh_id = upload_sample(service, "sphere", 1280)
        link = f"/v1/meshes/{mesh_id}/matrix?format=npy"
        ends = {"sources": "all", "targets": "all"}
        job = service.post(link, json=ends, headers={"Prefer": "respond-async"}).json()["links"]
        wait_until(lambda: service.get(job["self"]).json()["finished"] is not None)
        gc.write_matrix(stored_mesh(service, mesh_id), tmp_path / "table.npy", "all")
        expected = (tmp_path / "table.npy").read_bytes()
        assert service.get(job["results"]).content == expected
        part = service.get(job["results"], headers={"Range": "bytes=100000-2100000"})
        assert (part.status_code, part.content) == (206, expected[100_000:2_100_001])
        assert not [*(tmp_path / "copies" / "results").glob("*/*")]
        results = f"results/{mesh_id}/"
        wait_until(lambda: sum(name.startswith(results) for name in s3.names(url)) == 2)


def test_a_mesh_is_pulled_once_however_many_ask(service: ServiceClient) -> None:
    mesh_id = upload_sample(service, "sphere", 2000)
    drop_copies(service)
    pulls = []
    objects = service.app.state.service.store.meshes._objects  # type: ignore[attr-defined]
    fetch = objects.fetch
    objects.fetch = lambda name, path: pulls.append(name) or fetch(name, path)

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda n: service.get(_path(mesh_id, n)).status_code, range(16)))

    assert set(answers) == {200}
    assert len(pulls) == len(set(pulls)) > 0


def _path(mesh_id: str, number: int) -> str:
    return f"/v1/meshes/{mesh_id}/path?from=v0&to=v{number + 1}"


@pytest.mark.full
def test_copies_are_bounded_and_pulled_again(url: str, tmp_path: Path) -> None:
    with serving(url, copies=tmp_path, copies_bytes=1_500_000) as client:  # type: ignore[arg-type]
        meshes = [upload_sample(client, "plane", 5000 + n) for n in range(4)]
        assert 0 < len(copies_of(client)) < 4
        for mesh_id in meshes:
            assert client.get(_path(mesh_id, 1)).status_code == 200
        assert 0 < len(copies_of(client)) < 4


def test_damage_of_a_mesh_is_noticed_and_an_upload_heals_it(
    service: ServiceClient, s3: S3, url: str
) -> None:
    mesh_id = upload_sample(service, "plane", 500)
    expected = service.get(_path(mesh_id, 5)).json()
    array = next(name for name in s3.names(url) if name.endswith("/faces.npy"))
    s3.damage(url, array)
    drop_copies(service)
    check_problem(service.get(_path(mesh_id, 6)), 500, "mesh_damaged")

    assert upload_sample(service, "plane", 500) == mesh_id
    drop_copies(service)
    assert service.get(_path(mesh_id, 5)).json()["length"] == expected["length"]
    assert array not in s3.names(url)


@pytest.mark.full
def test_a_damaged_answer_is_cut_off_and_computed_again(
    service: ServiceClient, s3: S3, url: str
) -> None:
    mesh_id = upload_sample(service, "plane", 30_000)
    expected = distances(service, mesh_id, LONG).content
    body = next(name for name in s3.names(url) if name.endswith(".body"))
    s3.damage(url, body)
    broken = distances(service, mesh_id, LONG)
    assert broken.status_code != 200 or len(broken.content) < len(expected)
    wait_until(lambda: body not in s3.names(url))
    assert distances(service, mesh_id, LONG).content == expected


def test_two_uploads_of_one_mesh_at_once_store_it_once(
    service: ServiceClient, s3: S3, url: str
) -> None:
    def upload(_number: int) -> Any:
        return service.post("/v1/meshes", params={"sample": "sphere", "faces": 3000})

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(upload, range(4)))

    assert sorted(answer.status_code for answer in answers) == [200, 200, 200, 201]
    (mesh_id,) = {answer.json()["id"] for answer in answers}
    wait_until(lambda: len({name.split("/")[2] for name in s3.names(url) if "npy" in name}) == 1)
    drop_copies(service)
    assert service.get(_path(mesh_id, 1)).status_code == 200


def test_a_store_that_is_away_is_a_clear_error_and_comes_back(
    service: ServiceClient, s3: S3
) -> None:
    mesh_id = upload_sample(service, "plane", 500)
    with s3.away():
        wait_until(lambda: service.get(f"/v1/meshes/{mesh_id}").status_code == 503)
        answer = service.get(_path(mesh_id, 3))
        problem = check_problem(answer, 503, "store_unavailable")
        assert answer.headers["retry-after"] == "1", problem
        upload = service.post("/v1/meshes", params={"sample": "plane", "faces": 800})
        check_problem(upload, 503, "store_unavailable")
    assert service.get(_path(mesh_id, 3)).status_code == 200
    assert upload_sample(service, "plane", 800)


@pytest.mark.parametrize("wish", ["respond-async", "respond-async, wait=1"])
def test_a_job_waits_for_a_store_that_is_away(service: ServiceClient, s3: S3, wish: str) -> None:
    mesh_id = upload_sample(service, "plane", 30_000)
    with ExitStack() as stack, capture_logs() as lines:
        with stopped(service.workers()):
            job = distances(service, mesh_id, {**LONG, "Prefer": wish})
            stack.enter_context(s3.away())  # before the work is done
        link = job.headers["location"]
        wait_until(lambda: any(line["event"].startswith("job waits") for line in lines))
        assert service.get(link).json()["finished"] is None
    wait_until(lambda: service.get(link).json()["finished"])
    assert service.get(f"{link}/results").content == distances(service, mesh_id, LONG).content


@pytest.mark.full
def test_a_mesh_that_is_deleted_while_it_is_pulled_is_gone(service: ServiceClient) -> None:
    mesh_id = upload_sample(service, "sphere", 3000)
    drop_copies(service)
    objects = service.app.state.service.store.meshes._objects  # type: ignore[attr-defined]
    fetch, is_deleted = objects.fetch, threading.Event()

    def slow(name: str, path: Path) -> int:
        is_deleted.wait(LONG_S)
        return fetch(name, path)

    objects.fetch = slow
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(service.get, _path(mesh_id, 1))
        wait_until(lambda: bool(service.app.state.service.store.meshes._pulls))  # type: ignore[attr-defined]
        assert service.delete(f"/v1/meshes/{mesh_id}").status_code == 204
        is_deleted.set()
        check_problem(asked.result(), 404, "mesh_not_found")
    assert copies_of(service) == set()


@pytest.mark.slice(2)
@pytest.mark.parametrize(
    ("store", "environment", "said"),
    [
        ("s3://no-such-bucket/x", {}, "does not exist: create its bucket"),
        ("s3://", {}, "is not the URL of a store"),
        ("s3://bucket/x", {"AWS_ENDPOINT_URL": "http://127.0.0.1:9"}, "cannot be used"),
        ("gs://no-such-bucket/x", {}, "does not exist: create its bucket"),
        ("gs://bucket/x", {"GOOGLE_SERVICE_ACCOUNT": "/nowhere"}, "Unable to open service account"),
        ("az://container/x", {}, "Account must be specified"),
    ],
)
@pytest.mark.usefixtures("s3", "gcs")
def test_starts_that_are_refused(
    tmp_path: Path, store: str, environment: dict[str, str], said: str
) -> None:
    settings = {"GEODESIC_COPIES": str(tmp_path), **environment}
    assert said in refused_start(store, **settings)  # type: ignore[arg-type]


def test_wrong_credentials_are_refused(s3: S3, url: str, tmp_path: Path) -> None:
    with s3.asking_for_credentials():
        said = refused_start(url, GEODESIC_COPIES=str(tmp_path))  # type: ignore[arg-type]
    assert "cannot be used" in said
    assert "AWS_ENDPOINT_URL and AWS_ACCESS_KEY_ID" in said


def test_wrong_credentials_are_refused_by_google(gcs: GCS, tmp_path: Path) -> None:
    wrong = {"GOOGLE_BEARER_TOKEN": "another"}
    said = refused_start(gcs.new_url(), GEODESIC_COPIES=str(tmp_path), **wrong)  # type: ignore[arg-type]
    assert "cannot be used" in said
    assert "GOOGLE_APPLICATION_CREDENTIALS" in said


def test_wrong_credentials_are_refused_by_azure(azure: Azure, tmp_path: Path) -> None:
    wrong = {"AZURE_STORAGE_ACCOUNT_KEY": b64encode(b"another").decode()}
    said = refused_start(azure.new_url(), GEODESIC_COPIES=str(tmp_path), **wrong)  # type: ignore[arg-type]
    assert "Server failed to authenticate the request" in said
    assert "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY" in said
