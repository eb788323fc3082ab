"""Surfaces given by the lengths of their edges: NumPy's archives of arrays."""

import io
import zipfile

import numpy as np

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.mesh.validation import as_faces, as_vertices


def read_npz(data: bytes, max_faces: int | None) -> FileContents:
    """Read the arrays ``faces``, ``lengths`` and, if it is there, ``vertices``; of ``np.savez``."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        missing = [name for name in ("faces", "lengths") if name not in archive]
        if missing:
            raise InvalidMesh(
                f"the NPZ file has the arrays {', '.join(archive) or 'none'}; it must have faces "
                "and lengths, and may have vertices"
            )
        check_face_count(_rows_of(archive.zip, "faces"), max_faces)
        faces, lengths = as_faces(archive["faces"]), archive["lengths"]
        vertices = as_vertices(archive["vertices"]) if "vertices" in archive else None
    places = np.full((int(faces.max()) + 1, 3), np.nan) if vertices is None else vertices
    return FileContents.of_triangles(places, faces)._replace(lengths=lengths)


def _rows_of(archive: zipfile.ZipFile, name: str) -> int:
    """Return the number of rows that the header of an array declares."""
    with archive.open(f"{name}.npy") as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0
        if version != (1, 0):
            read = np.lib.format.read_array_header_2_0
        shape, _, _ = read(file)
    return int(shape[0]) if shape else 0
