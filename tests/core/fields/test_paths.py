"""Paths: what a path is, checked on the path itself, at the vertices of the zoo."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import (
    MERGING,
    check_approximate_path,
    each_error,
    exact_or_not,
    solve,
)
from tests.support.meshes import mesh_of
from tests.support.path_checks import check_path


def test_a_path_through_saddles_has_its_vertices_as_points():
    """Around the corners of a comb: every bend is a boundary vertex."""
    case = zoo.SMALL["comb"]
    mesh = mesh_of(case)
    corners = [int(np.flatnonzero((case.vertices == (x, 0, 0)).all(axis=1))[0]) for x in (0, 7)]
    path = gc.exact_distance(mesh, corners[0]).path_to(corners[1])
    directions = np.diff(path.points, axis=0)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    bends = np.flatnonzero((directions[1:] * directions[:-1]).sum(axis=1) < 1 - 1e-9) + 1
    assert len(bends) >= 2
    for bend in bends:
        assert max(path.locations[bend].barycentric) == 1.0


@exact_or_not
@pytest.mark.parametrize(
    ("case", "roots"),
    [
        pytest.param(zoo.SMALL["torus"], (0, 25, 50), id="torus"),
        pytest.param(MERGING["dented_ring"], (0, 70, 120), id="dented_ring"),
        pytest.param(MERGING["islands"], (0, 70, 120), id="islands"),
    ],
)
@pytest.mark.jit
def test_a_path_ends_at_the_nearest_of_several_sources(case, roots, error):
    mesh = mesh_of(case)
    first, second, third = roots
    sources = [
        gc.Source(first),
        gc.Source(second, 0.5),
        gc.Source(gc.SurfacePoint.vertex(third), 0.25),
    ]
    exact = gc.exact_distance(mesh, sources).distances
    field = solve(mesh, sources, error, retain="paths")
    assert set(field.nearest_source.tolist()) == {0, 1, 2}
    for target in range(0, len(exact), 4 if WITHOUT_JIT else 1):
        if target not in roots:
            check_approximate_path(field, target, exact[target], error)


@each_error
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("winding", [1, -1])
def test_a_path_ends_at_the_named_one_of_sources_that_tie(error, order, winding):
    """It ended at the other; with start distances the lengths did not fit, an internal error."""
    vertices = [(0, 0, 0), (0.5, 0, 0), (0, 1, 0), (1, 1, 0)]
    mesh = gc.TriangleMesh(vertices, [face[::winding] for face in ((0, 1, 2), (1, 3, 2))])
    sources = [(gc.Source(1, 0.5), gc.Source(2))[i] for i in order]
    field = solve(mesh, sources, error)
    assert field.nearest_source[0] == 0
    path = field.path_to(0)
    np.testing.assert_array_equal(path.points[0], vertices[sources[0].point])
    assert path.length == pytest.approx(1 - sources[0].start_distance, rel=1e-12)
    assert path.error_bound.value == pytest.approx(0, abs=1e-12)


@each_error
@pytest.mark.parametrize("late", [0.0, 0.5])
@pytest.mark.parametrize("name", ["single_triangle", "crags", "bow_tie", "isolated_vertices"])
def test_the_path_to_the_source_is_the_source(name, late, error):
    case = zoo.SMALL[name]
    source = int(case.faces[0, 0])
    path = solve(mesh_of(case), gc.Source(source, late), error).path_to(source)
    assert path.length == 0
    assert path.error_bound == gc.ErrorBound("relative", 0.0, "guaranteed")
    assert len(path.points) == len(path.locations) == len(path.faces) + 1
    np.testing.assert_array_equal(path.points, case.vertices[[source] * len(path.points)])


def test_the_path_to_a_neighbour_is_the_edge():
    case = zoo.SMALL["hills"]
    mesh = mesh_of(case)
    path = gc.exact_distance(mesh, 9).path_to(10)
    np.testing.assert_array_equal(path.points, mesh.vertices[[9, 10]])


@each_error
def test_no_path_tells_why(error):
    mesh = mesh_of(zoo.SMALL["two_components"])
    other = len(mesh.vertices) - 1
    with pytest.raises(gc.errors.NoPath, match=str(other)) as caught:
        solve(mesh, 0, error).path_to(other)
    assert caught.value.reason == "disconnected"
    near = solve(mesh, 0, error, max_distance=0.5)
    for target, reason in ((1, "beyond_max_distance"), (other, "disconnected")):
        with pytest.raises(gc.errors.NoPath) as caught:
            near.path_to(target)
        assert caught.value.reason == reason


@each_error
def test_no_path_to_an_isolated_vertex(error):
    case = zoo.SMALL["isolated_vertices"]
    with pytest.raises(gc.errors.NoPath) as caught:
        solve(mesh_of(case), int(case.faces[0, 0]), error).path_to(0)
    assert caught.value.reason == "disconnected"


@pytest.mark.parametrize("name", ["crags_with_holes", "double_frame", "bow_tie_of_fans"])
def test_shortest_path_is_the_fields_path(name):
    case = zoo.SMALL[name]
    mesh = mesh_of(case)
    source, target = 1, len(case.vertices) - 1
    distance = gc.exact_distance(mesh, source).distances[target]
    check_path(mesh, gc.shortest_path(mesh, source, target), source, target, distance)


def test_shortest_path_between_components():
    case = zoo.SMALL["two_components"]
    with pytest.raises(gc.errors.NoPath) as caught:
        gc.shortest_path(mesh_of(case), 0, len(case.vertices) - 1)
    assert caught.value.reason == "disconnected"


def test_paths_carry_the_fields_error_bound():
    field = gc.exact_distance(mesh_of(zoo.SMALL["cube"]), 0)
    assert field.path_to(3).error_bound == field.error_bound


@pytest.mark.jit
def test_a_path_along_the_boundary_may_stray_by_rounding():
    """It left the surface between two vertices of the boundary, and was given up."""
    case = zoo.KNOWN["slivers_1e-05"].moved(1e9 * zoo.rotation(3), (1.0, 2.0, -3.0))
    mesh = mesh_of(case)
    field = gc.exact_distance(mesh, 146)
    for target in range(209, 441, 21):
        check_path(mesh, field.path_to(target), 146, target, field.distances[target])


def test_a_path_between_many_sheets_around_a_tip_is_found():
    """Its line may go through sheets in tens of thousands of ways: each place is tried once."""
    rng = np.random.default_rng(114)
    points = rng.normal(size=(int(rng.integers(5, 40)), 3)) * 10.0 ** rng.uniform(-3, 0, 3)
    faces = [rng.choice(len(points), 3, replace=False) for _ in range(int(rng.integers(3, 80)))]
    mesh = gc.TriangleMesh(points, faces)
    source = gc.SurfacePoint.face(9, (0.1909981448964488, 0.26098535102994447, 0.5480165040736068))
    field = gc.exact_distance(mesh, source)
    for v in np.flatnonzero(np.isfinite(field.distances)).tolist():
        assert field.path_to(v).length == pytest.approx(field.distances[v], rel=1e-12)
