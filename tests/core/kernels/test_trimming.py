"""Trimming keeps, at each point of an edge, a window that is nearest there."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from geodesic_core.kernels.sweep.trimming import trim
from tests.support.stepping import window

ALONG_THE_LINE = 2e-7
"""Where both sources lie on the edge's own line the bisector has half the digits."""

SAMPLES = np.linspace(0.0, 1.0, 801)

positions = st.floats(-3, 3, allow_subnormal=False)
depths = st.floats(-3, 0, allow_subnormal=False)
weights = st.one_of(st.just(0.0), st.floats(0, 3, allow_subnormal=False))
ends = st.one_of(st.sampled_from([0.0, 0.25, 1.0]), st.floats(0, 1, allow_subnormal=False))


@st.composite
def windows(draw):
    b0, b1 = sorted((draw(ends), draw(ends)))
    return b0, b1, draw(positions), draw(depths), draw(weights)


def naive(x, values):
    """Distance by a window where it covers x, else infinity."""
    b0, b1, sx, sy, sigma = values
    return np.where((b0 <= x) & (x <= b1), np.hypot(x - sx, sy) + sigma, math.inf)


LEAST = 1e-14
"""Every wider overlap is trimmed here."""


def trimmed(p, c):
    left = trim(window(*p), window(*c), LEAST, LEAST)
    assert [each[2:] for each in left] == [window(*p)[2:], window(*c)[2:]]
    return tuple(each[:5] for each in left)


def is_empty(values) -> bool:
    return values[1] <= values[0]


@given(windows(), windows())
@example((0.0, 1.0, 0.5, -1.0, 0.0), (0.0, 1.0, 0.5, -1.0, 0.0))
@example((0.0, 1.0, 0.5, -1.0, 1.0), (0.25, 0.75, 0.5, -0.1, 1.5))
@example((0.0, 1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 1.0, 0.0, 0.0))
@example((0.0, 1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 1.0, 0.0, 0.5))
def test_nothing_nearest_is_lost(p, c):
    p_left, c_left = trimmed(p, c)
    for before, after in ((p, p_left), (c, c_left)):
        assert before[0] <= after[0]
        assert after[1] <= before[1]
    kept = [values for values in (p_left, c_left) if not is_empty(values)]
    places = np.concatenate([SAMPLES, [p[0], p[1], c[0], c[1]]])
    wanted = np.minimum(naive(places, p), naive(places, c))
    if p[0] == p[1] or c[0] == c[1]:
        return  # without width there is nothing to keep
    found = np.min([naive(places, values) for values in kept], axis=0)
    asked = np.isfinite(wanted)
    assert (found[asked] <= wanted[asked] * (1 + 1e-12) + ALONG_THE_LINE).all()


@settings(suppress_health_check=[HealthCheck.filter_too_much])  # few overlap still
@given(windows(), windows())
def test_what_overlaps_still_could_not_be_cut(p, c):
    """Whoever loses at an end of the overlap goes on beyond it: to cut would leave two pieces."""
    p_left, c_left = trimmed(p, c)
    lo, hi = max(p_left[0], c_left[0]), min(p_left[1], c_left[1])
    assume(hi - lo > 1e-9)
    places = np.linspace(lo, hi, 401)
    leads = naive(places, c_left) - naive(places, p_left)  # of p
    (_, at_lo), (_, at_hi) = (_by_rank(p_left, c_left, leads[i]) for i in (0, -1))
    assume(at_lo != at_hi or np.ptp(np.sign(leads)) < 2)  # else beaten at both ends alone
    assert at_lo[0] < lo or abs(leads[0]) < ALONG_THE_LINE
    assert at_hi[1] > hi or abs(leads[-1]) < ALONG_THE_LINE


def _by_rank(p, c, lead):
    """The winner and the loser, by the lead of p."""
    return (p, c) if lead >= 0 else (c, p)


@given(windows(), windows())
def test_trimming_again_changes_little(p, c):
    once = trimmed(p, c)
    twice = trimmed(*once)
    for a, b in zip(once, twice, strict=True):
        if not is_empty(a):
            assert b[:2] == pytest.approx(a[:2], abs=1e-7)


@given(windows())
def test_of_equal_windows_the_first_stays(p):
    p_left, c_left = trimmed(p, p)
    assert p_left == p
    assert is_empty(c_left) or p[1] - p[0] <= LEAST


@given(windows(), windows())
def test_windows_apart_are_left_alone(p, c):
    if max(p[0], c[0]) >= min(p[1], c[1]):
        assert trimmed(p, c) == (p, c)


@pytest.mark.parametrize("weight", [0.0, 0.1])
@pytest.mark.parametrize("first_wins_below", [True, False])
def test_one_boundary_for_both(weight, first_wins_below):
    """Neither gap nor overlap where two windows are cut at their bisector."""
    left, right = (0.0, 1.0, 0.2, -0.5, weight), (0.0, 1.0, 0.8, -0.5, 0.05)
    pair = (left, right) if first_wins_below else (right, left)
    a, b = sorted(trimmed(*pair))
    assert a[1] == b[0]
    assert a[0] == 0.0
    assert b[1] == 1.0
