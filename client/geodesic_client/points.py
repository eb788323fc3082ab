"""Points and curves, as the service reads them. The index of a vertex is a point as well."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Point = int | Mapping[str, Any]
"""The index of a vertex, or the result of a function of this module"""


def edge(start: int, end: int, t: float) -> Point:
    """Return the point on the edge between two vertices, at a share ``t`` of the way."""
    return {"edge": [start, end], "t": t}


def face(index: int, weights: Sequence[float]) -> Point:
    """Return the point in a face, by the weights of its three corners."""
    return {"face": index, "barycentric": list(weights)}


def position(coordinates: Sequence[float], max_distance: float | None = None) -> Point:
    """Return the point of the surface nearest to ``x, y, z``, at most ``max_distance`` away."""
    return {"position": list(coordinates), "max_distance": max_distance}


def curve(points: Sequence[Point]) -> Point:
    """Return a curve, for a source: points each of which shares a face with the next."""
    return {"polyline": list(points)}


def starting_at(source: Point, distance: float) -> Point:
    """Return a source at which distances begin with ``distance`` instead of 0."""
    members = source if isinstance(source, Mapping) else {"vertex": source}
    return {**members, "start_distance": distance}


def as_points(points: Point | Sequence[Point]) -> Sequence[Point]:
    """Return several points; a single one becomes a list."""
    is_single = isinstance(points, int | np.integer | Mapping)
    return [points] if is_single else points  # type: ignore[list-item, return-value]
