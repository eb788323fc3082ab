"""Commands that write tables of distances."""

from collections.abc import Mapping
from hashlib import file_digest
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

import typer

from app.cli import files, local_matrix, remote_matrix
from app.cli.arguments import (
    NO_MERGE,
    AbsoluteError,
    Barriers,
    EffortOption,
    FormatOption,
    Layout,
    MaxDistance,
    MergeOption,
    MeshFile,
    MethodOption,
    Number,
    RelativeError,
    SomeSources,
    SomeTargets,
    accuracy,
    limits,
    writable,
)
from app.cli.ask import Answered, WrittenMembers, ask, check
from app.cli.matrix_file import MatrixToWrite, as_members, print_written, write_facts
from app.cli.output import AsJson, Output
from app.cli.point_file import points_of
from app.cli.points import Point
from app.cli.steps import MeshInput, read
from app.cli.summary import print_bound, print_end, print_size
from app.cli.words import say_warning

_OF_ANY_SIZE = (".npy", ".zarr", ".npz", ".parquet")
_BY_SERVICES = (".npy", ".npz")
_FILE = "POINTS"


def _web_address(text: str | None) -> str | None:
    """Check the address of a service before any work begins."""
    if text is not None and not _is_web_address(text):
        raise typer.BadParameter(
            f"{text!r} is not the address of a service: write it as http://HOST:PORT"
        )
    return text


def _is_web_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        return parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:  # of the port, say
        return False


MatrixOut = Annotated[
    Path | None,
    typer.Option(
        help="Where the distances go: .npy, .csv or .json; - prints .csv. For a sparse matrix: "
        ".npz, .csv or .json. For points from files: .npy or .zarr, or .npz or .parquet for the "
        "finite distances only.",
        callback=writable(".npy", ".npz", ".csv", ".json", ".zarr", ".parquet"),
    ),
]
PointsFile = Annotated[
    Path | None,
    typer.Option(
        metavar=_FILE,
        help="A file with one point per line, or 'all' for every vertex; computes the distances "
        "between all of them. A stopped command continues where it was when run again.",
    ),
]
SourcesFile = Annotated[
    Path | None,
    typer.Option(metavar=_FILE, help="In place of --points: a file of sources, with --targets."),
]
TargetsFile = Annotated[
    Path | None,
    typer.Option(metavar=_FILE, help="In place of --points: a file of targets, with --sources."),
]
LayoutOption = Annotated[
    Layout,
    typer.Option(
        "--layout",
        help="'dense': from each source to each target; 'sparse': the finite distances only; "
        "'pairs': from each source to the target of the same number.",
    ),
]
NumberOption = Annotated[
    Number, typer.Option("--dtype", help="Type of the distances, for points from files.")
]
Threads = Annotated[
    int | None,
    typer.Option(min=1, help="Largest number of threads; by default one for each core."),
]
Service = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        callback=_web_address,
        help="Let this service compute the matrix, on all its machines: for points from files, to "
        "a .npy or .npz file. GEODESIC_SERVICE_KEY holds the API key.",
    ),
]


def matrix(
    mesh_file: MeshFile,
    out: MatrixOut = None,
    source: SomeSources = None,
    target: SomeTargets = None,
    points: PointsFile = None,
    sources: SourcesFile = None,
    targets: TargetsFile = None,
    layout: LayoutOption = "dense",
    method: MethodOption = "exact",
    relative_error: RelativeError = None,
    absolute_error: AbsoluteError = None,
    effort: EffortOption = None,
    dtype: NumberOption = "float64",
    threads: Threads = None,
    service: Service = None,
    max_distance: MaxDistance = None,
    barriers: Barriers = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Compute distances from several points to several others, or between all points of a file."""
    options = accuracy(method, relative_error, absolute_error, effort)
    source, target = source or [], target or []
    named = {"--points": points, "--sources": sources, "--targets": targets}
    given = {name: file for name, file in named.items() if file is not None}
    mesh_input = MeshInput(mesh_file, file_format, merge)
    if not given:
        _check_points(source, target, dtype, threads, service)
        members = options | {"layout": layout} | limits(max_distance, barriers)
        _ask_matrix(mesh_input, Output(out, as_json), source, target, layout, members)
        return
    _check_files(list(given), source, target, layout)
    out = _checked_file(out, next(iter(given)), service, threads)
    check("matrix", sources="all", targets="all", max_distance=max_distance, **options)
    opened, read_seconds = read(mesh_input)
    output = Output(None, as_json)
    for warning in opened.warnings:
        say_warning(warning)
    blocked = () if barriers is None else barriers.of(opened.mesh)
    mesh = opened.mesh.with_barriers(blocked)
    starts, *stops = (points_of(mesh, file) for file in given.values())
    wanted = MatrixToWrite(
        out,
        mesh,
        starts,
        stops[0] if stops else None,
        options,
        max_distance,
        blocked,
        dtype,
    )
    with files.writing(out):
        if service is None:
            written = local_matrix.write_matrix(wanted, threads)
        else:
            written = remote_matrix.write_matrix(wanted, service)
    print_written(output, wanted, written, read_seconds)


def _check_points(
    source: list[Point],
    target: list[Point],
    dtype: Number,
    threads: int | None,
    service: str | None,
) -> None:
    """Refuse options that do not go together where no points are from files."""
    if not source or not target:
        raise typer.BadParameter("give --source and --target, or --points with a file")
    if dtype != "float64" or threads or service:
        raise typer.BadParameter("--dtype, --threads and --service apply only to points from files")


def _check_files(
    named: list[str], source: list[Point], target: list[Point], layout: Layout
) -> None:
    """Refuse options that do not go together where points are from the files of some options."""
    if named not in (["--points"], ["--sources", "--targets"]):
        raise typer.BadParameter("give --points, or both --sources and --targets")
    if source or target or layout != "dense":
        raise typer.BadParameter(f"--source, --target and --layout do not go with {named[0]}")


def _checked_file(out: Path | None, named: str, service: str | None, threads: int | None) -> Path:
    """Return the file of a matrix of any size, where it can be written as the options say."""
    if out is None:
        raise typer.BadParameter(f"{named} needs --out, a file for the matrix")
    if out.suffix.lower() not in _OF_ANY_SIZE:
        raise typer.BadParameter(f"{out} must end in .npy, .zarr, .npz or .parquet")
    if service is not None and out.suffix.lower() not in _BY_SERVICES:
        raise typer.BadParameter("--service writes .npy and .npz files only")
    if service is not None and threads is not None:
        raise typer.BadParameter("--threads does not go with --service, which has its own")
    return out


def _ask_matrix(
    mesh: MeshInput,
    output: Output,
    source: list[Point],
    target: list[Point],
    layout: Layout,
    members: Mapping[str, Any],
) -> None:
    """Ask for a matrix as the service would be asked."""
    wanted = (".npz" if layout == "sparse" else ".npy", ".csv", ".json", "")
    suffix = "" if output.out is None else output.out.suffix.lower()
    if suffix not in wanted:
        raise typer.BadParameter(f"{suffix} does not go with --layout {layout}")
    if layout == "pairs" and len(source) != len(target):
        raise typer.BadParameter(
            f"there are {len(source)} sources and {len(target)} targets; pairs need the same "
            "number of both"
        )
    points: WrittenMembers = {"sources": source, "targets": target}
    answered = ask("matrix", mesh, "Computing the matrix", points, members)
    import numpy as np

    output.write(answered.answer)
    if output.out is not None and suffix in (".npy", ".npz"):
        with files.writing(output.out):
            _write_facts(output.out, answered, source, target, members)
    reached = np.count_nonzero(np.isfinite(answered.answer.members["distances"]))
    cells = len(source) if layout == "pairs" else len(source) * len(target)
    print_size(output, answered.mesh)
    output.say(f"reached     {reached} of {cells} distances")
    print_bound(output, answered.answer.members["error_bound"])
    print_end(output, answered)


def _write_facts(
    out: Path,
    answered: Answered,
    source: list[Point],
    target: list[Point],
    members: Mapping[str, Any],
) -> None:
    """Write beside a matrix of arrays, which has no room for it, what its rows and columns are."""
    from app.queries.points import resolve_point

    mesh = answered.mesh
    sides = {"sources": source, "targets": target}
    with out.open("rb") as file:
        checksum = file_digest(file, "sha256").hexdigest()
    points = {
        side: as_members([resolve_point(mesh, each.point) for each in given])
        for side, given in sides.items()
    }
    facts = {
        "mesh": mesh.digest,
        **members,
        "barriers": mesh.barriers.tolist(),
        **points,
        "shape": [len(source)] if members["layout"] == "pairs" else [len(source), len(target)],
        "error_bound": answered.answer.members["error_bound"],
        "dtype": "float64",
        "units": "mesh units",
        "sha256": checksum,
    }
    write_facts(out, facts)
