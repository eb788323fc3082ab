"""Points of a face, by the weights of its inner corners: they need no positions in space."""

import math

from geodesic_core.arrays import Floats
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import COS_LEFT, LENGTH, LENGTH_LEFT, SIN_LEFT


@inlined
def copy_weights(source: Floats, row: int, weights: Floats, target: int) -> None:
    """Copy the weights in a row of ``source`` to a row of ``weights``."""
    for k in range(3):
        weights[target, k] = source[row, k]


@inlined
def put_corner(weights: Floats, row: int, corner: int) -> None:
    """Write the weights of a corner to a row."""
    for k in range(3):
        weights[row, k] = 1.0 if k == corner else 0.0


@inlined
def put_in_face(geometry: Floats, face: int, x: float, y: float, weights: Floats, row: int) -> None:
    """Write the weights of the point at (x, y) in a face's frame, pulled into it, to a row."""
    h = 3 * face
    ax = geometry[h, LENGTH_LEFT] * geometry[h, COS_LEFT]
    ay = geometry[h, LENGTH_LEFT] * geometry[h, SIN_LEFT]
    up = min(max(y / ay, 0.0), 1.0) if ay > 0.0 else 0.0
    along = min(max((x - up * ax) / geometry[h, LENGTH], 0.0), 1.0 - up)
    weights[row, 0], weights[row, 1], weights[row, 2] = (1.0 - up) - along, along, up


@inlined
def step_between(
    geometry: Floats, face: int, start: Floats, i: int, end: Floats, j: int
) -> tuple[float, float]:
    """Return the way from row i of ``start`` to row j of ``end``, in the frame of their face."""
    h, along, up = 3 * face, end[j, 1] - start[i, 1], end[j, 2] - start[i, 2]
    reach = up * geometry[h, LENGTH_LEFT]
    x = along * geometry[h, LENGTH] + reach * geometry[h, COS_LEFT]
    return x, reach * geometry[h, SIN_LEFT]


@kernel
def way_between(geometry: Floats, face: int, weights: Floats, i: int, j: int) -> float:
    """Return the distance of the points in two rows of weights in a face, within it."""
    x, y = step_between(geometry, face, weights, i, weights, j)
    return math.hypot(x, y)
