"""The service as it starts."""

import asyncio
import gc
import socket
import threading
from contextlib import closing
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.engine.slot import Slot
from app.main import create_app
from app.settings import Settings
from tests.support.postgres import SECRET
from tests.support.postgres import Server as Postgres
from tests.support.processes import Server, refused_start
from tests.support.service import check_problem, is_ready, wait_until


def test_what_is_imported_is_not_looked_through_for_garbage(client: TestClient) -> None:
    assert is_ready(client)
    assert gc.get_freeze_count() > 10_000


def test_listens_before_it_is_ready(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    may_start, open_slot = threading.Event(), Slot.open

    async def open_later(slot: Slot) -> None:
        await asyncio.to_thread(may_start.wait)
        await open_slot(slot)

    monkeypatch.setattr(Slot, "open", open_later)
    with TestClient(create_app(Settings(store=tmp_path, workers=1))) as client:
        try:
            assert client.get("/livez").json() == {"status": "ok"}
            response = client.get("/readyz")
            check_problem(response, 503, "engine_unavailable")
            assert response.headers["retry-after"] == "1"
        finally:
            may_start.set()
        wait_until(lambda: is_ready(client))


def test_starts_that_are_refused(postgres: Postgres, tmp_path: Path) -> None:
    wrong = postgres.url("postgres", "wrong")
    for said in (
        refused_start(tmp_path, "--state", wrong),
        refused_start(tmp_path, GEODESIC_STATE=wrong),
    ):
        assert "password authentication failed" in said
        assert SECRET not in said
    with closing(Server(tmp_path)):
        assert "GEODESIC_STATE" in refused_start(tmp_path), "it says what two services need"
        assert "in use" in refused_start(tmp_path, "--state", postgres.new_database())


def test_a_port_that_is_taken_is_refused_at_once(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        said = refused_start(tmp_path / "store", "--port", port)
    assert f"port {port} of 127.0.0.1 is in use: choose another by --port" in said
    assert not (tmp_path / "store").exists()
