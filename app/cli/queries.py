"""Commands that ask a query of a mesh, made from a table.

They write the same documents as the service. An entry of the table names the options of a command,
and what its summary tells; the rest is the same for all.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.cli.arguments import (
    NO_MERGE,
    SPELLINGS,
    STANDARD_STREAM,
    AbsoluteError,
    Barriers,
    BoundedMethodOption,
    EffortOption,
    FormatOption,
    MaxDistance,
    MergeOption,
    MeshFile,
    MethodOption,
    PointOrCurveSource,
    PointOrCurveSources,
    PointOrLabelSources,
    RelativeError,
    SomePointOrLabelSources,
    Source,
    Targets,
    accuracy,
    limits,
    writable,
)
from app.cli.ask import Answered, ask
from app.cli.barriers import BlockedFaces
from app.cli.files import writing
from app.cli.output import AsJson, Output
from app.cli.points import Curves, Direction, Point, Position
from app.cli.steps import Failure, MeshInput
from app.cli.summary import bound_in_words, print_bound, print_end, print_size
from app.cli.values_file import Values

if TYPE_CHECKING:
    from app.encoding import Answer
    from geodesic_core.arrays import Floats

Given = Mapping[str, Any]
"""The options of a command, by name"""
Options = Mapping[str, tuple[Any, Any]]
"""Annotations and defaults, by name, as typer reads them"""


@dataclass(frozen=True)
class Command:
    """A command that asks a query of a kind."""

    kind: str
    help: str
    label: str
    """What a bar says while the query is answered"""
    options: Options
    points: Mapping[str, str]
    """Members of the request that are points, and the option of each"""
    lines: Callable[[Given, Mapping[str, Any]], Iterator[str]]
    """The lines of the summary, by options and answer"""
    members: Callable[[Given], dict[str, Any]] = lambda _: {}
    """Checks options, and returns further members of the request"""


_NEEDED = Parameter.empty
_MESH: Options = {
    "file_format": (FormatOption, None),
    "merge": (MergeOption, NO_MERGE),
    "as_json": (AsJson, False),
}
_REACH: Options = {"max_distance": (MaxDistance, None), "barriers": (Barriers, None)}
_ERRORS: Options = {
    "relative_error": (RelativeError, None),
    "absolute_error": (AbsoluteError, None),
}
_ACCURACY: Options = {
    "method": (MethodOption, "exact"),
    **_ERRORS,
    "effort": (EffortOption, None),
}
_CHORD_ERROR: Options = {
    "chord_error": (
        Annotated[
            float | None,
            typer.Option(
                help="How far lines may deviate from the exact ones inside faces, in mesh units."
            ),
        ],
        None,
    )
}
_LINES = ".obj", ".csv", ".json"


def _out(what: str, *suffixes: str) -> Options:
    option = typer.Option(
        help=f"Where the {what}", callback=writable(*suffixes, to_stdout=".csv" in suffixes)
    )
    return {"out": (Annotated[Path | None, option], None)}


def _points(help_text: str, *, default: Any = _NEEDED, several: bool = True) -> tuple[Any, Any]:
    option = typer.Option(parser=Point.parse, metavar="POINT", help=help_text)
    kind: Any = list[Point] if several else Point
    return Annotated[kind if default is _NEEDED else kind | None, option], default


_WITH_LOCATIONS: Options = {
    "locations": (
        Annotated[
            bool,
            typer.Option(
                "--locations",
                help="In .json and .csv also faces and weights of the points, as cut takes them.",
            ),
        ],
        False,
    )
}
_ALONG: Options = {
    "along": (
        Annotated[
            list[Curves],
            typer.Option(
                parser=Curves.parse,
                metavar="CURVE|@FILE.json",
                help="A curve: points separated by /, each in one face with the next, as "
                "12/e13-14:0.5/15; or the lines of an answer that was written to a file. May be "
                "repeated.",
            ),
        ],
        _NEEDED,
    )
}
_POINTS_OUT = _out("points go, too: .csv or .json; - prints .csv.", ".csv", ".json")
_LINES_OUT = _out("lines go: .obj (polylines), .csv or .json; - prints .csv.", *_LINES)
_STOPS: Options = {
    "source": (Source, _NEEDED),
    "target": _points("The point to go to.", several=False),
    "via": _points("A point to pass on the way; may be repeated, in order.", default=None),
}
_STOPS_AS_POINTS = {"source": "source", "target": "target", "waypoints": "via"}


# Distance


def _included(given: Given) -> dict[str, Any]:
    included = ["nearest_source", *(["gradient"] if given["gradient"] else [])]
    return {"include": included, "certify": given["certify"]}


def _of_distance(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    import numpy as np

    distances = found["distances"]
    reached = np.isfinite(distances)
    yield f"reached     {np.count_nonzero(reached)} of {len(reached)} vertices"
    if reached.any():
        farthest = int(np.argmax(np.where(reached, distances, -1.0)))
        yield f"farthest    vertex {farthest} at {float(distances[farthest])!r}"
    if "certificate" in found:
        proof = found["certificate"]
        state = "to" if proof["holds"] else "not within its error, but to"
        yield f"proved      {state} {proof['relative_gap']:.2g} of the largest distance"


def _proved(_given: Given) -> dict[str, Any]:
    return {"certify": True}


def _with_columns(answer: "Answer", out: Path | None) -> "Answer | None":
    """Return the distances with their gradients beside them, where a file has room for an array."""
    if "gradient" not in answer.members or out is None or out.suffix.lower() != ".npy":
        return None
    import numpy as np

    from app.encoding import Answer

    columns = np.column_stack([answer.members["distances"], answer.members["gradient"]])
    return Answer({"array": columns}, ("array",))


def _write_metric(path: Path, surface: Path, distances: "Floats") -> None:
    """Write the distances of a hemisphere, whose side the file of its surface tells."""
    from geodesic_core.brain import load_cortex, write_maps

    with writing(path):
        write_maps(path, load_cortex(surface), distances, ["distance"])


# Paths

_NO_PATH = {
    "disconnected": "there is no path: the points are in different connected components",
    "beyond_max_distance": "there is no path within --max-distance {limit:g}",
}


def _without_via(given: Given) -> dict[str, Any]:
    if given["method"] != "exact" and given["via"]:
        raise typer.BadParameter("--via goes with --method exact only")
    return {}


def _of_path(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield f"length      {found['length']!r}"
    yield f"points      {len(found['locations'])}"


def _of_steps(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for step in found["steps"]:
        yield (
            f"leg {step['leg']}, {step['name']:12} bound {step['bound']!r}, "
            f"{step['windows']} windows, {len(step['faces'])} faces"
        )


def _of_paths(given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for written, path in zip(given["target"], found["paths"], strict=True):
        if path["status"] == "ok":
            bound = bound_in_words(path["error_bound"])
            yield f"path        to {written.text}: {path['length']!r}, error bound {bound}"
        else:
            yield f"no path     to {written.text}: {path['reason']}"


# Lines


def _levels(given: Given) -> dict[str, Any]:
    if (given["count"] is None) == (given["level"] is None):
        raise typer.BadParameter("give --count, or --level at least once, and not both")
    values = given["values"]
    if (values is None) == (not given["source"]):
        raise typer.BadParameter("give --source at least once, or --values, and not both")
    levels = {"levels": given["level"], "count": given["count"]}
    return levels if values is None else {**levels, "values": values.given}


def _tightened(given: Given) -> dict[str, Any]:
    return {**_barriers(given), "free_ends": given["free_ends"]}


def _barriers(given: Given) -> dict[str, Any]:
    return {"barriers": given["barriers"] or BlockedFaces()}


def _of_cut(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield f"cut         {found['vertices']} vertices, {found['faces']} faces"
    yield f"parts       {found['parts']}"
    if found["snapped"]["count"]:
        yield f"snapped     {found['snapped']['count']} points, to a vertex or an edge"


def _apart(given: Given) -> dict[str, Any]:
    return {"separate": not given["whole"]}


def _of_isolines(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for each in found["isolines"]:
        lines = each["lines"]
        closed = sum(line["closed"] for line in lines)
        length = sum(line["length"] for line in lines)
        yield (
            f"level       {each['level']!r}: {closed} closed, {len(lines) - closed} open, "
            f"{float(length)!r} long"
        )


def _spread(given: Given) -> dict[str, Any]:
    if given["count"] is None and given["radius"] is None:
        raise typer.BadParameter("give --count or --radius, or both")
    return {name: given[name] for name in ("count", "radius", "iterations")} | _barriers(given)


def _of_samples(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield f"points      {len(found['points'])}"
    yield f"reach       {found['covering_radius']!r}"
    if found["costs"]:
        state = "converged" if found["converged"] else "not converged"
        yield f"cost        {found['costs'][0]!r}, then {found['costs'][-1]!r}: {state}"


def _of_cells(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for i, area in enumerate(found["areas"]):
        yield f"cell        of source {i}: {area!r}"
    yield f"neighbours  {len(found['neighbours'])} pairs"


def _weighted(given: Given) -> dict[str, Any]:
    return {"weights": given["weight"] or None, **_barriers(given)}


def _of_mean(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield from _place(found["mean"])
    state = "converged" if found["converged"] else "not converged"
    yield f"variance    {found['variance']!r}, {state} after {found['moves']} moves"


def _of_loops(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for line in found["lines"]:
        name, count = "loop" if line["closed"] else "curve", len(line["faces"])
        yield f"{name:11} {float(line['length'])!r} long, through {count} faces"
    if not found["lines"]:
        yield "loops       none: the surface has no handle"


def _of_borders(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for line in found["borders"]:
        first, second = line["sources"]
        kind = "closed" if line["closed"] else "open"
        yield f"border      of sources {first} and {second}: {kind}, {float(line['length'])!r} long"


def _of_boundaries(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for line in found["boundaries"]:
        kind = "closed" if line["closed"] else "open"
        count = len(line["vertices"])
        yield f"boundary    {kind}, {count} vertices, {float(line['length'])!r} long"


# Points


def _k(given: Given) -> dict[str, Any]:
    k, count = given["k"], len(given["candidate"])
    if k > count:
        raise typer.BadParameter(f"-k is {k}, but there are only {count} candidates")
    return {"k": k}


def _of_nearest(given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield f"found       {len(found['nearest'])} of {given['k']}"
    for each in found["nearest"]:
        yield f"nearest     {given['candidate'][each['candidate']].text} at {each['distance']!r}"


def _place(point: Mapping[str, Any]) -> Iterator[str]:
    if "vertex" in point:
        yield f"point       v{point['vertex']}"
    else:
        yield f"point       f{point['face']}:{','.join(map(repr, point['barycentric']))}"
    if point["position"] is not None:
        yield f"position    {','.join(map(repr, point['position']))}"


def _of_locate(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    (point,) = found["points"]
    yield from _place(point)
    yield f"distance    {point['distance']!r}"


# Log map and straight lines


def _x_axis(given: Given) -> dict[str, Any]:
    axis = given["x_axis"]
    return {"x_axis": None if axis is None else axis.as_json(), "rescale": not given["true_angles"]}


def _of_log_map(given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    yield from _of_distance(given, found)
    bends = found["bends"].array
    yield f"bent        {(bends > 0).sum()} of {(bends >= 0).sum()} paths"
    yield f"total angle {found['total_angle']!r}"


def _lines(given: Given) -> dict[str, Any]:
    return {
        "lengths": given["length"],
        "at_vertices": given["at_vertices"],
        **_barriers(given),
    }


def _of_trace(_given: Given, found: Mapping[str, Any]) -> Iterator[str]:
    for line in found["lines"].tolist():
        end = line["locations"][-1]
        place = f"f{end['face']}:{','.join(map(repr, end['barycentric']))}"
        yield f"line        {line['length']!r} long, to {place}, stopped by {line['stopped']}"


COMMANDS = {
    "distance": Command(
        "distances",
        "Compute the distance of every vertex from the nearest source.",
        "Computing distances",
        {
            "source": (PointOrLabelSources, _NEEDED),
            **_out(
                "distances go: .npy, .csv, .json, .ply (the mesh, coloured), or .func.gii of a "
                "hemisphere; - prints .csv.",
                *(".npy", ".csv", ".json", ".ply", ".func.gii"),
            ),
            "gradient": (
                Annotated[
                    bool,
                    typer.Option(
                        "--gradient",
                        help="Also the direction in which distance grows, at each vertex; in .npy "
                        "as three more columns.",
                    ),
                ],
                False,
            ),
            "certify": (
                Annotated[
                    bool,
                    typer.Option("--certify", help="Also prove the distances, and print the gap."),
                ],
                False,
            ),
            **_ACCURACY,
            **_REACH,
        },
        {"sources": "source"},
        _of_distance,
        _included,
    ),
    "certify": Command(
        "distances",
        "Prove distances, and write a file that geodesic-verify checks.",
        "Proving distances",
        {
            "source": (PointOrLabelSources, _NEEDED),
            **_out("proof goes: .npz.", ".npz"),
            "method": (BoundedMethodOption, "exact"),
            **_ERRORS,
            **_REACH,
        },
        {"sources": "source"},
        _of_distance,
        _proved,
    ),
    "path": Command(
        "path",
        "Compute a shortest path over the surface between two points.",
        "Computing the path",
        {
            **_STOPS,
            **_out(
                "path goes: .obj (a polyline), .csv or .json; its points alone to .npy. - prints "
                ".csv.",
                *(*_LINES, ".npy"),
            ),
            **_ACCURACY,
            **_REACH,
        },
        _STOPS_AS_POINTS,
        _of_path,
        _without_via,
    ),
    "steps": Command(
        "steps",
        "Tell what the search for a path does, step by step.",
        "Searching",
        {**_STOPS, **_out("steps go: .json.", ".json"), **_REACH},
        _STOPS_AS_POINTS,
        _of_steps,
    ),
    "paths": Command(
        "paths",
        "Compute shortest paths from one point to several others, in one sweep.",
        "Computing the paths",
        {
            "source": (PointOrCurveSource, _NEEDED),
            "target": (Targets, _NEEDED),
            **_out("paths go: .obj (a polyline each), .csv or .json; - prints .csv.", *_LINES),
            **_ACCURACY,
            **_REACH,
        },
        {"source": "source", "targets": "target"},
        _of_paths,
    ),
    "isolines": Command(
        "isolines",
        "Draw lines of equal distance from the nearest source, or of equal values.",
        "Drawing isolines",
        {
            "source": (SomePointOrLabelSources, None),
            "values": (
                Annotated[
                    Values | None,
                    typer.Option(
                        parser=Values.read,
                        metavar="FILE",
                        help="In place of --source: a value for each vertex. A .npy file, or text "
                        "with a number a line, or with a column named value.",
                    ),
                ],
                None,
            ),
            **_LINES_OUT,
            **_WITH_LOCATIONS,
            "level": (
                Annotated[
                    list[float] | None,
                    typer.Option(
                        help="A distance, or a value, at which to draw lines; may be repeated."
                    ),
                ],
                None,
            ),
            "count": (
                Annotated[
                    int | None,
                    typer.Option(
                        min=1, help="In place of --level: the number of evenly spaced levels."
                    ),
                ],
                None,
            ),
            **_CHORD_ERROR,
            "method": (BoundedMethodOption, "exact"),
            **_ERRORS,
            **_REACH,
        },
        {"sources": "source"},
        _of_isolines,
        _levels,
    ),
    "borders": Command(
        "borders",
        "Draw the borders between the parts of the surface that are nearest to each source.",
        "Drawing borders",
        {
            "source": (PointOrCurveSources, _NEEDED),
            **_LINES_OUT,
            **_WITH_LOCATIONS,
            **_CHORD_ERROR,
            **_REACH,
        },
        {"sources": "source"},
        _of_borders,
    ),
    "boundaries": Command(
        "boundaries",
        "Find the boundary of the surface, as lines along its edges.",
        "Following the boundary",
        {**_LINES_OUT, **_WITH_LOCATIONS, "barriers": (Barriers, None)},
        {},
        _of_boundaries,
        _barriers,
    ),
    "farthest": Command(
        "samples",
        "Spread points over the surface, each the farthest from those before.",
        "Spreading points",
        {
            "count": (
                Annotated[int | None, typer.Option(min=1, help="How many, --from included.")],
                None,
            ),
            "radius": (
                Annotated[
                    float | None,
                    typer.Option(min=0.0, help="The covering radius to reach, mesh units."),
                ],
                None,
            ),
            "start": (
                Annotated[
                    list[Point] | None,
                    typer.Option(
                        "--from",
                        parser=Point.parse,
                        metavar="POINT",
                        help=f"A point to begin with, {SPELLINGS}; vertex 0 by default. May be "
                        "repeated.",
                    ),
                ],
                None,
            ),
            "iterations": (
                Annotated[
                    int,
                    typer.Option(
                        min=0, help="How often points then move to the middle of their cells."
                    ),
                ],
                0,
            ),
            **_out(
                "points go, too: .npy (x, y, z, face and weights), .csv or .json; - prints .csv.",
                *(".npy", ".csv", ".json"),
            ),
            "barriers": (Barriers, None),
        },
        {"starts": "start"},
        _of_samples,
        _spread,
    ),
    "cells": Command(
        "cells",
        "Measure the parts of the surface that are nearest to each source.",
        "Cutting cells",
        {
            "source": (PointOrCurveSources, _NEEDED),
            **_POINTS_OUT,
            **_CHORD_ERROR,
            **_REACH,
        },
        {"sources": "source"},
        _of_cells,
    ),
    "mean": Command(
        "mean",
        "Find the mean of points: where squared distances from them sum to the least.",
        "Looking for the mean",
        {
            "at": _points("A point; may be repeated."),
            "weight": (
                Annotated[
                    list[float] | None,
                    typer.Option(min=0.0, help="Its weight; give none, or one for each point."),
                ],
                None,
            ),
            **_out("answer goes: .json.", ".json"),
            "barriers": (Barriers, None),
        },
        {"points": "at"},
        _of_mean,
        _weighted,
    ),
    "loop": Command(
        "loop",
        "Find the shortest loop through a point that cannot be shrunk, or two for each handle.",
        "Looking for loops",
        {
            "through": _points(
                "Where the loop begins and ends; without it, two loops for each handle.",
                default=None,
                several=False,
            ),
            **_LINES_OUT,
            **_WITH_LOCATIONS,
            "barriers": (Barriers, None),
        },
        {"through": "through"},
        _of_loops,
        _barriers,
    ),
    "straighten": Command(
        "loop",
        "Pull curves tight: each becomes the shortest near it, open or closed.",
        "Pulling tight",
        {
            **_ALONG,
            "free_ends": (
                Annotated[
                    bool,
                    typer.Option("--free-ends", help="Let ends on the boundary slide along it."),
                ],
                False,
            ),
            **_LINES_OUT,
            **_WITH_LOCATIONS,
            "barriers": (Barriers, None),
        },
        {"curves": "along"},
        _of_loops,
        _tightened,
    ),
    "cut": Command(
        "cut",
        "Cut the mesh along curves, so that they are edges and the surface comes apart.",
        "Cutting",
        {
            **_ALONG,
            **_out(
                "cut mesh goes: .ply, or .npz with the arrays that lead back to the old one, too; "
                ".json tells its sizes.",
                *(".ply", ".npz", ".json"),
            ),
            "whole": (
                Annotated[
                    bool,
                    typer.Option("--whole", help="Do not let the surface come apart."),
                ],
                False,
            ),
        },
        {"curves": "along"},
        _of_cut,
        _apart,
    ),
    "nearest": Command(
        "nearest",
        "Find the candidates that are nearest to a point along the surface.",
        "Looking for the nearest",
        {
            "source": (Source, _NEEDED),
            "candidate": _points("A candidate; may be repeated."),
            "k": (Annotated[int, typer.Option("-k", min=1, help="How many to find.")], 1),
            **_POINTS_OUT,
            **_REACH,
        },
        {"source": "source", "candidates": "candidate"},
        _of_nearest,
        _k,
    ),
    "log-map": Command(
        "log_map",
        "Compute how far every vertex is from a point, and in which direction.",
        "Computing the log map",
        {
            "source": (Source, _NEEDED),
            **_out(
                "map goes: .npy (distance, angle, two coordinates, bends), .csv, .json or .ply "
                "(the mesh, coloured); - prints .csv.",
                *(".npy", ".csv", ".json", ".ply"),
            ),
            "x_axis": (
                Annotated[
                    Direction | None,
                    typer.Option(
                        parser=Direction.to_look_at,
                        metavar="POINT|X,Y,Z",
                        help="From where angles are measured: a point to look at, or a vector in "
                        "space.",
                    ),
                ],
                None,
            ),
            "true_angles": (
                Annotated[
                    bool,
                    typer.Option(
                        "--true-angles",
                        help="Do not rescale the angles around the source to a full turn.",
                    ),
                ],
                False,
            ),
            **_REACH,
        },
        {"source": "source"},
        _of_log_map,
        _x_axis,
    ),
    "trace": Command(
        "trace",
        "Go straight on over the surface, from points in directions.",
        "Tracing lines",
        {
            "start": (
                Annotated[
                    list[Point],
                    typer.Option(
                        "--from",
                        parser=Point.parse,
                        metavar="POINT",
                        help=f"Where a line starts, {SPELLINGS}; may be repeated, as the next two: "
                        "give one for all lines, or one for each.",
                    ),
                ],
                _NEEDED,
            ),
            "direction": (
                Annotated[
                    list[Direction],
                    typer.Option(
                        parser=Direction.parse,
                        metavar="ANGLE|X,Y,Z",
                        help="Its direction: radians, from where the angles of log-map begin, or a "
                        "vector in space.",
                    ),
                ],
                _NEEDED,
            ),
            "length": (Annotated[list[float], typer.Option(help="Its length.")], _NEEDED),
            **_out(
                "lines go: .obj (polylines), .csv, .json, or .npy (the numbers of .csv); - prints "
                ".csv.",
                *(*_LINES, ".npy"),
            ),
            "at_vertices": (
                Annotated[
                    Literal["straight", "stop"],
                    typer.Option(
                        "--at-vertices",
                        help="'straight': on, with equal angles on both sides; 'stop': no farther.",
                    ),
                ],
                "straight",
            ),
            "barriers": (Barriers, None),
        },
        {"starts": "start", "directions": "direction"},
        _of_trace,
        _lines,
    ),
    "locate": Command(
        "locate",
        "Find the point of the surface that is nearest to a position.",
        "Looking for the point",
        {
            "at": (
                Annotated[
                    Position,
                    typer.Option(
                        parser=Position.parse, metavar="X,Y,Z", help="The position, mesh units."
                    ),
                ],
                _NEEDED,
            ),
            **_POINTS_OUT,
        },
        {"points": "at"},
        _of_locate,
    ),
}
"""The commands, by name"""


def function_of(command: Command) -> Callable[..., None]:
    """Return the function of a command, with the signature that typer reads."""
    options = {"mesh_file": (MeshFile, _NEEDED), **command.options, **_MESH}

    def run(**given: Any) -> None:
        _run(command, given)

    run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
            for name, (annotation, default) in options.items()
        ]
    )
    run.__annotations__ = {name: annotation for name, (annotation, _) in options.items()}
    run.__doc__ = command.help
    return run


def _run(command: Command, given: dict[str, Any]) -> None:
    output = Output(given["out"], given["as_json"])
    members = command.members(given)
    if "method" in given:
        names = [name for name in _ACCURACY if name in given]
        members |= accuracy(**{name: given[name] for name in names})
    if "chord_error" in given:
        members["chord_error"] = given["chord_error"]
    if given.get("locations"):
        members["include"] = ["locations"]
    if "max_distance" in given:
        members |= limits(given["max_distance"], given["barriers"])
    options = command.points.items()
    points = {member: given[option] for member, option in options if given[option] is not None}
    if command.kind == "locate":
        points["points"] = [points["points"]]
    mesh = MeshInput(given["mesh_file"], given["file_format"], given["merge"])
    is_metric = output.out is not None and output.out.suffix.lower() == ".gii"
    if is_metric and mesh.file == STANDARD_STREAM:
        raise Failure(f"standard input does not tell the hemisphere for {output.out}: give a file")
    answered = ask(command.kind, mesh, command.label, points, members)
    found = answered.answer.members
    if found.get("status") == "no_path":
        raise Failure(_NO_PATH[found["reason"]].format(limit=given["max_distance"]))
    if output.out is not None and is_metric:
        _write_metric(output.out, mesh.file, found["distances"])
        Output(None, output.as_json).write(answered.answer)
    else:
        output.write(answered.answer, in_file=_with_columns(answered.answer, output.out))
    _summarize(output, command, given, answered)


def _summarize(output: Output, command: Command, given: Given, answered: Answered) -> None:
    found = answered.answer.members
    if command.kind == "locate":  # which is about a point, and not about the mesh
        for line in command.lines(given, found):
            output.say(line)
        output.say_written()
        return
    print_size(output, answered.mesh)
    for line in command.lines(given, found):
        output.say(line)
    if "error_bound" in found and command.kind != "nearest":  # which is always exact
        print_bound(output, found["error_bound"])
    print_end(output, answered)
