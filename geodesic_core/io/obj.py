"""OBJ files: vertices and faces in any order, with relative and absolute indices."""

import re
from collections import Counter

import numpy as np

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.text import (
    COMMENT,
    VERTEX_ROW,
    VERTEX_RULE,
    check_counted_faces,
    check_rows,
    excerpt,
    index_rows,
    number_table,
)

_CONTINUATION = re.compile(rb"\\[ \t]*\r?\n")
_ROW = re.compile(rb"^[ \t]*(v|f|l|p|curv2?|surf)[ \t]+([^\r\n]*)", re.MULTILINE)
_FACE_ROW = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
_CORNER = rb"-?0{0,99}[1-9]\d{0,17}(?:/-?\d*){0,2}"
_FACE = re.compile(rb"[ \t]*" + _CORNER + rb"(?:[ \t]+" + _CORNER + rb")*[ \t]*")
_NOT_POSITION = re.compile(rb"/\S*")
_IGNORED = {b"l": "lines", b"p": "points", b"surf": "surfaces"}


def read_obj(data: bytes, max_faces: int | None) -> FileContents:
    """Read an OBJ file.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    if b"#" in data:  # first, as a comment may end in a backslash
        data = COMMENT.sub(b"", data)
    if b"\\" in data:
        data = _CONTINUATION.sub(b" ", data)
    check_counted_faces(_FACE_ROW, data, max_faces)
    rows = _ROW.findall(data)
    vertex_rows = [row for keyword, row in rows if keyword == b"v"]
    face_rows = [row for keyword, row in rows if keyword == b"f"]
    check_rows(vertex_rows, VERTEX_ROW, "vertex", VERTEX_RULE)
    check_rows(face_rows, _FACE, "face", "it must have vertices, which are numbered from 1")
    if not face_rows:
        raise InvalidMesh("the OBJ file holds no faces", kind="face")
    so_far = np.cumsum([keyword == b"v" for keyword, _ in rows])
    so_far = so_far[[keyword == b"f" for keyword, _ in rows]]
    corners, sizes = index_rows(_NOT_POSITION.sub(b"", b"\n".join(face_rows)).split(b"\n"))
    # -1 is the last vertex so far.
    corners = np.where(corners < 0, corners + np.repeat(so_far, sizes), corners - 1)
    bad = np.flatnonzero((corners < 0) | (corners >= len(vertex_rows)))
    if len(bad):
        face = int(np.searchsorted(np.cumsum(sizes), bad[0], side="right"))
        raise InvalidMesh(
            f"face {face} reads {excerpt(face_rows[face])}, but the file's vertices are numbered 1 "
            f"to {len(vertex_rows)}, and {so_far[face]} precede the face",
            kind="face",
            elements=[face],
        )
    ignored = Counter(_IGNORED.get(k, "curves") for k, _ in rows if k not in (b"v", b"f"))
    notes = note_on_ignored("OBJ", ignored)
    return FileContents(number_table(vertex_rows, 3), corners, sizes, notes)
