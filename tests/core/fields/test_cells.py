"""Cells: the planar Voronoi diagram, sums of areas, and the nearest source everywhere."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points


def planar_cell(places, i, width, height):
    """The corners of the Voronoi cell of a point within a rectangle."""
    others = np.delete(places, i, axis=0)
    away = others - places[i]
    sides = [(-1, 0, 0), (1, 0, -width), (0, -1, 0), (0, 1, -height)]
    halves = np.column_stack([away, -(away * 0.5 * (others + places[i])).sum(axis=1)])
    return HalfspaceIntersection(np.concatenate([halves, sides]), places[i]).intersections


@pytest.mark.parametrize("seed", range(3))
def test_in_the_plane_they_are_voronoi_cells(seed):
    vertices, faces = zoo.grid(9, 7, seed=seed, jitter=0.2)
    turn = zoo.rotation(seed)
    mesh = gc.TriangleMesh(vertices @ turn.T, faces)
    points = random_points(mesh, 24, seed)[::3]  # inside of faces
    places = np.array([mesh.position(point) for point in points]) @ turn
    cells = gc.exact_distance(mesh, points).cells()
    for i, point in enumerate(cells.centroids):
        hull = ConvexHull(planar_cell(places[:, :2], i, 9.0, 7.0))
        np.testing.assert_allclose(cells.areas[i], hull.volume, rtol=1e-9)
        corners = hull.points[hull.vertices]
        x, y = corners.T
        cross = x * np.roll(y, -1) - np.roll(x, -1) * y
        middle = ((corners + np.roll(corners, -1, axis=0)) * cross[:, None]).sum(axis=0)
        expected = middle / (3.0 * cross.sum())
        np.testing.assert_allclose((mesh.position(point) @ turn)[:2], expected, atol=1e-8)


def check_cells(mesh, field, cells):
    """Whole, each face with the source that is nearest, and as the borders say."""
    reached = cells.cell_of >= 0
    whole = cells.cut.mesh.face_areas
    assert abs(whole.sum() - mesh.face_areas.sum()) <= 1e-12 * mesh.face_areas.sum()
    np.testing.assert_allclose(cells.areas.sum(), whole[reached].sum(), rtol=1e-12)
    assert {tuple(pair) for pair in cells.adjacency.tolist()} == {b.sources for b in cells.borders}
    np.testing.assert_allclose(
        cells.border_lengths.sum(), sum(b.length for b in cells.borders), rtol=1e-12
    )
    error = 2.0 * gc.resolve_chord_error(mesh, None)
    rng = np.random.default_rng(1)
    large = np.flatnonzero(whole > 1e-9 * whole.sum())
    for face in rng.choice(large, min(len(large), 25), replace=False).tolist():
        place = cells.cut.to_old(gc.SurfacePoint.face(face, tuple(rng.dirichlet([1, 1, 1]))))
        distances = [
            gc.exact_distance(mesh, [source], targets=[place]).distance_at(place)
            + source.start_distance
            for source in (gc.Source(s.point) for s in field.sources)
        ]
        if cells.cell_of[face] < 0:
            assert min(distances) >= field.max_distance - error
        else:
            assert distances[cells.cell_of[face]] <= min(distances) + 2.0 * error


@pytest.mark.jit
@pytest.mark.parametrize("limit", [None, 0.2])
@pytest.mark.parametrize("sample", ["sphere", "knot", "terrain", "obstacles"])
def test_each_face_belongs_to_the_source_that_is_nearest(sample, limit):
    mesh = getattr(gc.samples, sample)(1500)
    points = random_points(mesh, 8, seed=4)
    limit = None if limit is None else limit * mesh.diagonal
    field = gc.exact_distance(mesh, points, max_distance=limit)
    check_cells(mesh, field, field.cells())


@pytest.mark.jit
@pytest.mark.parametrize(("low", "high"), [(0.0, 0.3), (0.7, 1.0), (0.4, 0.6)])
@pytest.mark.parametrize("sources", [[0, -1, 3], [0, 3]])
def test_barriers_belong_to_no_cell(low, high, sources):
    """Wherever they are, and where they part the surface; a side without a source as well."""
    mesh = gc.samples.plane(800)
    x = mesh.vertices[mesh.faces, 0].mean(axis=1)
    walls = np.flatnonzero((x > low) & (x < high))
    free = np.flatnonzero((x <= low) | (x >= high))
    free = free[np.argsort(x[free], kind="stable")]
    inside = [gc.SurfacePoint.face(int(free[i]), (0.2, 0.3, 0.5)) for i in sources]
    field = gc.exact_distance(mesh, inside, barriers=walls)
    cells = field.cells()
    assert (cells.cell_of[np.isin(cells.cut.face_of, walls)] == -1).all()
    faces = np.flatnonzero(~np.isin(cells.cut.face_of, walls))
    middles = cells.cut.to_old([gc.SurfacePoint.face(int(f), (1 / 3,) * 3) for f in faces])
    assert cells.cell_of[faces].tolist() == [field.nearest_source_at(each) for each in middles]
    reached = np.isfinite(field.distances[mesh.faces[free]]).all(axis=1)
    assert cells.areas.sum() == pytest.approx(mesh.face_areas[free[reached]].sum(), rel=1e-12)


def test_a_source_that_is_walled_in_has_no_cell():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]]
    book = gc.TriangleMesh(corners, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    with pytest.warns(gc.errors.BlockedSource):
        cells = gc.exact_distance(book, [4, 2], barriers=[2]).cells()
    np.testing.assert_allclose(cells.areas, [0.0, 1.0], rtol=1e-15)
    assert cells.cell_of.tolist() == [1, 1, -1]
    assert cells.centroids[0] is None


@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_they_are_whole_on_any_surface(case):
    mesh = mesh_of(case)
    points = [int(mesh.faces[0, 0]), int(mesh.faces[-1, 2])]
    field = gc.exact_distance(mesh, points)
    check_cells(mesh, field, field.cells())


@pytest.mark.jit
def test_meshes_and_adjacency_are_those_of_the_cut():
    mesh = gc.samples.knot(1500)
    cells = gc.exact_distance(mesh, [0, 300, 500, 700]).cells()
    for i, own in enumerate(cells.meshes()):
        np.testing.assert_allclose(own.face_areas.sum(), cells.areas[i], rtol=1e-12)
        rows = np.flatnonzero(cells.cell_of == i)
        np.testing.assert_array_equal(
            own.vertices[own.faces], cells.cut.vertices[cells.cut.faces[rows]]
        )
    assert not np.intersect1d(
        cells.cut.faces[cells.cell_of == 0], cells.cut.faces[cells.cell_of != 0]
    ).size


@pytest.mark.jit
def test_cells_of_other_fields_are_exact():
    mesh = gc.samples.terrain(1500)
    expected = gc.exact_distance(mesh, [3, 500]).cells()
    for field in (gc.approximate_distance(mesh, [3, 500], 0.1), gc.fast_distance(mesh, [3, 500])):
        cells = field.cells()
        np.testing.assert_array_equal(cells.areas, expected.areas)
        np.testing.assert_array_equal(cells.cell_of, expected.cell_of)


def test_one_source_has_the_whole_surface():
    mesh = gc.samples.plane(200)
    cells = gc.exact_distance(mesh, 7).cells()
    np.testing.assert_array_equal(cells.cut.faces, mesh.faces)
    np.testing.assert_allclose(cells.areas, [1.0], rtol=1e-12)
    assert cells.adjacency.shape == (0, 2)
    np.testing.assert_allclose(mesh.position(cells.centroids[0])[:2], 0.5, atol=1e-9)


def test_a_source_that_is_nearest_nowhere_has_no_cell():
    mesh = gc.samples.plane(200)
    cells = gc.exact_distance(mesh, [0, gc.Source(5, start_distance=9.0), 60]).cells()
    assert cells.areas[1] == 0.0
    assert cells.centroids[1] is None
    assert cells.centroids[0] is not None
    with pytest.raises(InvalidArgument, match="source 1"):
        cells.meshes()


def test_curves_have_cells_without_centroids():
    mesh = gc.samples.plane(200)
    cells = gc.exact_distance(mesh, [gc.Curve([0, 1, 2]), 110]).cells()
    np.testing.assert_allclose(cells.areas.sum(), 1.0, rtol=1e-12)
    with pytest.raises(InvalidArgument, match="curves"):
        _ = cells.centroids


def test_cells_of_a_surface_given_by_lengths():
    """The unit square, known by its lengths only."""
    square = gc.samples.plane(200)
    corners = square.vertices[square.faces]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    mesh = gc.TriangleMesh.from_lengths(square.faces, lengths)
    expected = gc.exact_distance(square, [0, 30, 110]).cells()
    cells = gc.exact_distance(mesh, [0, 30, 110]).cells()
    np.testing.assert_allclose(cells.areas, expected.areas, rtol=1e-9)
    for own, area in zip(cells.meshes(), cells.areas, strict=True):
        assert not own.has_positions
        np.testing.assert_allclose(own.face_areas.sum(), area, rtol=1e-12)
