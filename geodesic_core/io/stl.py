"""STL files: triangles without numbering, in text or binary."""

import io
import re

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.text import VERTEX_ROW, VERTEX_RULE, check_rows, number_table

_HEADER, _TRIANGLE = 84, 50
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.IGNORECASE)
_KEYWORD = re.compile(rb"^[ \t]*(facet|vertex|endfacet|endsolid)\b", re.MULTILINE | re.IGNORECASE)
_VERTEX = re.compile(rb"^[ \t]*vertex\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)
_KEYWORDS = (b"facet", b"vertex", b"vertex", b"vertex", b"endfacet")
"""Those of one triangle; its loop and its normal are of no interest."""


def read_stl(data: bytes, max_faces: int | None) -> FileContents:
    """Read an STL file; each triangle has three vertices of its own.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    triangles = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    expected = _HEADER + triangles * _TRIANGLE
    if len(data) == expected:
        check_face_count(triangles, max_faces)
        vertices = _read_binary(data)
    else:
        triangles = sum(1 for _ in _FACET.finditer(data))
        if not triangles or data.lstrip()[:5].lower() != b"solid":
            raise InvalidMesh(
                f"the STL file is neither ASCII nor binary: its header declares "
                f"{(expected - _HEADER) // _TRIANGLE} triangles, which take {expected} bytes, but "
                f"it has {len(data)}"
            )
        check_face_count(triangles, max_faces)
        vertices = _read_ascii(data)
    return FileContents(vertices, np.arange(len(vertices)), np.full(triangles, 3))


def _read_binary(data: bytes) -> Floats:
    from trimesh.exchange.stl import load_stl_binary

    with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
        return np.asarray(load_stl_binary(io.BytesIO(data))["vertices"], np.float64)


def _read_ascii(data: bytes) -> Floats:
    """Return the corners of all facets.

    trimesh (5.2) takes megabytes for a kilobyte of long numbers, and logs tracebacks for normals
    that it cannot read.
    """
    keywords = [keyword.lower() for keyword in _KEYWORD.findall(data)]
    if keywords[-1] != b"endsolid":
        raise InvalidMesh("the STL file is cut short: its last solid has no end")
    inside = [keyword for keyword in keywords if keyword != b"endsolid"]
    wrong = next(
        (i for i, word in enumerate(inside) if word != _KEYWORDS[i % len(_KEYWORDS)]), len(inside)
    )
    if wrong < len(inside) or len(inside) % len(_KEYWORDS):
        facet = wrong // len(_KEYWORDS)
        raise InvalidMesh(
            f"facet {facet} of the STL file is damaged or cut short; it must have three vertices",
            kind="face",
            elements=[facet],
        )
    corners = _VERTEX.findall(data)
    check_rows(corners, VERTEX_ROW, "vertex", VERTEX_RULE)
    return number_table(corners, 3)
