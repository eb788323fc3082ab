"""PLY files: elements and properties as the header declares them, in text or binary."""

import re
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.limits import check_declared_counts, check_face_count, counts_in_words
from geodesic_core.io.text import (
    VERTEX_ROW,
    check_row_count,
    check_rows,
    counted_polygons,
    excerpt,
    index_rows,
    number_table,
)

_HEADER = re.compile(rb"ply[ \t]*\r?\n(.*?)^end_header[ \t]*\r?\n", re.DOTALL | re.MULTILINE)
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


class _Property(NamedTuple):
    name: bytes
    type: str
    count_type: str
    """Of a list; else empty."""


class _Element(NamedTuple):
    name: str
    size: int
    properties: list[_Property]

    @property
    def has_lists(self) -> bool:
        return any(part.count_type for part in self.properties)

    def least_bytes(self, order: str) -> int:
        """Return the least bytes of one, its lists empty; of text where ``order`` is empty."""
        if not order:
            return 2 * len(self.properties)  # a digit and a separator
        return sum(np.dtype(part.count_type or part.type).itemsize for part in self.properties)


def read_ply(data: bytes, max_faces: int | None) -> FileContents:
    """Read a PLY file.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    header = _HEADER.match(data)
    if header is None:
        raise InvalidMesh("the PLY file has no header from 'ply' to 'end_header'")
    order, elements = _read_header(header[1])
    counts = {element.name: element.size for element in elements}
    for name in ("vertex", "face"):
        if not counts.get(name):
            raise InvalidMesh(f"the PLY file holds no {name} elements", kind="face")
    _check_properties(elements)
    body = data[header.end() :]
    least_bytes = {element.name: element.least_bytes(order) for element in elements}
    check_declared_counts(counts, least_bytes, len(body))
    check_face_count(counts["face"], max_faces)
    read = _read_binary(elements, body, order) if order else _read_ascii(elements, body)
    others = {name: n for name, n in counts.items() if n and name not in ("vertex", "face")}
    return read._replace(notes=note_on_ignored("PLY", others))


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


def _check_properties(elements: list[_Element]) -> None:
    """Refuse vertices without x, y and z, and faces without corners."""
    for element in elements:
        names = [part.name for part in element.properties if not part.count_type]
        if element.name == "vertex" and (
            element.has_lists or [names.count(axis) for axis in (b"x", b"y", b"z")] != [1, 1, 1]
        ):
            raise InvalidMesh("the PLY vertices must have x, y and z once each, and no lists")
        if element.name == "face":
            _corner_list_index(element)


def _corner_list_index(face: _Element) -> int:
    """Return which property holds the corners of faces."""
    for index, part in enumerate(face.properties):
        if part.count_type and part.name in _CORNER_NAMES:
            return index
    raise InvalidMesh("the PLY faces have no property 'list … vertex_indices'", kind="face")


def _read_ascii(elements: list[_Element], body: bytes) -> FileContents:
    rows = [row for row in body.splitlines() if row.strip()]
    check_row_count({element.name: element.size for element in elements}, len(rows))
    start = 0
    for element in elements:
        block = rows[start : start + element.size]
        start += element.size
        if element.name == "vertex":
            vertices = _read_ascii_positions(element, block)
        elif element.name == "face":
            at = _corner_list_index(element)
            if any(part.count_type for part in element.properties[:at]):
                raise InvalidMesh("the PLY faces have another list before their vertex_indices")
            corners, sizes = index_rows(counted_polygons(block, skipped=at))
    return FileContents(vertices, corners, sizes)


def _read_ascii_positions(element: _Element, rows: list[bytes]) -> Floats:
    columns = len(element.properties)
    check_rows(rows, VERTEX_ROW, "vertex", f"it must have {columns} numbers")
    short = next((i for i, row in enumerate(rows) if len(row.split()) < columns), None)
    if short is not None:
        raise InvalidMesh(
            f"vertex {short} reads {excerpt(rows[short])}; it must have {columns} numbers",
            kind="vertex",
            elements=[short],
        )
    table = dict(
        zip((part.name for part in element.properties), number_table(rows, columns).T, strict=True)
    )
    types = {part.name: part.type for part in element.properties}
    with np.errstate(over="ignore"):  # the mesh refuses what is not finite
        axes = [table[axis].astype(types[axis]) for axis in (b"x", b"y", b"z")]
    return np.stack(axes, axis=1).astype(np.float64)


def _read_binary(elements: list[_Element], body: bytes, order: str) -> FileContents:
    counts = {element.name: element.size for element in elements}
    short = InvalidMesh(
        f"the header declares {counts_in_words(counts)}, but {len(body)} bytes follow"
    )
    at = 0
    for element in elements:
        table = _uniform_records(element, body, at, order)
        if table is None:
            if not element.has_lists:
                raise short
            walked = _walk_lists(element, body, at, order)
            at = walked[2]
            if element.name == "face":
                corners, sizes = walked[:2]
            continue
        at += table.nbytes
        if element.name == "vertex":
            names = [part.name for part in element.properties]
            axes = [table[str(names.index(axis))] for axis in (b"x", b"y", b"z")]
            with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
                vertices = np.stack(axes, axis=1).astype(np.float64)
        elif element.name == "face":
            rows = table[str(_corner_list_index(element))]
            corners, sizes = rows.astype(np.int64).reshape(-1), np.full(len(rows), rows.shape[1])
    if at != len(body):
        raise short
    return FileContents(vertices, corners, sizes)


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


def _walk_lists(element: _Element, body: bytes, at: int, order: str) -> tuple[Longs, Longs, int]:
    """Return the corners of faces of any size, the size of each, and the offset behind them."""
    corner_list = _corner_list_index(element) if element.name == "face" else -1
    counters = [struct.Struct(order + part.count_type) for part in element.properties]
    widths = [np.dtype(part.type).itemsize for part in element.properties]
    chunks, sizes = [], []
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
            if i == corner_list:
                chunks.append(body[at : at + count * width])
                sizes.append(count)
            at += count * width
        if at > len(body):
            raise _ends_within(element, number)
    item = order + element.properties[corner_list].type
    corners = np.frombuffer(b"".join(chunks), item).astype(np.int64)
    return corners, np.array(sizes, dtype=np.int64), at


def _ends_within(element: _Element, number: int) -> InvalidMesh:
    return InvalidMesh(
        f"the PLY file ends within {element.name} {number}, where its header declares "
        f"{counts_in_words({element.name: element.size})}"
    )
