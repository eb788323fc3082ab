"""OFF files: counts, then rows of vertices and of faces."""

import re

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_declared_counts, check_face_count
from geodesic_core.io.text import (
    COMMENT,
    VERTEX_ROW,
    VERTEX_RULE,
    check_row_count,
    check_rows,
    counted_polygons,
    index_rows,
    number_table,
)

_COUNT = rb"(-?\d{1,100})"  # Python refuses to read thousands of digits
_HEADER = re.compile(
    rb"\s*(?:ST)?C?N?OFF\b\s*" + _COUNT + rb"[ \t]+" + _COUNT + rb"(?:[ \t]+-?\d+)?[ \t\r]*\n"
)
_LEAST_BYTES = {"vertex": len("0 0 0\n"), "face": len("1 0\n")}


def read_off(data: bytes, max_faces: int | None) -> FileContents:
    """Read an OFF file.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    text = COMMENT.sub(b"", data) if b"#" in data else data
    header = _HEADER.match(text)
    if header is None:
        raise InvalidMesh("the OFF file does not begin with OFF and its counts as ASCII numbers")
    vertex_count, face_count = int(header[1]), int(header[2])
    counts = {"vertex": vertex_count, "face": face_count}
    check_declared_counts(counts, _LEAST_BYTES, len(text) - header.end())
    check_face_count(face_count, max_faces)
    rows = [row for row in text[header.end() :].splitlines() if row.strip()]
    check_row_count(counts, len(rows))
    if face_count == 0:
        raise InvalidMesh("the OFF file holds no faces", kind="face")
    vertex_rows = rows[:vertex_count]
    check_rows(vertex_rows, VERTEX_ROW, "vertex", VERTEX_RULE)
    corners, sizes = index_rows(counted_polygons(rows[vertex_count:]))
    return FileContents(number_table(vertex_rows, 3), corners, sizes)
