"""Commands that write tables of distances."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import remote_matrix
from app.cli.arguments import (
    AbsoluteError,
    Barriers,
    BlockedFaces,
    EffortOption,
    Layout,
    MaxDistance,
    Merge,
    MergeOption,
    MeshFile,
    Method,
    MethodOption,
    Number,
    Point,
    RelativeError,
    SomeSources,
    SomeTargets,
    accuracy,
    writable,
)
from app.cli.ask import WrittenMembers, ask
from app.cli.output import AsJson, Output, print_json
from app.cli.steps import Failure, read, showing
from app.cli.summary import print_bound, print_end, print_size

if TYPE_CHECKING:
    from typing import Literal

    from geodesic_client import StoredMatrix

    from geodesic_core import SurfacePoint, TriangleMesh

    Everywhere = Literal["all"]

_OF_ANY_SIZE = (".npy", ".zarr", ".npz", ".parquet")
_BY_SERVICES = (".npy", ".npz")
_FILE = "POINTS"


def matrix(
    mesh_file: MeshFile,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the distances go: .npy, .csv or .json; - prints .csv. For a sparse matrix: "
            ".npz, .csv or .json. For points from files: .npy or .zarr, or .npz or .parquet for "
            "the finite distances only.",
            callback=writable(".npy", ".npz", ".csv", ".json", ".zarr", ".parquet"),
        ),
    ] = None,
    source: SomeSources = None,
    target: SomeTargets = None,
    points: Annotated[
        Path | None,
        typer.Option(
            metavar=_FILE,
            help="A file with one point per line, or 'all' for every vertex; computes the "
            "distances between all of them. A stopped command continues where it was when run "
            "again.",
        ),
    ] = None,
    sources: Annotated[
        Path | None,
        typer.Option(
            metavar=_FILE, help="In place of --points: a file of sources, with --targets."
        ),
    ] = None,
    targets: Annotated[
        Path | None,
        typer.Option(
            metavar=_FILE, help="In place of --points: a file of targets, with --sources."
        ),
    ] = None,
    layout: Annotated[
        Layout,
        typer.Option(
            help="'dense': from each source to each target; 'sparse': the finite distances only; "
            "'pairs': from each source to the target of the same number."
        ),
    ] = Layout.DENSE,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    dtype: Annotated[
        Number, typer.Option(help="Type of the distances, for points from files.")
    ] = Number.FLOAT64,
    threads: Annotated[
        int | None,
        typer.Option(min=1, help="Largest number of threads; by default one for each core."),
    ] = None,
    service: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Let this service compute the matrix, on all its machines: for points from "
            "files, to a .npy or .npz file. GEODESIC_SERVICE_KEY holds the API key.",
        ),
    ] = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    merge: MergeOption = Merge.NONE,
    as_json: AsJson = False,
) -> None:
    """Compute distances from several points to several others, or between all points of a file."""
    options = accuracy(method, relative_error, absolute_error, effort)
    by_files = {"--points": points, "--sources": sources, "--targets": targets}
    given = [name for name, value in by_files.items() if value is not None]
    if not given:
        if not source or not target:
            raise typer.BadParameter("give --source and --target, or --points with a file")
        if dtype is not Number.FLOAT64 or threads or service:
            raise typer.BadParameter(
                "--dtype, --threads and --service apply only to points from files"
            )
        members = options | {
            "layout": layout.value,
            "max_distance": max_distance,
            "barriers": barriers or BlockedFaces(),
        }
        _ask_matrix(mesh_file, Output(out, as_json), source, target, layout, members, merge)
        return
    if given not in (["--points"], ["--sources", "--targets"]):
        raise typer.BadParameter("give --points, or both --sources and --targets")
    if source or target or layout is not Layout.DENSE:
        raise typer.BadParameter(f"--source, --target and --layout do not go with {given[0]}")
    if out is None:
        raise typer.BadParameter(f"{given[0]} needs --out, a file for the matrix")
    if out.suffix.lower() not in _OF_ANY_SIZE:
        raise typer.BadParameter(f"{out} must end in .npy, .zarr, .npz or .parquet")
    if service is not None and out.suffix.lower() not in _BY_SERVICES:
        raise typer.BadParameter("--service writes .npy and .npz files only")
    if service is not None and threads is not None:
        raise typer.BadParameter("--threads does not go with --service, which has its own")
    opened, read_seconds = read(mesh_file, merge)
    import geodesic_core as gc

    mesh, output = opened.mesh, Output(None, as_json)
    starts = _points_of(mesh, points or sources)
    stops = None if targets is None else _points_of(mesh, targets)
    if service is not None:
        _print_remote(
            output,
            mesh,
            remote_matrix.write_matrix(
                service,
                mesh,
                out,
                starts,
                starts if stops is None else stops,
                accuracy=options,
                max_distance=max_distance,
                barriers=() if barriers is None else barriers.of(mesh),
                dtype=dtype.value,
            ),
            out,
        )
        return
    if absolute_error is not None:
        options.setdefault("relative_error", None)
    with showing("Computing the matrix") as step:
        written = gc.write_matrix(
            mesh,
            out,
            starts,
            stops,
            **options,
            dtype=dtype.value,
            max_distance=max_distance,
            barriers=() if barriers is None else barriers.of(mesh),
            threads=threads,
            progress=step.progress,
            cancel=step.cancel,
        )
    rows = min(written.shape)
    bound = written.error_bound
    if as_json:
        facts = {"shape": written.shape, "error_bound": asdict(bound), "sha256": written.sha256}
        print_json({**facts, "continued": rows - written.swept, "written": str(out)})
    print_size(output, mesh)
    output.say(f"matrix      {written.shape[0]} by {written.shape[1]}")
    if written.swept < rows:
        output.say(f"continued   {rows - written.swept} of {rows} sweeps were done before")
    output.say(f"error bound {bound.value!r} ({bound.type}, {bound.kind})")
    output.say(f"sha256      {written.sha256}")
    output.say(f"took        {read_seconds:.3f} s to read")
    output.say(f"written     {out}")


def _print_remote(
    output: Output, mesh: "TriangleMesh", written: "tuple[StoredMatrix, str]", out: Path
) -> None:
    matrix, checksum = written
    bound = matrix.error_bound
    if output.as_json:
        facts = {"shape": matrix.shape, "error_bound": asdict(bound), "sha256": checksum}
        print_json({**facts, "written": str(out)})
    print_size(output, mesh)
    output.say(f"matrix      {matrix.shape[0]} by {matrix.shape[1]}")
    output.say(f"error bound {bound.value!r} ({bound.type}, {bound.kind})")
    output.say(f"sha256      {checksum}")
    output.say(f"written     {out}")


def _points_of(mesh: "TriangleMesh", file: Path | None) -> "list[SurfacePoint] | Everywhere":
    """Return the points of a file, one a line; those of all vertices for the name ``all``."""
    if file is None or str(file) == "all":
        return "all"
    from app.queries.points import resolve_point
    from geodesic_core.errors import InvalidPoint

    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise Failure(f"cannot read {file}: {getattr(error, 'strerror', None) or error}") from None
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


def _ask_matrix(
    mesh_file: Path,
    output: Output,
    source: list[Point],
    target: list[Point],
    layout: Layout,
    members: Mapping[str, Any],
    merge: Merge,
) -> None:
    """Ask for a matrix as the service would be asked."""
    wanted = (".npz" if layout is Layout.SPARSE else ".npy", ".csv", ".json", "")
    suffix = "" if output.out is None else output.out.suffix.lower()
    if suffix not in wanted:
        raise typer.BadParameter(f"{suffix} does not go with --layout {layout.value}")
    if layout is Layout.PAIRS and len(source) != len(target):
        raise typer.BadParameter(
            f"there are {len(source)} sources and {len(target)} targets; pairs need the same "
            "number of both"
        )
    points: WrittenMembers = {"sources": source, "targets": target}
    answered = ask("matrix", mesh_file, merge, "Computing the matrix", points, members)
    import numpy as np

    output.write(answered.answer)
    reached = np.count_nonzero(np.isfinite(answered.answer.members["distances"]))
    cells = len(source) if layout is Layout.PAIRS else len(source) * len(target)
    print_size(output, answered.mesh)
    output.say(f"reached     {reached} of {cells} distances")
    print_bound(output, answered.answer.members["error_bound"])
    print_end(output, answered)
