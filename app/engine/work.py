"""What a worker can be asked to do, and what it says when it has done it: small values only."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from app.encoding import Representation
from app.errors import Problem
from app.queries import Estimate, Query
from app.schemas.meshes import Merge
from app.store.meshes import WrittenMesh
from app.store.results import Written


@dataclass(frozen=True)
class MeshFromFile:
    """The mesh of an upload."""

    path: Path
    file_type: str
    merge: Merge
    owner: str | None = None
    """Who may delete it; None is everybody."""


@dataclass(frozen=True)
class MeshFromSample:
    """A sample."""

    name: str
    faces: int
    merge: Merge
    owner: str | None = None


MeshInput = MeshFromFile | MeshFromSample


@dataclass(frozen=True)
class StoreMesh:
    """Read or make a mesh, check it, and write it into a new folder."""

    origin: MeshInput
    folder: Path

    stops_when_asked: ClassVar[bool] = False


@dataclass(frozen=True)
class RunQuery:
    """Answer ``query`` into the result ``result_name``."""

    query: Query[Any]
    form: Representation
    result_name: str

    stops_when_asked: ClassVar[bool] = True


@dataclass(frozen=True)
class EstimateQuery:
    """Tell what the answer to ``query`` would take."""

    query: Query[Any]
    form: Representation

    stops_when_asked: ClassVar[bool] = True


Work = StoreMesh | RunQuery | EstimateQuery


@dataclass(frozen=True)
class Task:
    """Work, and what decides when and where it is done."""

    work: Work
    client: str
    """On whose behalf: clients take turns"""
    affinity_keys: tuple[str, ...] = ()
    """What it is about, the most telling first: best done where that came up before"""
    is_small: bool = False
    """Whether it is likely to be done at once, so that it need not wait behind long work"""


@dataclass(frozen=True)
class TaskResult:
    """What a worker reports: the seconds of each phase, and what the work was for.

    Answers are files; only small ones come along.
    """

    seconds: Mapping[str, float]
    mesh: WrittenMesh | None = None
    answer: Written | None = None
    estimate: Estimate | None = None


Outcome = TaskResult | Problem | None
"""Of work: done, refused, or stopped when asked to."""
