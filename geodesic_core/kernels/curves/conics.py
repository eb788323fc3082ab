r"""Conics and straight lines in the plane of a face, each with one parameter.

A conic is given as seen from a focus c. In the direction of the unit vector u, at an angle φ, the
conic is r(φ) = q / w(φ) away from c, where w(φ) = k + g·u = k + gx cos φ + gy sin φ::

                  \
          c        |
           *------>+
              r   |
                 /

The parameter of a conic is the angle φ, counter-clockwise. A circle around c is the conic with
g = 0 and k = 1, so that q is its radius. A straight line has no focus: c is one of its points, and
g is the unit vector along it. The parameter of a line is the distance from c. An *arc* is a curve
between two parameters.
"""

import math
from typing import Any

from geodesic_core.arrays import Floats
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, half_edge_in_face

# Columns of a curve
CX = 0  # the focus of a conic; a point of a line
CY = 1
Q = 2  # infinite of a line
K = 3
GX = 4
GY = 5
CURVE = 6

EX, EY = GX, GY  # of a line: the unit vector along it

# Columns of an arc, after those of its curve
START = CURVE  # the parameters between which it lies
END = CURVE + 1
ARC = CURVE + 2

TURN = 2.0 * math.pi


@kernel
def is_line(curve: Floats) -> bool:
    """Whether a curve is a straight line; else it is a conic."""
    return math.isinf(curve[Q])


@inlined
def put_arc(arc: Floats, curve: Floats, start: float, end: float) -> None:
    """Make ``arc`` the arc of a curve between two parameters."""
    for column in range(CURVE):
        arc[column] = curve[column]
    arc[START], arc[END] = start, end


@kernel
def point_on(curve: Floats, parameter: float) -> tuple[float, float]:
    """Return the point of a curve at a parameter."""
    x, y = curve[CX], curve[CY]
    if is_line(curve):
        return x + parameter * curve[EX], y + parameter * curve[EY]
    cosine, sine = math.cos(parameter), math.sin(parameter)
    r = curve[Q] / (curve[K] + curve[GX] * cosine + curve[GY] * sine)
    return x + r * cosine, y + r * sine


@kernel
def direction_at(curve: Floats, parameter: float) -> tuple[float, float]:
    """Return the unit vector along a conic at a parameter, toward larger ones."""
    cosine, sine = math.cos(parameter), math.sin(parameter)
    w = curve[K] + curve[GX] * cosine + curve[GY] * sine
    turn = curve[GX] * sine - curve[GY] * cosine  # -w'
    x, y = turn * cosine - w * sine, turn * sine + w * cosine
    length = math.hypot(x, y)
    return x / length, y / length


@kernel
def whole_range(curve: Floats, geometry: Floats, face: int) -> tuple[float, float]:
    """Return the least and the largest parameter of a curve in the plane of a face.

    The range of a circle begins where the circle is farthest from the middle of the face, that of
    an ellipse where it is farthest from the focus.
    """
    if is_line(curve):
        return -math.inf, math.inf
    gx, gy = curve[GX], curve[GY]
    swing = math.hypot(gx, gy)
    if curve[K] < swing:
        half = math.acos(-curve[K] / swing)
        first = math.atan2(gy, gx) - half
        return first, first + 2.0 * half
    first = math.atan2(-gy, -gx)
    if swing == 0.0:
        ax, ay, _, _ = half_edge_in_face(geometry, 3 * face + 2)
        middle_x, middle_y = (geometry[3 * face, LENGTH] + ax) / 3.0, ay / 3.0
        first = math.atan2(curve[CY] - middle_y, curve[CX] - middle_x)
    return first, first + TURN


@kernel
def strays(curve: Floats, start: float, end: float, enough: float) -> float:
    """Return an upper bound of how far a conic strays from the chord between two parameters.

    It is convex: between the chord and the tangents at its ends. Chords no longer than ``enough``
    count as exact.
    """
    x0, y0 = point_on(curve, start)
    x1, y1 = point_on(curve, end)
    ux, uy = direction_at(curve, start)
    vx, vy = direction_at(curve, end)
    length = math.hypot(x1 - x0, y1 - y0)
    if length <= enough:
        return 0.0
    ex, ey = (x1 - x0) / length, (y1 - y0) / length
    rise, fall = abs(ex * uy - ey * ux), abs(ex * vy - ey * vx)
    if ex * ux + ey * uy <= 0.5 or ex * vx + ey * vy <= 0.5:  # more than a third of half a turn
        return math.inf
    whole = rise * (ex * vx + ey * vy) + fall * (ex * ux + ey * uy)
    return length * rise * fall / whole if whole > 0.0 else 0.0


@inlined
def sagitta_of(curve: Floats, start: float, end: float) -> float:
    """Return an upper bound of how far an arc strays from its chord; of circles it is exact."""
    if is_line(curve):
        return 0.0
    if curve[GX] != 0.0 or curve[GY] != 0.0:
        return strays(curve, start, end, 0.0)
    radius = curve[Q] / curve[K]
    if end - start >= math.pi:
        return 2.0 * radius
    return radius * (1.0 - math.cos(0.5 * (end - start)))


@inlined
def chord_of(curve: Floats, start: float, end: float) -> Any:
    """Return both ends of an arc, and its sagitta."""
    x0, y0 = point_on(curve, start)
    x1, y1 = point_on(curve, end)
    return x0, y0, x1, y1, sagitta_of(curve, start, end)
