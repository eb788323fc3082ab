"""Several sources, start distances, ties, and the limit of distance."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.front.relaxation import precedence
from geodesic_core.tolerances import TIE
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import (
    GRANTED,
    MERGING,
    check_limited,
    check_within,
    each_error,
    solve,
)
from tests.support.meshes import mesh_of

SMALL_AND_MERGING = zoo.SMALL | MERGING


@each_error
@pytest.mark.jit
def test_sources_in_every_spelling(error):
    mesh = mesh_of(zoo.SMALL["torus"])
    plain = solve(mesh, 5, error)
    for source in (
        np.int64(5), np.uint8(5), gc.SurfacePoint.vertex(5), gc.Source(5), [5], (5,), np.array([5]),
        gc.Source(gc.SurfacePoint.vertex(5)), [gc.Source(5, 0.0)], [gc.SurfacePoint.vertex(5)],
    ):  # fmt: skip
        field = solve(mesh, source, error)
        np.testing.assert_array_equal(field.distances, plain.distances)
    mixed = solve(mesh, [5, gc.SurfacePoint.vertex(9), gc.Source(20, 0.5)], error)
    assert [source.start_distance for source in mixed.sources] == [0.0, 0.0, 0.5]


@each_error
def test_ties_go_to_the_lowest_source(error):
    mesh = mesh_of(zoo.SMALL["flat_grid"])  # 7 by 6 vertices
    np.testing.assert_array_equal(solve(mesh, [8, 8], error).nearest_source, 0)
    for left, right in ((0, 6), (6, 0), (35, 41)):
        nearest = solve(mesh, [left, right], error).nearest_source.reshape(6, 7)
        assert (nearest[:, 3] == 0).all(), "the middle column is as far from either"


@each_error
@pytest.mark.jit
def test_a_source_behind_another_is_not_nearest_even_to_itself(error):
    case = zoo.SMALL["hills"]
    row = expected.matrix(case)[3]
    field = solve(mesh_of(case), [gc.Source(3), gc.Source(40, float(row[40]) + 1)], error)
    check_within(field.distances, row, error)
    np.testing.assert_array_equal(field.nearest_source, 0)


@each_error
@pytest.mark.jit
def test_start_distances_shift_the_field(error):
    """A share of a late start may be more than the whole mesh, and nothing gets worse."""
    small, land = zoo.SMALL["crags"], MERGING["land"]
    on_land = gc.exact_distance(mesh_of(land), 10).distances
    for case, exact in ((small, expected.matrix(small)[10]), (land, on_land)):
        field = solve(mesh_of(case), gc.Source(10, 1e3), error)
        check_within(field.distances, exact + 1e3, error)


@each_error
def test_start_distances_beyond_the_limit_reach_nothing(error):
    mesh = mesh_of(zoo.SMALL["hills"])
    field = solve(mesh, gc.Source(3, 2.0), error, max_distance=1.0)
    assert np.isinf(field.distances).all()
    assert (field.nearest_source == -1).all()


@pytest.mark.slice(len(SMALL_AND_MERGING))
@zoo.each(SMALL_AND_MERGING)
def test_within_max_distance_the_bounds_hold_and_beyond_it_nothing_is_reached(case):
    mesh = mesh_of(case)
    source = len(case.vertices) // 3
    exact = gc.exact_distance(mesh, source).distances
    farthest = exact[np.isfinite(exact)].max()
    for share in (0.4,) if WITHOUT_JIT else (0.0, 0.3, 0.6, 1.1):
        limit = float(share * farthest)
        for error in GRANTED:
            field = solve(mesh, source, error, max_distance=limit)
            check_limited(field, exact, limit, error)
            assert (field.nearest_source[np.isfinite(field.distances)] == 0).all()


@zoo.each(SMALL_AND_MERGING)
def test_within_max_distance_exact_distances_stay_as_they_are(case):
    mesh = mesh_of(case)
    source = len(case.vertices) // 3
    full = gc.exact_distance(mesh, source)
    reached = full.distances[np.isfinite(full.distances)]
    for limit in (0.0, 0.3 * reached.max(), float(np.median(reached)), 2 * reached.max() + 1):
        field = gc.exact_distance(mesh, source, max_distance=limit)
        within = full.distances <= limit
        np.testing.assert_array_equal(field.distances, np.where(within, full.distances, np.inf))
        np.testing.assert_array_equal(field.nearest_source, np.where(within, 0, -1))
        assert field.max_distance == limit


@each_error
@pytest.mark.jit
def test_max_distance_with_several_sources(error):
    case = zoo.SMALL["torus"]
    points, starts = [0, 20, 40], [0.0, 0.25, 0.5]
    sources = [gc.Source(s, t) for s, t in zip(points, starts, strict=True)]
    field = solve(mesh_of(case), sources, error, max_distance=1.5)
    least = (expected.matrix(case)[points] + np.array(starts)[:, None]).min(axis=0)
    check_limited(field, least, 1.5, error)


@pytest.mark.jit
@each_error
def test_max_distance_saves_work(error):
    mesh = gc.TriangleMesh(*zoo.icosphere(4))
    near = solve(mesh, 0, error, max_distance=0.2).stats
    assert near.windows_created < 0.05 * solve(mesh, 0, error).stats.windows_created


@zoo.each_scale
def test_tie_is_the_most_that_a_lower_source_may_be_farther(scale):
    for share, lower_wins in ((0.5, True), (-0.5, True), (2.0, False), (-2.0, True)):
        offered = scale * (1 + share * TIE)
        assert precedence(offered, 0, scale, 1) == lower_wins
        assert precedence(scale, 1, offered, 0) != lower_wins
    assert not precedence(scale, 0, scale, 0)
    assert precedence(scale, 7, math.inf, 0)


@pytest.mark.parametrize("seed", range(5))
def test_tie_covers_the_rounding_of_symmetric_meshes(seed):
    """Turned at random, a grid is symmetric but for rounding: its diagonal goes to source 0."""
    case = zoo.Case("grid", *zoo.grid(8, 8)).moved(zoo.rotation(seed), (3.0, 1.0, -2.0))
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    corners = [8, 72]
    field, mirrored = (gc.exact_distance(mesh, ends) for ends in (corners, corners[::-1]))
    diagonal = np.arange(0, 81, 10)
    assert (field.nearest_source[diagonal] == 0).all()
    assert (mirrored.nearest_source[diagonal] == 0).all()
    late = gc.exact_distance(mesh, [gc.Source(8, 8 * 10 * TIE), gc.Source(72)])
    assert (late.nearest_source[diagonal] == 1).all()
