"""Surfaces of brains: GIFTI and FreeSurfer, read by nibabel, the field's own library."""

import base64
import math
import re
import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any
from xml.parsers.expat import ExpatError

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.extras import extra
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import (
    check_declared_counts,
    check_face_count,
    check_row_count,
    check_vertex_count,
)
from geodesic_core.io.text import bad_row, polygon_rows, vertex_table

_TRIANGLE_FILE, _QUAD_FILE, _NEW_QUAD_FILE = b"\xff\xff\xfe", b"\xff\xff\xff", b"\xff\xff\xfd"
"""First bytes of FreeSurfer's surfaces, which have no suffix of their own: ``lh.pial``"""
_HUNDREDTHS = 0.01
"""Unit of the integers that older quadrangle files have for positions, mm"""
_BASE64_GZIP, _MOST_BYTES_OF_VALUE = 3, 16
"""Of GIFTI: the number of an encoding, and bytes of the largest type"""
_VALUE = re.compile(r"(?:^|\r)[^\S\r\n]*[^\s#]", re.MULTILINE)
"""The first value of an array's text, in which numpy takes ``#`` for the start of a comment"""
_POINTS, _TRIANGLES = "NIFTI_INTENT_POINTSET", "NIFTI_INTENT_TRIANGLE"


def read_gifti(data: bytes, max_faces: int | None) -> FileContents:
    """Read a GIFTI surface: the first point set, in its own coordinates, and the triangles."""
    with extra("brain", "nibabel", "load_mesh of a GIFTI file"):
        from nibabel.gifti.gifti import GiftiImage

    parser = _bounded_parser(GiftiImage.parser, len(data), max_faces)
    try:
        parser.parse(data)
    except ExpatError as error:
        raise InvalidMesh(f"the GIFTI file is no whole XML document: {error}") from error
    return _contents(*surface_arrays(parser.img))


def _bounded_parser(base: Any, size: int, max_faces: int | None) -> Any:
    """Return a parser of nibabel that takes no more time or memory than a file declares."""

    class Parser(base):  # type: ignore[misc]  # nibabel has no types
        def StartElementHandler(self, name: str, attrs: dict[str, str]) -> None:  # noqa: N802
            if self.img is None and name != "GIFTI":
                raise InvalidMesh(f"the GIFTI file begins with the element {name[:20]!r}")
            if name == "DataArray":
                _check_array(attrs, max_faces)
            # It only leads to a warning where it is wrong.
            super().StartElementHandler(
                name, {key: attrs[key] for key in attrs if key != "NumberOfDataArrays"}
            )

        def flush_chardata(self) -> None:
            if self.write_to == "Data":
                text = "".join(self._char_blocks or ())
                if not _VALUE.search(text):
                    raise InvalidMesh("an array of the GIFTI file is empty")
                if self.da.encoding == _BASE64_GZIP:
                    _check_unpacked(text, math.prod(self.da.dims))
            super().flush_chardata()

    return Parser(buffer_size=size)


def _check_array(attributes: Mapping[str, str], max_faces: int | None) -> None:
    """Refuse an array in another file, and one of more dimensions or rows than there can be."""
    if attributes.get("Encoding") == "ExternalFileBinary":
        raise InvalidMesh(
            "the arrays of the GIFTI file are in another file: save it with them inside"
        )
    dimensions = attributes.get("Dimensionality", "")
    if dimensions not in ("1", "2"):
        raise InvalidMesh(
            f"an array of the GIFTI file has {dimensions[:20]!r} dimensions; it must have 1 or 2"
        )
    rows = attributes.get("Dim0", "")
    if not (rows.isdecimal() and len(rows) < 19):
        raise InvalidMesh(f"an array of the GIFTI file has {rows[:20]!r} rows")
    if attributes.get("Intent") == _TRIANGLES:
        check_face_count(int(rows), max_faces)
    else:
        check_vertex_count("an array of the GIFTI file", int(rows), max_faces)


def _check_unpacked(text: str, values: int) -> None:
    """Refuse an array that holds more than its values, once unpacked."""
    most = _MOST_BYTES_OF_VALUE * max(values, 0)
    if len(zlib.decompressobj().decompress(base64.b64decode(text), most + 1)) > most:
        raise InvalidMesh(f"an array of the GIFTI file holds more than its {values} values")


def surface_arrays(image: Any) -> tuple[NDArray[np.generic], NDArray[np.generic]]:
    """Return the points and the triangles of a GIFTI image of nibabel."""
    arrays = {name: image.get_arrays_from_intent(name) for name in (_POINTS, _TRIANGLES)}
    missing = [name for name, found in arrays.items() if not found]
    if missing:
        raise InvalidMesh(f"the GIFTI file holds no {missing[0]} array: it is not a surface")
    return arrays[_POINTS][0].data, arrays[_TRIANGLES][0].data


def read_freesurfer(data: bytes, max_faces: int | None) -> FileContents:
    """Read a surface of FreeSurfer, in its own coordinates: binary, of quadrangles too, or text."""
    magic = data[:3]
    if magic == _TRIANGLE_FILE:
        return _read_triangles(data, max_faces)
    if magic in (_QUAD_FILE, _NEW_QUAD_FILE):
        return _read_quads(data, max_faces)
    if data.startswith(b"#!ascii"):
        return _read_text(data, max_faces)
    raise InvalidMesh("the file is not a FreeSurfer surface: it begins with other bytes")


def _read_triangles(data: bytes, max_faces: int | None) -> FileContents:
    # Two lines of text, two counts, then positions and faces, all big-endian.
    stream = BytesIO(data)
    stream.seek(len(_TRIANGLE_FILE))
    stream.readline()
    stream.readline()
    counts = stream.read(8)
    if len(counts) < 8:
        raise InvalidMesh("the FreeSurfer file ends before its counts")
    vertex_count, face_count = np.frombuffer(counts, ">i4").tolist()
    _check_counts(vertex_count, face_count, 12, len(data) - stream.tell(), max_faces)
    vertices = np.frombuffer(stream.read(12 * vertex_count), ">f4").reshape(-1, 3)
    faces = np.frombuffer(stream.read(12 * face_count), ">i4").reshape(-1, 3)
    return _contents(vertices, faces)


def _check_counts(
    vertices: int, faces: int, vertex_bytes: int, room: int, max_faces: int | None
) -> None:
    least_bytes = {"vertex": vertex_bytes, "face": 12}
    check_declared_counts({"vertex": vertices, "face": faces}, least_bytes, room)
    check_face_count(faces, max_faces)


def _read_quads(data: bytes, max_faces: int | None) -> FileContents:
    """Read quadrangles, each divided as FreeSurfer does: by whether its first corner is even."""
    if len(data) < 9:
        raise InvalidMesh("the FreeSurfer file ends before its counts")
    vertex_count, quad_count = _three_byte_integers(data[3:9]).tolist()
    kind, unit = (">i2", _HUNDREDTHS) if data[:3] == _QUAD_FILE else (">f4", 1.0)
    width = 3 * np.dtype(kind).itemsize
    _check_counts(vertex_count, quad_count, width, len(data) - 9, max_faces)
    middle = 9 + vertex_count * width
    with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
        vertices = np.frombuffer(data[9:middle], kind).reshape(-1, 3) * unit
    quads = _three_byte_integers(data[middle : middle + 12 * quad_count]).reshape(-1, 4)
    even = quads[:, [0, 1, 3, 2, 3, 1]]
    odd = quads[:, [0, 1, 2, 0, 2, 3]]
    faces = np.where(quads[:, :1] % 2 == 0, even, odd).reshape(-1, 3)
    check_face_count(len(faces), max_faces)
    return _contents(vertices, faces)


def _three_byte_integers(data: bytes) -> NDArray[np.int64]:
    digits = np.frombuffer(data, np.uint8).reshape(-1, 3).astype(np.int64)
    integers: NDArray[np.int64] = digits @ np.array([1 << 16, 1 << 8, 1])
    return integers


def _read_text(data: bytes, max_faces: int | None) -> FileContents:
    """Read rows of four numbers, the last of which says what FreeSurfer has cut out."""
    rows = [row for row in data.splitlines() if row.strip() and not row.startswith(b"#")]
    counts = rows[0].split() if rows else []
    if len(counts) != 2 or not all(count.isdigit() and len(count) < 19 for count in counts):
        raise InvalidMesh("the FreeSurfer file has no row with its counts of vertices and faces")
    vertex_count, face_count = map(int, counts)
    check_row_count({"vertex": vertex_count, "face": face_count}, len(rows) - 1)
    check_face_count(face_count, max_faces)
    vertices = vertex_table(rows[1 : 1 + vertex_count])
    face_rows = rows[1 + vertex_count :]
    corners, sizes = polygon_rows(face_rows)
    if (sizes < 3).any():
        short = int(np.flatnonzero(sizes < 3)[0])
        raise bad_row("face", short, face_rows[short], "it must have three vertices")
    starts = np.cumsum(sizes) - sizes
    return _contents(vertices, corners[starts[:, None] + np.arange(3)])


def _contents(vertices: NDArray[np.generic], faces: NDArray[np.generic]) -> FileContents:
    for name, rows in (("points", vertices), ("triangles", faces)):
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise InvalidMesh(f"the {name} have shape {rows.shape}; it must be (n, 3)")
    return FileContents.of_triangles(np.ascontiguousarray(vertices, np.float64), faces)
