"""STL files: triangles without numbering, in text or binary."""

import re

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.text import vertex_table

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_UNCOUNTED = (0, 2**32 - 1)
"""Counts of writers that did not know how many triangles were to come"""

_TEXT = re.compile(rb"\s*solid", re.IGNORECASE)
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.IGNORECASE)
_KEYWORD = re.compile(rb"^[ \t]*(facet|vertex|endfacet|endsolid)\b", re.MULTILINE | re.IGNORECASE)
_VERTEX = re.compile(rb"^[ \t]*vertex\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)
_KEYWORDS = (b"facet", b"vertex", b"vertex", b"vertex", b"endfacet")
"""Those of one triangle; its loop and its normal are of no interest."""


def read_stl(data: bytes, max_faces: int | None) -> FileContents:
    """Read an STL file; each triangle has three vertices of its own.

    Bytes behind the triangles that a binary file declares are left out, with a note. Where it
    declares none, or the largest number there is, all are read that it holds.
    """
    declared = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    whole, behind = divmod(len(data) - _HEADER, _TRIANGLE.itemsize)
    triangles = declared
    left_out: dict[str, int] = {}
    notes: tuple[str, ...] = ()
    if declared in _UNCOUNTED and whole > 0 and not behind:
        triangles = whole
        notes = (
            f"The STL file declares {declared} triangles; all {whole} that it holds were read.",
        )
    # A text cannot pass for a binary file: its bytes would declare 150 million triangles or more.
    if triangles <= whole and (triangles > 0 or not behind):
        check_face_count(triangles, max_faces)
        vertices = _read_binary(data, triangles)
        behind = len(data) - _HEADER - triangles * _TRIANGLE.itemsize
        left_out = {"bytes behind its last triangle": behind}
    else:
        data = data.replace(b"\r", b"\n")
        triangles = sum(1 for _ in _FACET.finditer(data))
        if not triangles or not _TEXT.match(data):
            raise InvalidMesh(
                f"the STL file is neither ASCII nor binary: its header declares {declared} "
                f"triangles, which take {_HEADER + declared * _TRIANGLE.itemsize} bytes, but it "
                f"has {len(data)}"
            )
        check_face_count(triangles, max_faces)
        vertices = _read_ascii(data)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return FileContents.of_triangles(vertices, faces, left_out, notes)


def _read_binary(data: bytes, triangles: int) -> Floats:
    corners = np.frombuffer(data, _TRIANGLE, triangles, _HEADER)["corners"].reshape(-1, 3)
    with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
        return corners.astype(np.float64)


def _read_ascii(data: bytes) -> Floats:
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
    return vertex_table(_VERTEX.findall(data))
