"""Numbers of many digits, wherever a client can write one: refused or bounded, never a defect."""

from typing import Any

import pytest
from starlette.testclient import TestClient

DIGITS = (19, 20, 25, 400, 4299, 4301, 5000)
"""Around what 64 bits hold, what a float holds, and what Python reads."""

REFUSED: dict[str, tuple[str, str, dict[str, Any]]] = {
    "cursor of jobs": ("GET", "jobs?cursor={n}", {}),
    "limit": ("GET", "meshes?limit={n}", {}),
    "last event": ("GET", "jobs/{job}/events", {"headers": {"Last-Event-ID": "{n}"}}),
    "faces of a sample": ("POST", "meshes?sample=plane&faces={n}", {}),
    "vertex in a path": ("GET", "meshes/{mesh}/path?from=v{n}&to=v1", {}),
    "edge in a path": ("GET", "meshes/{mesh}/path?from=e{n}-2:0.3&to=v1", {}),
    "count": (
        "POST",
        "meshes/{mesh}/isolines",
        {"content": '{"sources":[{"vertex":0}],"count":{n}}'},
    ),
    "vertex": ("POST", "meshes/{mesh}/distances", {"content": '{"sources":[{"vertex":{n}}]}'}),
    "barrier": (
        "POST",
        "meshes/{mesh}/distances",
        {"content": '{"sources":[{"vertex":0}],"barriers":[{n}]}'},
    ),
    "k": (
        "POST",
        "meshes/{mesh}/nearest",
        {"content": '{"source":{"vertex":0},"candidates":[{"vertex":1}],"k":{n}}'},
    ),
}


@pytest.fixture(scope="module")
def job(client: TestClient, plane: str) -> str:
    body = {"sources": [{"vertex": 0}]}
    prefer = {"Prefer": "respond-async"}
    return str(client.post(f"/v1/meshes/{plane}/distances", json=body, headers=prefer).json()["id"])


@pytest.mark.parametrize("digits", DIGITS)
@pytest.mark.parametrize("place", REFUSED)
def test_refused(client: TestClient, plane: str, job: str, place: str, digits: int) -> None:
    def written(text: str) -> str:
        return text.replace("{n}", "9" * digits).replace("{mesh}", plane).replace("{job}", job)

    method, path, more = REFUSED[place]
    headers = {name: written(value) for name, value in more.get("headers", {}).items()}
    content = written(more["content"]) if "content" in more else None
    if content is not None:
        headers["Content-Type"] = "application/json"
    response = client.request(method, f"/v1/{written(path)}", content=content, headers=headers)
    assert response.status_code == 422, response.text
    assert response.json()["code"] in ("invalid_request", "invalid_point")


@pytest.mark.parametrize("digits", DIGITS)
def test_a_client_may_wait_as_long_as_it_likes(client: TestClient, plane: str, digits: int) -> None:
    headers = {"X-Timeout-Ms": "9" * digits}
    response = client.get(f"/v1/meshes/{plane}/path?from=v0&to=v1", headers=headers)
    assert response.status_code == (200 if digits < 4300 else 422)


@pytest.mark.parametrize("digits", DIGITS)
def test_ranges_beyond_the_file(client: TestClient, plane: str, digits: int) -> None:
    link, number = f"/v1/meshes/{plane}/arrays/vertices", "9" * digits
    whole = client.get(link).content
    assert client.get(link, headers={"Range": f"bytes={number}-"}).status_code == 416
    assert client.get(link, headers={"Range": f"bytes=8-{number}"}).content == whole[8:]
    assert client.get(link, headers={"Range": f"bytes=-{number}"}).content == whole
