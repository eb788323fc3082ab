"""By how much the function of a certificate rises too fast in each face, with all rounding.

The same bounds as `geodesic_core.verify` finds by balls, whose names these are; that file says what
is proved, and how. Here numbers are plain, and their rounding is bounded beforehand. Let u be the
rounding of an operation, e and g edges at a corner with lengths E and G, and all of a piece seen
from the corner: foot a, height h, extent [b0, b1].

- Lengths are off by e_r and g_r; cosine and sine at the corner, as a vector, by rho. An extent is
  t · E, and from the far end 1 - t: off by β = e_r + 3 u E at most. A foot from the far end is
  E - a: off by α = e_r + u |E - a|, else by 0. What is known of σ is off by s_r, mostly 0.
- The straight way through a piece is a cone whose apex is (a, h), turned by the corner's angle: off
  by α + |(a, h)| (rho + 3 u).
- The way that bends at b has its apex at (b cos, b sin), which is off by β + E (rho + 2 u), and
  σ + r, r = |(b - a, h)|, which is off by α + β + s_r + u (4 r + |σ|).
- The difference of two cones at a place is off by as much as both apexes and both σ are. It is
  computed as (σ1 - σ0) + (r1² - r0²) / (r1 + r0), by products of differences and sums: the rounding
  of that is less than 3 u |σ1 - σ0| and 16 u times how far the apexes are apart, which bounds the
  quotient. At an end of a piece of g, it is off by twice that end's β.
- The rays at b meet g at b h / ((a - b) sin + h cos). The numerator is off by h (β + u E), and the
  denominator by α + β + (|a| + E + h) (rho + 4 u).

Constants are rounded up, which pays for products of errors. The difference of two cones is never
larger than their apexes and σ allow. For that most pairs are passed by.

Where pieces meet, f is found in twice the precision: the root r of two squares is corrected by
(x² + h² - r²) / 2 r, where squares and differences are sums of two numbers, without rounding.
"""

import math
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.kernels.certificates.faces import Faces
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.tolerances import HALF_ULP as U

TINY = 1e-140
"""Absolute rounding, where numbers underflow"""
_SPLIT = 2.0**27 + 1.0
"""Splits a number into halves of its digits"""

# Columns of a piece, as seen from a corner
FOOT = 0
HEIGHT = 1
SIGMA = 2
B0 = 3
B1 = 4
FOOT_OFF = 5
SIGMA_OFF = 6
PIECE = 7


class Turns(NamedTuple):
    """The angles at the corners of faces."""

    cosine: Floats
    """(F, 3)"""
    sine: Floats
    off: Floats
    """(F, 3): by how much both, as a vector, may be rounded"""


class Pieces(NamedTuple):
    """The pieces of all edges, those of edge e from ``start[e]`` on; see `verify.Pieces`."""

    start: Longs
    a: Floats
    h: Floats
    sigma: Floats
    sigma_off: Floats
    t0: Floats
    t1: Floats


class Cone(NamedTuple):
    """A cone over an edge, and where it counts."""

    foot: float
    height: float
    sigma: float
    off: float
    """By how much its values may be rounded"""
    x0: float
    x1: float


@kernel
def find_rises(
    faces: Faces, turns: Turns, pieces: Pieces, first: int, last: int, rises: Floats
) -> None:
    """Fill ``rises[first:last]`` with bounds of f(q) - f(p) - |pq|, for p and q on two edges.

    They are 0 at least. O(pieces).
    """
    faces, turns, pieces = borrowed(faces), borrowed(turns), borrowed(pieces)
    ahead, behind = np.empty((64, PIECE)), np.empty((64, PIECE))
    for face in range(first, last):
        worst = 0.0
        for c in range(3):
            corner, e, g = (
                faces.corners[face, c],
                faces.of_face[face, c],
                faces.of_face[face, (c + 2) % 3],
            )
            m, n = pieces.start[e + 1] - pieces.start[e], pieces.start[g + 1] - pieces.start[g]
            ahead, behind = with_room(ahead, m), with_room(behind, n)
            put_pieces(pieces, e, faces.edges[e, 0] == corner, faces, ahead)
            put_pieces(pieces, g, faces.edges[g, 0] == corner, faces, behind)
            turn = turns.cosine[face, c], turns.sine[face, c], turns.off[face, c]
            worst = rise_across(faces, e, g, ahead, behind, (m, n), turn, worst)
            worst = rise_across(faces, g, e, behind, ahead, (n, m), turn, worst)
        rises[face] = worst


@inlined
def put_pieces(pieces: Pieces, e: int, is_low: bool, faces: Faces, rows: Floats) -> None:
    """Fill ``rows`` with the pieces of an edge as seen from its lower end, or its upper one."""
    length, length_off = faces.length[e], faces.length_off[e]
    start, end = pieces.start[e], pieces.start[e + 1]
    for n in range(end - start):
        i = start + n if is_low else end - 1 - n
        row = rows[n]
        row[HEIGHT], row[SIGMA], row[SIGMA_OFF] = pieces.h[i], pieces.sigma[i], pieces.sigma_off[i]
        if is_low:
            row[FOOT], row[FOOT_OFF] = pieces.a[i], 0.0
            row[B0], row[B1] = pieces.t0[i] * length, pieces.t1[i] * length
        else:
            foot = length - pieces.a[i]
            row[FOOT], row[FOOT_OFF] = foot, length_off + 1.25 * U * abs(foot)
            row[B0], row[B1] = (1.0 - pieces.t1[i]) * length, (1.0 - pieces.t0[i]) * length


@inlined
def extent_off(faces: Faces, e: int) -> float:
    """Return by how much the ends of pieces may be rounded, β."""
    return faces.length_off[e] + 4.0 * U * faces.length[e]


@kernel
def rise_across(
    faces: Faces,
    e: int,
    g: int,
    of_e: Floats,
    of_g: Floats,
    sizes: tuple[int, int],
    turn: tuple[float, float, float],
    worst: float,
) -> float:
    """Return the largest f(q) - f(p) - |pq| for p on e and q on g, or ``worst``.

    They meet in a corner; see `verify.Pieces.across`. So many of the first rows of the arrays are
    their pieces.
    """
    (m, n), (cosine, sine, off) = sizes, turn
    length, is_alone = faces.length[e], faces.is_rim[e]
    beta, beta_g, near = extent_off(faces, e), extent_off(faces, g), 0
    bend = Cone(0.0, 0.0, 0.0, 0.0, math.inf, math.inf)
    bend_off = beta + length * (off + 4.0 * U)
    for i in range(m):
        a, h, sigma, b0, b1 = (
            of_e[i, FOOT],
            of_e[i, HEIGHT],
            of_e[i, SIGMA],
            of_e[i, B0],
            of_e[i, B1],
        )
        alpha, known = of_e[i, FOOT_OFF], of_e[i, SIGMA_OFF]
        c0, c1 = -1.0, math.inf
        if not is_alone:
            below = alpha + beta + (abs(a) + length + h) * (off + 8.0 * U) + TINY
            above = h * (beta + 4.0 * U * length) + TINY
            k0, k1 = (a - b0) * sine + h * cosine + below, (a - b1) * sine + h * cosine - below
            c0 = c1 = math.inf
            if k0 > 0.0:
                c0 = max(b0 * h - above, 0.0) / k0 * (1.0 - 8.0 * U)
            if k1 > 0.0:
                c1 = (b1 * h + above) / k1 * (1.0 + 8.0 * U)
        if bend.x0 < c0:
            between = Cone(bend.foot, bend.height, bend.sigma, bend.off, bend.x0, c0)
            near, worst = rise_above(between, of_g, n, beta_g, near, worst)
        if c0 < c1:
            turned = max(abs(a), h) + 0.5 * min(abs(a), h)  # how far the apex is, or more
            rounded = alpha + known + turned * (off + 4.0 * U)
            straight = Cone(
                a * cosine - h * sine, abs(a * sine + h * cosine), sigma, rounded, c0, c1
            )
            near, worst = rise_above(straight, of_g, n, beta_g, near, worst)
        away = math.sqrt((b1 - a) * (b1 - a) + h * h)
        rounded = bend_off + alpha + beta + known + 8.0 * U * (away + abs(sigma)) + TINY
        bend = Cone(b1 * cosine, b1 * sine, sigma + away, rounded, c1, math.inf)
    if bend.x0 < math.inf:
        near, worst = rise_above(bend, of_g, n, beta_g, near, worst)
    return worst


@inlined
def rise_above(
    cone: Cone, rows: Floats, count: int, beta: float, near: int, worst: float
) -> tuple[int, float]:
    """Return the first piece that may meet a cone's part, and the largest f - cone, or ``worst``.

    ``near`` is where the search for that piece begins.
    """
    while near > 0 and rows[near - 1, B1] + beta >= cone.x0:
        near -= 1
    while near < count and rows[near, B1] + beta < cone.x0:
        near += 1
    j = near
    while j < count and rows[j, B0] - beta <= cone.x1:
        bound = rise_of(cone, rows[j], beta, worst)
        if not bound <= worst:  # NaN must not be passed by
            worst = bound
        j += 1
    return near, worst


@inlined
def rise_of(cone: Cone, row: Floats, beta: float, worst: float) -> float:
    """Bound the largest difference of a piece and a cone, or return ``worst`` if it is no larger.

    It is at an end, or where both apexes are in line with the point.
    """
    foot, height, above = row[FOOT], row[HEIGHT], row[SIGMA] - cone.sigma
    moved = cone.off + row[FOOT_OFF]  # by how much the apexes may be
    rounded = moved + row[SIGMA_OFF] + 2.0 * beta + 3.0 * U * abs(above) + TINY
    dx, dy = foot - cone.foot, height - cone.height
    apart = math.sqrt(dx * dx + dy * dy)
    rounded += 24.0 * U * apart
    by_apexes = above + apart + rounded
    if by_apexes <= worst:
        return worst
    left, right = max(row[B0], cone.x0), min(row[B1], cone.x1)
    x0, x1, y0, y1 = foot - left, foot - right, cone.foot - left, cone.foot - right
    up, down = height * height, cone.height * cone.height
    sides0 = math.sqrt(x0 * x0 + up) + math.sqrt(y0 * y0 + down) + TINY
    sides1 = math.sqrt(x1 * x1 + up) + math.sqrt(y1 * y1 + down) + TINY
    upward = dy * (height + cone.height)
    bound0 = above + (dx * (x0 + y0) + upward) / sides0 + rounded
    bound1 = above + (dx * (x1 + y1) + upward) / sides1 + rounded
    worst = max(bound0, bound1, worst)
    if by_apexes <= worst:
        return worst
    size = abs(x0) + abs(y0) + abs(x1) + abs(y1) + height + cone.height
    moved += beta + 8.0 * U * size
    side0, side1 = x0 * cone.height - y0 * height, x1 * cone.height - y1 * height
    most = 2.0 * size * moved + TINY
    is_apart = (side0 > most and side1 > most) or (side0 < -most and side1 < -most)
    is_beyond = (foot + moved >= cone.foot - moved and left <= cone.foot + 2.0 * moved) or (
        foot - moved <= cone.foot + moved and right >= cone.foot - 2.0 * moved
    )
    if is_apart or not is_beyond or dy < -2.0 * moved:
        return worst
    return by_apexes


@kernel
def find_jumps(
    faces: Faces, pieces: Pieces, values: Floats, first: int, last: int, jumps: Floats
) -> None:
    """Fill ``jumps[first:last]`` with bounds of f(q) - f(p) - |pq| for p and q on one edge.

    f rises no faster along a piece than distances do. So the bound is the largest sum of the jumps
    from p to q, each with its sign: the largest difference of two of their partial sums. There is
    one at each end of an edge as well, to the value of the vertex. On an edge of one face only the
    two values count.
    """
    faces, pieces = borrowed(faces), borrowed(pieces)
    for e in range(first, last):
        low, high = values[faces.edges[e, 0]], values[faces.edges[e, 1]]
        length, length_off = faces.length[e], faces.length_off[e]
        if faces.is_rim[e]:
            step = abs(high - low)
            jumps[e] = max(step - length + (length_off + 4.0 * U * (step + length)), 0.0)
            continue
        start, end = pieces.start[e], pieces.start[e + 1]
        total = most = least = size = known = 0.0
        for i in range(start, end + 1):
            is_first, is_last = i == start, i == end
            x = 0.0 if is_first else (length if is_last else pieces.t0[i] * length)
            x_off = 0.0 if is_first else length_off + 2.0 * U * x
            sigma0, r0, tail0, a0, h0 = low, 0.0, 0.0, 0.0, 0.0
            if not is_first:
                sigma0, a0, h0 = pieces.sigma[i - 1], pieces.a[i - 1], pieces.h[i - 1]
                r0, tail0 = long_root(x, a0, h0)
            sigma1, r1, tail1, a1, h1 = high, 0.0, 0.0, 0.0, 0.0
            if not is_last:
                sigma1, a1, h1 = pieces.sigma[i], pieces.a[i], pieces.h[i]
                r1, tail1 = long_root(x, a1, h1)
            rise, rise_tail = two_sum(sigma1, -sigma0)
            reach, reach_tail = two_sum(r1, -r0)
            jump, jump_tail = two_sum(rise, reach)
            jump += (rise_tail + reach_tail) + jump_tail + (tail1 - tail0)
            bends = 2.0
            if not (is_first or is_last):
                bends = min(2.0, 2.5 * (abs(a1 - a0) + abs(h1 - h0)) / (r0 + r1 + TINY))
            size = max(size, abs(total) + abs(jump))
            known += bends * x_off + 4.0 * U * abs(jump) + TINY
            known += 128.0 * U * U * (abs(sigma0) + abs(sigma1) + r0 + r1)
            total += jump
            most, least = max(most, total), min(least, total)
        bound = most - least + known + 4.0 * U * (end - start + 4) * size
        jumps[e] = bound * (1.0 + 4.0 * U * (end - start + 8))


@inlined
def long_root(x: float, foot: float, height: float) -> tuple[float, float]:
    """Return √((x - foot)² + height²) as a sum of two, which is off by 32 u² of it."""
    along, along_tail = two_sum(x, -foot)
    root = math.sqrt(along * along + height * height)
    if root == 0.0:
        return 0.0, 0.0
    square0, tail0 = long_square(along)
    square1, tail1 = long_square(height)
    square, tail = long_square(root)
    left, left_tail = two_sum(square0, -square)
    left, more_tail = two_sum(left, square1)
    left += (left_tail + more_tail) + (tail0 + tail1 - tail) + 2.0 * along * along_tail
    return root, 0.5 * left / root


@inlined
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return a + b as a sum of two, without rounding (Knuth)."""
    total = a + b
    other = total - a
    return total, (a - (total - other)) + (b - other)


@inlined
def long_square(a: float) -> tuple[float, float]:
    """Return a² as a sum of two, without rounding but for underflow (Dekker)."""
    square, wide = a * a, _SPLIT * a
    high = wide - (wide - a)
    low = a - high
    return square, ((high * high - square) + 2.0 * high * low) + low * low
