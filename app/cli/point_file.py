"""Files of points."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from app.cli.points import Point
from app.cli.steps import Failure
from app.cli.text_file import lines_of

if TYPE_CHECKING:
    from geodesic_core import SurfacePoint, TriangleMesh

    Points = Sequence[SurfacePoint] | Literal["all"]


def points_of(mesh: "TriangleMesh", file: Path) -> "Points":
    """Return the points of a file, one a line; those of all vertices for the name ``all``."""
    if str(file) == "all":
        return "all"
    from app.queries.points import resolve_point
    from geodesic_core.errors import InvalidPoint

    try:
        lines = lines_of(file)
    except typer.BadParameter as error:
        raise Failure(str(error)) from None
    points: list[SurfacePoint] = []
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        try:
            points.append(resolve_point(mesh, Point.parse(text).point))
        except (InvalidPoint, typer.BadParameter) as error:
            raise Failure(f"{file}, line {number}: {error}") from None
    if not points:
        raise Failure(f"{file} has no points: write one point per line")
    return points
