r"""Plane geometry of one unfolded triangle: scalars in, scalars out.

The frame of a half-edge has its tail at the origin, its head at (length, 0) and its face on y > 0.
The unfolded source of a window lies at (sx, sy) with sy <= 0::

                 apex
                 /|\
                / | \
          tail +--x--+ head        y = 0
                  |
                s (sx, sy)
"""

import math

from geodesic_core.kernels.jit import inlined


@inlined
def hit_left(b: float, sy: float, sy_left: float, sin_left: float, length_left: float) -> float:
    """Distance from the tail at which the ray from s through (b, 0) meets the edge (tail, apex).

    ``sy_left`` is the source's y in the frame of that edge. A ray that passes the apex on the other
    side, or never meets the line, gives the apex.
    """
    height = sy_left + b * sin_left
    if height >= 0.0:
        return length_left
    return min(b * sy / height, length_left)


@inlined
def bisector(
    lo: float,
    hi: float,
    s0x: float,
    s0y: float,
    sigma0: float,
    s1x: float,
    s1y: float,
    sigma1: float,
    guess: float,
) -> float:
    """Point of [lo, hi] at equal distance from two weighted sources (the quadratic of section 3.3).

    The caller knows that the sign of the difference changes once in [lo, hi]; ``guess`` lies there
    and picks the root where rounding offers two.
    """
    # Around lo as origin: the coefficients are differences of squares.
    x0, x1 = s0x - lo, s1x - lo
    alpha = x1 - x0
    beta = sigma1 - sigma0
    norm1 = x1 * x1 + s1y * s1y
    gamma = x0 * x0 + s0y * s0y - norm1 - beta * beta
    a = alpha * alpha - beta * beta
    b = gamma * alpha + 2.0 * x1 * beta * beta
    c = 0.25 * gamma * gamma - norm1 * beta * beta
    discriminant = max(b * b - 4.0 * a * c, 0.0)
    q = -0.5 * (b + math.copysign(math.sqrt(discriminant), b))
    x = guess - lo
    near, far = x, x
    if q != 0.0:
        near = c / q
    if a != 0.0:
        far = q / a
    root = near if abs(near - x) <= abs(far - x) else far
    return min(max(lo + root, lo), hi)
