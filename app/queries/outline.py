"""The members of a path in answers, or the reason why there is none."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.queries.accuracy import CERTAIN, bound_of
from app.queries.cost_model import CROSSINGS

SHOWN = "points", "locations", "faces"
"""The members that drawings and tables of a path show."""


def outline_of(path: gc.GeodesicPath) -> dict[str, Any]:
    """Return the members of a path."""
    return {
        "status": "ok",
        "length": path.length,
        "points": path.points,
        "locations": [
            {"face": location.face_index, "barycentric": location.barycentric}
            for location in path.locations
        ],
        "faces": path.faces,
        "error_bound": bound_of(path.error_bound),
    }


def no_outline(reason: str, field: gc.DistanceField | None = None) -> dict[str, Any]:
    """Return the members that stand for a path that does not exist, or that a field has not found.

    That it is longer than the limit is certain, but for fields whose error is estimated.
    """
    bound = CERTAIN
    if field is not None and field.error_bound.kind == "estimated" and reason != "disconnected":
        bound = bound_of(field.error_bound)
    nothing = dict.fromkeys(("length", "points", "locations", "faces"))
    return {"status": "no_path", "reason": reason, **nothing, "error_bound": bound}


def expected_outline(
    mesh: gc.TriangleMesh,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    length: float,
    edge: float,
) -> dict[str, Any]:
    """Return the members of a straight path, with as many points as paths of its length have.

    An infinite length stands for no path; ``edge`` is the typical length of an edge.
    """
    if math.isinf(length):
        return no_outline("disconnected")
    count = 2 + round(CROSSINGS * length / edge)
    shares = np.linspace(0.0, 1.0, count)[:, None]
    weights = np.concatenate([shares, 1.0 - shares, np.zeros_like(shares)], axis=1).tolist()
    face = len(mesh.faces) // 2
    return {
        "status": "ok",
        "length": length,
        "points": (1.0 - shares) * start + shares * end,
        "locations": [{"face": face, "barycentric": at} for at in weights],
        "faces": np.full(count - 1, face, np.int32),
        "error_bound": CERTAIN,
    }
