"""By how much the function of a certificate rises too fast in each face, with all rounding.

The same bounds as `geodesic_core.verify` computes with numpy, whose names these are; that file says
what is proved, and how. Here they take a tenth of the time.
"""

import math
from typing import Any, NamedTuple

from geodesic_core.arrays import Flags, Floats, Longs
from geodesic_core.kernels.jit import inlined, kernel

U = 2.0**-53
"""Relative rounding of an operation"""
UP = 1.0 + 2.0**-48
"""Makes up for the rounding of radii"""
TINY = 1e-140
"""Absolute rounding, where numbers underflow"""


class Ball(NamedTuple):
    """A real number within ``r`` of ``m``."""

    m: float
    r: float


class Corners(NamedTuple):
    """Cosine and sine at the corners of faces, (F, 3), by their midpoints and radii."""

    cosine: Floats
    cosine_radius: Floats
    sine: Floats
    sine_radius: Floats


class Pieces(NamedTuple):
    """The pieces of all edges, those of edge e from ``start[e]`` on; see `verify.Pieces`."""

    start: Longs
    a: Floats
    h: Floats
    sigma: Floats
    sigma_radius: Floats
    t0: Floats
    t1: Floats


class Cone(NamedTuple):
    """A cone, and where it counts."""

    a: Ball
    h: Ball
    sigma: Ball
    x0: float
    x1: float


@inlined
def add(a: Ball, b: Ball) -> Ball:
    """Return a + b."""
    m = a.m + b.m
    return Ball(m, (a.r + b.r + U * abs(m)) * UP)


@inlined
def subtract(a: Ball, b: Ball) -> Ball:
    """Return a - b."""
    m = a.m - b.m
    return Ball(m, (a.r + b.r + U * abs(m)) * UP)


@inlined
def multiply(a: Ball, b: Ball) -> Ball:
    """Return a · b."""
    m = a.m * b.m
    return Ball(m, (abs(a.m) * b.r + a.r * (abs(b.m) + b.r) + U * abs(m) + TINY) * UP)


@inlined
def norm(x: Ball, y: Ball) -> Ball:
    """Return the length of a vector."""
    m = math.sqrt(x.m * x.m + y.m * y.m)
    return Ball(m, (x.r + y.r + 8.0 * U * m + TINY) * UP)


@inlined
def high(a: Ball) -> float:
    """Upper bound of a ball."""
    bound = a.m + a.r
    return bound + 4.0 * U * abs(bound)


@inlined
def low(a: Ball) -> float:
    """Lower bound of a ball."""
    bound = a.m - a.r
    return bound - 4.0 * U * abs(bound)


@kernel
def find_violations(
    edges: Longs,
    faces: Longs,
    of_face: Longs,
    length: Floats,
    length_radius: Floats,
    is_rim: Flags,
    corners: Corners,
    pieces: Pieces,
    violations: Floats,
    first: int,
    last: int,
) -> None:
    """Write the largest f(q) - f(p) - |pq| of faces ``first`` to ``last``, for p, q on their rims.

    Pairs of points on one edge are left out. O(pieces log pieces). Modifies ``violations`` (F,).
    """
    for face in range(first, last):
        worst = -math.inf
        for c in range(3):
            corner = faces[face, c]
            cosine = Ball(corners.cosine[face, c], corners.cosine_radius[face, c])
            sine = Ball(corners.sine[face, c], corners.sine_radius[face, c])
            for way in range(2):
                e, g = of_face[face, c], of_face[face, (c + 2) % 3]
                if way == 1:
                    e, g = g, e
                e_low, g_low = edges[e, 0] == corner, edges[g, 0] == corner
                e_length = Ball(length[e], length_radius[e])
                g_length = Ball(length[g], length_radius[g])
                bound = violation_across(
                    pieces, e, g, e_length, g_length, e_low, g_low, is_rim[e], cosine, sine
                )
                worst = max(worst, bound)
        violations[face] = worst


@kernel
def violation_across(
    pieces: Pieces,
    e: int,
    g: int,
    e_length: Ball,
    g_length: Ball,
    e_low: bool,
    g_low: bool,
    is_alone: bool,
    cosine: Ball,
    sine: Ball,
) -> float:
    """Bound f(q) - f(p) - |pq| for p on e and q on g, edges at a corner; see `Pieces.across`.

    ``is_alone`` tells that e has pieces of no extent at its ends alone.
    """
    worst, number = -math.inf, pieces.start[e + 1] - pieces.start[e]
    bend = Cone(Ball(0.0, 0.0), Ball(0.0, 0.0), Ball(0.0, 0.0), math.inf, math.inf)
    for n in range(number):
        a, h, sigma, b0, b1 = piece_at(pieces, e, n, e_length, e_low)
        k0 = add(multiply(subtract(a, b0), sine), multiply(h, cosine))
        k1 = add(multiply(subtract(a, b1), sine), multiply(h, cosine))
        e0, e1 = multiply(b0, h), multiply(b1, h)
        c0 = c1 = math.inf
        if high(k0) > 0.0:
            c0 = max(low(e0), 0.0) / high(k0) * (1.0 - 8.0 * U)
        if low(k1) > 0.0:
            c1 = max(high(e1), 0.0) / low(k1) * (1.0 + 8.0 * U)
        if is_alone:
            c0, c1 = -1.0, math.inf
        if bend.x0 < c0:
            between = Cone(bend.a, bend.h, bend.sigma, bend.x0, c0)
            worst = max(worst, violation_by(pieces, g, g_length, g_low, between))
        if c0 < c1:
            foot = subtract(multiply(a, cosine), multiply(h, sine))
            height = add(multiply(a, sine), multiply(h, cosine))
            straight = Cone(foot, Ball(abs(height.m), height.r), sigma, c0, c1)
            worst = max(worst, violation_by(pieces, g, g_length, g_low, straight))
        bent = add(sigma, norm(subtract(b1, a), h))
        bend = Cone(multiply(b1, cosine), multiply(b1, sine), bent, c1, math.inf)
    if bend.x0 < math.inf:
        worst = max(worst, violation_by(pieces, g, g_length, g_low, bend))
    return worst


@inlined
def piece_at(pieces: Pieces, e: int, n: int, length: Ball, is_low: bool) -> Any:
    """Return the n-th piece of an edge from one of its ends on: cone, and both ends."""
    i = pieces.start[e] + n if is_low else pieces.start[e + 1] - 1 - n
    h, sigma = Ball(pieces.h[i], 0.0), Ball(pieces.sigma[i], pieces.sigma_radius[i])
    foot = Ball(pieces.a[i], 0.0)
    u0, u1 = Ball(pieces.t0[i], 0.0), Ball(pieces.t1[i], 0.0)
    if not is_low:
        foot = subtract(length, foot)
        u0, u1 = Ball(1.0 - pieces.t1[i], U), Ball(1.0 - pieces.t0[i], U)
    return foot, h, sigma, multiply(u0, length), multiply(u1, length)


@kernel
def violation_by(pieces: Pieces, g: int, length: Ball, is_low: bool, cone: Cone) -> float:
    """Bound the largest f - cone on the part of edge g on which the cone counts."""
    worst, number = -math.inf, pieces.start[g + 1] - pieces.start[g]
    lo, hi = 0, number  # the first piece that may end behind x0
    while lo < hi:
        middle = (lo + hi) // 2
        _, _, _, _, right = piece_at(pieces, g, middle, length, is_low)
        if high(right) < cone.x0:
            lo = middle + 1
        else:
            hi = middle
    for n in range(lo, number):
        a, h, sigma, left, right = piece_at(pieces, g, n, length, is_low)
        if low(left) > cone.x1:
            break
        if cone.x0 > low(left):
            left = Ball(cone.x0, 0.0)
        if cone.x1 < high(right):
            right = Ball(cone.x1, 0.0)
        worst = max(worst, largest_difference(a, h, sigma, cone, left, right))
    return worst


@kernel
def largest_difference(a: Ball, h: Ball, sigma: Ball, cone: Cone, left: Ball, right: Ball) -> float:
    """Bound the largest difference of two cones on an interval; see `verify.above`."""
    rise = subtract(sigma, cone.sigma)
    at_left = subtract(norm(subtract(left, a), h), norm(subtract(left, cone.a), cone.h))
    at_right = subtract(norm(subtract(right, a), h), norm(subtract(right, cone.a), cone.h))
    worst = max(high(add(rise, at_left)), high(add(rise, at_right)))
    on_left = subtract(multiply(subtract(a, left), cone.h), multiply(subtract(cone.a, left), h))
    on_right = subtract(multiply(subtract(a, right), cone.h), multiply(subtract(cone.a, right), h))
    is_apart = (low(on_left) > 0.0 and low(on_right) > 0.0) or (
        high(on_left) < 0.0 and high(on_right) < 0.0
    )
    is_beyond = (high(a) >= low(cone.a) and low(left) <= high(cone.a)) or (
        low(a) <= high(cone.a) and high(right) >= low(cone.a)
    )
    if not is_apart and is_beyond and high(subtract(h, cone.h)) >= 0.0:
        apexes = norm(subtract(a, cone.a), subtract(h, cone.h))
        worst = max(worst, high(add(rise, apexes)))
    return worst
