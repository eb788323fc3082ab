"""Writing to an object store that is slow, or gone."""

import asyncio
from typing import Any

import obstore
import pytest
from obstore.exceptions import GenericError
from obstore.store import MemoryStore

from app.errors import StoreUnavailableError
from app.store import objects
from app.store.objects import Objects


@pytest.fixture(autouse=True)
def asks_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "_PROBE_S", 0.001)


def test_a_write_may_take_long_while_the_store_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    put = obstore.put_async

    async def ask(_store: Any, name: str) -> None:
        asked.append(name)
        raise FileNotFoundError  # it is not there yet

    async def put_later(*arguments: Any, **options: Any) -> Any:
        while len(asked) < 5:
            await asyncio.sleep(0)
        return await put(*arguments, **options)

    monkeypatch.setattr(obstore, "head_async", ask)
    monkeypatch.setattr(obstore, "put_async", put_later)
    store = Objects(MemoryStore())
    store.write("name", b"content")
    assert store.read("name") == b"content"


def test_a_write_ends_where_the_store_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[bool] = []

    async def ask(_store: Any, _name: str) -> None:
        raise GenericError("nobody answers")

    async def put_never(*_arguments: Any, **_options: Any) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append(True)

    monkeypatch.setattr(obstore, "head_async", ask)
    monkeypatch.setattr(obstore, "put_async", put_never)
    with pytest.raises(StoreUnavailableError, match="nobody answers"):
        Objects(MemoryStore()).write("name", b"content")
    assert ended == [True]
