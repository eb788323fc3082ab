"""Several sources, start distances, ties, and the limit of distance."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import expected, zoo
from tests.support.meshes import mesh_of

EXACT = 1e-9
TIE = 1e-12


@zoo.each(zoo.SMALL)
def test_several_sources_are_the_least_of_each(case):
    mesh, matrix = mesh_of(case), expected.matrix(case)
    rng = np.random.default_rng(len(case.faces))
    for count in (2, 3, 5):
        sources = rng.integers(0, len(case.vertices), count)
        starts = rng.uniform(0, 1, count) * rng.integers(0, 2, count)
        field = gc.exact_distance(
            mesh, [gc.Source(int(s), float(t)) for s, t in zip(sources, starts, strict=True)]
        )
        each = matrix[sources] + starts[:, None]
        np.testing.assert_allclose(field.distances, each.min(axis=0), rtol=EXACT, atol=0)
        reached = np.isfinite(field.distances)
        assert (field.nearest_source[~reached] == -1).all()
        # The named source attains the least distance, and no lower one attains it as well.
        least = each.min(axis=0)
        ties = each <= least * (1 + TIE)
        np.testing.assert_array_equal(field.nearest_source[reached], ties.argmax(axis=0)[reached])


def test_sources_in_every_spelling():
    mesh = mesh_of(zoo.SMALL["torus"])
    plain = gc.exact_distance(mesh, 5)
    for source in (
        np.int64(5), np.uint8(5), gc.SurfacePoint.vertex(5), gc.Source(5), [5], (5,), np.array([5]),
        gc.Source(gc.SurfacePoint.vertex(5)), [gc.Source(5, 0.0)], [gc.SurfacePoint.vertex(5)],
    ):  # fmt: skip
        field = gc.exact_distance(mesh, source)
        np.testing.assert_array_equal(field.distances, plain.distances)
    mixed = gc.exact_distance(mesh, [5, gc.SurfacePoint.vertex(9), gc.Source(20, 0.5)])
    assert [source.start_distance for source in mixed.sources] == [0.0, 0.0, 0.5]


def test_ties_go_to_the_lowest_source():
    mesh = mesh_of(zoo.SMALL["flat_grid"])  # 7 by 6 vertices
    np.testing.assert_array_equal(gc.exact_distance(mesh, [8, 8]).nearest_source, 0)
    for left, right in ((0, 6), (6, 0), (35, 41)):
        nearest = gc.exact_distance(mesh, [left, right]).nearest_source.reshape(6, 7)
        assert (nearest[:, 3] == 0).all(), "the middle column is as far from either"


def test_a_source_behind_another_is_not_nearest_even_to_itself():
    case = zoo.SMALL["hills"]
    row = expected.matrix(case)[3]
    field = gc.exact_distance(mesh_of(case), [gc.Source(3), gc.Source(40, float(row[40]) + 1)])
    np.testing.assert_allclose(field.distances, row, rtol=EXACT)
    np.testing.assert_array_equal(field.nearest_source, 0)


def test_start_distances_shift_the_field():
    case = zoo.SMALL["crags"]
    field = gc.exact_distance(mesh_of(case), gc.Source(10, 1e3))
    np.testing.assert_allclose(field.distances, expected.matrix(case)[10] + 1e3, rtol=EXACT)


def test_start_distances_beyond_the_limit_reach_nothing():
    field = gc.exact_distance(mesh_of(zoo.SMALL["hills"]), gc.Source(3, 2.0), max_distance=1.0)
    assert np.isinf(field.distances).all()
    assert (field.nearest_source == -1).all()


@zoo.each(zoo.SMALL)
def test_within_max_distance_nothing_changes(case):
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


def test_max_distance_with_several_sources():
    case = zoo.SMALL["torus"]
    sources, starts = [0, 20, 40], [0.0, 0.25, 0.5]
    field = gc.exact_distance(
        mesh_of(case),
        [gc.Source(s, t) for s, t in zip(sources, starts, strict=True)],
        max_distance=1.5,
    )
    least = (expected.matrix(case)[sources] + np.array(starts)[:, None]).min(axis=0)
    np.testing.assert_allclose(field.distances, np.where(least <= 1.5, least, np.inf), rtol=EXACT)


@pytest.mark.jit
def test_max_distance_saves_work():
    vertices, faces = zoo.icosphere(4)
    mesh = gc.TriangleMesh(vertices, faces)
    near = gc.exact_distance(mesh, 0, max_distance=0.2).stats
    assert near.windows_created < 0.05 * gc.exact_distance(mesh, 0).stats.windows_created
