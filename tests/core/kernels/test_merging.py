"""Each constraint on a merged window (section 4.1) against a naive statement of it."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from geodesic_core.kernels.front.bounds import merging_bounds
from geodesic_core.kernels.front.state import new_wavefront
from geodesic_core.kernels.sweep.merging import (
    accuracy,
    continuity,
    directionality,
    least_sigma,
    merged,
    shortfall,
    visibility,
)
from geodesic_core.kernels.sweep.trimming import leaves_gap
from geodesic_core.tolerances import GRAZING, LOCAL_SHARE, LOWER_BOUND
from tests.support import zoo
from tests.support.stepping import topology_of, view_of_arrays, window

ROUNDING = 1e-9
"""Of lengths of about 1: a few roundings, on a conic that may be close to a line."""
ANYTHING = 1e9
"""An error that permits every merge."""

places = st.floats(-1, 2, allow_subnormal=False)
depths = st.floats(-2, -0.1, allow_subnormal=False)
small = st.floats(-0.3, 0.3, allow_subnormal=False)
splits = st.floats(0.2, 0.8)
overlaps = st.one_of(st.just(0.0), st.floats(0, 0.1))


@cache
def granted(relative: float, absolute: float = math.inf):
    """What kernels see of a sweep that merges within these errors."""
    topology = topology_of(zoo.SMALL["square"])
    bounds = merging_bounds(math.inf, relative, absolute)
    return view_of_arrays(topology, new_wavefront(topology, merges=True), bounds)


def distance(x, sx, sy, sigma):
    return np.hypot(x - sx, sy) + sigma


@st.composite
def neighbours(draw):
    """Two windows on [0, 1] that meet or overlap a little, as long where they meet."""
    sx, sy, split = draw(places), draw(depths), draw(splits)
    tx, ty = sx + draw(small), min(sy + draw(small), -0.05)
    rise = math.hypot(split - sx, sy) - math.hypot(split - tx, ty)
    sigma = draw(st.floats(0, 1))
    start = split - draw(overlaps)
    first = (0.0, split, sx, sy, sigma + max(-rise, 0.0))
    return first, (start, 1.0, tx, ty, sigma + max(rise, 0.0))


def on_the_conic(sigma, d0, d1):
    """The point at d0 - sigma from (0, 0) and d1 - sigma from (1, 0), below; None if there is none.

    By its angle at (0, 0): the law of cosines.
    """
    r0, r1 = d0 - sigma, d1 - sigma
    if r0 <= 0 or r1 <= 0 or r0 + r1 < 1 or abs(r0 - r1) > 1:
        return None
    cosine = (r0 * r0 + 1 - r1 * r1) / (2 * r0)
    return r0 * cosine, -r0 * math.sqrt(max(1 - cosine * cosine, 0.0))


def widens(s, first, second) -> float:
    """By how much the rays of s through both ends lie outside of those of the two windows.

    As a difference of cosines; negative where one lies inside.
    """
    left = s[0] / math.hypot(*s) - first[2] / math.hypot(first[2], first[3])
    right = (1 - s[0]) / math.hypot(1 - s[0], s[1])
    right -= (1 - second[2]) / math.hypot(1 - second[2], second[3])
    return min(left, right)


# One by one -------------------------------------------------------------------------------------


@given(places, depths)
def test_directionality_is_the_square_of_the_height_below_the_edge(x, y):
    assert directionality(x, math.hypot(x, y)) == pytest.approx(y * y, rel=1e-9)


@pytest.mark.parametrize(("along", "reach"), [(2.0, 1.0), (-2.0, 1.0), (1.0, 1.0), (1e-9, 1e-9)])
def test_directionality_refuses_what_is_not_below_the_edge(along, reach):
    assert directionality(along, reach) == -1.0


@given(places, depths, st.floats(0.1, 10))
def test_continuity_is_where_two_circles_meet(x, y, width):
    r0, r1 = math.hypot(x, y), math.hypot(x - width, y)
    assert continuity(width, r0, r1) == pytest.approx(x, abs=1e-11 * (1 + 1 / width))


@given(st.floats(0.2, 3), st.floats(-0.95, 0.95), st.floats(-0.95, 0.95))
def test_visibility_is_where_the_line_toward_the_pseudosource_leaves_the_conic(
    width, cosine, slant
):
    """The point at ``reach`` in this direction has the difference of distances of the conic."""
    difference = slant * width
    spare = (width - difference) * (width + difference)
    reach = visibility(cosine, width, difference, spare)
    if math.isinf(reach):
        # The line never meets the conic: at any reach the difference stays below that.
        reaches = np.geomspace(1e-3, 1e3, 50) * width
        sine = math.sqrt(1 - cosine * cosine)
        other = np.hypot(reaches * cosine - width, reaches * sine)
        assert (reaches - other <= difference + 1e-12 * reaches).all()
        return
    other = math.hypot(reach * cosine - width, reach * math.sqrt(1 - cosine * cosine))
    assert reach - other == pytest.approx(difference, abs=1e-9 * (width + reach))


@given(neighbours())
@example(((0.0, 0.5, 0.5, -1.0, 0.0), (0.5, 1.0, 0.5, -1.0, 0.0)))
def test_least_sigma_is_the_least_that_keeps_both_windows_in_view(pair):
    first, second = pair
    d0, d1 = distance(0.0, *first[2:]), distance(1.0, *second[2:])
    difference = d0 - d1
    spare = 1 - difference * difference
    assume(spare > 1e-6)
    sigma = least_sigma(
        d0,
        d1,
        visibility(first[2] / math.hypot(first[2], first[3]), 1.0, difference, spare),
        visibility((1 - second[2]) / math.hypot(1 - second[2], second[3]), 1.0, -difference, spare),
    )
    at_sigma = on_the_conic(sigma, d0, d1)
    if at_sigma is not None and at_sigma[1] < -1e-6:
        assert widens(at_sigma, first, second) >= -ROUNDING
    for less in np.linspace(0, sigma, 60)[:-1]:
        s = on_the_conic(less, d0, d1)
        if s is not None and sigma - less > 1e-3:
            assert widens(s, first, second) < ROUNDING


@given(places, depths, places, depths, st.floats(0, 1), splits)
def test_shortfall_is_the_most_between_the_ends(nx, ny, sx, sy, sigma, hi):
    assume(abs(ny - sy) > 1e-3)
    x = np.linspace(0, hi, 2001)
    falls = distance(x, sx, sy, sigma) - distance(x, nx, ny, 0.1)
    found = shortfall(window(0.0, hi, sx, sy, sigma), window(0.0, 1.0, nx, ny, 0.1))
    most, least = falls[1:-1].max(), falls[1:-1].min()
    ends = max(falls[0], falls[-1])
    if most > ends + 1e-6:
        assert found == pytest.approx(most, abs=1e-5)
    elif least < min(falls[0], falls[-1]) - 1e-6:
        assert found == pytest.approx(least, abs=1e-5)
    assert max(found, ends) >= most - 1e-12


@pytest.mark.parametrize("nearest", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("relative", "absolute"), [(1e-3, math.inf), (1e-2, 1e-4), (0.5, 1e9)])
def test_local_share_is_all_that_one_merge_may_use_up(relative, absolute, nearest):
    view, allowed = granted(relative, absolute), min(relative * nearest, absolute)
    assert accuracy(view, 0.999 * allowed, 0.0, nearest)
    assert not accuracy(view, 1.001 * allowed, 0.0, nearest)
    assert accuracy(view, 0.0, 0.999 * LOCAL_SHARE * allowed, nearest)
    assert not accuracy(view, 0.0, 1.001 * LOCAL_SHARE * allowed, nearest)


# All together -----------------------------------------------------------------------------------


def merge(pair, error, xi0=0.0, xi1=0.0):
    can, whole = merged(granted(error), window(*pair[0], xi0), window(*pair[1], xi1))
    assert not can or (whole.b0, whole.b1) == (pair[0][0], pair[1][1])
    return can, whole.sx, whole.sy, whole.sigma, whole.xi


@given(neighbours(), st.sampled_from([ANYTHING, 0.5, 1e-2]), st.floats(0, 1e-3), st.floats(0, 1e-3))
def test_what_is_merged_keeps_every_promise(pair, error, xi0, xi1):
    can, sx, sy, sigma, xi = merge(pair, error, xi0, xi1)
    assume(can)
    first, second = pair
    assert sy < 0
    assert sigma >= 0
    for end, old in ((0.0, first), (1.0, second)):
        # Where the conic is close to a line, half of the digits of s' are lost, not of distances.
        assert distance(end, sx, sy, sigma) == pytest.approx(distance(end, *old[2:]), rel=1e-9)
    fall = 0.0
    for old, known in ((first, xi0), (second, xi1)):
        x = np.linspace(*old[:2], 401)
        falls = distance(x, *old[2:]) - distance(x, sx, sy, sigma)
        assert falls.min() >= -ROUNDING
        assert (falls + known <= xi + ROUNDING).all()
        fall = max(fall, falls.max())
    nearest = distance(np.linspace(0, 1, 401), sx, sy, sigma).min()
    assert xi <= error * nearest + ROUNDING
    assert fall <= LOCAL_SHARE * error * nearest + ROUNDING
    # No higher than needed: one window attains the error.
    assert xi <= max(xi0, xi1) + fall + 1e-4


@given(neighbours())
def test_the_outermost_rays_stay_in_view(pair):
    can, sx, sy, _, _ = merge(pair, ANYTHING)
    assume(can)
    first, second = pair
    for height in (0.01, 0.3, 1.0, 10.0):
        slack = 1e-6 * (1 + height * (1 + abs(sx)) / abs(sy) ** 2)

        def at(end, x, y, height=height):
            return end + (end - x) * height / -y

        assert at(0.0, sx, sy) <= at(0.0, *first[2:4]) + slack
        assert at(1.0, sx, sy) >= at(1.0, *second[2:4]) - slack


def least_in_view(first, second):
    """The least sigma whose point of the conic has both windows in view, below the edge; or None.

    By a scan, and halving: how far a point moves is not bounded by the change of its sigma.
    """
    d0, d1 = distance(0.0, *first[2:]), distance(1.0, *second[2:])

    def sees(sigma):
        s = on_the_conic(sigma, d0, d1)
        return s is not None and s[1] < 0.0 and widens(s, first, second) >= 0.0

    scan = np.linspace(0.0, min(d0, d1), 401)[:-1].tolist()
    seeing = next((i for i, sigma in enumerate(scan) if sees(sigma)), None)
    if not seeing:
        return None if seeing is None else (0.0, on_the_conic(0.0, d0, d1))
    less, sigma = scan[seeing - 1 : seeing + 1]
    for _ in range(60):
        middle = (less + sigma) / 2
        less, sigma = (less, middle) if sees(middle) else (middle, sigma)
    return sigma, on_the_conic(sigma, d0, d1)


@given(neighbours())
@example(((0.0, 0.5, 0.5, -0.25, 7.450580485901526e-09), (0.5, 1.0, 0.49993896484375, -0.25, 0.0)))
@example(((0.0, 0.3125, 0.375, -0.25, 1.0), (0.3125, 1.0, 0.25, -0.05, 1.1776550486331931)))
@example(((0.0, 0.5, 0.5, -0.125, 0.15450849718747373), (0.5, 1.0, 0.375, -0.25, 0.0)))
def test_where_merging_is_refused_no_pseudosource_would_do(pair):
    """By a scan of the conic: the first in view, if any, is above the windows where they meet."""
    assume(not merge(pair, ANYTHING)[0])
    first, second = pair
    least = least_in_view(first, second)
    if least is None or least[1][1] > -1e-3:
        return
    sigma, s = least
    above = max(
        distance(x, *s, sigma) - distance(x, *old[2:])
        for x, old in ((first[1], first), (second[0], second))
    )
    assert above > -ROUNDING


@given(places, depths, st.floats(0, 1), splits)
def test_two_halves_of_a_window_make_it_whole_again(sx, sy, sigma, split):
    """The line of an outermost ray meets the conic in the old pseudosource itself, or in none."""
    pair = (0.0, split, sx, sy, sigma), (split, 1.0, sx, sy, sigma)
    can, nx, ny, n_sigma, xi = merge(pair, 1e-6)
    assert can
    x = np.linspace(0, 1, 101)
    np.testing.assert_allclose(distance(x, nx, ny, n_sigma), distance(x, sx, sy, sigma), rtol=1e-7)
    assert xi <= 1e-6


@given(neighbours(), st.sampled_from([1e-9, 1e9]))
def test_merging_scales(pair, scale):
    can, *found = merge(pair, 0.5)
    can_scaled, *scaled = merge([[scale * x for x in ends] for ends in pair], 0.5)
    if can and can_scaled:
        assert scaled[:3] == pytest.approx(
            [scale * x for x in found[:3]], rel=1e-5, abs=1e-9 * scale
        )


def test_nothing_is_merged_where_the_error_is_used_up():
    pair = (0.0, 0.5, 0.5, -1.0, 0.0), (0.5, 1.0, 0.5, -1.0, 0.0)
    assert merge(pair, 1e-3)[0]
    assert not merge(pair, 1e-3, xi0=2e-3)[0]
    assert not merge(pair, 1e-3, xi1=2e-3)[0]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((0.0, 0.5, -1.0, 0.0, 0.0), (0.5, 1.0, -1.0, 0.0, 0.0)),  # on the edge's own line
        ((0.0, 0.5, 0.0, 0.0, 0.5), (0.5, 1.0, 0.5, -1.0, 0.0)),  # at an end
        ((0.0, 0.5, 0.5, -1.0, 0.0), (0.5, 1.0, 1.0, 0.0, 0.0)),
        ((0.0, 0.5, 0.5, -1.0, 0.0), (0.5, 1.0, 0.5, -1.0, 3.0)),  # too far apart for any conic
        ((0.0, 0.5, 0.9, -0.1, 0.0), (0.5, 1.0, 0.1, -0.1, 0.0)),  # rays cross above the edge
    ],
)
def test_what_cannot_be_merged_is_refused(first, second):
    assert not merge((first, second), ANYTHING)[0]


# Gaps between windows ---------------------------------------------------------------------------


def diverge(p, c) -> bool:
    """Whether the ray of p through its right end and that of c through its left one part."""
    return (p[1] - p[2]) / -p[3] < (c[0] - c[2]) / -c[3]


@given(neighbours(), small, st.floats(0, 0.2), st.floats(0, 0.2), st.booleans())
def test_a_gap_is_a_wedge_that_either_window_may_be_nearest_to(pair, late, xi0, xi1, swapped):
    first, second = pair
    split = first[1]
    p, c = first, (split, *second[1:4], second[4] + max(late, 0.0))
    at_p, at_c = distance(split, *p[2:]), distance(split, *c[2:])
    lean = (p[1] - p[2]) / -p[3] - (c[0] - c[2]) / -c[3]
    assume(abs(lean) > 1e-6)
    assume(abs(at_p - at_c - xi1) > 1e-9 and abs(at_c - at_p - xi0) > 1e-9)
    wanted = diverge(p, c) and _either_may_be_nearest(at_p, xi0, at_c, xi1)
    windows = window(*p, xi0), window(*c, xi1)
    assert leaves_gap(*(windows[::-1] if swapped else windows)) == wanted


def _either_may_be_nearest(at_p, xi_p, at_c, xi_c) -> bool:
    """The true distances lie in [at, at + ξ]: whether these intervals have a point in common."""
    return max(at_p, at_c) <= min(at_p + xi_p, at_c + xi_c)


@pytest.mark.parametrize(
    ("p", "c"),
    [
        ((0.0, 0.4, 0.9, -1.0), (0.5, 1.0, 0.1, -1.0)),  # apart
        ((0.0, 0.6, 0.9, -1.0), (0.5, 1.0, 0.1, -1.0)),  # overlapping
        ((0.5, 0.5, 0.9, -1.0), (0.5, 1.0, 0.1, -1.0)),  # nothing left of one
        ((0.0, 0.5, 0.9, -1.0), (0.5, 0.5, 0.1, -1.0)),
    ],
)
def test_there_is_no_gap_where_windows_do_not_meet(p, c):
    assert not leaves_gap(window(*p, 0.0, xi=1.0), window(*c, 0.0, xi=1.0))
    first, second = (0.0, 0.5, *p[2:], 0.0), (0.5, 1.0, *c[2:], 0.0)
    assert leaves_gap(window(*first, xi=1.0), window(*second, xi=1.0))


@pytest.mark.parametrize("reach", [1e-9, 1.0, 1e9])
def test_grazing_is_the_least_angle_of_a_merged_pseudosource(reach):
    for share, taken in ((0.99, False), (1.01, True)):
        angle = math.asin(share * GRAZING)
        for along in (math.cos(angle), -math.cos(angle)):
            assert (directionality(along * reach, reach) > 0.0) == taken


@pytest.mark.slow
@settings(  # most cannot be merged
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]
)
@given(
    st.floats(-2, 3), st.floats(-3, -0.01), st.floats(-2, 3), st.floats(-3, -0.01), st.floats(0, 1)
)
@pytest.mark.jit
def test_lower_bound_is_all_that_a_merged_window_rises_by(s0x, s0y, s1x, s1y, joint):
    b = 0.2 + 0.6 * joint
    # Both windows give the same distance where they meet
    gap = math.hypot(s0x - b, s0y) - math.hypot(s1x - b, s1y)
    sigma0, sigma1 = max(-gap, 0.0), max(gap, 0.0)
    first, second = (0.0, b, s0x, s0y, sigma0), (b, 1.0, s1x, s1y, sigma1)
    can, whole = merged(granted(0.5), window(*first), window(*second))
    assume(can)
    sx, sy, sigma, xi = whole.sx, whole.sy, whole.sigma, whole.xi
    assert sy < 0
    assert sigma >= 0
    for b0, b1, x, y, weight in (first, second):
        places = np.linspace(b0, b1, 101)
        before = np.hypot(places - x, y) + weight
        after = np.hypot(places - sx, sy) + sigma
        assert (after <= before * (1 + 100 * LOWER_BOUND)).all()
        assert (before - after <= xi + 1e-12).all()
