"""Estimates: the time, memory and size of an answer, without computing it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from app.encoding import Representation, encode
from app.queries.base import Query
from app.queries.cost_model import PER_FACE_BLOCKED
from app.store.meshes import OpenMesh


@dataclass(frozen=True)
class Estimate:
    """The expected cost of an answer, rounded to the digits that make sense."""

    seconds: float
    memory_bytes: int
    response_bytes: int


def estimate(
    query: Query[Any], representation: Representation, opened: OpenMesh, cancel: Callable[[], bool]
) -> Estimate:
    """Return the expected cost of the answer to ``query``.

    Raises
    ------
    ProblemError
        The query cannot be answered: a point is not on the mesh, for example.
    Cancelled
        ``cancel`` returned True.
    """
    points = query.resolved(opened.mesh, cancel)
    forecast = query.forecast(query.noted(opened, points), points)
    parts = encode(forecast.answer, replace(representation, coding=None)).parts
    size = forecast.times * sum(map(len, parts))
    cost = forecast.cost
    seconds = cost.seconds
    if len(query.barriers):
        seconds += PER_FACE_BLOCKED * len(opened.mesh.faces)
    return Estimate(_rounded(seconds), round(_rounded(cost.memory_bytes)), round(size))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
