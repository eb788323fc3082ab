"""The service as it starts."""

import asyncio
import gc
import threading

import pytest
from starlette.testclient import TestClient

from app.engine.slot import Slot
from app.main import create_app
from app.settings import Settings
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
