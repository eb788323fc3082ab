"""Distances on the zoo: never too long, too short by no more than was granted, which may be 0."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tolerances import WIDEST_ERROR
from tests.support import zoo
from tests.support.approximation import (
    MERGING,
    check_within,
    each_error,
    solve,
)
from tests.support.meshes import mesh_of


def check_source(mesh, source, error, exact):
    field = solve(mesh, source, error)
    check_within(field.distances, exact, error)
    np.testing.assert_array_equal(field.nearest_source, np.where(np.isfinite(exact), 0, -1))


@pytest.mark.jit
@zoo.each(MERGING)
def test_merging_saves_windows_and_uses_what_it_is_granted(case):
    source = len(case.vertices) // 2
    mesh = mesh_of(case)
    exact = gc.exact_distance(mesh, source)
    field = gc.approximate_distance(mesh, source, 1e-2)
    assert field.stats.windows_kept < exact.stats.windows_kept
    assert (field.distances < exact.distances * (1 - 1e-6)).any()


def test_the_field_carries_the_error_that_it_keeps_to():
    mesh = mesh_of(zoo.SMALL["sphere"])
    promises = [
        ({}, "relative", 1e-3),
        ({"relative_error": 1e-4}, "relative", 1e-4),
        ({"relative_error": 0.02}, "relative", WIDEST_ERROR),
        ({"relative_error": np.float64(0.5), "absolute_error": 2}, "relative", WIDEST_ERROR),
        ({"relative_error": None, "absolute_error": 2}, "absolute", 2.0),
    ]
    for arguments, kind, value in promises:
        bound = gc.approximate_distance(mesh, 0, **arguments).error_bound
        assert (bound.type, bound.value, bound.kind) == (kind, value, "guaranteed")


@each_error
def test_field_has_the_documented_arrays(error):
    mesh = mesh_of(zoo.SMALL["two_components"])
    field = solve(mesh, 1, error)
    assert field.distances.shape == field.nearest_source.shape == (len(mesh.vertices),)
    assert field.distances.dtype == np.float64
    assert field.nearest_source.dtype == np.int32
    assert field.mesh is mesh
    assert field.max_distance == np.inf
    assert [source.start_distance for source in field.sources] == [0.0]
    assert field.error_bound == gc.ErrorBound("relative", min(error, WIDEST_ERROR), "guaranteed")


@each_error
@pytest.mark.parametrize("name", ["sphere", "two_components"])
def test_stats_are_plausible(name, error):
    mesh = mesh_of(zoo.SMALL[name])
    stats = solve(mesh, 0, error).stats
    assert 0 < stats.windows_peak <= stats.windows_created
    assert stats.windows_kept > 0
    assert stats.windows_per_edge_created == pytest.approx(
        stats.windows_created / mesh.report.edges
    )
    assert stats.peak_bytes > 0
    assert stats.seconds > 0
    assert stats.as_dict()["windows_created"] == stats.windows_created


@each_error
def test_other_components_and_isolated_vertices_are_unreachable(error):
    case = zoo.SMALL["isolated_vertices"]
    mesh = mesh_of(case)
    isolated = np.setdiff1d(np.arange(len(case.vertices)), case.faces)
    field = solve(mesh, case.faces[0, 0], error)
    np.testing.assert_array_equal(np.flatnonzero(np.isinf(field.distances)), isolated)
    np.testing.assert_array_equal(np.flatnonzero(field.nearest_source == -1), isolated)
    lonely = solve(mesh, isolated[0], error)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(lonely.distances)), isolated[:1])
    assert lonely.distances[isolated[0]] == 0


@each_error
def test_faces_of_no_area_carry_paths_along_them(error):
    """A vertex in the middle of an edge, joined to it by a face without area."""
    vertices = [(0, 0, 0), (2, 0, 0), (1, 0, 0), (1, 1, 0), (1, -1, 0)]
    faces = [(0, 2, 3), (2, 1, 3), (0, 1, 2), (1, 0, 4)]
    mesh = gc.TriangleMesh(vertices, faces)
    assert mesh.report.degenerate_faces.ids == (2,)
    points = np.array(vertices, dtype=float)
    for source in range(5):
        check_source(mesh, source, error, np.linalg.norm(points - points[source], axis=1))


@each_error
@pytest.mark.parametrize("late", [1e-15, 1e-12, 1e-9])
def test_windows_of_nearly_equal_sigma_are_cut_at_their_bisector(late, error):
    """Half the cuts were off: the farthest vertex of four faces came out a tenth too far."""
    points = np.array([(35, 0), (2, 32), (99, 29), (0, 41), (37, 49), (120, 51)]) / 100
    vertices = np.column_stack([points, np.zeros(6)])
    mesh = gc.TriangleMesh(vertices, [(0, 2, 1), (1, 2, 3), (3, 2, 5), (3, 5, 4)])
    distances = solve(mesh, [gc.Source(3, late), gc.Source(4)], error).distances
    assert distances[0] == pytest.approx(np.linalg.norm(points[4] - points[0]), rel=1e-9)


@pytest.mark.jit
@pytest.mark.parametrize(("retain", "most"), [("distances", 0.6), ("paths", 1.2)])
def test_memory_is_at_most_that_of_the_mesh_and_a_fifth(retain, most):
    for mesh in (gc.TriangleMesh(*zoo.icosphere(5)), gc.TriangleMesh(*zoo.torus(120, 60))):
        stats = gc.approximate_distance(mesh, 0, retain=retain).stats
        assert stats.peak_bytes <= most * mesh.nbytes


@pytest.mark.jit
def test_widest_error_is_the_most_that_is_used():
    mesh = gc.samples.knot(2000)
    widest = gc.approximate_distance(mesh, 0, WIDEST_ERROR)
    for error in (2 * WIDEST_ERROR, 0.5):
        field = gc.approximate_distance(mesh, 0, error)
        assert (field.distances == widest.distances).all()
        assert field.error_bound == widest.error_bound
    narrower = gc.approximate_distance(mesh, 0, WIDEST_ERROR / 2)
    assert (narrower.distances != widest.distances).any()
