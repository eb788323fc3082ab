"""Loading of mesh files: their bytes become vertices and polygons in the file's own numbering.

OBJ, OFF and PLY have readers of their own: that of trimesh (5.2) splits vertices at texture seams,
groups faces by material or by their number of corners, refuses binary PLY files that mix these,
drops what is too short and trusts the counts of a header. trimesh reads binary STL and GLB. What
such a file says of itself is checked first, so that a refusal names the place, and sparse or
compressed glTF positions are refused, which it would read as zeros. It never sees a path, nor gets
a resolver: a file cannot make it read another one.
"""

import codecs
from collections.abc import Callable
from pathlib import Path

import numpy as np

from geodesic_core.errors import InvalidMesh, MissingExtra
from geodesic_core.io.brain import FREESURFER_MAGIC, read_freesurfer, read_gifti
from geodesic_core.io.contents import FileContents
from geodesic_core.io.glb import read_glb
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.obj import read_obj
from geodesic_core.io.off import read_off
from geodesic_core.io.ply import read_ply
from geodesic_core.io.stl import read_stl
from geodesic_core.io.vtk import read_vtk, read_vtu
from geodesic_core.mesh.triangle_mesh import Merge, TriangleMesh

_Reader = Callable[[bytes, int | None], FileContents]
_READERS: dict[str, _Reader] = {
    "obj": read_obj,
    "off": read_off,
    "ply": read_ply,
    "stl": read_stl,
    "glb": read_glb,
    "gii": read_gifti,
    "freesurfer": read_freesurfer,
    "vtk": read_vtk,
    "vtu": read_vtu,
}


def load_mesh(
    source: str | Path | bytes | bytearray | memoryview,
    file_type: str | None = None,
    merge: Merge = "none",
    *,
    max_faces: int | None = None,
) -> TriangleMesh:
    r"""Read a mesh file: OBJ, OFF, PLY, STL or GLB; GIFTI, FreeSurfer or VTK.

    Vertices keep the file's numbering and faces its order. Polygons become triangles, in place, and
    ``mesh.face_map`` leads from these to the polygon. Lines, points and curves are left out, and
    ``mesh.warnings`` say so. The parts of a GLB scene are placed by its nodes and put one after the
    other, in the order of its meshes. An STL file has no numbering: its equal corners are always
    merged, in order of first appearance, and ``mesh.vertex_map[3 * face + corner]`` is the vertex.

    Parameters
    ----------
    source
        A path, or the bytes of a file.
    file_type
        ``"obj"``, ``"off"``, ``"ply"``, ``"stl"``, ``"glb"``, ``"gii"``, ``"freesurfer"``,
        ``"vtk"`` or ``"vtu"``; by default the suffix of the path. A triangle surface of FreeSurfer,
        such as ``lh.pial``, is known by its first bytes.
    merge
        ``"exact"`` merges vertices at equal positions, a distance those within it, as
        `TriangleMesh` does.
    max_faces
        Largest number of triangles. A file with more is refused before its faces are parsed, by the
        count in its header or by counting.

    Returns
    -------
    TriangleMesh
        Of (V, 3) float64 positions in the units of the file.

    Raises
    ------
    TooManyFaces
        There are more than ``max_faces``; an `InvalidMesh` as well.
    InvalidMesh
        The file cannot be read, is not of this type, is damaged, declares more than it holds, or
        holds a mesh that `TriangleMesh` refuses.
    InvalidArgument
        ``merge`` is no way of merging.
    MissingExtra
        GIFTI needs nibabel, the extra ``brain``; VTK's files need meshio, the extra ``vtk``.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> text = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    >>> gc.load_mesh(text, "off")
    TriangleMesh(3 vertices, 1 faces)
    """
    if isinstance(source, str | Path):
        path = Path(source)
        if file_type or path.suffix.lower().removeprefix(".") in _READERS:
            kind = _known_kind(file_type or path.suffix)  # before a large file is read
            data = _bytes_of(path)
        else:
            begins = _bytes_of(path, len(FREESURFER_MAGIC))
            kind = "freesurfer" if begins == FREESURFER_MAGIC else _known_kind(path.suffix)
            data = _bytes_of(path)
    else:
        kind = _known_kind(file_type or "")
        data = bytes(source)
    if not data:
        raise InvalidMesh(f"the {kind.upper()} file is empty")
    try:
        read = _READERS[kind](data.removeprefix(codecs.BOM_UTF8), max_faces)
    except (InvalidMesh, MissingExtra):
        raise
    except MemoryError:
        raise
    except Exception as error:  # any failure of a parser
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidMesh(f"the {kind.upper()} file is damaged: {what}") from error
    if len(read.sizes) == 0:
        raise InvalidMesh(f"the {kind.upper()} file holds no faces", kind="face")
    check_face_count(int(np.maximum(read.sizes - 2, 1).sum()), max_faces)
    if kind == "stl" and merge == "none":
        merge = "exact"
    return TriangleMesh.from_polygons(read.vertices, read.corners, read.sizes, merge, read.notes)


def _known_kind(file_type: str) -> str:
    kind, known = file_type.lower().removeprefix("."), ", ".join(_READERS)
    if not kind:
        raise InvalidMesh(f"the file type is missing; it must be one of {known}")
    if kind not in _READERS:
        raise InvalidMesh(f"unknown mesh file type {kind!r}; it must be one of {known}")
    return kind


def _bytes_of(path: Path, most: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(most)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidMesh(f"cannot read {path}: {reason}") from error
