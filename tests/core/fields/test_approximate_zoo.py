"""Approximate distances on the zoo: never too long, too short by no more than was granted."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import ERRORS, MERGING, check_within, solved, some_sources

MANY, FEW = (2, 1) if WITHOUT_JIT else (12, 4)
"""Sources a mesh."""


@pytest.mark.slice(20)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_small_meshes_against_the_oracle(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, MANY):
        exact = expected.matrix(case)[source]
        for error in (1e-3,) if WITHOUT_JIT else ERRORS:
            field = gc.approximate_distance(mesh, source, error)
            check_within(field.distances, exact, error)
            np.testing.assert_array_equal(field.nearest_source, np.where(np.isfinite(exact), 0, -1))


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_small_meshes_from_every_vertex(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source, exact in enumerate(expected.matrix(case)):
        for error in ERRORS:
            check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@pytest.mark.slice(6)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_closed_forms(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 2 if case.name.endswith("_grid") else 6):
        exact = case.distances(source)
        for error in ERRORS:
            check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_closed_forms_from_many_sources(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 50):
        exact = case.distances(source)
        for error in ERRORS:
            check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@zoo.each(MERGING)
def test_meshes_on_which_much_is_merged(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 1 if WITHOUT_JIT else 20):
        exact = gc.exact_distance(mesh, source).distances
        for error in (1e-2,) if WITHOUT_JIT else ERRORS:
            check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@pytest.mark.jit
@zoo.each(MERGING)
def test_slivers_and_merging_after_rigid_motion_and_scale(case):
    for scale in (1e-9, 1e9):
        moved = case.moved(scale * zoo.rotation(3), scale * np.array((1.0, 2.0, -3.0)))
        mesh = gc.TriangleMesh(moved.vertices, moved.faces)
        for source in some_sources(case, 3):
            exact = gc.exact_distance(mesh, source).distances
            for error in ERRORS:
                check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@zoo.each(MERGING)
def test_an_absolute_error_holds_with_and_without_a_relative_one(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, FEW):
        exact = gc.exact_distance(mesh, source).distances
        for absolute in (1e-3,) if WITHOUT_JIT else (1e-5, 1e-3, 0.1):
            alone = gc.approximate_distance(mesh, source, None, absolute)
            check_within(alone.distances, exact, absolute=absolute)
            both = gc.approximate_distance(mesh, source, 1e-3, absolute)
            check_within(both.distances, exact, 1e-3, absolute)


@pytest.mark.jit
@zoo.each(MERGING)
def test_merging_saves_windows_and_uses_what_it_is_granted(case):
    source = len(case.vertices) // 2
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    exact = gc.exact_distance(mesh, source)
    field = gc.approximate_distance(mesh, source, 1e-2)
    assert field.stats.windows_kept < exact.stats.windows_kept
    assert (field.distances < exact.distances * (1 - 1e-6)).any()


def test_the_field_carries_what_was_promised():
    case = zoo.SMALL["sphere"]
    promises = [
        ({}, "relative", 1e-3),
        ({"relative_error": 0.02}, "relative", 0.02),
        ({"relative_error": np.float64(0.5), "absolute_error": 2}, "relative", 0.5),
        ({"relative_error": None, "absolute_error": 2}, "absolute", 2.0),
    ]
    for arguments, kind, value in promises:
        bound = solved(case, 0, **arguments).error_bound
        assert (bound.type, bound.value, bound.kind) == (kind, value, "guaranteed")


def test_field_has_the_documented_arrays():
    field = solved(zoo.SMALL["two_components"], 1)
    assert field.distances.shape == field.nearest_source.shape == (len(field.mesh.vertices),)
    assert field.distances.dtype == np.float64
    assert field.nearest_source.dtype == np.int32
    assert field.max_distance == np.inf
    assert 0 < field.stats.windows_peak <= field.stats.windows_created
    assert field.stats.windows_kept > 0


@pytest.mark.parametrize("late", [1e-15, 1e-12, 1e-9])
@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_windows_of_nearly_equal_sigma_are_cut_at_their_bisector(solve, late):
    """Half the cuts were off: the farthest vertex of four faces came out a tenth too far."""
    points = np.array([(35, 0), (2, 32), (99, 29), (0, 41), (37, 49), (120, 51)]) / 100
    vertices = np.column_stack([points, np.zeros(6)])
    mesh = gc.TriangleMesh(vertices, [(0, 2, 1), (1, 2, 3), (3, 2, 5), (3, 5, 4)])
    distances = solve(mesh, [gc.Source(3, late), gc.Source(4)]).distances
    assert distances[0] == pytest.approx(np.linalg.norm(points[4] - points[0]), rel=1e-9)


@pytest.mark.jit
@pytest.mark.parametrize(("retain", "most"), [("distances", 0.6), ("paths", 1.2)])
def test_memory_is_at_most_that_of_the_mesh_and_a_fifth(retain, most):
    for mesh in (gc.TriangleMesh(*zoo.icosphere(5)), gc.TriangleMesh(*zoo.torus(120, 60))):
        stats = gc.approximate_distance(mesh, 0, retain=retain).stats
        assert stats.peak_bytes <= most * mesh.nbytes
