"""Loading of mesh files: their bytes become vertices and polygons in the file's own numbering.

OBJ, OFF, PLY, STL and GLB have readers of their own: those of trimesh (5.2) split vertices at
texture seams, group faces by material or by their number of corners, drop what is too short, trust
the counts of a header, and read sparse glTF positions as zeros. No file can have another one read.
"""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from collections.abc import Callable

import numpy as np

from geodesic_core.control import Control
from geodesic_core.errors import (
    InvalidArgument,
    InvalidMesh,
    MissingExtra,
    TooManyFaces,
    TooManyVertices,
    UnknownFileType,
)
from geodesic_core.io.brain import read_freesurfer, read_gifti
from geodesic_core.io.contents import FileContents
from geodesic_core.io.glb import read_glb, read_gltf
from geodesic_core.io.grid import read_grid
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.npz import read_npz
from geodesic_core.io.obj import read_obj
from geodesic_core.io.off import read_off
from geodesic_core.io.ply import read_ply
from geodesic_core.io.signatures import signature_of
from geodesic_core.io.stl import read_stl
from geodesic_core.io.unpacking import FileLike, NamedBytes, read_unpacked
from geodesic_core.io.vtk import read_vtk
from geodesic_core.mesh.triangle_mesh import Merge, TriangleMesh

_Reader = Callable[[bytes, int | None], FileContents]
"""Of the bytes of a file, with the most faces that are allowed, None for any number. All raise
`InvalidMesh` where the bytes are damaged or are no such file, and `TooManyFaces` before they parse
more faces than these."""
_READERS: dict[str, _Reader] = {
    "obj": read_obj,
    "off": read_off,
    "ply": read_ply,
    "stl": read_stl,
    "glb": read_glb,
    "gltf": read_gltf,
    "gii": read_gifti,
    "freesurfer": read_freesurfer,
    **dict.fromkeys(("vtk", "vtp", "vtu", "vts", "vtr", "vti"), read_vtk),
    "asc": read_grid,
    "npz": read_npz,
}
_AMBIGUOUS = ("asc",)
"""Suffixes that several types of files have"""


def load_mesh(
    source: FileLike,
    file_type: str | None = None,
    merge: Merge = "none",
    *,
    max_faces: int | None = None,
    max_vertices: int | None = None,
    max_bytes: int | None = None,
    cancel: Callable[[], bool] | None = None,
) -> TriangleMesh:
    r"""Read a mesh file: OBJ, OFF, PLY, STL, GLB, GIFTI, FreeSurfer, VTK, Esri ASCII grid or NPZ.

    Vertices keep the file's numbering and faces its order. Polygons become triangles, in place, and
    ``mesh.face_map`` leads from these to the polygon. Lines, points and curves are left out, and
    ``mesh.warnings`` say so.

    The parts of a glTF scene are placed by its nodes and put one after the other, in the order of
    its meshes; those that share their positions share vertices. Skins stand as their joints do at
    rest, and morph targets count by their default weights. An STL file has no numbering: its equal
    corners are always merged, in order of first appearance, and
    ``mesh.vertex_map[3 * face + corner]`` is the vertex. An NPZ file holds the arrays of
    `TriangleMesh`, ``vertices`` and ``faces``, or those of `TriangleMesh.from_lengths`: ``faces``,
    ``lengths`` and, where it is to be drawn, ``vertices``. Others that it holds are not read.

    Parameters
    ----------
    source
        A path, the bytes of a file, or a file object. It may be packed by gzip, bzip2 or xz, or be
        a zip archive that holds one mesh.
    file_type
        ``"obj"``, ``"off"``, ``"ply"``, ``"stl"``, ``"glb"``, ``"gltf"``, ``"gii"``,
        ``"freesurfer"``, ``"vtk"`` (or ``"vtp"``, ``"vtu"``, ``"vts"``, ``"vtr"``, ``"vti"``),
        ``"asc"`` or ``"npz"``; by default the suffix of the name. Without a known suffix, as
        FreeSurfer's ``lh.pial``, the first bytes decide where they can.
    merge
        ``"exact"`` merges vertices at equal positions, a distance those within it, as
        `TriangleMesh` does.
    max_faces
        Largest number of triangles. A file with more is refused before its faces are parsed, by the
        count in its header or by counting.
    max_vertices
        Largest number of vertices, before any are merged; those without a face count as well.
    max_bytes
        Largest size of a packed file when it is unpacked.
    cancel
        Called while the file is unpacked, and before each further step; the call stops with
        `Cancelled` once it returns true.

    Returns
    -------
    TriangleMesh
        Of (V, 3) float64 positions in the units of the file.

    Raises
    ------
    TooManyFaces
        There are more than ``max_faces``; an `InvalidMesh` as well.
    TooManyVertices
        There are more than ``max_vertices``; an `InvalidMesh` as well.
    UnknownFileType
        Neither name nor content tells the type, or it is none of these; an `InvalidMesh` as well.
    FileTooLarge
        Unpacked, the file has more than ``max_bytes``; an `InvalidMesh` as well.
    InvalidMesh
        The file cannot be read, is not of this type, is damaged, declares more than it holds, or
        holds a mesh that `TriangleMesh` refuses.
    InvalidArgument
        ``merge`` is no way of merging, or the file gives lengths, and vertices cannot be merged.
    Cancelled
        ``cancel`` returned true.
    MissingExtra
        GIFTI needs nibabel, the extra ``brain``; VTK's files need VTK, the extra ``vtk``.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> text = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    >>> gc.load_mesh(text, "off")
    TriangleMesh(3 vertices, 1 faces)
    """
    control = Control(cancel=cancel)
    file = read_unpacked(source, _READERS, max_bytes, control)
    kind = _kind_of(file, file_type)
    control.checkpoint(0.0)
    if not file.data:
        raise InvalidMesh(f"the {kind.upper()} file is empty")
    try:
        read = _contents_of(file.data, kind, max_faces)
    except (TooManyFaces, MissingExtra, MemoryError):
        raise
    except Exception as error:  # any failure of a parser
        raise _explained(error, kind, file.data) from error
    check_face_count(int(np.maximum(read.sizes - 2, 1).sum()), max_faces)
    if max_vertices is not None and len(read.vertices) > max_vertices:
        raise TooManyVertices(len(read.vertices), max_vertices)
    control.checkpoint(0.5)
    if kind == "stl" and merge == "none":
        merge = "exact"
    notes = read.notes
    if left_out := read.left_out_in_words():
        what = f"The {kind.upper()} file also holds {left_out}"
        notes += (f"{what}, which are not part of the surface and were left out.",)
    if read.lengths is not None:
        if merge != "none":
            raise InvalidArgument("merge must be 'none' for a surface that is given by its lengths")
        positions = read.vertices if len(read.vertices) else None
        return TriangleMesh.from_lengths(read.corners.reshape(-1, 3), read.lengths, positions)
    return TriangleMesh.from_polygons(read.vertices, read.corners, read.sizes, merge, notes)


def _kind_of(file: NamedBytes, file_type: str | None) -> str:
    known = ", ".join(_READERS)
    kind = file.suffix if file_type is None else file_type.lower().removeprefix(".")
    if kind in _READERS and (file_type or kind not in _AMBIGUOUS):
        return kind
    signature = None if file_type else signature_of(file.data)
    if signature is not None and signature.file_type:
        return signature.file_type
    if signature is not None:
        raise UnknownFileType(f"the file is {signature.words}")
    if not kind:
        raise UnknownFileType(f"the file type is missing; it must be one of {known}")
    raise UnknownFileType(f"unknown mesh file type {kind!r}; it must be one of {known}")


def _contents_of(data: bytes, kind: str, max_faces: int | None) -> FileContents:
    """Return the contents of a file; one without faces is refused with what else it holds."""
    read = _READERS[kind](data, max_faces)
    if len(read.sizes) == 0:
        left_out = read.left_out_in_words()
        beside = f", only {left_out}" if left_out else ""
        raise InvalidMesh(f"the {kind.upper()} file holds no faces{beside}", kind="face")
    return read


def _explained(error: Exception, kind: str, data: bytes) -> InvalidMesh:
    """Return why a file cannot be read: first of all, that it is of another type."""
    signature = signature_of(data)
    if signature is not None and _READERS.get(signature.file_type) is not _READERS[kind]:
        remedy = f": give file_type={signature.file_type!r}" if signature.file_type else ""
        return InvalidMesh(f"the {kind.upper()} file is in fact {signature.words}{remedy}")
    if isinstance(error, InvalidMesh):
        return error
    what = " ".join(str(error).split())[:200] or type(error).__name__
    return InvalidMesh(f"the {kind.upper()} file is damaged: {what}")
