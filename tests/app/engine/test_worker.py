"""A worker, in this process: what it keeps open, and work that fails or is stopped."""

from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

from app.encoding import CSV, NPY, encode
from app.engine.signals import Signals
from app.engine.work import (
    ComputePart,
    JoinParts,
    MeshFromFile,
    MeshFromSample,
    StoreMesh,
    TaskResult,
)
from app.engine.worker import Clock, Worker
from app.errors import Problem
from app.queries import DistancesQuery, MatrixQuery, PathQuery
from app.schemas.points import VertexPoint
from app.schemas.requests import MatrixRequest, PathRequest
from app.store.fields import field_files
from app.store.meshes import MeshStore, OpenMesh
from geodesic_core import MatrixParts, TriangleMesh, exact_distance, samples
from tests.support.logs import Log
from tests.support.service import store_mesh
from tests.support.waiting import wait_until
from tests.support.workers import (
    code_of,
    distances_query,
    new_worker,
    outcome_of,
    run_query,
    worker_config,
)


def planes(*faces: int) -> list[TriangleMesh]:
    return [samples.plane(count) for count in faces]


def path_query(mesh_id: str, target: int, **members: Any) -> PathQuery:
    ends = {"source": VertexPoint(vertex=0), "target": VertexPoint(vertex=target)}
    return PathQuery(mesh_id, PathRequest(**ends, **members))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Ids of the meshes that were opened, in order."""
    open_mesh, ids = MeshStore.open, []

    def open_noted(store: MeshStore, mesh_id: str) -> OpenMesh:
        ids.append(mesh_id)
        return open_mesh(store, mesh_id)

    monkeypatch.setattr(MeshStore, "open", open_noted)
    return ids


def test_meshes_that_do_not_fit_are_closed(tmp_path: Path, opened: list[str]) -> None:
    meshes = planes(100, 200, 300)
    ids = [store_mesh(tmp_path, mesh) for mesh in meshes]
    worker = new_worker(tmp_path, worker_mesh_bytes=meshes[1].nbytes + meshes[2].nbytes)
    assert [code_of(worker, distances_query(mesh_id)) for mesh_id in ids] == [None] * 3
    assert opened == ids

    for mesh_id in (ids[2], ids[1], ids[0]):
        assert code_of(worker, distances_query(mesh_id)) is None

    assert opened[3:] == [ids[0]]


def test_what_paths_need_counts_as_part_of_an_open_mesh(tmp_path: Path, opened: list[str]) -> None:
    meshes = planes(200, 300)
    ids = [store_mesh(tmp_path, mesh) for mesh in meshes]
    worker = new_worker(tmp_path, worker_mesh_bytes=sum(mesh.nbytes for mesh in meshes) + 100)
    queries = [distances_query(mesh_id) for mesh_id in ids]
    for _ in range(2):
        assert [code_of(worker, query) for query in queries] == [None, None]
    assert opened == ids

    assert code_of(worker, path_query(ids[1], 60)) is None
    assert [code_of(worker, query) for query in (queries[1], queries[0])] == [None, None]

    assert opened[2:] == [ids[0]]


def test_meshes_with_barriers_are_kept_as_others_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (mesh,) = planes(200)
    mesh_id = store_mesh(tmp_path, mesh)
    worker = new_worker(tmp_path, worker_mesh_bytes=2 * mesh.nbytes)
    walls: list[list[int]] = [[3, 9], [3, 9], [], [5], [3, 9]]
    expected = [exact_distance(mesh, 0, barriers=wall).distances for wall in walls]
    with_barriers, blocked = TriangleMesh.with_barriers, []

    def with_barriers_noted(mesh: TriangleMesh, faces: Any) -> TriangleMesh:
        blocked.append(list(faces))
        return with_barriers(mesh, faces)

    monkeypatch.setattr(TriangleMesh, "with_barriers", with_barriers_noted)
    outcomes = [outcome_of(worker, distances_query(mesh_id, *wall)) for wall in walls]

    assert blocked == [[3, 9], [5], [3, 9]], "the first had to go: there is room for two meshes"
    for outcome, distances in zip(outcomes, expected, strict=True):
        found = orjson.loads(body_of(outcome))["distances"]
        np.testing.assert_array_equal(np.array(found, float), distances)


def body_of(outcome: Any) -> bytes:
    """Return the body of a small result."""
    assert isinstance(outcome, TaskResult), outcome
    assert outcome.result is not None
    assert outcome.result.body is not None
    return outcome.result.body


@pytest.fixture
def every_field_is_quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """No field takes long, by the clock of the cache, so that none is stored."""
    monkeypatch.setattr("app.queries.field_cache.perf_counter", lambda: 7.0)


@pytest.fixture
def every_field_is_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each field takes a second, by the clock of the cache, so that it is stored."""
    monkeypatch.setattr("app.queries.field_cache.perf_counter", count().__next__)


@pytest.mark.usefixtures("every_field_is_quick")
def test_fields_that_do_not_fit_are_dropped(tmp_path: Path, sweeps: list[int]) -> None:
    mesh_id = store_mesh(tmp_path, *planes(200))
    size = exact_distance(*planes(200), 0).nbytes
    sweeps.clear()
    worker = new_worker(tmp_path, worker_field_bytes=2 * size)

    for vertex in (0, 1, 0, 2, 0, 1):
        assert code_of(worker, distances_query(mesh_id, vertex=vertex)) is None
        assert worker.fields.nbytes <= 2 * size

    assert len(sweeps) == 4, "0, 1, 2 and again 1, which was used longest ago"


def test_fields_go_with_their_mesh(tmp_path: Path) -> None:
    meshes = planes(200, 300)
    ids = [store_mesh(tmp_path, mesh) for mesh in meshes]
    both, second = (new_worker(tmp_path, worker_mesh_bytes=meshes[1].nbytes + 1) for _ in range(2))

    for mesh_id in ids:
        assert code_of(both, distances_query(mesh_id)) is None
    assert code_of(second, distances_query(ids[1])) is None

    assert both.fields.nbytes == second.fields.nbytes > 0


def test_caches_are_emptied_where_memory_runs_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, opened: list[str]
) -> None:
    mesh_id = store_mesh(tmp_path, *planes(200))
    worker = new_worker(tmp_path)
    assert code_of(worker, distances_query(mesh_id)) is None
    assert worker.fields.nbytes > 0

    def answer(*_: Any) -> Any:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(DistancesQuery, "answer", answer)
        problem = outcome_of(worker, distances_query(mesh_id))

    assert isinstance(problem, Problem)
    assert (problem.code, problem.setting) == ("memory_limit", "worker_memory_bytes")
    assert worker.fields.nbytes == 0
    assert opened == [mesh_id]
    assert code_of(worker, distances_query(mesh_id)) is None
    assert opened == [mesh_id, mesh_id]


# Fields in the store


@pytest.mark.usefixtures("every_field_is_slow")
@pytest.mark.parametrize(
    "accuracy",
    [{}, {"method": "approximate", "relative_error": 0.01}, {"method": "fast", "effort": 2}],
)
def test_a_field_that_took_long_is_stored_for_other_workers(
    tmp_path: Path, sweeps: list[int], accuracy: dict[str, Any]
) -> None:
    mesh_id = store_mesh(tmp_path, samples.knot(2000))
    query = distances_query(mesh_id, 5, 6, vertex=3, **accuracy)
    first, second = new_worker(tmp_path), new_worker(tmp_path)

    body = body_of(outcome_of(first, query, NPY))
    wait_until(lambda: field_files(tmp_path))
    again = body_of(outcome_of(second, query, NPY))

    assert len(sweeps) == 1
    assert again == body
    assert second.fields.nbytes == first.fields.nbytes


@pytest.mark.usefixtures("every_field_is_quick")
def test_a_field_that_is_found_at_once_is_not_stored(tmp_path: Path, sweeps: list[int]) -> None:
    mesh_id = store_mesh(tmp_path, *planes(200))

    bodies = [body_of(outcome_of(new_worker(tmp_path), distances_query(mesh_id))) for _ in range(2)]

    assert bodies[0] == bodies[1]
    assert len(sweeps) == 2
    assert field_files(tmp_path) == {}


@pytest.mark.usefixtures("every_field_is_slow")
def test_stored_fields_are_bounded(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, *planes(200))
    assert code_of(new_worker(tmp_path), distances_query(mesh_id)) is None
    wait_until(lambda: field_files(tmp_path))
    (size,) = field_files(tmp_path).values()
    worker = new_worker(tmp_path, fields_bytes=2 * size)

    for vertex in (1, 2, 3):
        before = set(field_files(tmp_path))
        assert code_of(worker, distances_query(mesh_id, vertex=vertex)) is None
        wait_until(lambda before=before: set(field_files(tmp_path)) - before)

    wait_until(lambda: len(field_files(tmp_path)) == 2)
    assert sum(field_files(tmp_path).values()) <= 2 * size


@pytest.mark.usefixtures("every_field_is_slow")
def test_evictions_are_counted_by_all_workers_of_a_slot_together(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, *planes(200))
    signals, bound = Signals(), 5000

    def is_counted(number: int) -> bool:
        """Whether the store is within its bound, and each evicted field is counted."""
        sizes = field_files(tmp_path).values()
        return sum(sizes) <= bound and signals.stored_field_evictions + len(sizes) == number

    for first in (1, 3):  # a worker, and the one that replaces it
        config = worker_config(tmp_path, worker_field_bytes=1, fields_bytes=bound)
        worker = Worker(config, signals)
        for number in (first, first + 1):
            assert code_of(worker, distances_query(mesh_id, vertex=number)) is None
            wait_until(partial(is_counted, number))

    assert signals.field_evictions == 4, "each goes as soon as it has been used"
    assert signals.stored_field_evictions > 0


# Its work


def test_the_clock_measures_each_phase(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.engine.worker.perf_counter", iter([1.0, 1.25, 7.0, 9.5]).__next__)
    clock = Clock()

    for name in ("load", "compute"):
        with clock.phase(name):
            pass

    assert clock.seconds == {"load": 0.25, "compute": 2.5}


def test_a_defect_is_logged_and_becomes_a_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    monkeypatch.setitem(samples.SAMPLES, "plane", lambda _: 1 / 0)

    outcome = new_worker(tmp_path).do(
        1, StoreMesh(MeshFromSample("plane", 10, "none"), tmp_path / "mesh")
    )

    assert isinstance(outcome, Problem)
    assert outcome.code == "internal_error"
    assert [(line["event"], line["work"]) for line in log] == [("work failed", "StoreMesh")]


@pytest.mark.parametrize(
    "accuracy",
    [{}, {"method": "approximate", "relative_error": 0.01}, {"method": "fast", "effort": 2}],
)
def test_work_that_is_asked_to_stop_stops(tmp_path: Path, accuracy: dict[str, Any]) -> None:
    signals = Signals(stop_number=2)
    worker = Worker(worker_config(tmp_path), signals)
    mesh_id = store_mesh(tmp_path, samples.sphere(2000))
    work = run_query(path_query(mesh_id, 700, **accuracy))

    assert worker.do(2, work) is None
    assert not list(tmp_path.glob("results/*"))
    outcome = worker.do(3, work)
    assert isinstance(outcome, TaskResult)
    assert "encode" in outcome.seconds


@pytest.mark.parametrize("kind", ["off", "json", "sample"])
def test_making_a_mesh_stops_when_asked_to(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"a.{kind}"
    path.write_text(
        '{"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}'
        if kind == "json"
        else "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    from_file = MeshFromFile(path, kind, "none")
    work = StoreMesh(
        MeshFromSample("plane", 10, "none") if kind == "sample" else from_file, tmp_path / "mesh"
    )
    worker = Worker(worker_config(tmp_path), Signals(stop_number=2))

    assert worker.do(2, work) is None
    assert not work.folder.exists()
    assert isinstance(worker.do(3, work), TaskResult)


def test_an_answer_that_is_stopped_while_it_is_written_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signals = Signals()
    worker = Worker(worker_config(tmp_path), signals)
    mesh_id = store_mesh(tmp_path, samples.sphere(20_000))
    work = run_query(distances_query(mesh_id), CSV)

    def encode_and_stop(*arguments: Any) -> Any:
        def parts() -> Iterator[Any]:
            first, second, *others = body
            yield from (first, second)
            signals.stop_number = 1
            yield from others

        body, headers = encode(*arguments)
        return parts(), headers

    monkeypatch.setattr("app.engine.worker.encode", encode_and_stop)

    assert worker.do(1, work) is None
    assert not list(tmp_path.glob("results/*/*"))
    signals.stop_number = 0
    monkeypatch.undo()
    assert isinstance(worker.do(2, work), TaskResult)


def test_a_large_matrix_that_is_stopped_while_its_file_is_read_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signals = Signals()
    worker = Worker(worker_config(tmp_path), signals)
    mesh_id = store_mesh(tmp_path, samples.sphere(100))
    query = MatrixQuery(mesh_id, MatrixRequest(sources="all", targets="all"))
    write = MatrixParts.write
    part = worker.do(1, ComputePart(query, 0, f"{mesh_id}/part"))
    assert isinstance(part, TaskResult)
    before = set(tmp_path.glob("results/*/*"))

    def write_and_stop(*arguments: Any, **options: Any) -> None:
        write(*arguments, **options)
        signals.stop_number = 2

    monkeypatch.setattr(MatrixParts, "write", write_and_stop)

    work = JoinParts(query, [f"{mesh_id}/part"], 1, f"{mesh_id}/whole")
    assert worker.do(2, work) is None
    assert set(tmp_path.glob("results/*/*")) == before
