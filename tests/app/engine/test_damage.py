"""A worker, in this process, whose mesh is damaged before and between its queries."""

from pathlib import Path

import pytest

from app.encoding import NPY
from app.engine.work import TaskResult
from app.engine.worker import Worker
from app.store import meshes
from app.store.meshes import MeshStore
from geodesic_core import samples
from tests.support.faults import flip_bytes
from tests.support.service import store_mesh
from tests.support.workers import code_of, distances_query, new_worker, outcome_of

WALL = (3, 9)


@pytest.fixture
def mesh_id(tmp_path: Path) -> str:
    return store_mesh(tmp_path, samples.plane(200))


def answer(worker: Worker, mesh_id: str, *barriers: int) -> bytes:
    outcome = outcome_of(worker, distances_query(mesh_id, *barriers, vertex=7), NPY)
    assert isinstance(outcome, TaskResult), outcome
    assert outcome.result is not None
    assert outcome.result.body is not None
    return outcome.result.body


def test_a_damaged_mesh_is_not_opened_and_a_healed_one_is_opened_anew(
    tmp_path: Path, mesh_id: str
) -> None:
    """A worker that has it open has mapped the damage: it must not go on with that."""
    worker = new_worker(tmp_path)
    expected = [answer(worker, mesh_id), answer(worker, mesh_id, *WALL)]
    flip_bytes(MeshStore(tmp_path).array_file(mesh_id, "vertices"))
    for barriers in ((), WALL):
        query = distances_query(mesh_id, *barriers, vertex=7)
        assert code_of(new_worker(tmp_path), query) == "mesh_damaged"
    store_mesh(tmp_path, samples.plane(200))
    for each in (worker, new_worker(tmp_path)):
        assert [answer(each, mesh_id), answer(each, mesh_id, *WALL)] == expected


def test_files_are_verified_when_a_process_opens_the_mesh(
    tmp_path: Path, mesh_id: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[Path] = []
    read = meshes.checksum_of
    monkeypatch.setattr(meshes, "checksum_of", lambda path: reads.append(path) or read(path))
    arrays = (tmp_path / "meshes" / mesh_id).glob("*.npy")
    worker = new_worker(tmp_path)
    for vertex in (1, 2):
        assert code_of(worker, distances_query(mesh_id, vertex=vertex)) is None
    assert sorted(reads) == sorted(arrays)
