"""Distances on the zoo: never too long, too short by no more than was granted, which may be 0."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tolerances import WIDEST_ERROR
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import (
    ERRORS,
    GRANTED,
    MERGING,
    check_within,
    each_error,
    solve,
    some_sources,
)
from tests.support.meshes import mesh_of

ABSOLUTE = (1e-3,) if WITHOUT_JIT else (1e-5, 1e-3, 0.1)
BOXES = {name: case for name, case in zoo.KNOWN.items() if name.endswith("_grid")}
"""Half a second for the distances from a vertex: a box is rolled to every other one."""
NO_BOXES = {name: case for name, case in zoo.KNOWN.items() if name not in BOXES}


def check_sources(
    case: zoo.Case,
    sources: Iterable[int],
    exact: Callable[[int], np.ndarray],
    errors: Iterable[float] = GRANTED,
):
    """Check the fields from some vertices, for each error, given the exact distances from each."""
    mesh = mesh_of(case)
    for source in sources:
        distances = exact(source)
        for error in errors:
            check_source(mesh, source, error, distances)


def check_source(mesh, source, error, exact):
    field = solve(mesh, source, error)
    check_within(field.distances, exact, error)
    np.testing.assert_array_equal(field.nearest_source, np.where(np.isfinite(exact), 0, -1))


@pytest.mark.slice(5)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_small_meshes_from_every_vertex(case):
    matrix = expected.matrix(case)
    sources = some_sources(case, 12 if WITHOUT_JIT else len(matrix))
    check_sources(case, sources, lambda source: matrix[source])


@pytest.mark.slice(len(NO_BOXES))
@pytest.mark.jit
@zoo.each(NO_BOXES)
def test_closed_forms(case):
    check_sources(case, some_sources(case, 12), case.distances)


@pytest.mark.slow
@pytest.mark.slice(1)
@pytest.mark.jit
@zoo.each(BOXES)
def test_closed_forms_on_boxes(case):
    check_sources(case, some_sources(case, 4), case.distances)


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_closed_forms_from_every_vertex(case):
    check_sources(case, range(len(case.vertices)), case.distances, [0])
    # Not from every vertex: the 2e-4 from 435 to 15 of slivers_1e-05, across faces with edges of
    # length 1, come out too long by 1.5e-9 of themselves, whatever the error.
    check_sources(case, some_sources(case, 50), case.distances, ERRORS)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["flat", "slivers_1e-05", "crowded_lines", "pleats_slivers"])
@pytest.mark.parametrize("seed", range(3))
def test_slivers_after_rigid_motion(name, seed):
    """Rotated coordinates are rounded, so that what was flat is only nearly so."""
    case = zoo.KNOWN[name].moved(zoo.rotation(seed), (1.0, 2.0, -3.0))
    mesh = mesh_of(case)
    for source in some_sources(case, 5):
        exact = case.distances(source)
        for error in GRANTED:
            # The motion itself moves each vertex by some 1e-15: that much is not the solver's.
            check_within(solve(mesh, source, error).distances, exact, error, moved=1e-14)


@pytest.mark.jit
@zoo.each(MERGING)
def test_distances_scale_with_the_mesh_and_stay_after_rigid_motion(case):
    mesh = mesh_of(case)
    for scale in (1e-9, 1e9):
        moved = mesh_of(case.moved(scale * zoo.rotation(3), scale * np.array((1.0, 2.0, -3.0))))
        for source in some_sources(case, 3):
            exact = scale * gc.exact_distance(mesh, source).distances
            for error in GRANTED:
                check_within(solve(moved, source, error).distances, exact, error)


@pytest.mark.slow
@zoo.each(MERGING)
@pytest.mark.jit
def test_meshes_on_which_much_is_merged(case):
    mesh = mesh_of(case)
    for source in some_sources(case, 1 if WITHOUT_JIT else 20):
        exact = gc.exact_distance(mesh, source).distances
        for error in GRANTED[1:]:
            check_source(mesh, source, error, exact)


@pytest.mark.jit
@zoo.each(MERGING)
def test_merging_saves_windows_and_uses_what_it_is_granted(case):
    source = len(case.vertices) // 2
    mesh = mesh_of(case)
    exact = gc.exact_distance(mesh, source)
    field = gc.approximate_distance(mesh, source, 1e-2)
    assert field.stats.windows_kept < exact.stats.windows_kept
    assert (field.distances < exact.distances * (1 - 1e-6)).any()


@zoo.each(MERGING)
@pytest.mark.jit
def test_an_absolute_error_holds_with_and_without_a_relative_one(case):
    mesh = mesh_of(case)
    for source in some_sources(case, 1 if WITHOUT_JIT else 4):
        exact = gc.exact_distance(mesh, source).distances
        for absolute in ABSOLUTE:
            alone = gc.approximate_distance(mesh, source, None, absolute)
            check_within(alone.distances, exact, absolute=absolute)
            both = gc.approximate_distance(mesh, source, 1e-3, absolute)
            check_within(both.distances, exact, 1e-3, absolute)


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
