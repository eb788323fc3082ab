"""Plane geometry against complex numbers and bisection."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from geodesic_core.kernels.front.window import reaches
from geodesic_core.kernels.planar import Source, bisector, bracketed, distance, hit_left
from geodesic_core.tolerances import DOUBLE_ROOT, FALSE_POSITION_STEPS, HALF_ULP
from tests.support import zoo
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


@zoo.each_scale
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


@pytest.mark.parametrize("delta", [0.0, *np.geomspace(1e-18, 1e-3, 31)])
@pytest.mark.parametrize("sign", [1, -1])
def test_double_root_leaves_the_bisector_its_digits(delta, sign):
    """Whichever way it is found, on both sides of the bound; nearly the straight bisector."""
    s0, s1 = (0.1, -0.7), (1.2, -1.1)
    straight = (s1[0] ** 2 + s1[1] ** 2 - s0[0] ** 2 - s0[1] ** 2) / (2 * (s1[0] - s0[0]))
    x = bisector(0.0, 2.0, *s0, 0.0, *s1, sign * delta)
    lead = math.hypot(x - s1[0], s1[1]) + sign * delta - math.hypot(x - s0[0], s0[1])
    assert abs(lead) <= 1e-16 / DOUBLE_ROOT
    assert abs(x - straight) <= 2 * delta + 1e-16 / DOUBLE_ROOT


@pytest.mark.parametrize("seed", range(20))
def test_half_ulp_and_false_position_steps_are_enough_for_any_bisector(seed):
    """Of a parallel window, too: the lead that is left is a few roundings of the distances."""
    x0, y0, x1, y1, angle, crossing = np.random.default_rng(seed).uniform(0.05, 1.0, 6)
    for s0 in (Source(x0, -y0, 1.0), Source(math.cos(angle), -math.sin(angle), 0.0)):
        s1 = Source(-x1, -y1, 1.0)
        delta = distance(crossing, *s0) - distance(crossing, *s1)
        ends = [distance(x, *s1) + delta - distance(x, *s0) for x in (0.0, 1.0)]
        if ends[0] * ends[1] < 0.0:
            x = bracketed(0.0, 1.0, s0, s1, delta)
            r0, r1 = distance(x, *s0), distance(x, *s1)
            assert abs(r1 + delta - r0) <= 8 * HALF_ULP * (abs(r0) + abs(r1) + abs(delta))


def test_false_position_steps_are_more_than_bisection_would_need():
    assert math.log2(1.0 / HALF_ULP) < FALSE_POSITION_STEPS
