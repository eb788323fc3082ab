"""What a query is likely to take, told without running it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from app.encoding import Representation, encode
from app.queries.base import Query
from app.queries.cost_model import PER_FACE_BLOCKED
from app.queries.places import resolved
from app.store.meshes import OpenMesh


@dataclass(frozen=True)
class Estimate:
    """What an answer is likely to take, in no more digits than there is sense in."""

    seconds: float
    memory_bytes: int
    response_bytes: int


def estimate(
    query: Query[Any], form: Representation, opened: OpenMesh, cancel: Callable[[], bool]
) -> Estimate:
    """Return what the answer to ``query`` would take, or refuse its points as the answer would."""
    places = resolved(query.points(), opened.mesh, cancel)
    likely = query.likely(opened, places)
    parts = encode(likely.answer, replace(form, coding=None)).parts
    size = likely.times * sum(map(len, parts))
    cost = likely.cost
    seconds = cost.seconds
    if len(query.barriers):
        seconds += PER_FACE_BLOCKED * len(opened.mesh.faces)
    return Estimate(_rounded(seconds), round(_rounded(cost.memory_bytes)), round(size))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
