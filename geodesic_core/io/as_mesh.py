"""Meshes as callers hold them: arrays, files, and the objects of other libraries.

None of these libraries is imported: an object is known by its attributes.
"""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.brain import surface_arrays
from geodesic_core.io.load import load_mesh
from geodesic_core.io.unpacking import FileLike, is_file
from geodesic_core.io.vtk_polygons import polygons_of
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class _Trimesh(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _Scene(Protocol):
    def to_mesh(self) -> Any: ...


class _Meshio(Protocol):
    @property
    def points(self) -> Any: ...
    @property
    def cells(self) -> Any: ...


class _VtkObject(Protocol):
    def IsA(self, name: str) -> bool: ...  # noqa: N802 - VTK's name


class _Open3D(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...


class _Open3DTensors(Protocol):
    @property
    def vertex(self) -> Any: ...
    @property
    def triangle(self) -> Any: ...


class _Nibabel(Protocol):
    def get_arrays_from_intent(self, intent: Any, /) -> Any: ...


class _Nilearn(Protocol):
    @property
    def coordinates(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _PyMeshLab(Protocol):
    def vertex_matrix(self) -> Any: ...
    def face_matrix(self) -> Any: ...


class _Vedo(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def cells(self) -> Any: ...


class _Compas(Protocol):
    def to_vertices_and_faces(self) -> Any: ...


class _SciPy(Protocol):
    @property
    def points(self) -> Any: ...
    @property
    def simplices(self) -> Any: ...


_Known = (
    _Trimesh
    | _Scene
    | _Meshio
    | _VtkObject
    | _Open3D
    | _Open3DTensors
    | _Nibabel
    | _Nilearn
    | _PyMeshLab
    | _Vedo
    | _Compas
    | _SciPy
)
"""Meshes of other libraries, as far as types tell them from other objects."""
MeshLike = (
    TriangleMesh | tuple[Any, ...] | list[ArrayLike] | Mapping[str, ArrayLike] | FileLike | _Known
)
"""All that `as_mesh` takes"""


def as_mesh(mesh: MeshLike) -> TriangleMesh:
    """Return an object as a `TriangleMesh`; all functions take the same objects.

    Vertices keep their numbers. Polygons become triangles, as in `load_mesh`. For several calls,
    convert once: each call with another object prepares the mesh again.

    Parameters
    ----------
    mesh
        A `TriangleMesh`, which is returned as it is; a tuple that begins with vertices and faces; a
        file, as for `load_mesh`; a dictionary of arrays, as MNE has them; or a mesh of trimesh (a
        scene's parts are placed and joined), meshio, VTK or PyVista (data sets, and composite ones
        joined), Open3D, nibabel (``GiftiImage``), nilearn (the parts of a ``PolyMesh`` or of a
        ``SurfaceImage`` joined), PyMeshLab, vedo, COMPAS or SciPy (``ConvexHull``, ``Delaunay`` of
        points in a plane).

    Returns
    -------
    TriangleMesh
        Of the same (V, 3) positions.

    Raises
    ------
    InvalidMesh
        The object is none of these, holds something other than polygons, or holds a mesh that
        `TriangleMesh` refuses.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> import trimesh
    >>> gc.as_mesh(trimesh.creation.box())
    TriangleMesh(8 vertices, 12 faces)
    >>> gc.as_mesh(([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]))
    TriangleMesh(3 vertices, 1 faces)
    """
    if isinstance(mesh, TriangleMesh):
        return mesh
    if isinstance(mesh, tuple | list) and any(map(_is_mesh, mesh)):
        raise InvalidMesh(
            f"this {type(mesh).__name__} holds {len(mesh)} meshes: give one of them, as meshes[0]"
        )
    if (isinstance(mesh, tuple) and len(mesh) > 1) or (isinstance(mesh, list) and len(mesh) == 2):
        return TriangleMesh(mesh[0], mesh[1])
    if isinstance(mesh, Mapping):
        for vertices, faces in _ARRAYS:
            if vertices in mesh and faces in mesh:
                return TriangleMesh(mesh[vertices], mesh[faces])
    read = _reader_of(mesh)
    if read is not None:
        return read(mesh)
    if is_file(mesh):
        return load_mesh(mesh)
    for attribute, remedy in _SEVERAL:
        if hasattr(mesh, attribute):
            raise InvalidMesh(f"this {type(mesh).__name__} may hold several meshes: give {remedy}")
    raise InvalidMesh(
        f"a mesh cannot be made from this {type(mesh).__name__}: give a TriangleMesh, (vertices, "
        "faces), a file, or a mesh of trimesh, meshio, VTK, PyVista, Open3D, nibabel, nilearn, "
        "PyMeshLab, vedo, COMPAS or SciPy"
    )


def _is_mesh(item: Any) -> bool:
    """Tell whether an item of a sequence is a mesh by itself, so that the sequence is none."""
    return isinstance(item, TriangleMesh | Mapping) or _reader_of(item) is not None


def _reader_of(mesh: Any) -> Callable[[Any], TriangleMesh] | None:
    """Return what reads the object of another library; None where none is known by it."""
    readers = (read for names, read in _READERS if all(hasattr(mesh, name) for name in names))
    return next(readers, None)


def _from_vtk(data: Any) -> TriangleMesh:
    data = getattr(data, "VTKObject", data)  # BrainSpace wraps it
    try:
        points, corners, sizes, left_out = polygons_of(data)
    except ValueError as error:
        raise InvalidMesh(f"the {type(data).__name__} cannot be used: {error}") from None
    if len(sizes) == 0:
        cells = ", ".join(f"{count} {name}" for name, count in left_out.items()) or "no cells"
        raise InvalidMesh(
            f"the {type(data).__name__} is not a surface: it has {cells}. Extract its surface "
            "first, which renumbers points (PyVista: data.extract_surface())"
        )
    notes = [_left_out(count, name) for name, count in left_out.items()]
    return TriangleMesh.from_polygons(points, corners, sizes, notes=notes)


_POLYGONS = ("triangle", "quad", "polygon")
_BESIDE = ("vertex", "line")


def _from_meshio(mesh: Any) -> TriangleMesh:
    rows: list[Any] = []
    beside = 0
    for block in mesh.cells:
        if block.type in _BESIDE:
            beside += len(block.data)
        elif block.type in _POLYGONS:
            rows += list(block.data)
        else:
            raise InvalidMesh(
                f"cells of type {block.type!r} are not polygons: a mesh of meshio may have cells "
                f"of the types {', '.join(_POLYGONS)}"
            )
    notes = [_left_out(beside, "vertices and lines")] if beside else []
    return _from_rows(_in_space(mesh.points), rows, notes)


def _from_rows(points: Any, rows: Iterable[Any], notes: Iterable[str] = ()) -> TriangleMesh:
    """Return the mesh of polygons that are rows of corners, of any lengths."""
    corners = [np.ravel(row) for row in rows]
    flat = np.concatenate(corners) if corners else np.empty(0, np.int64)
    return TriangleMesh.from_polygons(points, flat, list(map(len, corners)), notes=tuple(notes))


def _in_space(points: Any) -> Any:
    """Return points in the plane as points in space."""
    array = np.asarray(points)
    if array.ndim == 2 and array.shape[1] == 2:
        return np.pad(array, ((0, 0), (0, 1)))
    return points


def _left_out(count: int, kind: str) -> str:
    return f"{count} {kind} of the mesh were left out."


def _from_vedo(mesh: Any) -> TriangleMesh:
    if hasattr(mesh.dataset, "IsA"):
        return _from_vtk(mesh.dataset)
    return _from_rows(mesh.vertices, mesh.cells)


def _from_tensors(mesh: Any) -> TriangleMesh:
    arrays = mesh.vertex.positions, mesh.triangle.indices
    return TriangleMesh(*(each.numpy() if hasattr(each, "numpy") else each for each in arrays))


def _joined(parts: Iterable[Any]) -> TriangleMesh:
    """Return parts as one mesh, in their order."""
    return join_meshes([as_mesh(part) for part in parts])


def join_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return meshes as one, in whose numbers the vertices of each follow those before.

    Lengths and barriers stay.

    Raises
    ------
    InvalidMesh
        Lengths or positions are given for some of the meshes only.
    """
    if len(meshes) == 1:
        return meshes[0]
    ways = {(mesh.lengths is None, mesh.has_positions) for mesh in meshes}
    if len(ways) > 1:
        raise InvalidMesh(
            "some parts are given by positions and others by lengths: give all in the same way"
        )
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = _numbered([mesh.faces for mesh in meshes], [len(mesh.vertices) for mesh in meshes])
    lengths = [mesh.lengths for mesh in meshes if mesh.lengths is not None]
    if lengths:
        positions = vertices if meshes[0].has_positions else None
        joined = TriangleMesh.from_lengths(faces, np.concatenate(lengths), positions)
    else:
        joined = TriangleMesh(vertices, faces)
    barriers = _numbered([mesh.barriers for mesh in meshes], [len(mesh.faces) for mesh in meshes])
    return joined.with_barriers(barriers)


def _numbered(ids: Sequence[NDArray[Any]], counts: Sequence[int]) -> NDArray[Any]:
    """Return ids of several parts one after the other, where each part has so many."""
    firsts = np.cumsum([0, *counts[:-1]])
    return np.concatenate([part + first for part, first in zip(ids, firsts, strict=True)])


def _from_attributes(vertices: str, faces: str) -> Callable[[Any], TriangleMesh]:
    return lambda mesh: TriangleMesh(
        _in_space(getattr(mesh, vertices)), np.asanyarray(getattr(mesh, faces))
    )


_ARRAYS = (("vertices", "faces"), ("coordinates", "faces"), ("rr", "tris"))
"""Names of vertices and faces in dictionaries."""
_READERS: tuple[tuple[tuple[str, ...], Callable[[Any], TriangleMesh]], ...] = (
    (("IsA", "GetDataObjectType"), _from_vtk),  # and PyVista
    (("points", "cells", "cells_dict"), _from_meshio),
    (("geometry", "to_mesh"), lambda scene: as_mesh(scene.to_mesh())),  # trimesh
    (("get_arrays_from_intent",), lambda image: TriangleMesh(*surface_arrays(image))),  # nibabel
    (("vertices", "cells", "dataset"), _from_vedo),
    (
        ("vertex_matrix", "face_matrix"),  # PyMeshLab
        lambda mesh: TriangleMesh(mesh.vertex_matrix(), mesh.face_matrix()),
    ),
    (("to_vertices_and_faces",), lambda mesh: _from_rows(*mesh.to_vertices_and_faces())),  # COMPAS
    (("vertex", "triangle"), _from_tensors),  # Open3D
    (("vertices", "faces"), _from_attributes("vertices", "faces")),  # trimesh
    (("vertices", "triangles"), _from_attributes("vertices", "triangles")),  # Open3D
    (("coordinates", "faces"), _from_attributes("coordinates", "faces")),  # nilearn
    (("parts", "n_vertices"), lambda mesh: _joined(mesh.parts.values())),  # nilearn's PolyMesh
    (("mesh", "data"), lambda image: as_mesh(image.mesh)),  # nilearn's SurfaceImage
    (("points", "simplices"), _from_attributes("points", "simplices")),  # SciPy
)
"""Attributes by which an object is known, the more telling ones first, and what reads it."""
_SEVERAL = (
    ("current_mesh", "one, as meshes.current_mesh()"),  # PyMeshLab's MeshSet
    ("recursive_unpack", "one, as assembly.unpack()[0]"),  # vedo's Assembly
)
"""Attributes of objects that hold meshes, and which mesh to give instead"""
