"""Matrices over HTTP that are larger than memory: in parts, as jobs, read in ranges."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geodesic_client import Client, Mesh, ProblemError
from scipy.sparse import load_npz

import geodesic_core as gc
from tests.support.service import (
    ServiceClient,
    check_problem,
    serving,
    stored_mesh,
    upload_sample,
)
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(2)

ASYNC = {"Prefer": "respond-async"}
ALL = {"sources": "all", "targets": "all"}
FACES = 1280
"""Of a sphere with 642 vertices, whose matrix has three parts"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("store")


@pytest.fixture(scope="module")
def service(store: Path) -> Iterator[ServiceClient]:
    limits = {"max_matrix_cells": 100, "max_sources": 20, "results_bytes": 20_000_000}
    with serving(store, workers=2, **limits) as client:
        yield client


@pytest.fixture(autouse=True)
def dismiss_jobs(service: ServiceClient) -> Iterator[None]:
    yield
    for job in service.get("/v1/jobs").json()["jobs"]:
        service.delete(f"/v1/jobs/{job['id']}")


@pytest.fixture(scope="module")
def sphere(service: ServiceClient) -> str:
    return upload_sample(service, "sphere", FACES)


@pytest.fixture(scope="module")
def same(service: ServiceClient, sphere: str) -> gc.TriangleMesh:
    """The mesh, as the library has it."""
    return stored_mesh(service, sphere)


def submit(service: ServiceClient, mesh_id: str, query: str = "", **body: Any) -> Any:
    """Submit a matrix as a job, and return the document at its end."""
    format_ = "npz" if body.get("layout") == "sparse" else "npy"
    link = f"/v1/meshes/{mesh_id}/matrix?format={format_}{query}"
    response = service.post(link, json=ALL | body, headers=ASYNC)
    assert response.status_code == 202, response.text
    job = response.json()["links"]["self"]
    wait_until(lambda: service.get(job).json()["finished"] is not None)
    return service.get(job).json()


INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
APPROXIMATE = {"method": "approximate", "relative_error": 1e-3}


@pytest.mark.parametrize(
    ("query", "body", "options"),
    [
        ("&dtype=float32", {}, {}),
        ("", {"max_distance": 1.5, "barriers": [*range(200)]}, {}),
        ("", {"sources": [{"vertex": 3}, INSIDE]}, {}),
        ("", {"targets": [5, INSIDE, 3]}, {}),
        ("", {"method": "approximate", "relative_error": 1e-4}, {}),
        ("", {"method": "approximate", "absolute_error": 1e-3}, {"relative_error": None}),
        ("&dtype=float32", {"method": "fast", "effort": 1, "max_distance": 1.5}, {}),
        ("", {"layout": "sparse", "max_distance": 0.5}, {}),
        ("", {"layout": "sparse", "sources": [{"vertex": 3}, INSIDE]}, {}),
        ("&dtype=float32", {"layout": "sparse", "targets": [5, INSIDE, 3], "method": "fast"}, {}),
        ("", {"layout": "sparse", "max_distance": 0.6, "barriers": [*range(9)], **APPROXIMATE}, {}),
    ],
    ids=str,
)
def test_the_file_is_the_library_s_to_the_bit(
    service: ServiceClient,
    store: Path,
    sphere: str,
    same: gc.TriangleMesh,
    tmp_path: Path,
    query: str,
    body: Any,
    options: Any,
) -> None:
    job = submit(service, sphere, query, **body)
    answer = service.get(job["links"]["results"])

    inside = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    sides = {"sources": [3, inside], "targets": [5, inside, 3]}
    starts = sides["sources"] if "sources" in body else "all"
    stops = sides["targets"] if "targets" in body else "all"
    sides |= {"layout": []}
    limits = {name: value for name, value in body.items() if name not in sides}
    out = tmp_path / ("table.npz" if body.get("layout") == "sparse" else "table.npy")
    if "dtype=float32" in query:
        options = {**options, "dtype": "float32"}
    written = gc.write_matrix(same, out, starts, stops, **limits, **options)
    assert answer.content == out.read_bytes()
    assert job["progress"] == 1.0
    if out.suffix == ".npz":
        table = load_npz(out)
        missing = math.prod(table.shape) - table.nnz
    else:
        table = np.load(out)
        missing = int(np.isinf(table).sum())
    assert (missing > 0) == ("max_distance" in body)
    headers = answer.headers
    assert headers["geodesic-shape"] == ",".join(map(str, table.shape))
    assert headers["geodesic-dtype"] == table.dtype.str
    assert headers["geodesic-method"] == body.get("method", "exact")
    assert json.loads(headers["geodesic-error-bound"]) == asdict(written.error_bound)
    assert sum(json.loads(headers["geodesic-unreachable"]).values()) == missing
    assert not [*store.glob("results/*/*-*")], "parts stay behind"


def test_ranges(service: ServiceClient, sphere: str) -> None:
    link = submit(service, sphere)["links"]["results"]
    whole = service.get(link)
    etag, content = whole.headers["etag"], whole.content

    for ranges, part in (("bytes=128-5263", content[128:5264]), ("bytes=-16", content[-16:])):
        response = service.get(link, headers={"Range": ranges, "If-Range": etag})
        assert (response.status_code, response.content) == (206, part)
        assert response.headers["etag"] == etag
    total = f"bytes */{len(content)}"
    response = service.get(link, headers={"Range": f"bytes={len(content)}-"})
    check_problem(response, 416, "range_not_satisfiable")
    assert response.headers["content-range"] == total
    stale = service.get(link, headers={"Range": "bytes=0-9", "If-Range": '"other"'})
    assert (stale.status_code, stale.content) == (200, content)
    assert service.get(link, headers={"If-None-Match": etag}).status_code == 304


def test_the_same_matrix_is_not_computed_again(service: ServiceClient, sphere: str) -> None:
    first, again = (submit(service, sphere, max_distance=0.5) for _ in range(2))

    links = [job["links"]["results"] for job in (first, again)]
    tags = {service.get(link, headers={"Range": "bytes=0-0"}).headers["etag"] for link in links}
    assert len(tags) == 1
    assert first["id"] != again["id"]


def test_a_point_that_is_not_on_the_mesh(service: ServiceClient, sphere: str) -> None:
    link = f"/v1/meshes/{sphere}/matrix?format=npy"
    body = {"sources": [{"vertex": 0}] * 30, "targets": [{"vertex": 642}]}
    problem = check_problem(service.post(link, json=body, headers=ASYNC), 422, "invalid_point")
    assert problem["errors"][0]["pointer"] == "/targets/0/vertex"


@pytest.mark.parametrize("side", ["sources", "targets"])
@pytest.mark.parametrize("points", ["some", "", [], None, {"vertex": 0}, 3])
def test_other_points_are_refused(
    service: ServiceClient, sphere: str, side: str, points: Any
) -> None:
    body = {"sources": [0], "targets": [0]} | {side: points}
    problem = check_problem(
        service.post(f"/v1/meshes/{sphere}/matrix", json=body), 422, "invalid_request"
    )
    assert [fault["pointer"] for fault in problem["errors"]] == [f"/{side}"]


def test_pairs_are_written_one_by_one(service: ServiceClient, sphere: str) -> None:
    body = {"sources": [0], "targets": "all", "layout": "pairs"}
    response = service.post(f"/v1/meshes/{sphere}/matrix", json=body)
    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/targets"]


def test_all_vertices_in_memory(service: ServiceClient) -> None:
    plane = upload_sample(service, "plane", 8)
    mesh = stored_mesh(service, plane)
    answer = service.post(f"/v1/meshes/{plane}/matrix", json=ALL).json()
    vertices = range(len(mesh.vertices))
    assert answer["distances"] == gc.distance_matrix(mesh, vertices, vertices).tolist()
    assert [end["vertex"] for end in answer["targets"]] == [*vertices]
    mixed = service.post(
        f"/v1/meshes/{plane}/matrix", json=ALL | {"sources": [INSIDE | {"face": 3}]}
    )
    inside = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    assert mixed.json()["distances"] == gc.distance_matrix(mesh, [inside], vertices).tolist()


def test_bounds(service: ServiceClient, sphere: str) -> None:
    link = f"/v1/meshes/{sphere}/matrix"
    # In memory, and in other formats than numpy's, what is held in memory counts.
    for query, headers in (("?format=npy", {}), ("", ASYNC), ("?format=octets", ASYNC)):
        problem = check_problem(
            service.post(f"{link}{query}", json=ALL, headers=headers), 422, "limit_exceeded"
        )
        assert (problem["limit"], problem["actual"]) == (20, 642)
        assert problem["setting"] == "max_sources"
        assert "respond-async" in problem["hint"]
        body = {"sources": [0], "targets": "all"}
        problem = check_problem(
            service.post(f"{link}{query}", json=body, headers=headers), 422, "limit_exceeded"
        )
        assert (problem["limit"], problem["actual"]) == (100, 642)
        assert problem["setting"] == "max_matrix_cells"
    # As a job the store counts: the parts, of which a half is enough, and the file.
    larger = upload_sample(service, "sphere", 4000)
    vertices = len(stored_mesh(service, larger).vertices)
    for headers in (ASYNC, {"Prefer": "respond-async, wait=1"}):
        response = service.post(f"/v1/meshes/{larger}/matrix?format=npy", json=ALL, headers=headers)
        problem = check_problem(response, 422, "limit_exceeded")
        assert problem["setting"] == "results_bytes"
        assert problem["limit"] == 20_000_000
        assert 1.5 < problem["actual"] / (8 * vertices**2) < 1.7


def test_bounds_of_sparse_matrices(service: ServiceClient, sphere: str) -> None:
    link = f"/v1/meshes/{sphere}/matrix?format=npz"
    body = {"sources": [*range(10)], "targets": "all", "layout": "sparse"}
    for query, limit, actual in (({}, 100, 6420), ({"max_distance": 9.0}, 100, 6420)):
        problem = check_problem(service.post(link, json=body | query), 422, "limit_exceeded")
        assert (problem["limit"], problem["actual"]) == (limit, actual)
        assert problem["setting"] == "max_matrix_cells"
        assert "application/x-npz with `Prefer: respond-async`" in problem["hint"]
    json_link = f"/v1/meshes/{sphere}/matrix"
    problem = check_problem(
        service.post(json_link, json=body, headers=ASYNC), 422, "limit_exceeded"
    )
    assert problem["setting"] == "max_matrix_cells"
    # The refusal of a request is not that of a job, though the question is the same.
    job = submit(service, sphere, **body, max_distance=9.0)
    assert job["status"] == "successful"
    again = service.post(link, json=body | {"max_distance": 9.0})
    check_problem(again, 422, "limit_exceeded")
    # What a job finds counts against the store: here all distances, of which each takes 16 bytes
    # in a part and 16 in the file.
    larger = upload_sample(service, "sphere", 2600)
    job = submit(service, larger, layout="sparse")
    assert job["status"] == "failed"
    problem = job["problem"]
    assert (problem["code"], problem["limit"]) == ("storage_full", 20_000_000)
    assert problem["setting"] == "results_bytes"
    assert submit(service, larger, layout="sparse", max_distance=0.3)["status"] == "successful"


def test_answers_of_jobs_leave_no_room(service: ServiceClient, sphere: str) -> None:
    jobs = [submit(service, sphere, max_distance=2.0 - limit / 10) for limit in range(6)]

    *first, last = jobs
    assert [job["status"] for job in first] == ["successful"] * 5
    assert last["status"] == "failed"
    problem = last["problem"]
    assert (problem["code"], problem["limit"]) == ("storage_full", 20_000_000)
    assert problem["actual"] > problem["limit"]
    assert problem["setting"] == "results_bytes"
    service.delete(first[0]["links"]["self"])
    assert submit(service, sphere, max_distance=1.5)["status"] == "successful"


def test_a_job_goes_on_after_a_restart(tmp_path: Path) -> None:
    limits = {"max_matrix_cells": 100, "drain_s": 0.01}
    with serving(tmp_path, **limits) as service:
        sphere = upload_sample(service, "sphere", 12_000)
        link = f"/v1/meshes/{sphere}/matrix?format=npy&dtype=float32"
        job = service.post(link, json=ALL, headers=ASYNC).json()["links"]["self"]
        results = tmp_path / "results" / sphere
        wait_until(lambda: len([*results.glob("*-*.json")]) >= 1)
    whole = sorted(results.glob("*-*.json"))
    before = {path: path.stat().st_ino for path in whole}
    assert whole, "parts that were whole are there"
    with serving(tmp_path, **limits) as service:
        wait_until(lambda: len([*results.glob("*-*.json")]) > len(whole))
        assert before == {path: path.stat().st_ino for path in whole}, "they were computed again"
        assert service.get(job).json()["status"] == "running"
        service.delete(job)


def test_the_clients_read_rows_and_save_files(
    service: ServiceClient, sphere: str, same: gc.TriangleMesh, tmp_path: Path
) -> None:
    client = Client(http=service)
    shares: list[float] = []
    matrix = client.store_matrix(
        sphere, "all", "all", max_distance=2.5, dtype="float32", progress=shares.append
    )
    assert (matrix.shape, matrix.dtype) == ((642, 642), np.dtype("float32"))
    assert (matrix.layout, matrix.method) == ("dense", "exact")
    assert matrix.error_bound.value == 0.0
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    expected, out = tmp_path / "expected.npy", tmp_path / "out.npy"
    gc.write_matrix(same, expected, "all", max_distance=2.5, dtype="float32")
    table = np.load(expected)
    np.testing.assert_array_equal(client.matrix_rows(matrix, 0, 3), table[:3])
    np.testing.assert_array_equal(client.matrix_rows(matrix, 600, 642), table[600:])
    for first, last in ((0, 0), (-1, 2), (3, 643)):
        with pytest.raises(ValueError, match="do not exist; the matrix has"):
            client.matrix_rows(matrix, first, last)
    # What has come before is not read again.
    part = tmp_path / f".out.npy.{matrix.etag}.part"
    part.write_bytes(expected.read_bytes()[:1000])
    client.save_matrix(matrix, out)
    assert out.read_bytes() == expected.read_bytes()
    assert not part.exists()
    client.delete_job(matrix.job_id)
    with pytest.raises(ProblemError, match="job_not_found"):
        client.matrix_rows(matrix, 0, 1)


def test_the_clients_save_sparse_files(
    service: ServiceClient, sphere: str, same: gc.TriangleMesh, tmp_path: Path
) -> None:
    client = Client(http=service)
    options: dict[str, Any] = {"method": "approximate", "absolute_error": 1e-3}
    matrix = client.store_matrix(sphere, "all", "all", layout="sparse", max_distance=0.4, **options)
    assert (matrix.layout, matrix.shape, matrix.method) == ("sparse", (642, 642), "approximate")
    assert matrix.error_bound.type == "absolute"
    out, expected = tmp_path / "out.npz", tmp_path / "expected.npz"
    client.save_matrix(matrix, out)
    gc.write_matrix(same, expected, "all", max_distance=0.4, relative_error=None, **options)
    assert out.read_bytes() == expected.read_bytes()
    with pytest.raises(ValueError, match="cannot be read by rows"):
        client.matrix_rows(matrix, 0, 1)


def test_the_client_is_told_why_there_is_no_matrix(service: ServiceClient) -> None:
    client = Client(http=service)
    mesh: Mesh = client.sample("plane", 200)
    with pytest.raises(ProblemError, match="invalid_point"):
        client.store_matrix(mesh, [10_000] * 30, "all")
