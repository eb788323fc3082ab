"""Several sources, start distances and the limit of distance, approximately."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import ERRORS, MERGING, ROUNDING, check_within, solved

ERROR = 1e-2


@zoo.each(zoo.SMALL)
def test_several_sources_are_the_least_of_each(case):
    mesh, matrix = gc.TriangleMesh(case.vertices, case.faces), expected.matrix(case)
    rng = np.random.default_rng(len(case.faces))
    for count in (3,) if WITHOUT_JIT else (2, 3, 5):
        points = rng.integers(0, len(case.vertices), count)
        starts = rng.uniform(0, 1, count) * rng.integers(0, 2, count)
        sources = [gc.Source(int(s), float(t)) for s, t in zip(points, starts, strict=True)]
        each = matrix[points] + starts[:, None]
        exact = each.min(axis=0)
        field = gc.approximate_distance(mesh, sources, ERROR)
        check_within(field.distances, exact, ERROR)
        reached = np.isfinite(exact)
        assert (field.nearest_source[~reached] == -1).all()
        # The named source is the nearest, or its lead is less than may be told.
        named = each[field.nearest_source[reached], np.flatnonzero(reached)]
        assert (named <= exact[reached] * (1 + ROUNDING) / (1 - ERROR)).all()


def test_start_distances_count_as_distance():
    """A thousandth of a late start is more than the whole mesh, and nothing gets worse."""
    case = MERGING["land"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    exact = gc.exact_distance(mesh, 10).distances + 1e3
    field = gc.approximate_distance(mesh, gc.Source(10, 1e3), 1e-3)
    check_within(field.distances, exact, 1e-3)


def test_ties_go_to_the_lowest_source():
    case = zoo.SMALL["flat_grid"]  # 7 by 6 vertices
    np.testing.assert_array_equal(solved(case, [8, 8]).nearest_source, 0)
    for left, right in ((0, 6), (6, 0), (35, 41)):
        nearest = solved(case, [left, right]).nearest_source.reshape(6, 7)
        assert (nearest[:, 3] == 0).all(), "the middle column is as far from either"


@zoo.each(zoo.SMALL | MERGING)
def test_within_max_distance_the_bounds_hold_and_beyond_it_nothing_is_reached(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    source = len(case.vertices) // 3
    exact = gc.exact_distance(mesh, source).distances
    farthest = exact[np.isfinite(exact)].max()
    for share in (0.4,) if WITHOUT_JIT else (0.0, 0.3, 0.6, 1.1):
        limit = float(share * farthest)
        for error in (ERROR,) if WITHOUT_JIT else ERRORS:
            field = gc.approximate_distance(mesh, source, error, max_distance=limit)
            assert field.max_distance == limit
            found = field.distances
            reached = np.isfinite(found)
            assert (found[reached] <= limit).all()
            assert reached[exact <= limit * (1 - ROUNDING)].all(), "what is near enough is reached"
            check_within(found[reached], exact[reached], error)
            np.testing.assert_array_equal(field.nearest_source, np.where(reached, 0, -1))


def test_start_distances_beyond_the_limit_reach_nothing():
    field = solved(zoo.SMALL["hills"], gc.Source(3, 2.0), max_distance=1.0)
    assert np.isinf(field.distances).all()
    assert (field.nearest_source == -1).all()


@pytest.mark.jit
def test_max_distance_saves_work():
    mesh = gc.TriangleMesh(*zoo.icosphere(4))
    near = gc.approximate_distance(mesh, 0, max_distance=0.2).stats
    assert near.windows_created < 0.05 * gc.approximate_distance(mesh, 0).stats.windows_created
