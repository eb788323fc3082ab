"""The base of all queries: a validated request to a mesh, with a stable hash."""

import hashlib
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import orjson
from numpy.typing import NDArray

import geodesic_core as gc
from app import __version__
from app.encoding import JSON, NPY, OCTETS, Answer, Representation
from app.queries.cost_model import PER_FACE_BLOCKED
from app.queries.field_cache import FieldCache
from app.queries.points import SurfacePoints, name_of, notes_on, resolve_points
from app.queries.validation import (
    MeshSize,
    WrittenPoints,
    check_barriers,
    check_json_size,
    check_points,
    naming,
)
from app.schemas.points import StrictModel
from app.schemas.requests import AmongBarriers, QueryBody
from app.settings import Settings
from app.store.meshes import OpenMesh

VALUES_OF_POINT = 8
"""Values of a point in JSON: position, distance, and a face with three weights."""

BYTES_OF_VALUE = 8
"""Bytes of a value of an answer, about: in binary, and in text that is compressed."""

SMALL_SECONDS = 0.05
"""Seconds of work below which a query is small: it need not wait behind long work."""

UNLIMITED = 2**63
"""A limit that no answer reaches."""

_UNKNOWN, _AS_JSON = MeshSize(0, 0, 0.0), Representation(JSON)

R = TypeVar("R", bound=StrictModel)


@dataclass(frozen=True)
class ExecutionContext:
    """The resources of one answer, and the callbacks by which it is watched and stopped."""

    cancel: Callable[[], bool]
    progress: Callable[[float], None]
    fields: FieldCache | None = None
    """Fields of earlier answers; None solves anew"""
    memory_limit: int | None = None
    """Bytes; None for no limit"""
    max_values: int = UNLIMITED
    """Most values of the answer, where it is written as JSON"""
    max_cells: int = UNLIMITED
    """Most cells of a sparse matrix, whose number is known only once it is computed"""
    max_points: int = UNLIMITED
    """Most points that are looked for, where the request does not say how many"""

    def part(self, part: int, parts: int) -> "ExecutionContext":
        """Return the context of one of several calls, of about the same length, for one answer."""
        return replace(self, progress=lambda share: self.progress((part + share) / parts))

    @property
    def options(self) -> dict[str, Any]:
        """The keyword arguments of solvers."""
        return {
            "cancel": self.cancel,
            "progress": self.progress,
            "memory_limit": self.memory_limit,
        }


@dataclass(frozen=True)
class Query(ABC, Generic[R]):
    """A request to a mesh: one subclass for each kind.

    Made by `ask`, which checks all that can be checked without the mesh. The points are checked
    against the mesh itself when they are resolved.
    """

    mesh_id: str
    request: R
    """Normalized: requests that mean the same are equal"""
    size: MeshSize = _UNKNOWN
    """The size of the mesh, for limits and costs; workers, which have the mesh, do not need it"""
    representation: Representation = _AS_JSON
    """The form of the answer"""

    kind: ClassVar[str]
    """The name of the kind for clients"""
    model: ClassVar[type[QueryBody]]
    """The model of its requests"""

    @classmethod
    def ask(
        cls, mesh_id: str, size: MeshSize, request: R, settings: Settings | None = None
    ) -> Self:
        """Return the query that ``request`` asks of a mesh of this ``size``.

        Raises
        ------
        ProblemError
            A member of the request is invalid, or exceeds a limit of the ``settings``, if any.
        """
        if isinstance(request, AmongBarriers):
            check_barriers(request.barriers, size)
            request = request.model_copy(update={"barriers": sorted(set(request.barriers))})
        query = cls(mesh_id, cls.normalized(request), size)
        if settings is not None:
            query.check_limits(settings)
        check_points(query.written_points(), size)
        return query

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to a worker as JSON.

        For 40 000 points that takes 5 ms here and 0.1 s there, where models, pickled one by one,
        took 0.2 and 0.5 s.
        """
        return _revived, (type(self), self.mesh_id, self.written, self.representation)

    def answered_as(self, representation: Representation) -> Self:
        """Return the same query, with its answer in a representation."""
        return replace(self, representation=representation)

    @cached_property
    def written(self) -> bytes:
        """The request as JSON; pydantic's own way takes ten times as long."""
        return orjson.dumps(self.request, default=vars)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """Keys of what a worker may have cached: a field, then the mesh."""
        return (self.mesh_id,)

    @property
    def barriers(self) -> NDArray[np.int64]:
        """The faces that are blocked, ascending."""
        request = self.request
        blocked = request.barriers if isinstance(request, AmongBarriers) else ()
        return np.array(blocked, np.int64)

    # What each kind defines

    @property
    def offers(self) -> Sequence[str]:
        """The media types of the answer."""
        return JSON, NPY, OCTETS

    @property
    def hint(self) -> str:
        """The remedy for an answer that is too large for JSON."""
        return "ask for application/x-npy, with `Accept` or with ?format=npy"

    @classmethod
    def normalized(cls, request: R) -> R:
        """Return the request in its one spelling, or refuse members that contradict each other."""
        return request

    def check_limits(self, settings: Settings) -> None:
        """Refuse a request that exceeds the limits of the service."""

    def check_format(self, media_type: str) -> None:
        """Refuse a request that one of the ``offers`` has no room for."""

    def value_count(self) -> int:
        """Return the number of values of the answer in JSON; 0 where only solving yields it."""
        return 0

    def rough_bytes(self) -> int:
        """Return the bytes of the answer, about, as far as they are known before."""
        return BYTES_OF_VALUE * self.value_count()

    def written_points(self) -> WrittenPoints:
        """Yield the points of the request, in the order that `solve` takes them."""
        return iter(())

    @abstractmethod
    def rough_seconds(self) -> float:
        """Return the expected seconds of `solve`, by the size of the mesh alone."""

    @abstractmethod
    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Compute the answer on an open mesh, for the resolved points."""

    # What all kinds share

    @property
    def is_small(self) -> bool:
        """Whether the answer takes less than `SMALL_SECONDS`, about."""
        blocked = PER_FACE_BLOCKED * self.size.faces if len(self.barriers) else 0.0
        return self.rough_seconds() + blocked < SMALL_SECONDS

    def check_answer(self, settings: Settings, *, as_job: bool) -> None:
        """Refuse a format that has no room for the answer, as far as that is known before."""
        if self.representation.media_type == JSON:
            check_json_size(self.value_count(), settings.max_json_values, self.hint)
        else:
            self.check_format(self.representation.media_type)

    def with_barriers(self, opened: OpenMesh) -> OpenMesh:
        """Return a mesh with the ``barriers``, or refuse those that leave nothing of it."""
        with naming((gc.errors.InvalidArgument, "/barriers")):
            return opened.with_barriers(self.barriers)

    def answer(self, opened: OpenMesh, context: ExecutionContext) -> Answer:
        """Compute the answer on an open mesh that has the ``barriers``.

        Raises
        ------
        ProblemError
            A point is not on the mesh, or the answer exceeds a limit of the context.
        GeodesicError
            The solver failed, or was stopped: ``Cancelled`` once ``context.cancel`` returns True.
        """
        points = self.resolved(opened.mesh, context.cancel)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gc.errors.GeodesicWarning)  # the answer has notes
            return self.solve(self.noted(opened, points), points, context)

    def members(self, opened: OpenMesh, **more: Any) -> dict[str, Any]:
        """Return the members of an answer: those that each has, and more between them."""
        names = {"kind": self.kind, "mesh_id": self.mesh_id}
        return {**names, **more, "warnings": opened.warnings}

    def noted(self, opened: OpenMesh, points: SurfacePoints) -> OpenMesh:
        """Return a mesh whose warnings also tell of the resolved points that are hardly meant."""
        notes = notes_on(opened.mesh, self.written_points(), points, name_of)
        return replace(opened, warnings=[*opened.warnings, *notes]) if notes else opened

    def resolved(self, mesh: gc.TriangleMesh, cancel: Callable[[], bool]) -> SurfacePoints:
        """Return the points of the request on the mesh; raises as `resolve_points`."""
        return resolve_points(self.written_points(), mesh, cancel)


def _revived(
    kind: type[Query[Any]], mesh_id: str, request: bytes, representation: Representation
) -> Query[Any]:
    read = kind.model.model_validate_json(request)
    return kind(mesh_id, read, representation=representation)


@cache
def code_version() -> str:
    """Return the version of the code that answers: release and digest of the kernels."""
    return f"{__version__}+{gc.kernel_digest()}"


def result_key(query: Query[Any]) -> str:
    """Return the name of the answer to a query.

    It is a hash, of the code that answers as well.
    """
    return _hash(query, code_version())


def fingerprint(query: Query[Any]) -> str:
    """Return the hash of a query and the form of its answer, the same in all releases."""
    return _hash(query)


def _hash(query: Query[Any], *more: str) -> str:
    names = [type(query).__name__, query.mesh_id, query.representation, *more]
    digest = hashlib.blake2b(orjson.dumps(names), digest_size=16)
    digest.update(query.written)
    return digest.hexdigest()
