r"""Plane geometry of one unfolded triangle, in scalars.

The frame of a half-edge has its tail at the origin, its head at (length, 0) and its face on y > 0.
The unfolded source of a window lies at (sx, sy) with sy <= 0; if its weight sw is 0, at infinity in
that direction::

                 apex
                 /|\
                / | \
          tail +--x--+ head        y = 0
                  |
                s (sx, sy)
"""

import math
from typing import NamedTuple

from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.tolerances import DOUBLE_ROOT, FALSE_POSITION_STEPS, HALF_ULP


class Source(NamedTuple):
    """An unfolded source at (x, y); with weight 0, at infinity in that direction."""

    x: float
    y: float
    weight: float


@inlined
def hit_left(
    b: float, sy: float, sy_left: float, sin_left: float, length_left: float, sw: float = 1.0
) -> float:
    """Distance from the tail at which the ray from s through (b, 0) meets the edge (tail, apex).

    ``sy_left`` is the source's y in the frame of that edge. A ray that passes the apex on the other
    side, or never meets the line, gives the apex.
    """
    height = sy_left + b * sw * sin_left
    if height >= 0.0:
        return length_left
    return min(b * sy / height, length_left)


@inlined
def distance(x: float, sx: float, sy: float, sw: float = 1.0) -> float:
    """Distance from (x, 0) to (sx, sy); to one at infinity, less that from the origin."""
    if sw == 0.0:
        return -sx * x
    return math.sqrt((x - sx) * (x - sx) + sy * sy)


@kernel
def bracketed(lo: float, hi: float, s0: Source, s1: Source, delta: float) -> float:
    """Find the point of `bisector` by false position (Illinois), to within rounding.

    ``delta`` is σ1 - σ0.
    """
    lead_lo = distance(lo, s1.x, s1.y, s1.weight) + delta - distance(lo, s0.x, s0.y, s0.weight)
    lead_hi = distance(hi, s1.x, s1.y, s1.weight) + delta - distance(hi, s0.x, s0.y, s0.weight)
    if lead_lo * lead_hi >= 0.0:  # no sign change: by rounding alone, at an end
        return lo if abs(lead_lo) <= abs(lead_hi) else hi
    x, moved = lo, 0
    for _ in range(FALSE_POSITION_STEPS):
        x = lo - lead_lo * ((hi - lo) / (lead_hi - lead_lo))
        if x <= lo or x >= hi:
            break
        r0, r1 = distance(x, s0.x, s0.y, s0.weight), distance(x, s1.x, s1.y, s1.weight)
        lead = r1 + delta - r0
        if abs(lead) <= HALF_ULP * (abs(r0) + abs(r1)):
            break
        if (lead > 0.0) == (lead_lo > 0.0):
            lo, lead_lo = x, lead
            if moved < 0:  # twice the same end: draw the other nearer
                lead_hi *= 0.5
            moved = -1
        else:
            hi, lead_hi = x, lead
            if moved > 0:
                lead_lo *= 0.5
            moved = 1
    return min(max(x, lo), hi)


@inlined
def root_depth(x: float, width: float, delta: float, u: float, v: float) -> float:
    """Depth of a root of `bisector` within (0, width); 0 or less if outside, or no solution."""
    r0 = u + v * x  # these two times 2 delta
    r1 = r0 - 2.0 * delta * delta
    if delta * r0 < 0.0 or delta * r1 < 0.0:
        return 0.0
    return min(x, width - x)


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
) -> float:
    """Point of [lo, hi] at equal distance from two weighted sources (the quadratic of section 3.3).

    The caller knows that the sign of the difference changes once in [lo, hi].

    Let r0 and r1 be the distances to the two. From r1 = r0 - delta it follows that r0 is linear in
    x, m r0 = u + v x with m = 2 delta, and its square is the quadratic. Squaring has added the
    other branch of the hyperbola, where r0 or r1 comes out negative.
    """
    width, x0, x1, delta = hi - lo, s0x - lo, s1x - lo, sigma1 - sigma0
    m2 = 4.0 * delta * delta
    u = delta * delta - (x1 - x0) * (x1 + x0) - (s1y - s0y) * (s1y + s0y)
    v = 2.0 * (x1 - x0)
    a, b = m2 - v * v, m2 * x0 + u * v
    c = m2 * (x0 * x0 + s0y * s0y) - u * u
    t = b + math.copysign(math.sqrt(max(b * b - a * c, 0.0)), b)
    if abs(t) <= DOUBLE_ROOT * (m2 * abs(x0) + abs(u * v)):  # both roots at lo, in the rounding
        return bracketed(lo, hi, Source(s0x, s0y, 1.0), Source(s1x, s1y, 1.0), delta)
    near = c / t if t != 0.0 else 0.0
    far = t / a if a != 0.0 else 0.0
    depth_near = root_depth(near, width, delta, u, v)
    depth_far = root_depth(far, width, delta, u, v)
    if max(depth_near, depth_far) <= 0.0 or abs(near - far) <= DOUBLE_ROOT * width:
        # Weights that are nearly equal: both roots are the straight bisector's, with half of its
        # digits, and the signs of r0 and r1 are rounding.
        return bracketed(lo, hi, Source(s0x, s0y, 1.0), Source(s1x, s1y, 1.0), delta)
    # Where rounding lets in a second root, at an end, it is the inner one that counts.
    return lo + (near if depth_near >= depth_far else far)
