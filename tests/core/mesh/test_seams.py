"""Seams that are open, T-junctions, and merging within a distance, against naive statements."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

import geodesic_core as gc
from geodesic_core.kernels.mesh.point_tree import find_nearest, find_on_edges, tree_of
from geodesic_core.mesh.degeneracies import first_within
from geodesic_core.tolerances import NEARLY_JOINED
from tests.support import zoo

pytestmark = pytest.mark.slice(8)

NOTHING = gc.Sample(0, ())
SCALES = [1e-9, 1.0, 1e9]


def told(mesh):
    return [text for text in mesh.warnings if "not joined" in text or "T-junction" in text]


def joined(*meshes):
    """One mesh of several, where they are."""
    counts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    faces = [faces + start for (_, faces), start in zip(meshes, counts, strict=False)]
    return np.vstack([vertices for vertices, _ in meshes]), np.vstack(faces)


def square(columns, rows, at=(0.0, 0.0, 0.0), size=(1.0, 1.0)):
    vertices, faces = zoo.grid(columns, rows)
    return vertices * [size[0] / columns, size[1] / rows, 0] + at, faces


def check_seam(mesh, pairs, width):
    """These pairs are told, within a relative 1e-2 of this width; the remedy joins them."""
    report = mesh.report
    assert report.near_vertices == gc.Sample(len(pairs), tuple(sorted(pairs)[:10]))
    assert report.near_distance == pytest.approx(width, rel=1e-2)
    assert report.t_junctions == NOTHING
    (text,) = told(mesh)
    assert str(min(pairs)) in text
    remedy = float(text.split("merge=")[1].split(" ")[0])
    assert report.near_distance < remedy <= 2 * report.near_distance
    whole = gc.TriangleMesh(mesh.vertices, mesh.faces, merge=remedy)
    assert told(whole) == []
    assert len(whole.vertices) == len(mesh.vertices) - len(pairs)
    for a, b in pairs:
        assert whole.vertex_map[a] == whole.vertex_map[b]
    return whole


# Open seams --------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", SCALES)
def test_two_squares_beside_each_other(scale):
    left, right = square(4, 4), square(4, 4, (1.0 + 1e-7, 0.0, 0.0))
    vertices, faces = joined(left, right)
    mesh = gc.TriangleMesh(vertices * scale, faces)
    pairs = [(5 * row + 4, 25 + 5 * row) for row in range(5)]
    whole = check_seam(mesh, pairs, 1e-7 * scale)
    assert len(whole.vertices) == 45
    distances = gc.exact_distance(whole, 0).distances
    assert distances.max() == pytest.approx(math.sqrt(5.0) * scale, rel=1e-6)


def cut_tube(sides, rows, width):
    """A tube of radius 1 whose last column of vertices is open by this width."""
    vertices, faces = zoo.grid(sides, rows)
    angle = vertices[:, 0] * (2 * math.pi - width) / sides
    return np.stack([np.cos(angle), np.sin(angle), vertices[:, 1]], axis=1), faces


def test_a_border_and_itself():
    mesh = gc.TriangleMesh(*cut_tube(12, 3, 1e-7))
    whole = check_seam(mesh, [(13 * row, 13 * row + 12) for row in range(4)], 1e-7)
    assert (whole.report.boundary_loops, whole.report.euler_characteristic) == (2, 0)


def test_a_sphere_in_two_halves_of_which_one_was_rounded():
    """To single precision, after it was turned; turned back it has another seam than the other."""
    vertices, faces = zoo.icosphere(3)
    upper = vertices[faces].mean(axis=1)[:, 2] > 0.1
    turn = zoo.rotation(4)
    halves = [zoo.drop_unused(vertices, faces[upper]), zoo.drop_unused(vertices, faces[~upper])]
    halves[1] = ((halves[1][0] @ turn.T).astype(np.float32).astype(float) @ turn, halves[1][1])
    mesh = gc.TriangleMesh(*joined(*halves))
    first = len(halves[0][0])
    between = cdist(mesh.vertices[:first], mesh.vertices[first:])
    pairs = [(int(a), first + int(b)) for a, b in zip(*np.nonzero(between < 1e-6), strict=True)]
    assert len(pairs) > 20
    whole = check_seam(mesh, pairs, max(between[a, b - first] for a, b in pairs))
    assert (whole.report.components, whole.report.boundary_loops) == (1, 0)


def test_four_parts_that_nearly_meet_at_a_vertex():
    gap = 1e-6
    corners = itertools.product((0.0, 1.0 + gap), repeat=2)
    parts = [square(2, 2, (x, y, 0.0)) for x, y in corners]
    mesh = gc.TriangleMesh(*joined(*parts))
    assert mesh.report.near_distance == pytest.approx(gap, rel=1e-3)
    whole = gc.TriangleMesh(mesh.vertices, mesh.faces, merge=2e-6)
    assert len(whole.vertices) == 25
    assert told(whole) == []


def test_parts_that_nearly_touch_at_one_vertex():
    left = ([(0, 0, 0), (-1, 1, 0), (-1, -1, 0)], [(0, 1, 2)])
    right = ([(1e-5, 0, 0), (1, 1, 0), (1, -1, 0)], [(0, 2, 1)])
    vertices, faces = joined(*((np.array(v, float), np.array(f)) for v, f in (left, right)))
    check_seam(gc.TriangleMesh(vertices, faces), [(0, 3)], 1e-5)


def test_far_from_the_origin():
    shift = np.array([5e6, 4e6, 100.0])
    vertices, faces = joined(square(4, 4), square(4, 4, (1.0 + 1e-5, 0.0, 0.0)))
    mesh = gc.TriangleMesh(vertices + shift, faces)
    check_seam(mesh, [(5 * row + 4, 25 + 5 * row) for row in range(5)], 1e-5)


def test_what_is_at_one_position_is_told_as_duplicates_alone():
    mesh = gc.TriangleMesh(*joined(square(4, 4), square(4, 4, (1.0, 0.0, 0.0))))
    assert mesh.report.duplicate_vertices.count == 5
    assert told(mesh) == [text for text in mesh.warnings if "merge='exact'" in text]
    assert mesh.report.near_vertices == mesh.report.t_junctions == NOTHING
    soup = gc.TriangleMesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3)
    )
    assert soup.report.near_vertices == soup.report.t_junctions == NOTHING


# T-junctions -------------------------------------------------------------------------------------

T = (
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 0.5, 0), (2, 1, 0), (1, 0.5, 0)],
    [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 7), (7, 5, 6), (7, 6, 2)],
)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("beside", [-1e-4, -1e-9, 0.0, 1e-9, 1e-4])
def test_a_vertex_on_an_edge(scale, beside):
    vertices = np.array(T[0], float)
    vertices[7, 0] += beside
    mesh = gc.TriangleMesh(vertices * scale, T[1])
    assert mesh.report.t_junctions == gc.Sample(1, (7,))
    assert mesh.report.t_junction_edges == gc.Sample(1, ((1, 2),))
    assert mesh.report.near_vertices == NOTHING
    (text,) = told(mesh)
    assert "vertex 7" in text
    assert "(1, 2)" in text
    assert "split the face" in text


def test_the_remedy_of_a_t_junction():
    mesh = gc.TriangleMesh(T[0], [(0, 1, 7), (0, 7, 2), *T[1][1:]])
    assert told(mesh) == []
    expected = np.linalg.norm(mesh.vertices, axis=1)  # a plane
    np.testing.assert_allclose(gc.exact_distance(mesh, 0).distances, expected, rtol=1e-14)


def test_a_chain_of_them():
    """A coarse border beside a fine one that divides each of its edges in four."""
    coarse, fine = square(3, 3), square(3, 12, (1.0, 0.0, 0.0))
    mesh = gc.TriangleMesh(*joined(coarse, fine))
    rows = [row for row in range(13) if row % 4]
    assert mesh.report.t_junctions.ids == tuple(16 + 4 * row for row in rows)
    edges = [(4 * (row // 4) + 3, 4 * (row // 4) + 7) for row in rows]
    assert mesh.report.t_junction_edges.ids == tuple(edges)
    assert mesh.report.duplicate_vertices.count == 4


def test_a_t_junction_within_one_part():
    """A cut tube with a vertex more on one side of its seam, which is exact or open."""
    for width in (0.0, 1e-6):
        vertices, faces = cut_tube(12, 1, width)
        vertices[12], vertices[25] = vertices[12], vertices[25]
        vertices = np.vstack([vertices, (vertices[0] + vertices[13]) / 2])
        side = next(i for i, f in enumerate(faces.tolist()) if {0, 13} <= set(f))
        a = int(next(v for v in faces[side] if v not in (0, 13)))
        rest = np.delete(faces, side, axis=0)
        mesh = gc.TriangleMesh(vertices, [*rest, (0, a, 26), (26, a, 13)])
        assert mesh.report.t_junctions == gc.Sample(1, (26,))
        assert mesh.report.t_junction_edges == gc.Sample(1, ((12, 25),))


# What is no seam ---------------------------------------------------------------------------------


def strip(count, width, stagger=0.0):
    """A flat strip of edges of length 1, whose borders are this far apart."""
    x = np.arange(count, dtype=float)
    rows = [np.stack([x + stagger * side, 0 * x + width * side, 0 * x], axis=1) for side in (0, 1)]
    faces = [
        face
        for i in range(count - 1)
        for face in ((i, i + 1, count + i), (i + 1, count + i + 1, count + i))
    ]
    return np.vstack(rows), np.array(faces)


@pytest.mark.parametrize("stagger", [0.0, 0.5])
@pytest.mark.parametrize("width", [1e-9, 1e-6, 1e-3, 1.0])
def test_a_strip_is_not_joined_with_itself(width, stagger):
    assert told(gc.TriangleMesh(*strip(30, width, stagger))) == []


@pytest.mark.parametrize("width", [1e-9, 1e-6, 1e-3])
def test_nor_one_of_two_layers_that_are_staggered(width):
    lower, upper = strip(30, width, 0.5), strip(30, width, 0.5)
    upper = (upper[0] + (0.5, width, 0.0), upper[1])
    mesh = gc.TriangleMesh(*joined(lower, upper), merge="exact")
    assert mesh.report.components == 1
    assert told(mesh) == []


@pytest.mark.parametrize("height", [1e-2, 1e3])
def test_nor_the_tip_of_a_cone_nor_a_fan_of_needles(height):
    angle = np.arange(2000) * (math.pi / 1000)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    ids = np.arange(2000)
    faces = np.stack([0 * ids, 1 + ids, 1 + (ids + 1) % 2000], axis=1)
    assert told(gc.TriangleMesh([(0, 0, height), *rim], faces)) == []
    opened = gc.TriangleMesh([(0, 0, height), *rim], faces[:-1])
    assert told(opened) == []


def test_nor_thin_sheets_upon_each_other():
    below, above = square(5, 5), square(5, 5, (0.0, 0.0, 2e-3))
    mesh = gc.TriangleMesh(*joined(below, above))  # 1e-2 of their edges apart
    assert told(mesh) == []


def test_nor_what_is_small_beside_what_is_large():
    """A part that is smaller than the large one's tolerance, and well apart for its own size."""
    small = square(4, 4, (10.0 + 5e-3, 0.0, 0.0), (1e-2, 1e-2))
    assert told(gc.TriangleMesh(*joined(square(1, 1, size=(10.0, 10.0)), small))) == []


@zoo.each(zoo.SMALL | zoo.KNOWN)
def test_nor_anything_in_the_zoo(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    assert mesh.report.near_vertices == mesh.report.t_junctions == NOTHING


@zoo.each(zoo.SMALL)
@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_told_is_far_over_the_surface(case, seed):
    """Torn along some edges and moved apart a little: pairs are near, and their ways long."""
    rng = np.random.default_rng(seed)
    vertices, faces = case.vertices[case.faces].reshape(-1, 3), case.faces.copy()
    loose = rng.random(faces.shape) < 0.3
    faces[loose] = len(case.vertices) + np.flatnonzero(loose)
    shaken = vertices + 1e-6 * rng.normal(size=vertices.shape) * np.ptp(case.vertices)
    mesh = gc.TriangleMesh(np.vstack([case.vertices, shaken]), faces)
    for a, b in mesh.report.near_vertices.ids:
        apart = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b])
        assert apart <= mesh.report.near_distance
        way = gc.exact_distance(mesh, a, targets=[b]).distances[b]
        assert way * NEARLY_JOINED >= apart * (1 - 1e-12)
    for v, (a, b) in zip(
        mesh.report.t_junctions.ids, mesh.report.t_junction_edges.ids, strict=True
    ):
        assert v not in (a, b)
        along = mesh.vertices[b] - mesh.vertices[a]
        beside = np.linalg.norm(np.cross(mesh.vertices[v] - mesh.vertices[a], along))
        apart = beside / np.linalg.norm(along)
        ways = gc.exact_distance(mesh, v, targets=[a, b]).distances[[a, b]]
        assert ways.min() * NEARLY_JOINED >= apart * (1 - 1e-12)


# The search, against all pairs -------------------------------------------------------------------


def points_of(rng, count):
    """Points in space, in a plane, on a line, in clusters, or at few positions."""
    points = rng.random((count, 3)) * rng.choice([1.0, 1e-3, 0.0], (1, 3))
    if rng.random() < 0.3:
        points = points[rng.integers(0, count, count)] + 1e-3 * rng.random((count, 3))
    if rng.random() < 0.2:
        points = np.round(points, 1)
    return points * 10.0 ** rng.integers(-9, 10)


@given(st.integers(0, 2**32), st.sampled_from([1, 2, 8, 9, 17, 100, 300]))
def test_a_cluster_is_what_steps_lead_to(seed, count):
    rng = np.random.default_rng(seed)
    points = points_of(rng, count)
    between = cdist(points, points)
    step = 0.0 if rng.random() < 0.2 else float(rng.choice(between.reshape(-1))) * rng.random()
    graph = coo_array(between <= step)
    _, label = connected_components(graph, directed=False)
    _, lowest = np.unique(label, return_index=True)
    np.testing.assert_array_equal(first_within(points, step), lowest[label])


@given(st.integers(0, 2**32), st.sampled_from([1, 2, 8, 9, 17, 100, 300]))
def test_nearest_points_and_points_on_edges(seed, count):
    rng = np.random.default_rng(seed)
    points = np.unique(points_of(rng, count), axis=0)
    size = max(float(np.ptp(points)), 1e-300)
    tree = tree_of(points)
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(points)))
    np.testing.assert_array_equal(tree.points, points[tree.order])
    reach = size * 10.0 ** rng.uniform(-4, 0, len(points))
    nearest, distance = np.empty(len(points), np.int64), np.empty(len(points))
    find_nearest(tree, reach, nearest, distance)
    between = cdist(tree.points, tree.points)
    np.fill_diagonal(between, np.inf)
    between[between > np.minimum(reach, reach[:, None])] = np.inf
    best = between.min(axis=1)
    np.testing.assert_array_equal(nearest >= 0, np.isfinite(best))
    np.testing.assert_allclose(distance[nearest >= 0], best[np.isfinite(best)], rtol=1e-14)

    edges = rng.integers(0, len(points), (50, 2))
    edges = edges[edges[:, 0] != edges[:, 1]]
    widths = size * 10.0 ** rng.uniform(-4, -1, len(edges))
    found = np.empty(len(points), np.int64)
    find_on_edges(tree, reach.copy(), edges, widths, found)
    a, b = tree.points[edges[:, 0]], tree.points[edges[:, 1]]
    t = ((tree.points[:, None] - a) * (b - a)).sum(axis=2) / ((b - a) ** 2).sum(axis=1)
    beside = np.linalg.norm(tree.points[:, None] - (a + t[..., None] * (b - a)), axis=2)
    limit = np.minimum(widths, reach[:, None])
    inside = (t > NEARLY_JOINED) & (t < 1 - NEARLY_JOINED)
    no_end = (edges[:, 0] != np.arange(len(points))[:, None]) & (
        edges[:, 1] != np.arange(len(points))[:, None]
    )
    is_on = inside & no_end & (beside <= limit * (1 - 1e-9))
    may_be_on = inside & no_end & (beside <= limit * (1 + 1e-9))
    assert (found >= 0)[is_on.any(axis=1)].all()
    for i in np.flatnonzero(found >= 0):
        assert may_be_on[i, found[i]]


@pytest.mark.jit
@pytest.mark.parametrize("merge", [1e-3, 0.6, 2.0])
def test_many_vertices_that_are_close_take_no_list_of_pairs(merge):
    """All within one distance, or in two places: pairs would take terabytes."""
    rng = np.random.default_rng(0)
    points = 1e-4 * rng.random((300_000, 3))
    points[::2] += (1.0, 0.0, 0.0)
    count = len(np.unique(first_within(points, merge)))
    assert count == (1 if merge == 2.0 else 2)


# The argument ------------------------------------------------------------------------------------


def test_the_first_vertex_keeps_its_position():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1e-3, 0), (1, 1, 0), (0, 1 + 1e-3, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (3, 4, 5)], merge=2e-3)
    assert mesh.vertex_map.tolist() == [0, 1, 2, 1, 3, 2]
    np.testing.assert_array_equal(mesh.vertices, np.array(vertices)[[0, 1, 2, 4]])
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2]]


@pytest.mark.parametrize("merge", [0, 0.0, np.float64(0.0), np.array(0.0)])
def test_no_distance_is_exact(merge):
    vertices, faces = joined(square(2, 2), square(2, 2, (1.0, 0.0, 0.0)))
    ways = [gc.TriangleMesh(vertices, faces, merge=each) for each in (merge, "exact")]
    for name, array in ways[0].arrays().items():
        np.testing.assert_array_equal(array, ways[1].arrays()[name])


def test_edges_no_longer_than_the_distance_collapse():
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1 + 1e-3, 0, 0)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (1, 3, 2)], merge=1e-2)
    assert mesh.report.repeated_vertex_faces == gc.Sample(1, (1,))
    with pytest.raises(gc.errors.InvalidMesh, match="no surface"):
        gc.TriangleMesh(vertices, [(0, 1, 2), (1, 3, 2)], merge=1.0)


@pytest.mark.parametrize("merge", ["near", "1e-6", -1.0, math.nan, math.inf, True, None, [1.0]])
def test_what_is_no_way_of_merging(merge):
    with pytest.raises(
        gc.errors.InvalidArgument, match=r"merge is .*'none', 'exact' or a distance"
    ):
        gc.TriangleMesh(*square(1, 1), merge=merge)


def test_files_and_polygons_take_a_distance(tmp_path):
    rows = [f"v {x} {y} 0" for x, y in [(0, 0), (1, 0), (1, 1), (0, 1)]]
    rows += [f"v {x} {y} 0" for x, y in [(1.0000001, 0), (2, 0), (2, 1), (1.0000001, 1)]]
    path = tmp_path / "two.obj"
    path.write_text("\n".join([*rows, "f 1 2 3 4", "f 5 6 7 8"]))
    assert len(gc.load_mesh(path).vertices) == len(gc.load_mesh(path, merge="exact").vertices) == 8
    mesh = gc.load_mesh(path, merge=1e-6)
    assert len(mesh.vertices) == 6
    assert mesh.report.components == 1
    same = gc.TriangleMesh.from_polygons(
        gc.load_mesh(path).vertices, np.arange(8), [4, 4], merge=1e-6
    )
    np.testing.assert_array_equal(same.faces, mesh.faces)


def test_an_stl_file_takes_a_distance():
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 1e-5, 0), (1, 1, 0), (0, 1, 0)]
    text = "solid\n"
    for triangle in corners:
        text += "facet normal 0 0 1\nouter loop\n"
        text += "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle) + "endloop\nendfacet\n"
    data = (text + "endsolid\n").encode()
    assert len(gc.load_mesh(data, "stl").vertices) == 5
    assert len(gc.load_mesh(data, "stl", merge=1e-4).vertices) == 4


@pytest.mark.parametrize("gap", [5e-324, 1e-170, 1e-120, 1e-7])
def test_the_remedy_joins_however_narrow_the_gap_is(gap: float) -> None:
    left = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    right = [[1, 0, gap], [1, 1, gap], [2, 0, 0], [2, 1, 0]]
    faces = [[0, 1, 2], [0, 2, 3], [4, 6, 7], [4, 7, 5]]
    (told,) = (words for words in gc.TriangleMesh(left + right, faces).warnings if "apart" in words)
    remedy = float(told.partition("merge=")[2].partition(" ")[0])
    assert gc.TriangleMesh(left + right, faces, merge=remedy).report.components == 1


@zoo.each_scale
@pytest.mark.parametrize(("share", "is_told"), [(0.99, True), (1.01, False)])
def test_nearly_joined_is_a_share_of_the_height_of_both_vertices(share, is_told, scale):
    """Of each pair along two squares, one is the corner of a face 1/√2 high."""
    gap = share * NEARLY_JOINED * math.sqrt(0.5)
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    faces = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    both = scale * np.vstack([corners, corners + np.array([1.0 + gap, 0.0, 0.0])])
    told = gc.TriangleMesh(both, faces).report.near_vertices
    assert told.ids == (((1, 4), (2, 7)) if is_told else ())


@zoo.each_scale
@pytest.mark.parametrize(("share", "is_told"), [(0.99, True), (1.01, False)])
def test_nearly_joined_is_a_share_of_the_height_of_an_edge(share, is_told, scale):
    """Half the height of its ends, for a vertex that is far higher."""
    edge = np.array([(0, 0, 0), (0, 1, 0), (1, 0.5, 0)])
    height = np.linalg.norm(np.cross(edge[1], edge[2])) / np.linalg.norm(edge[2])
    beside = share * NEARLY_JOINED * height / 2.0
    large = np.array([(-beside, 0.5, 0), (-9, 9, 0), (-9, -9, 0)])
    mesh = gc.TriangleMesh(scale * np.vstack([edge, large]), [(0, 2, 1), (3, 4, 5)])
    assert mesh.report.t_junctions.ids == ((3,) if is_told else ())


@pytest.mark.parametrize(("share", "is_told"), [(0.99, False), (1.01, True)])
def test_nearly_joined_is_a_share_of_an_edge_at_its_ends(share, is_told):
    """Nearer to an end, no vertex counts as on the edge."""
    edge = [(0, 0, 0), (0, 1, 0), (1, 0.5, 0)]
    other = [(0, share * NEARLY_JOINED, 0), (-1.0, 0.1, 0), (-1.0, 0.0, 0)]
    report = gc.TriangleMesh(edge + other, [(0, 2, 1), (3, 4, 5)]).report
    assert (3 in report.t_junctions.ids) == is_told
