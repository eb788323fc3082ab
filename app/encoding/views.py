"""How an answer looks to programs that know no meshes: as a table, lines, places, or a surface."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

_ROWS = 2**11
"""Rows of arrays that become cells at a time."""


class Indices:
    """An array of indices of which −1 stands for none: ``null`` in JSON, empty in CSV.

    No dataclass: orjson would write it as an object.
    """

    def __init__(self, array: NDArray[Any]) -> None:
        self.array = array

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, part: slice) -> "Indices":
        return Indices(self.array[part])

    def tolist(self) -> list[int | None]:
        """Return the indices, None for none."""
        return [None if i < 0 else i for i in self.array.tolist()]


Values = NDArray[Any] | Indices
Column = Values | range


@dataclass(frozen=True)
class Table:
    """Rows of cells under names; None for an empty cell."""

    names: Sequence[str]
    rows: Callable[[], Iterator[Sequence[Any]]]

    @classmethod
    def of(cls, columns: Mapping[str, Column]) -> "Table":
        """Return the table of some columns of one length."""
        return cls([*columns], lambda: rows_of(*columns.values()))


@dataclass(frozen=True)
class Line:
    """A polyline, or what is told of there being none."""

    points: NDArray[np.float64]
    """(K, 3), mesh units; none where there is no line"""
    told: Mapping[str, Any]
    """What it has in GeoJSON and CSV, under the same names in all lines of an answer"""
    group: str = ""
    """What it belongs to, in OBJ: lines of one group follow one another"""
    is_closed: bool = False
    """Whether it leads back from its last point to the first, which is not repeated"""
    shade: float = 0.0
    """Which colour it has: 0 to 1"""
    at_points: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """What CSV tells of each point: K values each, under the same names in all lines"""


@dataclass(frozen=True)
class Place:
    """A point, and what GeoJSON tells of it."""

    position: Sequence[float] | None
    told: Mapping[str, Any]


@dataclass(frozen=True)
class Surface:
    """A mesh with values at its vertices, the colour of each by the first of them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.integer[Any]]
    values: Mapping[str, Values] = field(default_factory=dict)


def rows_of(*columns: Column) -> Iterator[Sequence[Any]]:
    """Yield the rows of some columns of one length, which become cells a part at a time."""
    for start in range(0, len(columns[0]), _ROWS):
        part = slice(start, start + _ROWS)
        yield from zip(*(_cells(column[part]) for column in columns), strict=True)


def table_of_lines(lines: Sequence[Line]) -> Table:
    """Return a row for each point; one without, where there is no line."""
    first = lines[0]

    def rows() -> Iterator[Sequence[Any]]:
        for line in lines:
            told = tuple(map(_cell, line.told.values()))
            if not len(line.points):
                yield told + (None,) * (4 + len(first.at_points))
                continue
            columns = *line.points.T.tolist(), *line.at_points.values()
            points = zip(range(len(line.points)), *columns, strict=True)
            yield from (told + point for point in points)

    return Table([*first.told, "point", *"xyz", *first.at_points], rows)


def _cells(column: Column) -> Sequence[Any]:
    """Return what stands in the cells of a column: nothing where there is no number.

    That of arrays as text, which orjson makes in a third of the time that Python takes.
    """
    match column:
        case range():
            return column
        case Indices():
            return column.tolist()
    text = orjson.dumps(np.ascontiguousarray(column), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].decode().replace("null", "").split(",")


def _cell(value: Any) -> Any:
    return str(value).lower() if isinstance(value, bool) else value
