"""Edges of no length: their ends are one place, and all else is as on the mesh without them."""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.mesh.locations import Locations
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.meshes import random_points
from tests.support.path_checks import check_path
from tests.support.searches import buy_landmarks

ALL = zoo.SMALL | zoo.IRREGULAR


class Needled:
    """A mesh with needles, the same without, and the way from the latter to the former."""

    def __init__(self, case: zoo.Case, seed: int = 1) -> None:
        self.rng = np.random.default_rng(seed)
        self.clean = gc.TriangleMesh(case.vertices, case.faces)
        vertices, faces, self.copy_of, self.place = zoo.needled(case.vertices, case.faces, seed)
        self.mesh = gc.TriangleMesh(vertices, faces)

    def copy(self, vertex: int) -> int:
        """One of the vertices that are this one."""
        return int(self.rng.choice(np.flatnonzero(self.copy_of == vertex)))

    def point(self, point: gc.SurfacePoint) -> gc.SurfacePoint:
        """The same point of the mesh with needles, a vertex as any of its copies."""
        if point.vertex_index is not None:
            return gc.SurfacePoint.vertex(self.copy(point.vertex_index))
        return gc.SurfacePoint.face(int(self.place[point.face_index]), point.barycentric)


def places(mesh, count):
    return random_points(mesh, 3 if WITHOUT_JIT else count, seed=5)


@zoo.each(ALL)
def test_distances_are_those_without_them_to_the_bit(case):
    both = Needled(case)
    for point in places(both.clean, 6):
        for solve in (gc.exact_distance, gc.approximate_distance):
            expected = solve(both.clean, point)
            found = solve(both.mesh, both.point(point))
            assert found.distances.tobytes() == expected.distances[both.copy_of].tobytes()
            nearest = expected.nearest_source[both.copy_of]
            assert found.nearest_source.tobytes() == nearest.tobytes()


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.slice(3)
@zoo.each(ALL)
def test_paths_are_those_without_them(case):
    both = Needled(case, seed=2)
    points = places(both.clean, 6)
    for start, end in itertools.product(points, repeat=2):
        source, target = both.point(start), both.point(end)
        distance = gc.exact_distance(both.clean, start).distance_at(end)
        if np.isinf(distance):
            with pytest.raises(gc.errors.NoPath):
                gc.shortest_path(both.mesh, source, target)
            continue
        field = gc.exact_distance(both.mesh, source)
        assert field.distance_at(target) == distance
        expected = gc.shortest_path(both.clean, start, end)
        found = gc.shortest_path(both.mesh, source, target, explain=True)
        assert found.points.tobytes() == expected.points.tobytes()
        assert found.faces.tolist() == both.place[expected.faces].tolist()
        assert set(found.faces.tolist()) <= set(found.steps[4].faces.tolist())
        check_on_the_surface(both, found, source, target, distance)
        check_on_the_surface(both, field.path_to(target), source, target, distance)


def check_on_the_surface(both, path, source, target, distance):
    """`check_path`, on the mesh without needles."""
    mesh, clean = both.mesh, both.clean
    ends = mesh.point(source), mesh.point(target)
    assert (path.locations[0], path.locations[-1]) == ends
    np.testing.assert_array_equal(path.points[[0, -1]], [mesh.position(end) for end in ends])
    without = {int(face): i for i, face in enumerate(both.place)}
    moved = gc.GeodesicPath(
        mesh=clean,
        faces=np.array([without[face] for face in path.faces.tolist()], np.int32),
        closed=False,
        length=path.length,
        located=Locations(
            np.array([without.get(p.face_index, -1) for p in path.locations]),
            np.array([p.barycentric for p in path.locations]),
            np.array([-1 if p.vertex_index is None else p.vertex_index for p in path.locations]),
            path.points,
        ),
        error_bound=path.error_bound,
        steps=None,
    )
    check_path(clean, moved, moved.locations[0], moved.locations[-1], distance)


@zoo.each(ALL)
def test_the_report_is_that_without_them_and_names_them(case):
    both = Needled(case, seed=3)
    mesh = both.mesh
    found, expected = mesh.report.as_dict(), both.clean.report.as_dict()
    collapsed = np.setdiff1d(np.arange(len(mesh.faces)), both.place)
    assert mesh.report.collapsed_faces == gc.Sample(len(collapsed), tuple(collapsed[:10]))
    edges = {
        (min(pair), max(pair))
        for face in mesh.faces[collapsed].tolist()
        for pair in itertools.combinations(face, 2)
        if both.copy_of[pair[0]] == both.copy_of[pair[1]]
    }
    assert mesh.report.zero_length_edges == gc.Sample(len(edges), tuple(sorted(edges)[:10]))
    for name in ("duplicate_faces", "degenerate_faces"):
        assert found[name]["ids"] == tuple(both.place[list(expected[name]["ids"])])
        assert found[name]["count"] == expected[name]["count"]
    new = {"vertices", "faces", "zero_length_edges", "collapsed_faces"}
    for name in expected.keys() - new - {"duplicate_faces", "degenerate_faces", "mean_edge_length"}:
        assert found[name] == expected[name], name
    assert mesh.edge_count == both.clean.edge_count == mesh.report.edges
    np.testing.assert_array_equal(mesh.components, both.clean.components[both.copy_of])


@pytest.mark.slice(5)
@zoo.each(ALL)
def test_all_spellings_of_a_place_are_one(case):
    mesh, copy_of = Needled(case, seed=4).mesh, Needled(case, seed=4).copy_of
    for face, corners in enumerate(mesh.faces.tolist()):
        for i, corner in enumerate(corners):
            vertex, after = mesh.point(int(copy_of[corner])), corners[(i + 1) % 3]
            assert vertex.vertex_index == copy_of[corner]
            weights = [0.0, 0.0, 0.0]
            weights[i], weights[i - 1] = 1 + 5e-17, -5e-17
            for spelling in (
                mesh.point(corner),
                mesh.point(gc.SurfacePoint.vertex(corner)),
                mesh.point(gc.SurfacePoint.edge(face, i, 1e-17)),
                mesh.point(gc.SurfacePoint.face(face, tuple(weights))),
                mesh.point_on_edge(corner, after, 0.0),
                mesh.point_on_edge(after, corner, 1.0),
            ):
                assert spelling == vertex
            assert mesh.position(corner).tolist() == mesh.vertices[corner].tolist()
            on_edge = mesh.point(gc.SurfacePoint.edge(face, i, 0.3))
            assert on_edge == mesh.point_on_edge(corner, after, 0.3)
            assert on_edge == mesh.point(on_edge)
            ends = int(copy_of[after]), int(copy_of[corner])
            expected = vertex if ends[0] == ends[1] else mesh.point_on_edge(*ends, 0.7)
            assert on_edge == expected
    assert mesh.inner_face[[p.face_index for p in places(mesh, 9)]].min() >= 0


@pytest.mark.jit
@pytest.mark.slice(5)
@zoo.each(ALL)
def test_points_in_needles_are_those_of_the_edge_that_is_left(case):
    both = Needled(case, seed=6)
    mesh = both.mesh
    for face in np.flatnonzero(mesh.inner_face < 0).tolist():
        for weights in ((0.2, 0.3, 0.5), (0.0, 0.75, 0.25), (1e-3, 1e-3, 0.998)):
            point = mesh.point(gc.SurfacePoint.face(face, weights))
            place = np.array(weights) @ mesh.vertices[mesh.faces[face]]
            np.testing.assert_allclose(
                mesh.position(point), place, rtol=0, atol=1e-12 * mesh.diagonal
            )
            assert min(point.barycentric) == 0
            field = gc.exact_distance(mesh, point)
            np.testing.assert_allclose(
                [field.distances[v] for v in mesh.faces[face]],
                np.linalg.norm(mesh.vertices[mesh.faces[face]] - place, axis=1),
                atol=1e-11 * mesh.diagonal,
            )


@pytest.mark.jit
def test_landmarks_lie_at_places_that_can_be_reached():
    both = Needled(zoo.SMALL["crumpled_sphere"], seed=7)
    solver = gc.Solver(both.mesh)
    buy_landmarks(solver, 3)
    landmarks = solver._workspace._search._landmarks
    known = landmarks.distances[both.mesh.topology.inner_vertex, : landmarks.count]
    assert (known.min(axis=0) == 0).all()
    assert (known.max(axis=0) > 0).all()


@pytest.mark.slice(6)
@zoo.each(zoo.SMALL)
@pytest.mark.jit
def test_tables_and_candidates_by_any_copy(case):
    both = Needled(case, seed=8)
    points = places(both.clean, 7)
    moved = [both.point(point) for point in points]
    expected = gc.distance_matrix(both.clean, points, points)
    found = gc.distance_matrix(both.mesh, moved, [both.point(point) for point in points])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    near = gc.nearest(both.mesh, moved[0], moved, len(moved))
    assert near.distances.tobytes() == (
        gc.nearest(both.clean, points[0], points, len(points)).distances.tobytes()
    )


def test_merging_the_vertices_says_the_same():
    """Where no other vertices share a position, ``merge="exact"`` gives the clean mesh."""
    case = zoo.SMALL["crumpled_torus"]
    both = Needled(case, seed=9)
    merged = gc.TriangleMesh(both.mesh.vertices, both.mesh.faces, merge="exact")
    assert merged.report.zero_length_edges.count == 0
    found = gc.exact_distance(both.mesh, both.copy(5)).distances
    expected = gc.exact_distance(merged, 5).distances[merged.vertex_map]
    assert found.tobytes() == expected.tobytes()


def test_what_a_store_keeps_makes_the_same_mesh():
    mesh = Needled(zoo.SMALL["torus"]).mesh
    again = gc.TriangleMesh.from_arrays(mesh.arrays())
    assert again.report == mesh.report
    last = len(mesh.vertices) - 1
    assert again.point(last) == mesh.point(last)
    found = gc.exact_distance(again, last).distances
    assert found.tobytes() == gc.exact_distance(mesh, last).distances.tobytes()


def test_vertices_that_no_such_edge_joins_stay_apart():
    """Two squares that share a corner's position, one of them with a needle there."""
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0), (0, 0, 0), (-1, 0, 0), (-1, -1, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (0, 3, 1), (4, 5, 6)])
    assert mesh.report.duplicate_vertices == gc.Sample(1, (4,))
    assert mesh.report.zero_length_edges == gc.Sample(1, ((0, 3),))
    assert mesh.components.tolist() == [0, 0, 0, 0, 1, 1, 1]
    found = gc.exact_distance(mesh, 3).distances
    np.testing.assert_array_equal(np.isinf(found), [0, 0, 0, 0, 1, 1, 1])


def test_faces_that_repeat_a_vertex_join_nothing():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0), (-1, 0, 0), (0, -1, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (0, 3, 3), (3, 4, 5)])
    assert mesh.report.zero_length_edges.count == mesh.report.collapsed_faces.count == 0
    assert mesh.report.components == 2


def test_an_edge_that_no_other_face_has_is_no_part_of_the_surface():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0), (5, 5, 5)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (3, 0, 4)])
    assert mesh.report.isolated_vertices == gc.Sample(1, (4,))
    assert gc.exact_distance(mesh, 1).distances.tolist() == [1, 0, np.sqrt(2), 1, np.inf]
    assert mesh.point(gc.SurfacePoint.face(1, (0.0, 0.0, 1.0))) == mesh.point(4)
    assert mesh.point(gc.SurfacePoint.face(1, (0.3, 0.7, 0.0))) == mesh.point(0)
    with pytest.raises(
        gc.errors.InvalidPoint, match=r"source 0 is in face 1, .* an edge of zero length"
    ):
        gc.exact_distance(mesh, gc.SurfacePoint.face(1, (0.3, 0.3, 0.4)))
    with pytest.raises(gc.errors.InvalidPoint, match="no edge joins"):
        mesh.point_on_edge(3, 4, 0.5)


def test_a_seam_closed_by_collapsed_quads():
    """Two halves of a square, whose shared side each has to itself, and quads of no width."""
    vertices = [(x, y, 0) for x in (0, 1, 1, 2) for y in (0, 1, 2)]
    quads = [(0, 3, 4, 1), (1, 4, 5, 2), (6, 9, 10, 7), (7, 10, 11, 8), (3, 6, 7, 4), (4, 7, 8, 5)]
    mesh = gc.TriangleMesh.from_polygons(vertices, np.ravel(quads), np.full(6, 4))
    straight = np.linalg.norm(mesh.vertices[:, None] - mesh.vertices[None], axis=2)
    found = gc.distance_matrix(mesh, range(12), range(12))
    np.testing.assert_allclose(found, straight, rtol=1e-12, atol=1e-15)
    assert mesh.report.zero_length_edges.count == 3
    assert mesh.report.collapsed_faces.count == 4
    assert mesh.report.components == 1
    assert (mesh.report.euler_characteristic, mesh.report.boundary_loops) == (1, 1)


def test_what_contraction_makes_non_manifold_is_crossed_into_every_sheet():
    """Three pages, each with a spine of its own; needles make them one."""
    book = zoo.IRREGULAR["three_faces_at_an_edge"]
    spines = [(0, 1), (5, 6), (7, 8)]
    vertices = np.vstack([book.vertices, book.vertices[[0, 1, 0, 1]]])
    pages = [(0, 1, 2), (6, 5, 3), (7, 8, 4)]
    needles = [(a, b, c) for (a, b), (c, d) in itertools.pairwise(spines)]
    needles += [(b, d, c) for (a, b), (c, d) in itertools.pairwise(spines)]
    mesh = gc.TriangleMesh(vertices, pages + needles)
    assert mesh.report.non_manifold_edges == gc.Sample(1, ((0, 1),))
    clean = gc.TriangleMesh(book.vertices, book.faces)
    for source in range(5):
        found = gc.exact_distance(mesh, source).distances
        expected = gc.exact_distance(clean, source).distances
        np.testing.assert_allclose(found[:5], expected, rtol=1e-15)
        np.testing.assert_array_equal(found[5:], found[[0, 1, 0, 1]])
