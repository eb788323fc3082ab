"""PLY files: elements and properties as the header declares them, in text or binary."""

import re
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import BEHIND, FileContents
from geodesic_core.io.limits import (
    check_declared_counts,
    check_face_count,
    check_row_count,
    counts_in_words,
)
from geodesic_core.io.text import INDEX_ROW, bad_row, counted_polygons, excerpt, vertex_table
from geodesic_core.mesh.degeneracies import of_three_vertices

_HEADER = re.compile(
    rb"ply[ \t]*(\r\n|\n|\r)(.*?[\r\n])end_header[ \t]*(?:\1|\r?\n)", re.DOTALL | re.IGNORECASE
)
_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_TYPES = {
    name: code
    for code, names in {
        "b": b"char int8",
        "B": b"uchar uint8",
        "h": b"short int16",
        "H": b"ushort uint16",
        "i": b"int int32",
        "I": b"uint uint32",
        "f": b"float float32",
        "d": b"double float64",
    }.items()
    for name in names.split()
}
"""The types by name, as `struct` and numpy both write them."""
_MOST_HEADER_LINES = 1000
"""Elements and properties of a PLY file: more than any has, and few enough to go through."""
_MOST_DIGITS = 100
"""Digits of a count; Python refuses to read thousands."""
_CORNER_NAMES = (b"vertex_indices", b"vertex_index")
_AXES = (b"x", b"y", b"z")
_POLYGONS = ("face", "tristrips")
"""Elements that make the surface"""
_Values = dict[int, tuple[NDArray[Any], Longs]]
"""Properties of an element by number: the values of all records, and how many each of these has"""


class _Property(NamedTuple):
    name: bytes
    type: str
    count_type: str
    """Of a list; else empty."""


class _Element(NamedTuple):
    name: str
    size: int
    properties: list[_Property]

    def wanted(self) -> list[int]:
        """Return which properties are read: the axes of vertices, the corners of polygons.

        Refuse vertices without x, y and z, and polygons without corners.
        """
        if self.name == "vertex":
            names = [part.name if not part.count_type else b"" for part in self.properties]
            if [names.count(axis) for axis in _AXES] != [1, 1, 1]:
                raise InvalidMesh("the PLY vertices must have x, y and z once each")
            return [names.index(axis) for axis in _AXES]
        if self.name not in _POLYGONS:
            return []
        for index, part in enumerate(self.properties):
            if part.count_type and part.name in _CORNER_NAMES:
                return [index]
        raise InvalidMesh(
            f"the PLY {self.name} elements have no 'list … vertex_indices'", kind="face"
        )

    def least_bytes(self, order: str) -> int:
        """Return the least bytes of one, its lists empty; of text where ``order`` is empty."""
        if not order:
            return 2 * len(self.properties)  # a digit and a separator
        return sum(np.dtype(part.count_type or part.type).itemsize for part in self.properties)


def read_ply(data: bytes, max_faces: int | None) -> FileContents:
    """Read a PLY file."""
    header = _HEADER.match(data)
    if header is None:
        raise InvalidMesh("the PLY file has no header from 'ply' to 'end_header'")
    order, elements = _read_header(header[2].lower())
    counts = {element.name: element.size for element in elements}
    if not counts.get("vertex"):
        raise InvalidMesh("the PLY file holds no vertex elements", kind="face")
    if not any(counts.get(name) for name in _POLYGONS):
        raise InvalidMesh("the PLY file holds no face elements", kind="face")
    for element in elements:
        element.wanted()
    body = data[header.end() :]
    least_bytes = {element.name: element.least_bytes(order) for element in elements}
    check_declared_counts(counts, least_bytes, len(body), slack=0 if order else 1)
    check_face_count(counts.get("face", 0), max_faces)
    vertices, corners, sizes, behind = _read_body(elements, body, order)
    others = {name: n for name, n in counts.items() if name not in ("vertex", *_POLYGONS)}
    return FileContents(vertices, corners, sizes, others | behind)


def _read_header(header: bytes) -> tuple[str, list[_Element]]:
    """Return the byte order, empty for text, and the elements."""
    order: str | None = None
    elements: list[_Element] = []
    lines = header.splitlines()
    declared = sum(line.lstrip()[:7] in (b"element", b"propert") for line in lines)
    if declared > _MOST_HEADER_LINES:
        raise InvalidMesh(
            f"the PLY header has {declared} elements and properties; at most {_MOST_HEADER_LINES} "
            "can be read"
        )
    for line in lines:
        match line.split():
            case [b"format", form, _] if form in _ORDERS:
                order = _ORDERS[form]
            case [b"element", word, count] if count.isdigit() and len(count) <= _MOST_DIGITS:
                name = word.decode("ascii", "replace")
                if name in [element.name for element in elements]:
                    raise InvalidMesh(f"the PLY header says {excerpt(line)} twice")
                elements.append(_Element(name, int(count), []))
            case [b"property", b"list", count_type, item, word] if (
                elements and item in _TYPES and _TYPES.get(count_type, "f") not in "fd"
            ):
                part = _Property(word, _TYPES[item], _TYPES[count_type])
                elements[-1].properties.append(part)
            case [b"property", item, word] if elements and item in _TYPES:
                elements[-1].properties.append(_Property(word, _TYPES[item], ""))
            case [] | [b"comment" | b"obj_info", *_]:
                pass
            case _:
                raise InvalidMesh(f"the PLY header has an unknown line, {excerpt(line)}")
    if order is None:
        raise InvalidMesh("the PLY header names no format")
    return order, elements


def _read_body(
    elements: list[_Element], body: bytes, order: str
) -> tuple[Floats, Longs, Longs, dict[str, int]]:
    """Return the positions, the corners and sizes of polygons, and what lies behind them."""
    rows = [] if order else [row for row in body.splitlines() if row.strip()]
    if not order:
        check_row_count({element.name: element.size for element in elements}, len(rows))
    vertices = np.empty((0, 3))
    polygons: dict[str, tuple[Longs, Longs]] = {}
    at = 0
    for element in elements:
        if order:
            values, at = _read_binary(element, body, at, order)
        else:
            values, at = _read_text(element, rows, at)
        with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
            if element.name == "vertex":
                axes = [values[i][0].astype(np.float64) for i in element.wanted()]
                vertices = np.stack(axes, axis=1)
            elif element.name in _POLYGONS:
                corners, sizes = values[element.wanted()[0]]
                polygons[element.name] = _as_polygons(element, corners.astype(np.int64), sizes)
    if order:
        behind = {f"bytes {BEHIND}": len(body) - at if body[at:].strip() else 0}
    else:
        behind = {f"rows {BEHIND}": len(rows) - at}
    ordered = [polygons[name] for name in _POLYGONS if name in polygons]
    corners, sizes = (np.concatenate(parts) for parts in zip(*ordered, strict=True))
    return vertices, corners, sizes, behind


def _as_polygons(element: _Element, corners: Longs, sizes: Longs) -> tuple[Longs, Longs]:
    """Return the polygons of an element; strips of triangles become triangles."""
    if element.name == "face" or len(corners) < 3:
        return corners, sizes
    # A strip ends with its list, or at -1.
    at = np.arange(len(corners))
    ends = np.zeros(len(corners), bool)
    ends[np.cumsum(sizes)[sizes > 0] - 1] = True
    is_break = corners == -1
    starts_anew = np.concatenate([[True], (ends | is_break)[:-1]])
    start = np.maximum.accumulate(np.where(starts_anew, at, 0))
    first = at[:-2][(start[:-2] == start[2:]) & ~is_break[2:]]
    odd = (first - start[first]) % 2
    rows = corners[np.stack([first + odd, first + 1 - odd, first + 2], axis=1)]
    rows = rows[of_three_vertices(rows)]  # others only lead to where the strip goes on
    return rows.reshape(-1), np.full(len(rows), 3)


def _read_text(element: _Element, rows: list[bytes], start: int) -> tuple[_Values, int]:
    """Return the properties of an element that are wanted, and which row follows it."""
    end = start + element.size
    block = rows[start:end]
    parts = element.properties
    if element.name == "vertex":
        scalar = [i for i, part in enumerate(parts) if not part.count_type]
        if len(scalar) < len(parts):
            by_property = _words_by_property(element, block)
            block = [b" ".join(words[i] for i in scalar) for words in by_property]
        table = vertex_table(block, len(scalar)).T
        ones = np.ones(element.size, np.int64)
        with np.errstate(over="ignore", invalid="ignore"):  # the mesh refuses what is not finite
            columns = {
                i: (column.astype(parts[i].type), ones)
                for i, column in zip(scalar, table, strict=True)
            }
        return columns, end
    if element.name in _POLYGONS:
        (at,) = element.wanted()
        skipped = at
        if any(part.count_type for part in parts[:at]):
            block = [b" ".join(words[at:]) for words in _words_by_property(element, block)]
            skipped = 0
        return {at: counted_polygons(block, skipped)}, end
    return {}, end


def _words_by_property(element: _Element, rows: list[bytes]) -> Iterator[list[bytes]]:
    """Yield the words of each property of each row: of a list, its count and its items."""
    for number, row in enumerate(rows):
        words, by_property, at = row.split(), [], 0
        for part in element.properties:
            end = at + 1
            if part.count_type and at < len(words):
                end += int(words[at]) if INDEX_ROW.fullmatch(words[at]) else len(words)
            if not at < end <= len(words):
                kind = "face" if element.name in _POLYGONS else "vertex"
                rule = f"it must have {len(element.properties)} properties, lists with their counts"
                raise bad_row(kind, number, row, rule, element.name)
            by_property.append(b" ".join(words[at:end]))
            at = end
        yield by_property


def _read_binary(element: _Element, body: bytes, start: int, order: str) -> tuple[_Values, int]:
    """Return the properties of an element that are wanted, and at which byte the next begins."""
    table = _uniform_records(element, body, start, order)
    if table is None:
        return _walk_lists(element, body, start, order)
    values = {}
    for i in element.wanted():
        rows = table[str(i)].reshape(element.size, -1)
        values[i] = rows.reshape(-1), np.full(element.size, rows.shape[1])
    return values, start + table.nbytes


def _uniform_records(element: _Element, body: bytes, start: int, order: str) -> NDArray[Any] | None:
    """Return an element's records, where all lists are as long as the first; else None."""
    fields: list[Any] = []
    for i, part in enumerate(element.properties):
        if part.count_type:
            at = start + np.dtype(fields).itemsize
            if at + np.dtype(part.count_type).itemsize > len(body):
                return None
            count = int(np.frombuffer(body, order + part.count_type, 1, at)[0])
            if not 0 <= count <= len(body):
                return None
            fields += [(f"count{i}", order + part.count_type)]
            fields += [(str(i), order + part.type, (count,))]
        else:
            fields.append((str(i), order + part.type))
    dtype = np.dtype(fields)
    if start + element.size * dtype.itemsize > len(body):
        return None
    table = np.frombuffer(body, dtype, element.size, start)
    counts = [table[f"count{i}"] for i, part in enumerate(element.properties) if part.count_type]
    return table if all((count == count[:1]).all() for count in counts) else None


def _walk_lists(element: _Element, body: bytes, at: int, order: str) -> tuple[_Values, int]:
    """Return what `_read_binary` does, of records of any lengths."""
    counters = [struct.Struct(order + part.count_type) for part in element.properties]
    widths = [np.dtype(part.type).itemsize for part in element.properties]
    chunks: dict[int, list[bytes]] = {i: [] for i in element.wanted()}
    sizes: dict[int, list[int]] = {i: [] for i in chunks}
    for number in range(element.size):
        for i, (counter, width) in enumerate(zip(counters, widths, strict=True)):
            if at + counter.size > len(body):
                raise _ends_within(element, number)
            count = counter.unpack_from(body, at)[0] if counter.size else 1
            if count < 0:
                raise InvalidMesh(
                    f"a list of {element.name} {number} of the PLY file has {count} items"
                )
            at += counter.size
            if i in chunks:
                chunks[i].append(body[at : at + count * width])
                sizes[i].append(count)
            at += count * width
        if at > len(body):
            raise _ends_within(element, number)
    values = {}
    for i, parts in chunks.items():
        item = order + element.properties[i].type
        values[i] = np.frombuffer(b"".join(parts), item), np.array(sizes[i], np.int64)
    return values, at


def _ends_within(element: _Element, number: int) -> InvalidMesh:
    return InvalidMesh(
        f"the PLY file ends within {element.name} {number}, where its header declares "
        f"{counts_in_words({element.name: element.size})}"
    )
