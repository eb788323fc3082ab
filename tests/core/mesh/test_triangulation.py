"""Polygons: cut into triangles that cover them, in place, with a map back."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from geodesic_core.mesh.triangulation import triangulated
from geodesic_core.tolerances import FAN
from tests.support import zoo
from tests.support.oracles import visibility

SHAPES = {
    "triangle": [(0, 0), (3, 0), (1, 2)],
    "square": [(0, 0), (2, 0), (2, 2), (0, 2)],
    "pentagon": [(0, 0), (2, 0), (3, 1), (2, 2), (0, 2)],
    "dart from its dent": [(0, 1), (-4, -3), (0, 8), (4, -3)],
    "dart from a wing": [(-4, -3), (0, 1), (4, -3), (0, 8)],
    "needle dart": [(0, 100), (-1, -10), (0, 0), (1, -10)],
    "middle of a side": [(0, 0), (1, 0), (2, 0), (2, 2), (0, 2)],
    "middles of all sides": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "comb": [(0, 0), (6, 0), (6, 5), (5, 1), (4, 5), (3, 1), (2, 5), (1, 1), (0, 5)],
    "star": [(0, 5), (1, 1), (5, 0), (1, -1), (0, -5), (-1, -1), (-5, 0), (-1, 1)],
}


def cut(points, polygon, size=None):
    size = len(polygon) if size is None else size
    return triangulated(np.asarray(points, float), np.asarray(polygon), np.array([size]))[0]


def doubled_areas(points, faces):
    a, b, c = np.asarray(points, float)[np.asarray(faces)].transpose(1, 0, 2)
    u, v = b - a, c - a
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def shoelace(points):
    x, y = np.asarray(points, float).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def check_cover(points, faces):
    """The triangles use each side once, in its direction, meet in pairs inside, and add up."""
    count = len(points)
    assert len(faces) == count - 2
    edges = [(int(f[i]), int(f[i - 2])) for f in faces for i in range(3)]
    assert len(set(edges)) == len(edges)
    sides = {(i, (i + 1) % count) for i in range(count)}
    assert sides <= set(edges)
    assert all((b, a) in edges for a, b in set(edges) - sides)
    areas, whole = doubled_areas(points, faces), shoelace(points)
    assert (areas * np.sign(whole) >= 0).all()
    assert areas.sum() == pytest.approx(whole, rel=1e-12)


@pytest.mark.slice(8)
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9, 1e45])
def test_flat_polygons_are_covered_from_any_corner_and_either_way_round(shape, scale):
    for start, step in itertools.product(range(len(shape)), (1, -1)):
        points = np.roll(np.array(shape, float), start, axis=0)[::step]
        for axes in itertools.permutations(range(3)):
            placed = np.insert(points, 2, 7.0, axis=1)[:, axes] * scale
            check_cover(points, cut(placed, range(len(points))))
        turned = np.insert(points, 2, 0.0, axis=1) @ zoo.rotation(start).T * scale
        assert len(cut(turned, range(len(points)))) == len(points) - 2


def test_convex_polygons_are_fans_from_their_first_corner():
    assert cut(np.insert(SHAPES["pentagon"], 2, 0, axis=1), range(5)).tolist() == [
        [0, 1, 2],
        [0, 2, 3],
        [0, 3, 4],
    ]


def test_a_polygon_with_a_hole_is_one_that_visits_two_corners_twice():
    outer, inner = [(0, 0), (6, 0), (6, 6), (0, 6)], [(2, 2), (2, 4), (4, 4), (4, 2)]
    points = np.insert(np.array(outer + inner, float), 2, 0, axis=1)
    faces = cut(points, [0, 1, 2, 3, 0, 4, 5, 6, 7, 4])
    assert doubled_areas(points, faces).sum() == pytest.approx(2 * (36 - 4))
    assert (doubled_areas(points, faces) > 0).all()
    report = gc.TriangleMesh(points, faces).report
    assert (report.euler_characteristic, report.boundary_loops) == (0, 2)


@pytest.mark.parametrize(
    ("polygon", "faces"),
    [
        ([5], [[5, 5, 5]]),
        ([4, 5], [[4, 5, 5]]),
        ([4, 4, 5], [[4, 4, 5]]),
        ([4, 4, 4, 4], [[4, 4, 4]]),
        ([4, 4, 5, 5], [[4, 5, 5]]),
        ([0, 0, 1, 2], [[0, 1, 2]]),
        ([0, 1, 1, 2], [[0, 1, 2]]),
        ([0, 1, 2, 0], [[1, 2, 0]]),
        ([0, 1, 1, 2, 3, 3], [[0, 1, 2], [0, 2, 3]]),
    ],
)
def test_a_corner_said_again_at_once_counts_once(polygon, faces):
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (5, 5, 5), (6, 6, 6)]
    found = cut(points, polygon)
    assert found.tolist() == faces


@pytest.mark.parametrize(
    "shape",
    [
        [(0, 0), (2, 2), (2, 0), (0, 2)],
        [(0, 0), (1, 0), (2, 0), (3, 0)],
        [(1, 1)] * 5,
        [(0, 0), (1, 0), (0, 0), (0, 1)],
        [(0, 5), (-3, -4), (5, 1), (-5, 1), (3, -4)],
        [(0, 0), (4, 0), (2, 0), (2, 3), (2, 0), (2, 3)],
    ],
    ids=["crossed", "on a line", "at a point", "there and back", "pentagram", "spikes"],
)
def test_polygons_that_enclose_nothing_of_their_own_still_give_triangles(shape):
    points = np.insert(np.array(shape, float), 2, 0, axis=1)
    faces = cut(points, range(len(shape)))
    assert len(faces) == len(shape) - 2
    assert set(faces.reshape(-1).tolist()) == set(range(len(shape)))


def test_the_map_leads_back_and_the_order_stays():
    shapes = [SHAPES["L"], SHAPES["triangle"], SHAPES["star"], SHAPES["square"], SHAPES["triangle"]]
    sizes = [len(shape) for shape in shapes]
    points = np.insert(np.concatenate(shapes).astype(float), 2, 0, axis=1)
    points[:, 0] += np.repeat(np.arange(5) * 20, sizes)
    mesh = gc.TriangleMesh.from_polygons(points, np.arange(sum(sizes)), sizes)
    assert mesh.face_map.tolist() == [0] * 4 + [1] + [2] * 6 + [3] * 2 + [4]
    owner = np.repeat(np.arange(5), sizes)
    assert (owner[mesh.faces] == mesh.face_map[:, None]).all()
    assert mesh.report.triangulated_polygons == 3
    again = gc.TriangleMesh.from_arrays(mesh.arrays())
    assert again.report == mesh.report
    assert again.face_map.tolist() == mesh.face_map.tolist()


def test_polygons_that_are_a_triangle_each_need_no_map():
    points = np.insert(SHAPES["square"], 2, 0, axis=1)
    mesh = gc.TriangleMesh.from_polygons(points, [0, 1, 2, 0, 0, 2, 3], [3, 4])
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.face_map is None
    assert "face_map" not in mesh.arrays()


def outline(cells):
    """Counter-clockwise corners around unit cells, those between two in line as well; else None."""
    follows = {}
    for x, y in cells:
        ring = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        for k, beside in enumerate([(x, y - 1), (x + 1, y), (x, y + 1), (x - 1, y)]):
            if beside not in cells:
                if ring[k] in follows:
                    return None  # cells touch at a corner
                follows[ring[k]] = ring[(k + 1) % 4]
    loop = [min(follows)]
    while follows[loop[-1]] != loop[0]:
        loop.append(follows[loop[-1]])
    return loop if len(loop) == len(follows) else None  # a hole


@given(st.integers(0, 2**31 - 1))
def test_distances_in_a_polygon_are_those_of_its_visibility_graph(seed):
    rng = np.random.default_rng(seed)
    cells = {(0, 0)}
    for _ in range(int(rng.integers(1, 14))):
        x, y = sorted(cells)[rng.integers(len(cells))]
        dx, dy = [(1, 0), (-1, 0), (0, 1), (0, -1)][rng.integers(4)]
        cells |= {(x + dx, y + dy)} if outline(cells | {(x + dx, y + dy)}) else set()
    loop = outline(cells)
    loop = loop[(k := int(rng.integers(len(loop)))) :] + loop[:k]

    grid = sorted({(x + i, y + j) for x, y in cells for i in (0, 1) for j in (0, 1)})
    number = {point: i for i, point in enumerate(grid)}
    halves = [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]
    faces = [[number[x + i, y + j] for i, j in half] for x, y in cells for half in halves]
    expected = visibility.distance_matrix(grid, faces)

    points = np.insert(np.array(loop, float), 2, 0.0, axis=1) @ zoo.rotation(seed % 1000).T
    points += rng.normal(size=points.shape) * rng.choice([0.0, 1e-16, 1e-15, 1e-14])
    mesh = gc.TriangleMesh.from_polygons(points, np.arange(len(loop)), [len(loop)])
    rows = [number[point] for point in loop]
    for source in range(0, len(loop), 3):
        found = gc.exact_distance(mesh, source).distances
        np.testing.assert_allclose(found, expected[rows[source], rows], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("bulge", "is_kept"), [(0.1, False), (10.0, True)])
@zoo.each_scale
def test_fan_has_no_sliver_below_its_share(bulge, is_kept, scale):
    """A square whose bottom bends at its middle corner, by a triangle of so much of the share."""
    height = bulge * FAN * 4
    square = [(0, 0), (1, -height), (2, 0), (2, 2), (0, 2)]
    points = np.insert(np.array(square, float) * scale, 2, 0.0, axis=1)
    faces, face_map = triangulated(points, np.arange(5), np.array([5]))
    assert ([0, 1, 2] in faces.tolist()) == is_kept
    assert face_map.tolist() == [0, 0, 0]
