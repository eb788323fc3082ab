"""Plane geometry against complex numbers and bisection."""

import cmath
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from geodesic_core.kernels.front.window import reaches
from geodesic_core.kernels.planar import bisector, hit_left
from tests.support.stepping import window

shares = st.floats(0, 1)
positions = st.floats(-3, 3)
depths = st.floats(-3, 0)
weights = st.floats(0, 3)


def cross(a: complex, b: complex) -> float:
    return a.real * b.imag - a.imag * b.real


@given(shares, positions, st.floats(-3, -1e-3), st.floats(0.01, 3.13), st.floats(0.01, 3))
def test_hit_left_meets_the_ray_or_stops_at_the_apex(b, sx, sy, angle, length):
    edge = cmath.rect(1, angle)
    source = complex(sx, sy)
    in_edge_frame = (source / edge).imag
    assume(in_edge_frame < 0)  # the source sees the edge through the face
    found = hit_left(b, sy, in_edge_frame, edge.imag, length)
    assert 0 <= found <= length
    ray, apex = b - source, length * edge - source
    if found < length:
        hit = found * edge - source
        assert abs(cross(ray, hit)) <= 1e-12 * abs(ray) * (abs(hit) + 1)
    else:  # the ray passes the apex on its right
        assert cross(apex, ray) <= 1e-9 * abs(ray) * abs(apex)


def test_hit_left_of_a_ray_through_the_tail_is_the_tail():
    assert hit_left(0.0, -1.0, -1.0, 0.6, 2.0) == 0.0


def test_hit_left_of_a_ray_that_never_meets_the_edge_is_the_apex():
    """A ray to the right of the edge's own direction, or along it."""
    assert hit_left(1.0, -1.0, -0.5, 0.8, 2.0) == 2.0
    assert hit_left(0.5, -1.0, -0.5, 1.0, 2.0) == 2.0


def bisected(lead, a, b):
    """The sign change of a function, to the last bit."""
    below = lead(a) > 0
    while (middle := (a + b) / 2) not in (a, b):
        if (lead(middle) > 0) == below:
            a = middle
        else:
            b = middle
    return a


@given(positions, depths, positions, depths, shares)
def test_bisector_is_where_bisection_finds_it(s0x, s0y, s1x, s1y, crossing):
    """The second weight is chosen so that there is a crossing, mostly."""
    sigma1 = math.hypot(crossing - s0x, s0y) - math.hypot(crossing - s1x, s1y)

    def lead(x):
        return math.hypot(x - s1x, s1y) + sigma1 - math.hypot(x - s0x, s0y)

    lo, hi = 0.0, 1.0
    assume((lead(lo) > 0) != (lead(hi) > 0))
    found = bisector(lo, hi, s0x, s0y, 0.0, s1x, s1y, sigma1)
    assert lo <= found <= hi
    # Where both sources lie on the edge's own line the root is double, and has half the digits.
    digits_lost = max(s0y, s1y) > -1e-2
    assert abs(lead(found)) <= (1e-7 if digits_lost else 1e-10)
    # At a flat crossing the place is ill-defined, but not the distance.
    assert abs(found - bisected(lead, lo, hi)) <= 1e-7 or abs(lead(found)) <= 1e-7


@pytest.mark.parametrize("swapped", [False, True])
def test_bisector_tells_the_branches_of_the_hyperbola_apart(swapped):
    """Squaring adds the points where the lead has the other sign, and one of them is in reach."""
    s0, s1 = (0.5, -0.3, 1.0), (1.5, -1.1, 0.0)
    if swapped:
        s0, s1 = s1, s0
    found = bisector(0.0, 1.0, *s0, *s1)
    at_s0, at_s1 = (math.hypot(found - x, y) + sigma for x, y, sigma in (s0, s1))
    assert at_s1 == pytest.approx(at_s0, rel=1e-12)


@pytest.mark.parametrize("weight", [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8])
def test_bisector_of_nearly_equal_weights(weight):
    """The quadratic is nothing but rounding there; the bisector is the straight one, nearly."""
    s0, s1 = (0.1, -0.7), (1.2, -1.1)
    straight = (s1[0] ** 2 + s1[1] ** 2 - s0[0] ** 2 - s0[1] ** 2) / (2 * (s1[0] - s0[0]))
    for sign in (1, -1):
        found = bisector(0.0, 2.0, *s0, 0.0, *s1, sign * weight)
        assert found == pytest.approx(straight, abs=10 * weight + 1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_bisector_scales(scale):
    unit = (0.0, 1.0, 0.2, -0.5, 0.3, 0.9, -0.8, 0.1)
    scaled = bisector(*(scale * x for x in unit))
    assert scaled == pytest.approx(scale * bisector(*unit), rel=1e-13)


@given(shares, shares, positions, depths, weights, weights)
def test_reaches_is_about_the_least_distance(u, v, sx, sy, sigma, limit):
    b0, b1 = min(u, v), max(u, v)
    nearest = math.hypot(min(max(sx, b0), b1) - sx, sy) + sigma
    assume(abs(nearest - limit) > 1e-9)
    assert reaches(window(b0, b1, sx, sy, sigma), limit) == (nearest < limit)
