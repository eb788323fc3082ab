"""Rows of text: the numbers and polygons of OBJ, OFF and PLY files."""

import re
from collections.abc import Callable

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.limits import check_face_count

COMMENT = re.compile(rb"(?<!\.)#[^\r\n]*")
"""But for the end of ``-1.#IND``, as Microsoft's C prints what is no number: it is refused"""
NUMBER = rb"[-+]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|(?i:nan|inf(?:inity)?))"
INDEX_ROW = re.compile(rb"[ \t]*-?\d{1,18}(?:[ \t]+-?\d{1,18})*[ \t\r]*")
_VERTEX_ROW = re.compile(rb"[ \t]*" + NUMBER + rb"(?:[ \t]+" + NUMBER + rb"){2,}[ \t\r]*")
_COUNT = re.compile(rb"\d{1,18}")


def check_counted_faces(face: re.Pattern[bytes], data: bytes, max_faces: int | None) -> None:
    """Count the faces of a text, by their pattern, before it is parsed, and refuse too many."""
    if max_faces is not None:
        check_face_count(sum(1 for _ in face.finditer(data)), max_faces)


def bad_row(kind: str, number: int, row: bytes, rule: str, name: str = "") -> InvalidMesh:
    """Return the refusal of a row; ``name`` is what the file calls a vertex or a face."""
    message = f"{name or kind} {number} reads {excerpt(row)}; {rule}"
    return InvalidMesh(message, kind=kind, elements=[number])


def check_rows(
    rows: list[bytes], is_right: Callable[[bytes], object], kind: str, rule: str, name: str = ""
) -> None:
    """Refuse the first row that is not right; see `bad_row`."""
    bad = next((i for i, row in enumerate(rows) if not is_right(row)), None)
    if bad is not None:
        raise bad_row(kind, bad, rows[bad], rule, name)


def excerpt(row: bytes) -> str:
    """Return the beginning of a row in quotes, for messages."""
    text = row.decode("ascii", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


def vertex_table(rows: list[bytes], columns: int = 3) -> Floats:
    """Return the first numbers of the rows of vertices, (V, columns); refuse one with fewer."""
    rule = f"it must have {columns} numbers"
    check_rows(rows, _VERTEX_ROW.fullmatch, "vertex", rule)
    if columns > 3:
        check_rows(rows, lambda row: len(row.split()) >= columns, "vertex", rule)
    words = b" ".join(rows).split()
    if len(words) != columns * len(rows):
        words = [word for row in rows for word in row.split(None, columns)[:columns]]
    return np.array(words, dtype=np.float64).reshape(-1, columns)


def index_rows(rows: list[bytes]) -> tuple[Longs, Longs]:
    """Return the integers of all rows, one after the other, and the number of each row's."""
    words = [row.split() for row in rows]
    flat = [word for row in words for word in row]
    return np.array(flat, dtype=np.int64), np.array([len(row) for row in words], dtype=np.int64)


def polygon_rows(rows: list[bytes]) -> tuple[Longs, Longs]:
    """Return what `index_rows` does; refuse rows of anything but integers."""
    check_rows(rows, INDEX_ROW.fullmatch, "face", "its vertices must be integers")
    return index_rows(rows)


def counted_polygons(rows: list[bytes], skipped: int = 0) -> tuple[Longs, Longs]:
    """Return polygons from rows of ``skipped`` words, a count, as many vertices, and anything."""
    polygons = []
    for face, row in enumerate(rows):
        words = row.split()[skipped:]
        if not words or not _COUNT.fullmatch(words[0]) or not 1 <= int(words[0]) < len(words):
            raise bad_row("face", face, row, "it must have a count, then as many vertices")
        polygons.append(b" ".join(words[1 : int(words[0]) + 1]))
    return polygon_rows(polygons)
