"""Surfaces in NumPy's archives of arrays, which may be given by the lengths of their edges."""

import io
import math
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.mesh.validation import as_faces, as_vertices


def read_npz(data: bytes, max_faces: int | None) -> FileContents:
    """Read the arrays ``faces`` and ``vertices``, ``lengths`` or both; of ``np.savez``."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        if "faces" not in names or not {"vertices", "lengths"} & set(names):
            raise InvalidMesh(
                f"the NPZ file has the arrays {', '.join(names[:5])}; it must have faces, and "
                "vertices, lengths or both"
            )
        faces = as_faces(_array(archive, "faces", max_faces))
        lengths = _array(archive, "lengths", max_faces) if "lengths" in names else None
        vertices = np.empty((0, 3))
        if "vertices" in names:
            vertices = as_vertices(_array(archive, "vertices", None))
    return FileContents.of_triangles(vertices, faces)._replace(lengths=lengths)


def _array(archive: zipfile.ZipFile, name: str, max_rows: int | None) -> NDArray[Any]:
    """Return an array of an archive; refuse one that declares more than it holds.

    NumPy would reserve memory for all that a header declares.
    """
    entry = archive.getinfo(f"{name}.npy")
    with archive.open(entry) as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0
        if version != (1, 0):
            read = np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)
    declared = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or declared > entry.file_size:
        raise InvalidMesh(
            f"the array {name} of the NPZ file declares {declared} bytes, but has at most "
            f"{entry.file_size}"
        )
    check_face_count(shape[0] if shape else 0, max_rows)
    with archive.open(entry) as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return array
