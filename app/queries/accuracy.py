"""Exact, approximate or fast: what queries ask for, and the bounds that answers state."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import orjson

import geodesic_core as gc
from app.errors import pointer
from app.queries.base import ExecutionContext, Query
from app.queries.validation import invalid_fields
from app.schemas.points import PointOrCurve, Source, StrictModel
from app.schemas.requests import Accuracy, Method
from app.store.meshes import OpenMesh

A = TypeVar("A", bound=Accuracy)

_OPTIONS: Mapping[Method, Mapping[str, float | None]] = {
    "approximate": {"relative_error": 1e-3, "absolute_error": None},
    "fast": {"effort": 2},
}
"""Members that go with one method only, and what they are where the request names none of them."""
_OPTION_NAMES = tuple(name for options in _OPTIONS.values() for name in options)

CERTAIN: Mapping[str, Any] = {"type": "relative", "value": 0.0, "kind": "guaranteed"}
"""The bound of answers without error."""


def with_default_accuracy(request: A) -> A:
    """Return a request that names its error or its effort, or refuse those of another method."""
    given = _options_of(request)
    for method, defaults in _OPTIONS.items():
        names = [name for name in defaults if name in given]
        if names and method != request.method:
            raise invalid_fields(list(map(pointer, names)), f"goes with method '{method}' only")
    return request if given else request.model_copy(update=_OPTIONS.get(request.method))


def _options_of(request: StrictModel) -> dict[str, Any]:
    """Return the members that are given of those that go with one method."""
    given = {name: getattr(request, name, None) for name in _OPTION_NAMES}
    return {name: value for name, value in given.items() if value is not None}


def options_of(request: Accuracy) -> dict[str, Any]:
    """Return the method, and what goes with it, as arguments of the library."""
    errors = {"relative_error": None} if request.method == "approximate" else {}
    return {"method": request.method, **errors, **_options_of(request)}


def as_swept(request: A, mesh: gc.TriangleMesh) -> A:
    """Return the request by the sweep that answers it: an exact one where no other is quicker."""
    if gc.error_bound(mesh, **options_of(request)).value > 0.0:
        return request
    return request.model_copy(update={"method": "exact"} | dict.fromkeys(_options_of(request)))


def solve_field(
    opened: OpenMesh,
    request: Accuracy,
    sources: Sequence[gc.Source],
    context: ExecutionContext,
    *,
    max_distance: float | None = None,
    targets: Sequence[gc.SurfacePoint] = (),
    isolines: bool = False,
) -> gc.DistanceField:
    """Return the field of distances from some sources, as exact as requested; maybe a cached one.

    It retains what paths need. For ``isolines`` approximate fields retain all windows. Exact fields
    sweep again: they have so many windows that it takes less time and memory to find only those
    that the levels need.
    """
    request = as_swept(request, opened.mesh)
    solver, given = opened.solver, _options_of(request)
    # Vertices are reached in any case.
    off_vertices = tuple(target for target in targets if target.vertex_index is None)
    options = {"max_distance": max_distance, "targets": off_vertices, **context.options}

    def solve() -> gc.DistanceField:
        if request.method == "exact":
            return solver.exact_distance(sources, **options)
        if request.method == "fast":
            return solver.fast_distance(sources, given["effort"], **options)
        errors = given.get("relative_error"), given.get("absolute_error")
        retain: gc.Retain = "windows" if isolines else "paths"
        return solver.approximate_distance(sources, *errors, retain=retain, **options)

    if context.fields is None:
        return solve()
    windows = isolines and request.method != "exact"
    accuracy = request.method, *sorted(given.items())
    question = tuple(sources), max_distance, off_vertices, accuracy, windows
    return context.fields.find(opened, question, solve)


def affinity_keys_of(
    query: Query[Any], sources: Sequence[Source | PointOrCurve]
) -> tuple[str, ...]:
    """Return the affinity keys of a query that needs the field of some sources."""
    request = query.request
    rest = {"method": "exact"} | request.model_dump(include={"method", "max_distance", "barriers"})
    rest |= _options_of(request)
    written = orjson.dumps([query.mesh_id, rest, *sources], _as_source, orjson.OPT_SORT_KEYS)
    return hashlib.blake2b(written, digest_size=8).hexdigest(), query.mesh_id


def _as_source(point: StrictModel) -> dict[str, Any]:
    # Some queries have sources without start distances; as JSON they are to look the same.
    return {"start_distance": 0.0, **vars(point)}


# Members of answers


def bound_of(bound: gc.ErrorBound) -> Mapping[str, Any]:
    """Return the members of an error bound."""
    return {"type": bound.type, "value": bound.value, "kind": bound.kind}


def bound_on(mesh: gc.TriangleMesh, request: Accuracy) -> Mapping[str, Any]:
    """Return the members of the error bound that distances on a mesh will have."""
    return bound_of(gc.error_bound(mesh, **options_of(request)))


def stats_of(stats: gc.SweepStats | None) -> Mapping[str, Any]:
    """Return the statistics that are the same in every run; seconds are in `Server-Timing`."""
    if stats is None:
        return {}
    return {name: value for name, value in stats.as_dict().items() if name != "seconds"}
