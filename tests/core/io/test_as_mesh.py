"""Meshes of other libraries, arrays and paths: each is taken where a mesh is asked for."""

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import trimesh
from nibabel.gifti import GiftiDataArray, GiftiImage
from pyvista import ImageData, MultiBlock, PolyData
from scipy.spatial import ConvexHull, Delaunay
from vtkmodules.vtkCommonDataModel import vtkPolyData

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh
from geodesic_core.io.as_mesh import MeshLike
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


def gifti_image() -> Any:
    arrays = [
        GiftiDataArray(V, "NIFTI_INTENT_POINTSET", datatype="float64"),
        GiftiDataArray(F.astype(np.int32), "NIFTI_INTENT_TRIANGLE"),
    ]
    return GiftiImage(darrays=arrays)


def plain_vtk() -> Any:
    plain = vtkPolyData()
    plain.DeepCopy(PolyData.from_regular_faces(V, F))
    return plain


def imitation(**members: Any) -> Any:
    """Return an object with the attributes of another library's, which is not installed."""
    return SimpleNamespace(**members)


def poly_mesh(**vertices: np.ndarray) -> Any:
    """Return what nilearn has for one hemisphere or both."""
    parts = {
        side: imitation(coordinates=each, faces=F, n_vertices=len(each))
        for side, each in vertices.items()
    }
    return imitation(parts=parts, n_vertices=sum(map(len, vertices.values())))


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
    "open3d of tensors": lambda _: imitation(
        vertex=imitation(positions=imitation(numpy=lambda: V)), triangle=imitation(indices=F)
    ),
    "skimage's marching cubes": lambda _: (V, F, V, V[:, 0]),
    "igl with texture": lambda _: (V, F, None),
    "dictionary": lambda _: {"vertices": V, "faces": F},
    "nilearn's arrays": lambda _: {"coordinates": V, "faces": F},
    "mne": lambda _: {"rr": V, "tris": F, "nn": V, "np": len(V), "ntri": len(F)},
    "nilearn": lambda _: imitation(coordinates=V, faces=F, n_vertices=len(V)),
    "nilearn's PolyMesh": lambda _: poly_mesh(left=V),
    "nilearn's SurfaceImage": lambda _: imitation(mesh=poly_mesh(right=V), data=0),
    "pymeshlab": lambda _: imitation(vertex_matrix=lambda: V, face_matrix=lambda: F),
    "vedo": lambda _: imitation(vertices=V, cells=F.tolist(), dataset=plain_vtk()),
    "compas": lambda _: imitation(
        vertex={"a": 0}, face={"b": 0}, to_vertices_and_faces=lambda: (V.tolist(), F.tolist())
    ),
    "brainspace": lambda _: imitation(
        IsA=lambda _name: True, GetDataObjectType=lambda: 0, VTKObject=plain_vtk()
    ),
    "nibabel": lambda _: gifti_image(),
    "scene": lambda _: trimesh.Scene([trimesh.Trimesh(V, F, process=False)]),
    "blocks": lambda _: MultiBlock([PolyData.from_regular_faces(V, F)]),
    "vtk": lambda _: plain_vtk(),
    "bytes": lambda folder: ball_file(folder).read_bytes(),
    "open file": lambda folder: io.BytesIO(ball_file(folder).read_bytes()),
}
given = pytest.mark.parametrize("kind", GIVEN)


@given
def test_each_kind_is_the_same_mesh(kind: str, tmp_path: Path) -> None:
    mesh = gc.as_mesh(GIVEN[kind](tmp_path))
    assert isinstance(mesh, gc.TriangleMesh)
    np.testing.assert_array_equal(mesh.vertices, V)
    np.testing.assert_array_equal(mesh.faces, F)
    assert mesh.warnings == ()


def test_hemispheres_are_joined_in_their_order() -> None:
    mesh = gc.as_mesh(poly_mesh(left=V, right=V + 3.0))
    np.testing.assert_array_equal(mesh.vertices, np.concatenate([V, V + 3.0]))
    np.testing.assert_array_equal(mesh.faces, np.concatenate([F, F + len(V)]))


@pytest.mark.parametrize("kind", ["mesh", "lists", "path", "trimesh", "pyvista", "scene", "mne"])
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


SQUARE = SQUARES[:4]
HALVES = [[0, 1, 2], [0, 2, 3]]


def test_the_parts_of_a_scene_are_placed_and_joined() -> None:
    scene = trimesh.Scene()
    part = trimesh.Trimesh(SQUARE, HALVES, process=False)
    scene.add_geometry(part, geom_name="square", node_name="here")
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
    turned[:3, 3] = [5, 0, 0]
    scene.graph.update("there", geometry="square", matrix=turned)  # the same part once more
    scene.add_geometry(trimesh.Trimesh(2 * SQUARE, HALVES, process=False))
    mesh = gc.as_mesh(scene)
    x, y, z = SQUARE.T
    expected = [SQUARE, np.stack([5 - y, x, z], axis=1), 2 * SQUARE]
    np.testing.assert_allclose(mesh.vertices, np.concatenate(expected), atol=1e-14)
    assert mesh.faces.tolist() == [[i + 4 * k for i in face] for k in range(3) for face in HALVES]


def test_hulls_and_triangulations_of_scipy_keep_the_numbers_of_their_points() -> None:
    cube = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T.astype(float)
    hull = gc.exact_distance(ConvexHull(cube), 0)
    assert hull.mesh.vertices.tolist() == cube.tolist()
    assert hull.distances.max() == pytest.approx(np.sqrt(5))
    flat = gc.exact_distance(Delaunay(SQUARE[:, :2]), 0)
    np.testing.assert_allclose(flat.distances, np.linalg.norm(SQUARE, axis=1))


def test_polygons_of_other_libraries_are_triangulated() -> None:
    for thing in (
        imitation(to_vertices_and_faces=lambda: (SQUARES, [[0, 1, 2, 3], [1, 4, 5, 2]])),
        imitation(vertices=SQUARES, cells=[[0, 1, 2, 3], [1, 4, 5, 2]], dataset=None),
    ):
        mesh = gc.as_mesh(thing)
        assert mesh.face_map is not None
        assert mesh.face_map.tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize(
    ("thing", "remedy"),
    [
        (imitation(current_mesh=lambda: None), r"one, as meshes.current_mesh\(\)"),
        (imitation(recursive_unpack=0), "one, as assembly.unpack"),
    ],
)
def test_what_may_hold_several_meshes_says_how_to_give_one(thing: Any, remedy: str) -> None:
    with pytest.raises(InvalidMesh, match=f"may hold several meshes: give {remedy}"):
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


class PyMeshLabMesh:
    """A mesh with the methods of PyMeshLab's."""

    def vertex_matrix(self) -> np.ndarray:
        return V

    def face_matrix(self) -> np.ndarray:
        return F


class CompasMesh:
    """A mesh with the method of COMPAS's."""

    def to_vertices_and_faces(self) -> tuple[list[list[float]], list[list[int]]]:
        return V.tolist(), F.tolist()


class TensorMesh:
    """A mesh with the maps of Open3D's meshes of tensors."""

    vertex = imitation(positions=V)
    triangle = imitation(indices=F)


class NilearnMesh:
    """A mesh with the arrays of nilearn's."""

    coordinates = V
    faces = F


def test_type_checkers_know_the_meshes_of_other_libraries() -> None:
    meshes: list[MeshLike] = [
        trimesh.Scene([trimesh.Trimesh(V, F, process=False)]),
        PyMeshLabMesh(),
        CompasMesh(),
        TensorMesh(),
        Open3DMesh(),
        NilearnMesh(),
        plain_vtk(),
        gifti_image(),
    ]
    for mesh in meshes:
        np.testing.assert_array_equal(gc.as_mesh(mesh).faces, F)


class SourceSpaces(list[Any]):
    """The two hemispheres of MNE's class, each a dictionary."""


def test_lists_of_meshes_say_that_one_is_to_be_given() -> None:
    hemisphere = {"rr": V, "tris": F, "nn": V}
    part = trimesh.Trimesh(V, F, process=False)
    for several, name in (
        (SourceSpaces([hemisphere, hemisphere]), "SourceSpaces holds 2 meshes"),
        (SourceSpaces([hemisphere]), "SourceSpaces holds 1 meshes"),
        ([BALL, BALL, BALL], "list holds 3 meshes"),
        ((part, part), "tuple holds 2 meshes"),
        ([PolyData.from_regular_faces(V, F)] * 2, "list holds 2 meshes"),
    ):
        with pytest.raises(InvalidMesh, match=rf"{name}: give one of them, as meshes\[0\]"):
            gc.as_mesh(several)
        assert len(gc.as_mesh(several[0]).faces) == len(F)
