"""Fields on disk: whole or not there, within the bound, and found by whoever comes later."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from app.store.fields import FieldStore, code_of_field, field_files
from tests.support.logs import Log
from tests.support.service import distances, serving, upload_sample, wait_until

MESH, OTHER = "a" * 32, "b" * 32
ARRAYS = {
    "distance": np.arange(30.0),
    "nearest": np.arange(30, dtype=np.int32),
    "merges": np.empty((0, 3)),
    "promise": np.array(["relative", "guaranteed"]),
}


@pytest.fixture
def store(tmp_path: Path) -> FieldStore:
    return FieldStore(tmp_path, 10**9)


def test_a_field_comes_back_as_it_was(store: FieldStore) -> None:
    store.write(MESH, "k", ARRAYS, "code 7")

    again = store.read(MESH, "k")

    assert again is not None
    assert again.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(again[name], array)
        assert again[name].dtype == array.dtype
    assert [code_of_field(path) for path in store.folder.rglob("*.npz")] == ["code 7"]
    assert store.read(MESH, "l") is None
    assert store.read(OTHER, "k") is None


def test_what_comes_back_is_a_field(store: FieldStore) -> None:
    """The library refuses arrays that are none of a field's."""
    mesh = gc.samples.sphere(80)
    for solve in (gc.exact_distance, gc.fast_distance):
        field = solve(mesh, 0)
        store.write(MESH, "k", field.arrays(), "code 7")
        arrays = store.read(MESH, "k")
        assert arrays is not None
        again = gc.DistanceField.from_arrays(mesh, arrays)
        np.testing.assert_array_equal(again.distances, field.distances)


@pytest.mark.slow
def test_a_damaged_one_is_not_there(store: FieldStore, log: Log) -> None:
    """Whatever byte has changed: arrays come as they were written, or not at all."""
    store.write(MESH, "k", ARRAYS, "code")
    (path,) = field_files(store.folder.parent)
    whole = path.read_bytes()
    refused = 0
    for i in range(len(whole)):
        content = bytearray(whole)
        content[i] ^= 1
        path.write_bytes(content)

        found = store.read(MESH, "k")

        assert path.exists() == (found is not None)
        if found is None:
            refused += 1
        else:
            for name, array in ARRAYS.items():
                np.testing.assert_array_equal(found[name], array)
    assert refused > len(whole) // 2, "the rest is dates and the like"
    assert [line["event"] for line in log] == ["stored field unreadable, solved again"] * refused


@pytest.mark.parametrize("size", [0, 1, 100])
def test_half_of_one_is_not_there(store: FieldStore, size: int) -> None:
    store.write(MESH, "k", ARRAYS, "code")
    (path,) = field_files(store.folder.parent)
    path.write_bytes(path.read_bytes()[:size])

    assert code_of_field(path) is None
    assert store.read(MESH, "k") is None
    assert not path.exists()


def test_those_used_least_recently_go(tmp_path: Path) -> None:
    FieldStore(tmp_path, 10**9).write(MESH, "0", ARRAYS, "code")
    (size,) = field_files(tmp_path).values()
    store = FieldStore(tmp_path, 3 * size)
    for i in (1, 2):
        store.write(OTHER, str(i), ARRAYS, "code")
    for moment, path in enumerate(sorted(field_files(tmp_path))):
        os.utime(path, (moment, moment))

    assert store.read(MESH, "0") is not None
    store.write(OTHER, "3", ARRAYS, "code")

    assert {path.stem for path in field_files(tmp_path)} == {"0", "2", "3"}
    FieldStore(tmp_path, sum(array.nbytes for array in ARRAYS.values()) - 1).write(
        MESH, "4", ARRAYS, "code"
    )
    assert {path.stem for path in field_files(tmp_path)} == {"0", "2", "3"}, "it fits in no way"


def test_what_cannot_be_written_is_logged(
    store: FieldStore, log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(np, "savez", _no_space)
    store.write(MESH, "k", ARRAYS, "code")

    (line,) = log
    assert (line["event"], line["mesh_id"]) == ("field not stored", MESH)
    assert "No space left" in line["error"]
    assert list((store.folder / MESH).iterdir()) == []


def _no_space(*_: Any, **__: Any) -> None:
    raise OSError(28, "No space left on device")


def test_the_next_start_sweeps(store: FieldStore) -> None:
    for mesh_id in (MESH, OTHER):
        store.write(mesh_id, "k", ARRAYS, "code")
    (store.folder / MESH / "tmp1").write_bytes(b"half")

    store.prepare({MESH})

    assert [path.relative_to(store.folder).as_posix() for path in store.folder.rglob("*.*")] == [
        f"{MESH}/k.npz"
    ]
    assert not (store.folder / MESH / "tmp1").exists()


@pytest.mark.service
def test_fields_outlive_the_service_and_go_with_their_mesh(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        mesh_id = upload_sample(client, "terrain", 80_000)
        first = distances(client, mesh_id)
        wait_until(lambda: field_files(tmp_path))
    (path,) = field_files(tmp_path)
    os.utime(path, (1, 1))

    with serving(tmp_path) as client:
        again = distances(client, mesh_id, headers={"Accept": "application/x-npy"})
        assert path.stat().st_mtime > 1, "it was read"
        body = np.frombuffer(again.content[-8 * len(first.json()["distances"]) :])
        np.testing.assert_array_equal(body, first.json()["distances"])
        assert client.delete(f"/v1/meshes/{mesh_id}").status_code == 204
        assert field_files(tmp_path) == {}
