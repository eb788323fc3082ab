"""Files of points: in the spellings of options, or as columns of numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from app.cli.points import Point
from app.cli.steps import Failure
from app.cli.text_file import NUMBER, Line, at, columns_in, lines_of, whole
from app.cli.words import say_warning

if TYPE_CHECKING:
    from geodesic_core import SurfacePoint, TriangleMesh

    Points = Sequence[SurfacePoint] | Literal["all"]

_VERTEX = {"vertex", "vertices", "vertex_id", "vertexid", "index", "id", "node"}
_AXES = [{axis, f"points:{i}", f"points_{i}"} for i, axis in enumerate("xyz")]
"""Names of columns in a header; those of ParaView number the axes"""


def points_of(mesh: "TriangleMesh", file: Path) -> "Points":
    """Return the points of a file on a mesh; those of all vertices for the name ``all``.

    Warns of points that are hardly meant, and raises `Failure` where there are others than points.
    """
    if str(file) == "all":
        return "all"
    from app.queries.points import notes_on, resolve_point
    from geodesic_core.errors import InvalidPoint

    written = _written_in(file)
    points: list[SurfacePoint] = []
    for place, point in written:
        try:
            points.append(resolve_point(mesh, point.point))
        except InvalidPoint as error:
            raise Failure(f"{place}: {error}") from None
    for note in notes_on(mesh, ((place, point.point) for place, point in written), points):
        say_warning(note)
    return points


def _written_in(file: Path) -> list[tuple[str, Point]]:
    """Return the points of a file, each with its place there; at least one."""
    try:
        lines = lines_of(file)
    except typer.BadParameter as error:
        raise Failure(str(error)) from None
    columns = _columns_named_in(lines[0]) if lines else None
    if columns is not None:
        lines = lines[1:]
    points: list[tuple[str, Point]] = []
    for line in lines:
        place = f"{file}, line {line.number}"
        try:
            found = _points_in(line, columns, is_alone=len(lines) == 1)
        except typer.BadParameter as error:
            raise Failure(f"{place}: {error}") from None
        points += [(place, point) for point in found]
    if not points:
        raise Failure(f"{file} has no points: write one point per line")
    return points


def _columns_named_in(line: Line) -> list[int] | None:
    """Return the places of x, y and z, or of vertices; None where a line is no such header."""
    if NUMBER.match(line.text):
        return None
    return columns_in(line, *_AXES) or columns_in(line, _VERTEX)


def _points_in(line: Line, columns: list[int] | None, *, is_alone: bool) -> list[Point]:
    """Return the points of a line; several vertices may be on one that ``is_alone`` in its file."""
    if columns is None and line.text[0].isalpha():
        return [Point.parse("".join(line.text.split()))]
    fields = line.fields() if columns is None else at(line, columns)
    if len(fields) == 1:
        return [Point.parse(whole(fields[0]))]
    if is_alone and columns is None:
        if len(fields) != len(_AXES):
            return [Point.parse(whole(field)) for field in fields]
        if all(map(str.isdecimal, fields)):
            raise typer.BadParameter(
                f"{line.text!r} may be a position or three vertices: write p{','.join(fields)}, or "
                "one vertex per line"
            )
    if len(fields) != len(_AXES):
        raise typer.BadParameter(
            f"{line.text!r} has {len(fields)} columns: write one vertex per line, or the three "
            "columns of a position, or name the columns vertex, or x, y and z, in the first line"
        )
    return [Point.parse(f"p{','.join(fields)}")]
