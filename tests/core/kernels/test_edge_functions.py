"""The function on the edges of a certificate: the least of the cones over each edge."""

import numpy as np
import pytest

from geodesic_core.kernels.certificates.edge_functions import CONE, edge_function
from geodesic_core.tolerances import NARROW


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


@pytest.mark.parametrize("seed", range(20))
def test_pieces_are_the_least_of_all_cones(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.1, 3.0, 6)
    groups = [cones_over(length, rng, int(rng.integers(0, 9))) for length in lengths]
    first = np.concatenate([[0], np.cumsum([len(group) for group in groups])])
    cones = np.concatenate(groups)
    counts, which, ends = edge_function(first, cones, lengths)
    start = np.concatenate([[0], np.cumsum(counts)])
    for e, length in enumerate(lengths):
        pieces = np.arange(start[e], start[e + 1])
        assert ends[pieces[-1]] == length
        assert (np.diff(ends[pieces]) >= 0.0).all()
        assert ((first[e] <= which[pieces]) & (which[pieces] < first[e + 1])).all()
        for x in rng.uniform(0.0, length, 200):
            k = pieces[np.searchsorted(ends[pieces], x)]
            foot, height, sigma = cones[which[k], :3]
            least = value_of(groups[e], x).min()
            assert sigma + np.hypot(x - foot, height) == pytest.approx(least, abs=1e-12)


def test_an_edge_without_cones_has_no_pieces():
    counts, which, ends = edge_function(np.zeros(3, np.int64), np.empty((0, CONE)), np.ones(2))
    assert counts.tolist() == [0, 0]
    assert len(which) == len(ends) == 0


@pytest.mark.parametrize(("gap", "is_closed"), [(0.1 * NARROW, True), (10.0 * NARROW, False)])
def test_narrow(gap, is_closed):
    """Two windows of one source nearly meet; between them the end of the edge would be nearest."""
    near = [2.0, 1.0, 0.5]
    ends = [[0.0, 0.0, 4.0, 0.0, 1.0], [1.0, 0.0, 4.0, 0.0, 1.0]]
    windows = [[*near, 0.0, 0.4], [*near, 0.4 + gap, 1.0]]
    cones = np.array([*ends, *windows])
    counts, which, _ = edge_function(np.array([0, 4]), cones, np.ones(1))
    assert counts.tolist() == ([2] if is_closed else [3])
    assert (0 not in which) is is_closed


def test_gaps_in_which_two_others_are_nearest():
    """As in the middle between both ends of an edge."""
    near = [0.5, 1.0, 0.5]
    ends = [[0.0, 0.0, 4.0, 0.0, 1.0], [1.0, 0.0, 4.0, 0.0, 1.0]]
    gap = 0.1 * NARROW
    windows = [[*near, 0.0, 0.5 - gap], [*near, 0.5 + gap, 1.0]]
    counts, which, _ = edge_function(np.array([0, 4]), np.array([*ends, *windows]), np.ones(1))
    assert counts.tolist() == [2]
    assert which.tolist() == [2, 3]
