"""Arguments of several commands."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from app.cli.barriers import BlockedFaces
from app.cli.points import Point, PointOrCurve, PointOrLabel


@dataclass(frozen=True)
class Merge:
    """Merging of the vertices of a file."""

    value: Literal["none", "exact"] | float

    @classmethod
    def parse(cls, given: "str | Merge") -> "Merge":
        """Return the merging that an option names; a default is one already."""
        if isinstance(given, Merge):
            return given
        match given:
            case "none":
                return cls("none")
            case "exact":
                return cls("exact")
        with suppress(ValueError):
            if 0.0 <= float(given) < math.inf:
                return cls(float(given))
        raise typer.BadParameter(
            f"{given!r} is neither 'none' nor 'exact', nor a distance, 0 or more"
        )

    def __str__(self) -> str:
        """Return it as the option has it."""
        return str(self.value)


NO_MERGE = Merge("none")


Method = Literal["exact", "approximate", "fast"]
BoundedMethod = Literal["exact", "approximate"]
"""Methods of solving whose bound is guaranteed"""
Layout = Literal["dense", "sparse", "pairs"]
Number = Literal["float64", "float32"]
SampleName = Literal["knot", "sphere", "terrain", "cortex", "obstacles", "plane"]


def effort(text: str) -> int:
    """Return the effort that an option names."""
    if text not in {"1", "2", "4", "8"}:
        raise typer.BadParameter(f"{text!r} is not 1, 2, 4 or 8")
    return int(text)


STANDARD_STREAM = Path("-")
"""Standard input, or standard output"""


def writable(*suffixes: str, to_stdout: bool = True) -> Callable[[Path | None], Path | None]:
    """Return a check of an output path that is made before any work begins."""

    def check(path: Path | None) -> Path | None:
        if path is None or (path == STANDARD_STREAM and to_stdout):
            return path
        if not path.name.lower().endswith(suffixes):
            *others, last = suffixes
            ends = f"{', '.join(others)} or {last}" if others else last
            raise typer.BadParameter(f"{path} must end in {ends}")
        if not path.absolute().parent.is_dir():
            raise typer.BadParameter(f"the folder of {path} does not exist")
        return path

    return check


SPELLINGS = "as 12 (a vertex), e12-13:0.3 (edge), f7:0.2,0.3,0.5 (face) or p1,2,3 (position)"

MeshFile = Annotated[
    Path,
    typer.Argument(
        metavar="MESH",
        help="An OBJ, OFF, PLY, STL, GLB, GIFTI, FreeSurfer, VTK or NPZ file; - for standard "
        "input.",
    ),
]
FormatOption = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Format of MESH, such as obj; by default the suffix of its name.",
    ),
]
MergeOption = Annotated[
    Merge,
    typer.Option(
        "--merge",
        parser=Merge.parse,
        metavar="none|exact|DISTANCE",
        help="'exact' joins vertices at the same position, a distance in mesh units those within "
        "it.",
    ),
]
MaxDistance = Annotated[
    float | None,
    typer.Option(
        help="Go no farther than this, in mesh units.",
        callback=lambda limit: None if limit == math.inf else limit,
    ),
]
CURVES = "or a curve: points separated by /, each in one face with the next, as 12/e13-14:0.5/15"
Sources = Annotated[
    list[Point],
    typer.Option(
        "--source",
        parser=Point.parse,
        metavar="POINT",
        help=f"A source, {SPELLINGS}; may be repeated.",
    ),
]
PointOrCurveSources = Annotated[
    list[PointOrCurve],
    typer.Option(
        "--source",
        parser=PointOrCurve.parse,
        metavar="POINT",
        help=f"A source, {SPELLINGS}, {CURVES}; may be repeated.",
    ),
]
PointOrLabelSources = Annotated[
    list[PointOrLabel],
    typer.Option(
        "--source",
        parser=PointOrLabel.parse,
        metavar="POINT",
        help=f"A source, {SPELLINGS}, {CURVES}; or the vertices of a label, as @FILE.label; may be "
        "repeated.",
    ),
]
SomePointOrLabelSources = Annotated[list[PointOrLabel] | None, *get_args(PointOrLabelSources)[1:]]
PointOrCurveSource = Annotated[
    PointOrCurve,
    typer.Option(
        "--source",
        parser=PointOrCurve.parse,
        metavar="POINT",
        help=f"The point to start from, {SPELLINGS}, {CURVES}.",
    ),
]
SomeSources = Annotated[list[Point] | None, *get_args(Sources)[1:]]
Source = Annotated[
    Point,
    typer.Option(
        parser=Point.parse, metavar="POINT", help=f"The point to start from, {SPELLINGS}."
    ),
]
Targets = Annotated[
    list[Point],
    typer.Option(
        "--target", parser=Point.parse, metavar="POINT", help="A target; may be repeated."
    ),
]
SomeTargets = Annotated[list[Point] | None, *get_args(Targets)[1:]]
Barriers = Annotated[
    BlockedFaces | None,
    typer.Option(
        parser=BlockedFaces.parse,
        metavar="FACES",
        help="Blocked faces, which act as holes: 3,7,40-59, or @FILE to read them from a file. For "
        "a brain surface, @FILE.label, .annot or .gii blocks a label; @FILE.annot=NAME blocks one "
        "of several; outside@FILE.label blocks all but the label.",
    ),
]
MethodOption = Annotated[
    Method,
    typer.Option(
        "--method",
        help="'approximate' is faster, within an allowed error; 'fast' is one quick pass, whose "
        "error is estimated.",
    ),
]
BoundedMethodOption = Annotated[
    BoundedMethod,
    typer.Option("--method", help="'approximate' is faster, within an allowed error."),
]
RelativeError = Annotated[
    float | None,
    typer.Option(
        help="For approximate: the allowed error, as a share of the distance; by default 0.001."
    ),
]
AbsoluteError = Annotated[
    float | None,
    typer.Option(
        help="For approximate: the allowed error in mesh units; if both errors are given, both "
        "hold."
    ),
]
EffortOption = Annotated[
    int | None,
    typer.Option(
        "--effort",
        parser=effort,
        metavar="1|2|4|8",
        help="For fast: more effort takes more time and lowers the error; 2 by default.",
    ),
]


def accuracy(
    method: Method,
    relative_error: float | None,
    absolute_error: float | None,
    effort: int | None = None,
) -> dict[str, Any]:
    """Return the members of a request that state its accuracy; each goes with one method only."""
    options = {
        "relative_error": (relative_error, "approximate"),
        "absolute_error": (absolute_error, "approximate"),
        "effort": (effort, "fast"),
    }
    given = {name: option for name, option in options.items() if option[0] is not None}
    for name, (_, needed) in given.items():
        if method != needed:
            option = "--" + name.replace("_", "-")
            raise typer.BadParameter(f"{option} goes with --method {needed} only")
    return {"method": method, **{name: value for name, (value, _) in given.items()}}


def limits(max_distance: float | None, barriers: BlockedFaces | None) -> dict[str, Any]:
    """Return the members of a request that state where paths may go."""
    return {"max_distance": max_distance, "barriers": barriers or BlockedFaces()}
