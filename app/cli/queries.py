"""Commands that ask queries of a mesh.

They write the same documents as the service. Each option is a parameter, as typer reads them.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import files
from app.cli.arguments import (
    AbsoluteError,
    Barriers,
    BoundedMethod,
    BoundedMethodOption,
    EffortOption,
    MaxDistance,
    Merge,
    MergeOption,
    MeshFile,
    Method,
    MethodOption,
    Point,
    PointOrCurveSource,
    PointOrCurveSources,
    Position,
    RelativeError,
    Source,
    Targets,
    accuracy,
    writable,
)
from app.cli.ask import Answered, WrittenMembers, ask
from app.cli.steps import Failure

if TYPE_CHECKING:
    from collections.abc import Mapping

    from app.encoding import Answer
    from geodesic_core import TriangleMesh

LINES = ".obj", ".csv", ".svg", ".geojson", ".json"
"""Suffixes of files that hold lines."""

PointsOut = Annotated[
    Path | None,
    typer.Option(
        help="Where the points go as well: .csv, .geojson or .json.",
        callback=writable(".csv", ".geojson", ".json"),
    ),
]


def distance(
    mesh_file: MeshFile,
    source: PointOrCurveSources,
    out: Annotated[
        Path,
        typer.Option(
            help="Where the distances go: .npy, .csv, .json or .ply (the mesh, coloured).",
            callback=writable(".npy", ".csv", ".json", ".ply"),
        ),
    ],
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
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute the distance of every vertex from the nearest source."""
    members = accuracy(method, relative_error, absolute_error, effort)
    members["include"] = ["nearest_source", *(["gradient"] if gradient else [])]
    members |= {"max_distance": max_distance, "barriers": barriers or []}
    points: WrittenMembers = {"sources": source}
    answered = ask("distances", mesh_file, merge, "Computing distances", points, members)
    import numpy as np

    found = answered.answer.members
    distances = found["distances"]
    if gradient and out.suffix.lower() == ".npy":
        files.write_answer(out, _array(np.column_stack([distances, found["gradient"]])))
    else:
        files.write_answer(out, answered.answer)
    reached = np.isfinite(distances)
    farthest = int(np.argmax(np.where(reached, distances, -1.0)))
    print_size(answered.mesh)
    typer.echo(f"reached     {np.count_nonzero(reached)} of {len(reached)} vertices")
    typer.echo(f"farthest    vertex {farthest} at {float(distances[farthest])!r}")
    typer.echo(f"error bound {_bound_in_words(found['error_bound'])}")
    print_end(answered, out)


def path(
    mesh_file: MeshFile,
    source: Source,
    target: Annotated[
        Point,
        typer.Option(parser=Point.parse, metavar="POINT", help="The point to go to."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="Where the path goes: .obj (a polyline), .csv, .svg, .geojson or .json; its "
            "points alone to .npy.",
            callback=writable(*LINES, ".npy"),
        ),
    ],
    via: Annotated[
        list[Point] | None,
        typer.Option(
            parser=Point.parse,
            metavar="POINT",
            help="A point to pass on the way; may be given again, in order.",
        ),
    ] = None,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Tell what each step of the search did; exact paths only."),
    ] = False,
    max_distance: MaxDistance = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute a shortest path over the surface between two points."""
    members = accuracy(method, relative_error, absolute_error, effort)
    if method is not Method.EXACT and (via or explain):
        name = "--via" if via else "--explain"
        raise typer.BadParameter(f"{name} goes with --method exact only")
    members |= {"max_distance": max_distance, "explain": explain, "barriers": barriers or []}
    points: WrittenMembers = {"source": source, "target": target, "waypoints": via or []}
    answered = ask("path", mesh_file, merge, "Computing the path", points, members)
    found = answered.answer.members
    if found["status"] != "ok":
        raise Failure(_NO_PATH[found["reason"]].format(limit=max_distance))
    files.write_answer(out, answered.answer)
    print_size(answered.mesh)
    typer.echo(f"length      {found['length']!r}")
    typer.echo(f"points      {len(found['points'])}")
    typer.echo(f"error bound {_bound_in_words(found['error_bound'])}")
    _print_seconds(answered)
    for step in found.get("steps", ()):
        typer.echo(
            f"leg {step.leg}, {step.name:12} {1e3 * step.seconds:8.2f} ms, bound {step.bound!r}, "
            f"{step.windows} windows, {len(step.faces)} faces"
        )
    typer.echo(f"written     {out}")


def paths(
    mesh_file: MeshFile,
    source: PointOrCurveSource,
    target: Targets,
    out: Annotated[
        Path,
        typer.Option(
            help="Where the paths go: .obj (a polyline each), .csv, .svg, .geojson or .json.",
            callback=writable(*LINES),
        ),
    ],
    max_distance: MaxDistance = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute shortest paths from one point to several others, in one sweep."""
    members = accuracy(method, relative_error, absolute_error, effort)
    members |= {"max_distance": max_distance, "barriers": barriers or []}
    points: WrittenMembers = {"source": source, "targets": target}
    answered = ask("paths", mesh_file, merge, "Computing the paths", points, members)
    files.write_answer(out, answered.answer)
    print_size(answered.mesh)
    for written, path in zip(target, answered.answer.members["paths"], strict=True):
        if path["status"] == "ok":
            bound = _bound_in_words(path["error_bound"])
            typer.echo(f"path        to {written.text}: {path['length']!r}, error bound {bound}")
        else:
            typer.echo(f"no path     to {written.text}: {path['reason']}")
    print_end(answered, out)


def isolines(
    mesh_file: MeshFile,
    source: PointOrCurveSources,
    out: Annotated[
        Path,
        typer.Option(
            help="Where the lines go: .obj (polylines), .csv, .svg, .geojson or .json.",
            callback=writable(*LINES),
        ),
    ],
    level: Annotated[
        list[float] | None,
        typer.Option(help="A distance at which to draw lines; may be given again."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(min=1, help="Instead: how many levels to space evenly."),
    ] = None,
    chord_error: Annotated[
        float | None,
        typer.Option(help="How far lines may stray inside faces, in mesh units."),
    ] = None,
    max_distance: MaxDistance = None,
    method: BoundedMethodOption = BoundedMethod.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Draw lines of equal distance from the nearest source."""
    members = accuracy(method, relative_error, absolute_error)
    if (count is None) == (level is None):
        raise typer.BadParameter("give --count, or --level at least once, and not both")
    members |= {"levels": level, "count": count, "chord_error": chord_error}
    members |= {"max_distance": max_distance, "barriers": barriers or []}
    points: WrittenMembers = {"sources": source}
    answered = ask("isolines", mesh_file, merge, "Drawing isolines", points, members)
    files.write_answer(out, answered.answer)
    print_size(answered.mesh)
    for each in answered.answer.members["isolines"]:
        lines = each["lines"]
        closed, length = (
            sum(line["closed"] for line in lines),
            sum(line["length"] for line in lines),
        )
        typer.echo(
            f"level       {each['level']!r}: {closed} closed, {len(lines) - closed} open, "
            f"{float(length)!r} long"
        )
    typer.echo(f"error bound {_bound_in_words(answered.answer.members['error_bound'])}")
    print_end(answered, out)


def nearest(
    mesh_file: MeshFile,
    source: Source,
    candidate: Annotated[
        list[Point],
        typer.Option(parser=Point.parse, metavar="POINT", help="A candidate; may be given again."),
    ],
    k: Annotated[int, typer.Option("-k", min=1, help="How many to find.")] = 1,
    out: PointsOut = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Find the candidates that are nearest to a point along the surface."""
    if k > len(candidate):
        raise typer.BadParameter(f"-k is {k}, but there are only {len(candidate)} candidates")
    members = {"k": k, "max_distance": max_distance, "barriers": barriers or []}
    points: WrittenMembers = {"source": source, "candidates": candidate}
    answered = ask("nearest", mesh_file, merge, "Looking for the nearest", points, members)
    found = answered.answer.members["nearest"]
    if out is not None:
        files.write_answer(out, answered.answer)
    print_size(answered.mesh)
    typer.echo(f"found       {len(found)} of {k}")
    for each in found:
        typer.echo(f"nearest     {candidate[each['candidate']].text} at {each['distance']!r}")
    print_end(answered, out)


def locate(
    mesh_file: MeshFile,
    at: Annotated[
        Position,
        typer.Option(parser=Position.parse, metavar="X,Y,Z", help="The position, mesh units."),
    ],
    out: PointsOut = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Find the point of the surface that is nearest to a position."""
    answered = ask("locate", mesh_file, merge, "Looking for the point", {"points": [at]}, {})
    (point,) = answered.answer.members["points"]
    if out is not None:
        files.write_answer(out, answered.answer)
    typer.echo(f"point       {_as_option(point)}")
    typer.echo(f"position    {','.join(map(repr, point['position']))}")
    typer.echo(f"distance    {point['distance']!r}")
    if out is not None:
        typer.echo(f"written     {out}")


_NO_PATH = {
    "disconnected": "there is no path: the points are in different connected components",
    "beyond_max_distance": "there is no path within max_distance = {limit:g}",
}


def _array(array: Any) -> "Answer":
    from app.encoding import Answer

    return Answer({"array": array}, ("array",))


def print_size(mesh: "TriangleMesh") -> None:
    """Print the size of the mesh."""
    typer.echo(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")


def _print_seconds(answered: Answered) -> None:
    read, solve = answered.read_seconds, answered.solve_seconds
    typer.echo(f"took        {read:.3f} s to read, {solve:.3f} s to solve")


def print_end(answered: Answered, out: Path | None) -> None:
    """Print the seconds that a query took, and where its answer is."""
    _print_seconds(answered)
    if out is not None:
        typer.echo(f"written     {out}")


def _bound_in_words(bound: "Mapping[str, Any]") -> str:
    return f"{bound['value']!r} ({bound['type']}, {bound['kind']})"


def _as_option(point: "Mapping[str, Any]") -> str:
    """Return a described point in the spelling of options."""
    if "vertex" in point:
        return f"v{point['vertex']}"
    return f"f{point['face']}:{','.join(map(repr, point['barycentric']))}"
