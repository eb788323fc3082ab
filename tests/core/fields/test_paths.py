"""Paths: what a path is, checked on the path itself, at every vertex of the zoo."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.certificates import check_path
from tests.support.meshes import mesh_of


def check_paths(case, sources, at_most=10**9):
    """Check the paths from each source to all vertices, or about ``at_most``, evenly spread."""
    mesh = mesh_of(case)
    for source in sources:
        field = gc.exact_distance(mesh, source)
        reached = np.flatnonzero(np.isfinite(field.distances))
        for target in reached[:: len(reached) // at_most + 1].tolist():
            if target != source:
                path = field.path_to(target)
                check_path(mesh, path, source, target, field.distances[target])


@pytest.mark.slice(15)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_paths_to_every_vertex(case):
    last = int(case.faces.max())
    check_paths(case, [last] if WITHOUT_JIT else [0, last // 2, last])


@pytest.mark.slice(6)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_paths_on_larger_meshes_and_slivers(case):
    check_paths(case, [len(case.vertices) // 3], at_most=300)


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_paths_on_larger_meshes_from_many_sources(case):
    sources = np.random.default_rng(7).choice(len(case.vertices), 20)
    check_paths(case, sources.tolist(), at_most=300)


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


def test_a_path_ends_at_the_nearest_of_several_sources():
    case = zoo.SMALL["torus"]
    mesh = mesh_of(case)
    field = gc.exact_distance(mesh, [gc.Source(0), gc.Source(25, 0.5), gc.Source(50, 0.25)])
    for target in range(len(case.vertices)):
        source = field.sources[field.nearest_source[target]]
        root = (0, 25, 50)[field.nearest_source[target]]
        if target != root:
            length = field.distances[target] - source.start_distance
            check_path(mesh, field.path_to(target), root, target, length)


@pytest.mark.parametrize("name", ["single_triangle", "crags", "bow_tie", "isolated_vertices"])
def test_the_path_to_the_source_is_the_source(name):
    case = zoo.SMALL[name]
    mesh = mesh_of(case)
    source = int(case.faces[0, 0])
    path = gc.exact_distance(mesh, source).path_to(source)
    assert path.length == 0
    assert len(path.points) == len(path.locations) == len(path.faces) + 1
    np.testing.assert_array_equal(path.points, mesh.vertices[[source] * len(path.points)])


def test_the_path_to_a_neighbour_is_the_edge():
    case = zoo.SMALL["hills"]
    mesh = mesh_of(case)
    path = gc.exact_distance(mesh, 9).path_to(10)
    np.testing.assert_array_equal(path.points, mesh.vertices[[9, 10]])


def test_no_path_tells_why():
    case = zoo.SMALL["two_components"]
    mesh = mesh_of(case)
    other = len(case.vertices) - 1
    with pytest.raises(gc.errors.NoPath, match=str(other)) as caught:
        gc.exact_distance(mesh, 0).path_to(other)
    assert caught.value.reason == "disconnected"
    near = gc.exact_distance(mesh, 0, max_distance=0.5)
    with pytest.raises(gc.errors.NoPath) as caught:
        near.path_to(1)
    assert caught.value.reason == "beyond_max_distance"
    with pytest.raises(gc.errors.NoPath) as caught:
        near.path_to(other)
    assert caught.value.reason == "disconnected"


def test_no_path_to_an_isolated_vertex():
    case = zoo.SMALL["isolated_vertices"]
    mesh = mesh_of(case)
    with pytest.raises(gc.errors.NoPath) as caught:
        gc.exact_distance(mesh, int(case.faces[0, 0])).path_to(0)
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
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    field = gc.exact_distance(mesh, 146)
    for target in range(209, 441, 21):
        check_path(mesh, field.path_to(target), 146, target, field.distances[target])
