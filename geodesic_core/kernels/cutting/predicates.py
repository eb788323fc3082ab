"""Predicates on points in whole numbers, whose signs are exact.

A point of a face is its weights at corners 1 and 2, in steps of 1 / STEPS: the face is the triangle
(0, 0), (STEPS, 0), (0, STEPS). Whatever its shape in space, a triangle of this grid is turned over
there only where it is here.
"""

from geodesic_core.arrays import Longs
from geodesic_core.kernels.jit import kernel
from geodesic_core.tolerances import EDGE_STEPS, MERGE

STEPS = int(EDGE_STEPS)
"""Steps of a weight"""
NEAR = int(MERGE * EDGE_STEPS)
"""Steps up to which points count as one, and as on a segment"""

_LIMB = 21  # bits: products of 42 bits by 42 are summed as three limbs of 64
_MASK = (1 << _LIMB) - 1
_ROUNDED = 1e-15  # four roundings, of the sum of both products


@kernel
def twice_area(places: Longs, i: int, j: int, k: int) -> float:
    """Return twice the area of a triangle, positive counter-clockwise: rounded, its sign exact."""
    a, b = places[j, 0] - places[i, 0], places[k, 1] - places[i, 1]
    c, d = places[j, 1] - places[i, 1], places[k, 0] - places[i, 0]
    first, second = float(a) * float(b), float(c) * float(d)
    if abs(first - second) > _ROUNDED * (abs(first) + abs(second)):
        return first - second
    a_high, b_high, c_high, d_high = a >> _LIMB, b >> _LIMB, c >> _LIMB, d >> _LIMB
    a_low, b_low, c_low, d_low = a & _MASK, b & _MASK, c & _MASK, d & _MASK
    low = a_low * b_low - c_low * d_low
    middle = a_high * b_low + a_low * b_high - c_high * d_low - c_low * d_high + (low >> _LIMB)
    high = a_high * b_high - c_high * d_high + (middle >> _LIMB)
    rest = ((middle & _MASK) << _LIMB) + (low & _MASK)
    return float(high) * float(1 << (2 * _LIMB)) + float(rest)


@kernel
def is_on_border(places: Longs, i: int) -> bool:
    """Whether a point is on an edge of the face."""
    x, y = places[i, 0], places[i, 1]
    return x == 0 or y == 0 or x + y == STEPS


@kernel
def apart(places: Longs, i: int, j: int) -> int:
    """Return the largest difference of two points in any of the three weights."""
    dx, dy = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
    return max(abs(dx), abs(dy), abs(dx + dy))


@kernel
def squared(places: Longs, i: int, j: int) -> float:
    """Return the square of the distance of two points, the same either way."""
    dx, dy = float(places[j, 0] - places[i, 0]), float(places[j, 1] - places[i, 1])
    return dx * dx + dy * dy


@kernel
def is_beside(places: Longs, i: int, j: int, k: int) -> bool:
    """Whether k is on the segment from i to j or NEAR it, and nearer to its ends than they are.

    So pieces of segments that are led through points get shorter, and that comes to an end.
    """
    if abs(twice_area(places, i, j, k)) > NEAR * float(apart(places, i, j)):
        return False
    return max(squared(places, i, k), squared(places, k, j)) < squared(places, i, j)
