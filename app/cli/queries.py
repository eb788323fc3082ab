"""Commands that ask queries of a mesh.

They write the same documents as the service. Each option is a parameter, as typer reads them.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.arguments import (
    NO_MERGE,
    AbsoluteError,
    Barriers,
    BoundedMethod,
    BoundedMethodOption,
    EffortOption,
    FormatOption,
    MaxDistance,
    MergeOption,
    MeshFile,
    Method,
    MethodOption,
    PointOrCurveSource,
    PointOrCurveSources,
    PointOrLabelSources,
    RelativeError,
    Source,
    Targets,
    accuracy,
    limits,
    writable,
)
from app.cli.ask import WrittenMembers, ask
from app.cli.output import AsJson, Output
from app.cli.points import Point, Position
from app.cli.steps import Failure, MeshInput
from app.cli.summary import bound_in_words, print_bound, print_end, print_seconds, print_size

if TYPE_CHECKING:
    from collections.abc import Mapping

    from app.encoding import Answer

LINES = ".obj", ".csv", ".json"
"""Suffixes of files that hold lines."""

PointsOut = Annotated[
    Path | None,
    typer.Option(
        help="Where the points go, too: .csv or .json; - prints .csv.",
        callback=writable(".csv", ".json"),
    ),
]
LinesOut = Annotated[
    Path | None,
    typer.Option(
        help="Where the lines go: .obj (polylines), .csv or .json; - prints .csv.",
        callback=writable(*LINES),
    ),
]
ChordError = Annotated[
    float | None,
    typer.Option(help="How far lines may deviate from the exact ones inside faces, in mesh units."),
]


def distance(
    mesh_file: MeshFile,
    source: PointOrLabelSources,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the distances go: .npy, .csv, .json or .ply (the mesh, coloured); - "
            "prints .csv.",
            callback=writable(".npy", ".csv", ".json", ".ply"),
        ),
    ] = None,
    gradient: Annotated[
        bool,
        typer.Option(
            "--gradient",
            help="Also the direction in which distance grows, at each vertex; in .npy as three "
            "more columns.",
        ),
    ] = False,
    max_distance: MaxDistance = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Compute the distance of every vertex from the nearest source."""
    output = Output(out, as_json)
    members = accuracy(method, relative_error, absolute_error, effort)
    members["include"] = ["nearest_source", *(["gradient"] if gradient else [])]
    members |= limits(max_distance, barriers)
    points: WrittenMembers = {"sources": source}
    answered = ask(
        "distances",
        MeshInput(mesh_file, file_format, merge),
        "Computing distances",
        points,
        members,
    )
    import numpy as np

    found = answered.answer.members
    distances = found["distances"]
    columns = None
    if gradient and out is not None and out.suffix.lower() == ".npy":
        columns = _array(np.column_stack([distances, found["gradient"]]))
    output.write(answered.answer, in_file=columns)
    reached = np.isfinite(distances)
    print_size(output, answered.mesh)
    output.say(f"reached     {np.count_nonzero(reached)} of {len(reached)} vertices")
    if reached.any():
        farthest = int(np.argmax(np.where(reached, distances, -1.0)))
        output.say(f"farthest    vertex {farthest} at {float(distances[farthest])!r}")
    print_bound(output, found["error_bound"])
    print_end(output, answered)


def path(
    mesh_file: MeshFile,
    source: Source,
    target: Annotated[
        Point,
        typer.Option(parser=Point.parse, metavar="POINT", help="The point to go to."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the path goes: .obj (a polyline), .csv or .json; its "
            "points alone to .npy. - prints .csv.",
            callback=writable(*LINES, ".npy"),
        ),
    ] = None,
    via: Annotated[
        list[Point] | None,
        typer.Option(
            parser=Point.parse,
            metavar="POINT",
            help="A point to pass on the way; may be repeated, in order.",
        ),
    ] = None,
    max_distance: MaxDistance = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Compute a shortest path over the surface between two points."""
    output = Output(out, as_json)
    members = accuracy(method, relative_error, absolute_error, effort)
    if method is not Method.EXACT and via:
        raise typer.BadParameter("--via goes with --method exact only")
    members |= limits(max_distance, barriers)
    points: WrittenMembers = {"source": source, "target": target, "waypoints": via or []}
    answered = ask(
        "path", MeshInput(mesh_file, file_format, merge), "Computing the path", points, members
    )
    found = answered.answer.members
    if found["status"] != "ok":
        raise Failure(_NO_PATH[found["reason"]].format(limit=max_distance))
    output.write(answered.answer)
    print_size(output, answered.mesh)
    output.say(f"length      {found['length']!r}")
    output.say(f"points      {len(found['points'])}")
    print_bound(output, found["error_bound"])
    print_seconds(output, answered)
    output.say_written()


def steps(
    mesh_file: MeshFile,
    source: Source,
    target: Annotated[
        Point,
        typer.Option(parser=Point.parse, metavar="POINT", help="The point to go to."),
    ],
    via: Annotated[
        list[Point] | None,
        typer.Option(
            parser=Point.parse,
            metavar="POINT",
            help="A point to pass on the way; may be repeated, in order.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Where the steps go: .json.", callback=writable(".json")),
    ] = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Tell what the search for a path does, step by step."""
    output = Output(out, as_json)
    points: WrittenMembers = {"source": source, "target": target, "waypoints": via or []}
    answered = ask(
        "steps",
        MeshInput(mesh_file, file_format, merge),
        "Searching",
        points,
        limits(max_distance, barriers),
    )
    output.write(answered.answer)
    print_size(output, answered.mesh)
    for step in answered.answer.members["steps"]:
        output.say(
            f"leg {step['leg']}, {step['name']:12} bound {step['bound']!r}, "
            f"{step['windows']} windows, {len(step['faces'])} faces"
        )
    print_end(output, answered)


def paths(
    mesh_file: MeshFile,
    source: PointOrCurveSource,
    target: Targets,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the paths go: .obj (a polyline each), .csv or .json; - prints .csv.",
            callback=writable(*LINES),
        ),
    ] = None,
    max_distance: MaxDistance = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Compute shortest paths from one point to several others, in one sweep."""
    output = Output(out, as_json)
    members = accuracy(method, relative_error, absolute_error, effort)
    members |= limits(max_distance, barriers)
    points: WrittenMembers = {"source": source, "targets": target}
    answered = ask(
        "paths", MeshInput(mesh_file, file_format, merge), "Computing the paths", points, members
    )
    output.write(answered.answer)
    print_size(output, answered.mesh)
    for written, path in zip(target, answered.answer.members["paths"], strict=True):
        if path["status"] == "ok":
            bound = bound_in_words(path["error_bound"])
            output.say(f"path        to {written.text}: {path['length']!r}, error bound {bound}")
        else:
            output.say(f"no path     to {written.text}: {path['reason']}")
    print_end(output, answered)


def isolines(
    mesh_file: MeshFile,
    source: PointOrLabelSources,
    out: LinesOut = None,
    level: Annotated[
        list[float] | None,
        typer.Option(help="A distance at which to draw lines; may be repeated."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(min=1, help="In place of --level: the number of evenly spaced levels."),
    ] = None,
    chord_error: ChordError = None,
    max_distance: MaxDistance = None,
    method: BoundedMethodOption = BoundedMethod.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Draw lines of equal distance from the nearest source."""
    output = Output(out, as_json)
    members = accuracy(method, relative_error, absolute_error)
    if (count is None) == (level is None):
        raise typer.BadParameter("give --count, or --level at least once, and not both")
    members |= {"levels": level, "count": count, "chord_error": chord_error}
    members |= limits(max_distance, barriers)
    points: WrittenMembers = {"sources": source}
    answered = ask(
        "isolines", MeshInput(mesh_file, file_format, merge), "Drawing isolines", points, members
    )
    output.write(answered.answer)
    print_size(output, answered.mesh)
    for each in answered.answer.members["isolines"]:
        lines = each["lines"]
        closed = sum(line["closed"] for line in lines)
        length = sum(line["length"] for line in lines)
        output.say(
            f"level       {each['level']!r}: {closed} closed, {len(lines) - closed} open, "
            f"{float(length)!r} long"
        )
    print_bound(output, answered.answer.members["error_bound"])
    print_end(output, answered)


def borders(
    mesh_file: MeshFile,
    source: PointOrCurveSources,
    out: LinesOut = None,
    chord_error: ChordError = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Draw the borders between the parts of the surface that are nearest to each source."""
    output = Output(out, as_json)
    members = {"chord_error": chord_error} | limits(max_distance, barriers)
    points: WrittenMembers = {"sources": source}
    answered = ask(
        "borders", MeshInput(mesh_file, file_format, merge), "Drawing borders", points, members
    )
    output.write(answered.answer)
    print_size(output, answered.mesh)
    for line in answered.answer.members["borders"]:
        first, second = line["sources"]
        kind = "closed" if line["closed"] else "open"
        output.say(
            f"border      of sources {first} and {second}: {kind}, {float(line['length'])!r} long"
        )
    print_end(output, answered)


def nearest(
    mesh_file: MeshFile,
    source: Source,
    candidate: Annotated[
        list[Point],
        typer.Option(parser=Point.parse, metavar="POINT", help="A candidate; may be repeated."),
    ],
    k: Annotated[int, typer.Option("-k", min=1, help="How many to find.")] = 1,
    out: PointsOut = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Find the candidates that are nearest to a point along the surface."""
    output = Output(out, as_json)
    if k > len(candidate):
        raise typer.BadParameter(f"-k is {k}, but there are only {len(candidate)} candidates")
    members = {"k": k} | limits(max_distance, barriers)
    points: WrittenMembers = {"source": source, "candidates": candidate}
    answered = ask(
        "nearest",
        MeshInput(mesh_file, file_format, merge),
        "Looking for the nearest",
        points,
        members,
    )
    found = answered.answer.members["nearest"]
    output.write(answered.answer)
    print_size(output, answered.mesh)
    output.say(f"found       {len(found)} of {k}")
    for each in found:
        output.say(f"nearest     {candidate[each['candidate']].text} at {each['distance']!r}")
    print_end(output, answered)


def locate(
    mesh_file: MeshFile,
    at: Annotated[
        Position,
        typer.Option(parser=Position.parse, metavar="X,Y,Z", help="The position, mesh units."),
    ],
    out: PointsOut = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Find the point of the surface that is nearest to a position."""
    output = Output(out, as_json)
    answered = ask(
        "locate",
        MeshInput(mesh_file, file_format, merge),
        "Looking for the point",
        {"points": [at]},
        {},
    )
    (point,) = answered.answer.members["points"]
    output.write(answered.answer)
    output.say(f"point       {_as_option(point)}")
    output.say(f"position    {','.join(map(repr, point['position']))}")
    output.say(f"distance    {point['distance']!r}")
    output.say_written()


_NO_PATH = {
    "disconnected": "there is no path: the points are in different connected components",
    "beyond_max_distance": "there is no path within --max-distance {limit:g}",
}


def _array(array: Any) -> "Answer":
    from app.encoding import Answer

    return Answer({"array": array}, ("array",))


def _as_option(point: "Mapping[str, Any]") -> str:
    """Return a described point in the spelling of options."""
    if "vertex" in point:
        return f"v{point['vertex']}"
    return f"f{point['face']}:{','.join(map(repr, point['barycentric']))}"
