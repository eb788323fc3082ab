"""Exact or approximate: what queries grant, and what their answers promise."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import orjson

import geodesic_core as gc
from app.errors import pointer
from app.queries.base import ExecutionContext, Query
from app.queries.validation import refuse_places
from app.schemas.points import Origin, Source, StrictModel
from app.schemas.requests import Accuracy
from app.store.meshes import OpenMesh

A = TypeVar("A", bound=Accuracy)

_ERRORS = ("relative_error", "absolute_error")

_USUAL_ERROR = 1e-3
"""The relative error of approximate answers where none is named."""

CERTAIN: Mapping[str, Any] = {"type": "relative", "value": 0.0, "kind": "guaranteed"}
"""The bound of what is known without error, by any method: exact answers, and that there is none"""


def with_its_error(request: A) -> A:
    """Return a request with the error that it grants, or refuse an error that has no sense."""
    given = [name for name, error in errors_of(request).items() if error is not None]
    if request.method == "approximate":
        return request if given else request.model_copy(update={"relative_error": _USUAL_ERROR})
    if given:
        message = "goes with method 'approximate' only; exact answers have no error"
        raise refuse_places([pointer(name) for name in given], message)
    return request


def errors_of(request: Accuracy) -> dict[str, float | None]:
    """Return the errors that are granted."""
    return {name: getattr(request, name) for name in _ERRORS}


def solve_field(
    opened: OpenMesh,
    request: Accuracy,
    sources: Sequence[gc.Source],
    grant: ExecutionContext,
    *,
    max_distance: float | None = None,
    targets: Sequence[gc.SurfacePoint] = (),
    isolines: bool = False,
) -> gc.DistanceField:
    """Return the field of distances from some sources, as exact as it has to be; maybe a kept one.

    It keeps what paths need. For ``isolines`` approximate ones keep all windows. Exact ones sweep
    again for them: their windows are so many that it takes less time and memory to find those that
    the levels need.
    """
    solver, errors = opened.solver, errors_of(request)
    # Vertices are reached in any case.
    beside = tuple(target for target in targets if target.vertex_index is None)
    options = {"max_distance": max_distance, "targets": beside, **grant.options}

    def solve() -> gc.DistanceField:
        if request.method == "exact":
            return solver.exact_distance(sources, **options)
        retain: gc.Retain = "windows" if isolines else "paths"
        return solver.approximate_distance(
            sources, request.relative_error, request.absolute_error, retain=retain, **options
        )

    more = isolines and request.method != "exact"
    question = tuple(sources), max_distance, beside, request.method, *errors.values(), more
    return grant.fields.find(opened, question, solve)


def topics_of(query: Query[Any], sources: Sequence[Source | Origin]) -> tuple[str, ...]:
    """Return what is known of the field that a query needs before its mesh is open."""
    request = query.request
    rest = request.model_dump(include={"method", "max_distance", "barriers", *_ERRORS})
    written = orjson.dumps([query.mesh_id, rest, *sources], _as_source, orjson.OPT_SORT_KEYS)
    return hashlib.blake2b(written, digest_size=8).hexdigest(), query.mesh_id


def _as_source(point: StrictModel) -> dict[str, Any]:
    # Some queries have sources without start distances; as JSON they are to look the same.
    return {"start_distance": 0.0, **vars(point)}


def method_of(request: Accuracy) -> dict[str, Any]:
    """Return what answers say of their method."""
    return {"method": request.method, "exact": request.method == "exact"}


def likely_bound(request: Accuracy) -> Mapping[str, Any]:
    """Return about the same as `bound_of` for a field that is not there yet."""
    return {"type": "relative", "value": request.relative_error or 0.0, "kind": "guaranteed"}


def bound_of(bound: gc.ErrorBound) -> Mapping[str, Any]:
    """Return what answers say of their error."""
    return {"type": bound.type, "value": bound.value, "kind": bound.kind}
