"""Trimming keeps, at each point of an edge, a window that is nearest there."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from geodesic_core.kernels.front.pool import put_window
from geodesic_core.kernels.front.state import FIRST, LAST, SIZE
from geodesic_core.kernels.front.window import B0, B1, NEXT
from geodesic_core.kernels.mesh.half_edges import HEAD, LENGTH, ROW, TAIL
from geodesic_core.kernels.sweep.trim_list import trim_list
from geodesic_core.kernels.sweep.trimming import leaves_gap, trim
from geodesic_core.tolerances import DIVERGING, GAP, LOOSE_OVERLAP, OVERLAP, SLACK
from tests.support import zoo
from tests.support.stepping import flat_view, window

pytestmark = pytest.mark.plain

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


@settings(  # few overlap still
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]
)
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


def put_list(view, wave, h, windows, root):
    slots = [put_window(view, window(*values, root=root)) for values in windows]
    wave.pool.lists[h, [SIZE, FIRST, LAST]] = len(slots), slots[0], slots[-1]
    for slot, after in zip(slots, [*slots[1:], -1], strict=True):
        wave.pool.windows.view(np.int32)[slot, NEXT] = after


def is_trimmed(overlap, difference, scale) -> bool:
    """Of two windows on an edge of length ``scale`` that overlap by a share of it."""
    view, wave, h = flat_view(scale)
    b, source = 0.5 * scale, scale * np.array([(0.1, -1.0, 0.0), (1.0, -1.0, difference)])
    left, right = (0.1 * scale, b + overlap * scale), (b, 0.9 * scale)
    put_list(view, wave, h, [(*left, *source[0]), (*right, *source[1])], 0)
    assert trim_list(view, h) == 2
    ends = wave.pool.scratch[0, B1], wave.pool.scratch[1, B0]
    return ends != (left[1], right[0])


@zoo.each_scale
@pytest.mark.parametrize(("share", "trimmed"), [(0.5, False), (2.0, True)])
def test_overlap_is_the_least_that_is_trimmed(scale, share, trimmed):
    assert is_trimmed(share * OVERLAP, 0.0, scale) == trimmed


@zoo.each_scale
@pytest.mark.parametrize(("share", "trimmed"), [(0.5, False), (2.0, True)])
def test_loose_overlap_is_the_least_that_is_trimmed_of_different_sigma(scale, share, trimmed):
    assert is_trimmed(share * LOOSE_OVERLAP, 1e-3, scale) == trimmed


@zoo.each_scale
@pytest.mark.parametrize(("share", "closed"), [(0.5, True), (2.0, False)])
def test_gap_is_the_most_that_is_closed(scale, share, closed):
    view, wave, h = flat_view(scale)
    b, gap = 0.5 * scale, share * GAP * scale
    source = (0.5 * scale, -scale, 0.0)
    put_list(view, wave, h, [(0.1 * scale, b, *source), (b + gap, 0.9 * scale, *source)], 0)
    assert trim_list(view, h) == 2
    assert (wave.pool.scratch[1, B0] == b) == closed
    assert wave.pool.scratch[1, B0] - b <= gap * (1 + 1e-3)
    # The ray through the closed gap is off by no more than the gap, and so is its length.
    here, there = (math.hypot(x - source[0], source[1]) for x in (b, b + gap))
    assert abs(here - there) <= gap


@zoo.each_scale
@pytest.mark.parametrize(("detour", "kept"), [(-1.0, True), (0.0, True), (0.5, True), (3.0, False)])
@pytest.mark.parametrize("from_tail", [True, False])
def test_slack_keeps_windows_that_tie_with_a_vertex(scale, detour, kept, from_tail):
    """At the far end of the window: against the path through the vertex and along the edge."""
    view, wave, h = flat_view(scale)
    length = view.mesh.geometry[ROW * h + LENGTH]
    tail, head = view.mesh.links[ROW * h + TAIL], view.mesh.links[ROW * h + HEAD]
    wave.vertices.distance[[tail, head]] = 1e6 * scale  # as good as unreached
    wave.vertices.distance[tail if from_tail else head] = scale
    b0, b1 = 0.25 * length, 0.75 * length
    far = b1 if from_tail else length - b0
    straight = (scale + far) + detour * SLACK * scale
    sy = -0.3 * scale
    reach = math.sqrt(straight**2 - sy**2)
    sx = b1 - reach if from_tail else b0 + reach
    put_list(view, wave, h, [(b0, b1, sx, sy, 0.0)], tail)
    assert trim_list(view, h) == kept


@pytest.mark.parametrize(("share", "is_gap"), [(0.5, False), (2.0, True)])
@zoo.each_scale
def test_diverging_is_the_least_angle_between_rays_that_leave_a_gap(share, is_gap, scale):
    left = (0.0, 0.5, 0.5 + share * DIVERGING, -1.0, 0.0, 1.0)
    right = (0.5, 1.0, 0.5, -1.0, 0.0, 1.0)
    both = (window(*(scale * x for x in values)) for values in (left, right))
    assert leaves_gap(*both) == is_gap
