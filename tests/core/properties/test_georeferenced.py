"""Georeferenced meshes: small ones, far from where coordinates are measured from.

All coordinates are multiples of GRAIN, so that an offset moves a mesh without rounding. Then the
oracle is the same mesh where it was: no answer may depend on the place.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT

GRAIN = 2.0**-20
"""Mesh units; up to 2**32 from zero a coordinate has a bit of this size."""

UTM, ECEF = (500000.0, 5000000.0, 100.0), (6400000.0, -6400000.0, 6400000.0)
CELLS = 10 if WITHOUT_JIT else 40

EACH_MESH = pytest.mark.parametrize("step", [0.01, 0.1])
EACH_PLACE = pytest.mark.parametrize(
    "offset", [(1e5, 1e5, 0.0), UTM, ECEF], ids=["1e5", "utm", "ecef"]
)


def terrain(step: float, cells: int = CELLS) -> tuple[np.ndarray, np.ndarray]:
    """Rough ground of square cells, two faces each, that begins at 0 along each axis."""
    rng = np.random.default_rng(1)
    x, y = np.divmod(np.arange(cells * cells), cells)
    vertices = np.stack([x, y, np.zeros(len(x))], axis=1) * step
    vertices += rng.uniform(0.0, (0.3 * step, 0.3 * step, step), vertices.shape)
    vertices = np.round(vertices / GRAIN) * GRAIN
    corners = np.flatnonzero((x < cells - 1) & (y < cells - 1))
    a, b, c, d = corners, corners + cells, corners + cells + 1, corners + 1
    return vertices - vertices.min(axis=0), np.concatenate(
        [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    )


def meshes(step: float, offset) -> tuple[gc.TriangleMesh, gc.TriangleMesh]:
    """The terrain near zero and moved by the offset."""
    vertices, faces = terrain(step)
    moved = vertices + offset
    np.testing.assert_array_equal(moved - offset, vertices)
    return gc.TriangleMesh(vertices, faces), gc.TriangleMesh(moved, faces)


def some_points(mesh, count: int, seed: int) -> list[gc.SurfacePoint]:
    """As many vertices, points on edges and points in faces."""
    rng = np.random.default_rng(seed)
    points = [mesh.point(int(v)) for v in rng.integers(len(mesh.vertices), size=count)]
    for face in rng.integers(len(mesh.faces), size=count).tolist():
        u, v, w = rng.dirichlet((1.0, 1.0, 1.0))
        points.append(mesh.point(gc.SurfacePoint.face(face, (u, v, w))))
        points.append(mesh.point(gc.SurfacePoint.face(face, (0.0, u, 1.0 - u))))
    return points


def spacing(mesh) -> float:
    """The distance of neighbouring numbers at the mesh's coordinates: what positions round to."""
    return float(np.spacing(np.abs(mesh.vertices).max()))


def check_same_path(near, far, offset, rounding):
    """The same path to the bit, but for the rounding of its positions."""
    assert far.length == near.length
    assert far.locations == near.locations
    assert far.error_bound == near.error_bound
    np.testing.assert_array_equal(far.faces, near.faces)
    np.testing.assert_allclose(far.points - offset, near.points, rtol=0, atol=rounding)


def check_same_fields(near, far, points, offset):
    """Equal answers of two fields."""
    rounding = spacing(far.mesh)
    np.testing.assert_array_equal(far.distances, near.distances)
    np.testing.assert_array_equal(far.nearest_source, near.nearest_source)
    np.testing.assert_array_equal(far.gradient, near.gradient)
    for point in points:
        assert far.distance_at(point) == near.distance_at(point)
        assert far.nearest_source_at(point) == near.nearest_source_at(point)
        check_same_path(near.path_to(point), far.path_to(point), offset, rounding)
    levels = gc.spaced_levels(near.distances, 3)
    for lines, others in zip(near.isolines(levels), far.isolines(levels), strict=True):
        assert len(lines) == len(others)
        for line, other in zip(lines, others, strict=True):
            assert other.closed == line.closed
            np.testing.assert_array_equal(other.faces, line.faces)
            np.testing.assert_allclose(other.points - offset, line.points, rtol=0, atol=rounding)


@EACH_PLACE
@EACH_MESH
@pytest.mark.parametrize("retain", ["paths", "windows"])
def test_exact_fields(step, offset, retain):
    near, far = meshes(step, offset)
    sources, points = some_points(near, 1, seed=2), some_points(near, 4, seed=3)
    fields = [gc.exact_distance(mesh, sources, retain=retain) for mesh in (near, far)]
    check_same_fields(*fields, points, offset)


@EACH_PLACE
@EACH_MESH
def test_approximate_fields(step, offset):
    near, far = meshes(step, offset)
    sources, points = some_points(near, 1, seed=4), some_points(near, 4, seed=5)
    fields = [gc.approximate_distance(mesh, sources) for mesh in (near, far)]
    check_same_fields(*fields, points, offset)


@pytest.mark.slow
@EACH_PLACE
@EACH_MESH
@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_fields_of_curves(step, offset, solve):
    near, far = meshes(step, offset)
    curve = gc.Curve(gc.shortest_path(near, *some_points(near, 1, seed=6)[1:]).locations)
    points = some_points(near, 4, seed=7)
    check_same_fields(*(solve(mesh, curve) for mesh in (near, far)), points, offset)


@pytest.mark.slow
@EACH_PLACE
@EACH_MESH
def test_searches(step, offset):
    near, far = meshes(step, offset)
    solvers = gc.Solver(near), gc.Solver(far)
    points = some_points(near, 4 if WITHOUT_JIT else 12, seed=8)
    for start, stop, end in zip(points, points[5:], points[7:], strict=False):
        for stops in [], [stop]:
            paths = [solver.shortest_path(start, end, stops) for solver in solvers]
            check_same_path(*paths, offset, spacing(far))


@pytest.mark.slow
@EACH_PLACE
@EACH_MESH
@pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])
def test_matrices(step, offset, layout):
    near, far = meshes(step, offset)
    points = some_points(near, 4, seed=9)
    starts, ends = points[:6], points[6:]
    matrices = [gc.distance_matrix(mesh, starts, ends, layout=layout) for mesh in (near, far)]
    if layout == "sparse":
        matrices = [matrix.toarray() for matrix in matrices]
    np.testing.assert_array_equal(*matrices)


@EACH_PLACE
@EACH_MESH
def test_nearest_candidates(step, offset):
    near, far = meshes(step, offset)
    source, *candidates = some_points(near, 6, seed=10)
    found, other = (gc.nearest(mesh, source, candidates, 5) for mesh in (near, far))
    np.testing.assert_array_equal(other.indices, found.indices)
    np.testing.assert_array_equal(other.distances, found.distances)


@EACH_PLACE
@EACH_MESH
def test_a_point_is_located_where_it_was(step, offset):
    """On the same vertex, edge or face, and as near as its position is rounded."""
    _, far = meshes(step, offset)
    for point in some_points(far, 20, seed=11):
        found = far.locate(far.position(point))
        assert found.vertex_index == point.vertex_index
        assert found.face_index == point.face_index
        is_zero = np.array(found.barycentric) == 0.0
        np.testing.assert_array_equal(is_zero, np.array(point.barycentric) == 0.0)
        away = far.position_from_origin(found) - far.position_from_origin(point)
        assert np.linalg.norm(away) <= 2.0 * spacing(far)


def test_a_vertex_of_no_face_may_be_anywhere():
    vertices, faces = terrain(0.01)
    near = gc.TriangleMesh(np.vstack([vertices, (0.0, 0.0, 0.0)]), faces)
    far = gc.TriangleMesh(np.vstack([vertices + UTM, (0.0, 0.0, 0.0)]), faces)
    paths = [gc.shortest_path(mesh, *some_points(near, 1, seed=12)[1:]) for mesh in (near, far)]
    check_same_path(*paths, UTM, spacing(far))


def test_barriers_and_arrays_measure_from_the_same_origin():
    near, far = meshes(0.01, ECEF)
    points = some_points(near, 4, seed=13)
    walls = range(0, len(near.faces), 7)
    free = [p for p in points if p.vertex_index is not None]
    near, far = near.with_barriers(walls), far.with_barriers(walls)
    again = gc.TriangleMesh.from_arrays(far.arrays())
    for mesh in far, again:
        fields = gc.exact_distance(near, free[0]), gc.exact_distance(mesh, free[0])
        check_same_fields(*fields, free[1:], ECEF)


def test_a_large_mesh_may_have_small_faces():
    """There is no place from which all coordinates are small: lengths round by the mesh's size."""
    vertices, faces = terrain(0.01)
    beside = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    alone = gc.TriangleMesh(vertices, faces)
    large = gc.TriangleMesh(
        np.vstack([vertices + UTM, beside]),
        np.vstack([faces, np.arange(3) + len(vertices)]),
    )
    points = some_points(alone, 4 if WITHOUT_JIT else 10, seed=14)
    exact = gc.distance_matrix(alone, points, points)
    np.testing.assert_array_equal(gc.distance_matrix(large, points, points), exact)
    solver = gc.Solver(large)
    for i, start in enumerate(points):
        end = (7 * i + 3) % len(points)
        path = solver.shortest_path(start, points[end])
        assert path.length == pytest.approx(exact[i, end], rel=1e-12, abs=1e-14 * large.diagonal)


@pytest.mark.slow
@pytest.mark.parametrize("apart", [1e-5, 1e-7, 1e-9])
def test_two_points_may_be_near_each_other(apart):
    """Then their distance has lost digits, but no more of it than rounding of the mesh."""
    mesh = gc.TriangleMesh(*terrain(0.1))
    for face in range(0, len(mesh.faces), 97):
        middle = gc.SurfacePoint.face(face, (0.4, 0.3, 0.3))
        beside = gc.SurfacePoint.face(face, (0.4, 0.3 - apart, 0.3 + apart))
        _, u, v = mesh.vertices[mesh.faces[face]]
        expected = apart * float(np.linalg.norm(v - u))
        rounding = 1e-15 * mesh.diagonal
        assert gc.shortest_path(mesh, middle, beside).length == pytest.approx(
            expected, abs=rounding
        )
        (pair,) = gc.distance_matrix(mesh, [middle], [beside], layout="pairs")
        assert pair == pytest.approx(expected, abs=rounding)


@given(
    place=st.tuples(*3 * [st.integers(-(2**50), 2**50)]),
    shift=st.tuples(*3 * [st.integers(-(2**18), 2**18)]),
    seed=st.integers(0, 100),
)
def test_distances_do_not_depend_on_the_place(place, shift, seed):
    """Nor does it matter from where the coordinates of the unmoved mesh are measured."""
    vertices, faces = terrain(0.1, cells=8)
    near, far = (
        gc.TriangleMesh(vertices + GRAIN * np.array(moved), faces) for moved in (shift, place)
    )
    np.testing.assert_array_equal(far.vertices - GRAIN * np.array(place), vertices)
    start, *points = some_points(near, 2, seed)
    fields = gc.exact_distance(near, start), gc.exact_distance(far, start)
    np.testing.assert_array_equal(*(field.distances for field in fields))
    for point in points:
        distance = fields[0].distance_at(point)
        assert fields[1].distance_at(point) == pytest.approx(distance, rel=1e-13)
        for path in fields[1].path_to(point), gc.shortest_path(far, start, point):
            assert path.length == pytest.approx(distance, rel=1e-12)
        found = gc.distance_matrix(far, [start], [point])
        assert found.item() == pytest.approx(distance, rel=1e-13)
