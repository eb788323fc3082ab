"""Conformance: all kinds of object stores go through the same cases."""

import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from obstore.store import MemoryStore

from app.store.objects import Objects
from tests.support.gcs import GCS

CREATORS = 8
LARGE = 12_000_000
"""Bytes that are sent in three parts, and read in two"""


@pytest.fixture(
    params=[
        "memory",
        pytest.param("s3", marks=pytest.mark.service),
        pytest.param("gcs", marks=pytest.mark.service),
        pytest.param("azure", marks=pytest.mark.service),
    ]
)
def objects(request: pytest.FixtureRequest) -> Objects:
    if request.param == "memory":
        return Objects(MemoryStore())
    return Objects.at(request.getfixturevalue(request.param).new_url())


def test_an_object_is_created_once(objects: Objects) -> None:
    assert objects.create("name", b"first")
    assert not objects.create("name", b"another")
    assert objects.create("name", b"first"), "as a request that is repeated"
    assert objects.read("name") == b"first"
    objects.remove("name")
    assert objects.create("name", b"another")


@pytest.mark.service
def test_one_of_many_creators_has_the_object(gcs: GCS) -> None:
    """Moto's S3 by itself may take two: it looks for an object, and writes it afterwards."""
    objects = Objects.at(gcs.new_url())
    contents = [str(number).encode() for number in range(CREATORS)]
    with ThreadPoolExecutor(CREATORS) as pool:
        won = list(pool.map(lambda content: objects.create("name", content), contents))
    assert won.count(True) == 1
    assert objects.read("name") == contents[won.index(True)]


@pytest.mark.parametrize("size", [0, 1000, LARGE])
def test_a_file_is_written_and_fetched(objects: Objects, tmp_path: Path, size: int) -> None:
    content = np.random.default_rng(size).bytes(size)
    sent, fetched = tmp_path / "sent", tmp_path / "fetched"
    sent.write_bytes(content)
    objects.write("name", b"a former content")
    objects.write("name", sent)

    assert objects.size("name") == size
    assert objects.fetch("name", fetched) == zlib.crc32(content)
    assert fetched.read_bytes() == content


def test_objects_that_are_not_there(objects: Objects, tmp_path: Path) -> None:
    assert objects.read("name") is None
    assert objects.size("name") is None
    assert objects.checksum("name") is None
    with pytest.raises(FileNotFoundError):
        objects.fetch("name", tmp_path / "file")
    objects.remove("name", "another")
    assert list(objects.found("folder")) == []
    assert objects.folders("folder") == []


def test_objects_are_found_by_folder(objects: Objects) -> None:
    for name in ("folder/one/a", "folder/two/b c.npy", "folder/d", "folders/e"):
        objects.write(name, b"content")

    found = [(each.name, each.size, each.is_old) for each in objects.found("folder")]
    names = ["folder/d", "folder/one/a", "folder/two/b c.npy"]
    assert sorted(found) == [(name, 7, False) for name in names]
    assert objects.folders("folder") == ["one", "two"]
    objects.remove("folder/one/a", "folder/d")
    assert [each.name for each in objects.found("folder")] == ["folder/two/b c.npy"]
