"""The line that each request has in the log."""

from pathlib import Path
from typing import Any

import anyio
import pytest
from starlette.testclient import TestClient

from app.errors import StoreUnavailableError
from tests.support.logs import Log
from tests.support.service import ServiceClient


def test_a_request_has_one_line(client: TestClient, log: Log) -> None:
    answer = client.get("/v1?secret=0123456789abcdef", headers={"X-Request-ID": "mine"})

    (line,) = log
    seconds = line.pop("seconds")
    assert seconds > 0
    assert line == {
        "event": "request",
        "log_level": "info",
        "module": "app.http",
        "request_id": "mine",
        "method": "GET",
        "path": "/v1",
        "operation": "getAbout",
        "status": 200,
        "caller": "unknown",  # the test client has no address
        "mesh_id": None,
        "queue_seconds": None,
        "compute_seconds": None,
        "bytes": int(answer.headers["content-length"]),
    }


def test_a_head_has_its_own_method_and_the_operation_of_get(client: TestClient, log: Log) -> None:
    client.head("/v1")
    client.head("/v1/meshes/abc")

    found = [(line["method"], line["operation"], line["mesh_id"], line["bytes"]) for line in log]
    assert found == [("HEAD", "getAbout", None, 0), ("HEAD", "getMesh", "abc", 0)]


def test_refusals_have_lines_as_well(client: TestClient, log: Log) -> None:
    client.get("/nowhere")
    client.delete("/v1/meshes/abc")
    client.request("PUT", "/v1")

    assert [(line["operation"], line["status"], line["mesh_id"]) for line in log] == [
        ("none", 404, None),
        ("deleteMesh", 404, "abc"),
        ("getAbout", 405, None),
    ]


def test_the_questions_of_browsers_before_a_request_have_lines(tmp_path: Path, log: Log) -> None:
    client = ServiceClient(tmp_path, cors_origins="https://a.org")
    asked = {"Origin": "https://a.org", "Access-Control-Request-Method": "POST"}
    client.options("/v1/meshes", headers=asked)

    assert [(line["method"], line["status"]) for line in log] == [("OPTIONS", 200)]


@pytest.mark.parametrize(("log_probes", "lines"), [("off", 0), ("on", 2)])
def test_probes_have_lines_where_they_are_asked_for(
    tmp_path: Path, log: Log, log_probes: str, lines: int
) -> None:
    client = ServiceClient(tmp_path, log_probes=log_probes)
    client.get("/livez")
    client.get("/readyz")

    assert len(log) == lines


def test_a_failure_has_its_traceback_and_its_line(
    client: TestClient, log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.http.routes.about.Index", None)
    answer = client.get("/")

    failure, line = log
    assert (failure["event"], failure["log_level"]) == ("request failed", "error")
    assert isinstance(failure["exc_info"], TypeError)
    assert (line["status"], line["request_id"]) == (500, answer.json()["request_id"])


def test_an_outage_has_no_traceback_and_its_own_status(
    client: TestClient, log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_named: object) -> None:
        raise StoreUnavailableError("no route to host")

    monkeypatch.setattr("app.http.routes.about.Index", fail)
    answer = client.get("/")

    assert answer.status_code == 503
    failure, line = log
    assert (failure["event"], failure["log_level"]) == ("request failed", "warning")
    assert (failure["code"], failure["error"]) == ("store_unavailable", "no route to host")
    assert "exc_info" not in failure
    assert (line["event"], line["status"]) == ("request", 503)


def test_a_client_that_hangs_up_has_its_own_status(client: ServiceClient, log: Log) -> None:
    scope = {
        "type": "http",
        "method": "POST",
        "scheme": "http",
        "path": "/v1/meshes",
        "query_string": b"format=obj",
        "headers": [(b"host", b"testserver")],
        "client": ("10.0.0.7", 1),
        "server": ("testserver", 80),
        "state": {},
    }

    async def receive() -> Any:
        return {"type": "http.disconnect"}

    async def send(_message: Any) -> None:
        pass  # nobody reads it

    anyio.run(client.app, scope, receive, send)

    (line,) = log
    assert (line["operation"], line["status"]) == ("createMesh", 499)
