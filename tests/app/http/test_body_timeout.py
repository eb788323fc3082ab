"""Bodies that come drop by drop, or are not wanted at all."""

import asyncio
import time
from pathlib import Path
from typing import Any

import orjson
import pytest

from app.main import create_app
from app.settings import Settings

LIMIT_S = 0.2
FORM = b"multipart/form-data; boundary=x"
FORM_HEAD = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.obj"\r\n\r\n'


class Dripping:
    """A client that sends a byte every 20 ms, for ever, and counts those that were taken."""

    def __init__(self, app: Any, path: str, head: bytes = b"v", **headers: bytes) -> None:
        self.app = app
        self.head = head
        self.taken = 0
        self.sent: list[Any] = []
        path, _, query = path.partition("?")
        self.scope = {
            "type": "http",
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "method": "POST",
            "scheme": "http",
            "path": path,
            "raw_path": path.encode(),
            "query_string": query.encode(),
            "headers": [(name.replace("_", "-").encode(), v) for name, v in headers.items()],
            "client": ("10.0.0.7", 1),
            "server": ("testserver", 80),
            "state": {},
        }

    async def receive(self) -> Any:
        if self.taken:  # the first is there at once, and so before any deadline
            await asyncio.sleep(0.02)
        self.taken += 1
        body = self.head if self.taken == 1 else b"v"
        return {"type": "http.request", "body": body, "more_body": True}

    async def send(self, message: Any) -> None:
        self.sent.append(message)

    def ask(self) -> tuple[int, Any, float]:
        """Return the status of the answer, its document, and after how many seconds it came."""
        start = time.monotonic()
        asyncio.run(self.app(self.scope, self.receive, self.send))
        body = b"".join(message.get("body", b"") for message in self.sent)
        return self.sent[0]["status"], orjson.loads(body), time.monotonic() - start


def app_in(store: Path, **settings: Any) -> Any:
    app = create_app(Settings(store=store, workers=1, **settings))
    app.state.service.scratch.prepare()
    return app


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "head", "media_type"),
    [
        ("/v1/meshes?format=obj", b"v", b"model/obj"),
        ("/v1/meshes", FORM_HEAD, FORM),
        (f"/v1/meshes/{'0' * 32}/distances", b"{", b"application/json"),
    ],
)
def test_a_body_has_to_be_there_in_time(
    tmp_path: Path, path: str, head: bytes, media_type: bytes
) -> None:
    client = Dripping(app_in(tmp_path, deadline_s=LIMIT_S), path, head, content_type=media_type)

    status, problem, seconds = client.ask()

    assert (status, problem["code"]) == (504, "deadline_exceeded")
    assert (problem["limit"], problem["setting"]) == (LIMIT_S, "deadline_s")
    assert (b"connection", b"close") in client.sent[0]["headers"]
    assert seconds >= LIMIT_S
    assert client.taken > 0
    assert not any((tmp_path / "tmp").iterdir())


class Stalling(Dripping):
    """A client of a service that does something else until all deadlines have passed."""

    async def receive(self) -> Any:
        if self.taken == 1:
            time.sleep(2 * LIMIT_S)  # the event loop itself stalls
        return await super().receive()


@pytest.mark.slow
def test_the_connection_closes_whichever_deadline_was_noticed_first(tmp_path: Path) -> None:
    client = Stalling(app_in(tmp_path, deadline_s=LIMIT_S), "/v1/meshes", content_type=b"model/obj")

    status, problem, _ = client.ask()

    assert (status, problem["code"]) == (504, "deadline_exceeded")
    assert (b"connection", b"close") in client.sent[0]["headers"]


def test_an_upload_has_the_time_that_its_client_grants(tmp_path: Path) -> None:
    client = Dripping(
        app_in(tmp_path), "/v1/meshes", content_type=b"model/obj", x_timeout_ms=b"200"
    )

    status, problem, _ = client.ask()

    assert (status, problem["code"], problem["limit"]) == (504, "deadline_exceeded", 0.2)
    assert "setting" not in problem
    assert not any((tmp_path / "tmp").iterdir())


@pytest.mark.parametrize("path", ["/v1/meshes?format=obj", f"/v1/meshes/{'0' * 32}/distances"])
def test_without_a_key_no_body_is_read(tmp_path: Path, path: str) -> None:
    app = app_in(tmp_path, api_keys="alice:0123456789abcdef")
    client = Dripping(app, path, content_type=b"application/json")

    status, problem, _ = client.ask()

    assert (status, problem["code"], client.taken) == (401, "unauthorized", 0)
