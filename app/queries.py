"""From what a client wrote to a frozen, validated query with a stable hash."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, islice
from typing import Any, ClassVar, NamedTuple
from uuid import uuid4

import orjson

from app import __version__, point_text, schemas
from app.errors import Fault, ProblemError, over_limit, pointer, refuse
from app.settings import Settings
from geodesic_core.kernels.jit import sources_digest
from geodesic_core.tolerances import WEIGHT_ERROR

FAULTS_SHOWN = 10

# What the JSON of a point has: position, distance, and a face with three weights
_VALUES_OF_POINT = 8

Named = Iterator[tuple[str, schemas.Point | schemas.Source]]
"""Points, each with the place in the body that it was written at."""


class MeshSize(NamedTuple):
    """How many elements a mesh has."""

    vertices: int
    faces: int


@dataclass(frozen=True)
class Approximation:
    """By how much distances may fall short: in shares of them, in mesh units, or both."""

    relative_error: float | None
    absolute_error: float | None


_USUAL = Approximation(relative_error=1e-3, absolute_error=None)


@dataclass(frozen=True)
class DistancesQuery:
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    mesh_id: str
    sources: tuple[schemas.Source, ...]
    targets: tuple[schemas.Point, ...] | None
    max_distance: float | None
    nearest_source: bool
    approximation: Approximation | None = None  # exact without

    is_repeatable: ClassVar[bool] = True

    def points(self) -> Named:
        """Yield the sources, then the targets."""
        return chain(_numbered("sources", self.sources), _numbered("targets", self.targets or ()))


@dataclass(frozen=True)
class PathQuery:
    """The shortest path between two points, past ``waypoints`` in their order."""

    mesh_id: str
    source: schemas.Point
    target: schemas.Point
    approximation: Approximation | None = None
    waypoints: tuple[schemas.Point, ...] = ()
    explain: bool = False

    @property
    def is_repeatable(self) -> bool:
        """Whether the answer is the same in every run: one that tells seconds is not."""
        return not self.explain

    def points(self) -> Named:
        """Yield the source, the target, then the waypoints."""
        ends = ("/source", self.source), ("/target", self.target)
        return chain(ends, _numbered("waypoints", self.waypoints))


@dataclass(frozen=True)
class LocateQuery:
    """The points of the surface nearest to ``positions``, where they are near enough."""

    mesh_id: str
    positions: tuple[schemas.Triple, ...]
    max_distance: float | None

    is_repeatable: ClassVar[bool] = True


Query = DistancesQuery | PathQuery | LocateQuery


@cache
def code_version() -> str:
    """Return what tells answers of different code apart: release and kernel sources."""
    return f"{__version__}+{sources_digest()}"


def result_key(query: Query, media_type: str) -> str:
    """Return the hash that names the answer to ``query`` in ``media_type``.

    It is the same in any run, unless the answer is not: that of each run has a name of its own.
    """
    if not query.is_repeatable:
        return uuid4().hex
    parts = [type(query).__name__, query, media_type, code_version()]
    text = orjson.dumps(parts, default=vars)  # dataclasses it knows, models it has to be told
    return hashlib.blake2b(text, digest_size=16).hexdigest()


def distances_query(
    mesh_id: str, size: MeshSize, request: schemas.DistancesRequest, settings: Settings
) -> DistancesQuery:
    """Validate ``request`` against a mesh of this ``size``."""
    approximation = _approximation(request)
    if len(request.sources) > settings.max_sources:
        raise over_limit(
            "limit_exceeded", "sources", len(request.sources), settings.max_sources, "max_sources"
        )
    query = DistancesQuery(
        mesh_id,
        tuple(request.sources),
        None if request.targets is None else tuple(request.targets),
        request.max_distance,
        "nearest_source" in request.include,
        approximation,
    )
    _refuse_outside(query.points(), size)
    return query


def path_query(
    mesh_id: str,
    size: MeshSize,
    request: schemas.PathRequest,
    parameters: schemas.PathAnswerParameters,
    settings: Settings,
) -> PathQuery:
    """Validate ``request`` against a mesh of this ``size``."""
    approximation = _approximation(request)
    if approximation is not None:
        _refuse_for_approximate(
            {
                "/waypoints": request.waypoints,
                "/explain": request.explain,
                "/query/explain": parameters.explain,
            }
        )
    count, limit = len(request.waypoints), settings.max_waypoints
    if count > limit:
        raise over_limit("limit_exceeded", "waypoints", count, limit, "max_waypoints")
    query = PathQuery(
        mesh_id,
        request.source,
        request.target,
        approximation,
        tuple(request.waypoints),
        request.explain or parameters.explain,
    )
    _refuse_outside(query.points(), size)
    return query


def written_request(parameters: schemas.PathParameters) -> schemas.PathRequest:
    """Return the body of the ``POST`` that asks the same as the parameters of a ``GET``."""
    return schemas.PathRequest(
        source=_parsed("/source", parameters.source),
        target=_parsed("/target", parameters.target),
        waypoints=[_parsed(pointer("waypoints", i), text) for i, text in enumerate(parameters.via)],
        **parameters.model_dump(include=set(schemas.Accuracy.model_fields)),
    )


@contextmanager
def naming_parameters() -> Iterator[None]:
    """Have refusals name the parameters of a ``GET`` where they name members of its body."""
    try:
        yield
    except ProblemError as error:
        faults = [Fault(_in_query(fault.pointer), fault.message) for fault in error.problem.errors]
        if not faults:
            raise
        raise ProblemError(
            replace(error.problem, detail=_detail(faults), errors=tuple(faults))
        ) from None


def locate_query(mesh_id: str, request: schemas.LocateRequest) -> LocateQuery:
    """Return the query that ``request`` asks."""
    return LocateQuery(mesh_id, tuple(request.points), request.max_distance)


def value_count(query: Query, vertices: int) -> int:
    """Return how many values the answer will have; 0 for a path, which tells when it is found."""
    match query:
        case PathQuery():
            return 0
        case LocateQuery():
            return _VALUES_OF_POINT * len(query.positions)
    columns = 2 if query.nearest_source else 1
    if query.targets is None:
        return columns * vertices
    return (columns + _VALUES_OF_POINT) * len(query.targets)


def refuse_large_json(query: Query, values: int, settings: Settings) -> None:
    """Refuse a query whose answer has more ``values`` than JSON is good for."""
    if values <= settings.max_json_values:
        return
    hint = "ask for application/x-npy, with `Accept` or with ?format=npy"
    if isinstance(query, PathQuery) and query.explain:
        hint = "ask without explain, or past fewer waypoints at once"
    elif isinstance(query, LocateQuery):
        hint = "ask for fewer points at once"
    raise over_limit(
        "result_too_large",
        "values in JSON",
        values,
        settings.max_json_values,
        "max_json_values",
        hint=hint,
    )


def refuse_points(faults: Sequence[Fault]) -> ProblemError:
    """Return the exception for points that are not on the mesh."""
    return refuse("invalid_point", _detail(faults), errors=tuple(faults))


def _numbered(name: str, written: Sequence[schemas.Point | schemas.Source]) -> Named:
    return ((f"/{name}/{i}", point) for i, point in enumerate(written))


def _approximation(accuracy: schemas.Accuracy) -> Approximation | None:
    """Return the errors that are granted, if any."""
    errors = {
        "relative_error": accuracy.relative_error,
        "absolute_error": accuracy.absolute_error,
    }
    given = [name for name, value in errors.items() if value is not None]
    if accuracy.method == "approximate":
        return Approximation(**errors) if given else _USUAL
    if given:
        message = "goes with method 'approximate' only; exact answers have no error"
        raise _misplaced([pointer(name) for name in given], message)
    return None


def _refuse_for_approximate(asked: Mapping[str, Any]) -> None:
    """Refuse what approximate paths do not have; ``asked`` says by place whether it is wanted."""
    given = [place for place, wanted in asked.items() if wanted]
    if given:
        raise _misplaced(given, "goes with method 'exact' only")


def _misplaced(places: Sequence[str], message: str) -> ProblemError:
    faults = tuple(Fault(place, message) for place in places)
    return refuse("invalid_request", _detail(faults), errors=faults)


def _parsed(place: str, text: str) -> schemas.Point:
    try:
        return point_text.parse(text)
    except ValueError as error:
        raise refuse_points([Fault(place, str(error))]) from None


def _in_query(place: str) -> str:
    """Return the parameter of a ``GET`` that stands for a place in the body of a ``POST``."""
    _, name, *members = place.split("/")
    if name == "query":
        return place
    kept = members[:1] if name == "waypoints" else []  # the number of the waypoint
    return pointer("query", _PARAMETERS.get(name, name), *kept)


_PARAMETERS = {"source": "from", "target": "to", "waypoints": "via"}


def _refuse_outside(named: Named, size: MeshSize) -> None:
    """Refuse points that cannot be on a mesh of this size."""
    faults = tuple(islice((f for place, p in named for f in _faults(place, p, size)), FAULTS_SHOWN))
    if faults:
        raise refuse_points(faults)


def _faults(place: str, point: schemas.Point | schemas.Source, size: MeshSize) -> Iterator[Fault]:
    match point:
        case schemas.VertexPoint(vertex=vertex):
            yield from _outside(f"{place}/vertex", "vertex", vertex, size.vertices)
        case schemas.EdgePoint(edge=ends, t=t):
            for i, vertex in enumerate(ends):
                yield from _outside(f"{place}/edge/{i}", "vertex", vertex, size.vertices)
            if not -WEIGHT_ERROR <= t <= 1.0 + WEIGHT_ERROR:
                yield Fault(f"{place}/t", f"t is {t!r}; it must be a number from 0 to 1")
        case schemas.FacePoint(face=face):
            yield from _outside(f"{place}/face", "face", face, size.faces)


def _outside(place: str, kind: str, index: int, count: int) -> Iterator[Fault]:
    if not 0 <= index < count:
        yield Fault(place, f"{kind} {index} is not one of 0 to {count - 1}")


def _detail(faults: Sequence[Fault]) -> str:
    return f"{faults[0].pointer}: {faults[0].message}"
