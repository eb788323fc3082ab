"""Points of the surface as arrays, and back again: how they are kept on disk."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.mesh.curve import Polyline
from geodesic_core.mesh.surface_point import SurfacePoint

_NO_VERTEX = -1


def to_arrays(name: str, lines: Sequence[Polyline]) -> dict[str, NDArray[Any]]:
    """Return canonical points, line by line, as arrays whose names begin with ``name``."""
    points = list(chain.from_iterable(lines))
    vertices = [_NO_VERTEX if p.vertex_index is None else p.vertex_index for p in points]
    return {
        f"{name}_sizes": np.array([len(line) for line in lines], np.int64),
        f"{name}_faces": np.array([point.face_index for point in points], np.int64),
        f"{name}_weights": np.array([point.barycentric for point in points]).reshape(-1, 3),
        f"{name}_vertices": np.array(vertices, np.int64),
    }


def from_arrays(name: str, arrays: Mapping[str, NDArray[Any]]) -> tuple[Polyline, ...]:
    """Return the lines that were `to_arrays` under this name."""
    rows = zip(
        *(arrays[f"{name}_{part}"].tolist() for part in ("faces", "weights", "vertices")),
        strict=True,
    )
    points = iter(
        SurfacePoint(face, tuple(weights), None if vertex == _NO_VERTEX else vertex)
        for face, weights, vertex in rows
    )
    sizes = arrays[f"{name}_sizes"].tolist()
    return tuple(tuple(next(points) for _ in range(size)) for size in sizes)
