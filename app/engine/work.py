"""The work of worker processes, and its results: small values that pass through a socket."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.errors import Problem
from app.queries import CutQuery, MatrixQuery, Query
from app.schemas.meshes import Merge
from app.store.meshes import WrittenMesh
from app.store.results import Result
from app.tracing import Period


@dataclass(frozen=True)
class MeshFromFile:
    """An uploaded mesh file."""

    path: Path
    file_type: str | None
    """None where the name of the file, or its content, tells"""
    merge: Merge


@dataclass(frozen=True)
class MeshFromSample:
    """A sample mesh."""

    sample: str
    faces: int
    merge: Merge


@dataclass(frozen=True)
class MeshFromCut:
    """A stored mesh that is cut along curves."""

    query: CutQuery


MeshInput = MeshFromFile | MeshFromSample | MeshFromCut


@dataclass(frozen=True)
class StoreMesh:
    """Read or make a mesh, check it, and write it into a new folder."""

    mesh_input: MeshInput
    folder: Path
    name: str | None = None
    """What people call the mesh"""


@dataclass(frozen=True)
class RunQuery:
    """Answer a query, and write the answer as the result ``result_name``."""

    query: Query[Any]
    result_name: str


@dataclass(frozen=True)
class ComputePart:
    """Compute a part of a large matrix, and write it as the result ``result_name``."""

    query: MatrixQuery
    part: int
    result_name: str


@dataclass(frozen=True)
class JoinParts:
    """Write a large matrix, whose parts are results, as the result ``result_name``."""

    query: MatrixQuery
    parts: Sequence[str]
    """Names of their results"""
    reached: int
    """Number of finite distances"""
    result_name: str


WritesResult = RunQuery | ComputePart | JoinParts
"""Work that ends with a result of a name: whoever else asks for it can wait for the same"""

Work = StoreMesh | WritesResult


@dataclass(frozen=True)
class Task:
    """Work, and all that decides when and by which worker it is done."""

    work: Work
    client: str
    """Name of the caller; callers take turns"""
    affinity_keys: tuple[str, ...] = ()
    """Keys of what a worker may have cached, the most valuable first"""
    is_small: bool = False
    """Whether the work is so short that it should not wait behind long work"""
    is_promised: bool = False
    """Whether it was accepted before, so that it waits for a worker however full the queue is"""


@dataclass(frozen=True)
class TaskResult:
    """The report of a worker: its phases, and one result, of the kind of the work."""

    seconds: Mapping[str, float]
    """Seconds of each phase"""
    periods: Mapping[str, Period] = field(default_factory=dict)
    """Begin and end of each phase, for traces"""
    mesh: WrittenMesh | None = None
    about_mesh: Mapping[str, Any] = field(default_factory=dict)
    """What the answer to a cut tells besides"""
    result: Result | None = None


Outcome = TaskResult | Problem | None
"""The end of work: done, refused, or stopped on request"""
