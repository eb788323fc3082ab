"""From what a client wrote to a frozen, validated query with a stable hash."""

import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import islice
from typing import Any, ClassVar
from uuid import uuid4

import orjson

from app import __version__, schemas
from app.errors import Fault, ProblemError, over_limit, pointer, refuse
from app.settings import Settings
from geodesic_core.kernels.jit import sources_digest

_WRITTEN_VERTEX = re.compile(r"v(-?[0-9]{1,18})")
_FAULTS_SHOWN = 10


@dataclass(frozen=True)
class Source:
    """A vertex and the distance that it starts from."""

    vertex: int
    start_distance: float


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
    sources: tuple[Source, ...]
    targets: tuple[int, ...] | None
    max_distance: float | None
    nearest_source: bool
    approximation: Approximation | None = None  # exact without

    is_repeatable: ClassVar[bool] = True


@dataclass(frozen=True)
class PathQuery:
    """The shortest path between two vertices, past ``waypoints`` in their order."""

    mesh_id: str
    source: int
    target: int
    approximation: Approximation | None = None
    waypoints: tuple[int, ...] = ()
    explain: bool = False

    @property
    def is_repeatable(self) -> bool:
        """Whether the answer is the same in every run: one that tells seconds is not."""
        return not self.explain


Query = DistancesQuery | PathQuery


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
    parts = [type(query).__name__, asdict(query), media_type, code_version()]
    text = orjson.dumps(parts, option=orjson.OPT_SORT_KEYS)
    return hashlib.blake2b(text, digest_size=16).hexdigest()


def distances_query(
    mesh_id: str, vertices: int, request: schemas.DistancesRequest, settings: Settings
) -> DistancesQuery:
    """Validate ``request`` against a mesh of so many ``vertices``."""
    approximation = _approximation(request)
    if len(request.sources) > settings.max_sources:
        raise over_limit(
            "limit_exceeded", "sources", len(request.sources), settings.max_sources, "max_sources"
        )
    named = {"sources": request.sources, "targets": request.targets or ()}
    _refuse_outside(
        vertices,
        (
            (pointer(name, i, "vertex"), point.vertex)
            for name, points in named.items()
            for i, point in enumerate(points)
        ),
    )
    return DistancesQuery(
        mesh_id,
        tuple(Source(point.vertex, point.start_distance) for point in request.sources),
        None if request.targets is None else tuple(point.vertex for point in request.targets),
        request.max_distance,
        "nearest_source" in request.include,
        approximation,
    )


def path_query(
    mesh_id: str,
    vertices: int,
    request: schemas.PathRequest,
    parameters: schemas.PathAnswerParameters,
    settings: Settings,
) -> PathQuery:
    """Validate ``request`` against a mesh of so many ``vertices``."""
    approximation = _approximation(request)
    if approximation is not None:
        _refuse_for_approximate(
            {
                "/waypoints": request.waypoints,
                "/explain": request.explain,
                "/query/explain": parameters.explain,
            }
        )
    _refuse_many_waypoints(len(request.waypoints), settings)
    source, target = request.source.vertex, request.target.vertex
    waypoints = tuple(point.vertex for point in request.waypoints)
    named = {"/source/vertex": source, "/target/vertex": target}
    named |= {pointer("waypoints", i, "vertex"): vertex for i, vertex in enumerate(waypoints)}
    _refuse_outside(vertices, named.items())
    explain = request.explain or parameters.explain
    return PathQuery(mesh_id, source, target, approximation, waypoints, explain)


def written_path_query(
    mesh_id: str, vertices: int, parameters: schemas.PathParameters, settings: Settings
) -> PathQuery:
    """Validate the parameters of a ``GET``, which ask the same as the body of a ``POST``."""
    approximation = _approximation(parameters, "/query")
    if approximation is not None:
        _refuse_for_approximate(
            {"/query/via": parameters.via, "/query/explain": parameters.explain}
        )
    _refuse_many_waypoints(len(parameters.via), settings)
    written = {"/query/from": parameters.source, "/query/to": parameters.target}
    written |= {pointer("query", "via", i): text for i, text in enumerate(parameters.via)}
    named = {place: _written_vertex(place, text) for place, text in written.items()}
    _refuse_outside(vertices, named.items())
    source, target, *waypoints = named.values()
    return PathQuery(mesh_id, source, target, approximation, tuple(waypoints), parameters.explain)


def value_count(query: Query, vertices: int) -> int:
    """Return how many values the answer will have; 0 for a path, which tells when it is found."""
    if isinstance(query, PathQuery):
        return 0
    per_point = 2 if query.nearest_source else 1
    return per_point * (vertices if query.targets is None else len(query.targets))


def refuse_large_json(query: Query, values: int, settings: Settings) -> None:
    """Refuse a query whose answer has more ``values`` than JSON is good for."""
    if values <= settings.max_json_values:
        return
    hint = "ask for application/x-npy, with `Accept` or with ?format=npy"
    if isinstance(query, PathQuery) and query.explain:
        hint = "ask without explain, or past fewer waypoints at once"
    raise over_limit(
        "result_too_large",
        "values in JSON",
        values,
        settings.max_json_values,
        "max_json_values",
        hint=hint,
    )


def _approximation(accuracy: schemas.Accuracy, root: str = "") -> Approximation | None:
    """Return the errors that are granted, if any; ``root`` is where the request has its fields."""
    errors = {
        "relative_error": accuracy.relative_error,
        "absolute_error": accuracy.absolute_error,
    }
    given = [name for name, value in errors.items() if value is not None]
    if accuracy.method == "approximate":
        return Approximation(**errors) if given else _USUAL
    if given:
        message = "goes with method 'approximate' only; exact answers have no error"
        raise _misplaced([root + pointer(name) for name in given], message)
    return None


def _refuse_for_approximate(asked: Mapping[str, Any]) -> None:
    """Refuse what approximate paths do not have; ``asked`` says by place whether it is wanted."""
    given = [place for place, wanted in asked.items() if wanted]
    if given:
        raise _misplaced(given, "goes with method 'exact' only")


def _misplaced(places: Sequence[str], message: str) -> ProblemError:
    faults = tuple(Fault(place, message) for place in places)
    return refuse("invalid_request", f"{places[0]}: {message}", errors=faults)


def _refuse_many_waypoints(count: int, settings: Settings) -> None:
    limit = settings.max_waypoints
    if count > limit:
        raise over_limit("limit_exceeded", "waypoints", count, limit, "max_waypoints")


def _written_vertex(place: str, text: str) -> int:
    written = _WRITTEN_VERTEX.fullmatch(text)
    if written is None:
        message = f"{text!r} is not a vertex written as v and its index, such as v0"
        raise refuse("invalid_point", message, errors=(Fault(place, message),))
    return int(written[1])


def _refuse_outside(vertices: int, points: Iterable[tuple[str, int]]) -> None:
    outside = ((place, vertex) for place, vertex in points if not 0 <= vertex < vertices)
    faults = tuple(
        Fault(place, f"vertex {vertex} is not one of 0 to {vertices - 1}")
        for place, vertex in islice(outside, _FAULTS_SHOWN)
    )
    if faults:
        detail = f"{faults[0].pointer}: {faults[0].message}"
        raise refuse("invalid_point", detail, errors=faults)
