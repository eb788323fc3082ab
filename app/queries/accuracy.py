"""Exact or approximate: what queries grant, and what their answers promise."""

from collections.abc import Mapping
from typing import Any, TypeVar

import geodesic_core as gc
from app import schemas
from app.errors import pointer
from app.queries.refusals import refuse_places

A = TypeVar("A", bound=schemas.Accuracy)

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


def errors_of(request: schemas.Accuracy) -> dict[str, float | None]:
    """Return the errors that are granted."""
    return {"relative_error": request.relative_error, "absolute_error": request.absolute_error}


def solve_field(
    solver: gc.Solver,
    request: schemas.Accuracy,
    sources: Any,
    *,
    paths: bool = False,
    isolines: bool = False,
    **options: Any,
) -> gc.DistanceField:
    """Return the field of distances from some sources, as exact as it has to be.

    Approximate ones keep what ``paths`` or ``isolines`` need. Exact ones keep the first anyway, and
    sweep again for the second: their windows are so many that it takes less time and memory to find
    those that the levels need.
    """
    if request.method == "exact":
        return solver.exact_distance(sources, **options)
    keep = {"keep_windows": paths, "keep_isolines": isolines}
    return solver.approximate_distance(sources, **errors_of(request), **keep, **options)


def method_of(request: schemas.Accuracy) -> dict[str, Any]:
    """Return what answers say of their method."""
    return {"method": request.method, "exact": request.method == "exact"}


def likely_bound(request: schemas.Accuracy) -> Mapping[str, Any]:
    """Return about the same as `bound_of` for a field that is not there yet."""
    return {"type": "relative", "value": request.relative_error or 0.0, "kind": "guaranteed"}


def bound_of(bound: gc.ErrorBound) -> Mapping[str, Any]:
    """Return what answers say of their error."""
    return {"type": bound.type, "value": bound.value, "kind": bound.kind}
