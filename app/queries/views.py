"""Answers as tables, lines and surfaces, for the formats that are written from these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import Line, Surface, Table
from app.encoding.views import Column, Values, rows_of


def columns_of(members: Mapping[str, Any]) -> dict[str, Values]:
    """Return the columns of an answer by name: distances, then included ones (vectors as three)."""
    columns: dict[str, Values] = {"distance": members["distances"]}
    names = "nearest_source", "lower", "upper"
    columns |= {name: members[name] for name in names if name in members}
    if "gradient" in members:
        columns |= {f"gradient_{x}": members["gradient"][:, i] for i, x in enumerate("xyz")}
    return columns


def table_of_distances(index: str, columns: Mapping[str, Values]) -> Table:
    """Return a row for each vertex or target, numbered under the name ``index``."""
    return Table.of({index: range(len(columns["distance"])), **columns})


def surface_of(mesh: gc.TriangleMesh, columns: Mapping[str, Values]) -> Surface:
    """Return a mesh with values at its vertices."""
    return Surface(mesh.vertices, mesh.faces, columns)


def line_of(outline: Mapping[str, Any], number: int | None = None) -> Line:
    """Return a path, or the reason why there is none; its ``number`` where there are several."""
    properties: dict[str, Any] = {} if number is None else {"path": number}
    properties |= {"status": outline.get("reason", "ok"), "length": outline["length"]}
    return polyline(outline, properties, "" if number is None else f"path_{number}")


def polyline(described: Mapping[str, Any], properties: Mapping[str, Any], group: str) -> Line:
    """Return a described path or line, with the locations of its points if it has that member."""
    columns: dict[str, list[Any]] = {}
    points = described["points"]
    if "locations" in described:
        locations = described["locations"] or ()
        columns = {"face": [each["face"] for each in locations]}
        columns |= {x: [each["barycentric"][i] for each in locations] for i, x in enumerate("uvw")}
        if points is None:
            points = np.full((len(locations), 3), np.nan)
    return Line(points, properties, group, bool(described.get("closed")), columns)


def _no_line(*, located: bool) -> dict[str, Any]:
    """Return what stands for a line where there is none."""
    none = {"closed": None, "length": None, "points": np.empty((0, 3))}
    return none | ({"locations": ()} if located else {})


def lines_of(levels: Sequence[Mapping[str, Any]], *, located: bool) -> list[Line]:
    """Return isolines, and a line without points for each level that has none."""
    return [
        polyline(
            line,
            {
                "level": each["level"],
                "line": i if each["lines"] else None,
                "closed": line["closed"],
                "length": line["length"],
            },
            f"level_{each['level']!r}",
        )
        for each in levels
        for i, line in enumerate(each["lines"] or [_no_line(located=located)])
    ]


def lines_of_borders(borders: Sequence[Mapping[str, Any]], *, located: bool) -> list[Line]:
    """Return borders as lines, or a line without points where there are none."""
    none = {"sources": (None, None), **_no_line(located=located)}
    return [
        polyline(
            border,
            {
                "line": i if borders else None,
                "first": border["sources"][0],
                "second": border["sources"][1],
                "closed": border["closed"],
                "length": border["length"],
            },
            f"border_{border['sources'][0]}_{border['sources'][1]}",
        )
        for i, border in enumerate(borders or [none])
    ]


def lines_of_boundaries(curves: Sequence[Mapping[str, Any]], *, located: bool) -> list[Line]:
    """Return boundaries as lines with their vertices, or a line without points for none."""
    lines = lines_of_curves(curves, "boundary", located=located)
    given = curves or [{"vertices": ()}]
    return [
        replace(line, at_points={"vertex": curve["vertices"], **line.at_points})
        for line, curve in zip(lines, given, strict=True)
    ]


def lines_of_curves(curves: Sequence[Mapping[str, Any]], name: str, *, located: bool) -> list[Line]:
    """Return curves as lines of this name, or a line without points for none."""
    return [
        polyline(
            curve,
            {
                "line": i if curves else None,
                "closed": curve["closed"],
                "length": curve["length"],
            },
            f"{name}_{i}",
        )
        for i, curve in enumerate(curves or [_no_line(located=located)])
    ]


def table_of_matrix(distances: NDArray[np.float64]) -> Table:
    """Return a row for each cell of a matrix (N, M), or for each of N pairs."""
    if distances.ndim == 1:
        pairs = range(len(distances))
        return table_of_sparse(pairs, pairs, distances)

    def rows() -> Iterator[Sequence[Any]]:
        for i, row in enumerate(distances):
            yield from rows_of(np.broadcast_to(i, len(row)), range(len(row)), row)

    return Table(_MATRIX, rows)


def table_of_sparse(rows: Column, columns: Column, distances: Column) -> Table:
    """Return a row for each cell of a sparse matrix."""
    return Table.of(dict(zip(_MATRIX, (rows, columns, distances), strict=True)))


_MATRIX = "source", "target", "distance"


def table_of_points(
    index: str, found: Sequence[Mapping[str, Any] | None], value: str | None = "distance"
) -> Table:
    """Return a row for each described point, numbered by ``index`` unless it has that member.

    The second column is its member ``value``, if any.
    """
    values = [] if value is None else [value]

    def rows() -> Iterator[Sequence[Any]]:
        for i, described in enumerate(found):
            each = described or {}
            yield (
                each.get(index, i),
                *(each.get(name) for name in values),
                *(each.get("position") or _NOTHING),
                each.get("vertex"),
                each.get("face"),
                *each.get("barycentric", _NOTHING),
            )

    return Table([index, *values, *"xyz", "vertex", "face", *"uvw"], rows)


_NOTHING = None, None, None
