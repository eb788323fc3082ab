"""Rough meshes, where merging would save no time: approximate fields are exact."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo

pytestmark = pytest.mark.jit

SOURCES = [0, gc.Source(gc.SurfacePoint.face(700, (0.2, 0.3, 0.5)), start_distance=0.4)]
TARGET = gc.SurfacePoint.face(9000, (0.5, 0.25, 0.25))


@pytest.fixture(scope="module")
def rough() -> gc.TriangleMesh:
    """A ball of 10,242 vertices with noise of half an edge."""
    vertices, faces = zoo.icosphere(5)
    return gc.TriangleMesh(zoo.crumpled(vertices, 0.02, seed=1), faces)


@pytest.mark.slow
@pytest.mark.parametrize("errors", [{}, {"relative_error": 0.05}, {"absolute_error": 0.1}])
@pytest.mark.parametrize("retain", ["distances", "paths", "windows"])
def test_approximate_fields_are_exact_to_the_bit_and_state_no_error(rough, errors, retain):
    options = {"targets": [TARGET], "max_distance": 2.5, "barriers": range(400, 440)}
    exact = gc.exact_distance(rough, SOURCES, **options, retain=retain)
    found = gc.approximate_distance(rough, SOURCES, **errors, **options, retain=retain)

    assert found.error_bound == exact.error_bound == gc.ErrorBound("relative", 0.0, "guaranteed")
    assert found.distances.tobytes() == exact.distances.tobytes()
    assert found.nearest_source.tobytes() == exact.nearest_source.tobytes()
    assert found.distance_at(TARGET) == exact.distance_at(TARGET)
    one, other = found.path_to(5000), exact.path_to(5000)
    assert one.points.tobytes() == other.points.tobytes()
    assert one.error_bound == other.error_bound
    levels = exact.levels(3)
    for lines, others in zip(found.isolines(levels), exact.isolines(levels), strict=True):
        for line, expected in zip(lines, others, strict=True):
            np.testing.assert_array_equal(line.points, expected.points)


def test_windows_of_a_smoother_mesh_are_merged(rough):
    vertices, faces = zoo.icosphere(5)
    smoother = gc.TriangleMesh(zoo.crumpled(vertices, 0.001, seed=1), faces)

    assert rough.is_rough
    assert not smoother.is_rough
    found, exact = gc.approximate_distance(smoother, 0), gc.exact_distance(smoother, 0)
    assert found.stats.windows_kept < exact.stats.windows_kept
    assert found.error_bound.value == 1e-3


def test_with_barriers_it_is_rough_as_well(rough):
    assert rough.with_barriers(range(400)).is_rough
