"""Meshes as callers hold them: arrays, paths, and the objects of other libraries.

None of these libraries is imported: an object is known by its attributes.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.load import load_mesh
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class _Trimesh(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _PolyData(Protocol):
    @property
    def points(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class _Meshio(Protocol):
    @property
    def points(self) -> Any: ...
    @property
    def cells(self) -> Any: ...


class _Open3D(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...


MeshLike = (
    TriangleMesh
    | tuple[ArrayLike, ArrayLike]
    | str
    | Path
    | _Trimesh
    | _PolyData
    | _Meshio
    | _Open3D
)
"""All that `as_mesh` takes."""


def as_mesh(mesh: MeshLike) -> TriangleMesh:
    """Return an object as a `TriangleMesh`; all functions take the same objects.

    Vertices keep their numbers. Polygons become triangles, as in `load_mesh`. For several calls,
    convert once: each call with another object prepares the mesh again.

    Parameters
    ----------
    mesh
        A `TriangleMesh`, which is returned as it is; the arrays ``(vertices, faces)``; the path of
        a file, as for `load_mesh`; or a mesh of trimesh, of meshio, of PyVista (``PolyData``) or of
        Open3D (``open3d.geometry.TriangleMesh``).

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
    if isinstance(mesh, str | Path):
        return load_mesh(mesh)
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        return TriangleMesh(*mesh)
    for attributes, read in _READERS:
        if all(hasattr(mesh, name) for name in attributes):
            return read(mesh)
    raise InvalidMesh(
        f"a mesh cannot be made from this {type(mesh).__name__}: give a TriangleMesh, (vertices, "
        "faces), the path of a file, or a mesh of trimesh, meshio, PyVista or Open3D"
    )


def _from_poly_data(data: Any) -> TriangleMesh:
    if data.n_strips:
        raise InvalidMesh("the PolyData has triangle strips: give data.triangulate()")
    corners, sizes = _split_rows(np.asarray(data.faces))
    left_out = data.n_cells - len(sizes)
    notes = [_left_out(left_out, "vertices and lines")] if left_out else []
    return TriangleMesh.from_polygons(data.points, corners, sizes, notes=notes)


def _split_rows(rows: Any) -> tuple[Any, list[int]]:
    """Return the corners and the sizes of polygons that are rows of a size and its corners."""
    width = 1 + int(rows[0]) if len(rows) else 1
    if len(rows) % width == 0 and (rows[::width] == width - 1).all():  # all of one size
        return rows.reshape(-1, width)[:, 1:].ravel(), [width - 1] * (len(rows) // width)
    sizes, starts, at = [], [], 0
    while at < len(rows):
        size = int(rows[at])
        sizes.append(size)
        starts.append(at)
        at += 1 + size
    return np.delete(rows, starts), sizes


def _from_grid(data: Any) -> TriangleMesh:
    raise InvalidMesh(
        f"a {type(data).__name__} of PyVista is not a surface: give data.extract_surface()"
    )


_POLYGONS = ("triangle", "quad", "polygon")
_BESIDE = ("vertex", "line")


def _from_meshio(mesh: Any) -> TriangleMesh:
    points = np.asarray(mesh.points)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.pad(points, ((0, 0), (0, 1)))
    corners: list[Any] = []
    sizes: list[int] = []
    beside = 0
    for block in mesh.cells:
        if block.type in _BESIDE:
            beside += len(block.data)
        elif block.type in _POLYGONS:
            corners += [np.ravel(row) for row in block.data]
            sizes += map(len, block.data)
        else:
            raise InvalidMesh(
                f"cells of type {block.type!r} are not polygons: a mesh of meshio may have cells "
                f"of the types {', '.join(_POLYGONS)}"
            )
    notes = [_left_out(beside, "vertices and lines")] if beside else []
    flat = np.concatenate(corners) if corners else np.empty(0, np.int64)
    return TriangleMesh.from_polygons(points, flat, sizes, notes=notes)


def _left_out(count: int, kind: str) -> str:
    return f"{count} {kind} of the mesh were left out."


def _from_trimesh(mesh: Any) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces)


def _from_open3d(mesh: Any) -> TriangleMesh:
    return TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


_READERS: tuple[tuple[tuple[str, ...], Callable[[Any], TriangleMesh]], ...] = (
    (("points", "faces", "n_strips"), _from_poly_data),
    (("points", "extract_surface"), _from_grid),
    (("points", "cells", "cells_dict"), _from_meshio),
    (("vertices", "faces"), _from_trimesh),
    (("vertices", "triangles"), _from_open3d),
)
"""Attributes by which an object is known, the more telling ones first, and what reads it."""
