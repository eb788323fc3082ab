"""Surfaces of brains: GIFTI and FreeSurfer, read by nibabel, the field's own library."""

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.extras import extra
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count

FREESURFER_MAGIC = b"\xff\xff\xfe"
"""First bytes of a triangle surface; its files have no suffix of their own: ``lh.pial``"""
_POINTS, _TRIANGLES = "NIFTI_INTENT_POINTSET", "NIFTI_INTENT_TRIANGLE"


def read_gifti(data: bytes, max_faces: int | None) -> FileContents:
    """Read a GIFTI surface: the first point set, in its own coordinates, and the triangles.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or hold no surface.
    TooManyFaces
        There are more faces than ``max_faces``.
    MissingExtra
        nibabel is not installed.
    """
    with extra("brain", "nibabel", "load_mesh of a GIFTI file"):
        from nibabel.gifti.gifti import GiftiImage

    image: Any = GiftiImage.from_bytes(data)
    arrays = {name: image.get_arrays_from_intent(name) for name in (_POINTS, _TRIANGLES)}
    missing = [name for name, found in arrays.items() if not found]
    if missing:
        raise InvalidMesh(f"the GIFTI file holds no {missing[0]} array: it is not a surface")
    return _contents(arrays[_POINTS][0].data, arrays[_TRIANGLES][0].data, max_faces)


def read_freesurfer(data: bytes, max_faces: int | None) -> FileContents:
    """Read a triangle surface of FreeSurfer, in its own coordinates.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    if not data.startswith(FREESURFER_MAGIC):
        raise InvalidMesh(
            "the file is not a FreeSurfer triangle surface: it begins with other bytes"
        )
    # Two lines of text, two counts, then positions and faces, all big-endian.
    stream = BytesIO(data)
    stream.seek(len(FREESURFER_MAGIC))
    stream.readline()
    stream.readline()
    counts = stream.read(8)
    if len(counts) < 8:
        raise InvalidMesh("the FreeSurfer file ends before its counts")
    vertex_count, face_count = np.frombuffer(counts, ">i4").tolist()
    held = (len(data) - stream.tell()) // 12
    if min(vertex_count, face_count) < 0 or vertex_count + face_count > held:
        raise InvalidMesh(
            f"the FreeSurfer file declares {vertex_count} vertices and {face_count} faces, but "
            f"holds {held} rows"
        )
    check_face_count(face_count, max_faces)
    vertices = np.frombuffer(stream.read(12 * vertex_count), ">f4").reshape(-1, 3)
    faces = np.frombuffer(stream.read(12 * face_count), ">i4").reshape(-1, 3)
    return _contents(vertices, faces, max_faces)


def _contents(
    vertices: NDArray[np.generic], faces: NDArray[np.generic], max_faces: int | None
) -> FileContents:
    for name, rows in (("points", vertices), ("triangles", faces)):
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise InvalidMesh(f"the {name} have shape {rows.shape}; it must be (n, 3)")
    check_face_count(len(faces), max_faces)
    corners = np.ascontiguousarray(faces, np.int64).reshape(-1)
    sizes = np.full(len(faces), 3, np.int64)
    return FileContents(np.ascontiguousarray(vertices, np.float64), corners, sizes)
