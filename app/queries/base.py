"""What all queries share: a validated request to a mesh, with a stable hash."""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, ClassVar, Generic, Self, TypeVar
from uuid import uuid4

import numpy as np
import orjson
from numpy.typing import NDArray

import geodesic_core as gc
from app import __version__
from app.encoding import JSON, NPY, OCTETS, Answer, Representation
from app.queries.cost_model import PER_FACE_BLOCKED, Cost
from app.queries.field_cache import FieldCache
from app.queries.places import Places, resolved
from app.queries.validation import (
    MeshSize,
    Named,
    refuse_barriers_outside,
    refuse_large_json,
    refuse_outside,
    refuse_places,
)
from app.schemas.points import Point, StrictModel
from app.schemas.requests import AmongBarriers
from app.settings import Settings
from app.store.meshes import OpenMesh
from geodesic_core.kernels.jit import sources_digest

VALUES_OF_POINT = 8
"""What the JSON of a point has: position, distance, and a face with three weights."""

SMALL_SECONDS = 0.05

R = TypeVar("R", bound=StrictModel)


@dataclass(frozen=True)
class ExecutionContext:
    """What the answer to a query may take, and how it learns that it is to stop."""

    cancel: Callable[[], bool]
    progress: Callable[[float], None]
    fields: FieldCache
    memory_limit: int
    max_values: int
    """Most values of the answer, where it is written as JSON."""
    max_cells: int
    """Most cells of a matrix that tells its number only once it is there."""

    def part(self, part: int, parts: int) -> "ExecutionContext":
        """Return the grant of one of several calls, of about the same length, for one answer."""
        return replace(self, progress=lambda share: self.progress((part + share) / parts))

    @property
    def options(self) -> dict[str, Any]:
        """The same as the solvers have it."""
        return {
            "cancel": self.cancel,
            "progress": self.progress,
            "memory_limit": self.memory_limit,
        }


@dataclass(frozen=True)
class Likely:
    """What an answer is likely to cost."""

    cost: Cost
    answer: Answer
    """One of about the same size: mostly of straight distances in place of geodesic ones"""
    times: float = 1.0
    """How many times as large the real one will be"""


@dataclass(frozen=True)
class Query(ABC, Generic[R]):
    """A request to a mesh: one subclass for each kind.

    Made by `ask`, which checks all that can be checked without the mesh. The points are checked
    against the mesh itself when they are resolved.
    """

    mesh_id: str
    request: R
    """In the one spelling that stands for all that mean the same."""

    kind: ClassVar[str]
    """As clients call it"""
    model: ClassVar[type[StrictModel]]
    """Of the request"""

    @classmethod
    def ask(cls, mesh_id: str, size: MeshSize, request: R, settings: Settings) -> Self:
        """Return the query that ``request`` asks of a mesh of this ``size``, or refuse it."""
        if isinstance(request, AmongBarriers):
            refuse_barriers_outside(request.barriers, size)
            request = request.model_copy(update={"barriers": sorted(set(request.barriers))})
        query = cls(mesh_id, cls.normal(request))
        query.refuse(settings)
        refuse_outside(query.points(), size)
        return query

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to a worker as JSON.

        For 40 000 points that takes 5 ms here and 0.1 s there, where models, pickled one by one,
        took 0.2 and 0.5 s.
        """
        return _revived, (type(self), self.mesh_id, self.written)

    @cached_property
    def written(self) -> bytes:
        """The request as JSON; pydantic's own way takes ten times as long."""
        return orjson.dumps(self.request, default=vars)

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """What a worker that was asked before may have kept: a field, and the mesh."""
        return (self.mesh_id,)

    @property
    def barriers(self) -> NDArray[np.int64]:
        """The faces that are blocked, ascending."""
        request = self.request
        blocked = request.barriers if isinstance(request, AmongBarriers) else ()
        return np.array(blocked, np.int64)

    # What a kind says of itself

    @property
    def is_repeatable(self) -> bool:
        """Whether the answer is the same in every run."""
        return True

    @property
    def offers(self) -> Sequence[str]:
        """The media types that the answer comes in."""
        return JSON, NPY, OCTETS

    @property
    def hint(self) -> str:
        """What to do where the answer is too large for JSON."""
        return "ask for application/x-npy, with `Accept` or with ?format=npy"

    @classmethod
    def normal(cls, request: R) -> R:
        """Return the request in its one spelling, or refuse what does not go together."""
        return request

    def refuse(self, settings: Settings) -> None:
        """Refuse what exceeds the limits of the service."""

    def refuse_format(self, media_type: str) -> None:
        """Refuse what one of the ``offers`` does not hold."""

    def value_count(self, size: MeshSize) -> int:
        """Return how many values the answer will have in JSON; 0 where only it will tell."""
        return 0

    def points(self) -> Named:
        """Yield the points, in an order that ``solve`` knows."""
        return iter(())

    @abstractmethod
    def rough_seconds(self, size: MeshSize) -> float:
        """Return about how long ``solve`` takes, as far as the size of the mesh tells."""

    @abstractmethod
    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Answer on an open mesh, for these ``points``."""

    @abstractmethod
    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what ``solve`` is likely to cost, without solving."""

    # What all have

    def is_small(self, size: MeshSize) -> bool:
        """Tell whether the answer takes so little that nobody should have to wait for it."""
        blocked = PER_FACE_BLOCKED * size.faces if len(self.barriers) else 0.0
        return self.rough_seconds(size) + blocked < SMALL_SECONDS

    def refuse_answer(self, media_type: str, size: MeshSize, settings: Settings) -> None:
        """Refuse an answer that this media type is not good for, where that is known before."""
        if media_type == JSON:
            refuse_large_json(self.value_count(size), settings.max_json_values, self.hint)
        else:
            self.refuse_format(media_type)

    def among(self, opened: OpenMesh) -> OpenMesh:
        """Return a mesh with the ``barriers``, or refuse those that leave nothing of it."""
        try:
            return opened.with_barriers(self.barriers)
        except gc.errors.InvalidArgument as error:
            raise refuse_places(["/barriers"], str(error)) from None

    def answer(self, opened: OpenMesh, grant: ExecutionContext) -> Answer:
        """Answer on a mesh that is open `among` the barriers.

        Stops with ``Cancelled`` once the grant says so.
        """
        return self.solve(opened, resolved(self.points(), opened.mesh, grant.cancel), grant)


def _revived(kind: type[Query[Any]], mesh_id: str, request: bytes) -> Query[Any]:
    return kind(mesh_id, kind.model.model_validate_json(request))


@cache
def code_version() -> str:
    """Return what tells answers of different code apart: release and kernel sources."""
    return f"{__version__}+{sources_digest()}"


def result_key(query: Query[Any], form: Representation) -> str:
    """Return the hash that names the answer to ``query`` in a form.

    It is the same in any run, unless the answer is not: that of each run has a name of its own.
    """
    return fingerprint(query, form) if query.is_repeatable else uuid4().hex


def fingerprint(query: Query[Any], form: Representation) -> str:
    """Return the hash that stands for ``query`` in a form, answered by this code."""
    names = [type(query).__name__, query.mesh_id, form, code_version()]
    digest = hashlib.blake2b(orjson.dumps(names), digest_size=16)
    digest.update(query.written)
    return digest.hexdigest()


def numbered(where: str, written: Sequence[Point]) -> Iterator[tuple[str, Point]]:
    """Yield the points of a list, each with its place."""
    return ((f"{where}/{i}", point) for i, point in enumerate(written))
