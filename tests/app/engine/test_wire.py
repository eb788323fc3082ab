"""Tasks and outcomes as bytes: what was sent arrives, and nothing else does."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.encoding import Representation
from app.engine import wire
from app.engine.wire import DamagedMessageError, Message, VersionError, Wire, WireError
from app.engine.work import (
    ComputePart,
    JoinParts,
    MeshFromFile,
    MeshFromSample,
    Outcome,
    RunQuery,
    StoreMesh,
    Task,
    TaskResult,
    Work,
)
from app.errors import Fault, Problem
from app.queries import KINDS, MatrixQuery, Query
from app.store.meshes import WrittenMesh
from app.store.results import Result, ResultManifest
from app.tracing import Period

HERE, THERE = Path("/here/store"), Path("/mnt/there")
MESH_ID = 32 * "a"
VERTEX = {"vertex": 3}
REQUESTS: dict[str, dict[str, Any]] = {
    "distances": {"sources": [VERTEX | {"start_distance": 0.1}], "barriers": [1, 2]},
    "path": {"source": VERTEX, "target": {"face": 7, "barycentric": [0.2, 0.3, 0.5]}},
    "steps": {"source": VERTEX, "target": VERTEX, "waypoints": [VERTEX]},
    "paths": {"source": VERTEX, "targets": [{"edge": [0, 1], "t": 1 / 3}]},
    "isolines": {"sources": [{"polyline": [VERTEX, {"vertex": 4}]}], "levels": [1e-300, 0.1]},
    "borders": {"sources": [VERTEX, {"vertex": 4}], "chord_error": 0.01},
    "matrix": {"sources": [VERTEX], "targets": [VERTEX], "method": "fast", "effort": 4},
    "nearest": {"source": VERTEX, "candidates": [VERTEX, {"vertex": 9}], "k": 1},
    "locate": {"points": [[0.1, 0.2, 0.3]], "max_distance": 5e-324},
}
FORM = Representation("application/json", "float32", "zstd")
QUERIES = [
    kind(MESH_ID, kind.model.model_validate(REQUESTS[name]), representation=FORM)
    for name, kind in KINDS.items()
]


def sent(task: Task) -> Task:
    """Return a task as it arrives at a machine with another store."""
    message = Wire(THERE).decode_task(Wire(HERE).encode_task(Message(task, {"request_id": "r1"})))
    assert message.log_fields == {"request_id": "r1"}
    return message.task


def returned(outcome: Outcome) -> Outcome:
    return Wire(HERE).decode_outcome(Wire(THERE).encode_outcome(outcome))


@pytest.mark.parametrize("query", QUERIES, ids=lambda query: query.kind)
def test_queries_of_each_kind_arrive(query: Query[Any]) -> None:
    work = RunQuery(query, f"{MESH_ID}/key")
    task = Task(work, "alice", query.affinity_keys, is_small=True, is_promised=True)

    assert sent(task) == task


def test_parts_of_matrices_arrive() -> None:
    query = next(each for each in QUERIES if isinstance(each, MatrixQuery))
    parts = (f"{MESH_ID}/key-0", f"{MESH_ID}/key-1")
    for work in (
        ComputePart(query, 1, parts[1]),
        JoinParts(query, parts, 77, f"{MESH_ID}/key"),
    ):
        assert sent(Task(work, "alice", query.affinity_keys, is_promised=True)).work == work


def test_other_queries_have_no_parts() -> None:
    query: Any = QUERIES[0]
    message = Wire(HERE).encode_task(Message(Task(ComputePart(query, 0, "a/b"), ""), {}))
    with pytest.raises(DamagedMessageError, match="has no parts"):
        Wire(HERE).decode_task(message)


@pytest.mark.parametrize("where", [MeshFromFile, MeshFromSample], ids=["a file", "a sample"])
def test_uploads_arrive_under_the_paths_of_the_other_machine(where: type) -> None:
    def task(store: Path) -> Task:
        work: Work
        if where is MeshFromFile:
            given = MeshFromFile(store / "tmp/x/upload", "obj", 1e-6)
            work = StoreMesh(given, store / "tmp/x/mesh", "alice", "a bunny")
        else:
            work = StoreMesh(MeshFromSample("knot", 100, "exact"), store / "tmp/x/mesh")
        return Task(work, "alice")

    assert sent(task(HERE)) == task(THERE)


@pytest.mark.parametrize(
    "outcome",
    [
        TaskResult({"compute": 0.1}),
        TaskResult(
            {"load": 0.0, "compute": 1 / 3},
            {"compute": Period(2**62, 2**62 + 1)},
            result=Result(
                f"{MESH_ID}/key",
                ResultManifest(headers={"a": "b"}, size=3, crc32=2**32 - 1, code="1+2"),
                b"\0\xff\n",
                has_files=False,
                is_reusable=False,
            ),
        ),
        TaskResult({}, mesh=WrittenMesh({"id": MESH_ID, "report": {"ids": [1, [2, 3]]}}, None)),
        Problem(
            "invalid_mesh",
            "faces are at fault",
            errors=(Fault("/faces/0", "at fault"),),
            limit=5,
            actual=5.5,
            setting="GEODESIC_X",
            hint="a hint",
            headers={"Retry-After": "1"},
        ),
        Problem("quota_exceeded", "full", other_status=507),
        None,
    ],
    ids=lambda outcome: getattr(outcome, "code", type(outcome).__name__),
)
def test_outcomes_return(outcome: Outcome) -> None:
    assert returned(outcome) == outcome


def test_a_mesh_returns_with_the_folder_of_this_machine() -> None:
    there = WrittenMesh({"id": MESH_ID}, THERE / "tmp/x/mesh", 12)
    here = WrittenMesh({"id": MESH_ID}, HERE / "tmp/x/mesh", 12)

    assert returned(TaskResult({}, mesh=there)) == TaskResult({}, mesh=here)


def test_whole_limits_stay_whole() -> None:
    """In a document, 5 and 5.0 are two things."""
    problem = returned(Problem("limit_exceeded", "too many", limit=5, actual=6))

    assert isinstance(problem, Problem)
    assert (type(problem.limit), type(problem.actual)) == (int, int)


MESSAGE = Wire(HERE).encode_task(Message(Task(RunQuery(QUERIES[0], "a/b"), "alice"), {}))


def test_another_version_is_said_to_be_one() -> None:
    other = MESSAGE[:4] + struct.pack(">H", wire.VERSION + 1) + MESSAGE[6:]

    with pytest.raises(VersionError, match="the same release") as caught:
        Wire(HERE).decode_task(other)
    assert caught.value.theirs == wire.VERSION + 1


@given(st.integers(0, len(MESSAGE) - 1), st.integers(1, 255))
def test_a_changed_byte_is_noticed(place: int, change: int) -> None:
    damaged = bytearray(MESSAGE)
    damaged[place] ^= change

    with pytest.raises(WireError):
        Wire(HERE).decode_task(bytes(damaged))


@given(st.integers(0, len(MESSAGE) - 1))
def test_a_cut_is_noticed(length: int) -> None:
    with pytest.raises(DamagedMessageError):
        Wire(HERE).decode_task(MESSAGE[:length])


@given(st.binary(max_size=200))
def test_foreign_bytes_are_refused(data: bytes) -> None:
    for body in (data, framed(data)):
        with pytest.raises(DamagedMessageError):
            Wire(HERE).decode_task(body)
        with pytest.raises(DamagedMessageError):
            Wire(HERE).decode_outcome(body)


def framed(body: bytes) -> bytes:
    """Return a message with any body, whose checksum is right."""
    return b"GEOD" + struct.pack(">HI", wire.VERSION, zlib.crc32(body)) + body


def test_an_outcome_is_no_task() -> None:
    with pytest.raises(DamagedMessageError, match="type"):
        Wire(HERE).decode_task(Wire(HERE).encode_outcome(None))
    with pytest.raises(DamagedMessageError, match="type"):
        Wire(HERE).decode_outcome(MESSAGE)


MATRIX = wire._Query("matrix", MESH_ID, orjson.dumps(REQUESTS["matrix"]), FORM)
NAME = f"{MESH_ID}/key"


@pytest.mark.parametrize("path", ["/etc/passwd", "../x", "a/../../x", "a\0b"])
@pytest.mark.parametrize(
    "work",
    [
        lambda path: wire._Store(wire._Sample("knot", 10, "none"), path, None, None),
        lambda path: wire._Store(wire._File(path, "obj", "none"), "tmp/x", None, None),
        lambda path: wire._Run(MATRIX, path),
        lambda path: wire._Run(msgspec.structs.replace(MATRIX, mesh_id=path), NAME),
        lambda path: wire._Part(MATRIX, 0, path),
        lambda path: wire._Join(MATRIX, [NAME], 1, path),
        lambda path: wire._Join(MATRIX, [NAME, path], 1, NAME),
    ],
    ids=["folder", "file", "result", "mesh", "part", "matrix", "a part of a matrix"],
)
def test_paths_and_names_stay_in_the_store(work: Callable[[str], Any], path: str) -> None:
    def sent(path: str) -> bytes:
        return wire.encode(wire._Task(work(path), "alice", (), False, False, {}))

    assert Wire(HERE).decode_task(sent("a/b")).task.client == "alice"
    with pytest.raises(DamagedMessageError, match="no place in the store"):
        Wire(HERE).decode_task(sent(path))


def test_the_name_of_a_result_that_returns_stays_in_the_store() -> None:
    manifest = ResultManifest(headers={}, size=3, crc32=1)
    result = Result("a/../../x", manifest, b"abc", has_files=False)

    with pytest.raises(DamagedMessageError, match="no place in the store"):
        returned(TaskResult({}, result=result))


def test_unknown_kinds_and_codes_are_refused() -> None:
    query = wire._Query("areas", MESH_ID, b"{}", FORM)
    task = wire._Task(wire._Run(query, "id/key"), "alice", (), False, False, {})
    with pytest.raises(DamagedMessageError, match="no kind of query 'areas'"):
        Wire(HERE).decode_task(wire.encode(task))

    query = wire._Query("distances", MESH_ID, b'{"sources": []}', FORM)
    task = wire._Task(wire._Run(query, "id/key"), "alice", (), False, False, {})
    with pytest.raises(DamagedMessageError, match="cannot be read"):
        Wire(HERE).decode_task(wire.encode(task))

    with pytest.raises(DamagedMessageError, match="no problem 'odd'"):
        Wire(HERE).decode_outcome(wire.encode(wire._Refused(Problem("odd", "x"))))
