"""Checks of a query that need no open mesh: its points, its barriers, and the service's limits."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

import geodesic_core as gc
from app.errors import Fault, ProblemError, over_limit, problem, problem_of
from app.schemas.points import BareVertex, EdgePoint, FacePoint, Point, VertexPoint
from app.schemas.requests import QueryBody
from app.settings import Settings

FAULTS_SHOWN = 10

WrittenPoints = Iterator[tuple[str, Point]]
"""Points as a client wrote them, each with its JSON pointer into the body."""


class MeshSize(NamedTuple):
    """The number of elements of a mesh, and the mean length of its edges in mesh units."""

    vertices: int
    faces: int
    edge: float


def invalid_fields(pointers: Sequence[str], message: str) -> ProblemError:
    """Return the exception for members of a request that must not be as they are."""
    return _invalid_request([Fault(pointer, message) for pointer in pointers])


def invalid_points(faults: Sequence[Fault]) -> ProblemError:
    """Return the exception for points that are not on the mesh."""
    return problem("invalid_point", detail_of(faults), errors=tuple(faults))


@contextmanager
def naming(*members: tuple[type[gc.errors.GeodesicError], str]) -> Iterator[None]:
    """Name the member of the request that an error of the library is about, by kind of error.

    The first kind that matches counts. An ``{index}`` in a pointer is that of the error.
    """
    try:
        yield
    except gc.errors.GeodesicError as error:
        for kind, pointer in members:
            if isinstance(error, kind):
                fault = Fault(pointer.format(index=getattr(error, "index", 0)), str(error))
                raise ProblemError(
                    replace(problem_of(error), detail=detail_of([fault]), errors=(fault,))
                ) from None
        raise


def check_count(
    what: str, count: int, settings: Settings, setting: str, hint: str | None = None
) -> None:
    """Refuse a ``count`` of something that is above a setting."""
    limit = getattr(settings, setting)
    if count > limit:
        raise over_limit("limit_exceeded", what, count, limit, setting, hint=hint)


def check_lengths(body: Any, model: type[QueryBody], settings: Settings) -> None:
    """Refuse a body with a list of too many elements, before any of them is looked at."""
    if isinstance(body, dict):
        for name, setting in model.bounded_lists.items():
            if isinstance(elements := body.get(name), list):
                check_count(name, len(elements), settings, setting)


def check_json_size(values: int, limit: int, hint: str) -> None:
    """Refuse an answer of more ``values`` than JSON is good for."""
    if values > limit:
        raise over_limit(
            "result_too_large", "values in JSON", values, limit, "max_json_values", hint=hint
        )


def check_points(written: WrittenPoints, size: MeshSize) -> None:
    """Refuse points that cannot be on a mesh of this size."""
    found = (fault for pointer, point in written for fault in _faults(pointer, point, size))
    faults = tuple(islice(found, FAULTS_SHOWN))
    if faults:
        raise invalid_points(faults)


def check_barriers(barriers: Sequence[int], size: MeshSize) -> None:
    """Refuse barriers that are not faces of a mesh of this size."""
    found = (
        fault
        for i, face in enumerate(barriers)
        for fault in _out_of_range(f"/barriers/{i}", "face", face, size.faces)
    )
    faults = tuple(islice(found, FAULTS_SHOWN))
    if faults:
        raise _invalid_request(faults)


def detail_of(faults: Sequence[Fault]) -> str:
    """Return the message for some faults: the first."""
    return f"{faults[0].pointer}: {faults[0].message}"


def _invalid_request(faults: Sequence[Fault]) -> ProblemError:
    return problem("invalid_request", detail_of(faults), errors=tuple(faults))


def _faults(pointer: str, point: Point, size: MeshSize) -> Iterator[Fault]:
    match point:
        case BareVertex(vertex=vertex):
            yield from _out_of_range(pointer, "vertex", vertex, size.vertices)
        case VertexPoint(vertex=vertex):
            yield from _out_of_range(f"{pointer}/vertex", "vertex", vertex, size.vertices)
        case EdgePoint(edge=ends, t=t):
            for i, vertex in enumerate(ends):
                yield from _out_of_range(f"{pointer}/edge/{i}", "vertex", vertex, size.vertices)
            if not -gc.WEIGHT_ERROR <= t <= 1.0 + gc.WEIGHT_ERROR:
                yield Fault(f"{pointer}/t", f"t is {t!r}; it must be a number from 0 to 1")
        case FacePoint(face=face):
            yield from _out_of_range(f"{pointer}/face", "face", face, size.faces)


def _out_of_range(pointer: str, kind: str, index: int, count: int) -> Iterator[Fault]:
    if not 0 <= index < count:
        yield Fault(pointer, f"{kind} {index} does not exist; the indices are 0 to {count - 1}")
