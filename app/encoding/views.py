"""Views of an answer, for formats without its structure: table, lines, surface."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from geodesic_core.errors import NotEmbedded

_ROWS = 2**11
"""Rows of arrays that are turned into cells at a time."""


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


class Elements:
    """The elements of a list, made some at a time, and only for a format that shows them."""

    def __init__(self, count: int, made: Callable[[slice], list[Any]]) -> None:
        self._count = count
        self._made = made

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, part: slice) -> list[Any]:
        return self._made(part)

    def tolist(self) -> list[Any]:
        """Return all elements."""
        return self._made(slice(None))


Values = NDArray[Any] | Indices
Column = Values | range


@dataclass(frozen=True)
class Table:
    """Rows of cells under names; None for an empty cell."""

    names: Sequence[str]
    rows: Callable[[], Iterator[Sequence[Any]]]

    @classmethod
    def of(cls, columns: Mapping[str, Column]) -> "Table":
        """Return the table with columns of one length."""
        return cls([*columns], lambda: rows_of(*columns.values()))


@dataclass(frozen=True)
class Line:
    """A polyline with its properties; without points where there is no line."""

    points: NDArray[np.float64]
    """(K, 3), mesh units; empty where there is no line, NaN on a mesh without positions"""
    properties: Mapping[str, Any]
    """Values for CSV, under the same names in all lines of an answer"""
    group: str = ""
    """The group in OBJ; lines of one group follow one another"""
    is_closed: bool = False
    """Whether it leads back from its last point to the first, which is not repeated"""
    at_points: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """Columns of K values for the points in CSV, under the same names in all lines"""


@dataclass(frozen=True)
class Surface:
    """A mesh with values at its vertices, the colour of each by the first of them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.integer[Any]]
    values: Mapping[str, Values] = field(default_factory=dict)


def embedded(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return positions, or refuse to draw without any."""
    if np.isnan(points.min(initial=np.inf)):  # with no mask as long as the answer
        raise NotEmbedded(
            "a drawing needs positions in space, and this mesh has lengths alone: ask for json or "
            "csv"
        )
    return points


def rows_of(*columns: Column) -> Iterator[Sequence[Any]]:
    """Yield the rows of columns of one length, turning a part of each into cells at a time."""
    for start in range(0, len(columns[0]), _ROWS):
        part = slice(start, start + _ROWS)
        yield from zip(*(_cells(column[part]) for column in columns), strict=True)


def table_of_lines(lines: Sequence[Line]) -> Table:
    """Return the table with a row for each point, and one row for a line without points."""
    first = lines[0]

    def rows() -> Iterator[Sequence[Any]]:
        for line in lines:
            properties = tuple(map(_cell, line.properties.values()))
            if not len(line.points):
                yield properties + (None,) * (4 + len(first.at_points))
                continue
            positions = line.points.T.astype(object)
            positions[np.isnan(line.points.T)] = None
            columns = *positions.tolist(), *line.at_points.values()
            points = zip(range(len(line.points)), *columns, strict=True)
            yield from (properties + point for point in points)

    return Table([*first.properties, "point", *"xyz", *first.at_points], rows)


def _cells(column: Column) -> Sequence[Any]:
    """Return the cells of a column: empty where there is no number.

    Cells of arrays are text, which orjson makes in a third of the time that Python takes.
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
