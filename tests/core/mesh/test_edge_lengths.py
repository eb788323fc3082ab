"""Surfaces given by lengths: closed forms, the same as their twins in space, and refusals."""

import io
import math
import zipfile

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh, NotEmbedded
from geodesic_core.kernels.mesh.half_edges import SIN_LEFT
from geodesic_core.tolerances import ROUNDED_LENGTH
from tests.core.fields.test_log_map import apart, sources_of
from tests.support import zoo
from tests.support.meshes import mesh_of

ALL = zoo.SMALL | zoo.KNOWN | zoo.IRREGULAR
SAME = 1e-12


def lengths_of(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = np.asarray(vertices, float)[np.asarray(faces)]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def twin_of(mesh: gc.TriangleMesh) -> gc.TriangleMesh:
    """The same surface, without positions."""
    given = len(mesh.vertices)
    twin = gc.TriangleMesh.from_lengths(mesh.faces, lengths_of(mesh.vertices, mesh.faces))
    assert len(twin.vertices) <= given
    return twin


def flat_torus(columns: int, rows: int, width: float, height: float) -> gc.TriangleMesh:
    """Squares cut in two; vertex ``columns * j + i`` at (i, j) of the grid."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(columns), np.arange(rows)))
    at = [((j + dj) % rows) * columns + (i + di) % columns for dj in (0, 1) for di in (0, 1)]
    faces = np.concatenate([np.stack([at[0], at[1], at[3]], 1), np.stack([at[0], at[3], at[2]], 1)])
    x, y = width / columns, height / rows
    skew = math.hypot(x, y)
    lengths = np.repeat([[x, y, skew], [skew, x, y]], columns * rows, axis=0)
    return gc.TriangleMesh.from_lengths(faces, lengths)


def on_torus(mesh, columns, rows, width, height, point) -> np.ndarray:
    """The place of a point in the plane of which the torus is a quotient."""
    corner, (first, *_) = mesh.faces[point.face_index], mesh.faces[point.face_index]
    places = np.stack([corner % columns, corner // columns], 1).astype(float)
    base = np.array([first % columns, first // columns])
    places = base + (places - base + [columns // 2, rows // 2]) % [columns, rows]
    places -= [columns // 2, rows // 2]
    return np.array(point.barycentric) @ places * [width / columns, height / rows]


@pytest.mark.jit
@pytest.mark.parametrize(("columns", "rows"), [(17, 12), (40, 33), (5, 4), (3, 3)])
def test_on_a_flat_torus_all_is_as_in_the_plane_modulo_its_sides(columns, rows):
    width, height = 1.7, 1.2
    mesh = flat_torus(columns, rows, width, height)
    numbers, size = np.arange(columns * rows), np.array([width, height])
    places = np.stack([numbers % columns, numbers // columns], 1) * size / [columns, rows]
    for source in sources_of(mesh, 9, columns):
        if source.vertex_index is not None:
            start = places[source.vertex_index]
        else:
            start = on_torus(mesh, columns, rows, width, height, source)
        away = (places - start + size / 2) % size - size / 2
        exact = np.hypot(*away.T)
        field = gc.exact_distance(mesh, source)
        np.testing.assert_allclose(field.distances, exact, atol=SAME)
        matrix = gc.distance_matrix(mesh, [source], range(len(places)))
        np.testing.assert_allclose(np.asarray(matrix).reshape(-1), exact, atol=SAME)
        is_clear = (np.abs(np.abs(away) - size / 2) > 1e-9).all(axis=1) & (exact > 0)
        log_map = gc.log_map(mesh, source)
        seen = np.flatnonzero(is_clear)
        turned = apart(log_map.angles[seen] - log_map.angles[seen[0]], 0.0)
        true = np.arctan2(away[seen, 1], away[seen, 0])
        assert apart(turned, apart(true - true[0], 0.0)).max() <= 1e-11
        for v in seen[:: max(1, len(seen) // 7)].tolist():
            path = gc.shortest_path(mesh, source, v)
            assert path.length == pytest.approx(exact[v], abs=SAME)
            assert field.path_to(v).length == pytest.approx(exact[v], abs=SAME)
            line = gc.trace(mesh, source, log_map.angles[v], exact[v])
            assert line.stopped == "length"
            assert gc.exact_distance(mesh, v, targets=[line.locations[-1]]).distance_at(
                line.locations[-1]
            ) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.jit
def test_lines_of_equal_distance_and_borders_are_locations():
    """On a flat torus: circles, and the two lines halfway between two sources."""
    mesh = flat_torus(20, 20, 1.0, 1.0)
    other = 10  # half of the way around
    field = gc.exact_distance(mesh, [0, other])
    for line in field.isolines([0.2], chord_error=1e-7)[0]:
        assert line.closed
        assert line.length == pytest.approx(2.0 * np.pi * 0.2, rel=1e-5)
        found = [field.distance_at(point) for point in line.locations[::40]]
        np.testing.assert_allclose(found, 0.2, rtol=1e-9)
    borders = field.borders()
    assert sum(line.length for line in borders) == pytest.approx(2.0, rel=1e-9)
    assert all(line.closed and line.sources == (0, 1) for line in borders)
    away = gc.exact_distance(mesh, borders[0]).distances
    assert away[[0, other]] == pytest.approx([0.25, 0.25], abs=SAME)


@pytest.mark.jit
@zoo.each(ALL)
def test_a_surface_and_its_twin_without_positions_agree(case):
    mesh = mesh_of(case)
    if mesh.report.zero_length_edges.count:
        with pytest.raises(InvalidMesh, match="has the lengths"):
            twin_of(mesh)
        return
    twin = twin_of(mesh)
    used = len(twin.vertices)
    # Lengths that are rounded leave a thin face fewer digits of its height.
    thinnest = mesh.topology.geometry[:, SIN_LEFT].min()
    rounding = SAME * mesh.diagonal * max(1.0, 0.1 / max(thinnest, 1e-4))
    for source in sources_of(mesh, 4):
        if source.vertex_index is not None and source.vertex_index >= used:
            continue
        for solve in (gc.exact_distance, gc.approximate_distance, gc.fast_distance):
            mine, theirs = (solve(each, source, retain="paths") for each in (mesh, twin))
            reached = np.isfinite(theirs.distances)
            difference = np.abs(mine.distances[:used][reached] - theirs.distances[reached])
            if solve is gc.exact_distance:
                assert difference.max(initial=0.0) <= rounding
            assert (np.isinf(mine.distances[:used]) == np.isinf(theirs.distances)).all()
        if not mesh.report.inconsistent_orientation:  # else seams lie elsewhere on the twin
            totals = [gc.log_map(each, source).total_angle for each in (mesh, twin)]
            assert totals[0] == pytest.approx(totals[1], abs=1e-10)
        for v in np.flatnonzero(np.isfinite(mine.distances[:used]))[:7].tolist():
            path = gc.shortest_path(twin, source, v)
            length = gc.shortest_path(mesh, source, v).length
            assert path.length == pytest.approx(length, abs=10 * rounding)
            with pytest.raises(InvalidArgument, match="use locations"):
                path.points  # noqa: B018
        nearest = [gc.nearest(each, source, range(used), min(3, used)) for each in (mesh, twin)]
        np.testing.assert_allclose(nearest[0].distances, nearest[1].distances, atol=rounding)


@zoo.each(zoo.SMALL)
def test_lengths_may_be_other_than_those_of_the_vertices(case):
    """Twice as long everywhere, at the same positions: twice as far."""
    mesh = mesh_of(case)
    if mesh.report.zero_length_edges.count:
        return
    twice = mesh.with_lengths(2.0 * lengths_of(mesh.vertices, mesh.faces))
    for source in sources_of(mesh, 4):
        distances = gc.exact_distance(mesh, source).distances
        others = gc.exact_distance(twice, source).distances
        np.testing.assert_allclose(others, 2.0 * distances, rtol=SAME, atol=SAME * mesh.diagonal)
        for v in np.flatnonzero(np.isfinite(distances))[:9].tolist():
            path = gc.shortest_path(twice, source, v)
            assert path.length == pytest.approx(2.0 * distances[v], abs=1e-11 * mesh.diagonal)
            np.testing.assert_array_equal(path.points[-1], mesh.vertices[v])


def test_barriers_keep_the_lengths():
    mesh = flat_torus(8, 7, 2.0, 1.5)
    blocked = mesh.with_barriers([0, 1, 2])
    vertices, faces = zoo.grid(6, 5)
    plane = gc.TriangleMesh(vertices, faces)
    barriers = [3, 4, 11, 12, 20]
    flat = gc.TriangleMesh.from_lengths(plane.faces, lengths_of(plane.vertices, plane.faces))
    np.testing.assert_allclose(
        gc.exact_distance(flat, 0, barriers=barriers).distances,
        gc.exact_distance(plane, 0, barriers=barriers).distances,
        atol=SAME,
    )
    assert blocked.lengths is not None
    again = blocked.with_lengths(2.0 * mesh.lengths)
    assert again.barriers.tolist() == [0, 1, 2]
    np.testing.assert_allclose(
        gc.exact_distance(again, 9).distances, 2.0 * gc.exact_distance(blocked, 9).distances
    )


def test_arrays_hold_the_lengths():
    mesh = flat_torus(5, 4, 1.0, 1.0)
    copy = gc.TriangleMesh.from_arrays(mesh.arrays())
    np.testing.assert_array_equal(copy.lengths, mesh.lengths)
    np.testing.assert_array_equal(
        gc.exact_distance(copy, 3).distances, gc.exact_distance(mesh, 3).distances
    )


@pytest.mark.parametrize("with_vertices", [False, True])
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_of_arrays_is_read(with_vertices, save, tmp_path):
    mesh = flat_torus(5, 4, 1.0, 1.0)
    places = np.random.default_rng(1).random((20, 3))
    arrays = {"faces": mesh.faces, "lengths": mesh.lengths}
    file = io.BytesIO()
    save(file, **arrays, **({"vertices": places} if with_vertices else {}))
    path = tmp_path / "torus.npz"
    path.write_bytes(file.getvalue())
    for source, kind in ((path, None), (file.getvalue(), None), (file.getvalue(), "npz")):
        read = gc.load_mesh(source, kind)
        np.testing.assert_array_equal(read.lengths, mesh.lengths)
        assert read.has_positions == with_vertices
    with pytest.raises(InvalidArgument, match="merge"):
        gc.load_mesh(path, merge="exact")
    with pytest.raises(gc.errors.TooManyFaces):
        gc.load_mesh(path, max_faces=39)
    with pytest.raises(gc.errors.FileTooLarge):
        gc.load_mesh(path, max_bytes=100)
    np.savez(path, faces=mesh.faces)
    with pytest.raises(InvalidMesh, match="must have faces, and vertices, lengths or both"):
        gc.load_mesh(path)


def test_an_archive_of_vertices_and_faces_is_read(tmp_path):
    mesh = gc.samples.plane(200)
    path = tmp_path / "plane.npz"
    np.savez(path, vertices=mesh.vertices, faces=mesh.faces, parts=np.arange(3))
    read = gc.load_mesh(path)
    assert read.lengths is None
    assert read.vertices.tobytes() == mesh.vertices.tobytes()
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.savez(
        path, vertices=mesh.vertices[mesh.faces.reshape(-1)], faces=np.arange(600).reshape(-1, 3)
    )
    assert len(gc.load_mesh(path, merge="exact").vertices) == len(mesh.vertices)


@pytest.mark.parametrize("name", ["faces", "lengths", "vertices"])
def test_an_array_that_declares_more_than_it_holds_is_refused(name):
    """Without reserving the memory; and so is a face that names a vertex far beyond all others."""
    arrays = {
        "faces": np.array(TETRAHEDRON),
        "lengths": np.ones((4, 3)),
        "vertices": np.eye(4)[:, :3],
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for each, array in arrays.items():
            content = io.BytesIO()
            np.save(content, array)
            data = content.getvalue()
            if each == name:
                data = data.replace(b"(4, 3), }" + b" " * 12, b"(4000000000000, 3), }")
                assert b"4000000000000" in data
            archive.writestr(f"{each}.npy", data)
    with pytest.raises(InvalidMesh, match=f"array {name} of the NPZ file declares"):
        gc.load_mesh(file.getvalue())
    with pytest.raises(InvalidMesh, match="vertices are numbered 0 to 11"):
        gc.TriangleMesh.from_lengths([[0, 1, 2], *TETRAHEDRON[1:3], [1, 3, 2**40]], np.ones((4, 3)))


def test_what_needs_space_says_so():
    mesh = flat_torus(5, 4, 1.0, 1.0)
    field = gc.exact_distance(mesh, 0)
    for ask in (
        lambda: mesh.locate([0, 0, 0]),
        lambda: mesh.position(0),
        mesh.tangent_frames,
        mesh.to_trimesh,
        mesh.to_pyvista,
        lambda: field.isolines([0.2])[0][0].points,
        lambda: field.isolines([0.2])[0][0].save("line.csv"),
        lambda: gc.shortest_path(mesh, 0, 7).to_pyvista(),
    ):
        with pytest.raises(NotEmbedded, match="lengths alone") as refusal:
            ask()
        assert "\n" not in str(refusal.value)
    assert mesh.report.bounds is None
    for ask in (
        lambda: field.gradient,
        lambda: gc.trace(mesh, 0, [1.0, 0.0, 0.0], 1.0),
        lambda: gc.log_map(mesh, 0, x_axis=[1.0, 0.0, 0.0]),
    ):
        with pytest.raises(InvalidArgument, match="use angles"):
            ask()
    assert mesh.report.euler_characteristic == 0
    assert mesh.report.mean_edge_length > 0.0
    assert mesh.report.near_vertices.count == mesh.report.duplicate_vertices.count == 0
    assert "TriangleMesh" in mesh._repr_html_()


TETRAHEDRON = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, 1e-60, 1e200])
def test_a_length_must_be_a_number_in_range(bad):
    lengths = np.ones((4, 3))
    lengths[2, 1] = bad
    with pytest.raises(InvalidMesh, match="face 2 has the lengths") as refusal:
        gc.TriangleMesh.from_lengths(TETRAHEDRON, lengths)
    assert refusal.value.elements == (2,)


@pytest.mark.parametrize("lengths", [np.ones(12), np.ones((3, 3)), "long", [[1, 2], [3]]])
def test_lengths_have_the_shape_of_faces(lengths):
    with pytest.raises(InvalidMesh, match="lengths"):
        gc.TriangleMesh.from_lengths(TETRAHEDRON, lengths)


def test_rounded_length_is_how_far_faces_may_disagree_on_their_edge():
    lengths = np.ones((4, 3))
    lengths[0, 1], lengths[3, 2] = 1.2, 1.3
    with pytest.raises(
        InvalidMesh, match=r"between the vertices 1 and 2 .* 1\.2.* 1\.3"
    ) as refusal:
        gc.TriangleMesh.from_lengths(TETRAHEDRON, lengths)
    assert refusal.value.kind == "edge"
    assert refusal.value.elements == ((1, 2),)
    lengths[3, 2] = 1.2 * (1.0 + ROUNDED_LENGTH / 2.0)
    mesh = gc.TriangleMesh.from_lengths(TETRAHEDRON, lengths)
    assert mesh.lengths[3, 2] == mesh.lengths[0, 1] == 1.2


def test_the_triangle_inequality_holds_and_equality_is_a_face_without_area():
    with pytest.raises(InvalidMesh, match=r"face 1 .* longer than the other two") as refusal:
        gc.TriangleMesh.from_lengths([[0, 1, 2], [0, 2, 3]], [[1, 1, 1], [1, 2.5, 1]])
    assert refusal.value.elements == (1,)
    flat = gc.TriangleMesh.from_lengths([[0, 1, 2], [0, 2, 3]], [[1, 1, 1], [1, 2, 1]])
    assert flat.report.degenerate_faces.ids == (1,)
    assert gc.exact_distance(flat, 2).distances.round(12).tolist() == [1.0, 1.0, 0.0, 2.0]


def test_a_needle_loses_no_digits():
    """Against the same triangle in space, whose angles come from products."""
    for height in (1e-3, 1e-8, 1e-11):
        corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, height, 0.0]])
        mesh = gc.TriangleMesh(corners, [[0, 1, 2]])
        twin = gc.TriangleMesh.from_lengths([[0, 1, 2]], lengths_of(corners, [[0, 1, 2]]))
        excess = lengths_of(corners, [[0, 1, 2]])[0]
        rounding = 1e-15 / max(excess[1] + excess[2] - 1.0, 1e-300)
        angles = (gc.log_map(each, 2).total_angle for each in (mesh, twin))
        assert next(angles) == pytest.approx(next(angles), abs=min(1e-12 + rounding, 1.0))
