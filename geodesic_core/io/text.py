"""Rows of text: the numbers and polygons of OBJ, OFF and PLY files."""

import re

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.limits import check_face_count, counts_in_words

COMMENT = re.compile(rb"(?<!\.)#[^\r\n]*")
"""But for the end of ``-1.#IND``, as Microsoft's C prints what is no number: it is refused"""
NUMBER = rb"[-+]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|(?i:nan|inf(?:inity)?))"
VERTEX_ROW = re.compile(rb"[ \t]*" + NUMBER + rb"(?:[ \t]+" + NUMBER + rb"){2,}[ \t\r]*")
INDEX_ROW = re.compile(rb"[ \t]*-?\d{1,18}(?:[ \t]+-?\d{1,18})*[ \t\r]*")
_COUNT = re.compile(rb"\d{1,18}")
VERTEX_RULE = "it must have three numbers"


def check_counted_faces(face: re.Pattern[bytes], data: bytes, max_faces: int | None) -> None:
    """Count the faces of a text before it is parsed, and refuse too many.

    Raises
    ------
    TooManyFaces
        The pattern of a face occurs more than ``max_faces`` times.
    """
    if max_faces is not None:
        check_face_count(sum(1 for _ in face.finditer(data)), max_faces)


def check_rows(rows: list[bytes], pattern: re.Pattern[bytes], kind: str, rule: str) -> None:
    """Refuse rows that do not match a pattern; ``rule`` ends the message.

    Raises
    ------
    InvalidMesh
        The first row at fault, as an element of this ``kind``.
    """
    bad = next((i for i, row in enumerate(rows) if not pattern.fullmatch(row)), None)
    if bad is not None:
        raise InvalidMesh(
            f"{kind} {bad} reads {excerpt(rows[bad])}; {rule}", kind=kind, elements=[bad]
        )


def excerpt(row: bytes) -> str:
    """Return the beginning of a row in quotes, for messages."""
    text = row.decode("ascii", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


def number_table(rows: list[bytes], columns: int) -> Floats:
    """Return the first ``columns`` numbers of each row, (N, columns), where none has fewer."""
    words = b" ".join(rows).split()
    if len(words) != columns * len(rows):
        words = [word for row in rows for word in row.split(None, columns)[:columns]]
    return np.array(words, dtype=np.float64).reshape(-1, columns)


def index_rows(rows: list[bytes]) -> tuple[Longs, Longs]:
    """Return the integers of all rows, one after the other, and the number of each row's."""
    words = [row.split() for row in rows]
    flat = [word for row in words for word in row]
    return np.array(flat, dtype=np.int64), np.array([len(row) for row in words], dtype=np.int64)


def counted_polygons(rows: list[bytes], skipped: int = 0) -> list[bytes]:
    """Return the indices of face rows: ``skipped`` words, a count, that many indices, anything.

    Raises
    ------
    InvalidMesh
        A row is too short, or has no count.
    """
    polygons = []
    for face, row in enumerate(rows):
        words = row.split()[skipped:]
        if not words or not _COUNT.fullmatch(words[0]) or not 1 <= int(words[0]) < len(words):
            raise InvalidMesh(
                f"face {face} reads {excerpt(row)}; it must have a count, then as many vertices",
                kind="face",
                elements=[face],
            )
        polygons.append(b" ".join(words[1 : int(words[0]) + 1]))
    check_rows(polygons, INDEX_ROW, "face", "its vertices must be integers")
    return polygons


def check_row_count(counts: dict[str, int], rows: int) -> None:
    """Refuse a file with fewer rows than its header declares.

    Raises
    ------
    InvalidMesh
        Rows are missing.
    """
    if sum(counts.values()) > rows:
        raise InvalidMesh(f"the header declares {counts_in_words(counts)}, but {rows} rows follow")


def check_columns(rows: list[bytes], columns: int) -> None:
    """Refuse rows of vertices with fewer words than ``columns``.

    Raises
    ------
    InvalidMesh
        The first row at fault.
    """
    short = next((i for i, row in enumerate(rows) if len(row.split()) < columns), None)
    if short is not None:
        raise InvalidMesh(
            f"vertex {short} reads {excerpt(rows[short])}; it must have {columns} numbers",
            kind="vertex",
            elements=[short],
        )
