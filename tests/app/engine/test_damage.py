"""A worker, in this process, whose mesh is damaged before, between and during its queries."""

import os
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from app.encoding import NPY
from app.engine.work import TaskResult
from app.engine.worker import Worker
from app.errors import Problem
from app.queries import DistancesQuery
from app.store import meshes, verified
from app.store.fields import field_files
from app.store.meshes import MeshStore
from app.store.verified import FileVersion, version_of
from geodesic_core import TriangleMesh, samples
from tests.support.faults import FAULTS, MANIFEST_FAULTS, Fault, flip_bytes, remove, replace
from tests.support.service import store_mesh
from tests.support.waiting import wait_until
from tests.support.workers import code_of, distances_query, new_worker, outcome_of

ARRAYS = ("vertices", "faces", "component")
WALL = [3, 9]

each_fault = pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS.keys())


def plane() -> TriangleMesh:
    return samples.plane(200)


@pytest.fixture
def mesh_id(tmp_path: Path) -> str:
    return store_mesh(tmp_path, plane())


def file_of(root: Path, mesh_id: str, name: str) -> Path:
    return root / "meshes" / mesh_id / name


def answer(worker: Worker, mesh_id: str, *barriers: int, vertex: int = 7) -> bytes:
    outcome = outcome_of(worker, distances_query(mesh_id, *barriers, vertex=vertex), NPY)
    assert isinstance(outcome, TaskResult), outcome
    assert outcome.result is not None
    assert outcome.result.body is not None
    return outcome.result.body


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The answer on a mesh that was never damaged."""
    root = tmp_path_factory.mktemp("whole")
    return answer(new_worker(root), store_mesh(root, plane()))


@pytest.mark.slow
@each_fault
@pytest.mark.parametrize("name", ARRAYS)
def test_damage_of_an_open_mesh_is_noticed_and_healed_by_writing_it_again(
    tmp_path: Path, mesh_id: str, expected: bytes, name: str, fault: Fault
) -> None:
    worker = new_worker(tmp_path)
    for barriers in ([], WALL):
        assert code_of(worker, distances_query(mesh_id, *barriers)) is None
    with_walls = answer(worker, mesh_id, *WALL)

    fault(file_of(tmp_path, mesh_id, f"{name}.npy"))
    for barriers in ([], WALL):
        for each in (worker, new_worker(tmp_path)):
            problem = outcome_of(each, distances_query(mesh_id, *barriers, vertex=7))
            assert isinstance(problem, Problem)
            assert problem.code == "mesh_damaged"
            assert f"its array {name} has changed since it was written" in problem.detail
    assert store_mesh(tmp_path, plane()) == mesh_id

    assert not any(MeshStore(tmp_path).inspect(mesh_id))
    for each in (worker, new_worker(tmp_path)):
        assert answer(each, mesh_id) == expected
        assert answer(each, mesh_id, *WALL) == with_walls


@pytest.mark.parametrize("fault", MANIFEST_FAULTS.values(), ids=MANIFEST_FAULTS.keys())
def test_damage_of_a_manifest_is_noticed_and_healed_by_writing_the_mesh_again(
    tmp_path: Path, mesh_id: str, expected: bytes, fault: Fault
) -> None:
    store = MeshStore(tmp_path)
    before = store.manifest(mesh_id)

    fault(file_of(tmp_path, mesh_id, "manifest.json"))
    (damage,) = store.inspect(mesh_id)
    assert "its manifest has changed since it was written" in str(damage)
    assert code_of(new_worker(tmp_path), distances_query(mesh_id)) == "mesh_damaged"
    store_mesh(tmp_path, plane())

    assert not any(store.inspect(mesh_id))
    assert {**store.manifest(mesh_id), "created": ""} == {**before, "created": ""}
    assert answer(new_worker(tmp_path), mesh_id) == expected


def test_a_healed_mesh_keeps_its_owner_if_its_manifest_is_whole(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, plane(), "alice")
    created = MeshStore(tmp_path).manifest(mesh_id)["created"]

    flip_bytes(file_of(tmp_path, mesh_id, "faces.npy"))
    store_mesh(tmp_path, plane(), "bob")
    manifest = MeshStore(tmp_path).manifest(mesh_id)
    assert (manifest["owner"], manifest["created"]) == ("alice", created)

    flip_bytes(file_of(tmp_path, mesh_id, "manifest.json"))
    store_mesh(tmp_path, plane(), "bob")
    assert MeshStore(tmp_path).manifest(mesh_id)["owner"] == "bob"


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Paths of the files that were verified, in order."""
    read, paths = verified.read_checksum, []

    def read_noted(path: str) -> int | None:
        paths.append(path)
        return read(path)

    monkeypatch.setattr(verified, "read_checksum", read_noted)
    return paths


def test_files_that_do_not_change_are_verified_once(
    tmp_path: Path, mesh_id: str, reads: list[str]
) -> None:
    arrays = {str(path) for path in (tmp_path / "meshes" / mesh_id).glob("*.npy")}
    for worker in (new_worker(tmp_path), new_worker(tmp_path)):
        for vertex in (1, 2):
            assert code_of(worker, distances_query(mesh_id, vertex=vertex)) is None
    assert sorted(reads) == sorted(arrays)


def test_a_file_that_was_only_touched_is_no_damage(
    tmp_path: Path, mesh_id: str, expected: bytes
) -> None:
    worker = new_worker(tmp_path)
    assert code_of(worker, distances_query(mesh_id)) is None
    for path in (tmp_path / "meshes" / mesh_id).iterdir():
        os.utime(path)
    assert answer(worker, mesh_id) == expected


# During a query


@pytest.fixture
def every_field_is_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each field takes a second, by the clock of the cache, so that it is stored."""
    monkeypatch.setattr("app.queries.field_cache.perf_counter", count().__next__)


def damage_during(patch: pytest.MonkeyPatch, when: str, path: Path, fault: Fault) -> None:
    """Have a file damaged before or after the solver's work, before it fails, or while encoding."""
    solve = DistancesQuery.answer

    def damaged_answer(*arguments: Any) -> Any:
        if when in ("before", "failing"):
            fault(path)
        if when == "failing":
            raise ZeroDivisionError
        found = solve(*arguments)
        if when == "after":
            fault(path)
        return found

    def encode(*_: Any) -> Any:
        def parts() -> Iterator[bytes]:
            yield b"x" * 2**17
            fault(path)

        return parts(), {}

    patch.setattr(DistancesQuery, "answer", damaged_answer)
    if when == "encoding":
        patch.setattr("app.engine.worker.encode", encode)


@pytest.mark.slow
@pytest.mark.usefixtures("every_field_is_slow")
@pytest.mark.parametrize("when", ["before", "after", "failing", "encoding"])
@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_computed_on_a_damaged_mesh_is_neither_answered_nor_stored(
    tmp_path: Path,
    mesh_id: str,
    expected: bytes,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    when: str,
) -> None:
    worker = new_worker(tmp_path)
    assert code_of(worker, distances_query(mesh_id)) is None
    wait_until(lambda: len(field_files(tmp_path)) == 1)
    stored = {path: path.read_bytes() for path in tmp_path.glob("results/*/*")}

    with monkeypatch.context() as patch:
        damage_during(patch, when, file_of(tmp_path, mesh_id, f"{name}.npy"), flip_last_bit)
        assert code_of(worker, distances_query(mesh_id, vertex=7)) == "mesh_damaged"
    worker._writer.shutdown()
    store_mesh(tmp_path, plane())

    assert {path: path.read_bytes() for path in tmp_path.glob("results/*/*")} == stored
    if when != "encoding":  # by then the field was known to be right
        assert len(field_files(tmp_path)) == 1
    for each in (worker_after(worker), new_worker(tmp_path)):
        assert answer(each, mesh_id) == expected


def worker_after(worker: Worker) -> Worker:
    """Return the same worker, with what it has cached, and another thread to write fields."""
    fresh = new_worker(worker.settings.store)
    fresh.meshes, fresh.fields = worker.meshes, worker.fields
    return fresh


def flip_last_bit(path: Path) -> None:
    """Change an array in place, so that its numbers stay valid: kernels do not check them."""
    with path.open("r+b") as file:
        file.seek(-8, os.SEEK_END)
        (first, *_) = file.read(1)
        file.seek(-8, os.SEEK_END)
        file.write(bytes([first ^ 1]))


@pytest.mark.parametrize("fault", [replace, remove, os.utime])
def test_a_query_goes_on_where_its_files_stay_mapped_as_they_were(
    tmp_path: Path,
    mesh_id: str,
    expected: bytes,
    monkeypatch: pytest.MonkeyPatch,
    fault: Fault,
) -> None:
    worker = new_worker(tmp_path)
    damage_during(monkeypatch, "before", file_of(tmp_path, mesh_id, "faces.npy"), fault)
    assert answer(worker, mesh_id) == expected


# Damage without a trace


def test_damage_that_no_status_tells_of_is_found_by_inspection(
    tmp_path: Path, mesh_id: str, expected: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk changes bits in silence, which a status without the time of change stands for."""

    def silent(path: str) -> FileVersion | None:
        version = version_of(path)
        return version and version._replace(ctime_ns=0)

    for module in (meshes, verified):
        monkeypatch.setattr(module, "version_of", silent)
    worker, store = new_worker(tmp_path), MeshStore(tmp_path)
    assert code_of(worker, distances_query(mesh_id)) is None
    assert not any(store.inspect(mesh_id))
    path = file_of(tmp_path, mesh_id, "vertices.npy")
    status = path.stat()
    flip_last_bit(path)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert store.array_file(mesh_id, "vertices") == path, "nobody can know"

    assert any(store.inspect(mesh_id))
    store.distrust(mesh_id)

    for each in (worker, new_worker(tmp_path)):
        assert code_of(each, distances_query(mesh_id, vertex=7)) == "mesh_damaged"
    store_mesh(tmp_path, plane())
    assert answer(worker, mesh_id) == expected
