"""STL files: triangles without numbering, in text or binary."""

import io
import re

import numpy as np

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.text import VERTEX_ROW, VERTEX_RULE, check_rows

_HEADER, _TRIANGLE = 84, 50
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.IGNORECASE)
_VERTEX = re.compile(rb"^[ \t]*vertex\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)


def read_stl(data: bytes, max_faces: int | None) -> FileContents:
    """Read an STL file; each triangle has three vertices of its own.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    from trimesh.exchange.stl import load_stl

    triangles = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    expected = _HEADER + triangles * _TRIANGLE
    if len(data) == expected:
        check_face_count(triangles, max_faces)
    else:
        facets = sum(1 for _ in _FACET.finditer(data))
        if not facets or data.lstrip()[:5].lower() != b"solid":
            raise InvalidMesh(
                f"the STL file is neither ASCII nor binary: its header declares {triangles} "
                f"triangles, which take {expected} bytes, but it has {len(data)}"
            )
        check_face_count(facets, max_faces)
        corners = _VERTEX.findall(data)
        check_rows(corners, VERTEX_ROW, "vertex", VERTEX_RULE)
        if len(corners) != 3 * facets:
            raise InvalidMesh(f"the STL file has {facets} facets, but {len(corners)} corners")
        triangles = facets
    read = load_stl(io.BytesIO(data))
    parts = read["geometry"].values() if "geometry" in read else [read]
    vertices = np.concatenate([np.empty((0, 3)), *(part["vertices"] for part in parts)])
    if len(vertices) != 3 * triangles:
        raise InvalidMesh(
            f"the STL file is cut short or damaged: it begins {triangles} triangles, but "
            f"{len(vertices)} corners are complete"
        )
    return FileContents(vertices, np.arange(len(vertices)), np.full(triangles, 3))
