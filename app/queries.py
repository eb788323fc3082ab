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
class DistancesQuery:
    """Distances from ``sources`` to all vertices, or to ``targets`` only."""

    mesh_id: str
    sources: tuple[Source, ...]
    targets: tuple[int, ...] | None
    max_distance: float | None
    nearest_source: bool


@dataclass(frozen=True)
class PathQuery:
    """The shortest path between two vertices."""

    mesh_id: str
    source: int
    target: int


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
    _refuse_approximate(request.method)
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
    )


def path_query(
    mesh_id: str,
    vertices: int,
    request: schemas.PathRequest,
    places: tuple[str, str] = ("/source/vertex", "/target/vertex"),
) -> PathQuery:
    """Validate ``request`` against a mesh of so many ``vertices``; ``places`` name its ends."""
    _refuse_approximate(request.method)
    ends = (request.source.vertex, request.target.vertex)
    _refuse_outside(vertices, zip(places, ends, strict=True))
    return PathQuery(mesh_id, *ends)


def written_path_query(
    mesh_id: str, vertices: int, parameters: schemas.PathParameters
) -> PathQuery:
    """Validate the parameters of a ``GET``, which ask the same as the body of a ``POST``."""
    places = ("/query/from", "/query/to")
    request = schemas.PathRequest(
        source=_written_point(places[0], parameters.source),
        target=_written_point(places[1], parameters.target),
    )
    return path_query(mesh_id, vertices, request, places)


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


def _refuse_approximate(method: str) -> None:
    if method == "approximate":
        fault = Fault("/method", "only 'exact' is available yet")
        raise refuse(
            "invalid_request", "the approximate method is not available yet", errors=(fault,)
        )


def _written_point(place: str, text: str) -> schemas.Point:
    written = _WRITTEN_VERTEX.fullmatch(text)
    if written is None:
        message = f"{text!r} is not a vertex written as v and its index, such as v0"
        raise refuse("invalid_point", message, errors=(Fault(place, message),))
    return schemas.Point(vertex=int(written[1]))


def _refuse_outside(vertices: int, points: Iterable[tuple[str, int]]) -> None:
    outside = ((place, vertex) for place, vertex in points if not 0 <= vertex < vertices)
    faults = tuple(
        Fault(place, f"vertex {vertex} is not one of 0 to {vertices - 1}")
        for place, vertex in islice(outside, _FAULTS_SHOWN)
    )
    if faults:
        detail = f"{faults[0].pointer}: {faults[0].message}"
        raise refuse("invalid_point", detail, errors=faults)
