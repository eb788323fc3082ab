"""The members of a path in answers, or the reason why there is none."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.queries.accuracy import CERTAIN, bound_of

SHOWN = "points", "locations", "faces"
"""The members that drawings and tables of a path show."""


def outline_of(path: gc.GeodesicPath | gc.CheapestPath) -> dict[str, Any]:
    """Return the members of a path."""
    cost = {"cost": path.cost} if isinstance(path, gc.CheapestPath) else {}
    return {"status": "ok", **polyline_of(path), **cost, "error_bound": bound_of(path.error_bound)}


def polyline_of(path: gc.SurfaceCurve) -> dict[str, Any]:
    """Return the members of a path or a line as a polyline; its points only where it has any."""
    return {
        "length": path.length,
        "points": points_of(path),
        "locations": locations_of(path),
        "faces": path.faces,
    }


def points_of(curve: gc.SurfaceCurve) -> NDArray[np.float64] | None:
    """Return the points of a curve; None on a mesh without positions."""
    return curve.points if curve.mesh is None or curve.mesh.has_positions else None


def locations_of(curve: gc.SurfaceCurve) -> list[dict[str, Any]]:
    """Return the members of the points of a curve on the surface."""
    return [
        {"face": location.face_index, "barycentric": location.barycentric}
        for location in curve.locations
    ]


def no_outline(reason: str, error_bound: gc.ErrorBound) -> dict[str, Any]:
    """Return the members that stand for a path that does not exist, or that was not found.

    That it is longer than the limit is certain, unless the error of distances is estimated.
    """
    bound = CERTAIN
    if error_bound.kind == "estimated" and reason != "disconnected":
        bound = bound_of(error_bound)
    nothing = dict.fromkeys(("length", "points", "locations", "faces"))
    return {"status": "no_path", "reason": reason, **nothing, "error_bound": bound}
