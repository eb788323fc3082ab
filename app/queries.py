"""From what a client wrote to a frozen, validated query with a stable hash."""

import hashlib
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from itertools import islice

import orjson

from app import __version__, schemas
from app.errors import Fault, over_limit, pointer, refuse
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


@dataclass(frozen=True)
class PathQuery:
    """The shortest path between two vertices."""

    mesh_id: str
    source: int
    target: int
    approximation: Approximation | None = None


Query = DistancesQuery | PathQuery


@cache
def code_version() -> str:
    """Return what tells answers of different code apart: release and kernel sources."""
    return f"{__version__}+{sources_digest()}"


def result_key(query: Query, media_type: str) -> str:
    """Return the hash that names the answer to ``query`` in ``media_type``, the same in any run."""
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


def path_query(mesh_id: str, vertices: int, request: schemas.PathRequest) -> PathQuery:
    """Validate ``request`` against a mesh of so many ``vertices``."""
    approximation = _approximation(request)
    source, target = request.source.vertex, request.target.vertex
    _refuse_outside(vertices, (("/source/vertex", source), ("/target/vertex", target)))
    return PathQuery(mesh_id, source, target, approximation)


def written_path_query(
    mesh_id: str, vertices: int, parameters: schemas.PathParameters
) -> PathQuery:
    """Validate the parameters of a ``GET``, which ask the same as the body of a ``POST``."""
    approximation = _approximation(parameters, "/query")
    source = _written_vertex("/query/from", parameters.source)
    target = _written_vertex("/query/to", parameters.target)
    _refuse_outside(vertices, (("/query/from", source), ("/query/to", target)))
    return PathQuery(mesh_id, source, target, approximation)


def refuse_large_json(query: Query, vertices: int, settings: Settings) -> None:
    """Refuse a query whose answer has more values than JSON is good for."""
    if isinstance(query, PathQuery):
        return
    per_point = 2 if query.nearest_source else 1
    values = per_point * (vertices if query.targets is None else len(query.targets))
    if values > settings.max_json_values:
        raise over_limit(
            "result_too_large",
            "values in JSON",
            values,
            settings.max_json_values,
            "max_json_values",
            hint="ask for application/x-npy, with `Accept` or with ?format=npy",
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
        faults = tuple(Fault(root + pointer(name), message) for name in given)
        detail = f"{faults[0].pointer}: {message}"
        raise refuse("invalid_request", detail, errors=faults)
    return None


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
