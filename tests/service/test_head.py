"""`HEAD`: the headers of `GET`, without its content."""

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from tests.support.processes import stopped
from tests.support.service import upload_sample

OF_ONE_ANSWER = {"date", "server-timing", "x-request-id", "transfer-encoding"}
"""Headers that differ from one answer to the next, or tell how its body travels"""

ASYNC = {"Prefer": "respond-async"}
PATHS = (
    "/",
    "/livez",
    "/readyz",
    "/openapi.json",
    "/problems/forbidden",
    "/v1",
    "/v1/meshes",
    "/v1/meshes/{mesh}",
    "/v1/meshes/{mesh}/arrays/vertices",
    "/v1/meshes/{mesh}/path?from=0&to=9",
    "/v1/meshes/{mesh}/path?from=0&to=9&format=npy",
    "/v1/jobs/{job}",
    "/v1/jobs/{job}/results",
    "/v1/jobs/{job}/events",
)
REFUSED = (
    ("/nowhere", 404),
    ("/v1/meshes/0", 404),
    ("/v1/meshes/{mesh}/distances", 405),
    ("/v1/meshes/{mesh}/path?from=0", 422),
)


@pytest.fixture(scope="module")
def job(client: TestClient, plane: str) -> str:
    """The id of a job that has finished."""
    submitted = submit(client, plane)
    client.get(f"{submitted}/events")
    return submitted.rpartition("/")[2]


def submit(client: TestClient, mesh_id: str) -> str:
    body = {"sources": [{"vertex": 7}]}
    answer = client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=ASYNC)
    return str(answer.headers["location"])


def headers_of(answer: Any) -> dict[str, str]:
    return {name: value for name, value in answer.headers.items() if name not in OF_ONE_ANSWER}


def check_same_head(client: Any, path: str, status: int, headers: Any = None) -> None:
    whole, head = (client.request(method, path, headers=headers) for method in ("GET", "HEAD"))
    assert (head.status_code, whole.status_code) == (status, status)
    assert headers_of(head) == headers_of(whole)
    assert head.content == b""


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.usefixtures("one_replica")
def test_headers_are_those_of_get(client: TestClient, plane: str, job: str, path: str) -> None:
    check_same_head(client, path.format(mesh=plane, job=job), 200)


@pytest.mark.parametrize(("path", "status"), REFUSED)
def test_refusals_are_those_of_get(client: TestClient, plane: str, path: str, status: int) -> None:
    check_same_head(client, path.format(mesh=plane), status)


@pytest.mark.usefixtures("one_replica")
def test_conditions_and_ranges_are_those_of_get(client: TestClient, plane: str) -> None:
    array = f"/v1/meshes/{plane}/arrays/vertices"
    etag = client.head(array).headers["etag"]
    check_same_head(client, array, 304, {"If-None-Match": etag})
    check_same_head(client, array, 206, {"Range": "bytes=8-15"})
    check_same_head(client, array, 416, {"Range": "bytes=99999999-"})


def test_events_of_a_job_under_way_are_not_awaited(tmp_path: Path, serve: Any) -> None:
    with serve(tmp_path) as client:
        mesh_id = upload_sample(client, "plane", 200)
        with stopped(client.workers()):
            job = submit(client, mesh_id)
            seen = client.head(f"{job}/events")
            unseen = client.head(f"{job}/events", headers={"Last-Event-ID": "99"})
            assert client.get(job).json()["finished"] is None
    for answer in (seen, unseen):
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
