"""Paths of approximate fields: on the surface, no shorter than exact, longer by the error."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo
from tests.support.approximation import (
    ERRORS,
    MERGING,
    check_approximate_path,
    check_within,
    solved,
    some_sources,
)


def check_paths(mesh, source, exact, error, at_most):
    """Check the paths from a source to all vertices, or about ``at_most``, evenly spread."""
    field = gc.approximate_distance(mesh, source, error, retain="paths")
    reached = np.flatnonzero(np.isfinite(exact))
    for target in reached[:: len(reached) // at_most + 1].tolist():
        if target != source:
            check_approximate_path(field, target, exact[target], error)


@pytest.mark.slice(10)
@zoo.each(zoo.SMALL)
def test_paths_on_small_meshes(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 1 if WITHOUT_JIT else 4):
        check_paths(mesh, source, expected.matrix(case)[source], 1e-2, 30)


@pytest.mark.slice(6)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_paths_on_larger_meshes_and_slivers(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    source = len(case.vertices) // 3
    check_paths(mesh, source, case.distances(source), 1e-3, 60)


@pytest.mark.slice(3)
@zoo.each(MERGING)
def test_paths_where_much_is_merged(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 1 if WITHOUT_JIT else 5):
        exact = gc.exact_distance(mesh, source).distances
        for error in (1e-2,) if WITHOUT_JIT else ERRORS:
            check_paths(mesh, source, exact, error, 40)


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.KNOWN | MERGING)
def test_paths_from_many_sources(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in some_sources(case, 20):
        exact = gc.exact_distance(mesh, source).distances
        for error in ERRORS:
            check_paths(mesh, source, exact, error, 100)


@pytest.mark.parametrize("name", ["dented_ball", "islands", "dented_ring"])
def test_kept_or_found_again_the_path_is_the_same(name):
    case = MERGING[name]
    kept, found = (solved(case, 0, 1e-2, retain=each) for each in ("paths", "distances"))
    np.testing.assert_array_equal(kept.distances, found.distances)
    for target in range(1, len(case.vertices), 9):
        one, other = kept.path_to(target), found.path_to(target)
        assert one.points.tobytes() == other.points.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()
        assert (one.length, one.error_bound) == (other.length, other.error_bound)
        assert one.locations == other.locations


@pytest.mark.jit
@pytest.mark.parametrize("name", ["dented_ball", "islands"])
def test_some_paths_are_longer_than_the_field_says(name):
    """Else nothing was merged, and the tests above are idle."""
    field = solved(MERGING[name], 0, 1e-2, retain="paths")
    bounds = [field.path_to(t).error_bound.value for t in range(1, len(field.distances))]
    assert 1e-5 < max(bounds) < 1e-2


def test_paths_under_an_absolute_error():
    case = MERGING["dented_ring"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    exact = gc.exact_distance(mesh, 3).distances
    field = gc.approximate_distance(mesh, 3, None, 1e-3, retain="paths")
    check_within(field.distances, exact, absolute=1e-3)
    for target in range(4, len(exact), 11):
        check_approximate_path(field, target, exact[target], 1e-3 / exact[target])


@pytest.mark.parametrize("name", ["dented_ring", "islands"])
def test_a_path_ends_at_the_nearest_of_several_sources(name):
    case = MERGING[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    sources = [gc.Source(0), gc.Source(70, 0.5), gc.Source(gc.SurfacePoint.vertex(120), 0.25)]
    exact = gc.exact_distance(mesh, sources).distances
    field = gc.approximate_distance(mesh, sources, 1e-2, retain="paths")
    roots = [0, 70, 120]
    assert set(field.nearest_source.tolist()) == {0, 1, 2}
    for target in range(0, len(exact), 4 if WITHOUT_JIT else 1):
        if target not in roots:
            check_approximate_path(field, target, exact[target], 1e-2)


@pytest.mark.parametrize("late", [0.0, 0.5])
@pytest.mark.parametrize("name", ["single_triangle", "crags", "bow_tie", "isolated_vertices"])
def test_the_path_to_the_source_is_the_source(name, late):
    case = zoo.SMALL[name]
    source = int(case.faces[0, 0])
    path = solved(case, gc.Source(source, late)).path_to(source)
    assert path.length == 0
    assert (
        path.error_bound
        == gc.approximate_distance(gc.TriangleMesh(case.vertices, case.faces), source)
        .path_to(source)
        .error_bound
    )
    assert path.error_bound.value == 0
    np.testing.assert_array_equal(path.points, case.vertices[[source] * len(path.points)])


def test_no_path_tells_why():
    case = zoo.SMALL["two_components"]
    other = len(case.vertices) - 1
    with pytest.raises(gc.errors.NoPath, match=str(other)) as caught:
        solved(case, 0).path_to(other)
    assert caught.value.reason == "disconnected"
    near = solved(case, 0, max_distance=0.5)
    for target, reason in ((1, "beyond_max_distance"), (other, "disconnected")):
        with pytest.raises(gc.errors.NoPath) as caught:
            near.path_to(target)
        assert caught.value.reason == reason


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("winding", [1, -1])
def test_a_path_ends_at_the_named_one_of_sources_that_tie(solve, order, winding):
    """It ended at the other; with start distances the lengths did not fit, an internal error."""
    vertices = [(0, 0, 0), (0.5, 0, 0), (0, 1, 0), (1, 1, 0)]
    mesh = gc.TriangleMesh(vertices, [face[::winding] for face in ((0, 1, 2), (1, 3, 2))])
    sources = [(gc.Source(1, 0.5), gc.Source(2))[i] for i in order]
    field = solve(mesh, sources)
    assert field.nearest_source[0] == 0
    path = field.path_to(0)
    np.testing.assert_array_equal(path.points[0], vertices[sources[0].point])
    assert path.length == pytest.approx(1 - sources[0].start_distance, rel=1e-12)
    assert path.error_bound.value == pytest.approx(0, abs=1e-12)


def test_a_walk_into_another_sheet_than_the_path_came_from_is_given_up():
    """Over edges of four faces, from points on edges, where windows were merged before.

    Three cubes that meet at edges: 36 faces.
    """
    vertices, faces = zoo.voxels([(0, 0, 0), (0, 1, 1), (1, 0, 1)])
    rng = np.random.default_rng(0)
    names = rng.permutation(len(vertices))
    mesh = gc.TriangleMesh(vertices[np.argsort(names)], rng.permutation(names[faces]))
    for face in (5,) if WITHOUT_JIT else range(len(faces)):
        for corner in range(3):
            source = gc.SurfacePoint.edge(face, corner, 0.2)
            exact = gc.exact_distance(mesh, source).distances
            field = gc.approximate_distance(mesh, source, retain="paths")
            for target in range(len(vertices)):
                length = field.path_to(target).length
                assert exact[target] * (1 - 1e-9) <= length <= exact[target] * (1 + 1e-3)
