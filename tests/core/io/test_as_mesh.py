"""Meshes of other libraries, arrays and paths: each is taken where a mesh is asked for."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import trimesh
from pyvista import ImageData, PolyData

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh
from tests.support.fresh import told_by

BALL = gc.samples.sphere(320)
V, F = BALL.vertices, BALL.faces


class Open3DMesh:
    """A mesh with the attributes of Open3D's, whose vectors convert to arrays."""

    class Vector:
        def __init__(self, rows: Any) -> None:
            self.rows = rows

        def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
            return np.array(self.rows, dtype=dtype)

    vertices = Vector(V)
    triangles = Vector(F)


def ball_file(folder: Path) -> Path:
    path = folder / "ball.off"
    rows = [f"OFF\n{len(V)} {len(F)} 0"]
    rows += [" ".join(map(repr, row)) for row in V.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in F.tolist()]
    path.write_text("\n".join(rows))
    return path


GIVEN = {
    "mesh": lambda _: BALL,
    "arrays": lambda _: (V, F),
    "lists": lambda _: [V.tolist(), F.tolist()],
    "path": ball_file,
    "text": lambda folder: str(ball_file(folder)),
    "trimesh": lambda _: trimesh.Trimesh(V, F, process=False),
    "pyvista": lambda _: PolyData.from_regular_faces(V, F),
    "meshio": lambda _: meshio.Mesh(V, [("triangle", F)]),
    "open3d": lambda _: Open3DMesh(),
}
given = pytest.mark.parametrize("kind", GIVEN)


@given
def test_each_kind_is_the_same_mesh(kind: str, tmp_path: Path) -> None:
    mesh = gc.as_mesh(GIVEN[kind](tmp_path))
    assert isinstance(mesh, gc.TriangleMesh)
    np.testing.assert_array_equal(mesh.vertices, V)
    np.testing.assert_array_equal(mesh.faces, F)
    assert mesh.warnings == ()


@given
@pytest.mark.jit
def test_all_functions_take_each_kind(kind: str, tmp_path: Path) -> None:
    ball = GIVEN[kind](tmp_path)
    expected = gc.exact_distance(BALL, 0).distances
    assert gc.exact_distance(ball, 0).distances.tolist() == expected.tolist()
    assert gc.approximate_distance(ball, 0).distances[7] <= expected[7]
    assert gc.fast_distance(ball, 0).distances[7] >= expected[7] * (1 - 1e-12)
    assert gc.shortest_path(ball, 0, 7).length == pytest.approx(expected[7])
    assert gc.distance_matrix(ball, [0], [7]) == pytest.approx(expected[7])
    assert gc.nearest(ball, 0, [7]).distances == pytest.approx(expected[7])
    assert gc.Solver(ball).mesh.faces.tolist() == F.tolist()


def test_a_mesh_that_is_one_already_is_not_prepared_again() -> None:
    assert gc.as_mesh(BALL) is BALL
    assert gc.Solver(BALL).mesh is BALL


@pytest.mark.parametrize(
    "thing",
    [None, 3, V, {"vertices": V}, (V,), [V, F, F], trimesh.PointCloud(V), object()],
    ids=lambda thing: type(thing).__name__,
)
def test_anything_else_is_refused_with_what_is_taken(thing: Any) -> None:
    with pytest.raises(InvalidMesh) as raised:
        gc.exact_distance(thing, 0)
    assert str(raised.value) == (
        f"a mesh cannot be made from this {type(thing).__name__}: give a TriangleMesh, (vertices, "
        "faces), a file, or a mesh of trimesh, meshio, VTK, PyVista, Open3D, nibabel, nilearn, "
        "PyMeshLab, vedo, COMPAS or SciPy"
    )


def test_a_path_that_leads_nowhere_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidMesh, match=r"cannot read .*nowhere.ply: No such file"):
        gc.shortest_path(tmp_path / "nowhere.ply", 0, 1)


SQUARES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], float)


def test_polygons_of_pyvista_are_triangulated_in_place_and_lines_left_out() -> None:
    mixed = PolyData(SQUARES, faces=[4, 0, 1, 2, 3, 3, 1, 4, 5, 3, 1, 5, 2], lines=[2, 0, 5])
    mesh = gc.as_mesh(mixed)
    assert mesh.face_map is not None
    assert mesh.face_map.tolist() == [0, 0, 1, 2]
    assert mesh.faces[2:].tolist() == [[1, 4, 5], [1, 5, 2]]
    assert mesh.warnings == ("1 line cells of the mesh were left out.",)


def test_polygons_of_meshio_are_triangulated_in_place_and_lines_left_out() -> None:
    blocks = [("line", [[0, 5]]), ("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 5], [1, 5, 2]])]
    mesh = gc.as_mesh(meshio.Mesh(SQUARES, blocks))
    assert mesh.face_map is not None
    assert mesh.face_map.tolist() == [0, 0, 1, 2]
    assert len(mesh.warnings) == 1


def test_points_of_meshio_may_lie_in_the_plane() -> None:
    mesh = gc.as_mesh(meshio.Mesh(SQUARES[:, :2], [("quad", [[0, 1, 2, 3]])]))
    assert mesh.vertices.tolist() == SQUARES.tolist()


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (meshio.Mesh(SQUARES, [("tetra", [[0, 1, 2, 3]])]), "cells of type 'tetra' are not polyg"),
        (meshio.Mesh(SQUARES, [("line", [[0, 1]])]), "no faces"),
        (meshio.Mesh(SQUARES, [("triangle", [[0, 1, 9]])]), "numbered 0 to 5"),
        (ImageData(dimensions=(3, 3, 3)), "ImageData is not a surface: it has 8 voxel cells. Extr"),
        (PolyData(SQUARES), "PolyData is not a surface: it has 6 vertex cells"),
        (PolyData(), "it has no cells"),
        (trimesh.Trimesh(SQUARES, [[0, 1, 9]], process=False), "numbered 0 to 5"),
        (SimpleNamespace(vertices="abc", triangles=[[0, 1, 2]]), "vertices have type"),
        (SimpleNamespace(vertices=SQUARES, faces=[[0.5, 1, 2]]), "faces have type float64"),
        ((SQUARES, None), "faces have shape"),
    ],
)
def test_a_mesh_that_is_no_surface_is_refused(thing: Any, message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        gc.as_mesh(thing)


@pytest.mark.jit
@pytest.mark.slow
def test_no_library_is_imported_to_know_its_meshes() -> None:
    work = (
        "import sys, geodesic_core as gc\n"
        "gc.exact_distance(([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), 0)\n"
        "print(*{'trimesh', 'meshio', 'pyvista', 'open3d'} & set(sys.modules))"
    )
    assert told_by(work) == "\n"


@pytest.mark.jit
def test_one_point_needs_no_list() -> None:
    middle = gc.SurfacePoint.face(12, (0.2, 0.3, 0.5))
    solver = gc.Solver(BALL)
    for one in (7, np.int64(7), middle):
        assert gc.distance_matrix(BALL, 0, one).shape == (1, 1)
        assert gc.distance_matrix(BALL, 0, one) == solver.distance_matrix([0], [one])
        assert gc.nearest(BALL, 0, one).indices.tolist() == [0]
        field = gc.exact_distance(BALL, 0, targets=one)
        assert field.distance_at(one) == pytest.approx(gc.distance_matrix(BALL, 0, one)[0, 0])
        by_way, straight = (gc.shortest_path(BALL, 0, 30, way) for way in (one, ()))
        assert by_way.length > straight.length


@pytest.mark.parametrize("points", [3.5, "7"])
def test_what_is_no_point_is_refused(points: Any) -> None:
    for ask in (
        lambda: gc.exact_distance(BALL, 0, targets=points),
        lambda: gc.shortest_path(BALL, 0, 7, points),
        lambda: gc.distance_matrix(BALL, 0, points),
        lambda: gc.nearest(BALL, 0, points),
    ):
        with pytest.raises(InvalidArgument, match="it must be a point, or a sequence of points"):
            ask()
