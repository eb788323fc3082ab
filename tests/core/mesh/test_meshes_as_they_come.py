"""Bad input, case by case as other libraries were tried on it: the right answer or the right error.

The table is that of ``docs/accuracy.md``.
"""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.oracles import unfolding
from tests.support.path_checks import check_path
from tests.support.splitting import split_at

SEAMLESS = zoo.SMALL["crumpled_sphere"]


def distances(vertices, faces, source=0, **options):
    return gc.exact_distance(gc.TriangleMesh(vertices, faces, **options), source).distances


def agrees_with_the_oracle(vertices, faces):
    matrix = unfolding.distance_matrix(vertices, faces)
    for source in range(len(vertices)):
        np.testing.assert_allclose(distances(vertices, faces, source), matrix[source], rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "edge"), [("three_faces_at_an_edge", (0, 1)), ("cubes_at_an_edge", (5, 6))]
)
def test_non_manifold_edges(name, edge):
    """They are told from those that are only run the same way twice."""
    case = zoo.IRREGULAR[name]
    agrees_with_the_oracle(case.vertices, case.faces)
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    assert mesh.report.non_manifold_edges == gc.Sample(1, (edge,))
    assert mesh.report.misoriented_edges.count == 0
    assert not mesh.report.inconsistent_orientation
    assert f"three faces or more; the first joins the vertices {edge}" in mesh.warnings[0]


@pytest.mark.parametrize(
    ("name", "edges"),
    [
        ("misoriented", ((0, 1),)),
        ("flipped_face", ((0, 2), (0, 3), (2, 3))),
        ("moebius", ((0, 9),)),
        ("face_twice", ((0, 1), (0, 2), (1, 2))),
    ],
)
def test_mixed_winding(name, edges):
    case = zoo.IRREGULAR[name]
    agrees_with_the_oracle(case.vertices, case.faces)
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    assert mesh.report.misoriented_edges == gc.Sample(len(edges), edges)
    assert mesh.report.inconsistent_orientation
    assert mesh.report.non_manifold_edges.count == 0
    assert f"inconsistent; the first joins the vertices {edges[0]}" in mesh.warnings[-1]


@pytest.mark.jit
@pytest.mark.parametrize("repeats", [(1, 1, 2), (1, 2, 1), (2, 1, 1), (3, 3, 3)])
@pytest.mark.parametrize("at", [0, 40, -1])
def test_a_face_that_repeats_a_vertex(repeats, at):
    at = len(SEAMLESS.faces) if at < 0 else at
    faces = np.insert(SEAMLESS.faces, at, repeats, axis=0)
    mesh = gc.TriangleMesh(SEAMLESS.vertices, faces)
    field = gc.exact_distance(mesh, 5)
    clean = distances(SEAMLESS.vertices, SEAMLESS.faces, 5)
    assert field.distances.tobytes() == clean.tobytes()
    assert mesh.faces.tolist() == faces.tolist()
    assert mesh.report.repeated_vertex_faces == gc.Sample(1, (at,))
    assert f"face {at}" in mesh.warnings[-1]
    path = field.path_to(20)
    check_path(mesh, path, 5, 20, clean[20])
    assert at not in path.faces
    assert at not in [place.face_index for place in path.locations]
    found = gc.Solver(mesh).shortest_path(5, 20, explain=True)
    check_path(mesh, found, 5, 20, clean[20])
    assert all(at not in step.faces for step in found.steps)


@pytest.mark.jit
def test_a_face_that_repeats_a_vertex_holds_no_points():
    faces = np.insert(SEAMLESS.faces, 3, (1, 1, 2), axis=0)
    mesh = gc.TriangleMesh(SEAMLESS.vertices, faces)
    for point in (gc.SurfacePoint.face(3, (0.2, 0.3, 0.5)), gc.SurfacePoint.edge(3, 0, 0.5)):
        with pytest.raises(gc.errors.InvalidPoint, match=r"face 3, which repeats a vertex"):
            gc.exact_distance(mesh, point)
    clean = gc.TriangleMesh(SEAMLESS.vertices, SEAMLESS.faces)
    shift = np.arange(len(clean.faces)) + (np.arange(len(clean.faces)) >= 3)
    for face in range(len(clean.faces)):
        middle = clean.vertices[clean.faces[face]].mean(axis=0)
        assert mesh.locate(middle).face_index == shift[clean.locate(middle).face_index]
    inside = [gc.SurfacePoint.face(face, (0.2, 0.3, 0.5)) for face in (2, 60)]
    moved = [gc.SurfacePoint.face(int(shift[face]), (0.2, 0.3, 0.5)) for face in (2, 60)]
    expected = gc.shortest_path(clean, *inside)
    found = gc.shortest_path(mesh, *moved)
    assert found.points.tobytes() == expected.points.tobytes()
    assert found.faces.tolist() == shift[expected.faces].tolist()


@pytest.mark.parametrize("index", [-1, 10**9, len(SEAMLESS.vertices)])
def test_a_source_out_of_range(index):
    with pytest.raises(gc.errors.InvalidPoint, match=str(index)):
        distances(SEAMLESS.vertices, SEAMLESS.faces, index)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_vertex_that_is_not_finite(value):
    vertices = SEAMLESS.vertices.copy()
    vertices[7, 1] = value
    with pytest.raises(gc.errors.InvalidMesh, match=r"vertex 7\b") as caught:
        gc.TriangleMesh(vertices, SEAMLESS.faces)
    assert caught.value.elements == (7,)


def test_a_face_of_no_area():
    """A square whose diagonal has a vertex on it, which one side's face does not know of."""
    vertices = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (1, 1, 0)]
    faces = [(0, 1, 2), (0, 2, 4), (0, 4, 3), (4, 2, 3)]
    mesh = gc.TriangleMesh(vertices, faces)
    assert mesh.report.degenerate_faces == gc.Sample(1, (1,))
    for source, start in enumerate(vertices):
        straight = np.linalg.norm(np.subtract(vertices, start), axis=1)
        found = gc.exact_distance(mesh, source).distances
        np.testing.assert_allclose(found, straight, rtol=1e-12)


def test_a_path_that_bends_where_a_face_of_no_area_begins():
    """Around (0, 1), which is the middle vertex of a face of no area, and on over two faces."""
    vertices = [(-1, 1, 0), (-1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 3, 0), (1, 2, 0)]
    faces = [(3, 0, 1), (3, 1, 2), (4, 3, 2), (4, 2, 5), (2, 6, 5)]
    found = distances(vertices, faces, 0)
    assert found[6] == pytest.approx(1 + np.sqrt(2), rel=1e-12)


def test_an_edge_of_no_length():
    """A square cut along a diagonal, with a sliver between two vertices at one corner.

    More in `test_zero_length_edges`.
    """
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (0, 2, 4), (4, 2, 3)])
    found = gc.exact_distance(mesh, 4).distances
    np.testing.assert_allclose(found, [0, 1, np.sqrt(2), 1, 0], rtol=1e-15)
    assert gc.exact_distance(mesh, 1).distances[3] == pytest.approx(np.sqrt(2), rel=1e-15)
    assert mesh.report.zero_length_edges == gc.Sample(1, ((0, 4),))
    assert mesh.report.collapsed_faces == gc.Sample(1, (1,))
    assert "(0, 4)" in mesh.warnings[0]
    assert "face 1" in mesh.warnings[0]


def test_two_components():
    vertices = np.vstack([SEAMLESS.vertices, SEAMLESS.vertices + 9])
    count = len(SEAMLESS.vertices)
    mesh = gc.TriangleMesh(vertices, np.vstack([SEAMLESS.faces, SEAMLESS.faces + count]))
    field = gc.exact_distance(mesh, 3)
    assert np.isfinite(field.distances[:count]).all()
    assert np.isinf(field.distances[count:]).all()
    assert (field.nearest_source[count:] == -1).all()
    assert mesh.report.components == 2
    assert mesh.report.component_vertices == gc.Sample(2, (0, count))
    assert f"0, {count}" in mesh.warnings[0]
    with pytest.raises(gc.errors.NoPath) as caught:
        gc.shortest_path(mesh, 3, count + 3)
    assert caught.value.reason == "disconnected"


def test_vertices_duplicated_along_a_seam():
    """A square in two halves, whose diagonal is there twice."""
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0), (1, 1, 0), (0, 1, 0)]
    faces = [(0, 1, 2), (3, 4, 5)]
    apart = gc.TriangleMesh(vertices, faces)
    assert apart.report.duplicate_vertices == gc.Sample(2, (3, 4))
    assert np.isinf(gc.exact_distance(apart, 1).distances[5])
    assert any("vertex 3" in text and "merge='exact'" in text for text in apart.warnings)
    joined = gc.TriangleMesh(vertices, faces, merge="exact")
    assert joined.vertex_map.tolist() == [0, 1, 2, 0, 2, 3]
    assert joined.warnings == ()
    found = gc.exact_distance(joined, 1).distances
    assert found[joined.vertex_map[5]] == pytest.approx(np.sqrt(2), rel=1e-15)


def test_a_seam_inside_one_component_is_told_of_as_well():
    vertices, faces = zoo.torus(5, 4)
    faces = faces.copy()
    last, corner = len(vertices), faces[0, 2]
    faces[0, 2] = last
    mesh = gc.TriangleMesh(np.vstack([vertices, vertices[corner]]), faces)
    assert mesh.report.components == 1
    assert mesh.report.duplicate_vertices == gc.Sample(1, (last,))
    assert "merge='exact'" in mesh.warnings[0]


def test_a_triangle_soup():
    soup = SEAMLESS.vertices[SEAMLESS.faces].reshape(-1, 3)
    faces = np.arange(len(soup)).reshape(-1, 3)
    apart = gc.TriangleMesh(soup, faces)
    assert apart.report.components == len(faces)
    assert apart.report.duplicate_vertices.count == len(soup) - len(SEAMLESS.vertices)
    assert np.isfinite(gc.exact_distance(apart, 0).distances).sum() == 3
    assert any("merge='exact'" in text for text in apart.warnings)
    joined = gc.TriangleMesh(soup, faces, merge="exact")
    clean = gc.TriangleMesh(SEAMLESS.vertices, SEAMLESS.faces)
    np.testing.assert_array_equal(joined.vertices[joined.vertex_map], soup)
    number = {tuple(at): i for i, at in enumerate(joined.vertices.tolist())}
    order = [number[tuple(at)] for at in SEAMLESS.vertices.tolist()]
    np.testing.assert_allclose(
        gc.exact_distance(joined, order[0]).distances[order],
        gc.exact_distance(clean, 0).distances,
        rtol=1e-12,
    )


def test_faces_that_merging_makes_repeat_a_vertex():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (3, 1, 0)], merge="exact")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 0]]
    assert mesh.report.repeated_vertex_faces == gc.Sample(1, (1,))
    np.testing.assert_allclose(gc.exact_distance(mesh, 0).distances, [0, 1, 1])


def test_a_pillow_of_one_triangle_and_its_back():
    mesh = gc.TriangleMesh([(0, 0, 0), (3, 0, 0), (0, 4, 0)], [(0, 1, 2), (2, 1, 0)])
    assert mesh.report.duplicate_faces == gc.Sample(1, (1,))
    assert "face 1" in mesh.warnings[0]
    np.testing.assert_allclose(gc.exact_distance(mesh, 1).distances, [3, 0, 5], rtol=1e-15)


NEEDLES = [(0, 2, 1), (1, 2, 0), (2, 0, 1)]
NEEDLE = np.array(
    [
        (-0.15211269660704663, 1.0566645623318836, 0.9966675671761641),
        (-0.15162187405516467, -0.04385665101193417, 0.038200165017030135),
        (-0.1487304589151138, -0.032884343650413754, 0.07894510119180953),
    ]
)


@pytest.mark.parametrize("source", [0, 1, 2])
def test_three_needles_upon_each_other(source):
    """Windows would wind about the tip from sheet to sheet, each time in two more ways."""
    mesh = gc.TriangleMesh(NEEDLE, NEEDLES)
    expected = np.linalg.norm(NEEDLE - NEEDLE[source], axis=1)
    found = gc.exact_distance(mesh, source, deadline_s=2)
    assert found.stats.windows_created < 30
    np.testing.assert_allclose(found.distances, expected, rtol=1e-12)
    near = gc.approximate_distance(mesh, source, 1e-3, deadline_s=2).distances
    np.testing.assert_allclose(near, expected, rtol=1e-3)
    for target in range(3):
        path = gc.shortest_path(mesh, source, target)
        assert path.length == pytest.approx(expected[target], rel=1e-12)


@pytest.mark.parametrize("noise", [0.0, 1e-16, 1e-14, 1e-12, 1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize(
    "faces", [[(0, 1, 2), (2, 1, 0)], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]]
)
def test_a_pillow_of_faces_of_no_area(faces, noise):
    """Windows would wind about its tips, whose angle is none, for ever."""
    count = np.max(faces) + 1
    places = np.array([1.0, 0.3, 3.7, 4.4])[:count]
    line = np.stack([places, 0 * places, 0 * places], axis=1) @ zoo.rotation(3)
    moved = line + noise * np.random.default_rng(5).normal(size=line.shape)
    mesh = gc.TriangleMesh(moved, faces)
    for source in range(count):
        expected = np.abs(places - places[source])
        found = gc.exact_distance(mesh, source, deadline_s=20)
        assert found.stats.windows_created < 60
        np.testing.assert_allclose(found.distances, expected, rtol=1e-14, atol=20 * noise)
        near = gc.approximate_distance(mesh, source, 1e-3, deadline_s=20).distances
        np.testing.assert_allclose(near, found.distances, rtol=1e-3)


LINES = {
    "the middle of two flat faces upon each other": (
        [(1, 2, 1), (0, 0, 0), (0, 1, 0), (1, 0, 1), (1, 2, 0), (2, 0, 2)],
        [(5, 0, 3), (1, 5, 3), (1, 3, 2), (3, 0, 5), (3, 5, 1), (3, 1, 4)],
    ),
    "a crossing that rounding alone says where": (
        [
            (1.9999999999989242, 2.285470755522246e-12, 2.250574277703337e-13),
            (2.9999999999991642, 1.2332385122516276e-13, 5.209278692188834e-13),
            (0.9999999999989271, -1.1605693521082693e-12, 5.671545734155407e-13),
            (6.000000000000831, 3.7867712050104383e-13, -6.838885757396252e-13),
        ],
        [(2, 3, 1), (2, 3, 1), (2, 0, 1), (2, 1, 3), (2, 1, 3)],
    ),
    "the same on a larger share of the edge": (
        [
            (0.0431, -4.83e-10, -9.63e-10),
            (0.465, -1.34e-10, -1.06e-09),
            (0.629, -3.42e-10, 1.08e-09),
            (0.267, -3.22e-10, 7.14e-10),
        ],
        [(3, 0, 2), (2, 1, 0), (3, 2, 0)],
    ),
    "a wrong face that is wound about": (
        [
            (-0.6038942229, 0.4530588625, 0.450438413),
            (-0.5870028197, 0.4403864732, 0.4378394652),
            (-0.311062268, 0.2333679527, 0.2320179111),
            (-0.2842165181, 0.2132273851, 0.2119942362),
        ],
        [(2, 3, 0), (1, 0, 2), (1, 2, 0)],
    ),
    "several of them": (
        [
            (5.99999999985, 2.863549375456e-11, 8.740570438307e-11),
            (4.000000000163, 9.854477102241e-11, 6.742941244088e-11),
            (-2.26889917096e-10, -1.496904113967e-10, -6.708761973581e-11),
            (6.999999999975, 1.10513663388e-10, -2.873894028664e-12),
            (0.9999999999807, -7.109512152232e-11, -1.441321208171e-10),
        ],
        [(1, 2, 0), (0, 3, 4), (4, 3, 2), (4, 2, 3)],
    ),
}
"""Random faces on a line, or nearly: each case was found by chance, and its path was lost."""


@pytest.mark.parametrize("name", LINES)
def test_paths_through_faces_of_no_area(name):
    vertices, faces = (np.array(each) for each in LINES[name])
    mesh = gc.TriangleMesh(vertices, faces)
    for source in range(len(vertices)):
        field = gc.exact_distance(mesh, source, deadline_s=20)
        for target in np.flatnonzero(np.isfinite(field.distances)).tolist():
            path = gc.shortest_path(mesh, source, target)
            check_path(mesh, path, source, target, field.distances[target])
            check_path(mesh, field.path_to(target), source, target, field.distances[target])


WINDING = (
    [(0.82, 0.65), (0.98, 0.94), (0.08, 0.27), (0.04, 0.21), (0.02, 0.97), (0.68, 0.12)],
    [(2, 1, 4), (0, 3, 2), (2, 0, 1), (5, 0, 2), (3, 0, 2), (2, 0, 3)],
)
"""Three copies of an edge, and more faces around vertex 2: many wrong ways about it."""


@pytest.mark.jit
def test_a_path_is_found_among_many_faces_that_are_wound_about():
    flat, faces = WINDING
    mesh = gc.TriangleMesh(np.pad(flat, ((0, 0), (0, 1))), faces)
    inside = [(0.1, 0.6, 0.3), (0.6, 0.2, 0.2)]
    for face, weights in itertools.product([0, 2, 3], inside):  # others the oracle does not know
        point = gc.SurfacePoint.face(face, weights)
        vertices, pieces, (at,) = split_at(mesh, [point])
        expected = unfolding.distance_matrix(vertices, pieces)[at]
        field = gc.exact_distance(mesh, point)
        for target in range(6):
            distance = expected[target]
            back = gc.exact_distance(mesh, target).distance_at(point)
            assert back == pytest.approx(distance, rel=1e-12)
            check_path(mesh, field.path_to(target), point, target, distance)
            check_path(mesh, gc.shortest_path(mesh, point, target), point, target, distance)


QUARTERS = (
    [(2, 2), (1, 1), (1, 3), (0, 4), (0, 3), (3, 1), (3, 2)],
    [(5, 2, 0), (2, 0, 3), (1, 6, 5), (6, 1, 3), (2, 6, 5), (3, 5, 1), (3, 5, 6)],
)
"""The first two faces have no area, and lie in one line."""


def test_a_path_ends_in_the_second_of_two_faces_of_no_area():
    """Traced back, it is at its source's place before it is in its source's face."""
    flat, faces = QUARTERS
    mesh = gc.TriangleMesh(np.pad(flat, ((0, 0), (0, 1))) / 4, faces)
    inside = gc.SurfacePoint.face(1, (0.15, 0.51, 0.34))
    beyond = gc.SurfacePoint.face(5, (0.01, 0.42, 0.57))
    vertices = [*mesh.vertices, mesh.position(inside), mesh.position(beyond)]
    split = [(2, 0, 7), (0, 3, 7), (3, 2, 7), (3, 5, 8), (5, 1, 8), (1, 3, 8)]  # faces 1 and 5
    pieces = [face for i, face in enumerate(faces) if i not in (1, 5)] + split
    expected = unfolding.distance_matrix(np.array(vertices), pieces)[7, 8]
    for source, target in itertools.permutations([inside, beyond]):
        check_path(mesh, gc.shortest_path(mesh, source, target), source, target, expected)
        for solve in (gc.exact_distance, gc.approximate_distance, gc.fast_distance):
            path = solve(mesh, source).path_to(target)
            assert path.length == pytest.approx(expected, rel=1e-12)


FOLDED = (
    [(4, 6), (0, 4), (0, 0), (1, 0), (-2, 0), (3, 5), (4, 4), (0, 3)],
    [(0, 4, 5), (0, 5, 1), (0, 1, 6), (0, 6, 3), (0, 3, 2), (0, 2, 7), (0, 7, 4), (4, 1, 6)],
)
"""Faces around vertex 0; of the first one, which has no area, vertex 5 lies on the longest edge."""


def test_what_lies_behind_a_face_of_no_area_is_seen_from_its_vertex_on_an_edge():
    """Windows on both sides of it are as near as the edge, and needed all the same."""
    flat, faces = FOLDED
    mesh = gc.TriangleMesh(np.pad(flat, ((0, 0), (0, 1))) / 4, faces)
    expected = unfolding.distance_matrix(np.array(mesh.vertices), faces)
    for source in range(len(flat)):
        found = gc.exact_distance(mesh, source)
        np.testing.assert_allclose(found.distances, expected[source], rtol=1e-12)
        for target in range(len(flat)):
            check_path(mesh, found.path_to(target), source, target, expected[source, target])


def test_points_inside_a_face_of_no_area():
    """They lie on all of its edges, and are seen from the faces beyond each."""
    vertices = [(0, 0, 0), (3, 0, 0), (8, 0, 0), (4, 3, 0), (1, -2, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (0, 2, 3), (1, 0, 4)])
    source = gc.SurfacePoint.face(0, (0.5, 0.2, 0.3))  # at x = 3, and as far
    near = gc.SurfacePoint.face(0, (0.5, 0.4, 0.1))  # at x = 2
    inside = gc.SurfacePoint.face(1, (0.25, 0.25, 0.5))  # at (4, 1.5)
    expected = np.linalg.norm(mesh.vertices - mesh.vertices[1], axis=1)
    for retain in ("paths", "windows"):
        field = gc.exact_distance(mesh, source, retain=retain)
        np.testing.assert_allclose(field.distances, expected, rtol=1e-14, atol=1e-13)
        assert field.distance_at(near) == pytest.approx(1.0, rel=1e-14)
        assert field.distance_at(inside) == pytest.approx(np.hypot(1, 1.5), rel=1e-14)
        for target in (near, inside, 3, 4):
            check_path(mesh, field.path_to(target), source, target, field.distance_at(target))
    across = gc.exact_distance(mesh, inside).distance_at(near)
    assert across == pytest.approx(np.hypot(2, 1.5), rel=1e-14)


def test_what_is_pinched_is_no_other_mesh_to_the_report():
    """Edges that windows cross as irregular ones are plain edges to all others."""
    vertices = [(0, 0, 0), (1, 0, 0), (3, 0, 0), (1, 2, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 3), (1, 2, 3), (0, 2, 1)])
    assert mesh.report.degenerate_faces == gc.Sample(1, (2,))
    assert mesh.report.bow_tie_vertices.count == mesh.report.non_manifold_edges.count == 0
    assert mesh.report.boundary_loops == 1
    lines = gc.exact_distance(mesh, 3).isolines([2.1])[0]
    assert [line.closed for line in lines] == [False, False]


@pytest.mark.jit
def test_points_inside_three_sheets_upon_each_other():
    """The way from inside one sheet into another is over the nearest edge, in its mirror image."""
    corners = np.array([(0, 0, 0), (4, 0, 0), (1, 3, 0)])
    mesh = gc.TriangleMesh(corners, NEEDLES)
    weights = [(0.2, 0.5, 0.3), (0.6, 0.1, 0.3), (0.3, 0.3, 0.4), (0.05, 0.05, 0.9)]
    places = np.array(weights) @ corners

    def over_an_edge(p, q):
        found = []
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            normal = np.cross((0, 0, 1), b - a) / np.linalg.norm(b - a)
            image = q - 2 * ((q - a) @ normal) * normal
            share = ((p - a) @ normal) / ((p - image) @ normal)
            along = (p + share * (image - p) - a) @ (b - a) / ((b - a) @ (b - a))
            end = a if along < 0 else b
            bent = np.linalg.norm(p - end) + np.linalg.norm(q - end)
            found.append(np.linalg.norm(p - image) if 0 <= along <= 1 else bent)
        return min(found)

    def point(sheet, weight):
        order = [weight[v] for v in NEEDLES[sheet]]
        return gc.SurfacePoint.face(sheet, order)

    for i, j in itertools.product(range(3), range(3)):
        targets = [point(j, weight) for weight in weights]
        for p, weight in zip(places, weights, strict=True):
            field = gc.exact_distance(mesh, point(i, weight), targets=targets)
            for q, target in zip(places, targets, strict=True):
                expected = np.linalg.norm(p - q) if i == j else over_an_edge(p, q)
                assert field.distance_at(target) == pytest.approx(expected, rel=1e-12)
                path = gc.shortest_path(mesh, point(i, weight), target)
                assert path.length == pytest.approx(expected, rel=1e-12)


@pytest.mark.jit
def test_a_path_that_ends_on_the_edge_of_a_face_of_no_area():
    """Behind an edge of several faces, where the end may lie in another one."""
    vertices = np.array(
        [(0, 0, 0), (1, 0, 2), (2, 1, 2), (1, 2, 0), (0, 2, 2), (0, 1, 1), (0, 2, 0)], float
    )
    faces = [(2, 1, 0), (6, 2, 4), (0, 4, 3), (0, 4, 5), (2, 4, 6), (4, 3, 6)]
    matrix = unfolding.distance_matrix(vertices, faces)
    mesh = gc.TriangleMesh(vertices, faces)
    for source, target in itertools.permutations(range(7), 2):
        path = gc.exact_distance(mesh, source).path_to(target)
        assert path.length == pytest.approx(matrix[source, target], rel=1e-12)


def test_an_unreferenced_last_vertex():
    vertices = np.vstack([SEAMLESS.vertices, (9, 9, 9), (9, 9, 9)])
    mesh = gc.TriangleMesh(vertices, SEAMLESS.faces)
    field = gc.exact_distance(mesh, 0)
    assert len(field.distances) == len(vertices)
    assert np.isfinite(field.distances[:-2]).all()
    assert np.isinf(field.distances[-2:]).all()
    last = len(vertices) - 1
    assert mesh.report.isolated_vertices == gc.Sample(2, (last - 1, last))
    assert mesh.report.duplicate_vertices.count == 0
    assert gc.exact_distance(mesh, last).distances[last] == 0


def test_vertices_of_faces_that_repeat_one_alone_are_isolated():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (0, 3, 3)])
    assert mesh.report.isolated_vertices == gc.Sample(1, (3,))
    assert mesh.report.components == 1
    assert (mesh.report.faces, mesh.report.edges, mesh.report.euler_characteristic) == (2, 3, 1)
    assert np.isinf(gc.exact_distance(mesh, 0).distances[3])
