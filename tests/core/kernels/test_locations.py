"""Nodes of a traced path as points of the surface, against a plain search over the faces."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL
from geodesic_core.kernels.mesh.locations import Locations, drop_repeats, locate_nodes
from tests.conftest import WITHOUT_JIT
from tests.support import zoo

NAMES = ["crags_with_holes", "cube", "bow_tie_of_fans", "single_triangle", "isolated_vertices"]


def located_points(mesh, nodes, parameters):
    """Face, weights, vertex and position of each node."""
    count = len(nodes)
    faces, vertices = np.empty(count, np.int32), np.empty(count, np.int64)
    weights, points = np.empty((count, 3)), np.empty((count, 3))
    nodes, parameters = np.asarray(nodes, np.int32), np.asarray(parameters, float)
    located = Locations(faces, weights, vertices, points)
    locate_nodes(mesh.embedding, mesh.faces, nodes, parameters, located)
    return faces, weights, vertices, points


def lowest_face(mesh, vertices) -> int:
    """The lowest face that has all of these corners; -1 if there is none."""
    holds = [set(vertices) <= set(face) for face in mesh.faces.tolist()]
    return holds.index(True) if any(holds) else -1


@pytest.mark.parametrize("name", NAMES)
def test_vertices(name):
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    everyone = np.arange(len(case.vertices))
    nodes = -1 - mesh.topology.inner_vertex[everyone]
    faces, weights, vertices, points = located_points(mesh, nodes, np.zeros(len(nodes)))
    np.testing.assert_array_equal(vertices, everyone)
    np.testing.assert_array_equal(points, mesh.vertices)
    assert faces.tolist() == [lowest_face(mesh, [v]) for v in everyone.tolist()]
    for v in np.unique(mesh.faces).tolist():
        np.testing.assert_array_equal(weights[v], mesh.faces[faces[v]] == v)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("t", [1e-12, 0.25, 0.5, 1 - 1e-12])
def test_points_of_edges(name, t):
    """Seen from either side, the same point of the lower face."""
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    links = mesh.topology.links
    nodes = np.arange(len(links))[:: 7 if WITHOUT_JIT else 1]
    faces, weights, vertices, points = located_points(mesh, nodes, np.full(len(nodes), t))
    assert (vertices == -1).all()
    ends = mesh.topology.outer_vertex[links[nodes][:, [TAIL, HEAD]]]
    for (tail, head), face, row, point in zip(
        ends.tolist(), faces.tolist(), weights, points, strict=True
    ):
        assert face == lowest_face(mesh, [tail, head])
        corners = mesh.faces[face].tolist()
        assert row[corners.index(tail)] == pytest.approx(1 - t, rel=1e-15, abs=1e-16)
        assert row[corners.index(head)] == pytest.approx(t, rel=1e-15, abs=1e-16)
        assert row.sum() == pytest.approx(1, rel=1e-15)
        expected = (1 - t) * mesh.vertices[tail] + t * mesh.vertices[head]
        np.testing.assert_allclose(point, expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(("t", "at_tail"), [(0.0, True), (1e-17, True), (1.0, False)])
def test_ends_of_edges_are_vertices(t, at_tail):
    """Also where the parameter is too small to tell from an end."""
    mesh = gc.TriangleMesh(*zoo.octahedron())
    nodes = np.arange(len(mesh.topology.links))
    faces, weights, vertices, points = located_points(mesh, nodes, np.full(len(nodes), t))
    ends = mesh.topology.links[nodes, TAIL if at_tail else HEAD]
    np.testing.assert_array_equal(vertices, mesh.topology.outer_vertex[ends])
    np.testing.assert_array_equal(points, mesh.vertices[vertices])
    assert faces.tolist() == [lowest_face(mesh, [v]) for v in vertices.tolist()]
    np.testing.assert_array_equal(weights.max(axis=1), 1.0)


def test_repeated_locations_are_dropped_with_the_faces_between_them():
    faces = np.array([3, 3, 3, 4, 4, 3, 3], np.int32)
    weights = np.array(
        [(1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 0.5, 0.5), (1, 0, 0), (1, 0, 0)],
        dtype=float,
    )
    vertices, points = np.arange(7), np.arange(21.0).reshape(7, 3)
    located = Locations(faces.copy(), weights.copy(), vertices.copy(), points.copy())
    crossed = np.array([5, 4, 3, 2, 1, 0], np.int32)  # from the last to the first
    outer_face, between = np.arange(10, 16, dtype=np.int32), np.empty(6, np.int32)
    count = drop_repeats(outer_face, crossed, located, between)
    left = [0, 2, 3, 4, 5]
    assert count == len(left)
    for array, before in zip(located, (faces, weights, vertices, points), strict=True):
        np.testing.assert_array_equal(array[:count], before[left])
    assert between[: count - 1].tolist() == [11, 12, 13, 14]
