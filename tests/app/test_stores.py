import os
from pathlib import Path

import anyio
import numpy as np
import pytest

import geodesic_core as gc
from app.errors import ProblemError
from app.mesh_store import MeshStore
from app.result_store import ResultStore, write_result

SQUARE = (
    np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


@pytest.fixture
def meshes(tmp_path: Path) -> MeshStore:
    store = MeshStore(tmp_path)
    store.prepare()
    return store


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)


def code_of(call) -> str:
    with pytest.raises(ProblemError) as caught:
        call()
    return caught.value.problem.code


def test_a_mesh_comes_back_as_it_was(meshes: MeshStore) -> None:
    mesh = gc.TriangleMesh(*SQUARE)

    mesh_id, is_new = meshes.add(mesh)
    opened = meshes.open(mesh_id)

    assert is_new
    assert opened.warnings == list(mesh.warnings)
    for name, array in mesh.arrays().items():
        np.testing.assert_array_equal(opened.mesh.arrays()[name], array)
        assert not opened.mesh.arrays()[name].flags.writeable


def test_the_id_is_of_the_content(meshes: MeshStore) -> None:
    vertices, faces = SQUARE
    mesh_id, _ = meshes.add(gc.TriangleMesh(vertices, faces))

    assert meshes.add(gc.TriangleMesh(vertices.tolist(), faces.tolist())) == (mesh_id, False)
    assert meshes.add(gc.TriangleMesh(vertices * 2, faces))[0] != mesh_id
    assert meshes.add(gc.TriangleMesh(vertices, faces[::-1]))[0] != mesh_id


def test_a_vertex_map_is_part_of_the_content(meshes: MeshStore) -> None:
    vertices, faces = SQUARE
    doubled = np.concatenate([vertices, vertices])

    merged = gc.TriangleMesh(doubled, faces, merge="exact")

    assert meshes.add(merged)[0] != meshes.add(gc.TriangleMesh(vertices, faces))[0]


def test_two_writers_of_one_mesh(meshes: MeshStore, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    rename = Path.rename

    def overtaken(path: Path, target: Path) -> Path:
        monkeypatch.undo()
        meshes.add(mesh)
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", overtaken)

    assert meshes.add(mesh)[1] is False
    assert len(meshes.page("", 10)[0]) == 1


@pytest.mark.parametrize("file", ["vertices.npy", "faces.npy", "component.npy"])
def test_a_changed_array_is_noticed(meshes: MeshStore, tmp_path: Path, file: str) -> None:
    mesh_id, _ = meshes.add(gc.TriangleMesh(*SQUARE))
    damage(tmp_path / "meshes" / mesh_id / file)

    assert code_of(lambda: meshes.open(mesh_id)) == "mesh_damaged"


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"version": 99}'])
def test_a_broken_manifest_is_noticed(meshes: MeshStore, tmp_path: Path, content: bytes) -> None:
    mesh_id, _ = meshes.add(gc.TriangleMesh(*SQUARE))
    (tmp_path / "meshes" / mesh_id / "manifest.json").write_bytes(content)

    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_damaged"


def test_a_missing_array_is_noticed(meshes: MeshStore, tmp_path: Path) -> None:
    mesh_id, _ = meshes.add(gc.TriangleMesh(*SQUARE))
    (tmp_path / "meshes" / mesh_id / "faces.npy").unlink()

    assert code_of(lambda: meshes.open(mesh_id)) == "mesh_damaged"


@pytest.mark.parametrize("mesh_id", ["", "..", "0" * 32, "../meshes", "G" * 32])
def test_unknown_ids(meshes: MeshStore, mesh_id: str) -> None:
    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_not_found"
    assert code_of(lambda: meshes.delete(mesh_id)) == "mesh_not_found"


def test_half_written_entries_are_swept(meshes: MeshStore, tmp_path: Path) -> None:
    mesh_id, _ = meshes.add(gc.TriangleMesh(*SQUARE))
    (tmp_path / "tmp" / "half").mkdir()
    (tmp_path / "tmp" / "half" / "vertices.npy").write_bytes(b"x")

    MeshStore(tmp_path).prepare()

    assert list((tmp_path / "tmp").iterdir()) == []
    assert meshes.open(mesh_id)


def test_a_failed_write_leaves_nothing(
    meshes: MeshStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_args: object, **_kwargs: object) -> None:
        raise OSError(28, "no space left on device")

    monkeypatch.setattr(np, "save", full)

    with pytest.raises(OSError, match="no space"):
        meshes.add(gc.TriangleMesh(*SQUARE))
    assert list((tmp_path / "tmp").iterdir()) == []
    assert list((tmp_path / "meshes").iterdir()) == []


# Results


@pytest.fixture
def results(tmp_path: Path) -> ResultStore:
    store = ResultStore(tmp_path / "results", 100, memory=0)
    store.prepare()
    return store


def put(results: ResultStore, root: Path, name: str, size: int = 40) -> None:
    written = write_result(root / "results", name, [b"x" * size], {"A": "b"})
    results.give_back(results.take_new(name, written))


def find(results: ResultStore, name: str):
    found = anyio.run(results.find, name)
    if found is not None:
        results.give_back(found)
    return found


def test_a_result_comes_back(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")

    found = find(results, "m/a")

    assert found is not None
    assert found.path.read_bytes() == b"x" * 40
    assert found.headers == {"A": "b"}
    assert found.key == "a"


def test_the_least_recently_used_go_first(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "m/b")
    find(results, "m/a")
    put(results, tmp_path, "m/c")

    assert [find(results, f"m/{key}") is not None for key in "abc"] == [True, False, True]
    assert len(list((tmp_path / "results" / "m").iterdir())) == 4


def test_what_is_being_sent_stays(results: ResultStore, tmp_path: Path) -> None:
    written = write_result(tmp_path / "results", "m/a", [b"x" * 90], {})
    sent = results.take_new("m/a", written)
    put(results, tmp_path, "m/b")

    assert sent.path.exists()
    results.give_back(sent)
    put(results, tmp_path, "m/c")
    assert not sent.path.exists()


def test_a_changed_result_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    damage(tmp_path / "results" / "m" / "a.body")

    assert find(results, "m/a") is None
    assert find(results, "m/a") is None


def test_a_broken_seal_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    (tmp_path / "results" / "m" / "a.json").write_bytes(b"{")

    assert find(results, "m/a") is None


def test_results_survive_a_restart(results: ResultStore, tmp_path: Path) -> None:
    for key, second in (("old", 1), ("new", 2)):
        put(results, tmp_path, f"m/{key}")
        os.utime(tmp_path / "results" / "m" / f"{key}.body", (second, second))
    (tmp_path / "results" / "m" / "unsealed.body").write_bytes(b"x")
    (tmp_path / "results" / "m" / "tmpabc").write_bytes(b"x")

    restarted = ResultStore(tmp_path / "results", 50, memory=0)
    restarted.prepare()

    assert find(restarted, "m/old") is None
    assert find(restarted, "m/new") is not None
    names = sorted(path.name for path in (tmp_path / "results" / "m").iterdir())
    assert names == ["new.body", "new.json"]


def test_results_of_a_mesh_are_forgotten(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "n/a")

    results.forget_mesh("m")

    assert find(results, "m/a") is None
    assert find(results, "n/a") is not None


def test_small_results_are_in_memory_as_far_as_they_fit(tmp_path: Path) -> None:
    results = ResultStore(tmp_path / "results", 10**6, memory=100)
    results.prepare()
    for key in "abc":
        put(results, tmp_path, f"m/{key}")
    put(results, tmp_path, "m/large", 2**17)

    found = {key: find(results, f"m/{key}").body for key in ("c", "b", "large", "a")}
    assert found == {"c": b"x" * 40, "b": b"x" * 40, "large": None, "a": b"x" * 40}
    damage(tmp_path / "results" / "m" / "a.body")
    assert find(results, "m/a").body == b"x" * 40, "read a moment ago"
    results.forget_mesh("m")
    assert find(results, "m/a") is None


def test_what_is_held_stays_until_it_is_released(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    results.hold("m/a")
    assert results.has_room_to_hold("m/a")
    other = results.take_new("m/b", write_result(tmp_path / "results", "m/b", [b"x" * 61], {}))
    assert not results.has_room_to_hold("m/b")
    results.give_back(other)
    results.forget_mesh("m")

    assert find(results, "m/a") is not None
    assert find(results, "m/b") is None
    results.release("m/a")
    put(results, tmp_path, "m/c", 61)
    assert find(results, "m/a") is None


@pytest.mark.usefixtures("results")
def test_a_failed_result_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_result(tmp_path / "results", "m/a", [b"x", None], {})  # type: ignore[list-item]
    assert not list((tmp_path / "results").glob("m/*"))
