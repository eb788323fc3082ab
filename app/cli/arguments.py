"""Arguments that several commands share."""

import re
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

USUAL_ERROR = 1e-3
"""The relative error of approximate answers, where none is named."""


class Merge(StrEnum):
    """Which vertices of a file become one."""

    NONE = "none"
    EXACT = "exact"


class Method(StrEnum):
    """How exact an answer has to be."""

    EXACT = "exact"
    APPROXIMATE = "approximate"


class Layout(StrEnum):
    """How a matrix is laid out."""

    DENSE = "dense"
    SPARSE = "sparse"
    PAIRS = "pairs"


class SampleName(StrEnum):
    """Meshes that can be made."""

    KNOT = "knot"
    SPHERE = "sphere"
    TERRAIN = "terrain"
    OBSTACLES = "obstacles"
    PLANE = "plane"


class Point(NamedTuple):
    """A point of the mesh, as it was written."""

    text: str
    point: Any

    @classmethod
    def parse(cls, text: str) -> "Point":
        """Return the point that an option names."""
        from app.queries.point_text import parse

        try:
            return cls(text, parse(f"v{text}" if _INDEX.fullmatch(text) else text))
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None


_INDEX = re.compile(r"-?[0-9]+")


class PointOrCurve(NamedTuple):
    """A point, or the points of a curve, where paths start, as they were written."""

    text: str
    points: Sequence[Point]

    @classmethod
    def parse(cls, text: str) -> "PointOrCurve":
        """Return the point or the curve that an option names."""
        return cls(text, [Point.parse(part) for part in text.split("/")])


def position(text: str) -> Point:
    """Return the position that an option names."""
    try:
        return Point(text, Point.parse(f"p{text}").point)
    except typer.BadParameter:
        raise typer.BadParameter(f"{text!r} is not a position: write it as x,y,z") from None


def faces(text: str) -> Sequence[int]:
    """Return the faces that an option lists: ids, and ranges with both ends."""
    if not _FACES.fullmatch(text):
        raise typer.BadParameter(f"{text!r} is not a list of faces: write it as 3,7,40-59")
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


_FACES = re.compile(r"[0-9]{1,9}(-[0-9]{1,9})?(,[0-9]{1,9}(-[0-9]{1,9})?)*")


def writable(*suffixes: str) -> Callable[[Path], Path]:
    """Return a check of an output path, made before any work begins."""

    def check(path: Path) -> Path:
        if path.suffix.lower() not in suffixes:
            *others, last = suffixes
            ends = f"{', '.join(others)} or {last}" if others else last
            raise typer.BadParameter(f"{path} must end in {ends}")
        if not path.absolute().parent.is_dir():
            raise typer.BadParameter(f"the folder of {path} does not exist")
        return path

    return check


SPELLINGS = "as 12 (a vertex), e12-13:0.3 (edge), f7:0.2,0.3,0.5 (face) or p1,2,3 (position)"

MeshFile = Annotated[
    Path, typer.Argument(metavar="MESH", help="An OBJ, OFF, PLY, STL or GLB file.")
]
MergeOption = Annotated[
    Merge, typer.Option("--merge", help="'exact' joins vertices at equal positions.")
]
MaxDistance = Annotated[float | None, typer.Option(help="Go no farther than this, in mesh units.")]
CURVES = "or a curve: points that are each in a face with the next, as 12/e13-14:0.5/15"
Sources = Annotated[
    list[Point],
    typer.Option(
        "--source",
        parser=Point.parse,
        metavar="POINT",
        help=f"A source, {SPELLINGS}; may be given again.",
    ),
]
Origins = Annotated[
    list[PointOrCurve],
    typer.Option(
        "--source",
        parser=PointOrCurve.parse,
        metavar="POINT",
        help=f"A source, {SPELLINGS}, {CURVES}; may be given again.",
    ),
]
OriginOption = Annotated[
    PointOrCurve,
    typer.Option(
        "--source",
        parser=PointOrCurve.parse,
        metavar="POINT",
        help=f"What to start from, {SPELLINGS}, {CURVES}.",
    ),
]
Source = Annotated[
    Point,
    typer.Option(
        parser=Point.parse, metavar="POINT", help=f"The point to start from, {SPELLINGS}."
    ),
]
Targets = Annotated[
    list[Point],
    typer.Option(
        "--target", parser=Point.parse, metavar="POINT", help="A target; may be given again."
    ),
]
Barriers = Annotated[
    Sequence[int] | None,
    typer.Option(
        parser=faces, metavar="FACES", help="Faces that are blocked, as 3,7,40-59: holes."
    ),
]
MethodOption = Annotated[
    Method, typer.Option("--method", help="'approximate' is faster, within the error asked for.")
]
RelativeError = Annotated[
    float | None,
    typer.Option(
        help="For approximate: the error granted, as a share of the distance; "
        f"{USUAL_ERROR} where no error is named."
    ),
]
AbsoluteError = Annotated[
    float | None,
    typer.Option(help="For approximate: the same in mesh units; with both, both hold."),
]


def granted_errors(
    method: Method, relative_error: float | None, absolute_error: float | None
) -> tuple[float | None, float | None] | None:
    """Return the relative and the absolute error to solve with; None where the method is exact."""
    is_named = relative_error is not None or absolute_error is not None
    if method is Method.APPROXIMATE:
        return (relative_error, absolute_error) if is_named else (USUAL_ERROR, None)
    if is_named:
        name = "--absolute-error" if relative_error is None else "--relative-error"
        raise typer.BadParameter(f"{name} goes with --method approximate only")
    return None
