"""Tasks and their outcomes as bytes: what travels between machines.

Within a machine, work goes to a worker as a pickle: both ends run the same code, and a socket
connects them. Machines may run different releases, and a pickle would run what its sender says. So
a message has a version and a checksum, and is decoded into the types that are declared here.

::

    4 bytes   GEOD
    2 bytes   version
    4 bytes   CRC-32 of the rest
    rest      MessagePack

Paths of the store travel relative to it: machines may have it in different places.
"""

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, Literal, TypeVar

import msgspec

from app.encoding import Representation
from app.engine.work import (
    ComputePart,
    JoinParts,
    MeshFromFile,
    MeshFromSample,
    MeshInput,
    Outcome,
    RunQuery,
    StoreMesh,
    Task,
    TaskResult,
    Work,
)
from app.errors import CODES, Problem
from app.queries import KINDS, MatrixQuery, Query
from app.store.meshes import WrittenMesh
from app.store.results import Result, ResultManifest
from app.tracing import Period

VERSION = 8
"""To be raised with every change of the types below, and of what they mean"""

_MAGIC = b"GEOD"
_HEAD = struct.Struct(">4sHI")

T = TypeVar("T")


class WireError(Exception):
    """A message cannot be read."""


class DamagedMessageError(WireError):
    """The bytes are no message, or not what was sent."""


class VersionError(WireError):
    """The message comes from a release with another version of these types."""

    def __init__(self, theirs: int) -> None:
        super().__init__(
            f"a message has version {theirs}, but this release uses {VERSION}: run the same "
            "release of geodesic on all machines"
        )
        self.theirs = theirs


class _Sample(msgspec.Struct, frozen=True, tag="sample"):
    sample: str
    faces: int
    merge: Literal["none", "exact"] | float


class _File(msgspec.Struct, frozen=True, tag="file"):
    path: str
    file_type: str | None
    merge: Literal["none", "exact"] | float


class _Store(msgspec.Struct, frozen=True, tag="store"):
    mesh_input: _Sample | _File
    folder: str
    owner: str | None
    name: str | None


class _Query(msgspec.Struct, frozen=True):
    kind: str
    mesh_id: str
    request: bytes
    """As JSON, see `Query.written`"""
    representation: Representation


class _Run(msgspec.Struct, frozen=True, tag="run"):
    query: _Query
    result_name: str


class _Part(msgspec.Struct, frozen=True, tag="part"):
    query: _Query
    part: int
    result_name: str


class _Join(msgspec.Struct, frozen=True, tag="join"):
    query: _Query
    parts: Sequence[str]
    reached: int
    result_name: str


_Work = _Store | _Run | _Part | _Join


class _Task(msgspec.Struct, frozen=True):
    work: _Work
    client: str
    affinity_keys: tuple[str, ...]
    is_small: bool
    is_promised: bool
    log_fields: dict[str, str]


class _Mesh(msgspec.Struct, frozen=True):
    manifest: dict[str, Any]
    folder: str | None
    size: int


class _Result(msgspec.Struct, frozen=True):
    name: str
    headers: dict[str, str]
    size: int
    crc32: int
    code: str
    body: bytes | None
    has_files: bool
    is_reusable: bool


class _Done(msgspec.Struct, frozen=True, tag="done"):
    seconds: dict[str, float]
    periods: dict[str, Period]
    mesh: _Mesh | None
    result: _Result | None


class _Refused(msgspec.Struct, frozen=True, tag="refused"):
    problem: Problem


class _Stopped(msgspec.Struct, frozen=True, tag="stopped"):
    pass


@dataclass(frozen=True)
class Message:
    """A task on its way to another machine, and the fields of what is logged about it there."""

    task: Task
    log_fields: Mapping[str, str]


class Wire:
    """The codec of a machine, which has the store at ``store``."""

    def __init__(self, store: Path) -> None:
        self._store = store

    def encode_task(self, message: Message) -> bytes:
        """Return a task as bytes."""
        task = message.task
        return encode(
            _Task(
                self._work_out(task.work),
                task.client,
                tuple(task.affinity_keys),
                task.is_small,
                task.is_promised,
                dict(message.log_fields),
            )
        )

    def decode_task(self, data: bytes) -> Message:
        """Return the task that ``encode_task`` wrote; raises ``WireError``."""
        read = decode(data, _Task)
        task = Task(
            self._work_in(read.work),
            read.client,
            read.affinity_keys,
            read.is_small,
            read.is_promised,
        )
        return Message(task, read.log_fields)

    def encode_outcome(self, outcome: Outcome) -> bytes:
        """Return the end of a task as bytes: a result, a problem, or that it was stopped."""
        match outcome:
            case TaskResult():
                return encode(
                    _Done(
                        dict(outcome.seconds),
                        dict(outcome.periods),
                        self._mesh_out(outcome.mesh),
                        _result_out(outcome.result),
                    )
                )
            case Problem():
                return encode(_Refused(outcome))
            case None:
                return encode(_Stopped())

    def decode_outcome(self, data: bytes) -> Outcome:
        """Return what ``encode_outcome`` wrote; raises ``WireError``."""
        match decode(data, _Done | _Refused | _Stopped):
            case _Done() as done:
                return TaskResult(
                    done.seconds,
                    done.periods,
                    self._mesh_in(done.mesh),
                    _result_in(done.result),
                )
            case _Refused(problem):
                if problem.code not in CODES:
                    raise DamagedMessageError(f"there is no problem {problem.code!r}")
                return problem
            case _:
                return None

    def _work_out(self, work: Work) -> _Work:
        match work:
            case StoreMesh(mesh_input, folder, owner, name):
                return _Store(self._input_out(mesh_input), self._path_out(folder), owner, name)
            case RunQuery(query, name):
                return _Run(_query_out(query), name)
            case ComputePart(query, part, name):
                return _Part(_query_out(query), part, name)
            case JoinParts(query, parts, reached, name):
                return _Join(_query_out(query), list(parts), reached, name)

    def _work_in(self, work: _Work) -> Work:
        match work:
            case _Store(mesh_input, folder, owner, name):
                return StoreMesh(self._input_in(mesh_input), self._path_in(folder), owner, name)
            case _Run(query, name):
                return RunQuery(_query_in(query), _inside(name))
            case _Part(query, part, name):
                return ComputePart(_matrix_in(query), part, _inside(name))
            case _Join(query, parts, reached, name):
                names = tuple(map(_inside, parts))
                return JoinParts(_matrix_in(query), names, reached, _inside(name))

    def _input_out(self, given: MeshInput) -> _Sample | _File:
        match given:
            case MeshFromSample():
                return _Sample(given.sample, given.faces, given.merge)
            case MeshFromFile():
                return _File(self._path_out(given.path), given.file_type, given.merge)

    def _input_in(self, given: _Sample | _File) -> MeshInput:
        match given:
            case _Sample():
                return MeshFromSample(given.sample, given.faces, given.merge)
            case _File():
                return MeshFromFile(self._path_in(given.path), given.file_type, given.merge)

    def _mesh_out(self, mesh: WrittenMesh | None) -> _Mesh | None:
        if mesh is None:
            return None
        folder = None if mesh.folder is None else self._path_out(mesh.folder)
        return _Mesh(dict(mesh.manifest), folder, mesh.size)

    def _mesh_in(self, mesh: _Mesh | None) -> WrittenMesh | None:
        if mesh is None:
            return None
        folder = None if mesh.folder is None else self._path_in(mesh.folder)
        return WrittenMesh(mesh.manifest, folder, mesh.size)

    def _path_out(self, path: Path) -> str:
        return path.relative_to(self._store).as_posix()

    def _path_in(self, path: str) -> Path:
        return self._store / _inside(path)


def encode(value: object) -> bytes:
    """Return a value as a message."""
    body = msgspec.msgpack.encode(value)
    return _HEAD.pack(_MAGIC, VERSION, zlib.crc32(body)) + body


def decode(data: bytes, kind: Any) -> Any:
    """Return the value in a message, of this type.

    Raises
    ------
    DamagedMessageError
        The bytes are no message, not what was sent, or a message of another type.
    VersionError
        A release with another version wrote them.
    """
    if len(data) < _HEAD.size or not data.startswith(_MAGIC):
        raise DamagedMessageError("the bytes are not a message of geodesic")
    _, version, checksum = _HEAD.unpack_from(data)
    body = memoryview(data)[_HEAD.size :]
    if version != VERSION:
        raise VersionError(version)
    if zlib.crc32(body) != checksum:
        raise DamagedMessageError("the message was damaged on the way")
    try:
        return _decoder(kind).decode(body)
    except msgspec.DecodeError as error:
        raise DamagedMessageError(f"the message is not of the expected type: {error}") from error


@cache
def _decoder(kind: Any) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind)


def _inside(path: str) -> str:
    """Return a path in the store, or a name that files there have; raise where it leads out."""
    parts = PurePosixPath(path)
    if parts.is_absolute() or ".." in parts.parts or "\0" in path:
        raise DamagedMessageError(f"{path!r} is no place in the store")
    return path


def _query_out(query: Query[Any]) -> _Query:
    return _Query(query.kind, query.mesh_id, query.written, query.representation)


def _query_in(query: _Query) -> Query[Any]:
    kind = KINDS.get(query.kind)
    if kind is None:
        raise DamagedMessageError(f"there is no kind of query {query.kind!r}")
    try:
        request = kind.model.model_validate_json(query.request)
        return kind(_inside(query.mesh_id), request, representation=query.representation)
    except ValueError as error:
        raise DamagedMessageError(f"the query of kind {query.kind} cannot be read") from error


def _matrix_in(query: _Query) -> MatrixQuery:
    read = _query_in(query)
    if not isinstance(read, MatrixQuery):
        raise DamagedMessageError(f"a query of kind {query.kind} has no parts")
    return read


def _result_out(result: Result | None) -> _Result | None:
    if result is None:
        return None
    manifest = result.manifest
    return _Result(
        result.name,
        manifest.headers,
        manifest.size,
        manifest.crc32,
        manifest.code,
        result.body,
        result.has_files,
        result.is_reusable,
    )


def _result_in(result: _Result | None) -> Result | None:
    if result is None:
        return None
    manifest = ResultManifest(
        headers=result.headers, size=result.size, crc32=result.crc32, code=result.code
    )
    return Result(_inside(result.name), manifest, result.body, result.has_files, result.is_reusable)
