"""The function on the edges of a certificate: the least of the cones over each edge."""

import numpy as np
import pytest

from geodesic_core.kernels.certificates.edge_functions import CONE, with_pieces
from geodesic_core.tolerances import NARROW

pytestmark = pytest.mark.plain


def value_of(cones, x):
    """Cones (N, 5) at x, infinite beyond their ends."""
    foot, height, sigma, low, high = cones.T
    away = sigma + np.hypot(x - foot, height)
    return np.where((low <= x) & (x <= high), away, np.inf)


def cones_over(length, rng, count):
    """Cones of both ends of an edge, and windows."""
    cones = np.zeros((count + 2, CONE))
    cones[:, 4] = length
    cones[1, 0] = length
    cones[:2, 2] = rng.uniform(1.0, 1.0 + length, 2)
    cones[2:, 0] = rng.uniform(-length, 2.0 * length, count)
    cones[2:, 1] = rng.uniform(0.0, 2.0, count)
    cones[2:, 2] = rng.uniform(0.0, 1.0, count)
    cones[2:, 3:] = np.sort(rng.uniform(0.0, length, (count, 2)), axis=1)
    return cones


def envelope(cones, length=1.0):
    """Pieces of an edge: cones, and between which shares of it."""
    rows, count = with_pieces(cones, length, np.empty((1, CONE)), 0)
    return rows[:count]


@pytest.mark.parametrize("seed", range(60))
def test_pieces_are_the_least_of_all_cones(seed):
    rng = np.random.default_rng(seed)
    length = rng.uniform(0.1, 3.0)
    cones = cones_over(length, rng, int(rng.integers(0, 9)))
    pieces = envelope(cones, length)
    assert pieces[0, 3] == 0.0
    assert pieces[-1, 4] == 1.0
    assert (pieces[1:, 3] == pieces[:-1, 4]).all()
    assert (pieces[:, 3] <= pieces[:, 4]).all()
    for x in rng.uniform(0.0, length, 200):
        foot, height, sigma, *_ = pieces[np.searchsorted(pieces[:, 4], x / length)]
        least = value_of(cones, x).min()
        assert sigma + np.hypot(x - foot, height) == pytest.approx(least, abs=1e-12)


def test_pieces_are_appended_to_those_of_other_edges():
    rows, count = np.zeros((1, CONE)), 0
    for seed in range(3):
        cones = cones_over(1.0, np.random.default_rng(seed), 5)
        before = count
        rows, count = with_pieces(cones, 1.0, rows, before)
        assert (rows[before:count] == envelope(cones)).all()


@pytest.mark.parametrize(("gap", "is_closed"), [(0.1 * NARROW, True), (10.0 * NARROW, False)])
def test_narrow(gap, is_closed):
    """Two windows of one source nearly meet; between them the end of the edge would be nearest."""
    near = [2.0, 1.0, 0.5]
    ends = [[0.0, 0.0, 4.0, 0.0, 1.0], [1.0, 0.0, 4.0, 0.0, 1.0]]
    windows = [[*near, 0.0, 0.4], [*near, 0.4 + gap, 1.0]]
    cones = np.array([*ends, *windows])
    pieces = envelope(cones)
    assert len(pieces) == (2 if is_closed else 3)
    assert (0.0 not in pieces[:, 0]) is is_closed


def test_gaps_in_which_two_others_are_nearest():
    """As in the middle between both ends of an edge."""
    near = [0.5, 1.0, 0.5]
    ends = [[0.0, 0.0, 4.0, 0.0, 1.0], [1.0, 0.0, 4.0, 0.0, 1.0]]
    gap = 0.1 * NARROW
    windows = [[*near, 0.0, 0.5 - gap], [*near, 0.5 + gap, 1.0]]
    pieces = envelope(np.array([*ends, *windows]))
    assert pieces[:, :3].tolist() == [near, near]


@pytest.mark.parametrize("nearer", [1e-3, 1e-6, 1e-9, 1e-12])
def test_an_end_that_is_hardly_nearer_by_itself(nearer):
    """The way along the edge is longer by this: the end is nearest in half of it."""
    ends = np.array([[0.0, 0.0, 4.0, 0.0, 1.0], [1.0, 0.0, 5.0 - nearer, 0.0, 1.0]])
    for cones in (ends, ends[::-1]):
        pieces = envelope(cones)
        assert pieces[:, 0].tolist() == [0.0, 1.0]
        assert pieces[1, 3] == pytest.approx(1.0 - 0.5 * nearer, rel=0, abs=2e-15)
