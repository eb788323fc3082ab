"""What queries are refused for: places at fault, and limits."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from app.errors import Fault, ProblemError, over_limit, problem
from app.schemas.points import EdgePoint, FacePoint, Point, VertexPoint
from app.settings import Settings
from geodesic_core.tolerances import WEIGHT_ERROR

FAULTS_SHOWN = 10

Named = Iterator[tuple[str, Point]]
"""Points, each with the place in the body that it was written at."""


class MeshSize(NamedTuple):
    """How many elements a mesh has, and how long its edges are on average, mesh units."""

    vertices: int
    faces: int
    edge: float


def refuse_places(places: Sequence[str], message: str) -> ProblemError:
    """Return the exception for what should not be at some places of a request."""
    faults = tuple(Fault(place, message) for place in places)
    return problem("invalid_request", detail_of(faults), errors=faults)


def refuse_points(faults: Sequence[Fault]) -> ProblemError:
    """Return the exception for points that are not on the mesh."""
    return problem("invalid_point", detail_of(faults), errors=tuple(faults))


def refuse_more(what: str, count: int, settings: Settings, setting: str) -> None:
    """Refuse a ``count`` of something that is above a setting."""
    limit = getattr(settings, setting)
    if count > limit:
        raise over_limit("limit_exceeded", what, count, limit, setting)


def refuse_large_json(values: int, limit: int, hint: str) -> None:
    """Refuse an answer of more ``values`` than JSON is good for."""
    if values > limit:
        raise over_limit(
            "result_too_large", "values in JSON", values, limit, "max_json_values", hint=hint
        )


def refuse_outside(named: Named, size: MeshSize) -> None:
    """Refuse points that cannot be on a mesh of this size."""
    faults = tuple(islice((f for place, p in named for f in _faults(place, p, size)), FAULTS_SHOWN))
    if faults:
        raise refuse_points(faults)


def refuse_barriers_outside(barriers: Sequence[int], size: MeshSize) -> None:
    """Refuse barriers that are no faces of a mesh of this size."""
    found = (
        fault
        for i, face in enumerate(barriers)
        for fault in _outside(f"/barriers/{i}", "face", face, size.faces)
    )
    faults = tuple(islice(found, FAULTS_SHOWN))
    if faults:
        raise problem("invalid_request", detail_of(faults), errors=faults)


def detail_of(faults: Sequence[Fault]) -> str:
    """Return the message for some faults: the first."""
    return f"{faults[0].pointer}: {faults[0].message}"


def _faults(place: str, point: Point, size: MeshSize) -> Iterator[Fault]:
    match point:
        case VertexPoint(vertex=vertex):
            yield from _outside(f"{place}/vertex", "vertex", vertex, size.vertices)
        case EdgePoint(edge=ends, t=t):
            for i, vertex in enumerate(ends):
                yield from _outside(f"{place}/edge/{i}", "vertex", vertex, size.vertices)
            if not -WEIGHT_ERROR <= t <= 1.0 + WEIGHT_ERROR:
                yield Fault(f"{place}/t", f"t is {t!r}; it must be a number from 0 to 1")
        case FacePoint(face=face):
            yield from _outside(f"{place}/face", "face", face, size.faces)


def _outside(place: str, kind: str, index: int, count: int) -> Iterator[Fault]:
    if not 0 <= index < count:
        yield Fault(place, f"{kind} {index} is not one of 0 to {count - 1}")
