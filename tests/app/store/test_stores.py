import os
import shutil
import tracemalloc
import zlib
from pathlib import Path

import anyio
import numpy as np
import pytest

import geodesic_core as gc
from app.errors import ProblemError
from app.store import verified
from app.store.manifests import encode_manifest, read_manifest
from app.store.meshes import MeshStore
from app.store.results import (
    SMALL,
    FolderResults,
    Result,
    ResultStore,
    write_result,
    write_result_file,
)
from tests.support.faults import flip_bytes
from tests.support.service import store_mesh

SQUARE = (
    np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


@pytest.fixture
def meshes(tmp_path: Path) -> MeshStore:
    return MeshStore(tmp_path)


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)


def damage_of(meshes: MeshStore, mesh_id: str) -> list[str]:
    return [str(error) for error in meshes.inspect(mesh_id) if error is not None]


def code_of(call) -> str:
    with pytest.raises(ProblemError) as caught:
        call()
    return caught.value.problem.code


def test_a_mesh_comes_back_as_it_was(meshes: MeshStore, tmp_path: Path) -> None:
    mesh = gc.TriangleMesh(*SQUARE)

    opened = meshes.open(store_mesh(tmp_path, mesh))

    assert opened.warnings == list(mesh.warnings)
    assert opened.mesh.arrays().keys() == mesh.arrays().keys()
    for name, array in mesh.arrays().items():
        np.testing.assert_array_equal(opened.mesh.arrays()[name], array)
        assert opened.mesh.arrays()[name].dtype == array.dtype
        assert not opened.mesh.arrays()[name].flags.writeable


def test_the_id_is_of_the_content(tmp_path: Path) -> None:
    vertices, faces = SQUARE
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(vertices, faces))

    assert store_mesh(tmp_path, gc.TriangleMesh(vertices.tolist(), faces.tolist())) == mesh_id
    assert store_mesh(tmp_path, gc.TriangleMesh(vertices * 2, faces)) != mesh_id
    assert store_mesh(tmp_path, gc.TriangleMesh(vertices, faces[::-1])) != mesh_id


def test_a_vertex_map_is_part_of_the_content(tmp_path: Path) -> None:
    vertices, faces = SQUARE
    doubled = np.concatenate([vertices, vertices])

    merged = gc.TriangleMesh(doubled, faces, merge="exact")

    assert store_mesh(tmp_path, merged) != store_mesh(tmp_path, gc.TriangleMesh(vertices, faces))


def test_a_mesh_that_is_stored_is_not_written_again(meshes: MeshStore, tmp_path: Path) -> None:
    mesh = gc.TriangleMesh(*SQUARE)
    mesh_id = store_mesh(tmp_path, mesh, "alice")

    written = meshes.write_aside(mesh, tmp_path / "aside", "bob")

    assert (written.mesh_id, written.folder) == (mesh_id, None)
    assert written.manifest["owner"] == "alice"
    assert not (tmp_path / "aside").exists()


@pytest.mark.parametrize("file", ["vertices.npy", "faces.npy", "component.npy"])
def test_a_changed_array_is_noticed(meshes: MeshStore, tmp_path: Path, file: str) -> None:
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(*SQUARE))
    damage(tmp_path / "meshes" / mesh_id / file)

    assert code_of(lambda: meshes.open(mesh_id)) == "mesh_damaged"
    (found,) = damage_of(meshes, mesh_id)
    assert f"its array {file.removesuffix('.npy')} has changed since it was written" in found


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"id": "of another"}'])
def test_a_broken_manifest_is_noticed(meshes: MeshStore, tmp_path: Path, content: bytes) -> None:
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(*SQUARE))
    (tmp_path / "meshes" / mesh_id / "manifest.json").write_bytes(content)

    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_damaged"
    (found,) = damage_of(meshes, mesh_id)
    assert "its manifest" in found


def test_a_missing_array_is_noticed(meshes: MeshStore, tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, gc.TriangleMesh(*SQUARE))
    (tmp_path / "meshes" / mesh_id / "faces.npy").unlink()

    assert code_of(lambda: meshes.open(mesh_id)) == "mesh_damaged"


def test_a_mesh_under_the_name_of_another_is_noticed(meshes: MeshStore, tmp_path: Path) -> None:
    """Checksums are right, but what results are named by is not."""
    vertices, faces = SQUARE
    ids = [store_mesh(tmp_path, gc.TriangleMesh(vertices * scale, faces)) for scale in (1, 2)]
    assert [damage_of(meshes, mesh_id) for mesh_id in ids] == [[], []]
    first, second = (tmp_path / "meshes" / mesh_id for mesh_id in ids)
    for path in second.iterdir():
        shutil.copy(path, first)
    assert "its manifest belongs to another mesh" in damage_of(meshes, ids[0])[0]
    renamed = {**read_manifest(str(first / "manifest.json")), "id": ids[0]}
    (first / "manifest.json").write_bytes(encode_manifest(renamed))

    (found,) = damage_of(meshes, ids[0])
    assert "its id does not match its content" in found


@pytest.mark.parametrize("mesh_id", ["", "..", "0" * 32, "../meshes", "G" * 32])
def test_unknown_ids(meshes: MeshStore, mesh_id: str) -> None:
    assert code_of(lambda: meshes.manifest(mesh_id)) == "mesh_not_found"
    assert code_of(lambda: meshes.array_file(mesh_id, "faces")) == "mesh_not_found"


# Results


@pytest.fixture
def results(tmp_path: Path) -> ResultStore:
    store = ResultStore(FolderResults(tmp_path / "results"), 100, memory=0)
    store.prepare()
    return store


def write(root: Path, name: str, size: int = 40, *, is_cheap: bool = False):
    parts = [b"x" * size]
    return write_result(root / "results", name, parts, {"A": "b"}, "code", is_cheap=is_cheap)


def put(results: ResultStore, root: Path, name: str, size: int = 40, **how: bool) -> None:
    results.release(results.add(write(root, name, size, **how)))


def find(results: ResultStore, name: str):
    found = anyio.run(results.find, name)
    if found is not None:
        results.release(found)
    return found


def test_a_result_comes_back(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")

    found = find(results, "m/a")

    assert found is not None
    assert results.body(found).read_bytes() == b"x" * 40
    assert found.manifest.headers == {"A": "b"}
    assert found.key == "a"


def test_the_least_recently_used_go_first(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "m/b")
    find(results, "m/a")
    put(results, tmp_path, "m/c")

    assert [find(results, f"m/{key}") is not None for key in "abc"] == [True, False, True]
    assert len(list((tmp_path / "results" / "m").iterdir())) == 4


def test_what_is_being_sent_stays(results: ResultStore, tmp_path: Path) -> None:
    sent = results.add(write(tmp_path, "m/a", 90))
    put(results, tmp_path, "m/b")

    assert results.body(sent).exists()
    results.release(sent)
    put(results, tmp_path, "m/c")
    assert not results.body(sent).exists()


def test_a_changed_result_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    damage(tmp_path / "results" / "m" / "a.body")

    assert find(results, "m/a") is None
    assert find(results, "m/a") is None


def test_a_broken_manifest_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    (tmp_path / "results" / "m" / "a.json").write_bytes(b"{")

    assert find(results, "m/a") is None


def test_the_answer_of_a_job_stays_where_a_start_has_to_make_room(
    results: ResultStore, tmp_path: Path
) -> None:
    for key, second in (("job", 1), ("new", 2)):
        put(results, tmp_path, f"m/{key}")
        os.utime(tmp_path / "results" / "m" / f"{key}.json", (second, second))

    restarted = ResultStore(FolderResults(tmp_path / "results"), 50, memory=0)
    restarted.prepare()
    restarted.pin("m/job", None)
    restarted.make_room()

    assert find(restarted, "m/job") is not None
    assert find(restarted, "m/new") is None


def test_results_survive_a_restart(results: ResultStore, tmp_path: Path) -> None:
    for key, second in (("old", 1), ("new", 2)):
        put(results, tmp_path, f"m/{key}")
        os.utime(tmp_path / "results" / "m" / f"{key}.json", (second, second))
    (tmp_path / "results" / "m" / "incomplete.body").write_bytes(b"x")
    (tmp_path / "results" / "m" / "tmpabc").write_bytes(b"x")

    restarted = ResultStore(FolderResults(tmp_path / "results"), 50, memory=0)
    restarted.prepare()
    restarted.make_room()

    assert find(restarted, "m/old") is None
    assert find(restarted, "m/new") is not None
    names = sorted(path.name for path in (tmp_path / "results" / "m").iterdir())
    assert names == ["new.body", "new.json"]


@pytest.mark.parametrize("suffix", [".json", ".body"])
def test_a_result_that_another_service_removes_during_the_start_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    root = tmp_path / "results"
    for name in ("m/one", "m/two"):
        write_result(root, name, [b"x"], {}, "code", is_cheap=False)
    exists = Path.exists

    def exists_for_the_last_time(path: Path) -> bool:
        found = exists(path)
        if path.stem == "one":
            path.with_suffix(suffix).unlink()
        return found

    monkeypatch.setattr(Path, "exists", exists_for_the_last_time)
    assert list(FolderResults(root).found(is_alone=False)) == [("m/two", 1)]


def test_results_of_a_mesh_are_forgotten(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "n/a")

    results.forget_mesh("m")

    assert find(results, "m/a") is None
    assert find(results, "n/a") is not None


def test_small_results_are_in_memory_as_far_as_they_fit(tmp_path: Path) -> None:
    results = ResultStore(FolderResults(tmp_path / "results"), 10**6, memory=2 * 4096 + 100)
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


def test_the_memory_of_small_results_is_counted_whole(tmp_path: Path) -> None:
    memory = 2**22
    results = ResultStore(FolderResults(tmp_path / "results"), 10**6, memory=memory)
    headers = {"Geodesic-Method": "exact", "Geodesic-Error": "0.0", "Geodesic-Vertices": "12"}

    def answer(number: int) -> Result:
        body = [b"%0136d" % number]
        return write_result(
            tmp_path, f"m/{number:064x}", body, dict(headers), "code", is_cheap=True
        )

    tracemalloc.start()
    for number in range(3000):
        results.release(results.add(answer(number)))
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert memory / 4 < taken < memory
    assert find(results, f"m/{2999:064x}") is not None


def test_what_is_held_stays_until_it_is_released(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    results.pin("m/a", None)
    other = results.add(write(tmp_path, "m/b", 61))
    with pytest.raises(ProblemError):
        results.pin_within_quota("m/b", None)
    results.release(other)
    results.forget_mesh("m")

    assert find(results, "m/a") is not None
    assert find(results, "m/b") is None
    results.unpin("m/a", None)
    put(results, tmp_path, "m/c", 61)
    assert find(results, "m/a") is None


@pytest.mark.usefixtures("results")
def test_a_failed_result_leaves_nothing(tmp_path: Path) -> None:
    parts: list = [b"x" * 2**17, None]
    with pytest.raises(TypeError):
        write_result(tmp_path / "results", "m/a", parts, {}, "code", is_cheap=False)
    assert not list((tmp_path / "results").glob("m/*"))


@pytest.fixture
def roomy(tmp_path: Path) -> ResultStore:
    store = ResultStore(FolderResults(tmp_path / "results"), 10**6, memory=2 * 4096 + 100)
    store.prepare()
    return store


def test_what_is_small_and_found_at_once_has_no_files(roomy: ResultStore, tmp_path: Path) -> None:
    put(roomy, tmp_path, "m/small", is_cheap=True)
    put(roomy, tmp_path, "m/large", 2**17, is_cheap=True)

    assert find(roomy, "m/small").body == b"x" * 40
    assert roomy.nbytes == 2**17
    names = sorted(path.name for path in (tmp_path / "results").glob("m/*"))
    assert names == ["large.body", "large.json"]
    for key in "ab":
        put(roomy, tmp_path, f"m/{key}", is_cheap=True)
    assert find(roomy, "m/small") is None, "memory is bounded, too"
    roomy.forget_mesh("m")
    assert find(roomy, "m/a") is None


def test_files_come_when_they_are_needed(roomy: ResultStore, tmp_path: Path) -> None:
    written = write(tmp_path, "m/a", is_cheap=True)
    taken = roomy.add(written)

    filed = anyio.run(roomy.with_files, taken)
    roomy.pin("m/a", None)
    roomy.release(filed)

    assert roomy.body(filed).read_bytes() == b"x" * 40
    assert filed.manifest == taken.manifest
    assert anyio.run(roomy.with_files, filed) is filed
    restarted = ResultStore(FolderResults(tmp_path / "results"), 10**6, memory=0)
    restarted.prepare()
    assert find(restarted, "m/a").body == b"x" * 40


def test_what_gets_no_files_is_given_back(roomy: ResultStore, tmp_path: Path) -> None:
    taken = roomy.add(write(tmp_path, "m/a", is_cheap=True))
    (tmp_path / "results" / "m").write_bytes(b"in the way")

    with pytest.raises(FileExistsError):
        anyio.run(roomy.with_files, taken)
    (tmp_path / "results" / "m").unlink()
    assert find(roomy, "m/a") is not None
    roomy.forget_mesh("m")
    assert find(roomy, "m/a") is None, "what is in use would stay"


def test_a_large_result_is_read_once_for_each_version_of_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clients read it in many ranges, each of which finds it again."""
    root, reads = tmp_path / "results", list[str]()
    read = verified.read_checksum
    monkeypatch.setattr(verified, "read_checksum", lambda path: reads.append(path) or read(path))
    body = bytes(3 * SMALL)
    write = lambda file: file.write(body)  # noqa: E731
    result = write_result_file(root, "m/a", write, {}, "code", lambda: None)
    assert (result.manifest.size, result.manifest.crc32) == (len(body), zlib.crc32(body))
    store = ResultStore(FolderResults(root), 10**6, memory=0)
    store.prepare()
    for _ in range(3):
        assert anyio.run(store.find, "m/a") == result
    assert len(reads) == 1
    for _ in range(3):
        store.release(result)
    flip_bytes(root / "m" / "a.body")
    assert anyio.run(store.find, "m/a") is None
    assert store.nbytes == 0


def test_room_is_reserved_among_pinned_results(tmp_path: Path) -> None:
    store = ResultStore(FolderResults(tmp_path / "results"), 100, memory=0)
    store.add(write(tmp_path, "m/pinned", 40))
    store.pin("m/pinned", None)
    store.add(write(tmp_path, "m/other", 30))
    with store.reserving(None, 50):
        with pytest.raises(ProblemError):
            store.pin_within_quota("m/other", None)
        with pytest.raises(ProblemError) as refused, store.reserving(None, 11):
            pass
        problem = refused.value.problem
        assert (problem.code, problem.limit, problem.actual) == ("storage_full", 100, 101)
        assert problem.setting == "results_bytes"
        with store.reserving(None, 0) as reserve:
            reserve(6)
            reserve(4)
            with pytest.raises(ProblemError) as refused:
                reserve(1)
            assert refused.value.problem.code == "storage_full"
        with store.reserving(None, 10):
            pass
    store.pin_within_quota("m/other", None)


def test_the_answers_of_one_owner_s_jobs_leave_room_for_others(tmp_path: Path) -> None:
    """Both what is pinned and what is reserved count; a shared answer counts for each owner."""
    store = ResultStore(FolderResults(tmp_path / "results"), 100, memory=0, quota=50)
    for name in ("m/a", "m/b", "m/c"):
        store.add(write(tmp_path, name, 30))
    store.pin_within_quota("m/a", "alice")
    store.pin_within_quota("m/a", "alice")
    with pytest.raises(ProblemError) as refused:
        store.pin_within_quota("m/b", "alice")
    problem = refused.value.problem
    assert (problem.code, problem.status) == ("quota_exceeded", 507)
    assert (problem.limit, problem.actual) == (50, 60)
    assert problem.setting == "quota_results_bytes"
    with store.reserving("alice", 20):
        with pytest.raises(ProblemError):
            store.refuse_without_room("alice", 1)
        with pytest.raises(ProblemError):
            store.pin_within_quota("m/b", "alice")
        store.pin_within_quota("m/a", "bob")
        store.refuse_without_room("bob", 20)
    store.unpin("m/a", "alice")
    store.unpin("m/a", "alice")
    store.pin_within_quota("m/b", "alice")
