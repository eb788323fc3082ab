"""Annotations of FreeSurfer: files that give a label to each vertex, with a table of their names.

All numbers are big-endian integers of four bytes::

    vertices, then a vertex and the code of its label, for each
    1, where a table follows
    entries of the table, or -2 for the second version of it
        first version:   bytes and text of the name of its file, then the entries
        second version:  largest number, bytes and text as above, entries, then the entries, each
                         behind its number
    an entry: bytes and text of the name, then red, green, blue and 255 - opacity

The code of a label is its colour: red + 256 green + 65536 blue. nibabel reads files on disk only,
and takes the vertices to be in order.
"""

import numpy as np

from geodesic_core.arrays import Longs
from geodesic_core.errors import InvalidArgument, OtherSurface

_SECOND_VERSION = -2


class _Integers:
    """A cursor over bytes."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def bytes_of(self, count: int) -> bytes:
        taken = self._data[self._at : self._at + count]
        if count < 0 or len(taken) < count:
            raise InvalidArgument(f"it ends at byte {len(self._data)}, before it is complete")
        self._at += count
        return taken

    def next(self) -> int:
        return int.from_bytes(self.bytes_of(4), "big", signed=True)

    def text(self) -> str:
        return self.bytes_of(self.next()).rstrip(b"\0").decode("utf-8", "replace")

    def is_at_end(self) -> bool:
        return self._at >= len(self._data)


def read_annotation(data: bytes, count: int) -> tuple[Longs, dict[int, tuple[str, int]]]:
    """Return the labels of a surface with ``count`` vertices, or refuse those of another.

    They are the code of the label of each vertex, 0 for none, and a table: the name and the code of
    each label by its number in the file.
    """
    integers = _Integers(data)
    rows = integers.next()
    if not 0 <= rows <= count:
        raise OtherSurface(f"it has {rows} vertices, but the mesh has {count}", rows, count)
    pairs = np.frombuffer(integers.bytes_of(8 * rows), ">i4").reshape(-1, 2).astype(np.int64)
    check_vertices(pairs[:, 0], count)
    codes = np.zeros(count, np.int64)
    codes[pairs[:, 0]] = pairs[:, 1]
    has_table = not integers.is_at_end() and integers.next() == 1
    return codes, _table(integers) if has_table else {}


def check_vertices(vertices: Longs, count: int, source: str = "it") -> None:
    """Refuse vertices from a source that are not among the ``count`` of a mesh."""
    wrong = vertices[(vertices < 0) | (vertices >= count)]
    if len(wrong):
        message = f"{source} lists vertex {wrong[0]}, but the mesh has {count}"
        raise OtherSurface(message, int(vertices.max()) + 1, count)


def _table(integers: _Integers) -> dict[int, tuple[str, int]]:
    entries = integers.next()
    is_numbered = entries < 0
    if is_numbered and entries != _SECOND_VERSION:
        raise InvalidArgument(f"its table is of version {-entries}; versions 1 and 2 are read")
    if is_numbered:
        integers.next()
    integers.text()
    if is_numbered:
        entries = integers.next()
    table = {}
    for i in range(entries):  # which ends with the bytes, whatever the file declares
        number = integers.next() if is_numbered else i
        name = integers.text()
        red, green, blue, _ = (integers.next() for _ in range(4))
        table[number] = name, red + (green << 8) + (blue << 16)
    return table
