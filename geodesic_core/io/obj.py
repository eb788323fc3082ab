"""OBJ files: vertices and faces in any order, with relative and absolute indices."""

import re
from collections import Counter

import numpy as np

from geodesic_core.io.contents import FileContents
from geodesic_core.io.text import (
    COMMENT,
    bad_row,
    check_counted_faces,
    check_rows,
    index_rows,
    vertex_table,
)

_CONTINUATION = re.compile(rb"\\[ \t]*\r?\n")
_ROW = re.compile(rb"^[ \t]*(v|f|l|p|curv2?|surf)[ \t]+([^\r\n]*)", re.MULTILINE)
_FACE_ROW = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
_CORNER = rb"-?0{0,99}[1-9]\d{0,17}(?:/-?\d*){0,2}"
_FACE = re.compile(rb"[ \t]*" + _CORNER + rb"(?:[ \t]+" + _CORNER + rb")*[ \t]*")
_NOT_POSITION = re.compile(rb"/\S*")
_LEFT_OUT = {b"l": "lines", b"p": "points", b"surf": "surfaces"}


def read_obj(data: bytes, max_faces: int | None) -> FileContents:
    """Read an OBJ file."""
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
    vertices = vertex_table(vertex_rows)
    check_rows(
        face_rows, _FACE.fullmatch, "face", "it must have vertices, which are numbered from 1"
    )
    is_face = np.array([keyword == b"f" for keyword, _ in rows], bool)
    so_far = np.cumsum([keyword == b"v" for keyword, _ in rows], dtype=np.int64)[is_face]
    corners, sizes = index_rows(_NOT_POSITION.sub(b"", b"\n".join(face_rows)).splitlines())
    # -1 is the last vertex so far.
    corners = np.where(corners < 0, corners + np.repeat(so_far, sizes), corners - 1)
    bad = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(bad):
        face = int(np.searchsorted(np.cumsum(sizes), bad[0], side="right"))
        rule = (
            f"the file's vertices are numbered 1 to {len(vertices)}, and {so_far[face]} precede "
            "the face"
        )
        raise bad_row("face", face, face_rows[face], rule)
    left_out = Counter(_LEFT_OUT.get(k, "curves") for k, _ in rows if k not in (b"v", b"f"))
    return FileContents(vertices, corners, sizes, left_out)
