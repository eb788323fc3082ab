"""Commands that answer questions on a mesh."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import answers, files
from app.cli.arguments import (
    AbsoluteError,
    Barriers,
    Layout,
    MaxDistance,
    Merge,
    MergeOption,
    MeshFile,
    Method,
    MethodOption,
    OriginOption,
    Origins,
    Point,
    RelativeError,
    Source,
    Sources,
    Targets,
    granted_errors,
    writable,
)
from app.cli.steps import origin_of, point_of, read, showing

if TYPE_CHECKING:
    from geodesic_core import ErrorBound, GeodesicPath, Retain, TriangleMesh

LINES = ".obj", ".csv", ".svg", ".geojson", ".json"
"""What lines can be written to."""


def distance(
    mesh_file: MeshFile,
    source: Origins,
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
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute the distance of every vertex from the nearest source."""
    granted = granted_errors(method, relative_error, absolute_error)
    mesh, seconds = read(mesh_file, merge, barriers)
    import numpy as np

    from geodesic_core import approximate_distance, exact_distance

    sources = [origin_of(mesh, "--source", written) for written in source]
    with showing("Computing distances") as step:
        retain: Retain = "paths" if gradient else "distances"
        if granted is None:
            field = exact_distance(mesh, sources, max_distance, retain=retain, **step._asdict())
        else:
            field = approximate_distance(
                mesh, sources, *granted, max_distance, retain=retain, **step._asdict()
            )
    if gradient and out.suffix.lower() == ".npy":
        table = np.column_stack([field.distances, field.gradient])
        files.write_answer(out, answers.of_array(table))
    else:
        files.write_answer(out, answers.of_distances(field, gradient=gradient))
    reached = np.isfinite(field.distances)
    farthest = int(np.argmax(np.where(reached, field.distances, -1.0)))
    _tell_size(mesh)
    typer.echo(f"reached     {np.count_nonzero(reached)} of {len(reached)} vertices")
    typer.echo(f"farthest    vertex {farthest} at {float(field.distances[farthest])!r}")
    typer.echo(f"error bound {_bound_in_words(field.error_bound)}")
    typer.echo(f"took        {seconds:.3f} s to read, {field.stats.seconds:.3f} s to solve")
    typer.echo(f"written     {out}")


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
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute a shortest path over the surface between two points."""
    granted = granted_errors(method, relative_error, absolute_error)
    if granted is not None and (via or explain):
        name = "--via" if via else "--explain"
        raise typer.BadParameter(f"{name} goes with --method exact only")
    mesh, seconds = read(mesh_file, merge, barriers)
    from geodesic_core import approximate_distance, shortest_path

    first, last = point_of(mesh, "--source", source), point_of(mesh, "--target", target)
    between = [point_of(mesh, "--via", written) for written in via or ()]
    with showing("Computing the path") as step:
        start = perf_counter()
        if granted is None:
            found = shortest_path(
                mesh, first, last, between, max_distance, explain=explain, **step._asdict()
            )
        else:
            field = approximate_distance(
                mesh, first, *granted, max_distance, [last], retain="paths", **step._asdict()
            )
            found = field.path_to(last)
        solved = perf_counter() - start
    files.write_answer(out, answers.of_path(found))
    _tell_size(mesh)
    typer.echo(f"length      {found.length!r}")
    typer.echo(f"points      {len(found.points)}")
    typer.echo(f"error bound {_bound_in_words(found.error_bound)}")
    typer.echo(f"took        {seconds:.3f} s to read, {solved:.3f} s to solve")
    for part in found.steps or ():
        typer.echo(
            f"leg {part.leg}, {part.name:12} {1e3 * part.seconds:8.2f} ms, bound {part.bound!r}, "
            f"{part.windows} windows, {len(part.faces)} faces"
        )
    typer.echo(f"written     {out}")


def paths(
    mesh_file: MeshFile,
    source: OriginOption,
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
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute shortest paths from one point to several others, in one sweep."""
    granted = granted_errors(method, relative_error, absolute_error)
    mesh, seconds = read(mesh_file, merge, barriers)
    from geodesic_core import approximate_distance, exact_distance
    from geodesic_core.errors import NoPath

    start = origin_of(mesh, "--source", source)
    ends = [point_of(mesh, "--target", written) for written in target]
    found: list[GeodesicPath | NoPath] = []
    with showing("Computing the paths") as step:
        began = perf_counter()
        if granted is None:
            field = exact_distance(mesh, start, max_distance, ends, **step._asdict())
        else:
            field = approximate_distance(
                mesh, start, *granted, max_distance, ends, retain="paths", **step._asdict()
            )
        for end in ends:
            try:
                found.append(field.path_to(end))
            except NoPath as error:
                found.append(error)
        solved = perf_counter() - began
    files.write_answer(out, answers.of_paths(found))
    _tell_size(mesh)
    for written, path in zip(target, found, strict=True):
        if isinstance(path, NoPath):
            typer.echo(f"no path     to {written.text}: {path.reason}")
        else:
            bound = _bound_in_words(path.error_bound)
            typer.echo(f"path        to {written.text}: {path.length!r}, error bound {bound}")
    typer.echo(f"took        {seconds:.3f} s to read, {solved:.3f} s to solve")
    typer.echo(f"written     {out}")


def isolines(
    mesh_file: MeshFile,
    source: Origins,
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
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Draw lines of equal distance from the nearest source."""
    granted = granted_errors(method, relative_error, absolute_error)
    if (count is None) == (level is None):
        raise typer.BadParameter("give --count, or --level at least once, and not both")
    mesh, seconds = read(mesh_file, merge, barriers)
    from geodesic_core import approximate_distance, exact_distance

    sources = [origin_of(mesh, "--source", written) for written in source]
    began = perf_counter()
    with showing("Computing distances") as step:
        options = step._asdict()
        if granted is None:
            field = exact_distance(mesh, sources, max_distance, **options)
        else:
            field = approximate_distance(
                mesh, sources, *granted, max_distance, retain="windows", **options
            )
    levels = level or field.levels(count or 0).tolist()
    with showing("Drawing isolines") as step:
        found = field.isolines(levels, chord_error, **step._asdict())
    solved = perf_counter() - began
    files.write_answer(out, answers.of_isolines(field, levels, found))
    _tell_size(mesh)
    for distance, lines in zip(levels, found, strict=True):
        closed, length = sum(line.closed for line in lines), sum(line.length for line in lines)
        typer.echo(
            f"level       {distance!r}: {closed} closed, {len(lines) - closed} open, "
            f"{float(length)!r} long"
        )
    typer.echo(f"error bound {_bound_in_words(field.error_bound)}")
    typer.echo(f"took        {seconds:.3f} s to read, {solved:.3f} s to solve")
    typer.echo(f"written     {out}")


def matrix(
    mesh_file: MeshFile,
    source: Sources,
    target: Targets,
    out: Annotated[
        Path,
        typer.Option(
            help="Where the distances go: .npy, .csv or .json; of a sparse matrix .npz, .csv or "
            ".json.",
            callback=writable(".npy", ".npz", ".csv", ".json"),
        ),
    ],
    layout: Annotated[
        Layout,
        typer.Option(
            help="'dense': from each source to each target; 'sparse': what can be reached; "
            "'pairs': from each source to the target of the same number."
        ),
    ] = Layout.DENSE,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Compute the distances from several points to several others."""
    is_sparse = layout is Layout.SPARSE
    other = ".npy" if is_sparse else ".npz"
    if out.suffix.lower() == other:
        raise typer.BadParameter(f"{other} does not go with --layout {layout.value}")
    if layout is Layout.PAIRS and len(source) != len(target):
        raise typer.BadParameter(
            f"there are {len(source)} sources and {len(target)} targets; pairs need as many"
        )
    mesh, seconds = read(mesh_file, merge, barriers)
    import numpy as np

    from geodesic_core import distance_matrix

    starts = [point_of(mesh, "--source", written) for written in source]
    ends = [point_of(mesh, "--target", written) for written in target]
    with showing("Computing the matrix") as step:
        began = perf_counter()
        found = distance_matrix(mesh, starts, ends, max_distance, layout.value, **step._asdict())
        solved = perf_counter() - began
    files.write_answer(out, answers.of_matrix(found))
    values = found.data if is_sparse else found
    cells = len(source) if layout is Layout.PAIRS else len(source) * len(target)
    _tell_size(mesh)
    typer.echo(f"reached     {np.count_nonzero(np.isfinite(values))} of {cells} distances")
    typer.echo(f"took        {seconds:.3f} s to read, {solved:.3f} s to solve")
    typer.echo(f"written     {out}")


def nearest(
    mesh_file: MeshFile,
    source: Source,
    candidate: Annotated[
        list[Point],
        typer.Option(parser=Point.parse, metavar="POINT", help="A candidate; may be given again."),
    ],
    k: Annotated[int, typer.Option("-k", min=1, help="How many to find.")] = 1,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
) -> None:
    """Find the candidates that are nearest to a point along the surface."""
    if k > len(candidate):
        raise typer.BadParameter(f"-k is {k}, but there are only {len(candidate)} candidates")
    mesh, seconds = read(mesh_file, merge, barriers)
    from geodesic_core import nearest

    start = point_of(mesh, "--source", source)
    places = [point_of(mesh, "--candidate", written) for written in candidate]
    with showing("Looking for the nearest") as step:
        began = perf_counter()
        found = nearest(mesh, start, places, k, max_distance, **step._asdict())
        solved = perf_counter() - began
    _tell_size(mesh)
    typer.echo(f"found       {len(found.indices)} of {k}")
    for i, away in zip(found.indices.tolist(), found.distances.tolist(), strict=True):
        typer.echo(f"nearest     {candidate[i].text} at {away!r}")
    typer.echo(f"took        {seconds:.3f} s to read, {solved:.3f} s to solve")


def _tell_size(mesh: "TriangleMesh") -> None:
    typer.echo(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")


def _bound_in_words(bound: "ErrorBound") -> str:
    return f"{bound.value!r} ({bound.type}, {bound.kind})"
