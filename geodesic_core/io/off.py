"""OFF files: counts, then vertices and faces, in text or binary."""

import re
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import BEHIND, FileContents
from geodesic_core.io.limits import check_declared_counts, check_face_count, check_row_count
from geodesic_core.io.text import COMMENT, counted_polygons, vertex_table

_COUNT = rb"(-?\d{1,100})"  # Python refuses to read thousands of digits
_KEYWORD = re.compile(rb"(?:\s|#[^\r\n]*)*(ST)?(C)?(N)?(4)?(n)?OFF\b")
_BINARY = re.compile(rb"[ \t]+BINARY[ \t]*\r?\n")
_EDGE_COUNT = rb"(?:[ \t]+-?\d+|\s*\n[ \t]*-?\d+(?=[ \t]*\n))?"  # on its line, or alone on the next
_COUNTS = re.compile(rb"\s*" + _COUNT + rb"\s+" + _COUNT + _EDGE_COUNT + rb"(?:[ \t]*\n|(?=\s))")
_LINE_END = re.compile(rb"\r\n?")
_SIZE = re.compile(rb"\d{1,9}")
_LEAST_BYTES = {"vertex": len("0 0 0\n"), "face": len("1 0\n")}


class _Layout(NamedTuple):
    """What the keyword says of a vertex."""

    has_weight: bool
    """After the position there is a number to divide it by"""
    numbers: int
    """All its numbers: of position, weight, normal, colour and place in a texture"""


def read_off(data: bytes, max_faces: int | None) -> FileContents:
    """Read an OFF file."""
    keyword = _KEYWORD.match(data)
    if keyword is None:
        raise InvalidMesh("the OFF file does not begin with OFF")
    texture, colour, normal, weight, dimension = (part is not None for part in keyword.groups())
    if dimension:
        raise InvalidMesh("the OFF file has vertices of any dimension (nOFF); save it as OFF")
    layout = _Layout(weight, 3 + weight + (3 + weight) * normal + 4 * colour + 2 * texture)
    if (binary := _BINARY.match(data, keyword.end())) is not None:
        return _read_binary(data, binary.end(), layout, max_faces)
    return _read_text(data, keyword.end(), layout, max_faces)


def _read_text(data: bytes, at: int, layout: _Layout, max_faces: int | None) -> FileContents:
    text = data
    for pattern, plain in ((COMMENT, b""), (_LINE_END, b"\n")):
        if pattern.search(text, at) is not None:
            text, at = pattern.sub(plain, text[at:]), 0
    header = _COUNTS.match(text, at)
    if header is None:
        raise InvalidMesh("the OFF file does not begin with OFF and its counts as ASCII numbers")
    counts = {"vertex": int(header[1]), "face": int(header[2])}
    check_declared_counts(counts, _LEAST_BYTES, len(text) - header.end(), slack=1)
    check_face_count(counts["face"], max_faces)
    body = text[header.end() :]
    try:
        return _from_rows(body.splitlines(), counts, layout)
    except InvalidMesh:  # rows are a habit: any white space may stand between numbers
        rows = _rows_of_words(body.split(), counts, layout)
        if rows is None:
            raise
        return _from_rows(rows, counts, layout)


def _from_rows(lines: list[bytes], counts: dict[str, int], layout: _Layout) -> FileContents:
    rows = [line for line in lines if line.strip()]
    check_row_count(counts, len(rows))
    behind = counts["vertex"] + counts["face"]
    table = vertex_table(rows[: counts["vertex"]], 3 + layout.has_weight)
    corners, sizes = counted_polygons(rows[counts["vertex"] : behind])
    return FileContents(_positions(table), corners, sizes, {f"rows {BEHIND}": len(rows) - behind})


def _rows_of_words(
    words: list[bytes], counts: dict[str, int], layout: _Layout
) -> list[bytes] | None:
    """Return rows of a vertex or a face each; None where the words do not add up to these."""
    width = layout.numbers
    at = counts["vertex"] * width
    rows = [b" ".join(words[i : i + width]) for i in range(0, at, width)]
    for _ in range(counts["face"]):
        if at >= len(words) or not _SIZE.fullmatch(words[at]):
            return None
        end = at + 1 + int(words[at])
        rows.append(b" ".join(words[at:end]))
        at = end
    return rows if at == len(words) else None


def _positions(table: Floats) -> Floats:
    """Return (V, 3) positions, divided by their weights where there is a fourth column."""
    if table.shape[1] == 3:
        return table
    with np.errstate(divide="ignore", invalid="ignore"):  # the mesh refuses what is not finite
        return table[:, :3] / table[:, 3:]


def _read_binary(data: bytes, at: int, layout: _Layout, max_faces: int | None) -> FileContents:
    """Read integers and single floats, big-endian; a face also has the numbers of its colour."""
    if len(data) < at + 12:
        raise InvalidMesh("the OFF file ends before its counts")
    vertex_count, face_count, _ = np.frombuffer(data, ">i4", 3, at).tolist()
    at += 12
    width = layout.numbers
    least_bytes = {"vertex": 4 * width, "face": 8}
    check_declared_counts({"vertex": vertex_count, "face": face_count}, least_bytes, len(data) - at)
    check_face_count(face_count, max_faces)
    table = np.frombuffer(data, ">f4", vertex_count * width, at).reshape(-1, width)
    at += table.nbytes
    words = np.frombuffer(data, ">i4", (len(data) - at) // 4, at)
    faces, sizes, place = [], [], 0
    for face in range(face_count):
        size = int(words[place]) if place < len(words) else -1
        colour = place + 1 + size
        if size < 1 or colour >= len(words) or not 0 <= words[colour] < len(words) - colour:
            raise InvalidMesh(
                f"face {face} of the OFF file is damaged, or the file ends before it",
                kind="face",
                elements=[face],
            )
        faces.append(words[place + 1 : colour])
        sizes.append(size)
        place = colour + 1 + int(words[colour])
    positions = _positions(table[:, : 3 + layout.has_weight].astype(np.float64))
    corners = np.concatenate([words[:0], *faces]).astype(np.int64)
    rest = data[at + 4 * place :]
    left_out = {f"bytes {BEHIND}": len(rest) if rest.strip() else 0}
    return FileContents(positions, corners, np.array(sizes, np.int64), left_out)
