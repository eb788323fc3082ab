"""Conformance: a folder and all kinds of object stores go through the same cases."""

import asyncio
import os
import time
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import obstore
import pytest
from obstore.exceptions import GenericError
from obstore.store import MemoryStore

from app.errors import StoreUnavailableError
from app.store import bucket
from app.store.bucket import Bucket
from app.store.folder import Folder
from app.store.objects import ABANDONED_S, Objects
from tests.support.gcs import GCS

YEARS_S = 10 * 365.25 * 86_400
CREATORS = 8
LARGE = 12_000_000
"""Bytes that are sent in three parts, and read in two"""


@pytest.fixture(
    params=[
        "folder",
        "memory",
        pytest.param("s3", marks=pytest.mark.service),
        pytest.param("gcs", marks=pytest.mark.service),
        pytest.param("azure", marks=pytest.mark.service),
    ]
)
def objects(request: pytest.FixtureRequest, tmp_path: Path) -> Objects:
    if request.param == "folder":
        return Folder(tmp_path)
    if request.param == "memory":
        return Bucket(MemoryStore())
    return Bucket.at(request.getfixturevalue(request.param).new_url())


def test_an_object_is_replaced(objects: Objects) -> None:
    assert objects.replace("name", b"first") is None
    assert objects.replace("name", b"another") == b"first"
    assert objects.read("name") == b"another"
    objects.remove("name")
    assert objects.replace("name", b"first") is None


def test_an_object_is_created_once() -> None:
    objects = Bucket(MemoryStore())
    assert objects.create("name", b"first")
    assert not objects.create("name", b"another")
    assert objects.create("name", b"first"), "as a request that is repeated"
    assert objects.read("name") == b"first"


@pytest.mark.service
def test_one_of_many_creators_has_the_object(gcs: GCS) -> None:
    """Moto's S3 by itself may take two: it looks for an object, and writes it afterwards."""
    objects = Bucket.at(gcs.new_url())
    contents = [str(number).encode() for number in range(CREATORS)]
    with ThreadPoolExecutor(CREATORS) as pool:
        won = list(pool.map(lambda content: objects.create("name", content), contents))
    assert won.count(True) == 1
    assert objects.read("name") == contents[won.index(True)]


@pytest.mark.parametrize("size", [0, 1000, LARGE])
def test_a_file_is_written_and_read(objects: Objects, tmp_path: Path, size: int) -> None:
    content = np.random.default_rng(size).bytes(size)
    sent, fetched = tmp_path / "sent", tmp_path / "fetched"
    sent.write_bytes(content)
    objects.write("name", b"a former content")
    objects.write("name", sent)

    assert objects.size("name") == size
    assert objects.checksum("name") == zlib.crc32(content)
    assert objects.read("name") == content
    if isinstance(objects, Bucket):
        assert objects.fetch("name", fetched) == zlib.crc32(content)
        assert fetched.read_bytes() == content


def test_objects_that_are_not_there(objects: Objects) -> None:
    assert objects.read("name") is None
    assert objects.size("name") is None
    assert objects.checksum("name") is None
    objects.remove("name", "another")
    objects.note_use("name")
    assert list(objects.found("folder")) == []
    assert objects.folders("folder") == []


def test_objects_are_found_by_folder(objects: Objects) -> None:
    for name in ("folder/one/a", "folder/two/b c.npy", "folder/d", "folders/e"):
        objects.write(name, b"content")

    found = [(each.name, each.size, each.is_abandoned) for each in objects.found("folder")]
    names = ["folder/d", "folder/one/a", "folder/two/b c.npy"]
    assert sorted(found) == [(name, 7, False) for name in names]
    assert sorted(objects.folders("folder")) == ["one", "two"]
    objects.remove("folder/one/a", "folder/d")
    assert [each.name for each in objects.found("folder")] == ["folder/two/b c.npy"]


def test_uses_are_in_the_order_of_time_though_clocks_are_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A time to come is one from before the clock was set back; a little is a server's clock."""
    files, now = Folder(tmp_path), time.time()
    for name, seconds in {"a": -9.0, "b": 30.0, "c": YEARS_S, "d": YEARS_S + 1}.items():
        files.write(name, b"")
        os.utime(tmp_path / name, (now + seconds, now + seconds))
    order = lambda: "".join(each.name for each in files.found("."))  # noqa: E731
    assert order() == "cdab"
    files.note_use("c")
    assert order() == "dacb"
    monkeypatch.setattr(time, "time", lambda: now + 2 * YEARS_S)
    assert order() == "acbd"


@pytest.mark.parametrize("is_alone", [False, True])
def test_what_nobody_writes_any_more_is_abandoned(tmp_path: Path, is_alone: bool) -> None:
    files = Folder(tmp_path)
    files.is_alone = is_alone
    for name, age_s in {"new": 0, "old": 2 * ABANDONED_S}.items():
        files.write(name, b"")
        os.utime(tmp_path / name, 2 * (time.time() - age_s,))
    found = {each.name: each.is_abandoned for each in files.found(".")}
    assert found == {"new": is_alone, "old": True}


@pytest.fixture
def asks_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bucket, "_PROBE_S", 0.001)


@pytest.mark.usefixtures("asks_at_once")
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
    store = Bucket(MemoryStore())
    store.write("name", b"content")
    assert store.read("name") == b"content"


@pytest.mark.usefixtures("asks_at_once")
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
        Bucket(MemoryStore()).write("name", b"content")
    assert ended == [True]
