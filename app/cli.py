"""The ``geodesic`` command: serve, and the library's answers as files.

What is slow to import (the kernels, the server) is imported by the command that needs it.
"""

# ruff: noqa: PLC0415
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import IO, TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from typer.exceptions import TyperException

from app import __version__

if TYPE_CHECKING:
    from geodesic_core import DistanceField, ErrorBound, GeodesicPath, SurfacePoint, TriangleMesh

FAILED, INTERRUPTED = 1, 130
"""Exit codes: the work failed, Ctrl-C; typer's own for a wrong command line is 2."""

_USUAL_ERROR = 1e-3
"""The relative error of approximate answers, where none is named."""

_DRAIN_S = 20
"""Granted to requests that run when the server is told to stop."""

cli = typer.Typer(
    help="Geodesic distances and shortest paths on triangle meshes, exact or within an error.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


class _Failure(Exception):  # noqa: N818 - not an error of this program
    """A one-line message for the user, who can do something about it."""


def main() -> None:
    """Run the command line: every foreseeable failure is one line on standard error."""
    try:
        code = cli(standalone_mode=False)
    except TyperException as error:
        code = _say_error(f"{error.format_message()} (geodesic --help tells more)", error.exit_code)
    except Exception as error:
        from geodesic_core.errors import GeodesicError, InternalError

        if not isinstance(error, GeodesicError | _Failure) or isinstance(error, InternalError):
            raise
        code = _say_error(str(error), FAILED)
    if code == INTERRUPTED:
        _say_error("interrupted", code)
    sys.exit(code)


def _say_error(message: str, code: int) -> int:
    typer.echo("error: " + " ".join(message.split()), err=True)
    return code


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"geodesic {__version__}")
        raise typer.Exit


@cli.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass


# Arguments that several commands share ------------------------------------------------------------


class _Merge(StrEnum):
    NONE = "none"
    EXACT = "exact"


class _Method(StrEnum):
    EXACT = "exact"
    APPROXIMATE = "approximate"


class _SampleName(StrEnum):
    KNOT = "knot"
    SPHERE = "sphere"
    PLANE = "plane"


class _Point(NamedTuple):
    """A point of the mesh, as it was written."""

    text: str
    point: Any

    @classmethod
    def parse(cls, text: str) -> "_Point":
        from app.point_text import parse

        try:
            return cls(text, parse(f"v{text}" if _INDEX.fullmatch(text) else text))
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None


_INDEX = re.compile(r"-?[0-9]+")


def _position(text: str) -> _Point:
    try:
        return _Point(text, _Point.parse(f"p{text}").point)
    except typer.BadParameter:
        raise typer.BadParameter(f"{text!r} is not a position: write it as x,y,z") from None


def _writable(*suffixes: str) -> Callable[[Path], Path]:
    """Return a check of an output path, made before any work begins."""

    def check(path: Path) -> Path:
        if path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path} must end in {' or '.join(suffixes)}")
        if not path.absolute().parent.is_dir():
            raise typer.BadParameter(f"the folder of {path} does not exist")
        return path

    return check


_SPELLINGS = "as 12 (a vertex), e12-13:0.3 (edge), f7:0.2,0.3,0.5 (face) or p1,2,3 (position)"

_MeshFile = Annotated[
    Path, typer.Argument(metavar="MESH", help="An OBJ, OFF, PLY, STL or GLB file.")
]
_MergeOption = Annotated[
    _Merge, typer.Option("--merge", help="'exact' joins vertices at equal positions.")
]
_MethodOption = Annotated[
    _Method, typer.Option("--method", help="'approximate' is faster, within the error asked for.")
]
_RelativeError = Annotated[
    float | None,
    typer.Option(
        help="For approximate: the error granted, as a share of the distance; "
        f"{_USUAL_ERROR} where no error is named."
    ),
]
_AbsoluteError = Annotated[
    float | None,
    typer.Option(help="For approximate: the same in mesh units; with both, both hold."),
]


def _granted(
    method: _Method, relative_error: float | None, absolute_error: float | None
) -> tuple[float | None, float | None] | None:
    """Return the relative and the absolute error to solve with; None where the method is exact."""
    is_named = relative_error is not None or absolute_error is not None
    if method is _Method.APPROXIMATE:
        return (relative_error, absolute_error) if is_named else (_USUAL_ERROR, None)
    if is_named:
        name = "--absolute-error" if relative_error is None else "--relative-error"
        raise typer.BadParameter(f"{name} goes with --method approximate only")
    return None


# Commands -----------------------------------------------------------------------------------------


@cli.command()
def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.")] = 8000,
) -> None:
    """Serve geodesics over HTTP until interrupted; settings are GEODESIC_… variables."""
    import uvicorn
    from pydantic import ValidationError

    from app.main import create_app
    from app.settings import Settings, variable_of

    try:
        settings = Settings()
    except ValidationError as error:
        faults = [
            f"{variable_of(str(fault['loc'][0]))}: {fault['msg']}" if fault["loc"] else fault["msg"]
            for fault in error.errors()
        ]
        raise typer.BadParameter("; ".join(faults)) from error
    uvicorn.run(create_app(settings), host=host, port=port, timeout_graceful_shutdown=_DRAIN_S)


@cli.command()
def info(mesh_file: _MeshFile, merge: _MergeOption = _Merge.NONE) -> None:
    """Check a mesh and tell what is in it."""
    mesh, seconds = _read(mesh_file, merge)
    for name, value in mesh.report.as_dict().items():
        typer.echo(f"{name.replace('_', ' '):26}{_in_words(value)}")
    typer.echo(f"{'read in':26}{seconds:.3f} s")
    for warning in mesh.warnings:
        typer.echo(f"warning: {warning}")


@cli.command()
def distance(
    mesh_file: _MeshFile,
    source: Annotated[
        list[_Point],
        typer.Option(
            parser=_Point.parse,
            metavar="POINT",
            help=f"A source, {_SPELLINGS}; may be given again.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="Where the distances go: .npy, .csv or .json.",
            callback=_writable(".npy", ".csv", ".json"),
        ),
    ],
    max_distance: Annotated[
        float | None, typer.Option(help="Go no farther than this, in mesh units.")
    ] = None,
    method: _MethodOption = _Method.EXACT,
    relative_error: _RelativeError = None,
    absolute_error: _AbsoluteError = None,
    merge: _MergeOption = _Merge.NONE,
) -> None:
    """Compute the distance of every vertex from the nearest source."""
    granted = _granted(method, relative_error, absolute_error)
    mesh, seconds = _read(mesh_file, merge)
    import numpy as np

    from geodesic_core import approximate_distance, exact_distance

    sources = [_found(mesh, "--source", written) for written in source]
    with _step("Computing distances") as step:
        if granted is None:
            field = exact_distance(mesh, sources, max_distance, **step._asdict())
        else:
            field = approximate_distance(mesh, sources, *granted, max_distance, **step._asdict())
    _write(out, _DISTANCE_WRITERS[out.suffix.lower()], field)
    reached = np.isfinite(field.distances)
    farthest = int(np.argmax(np.where(reached, field.distances, -1.0)))
    typer.echo(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")
    typer.echo(f"reached     {np.count_nonzero(reached)} of {len(reached)} vertices")
    typer.echo(f"farthest    vertex {farthest} at {float(field.distances[farthest])!r}")
    typer.echo(f"error bound {_bound_in_words(field.error_bound)}")
    typer.echo(f"took        {seconds:.3f} s to read, {field.stats.seconds:.3f} s to solve")
    typer.echo(f"written     {out}")


@cli.command()
def path(
    mesh_file: _MeshFile,
    source: Annotated[
        _Point,
        typer.Option(
            parser=_Point.parse, metavar="POINT", help=f"The point to start from, {_SPELLINGS}."
        ),
    ],
    target: Annotated[
        _Point,
        typer.Option(parser=_Point.parse, metavar="POINT", help="The point to go to."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="Where the path goes: .obj (a polyline) or .json.",
            callback=_writable(".obj", ".json"),
        ),
    ],
    via: Annotated[
        list[_Point] | None,
        typer.Option(
            parser=_Point.parse,
            metavar="POINT",
            help="A point to pass on the way; may be given again, in order.",
        ),
    ] = None,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Tell what each step of the search did; exact paths only."),
    ] = False,
    method: _MethodOption = _Method.EXACT,
    relative_error: _RelativeError = None,
    absolute_error: _AbsoluteError = None,
    merge: _MergeOption = _Merge.NONE,
) -> None:
    """Compute a shortest path over the surface between two points."""
    granted = _granted(method, relative_error, absolute_error)
    if granted is not None and (via or explain):
        name = "--via" if via else "--explain"
        raise typer.BadParameter(f"{name} goes with --method exact only")
    mesh, seconds = _read(mesh_file, merge)
    from geodesic_core import approximate_distance, shortest_path

    first, last = _found(mesh, "--source", source), _found(mesh, "--target", target)
    between = [_found(mesh, "--via", written) for written in via or ()]
    with _step("Computing the path") as step:
        start = perf_counter()
        if granted is None:
            found = shortest_path(mesh, first, last, between, explain=explain, **step._asdict())
        else:
            field = approximate_distance(
                mesh, first, *granted, targets=[last], keep_windows=True, **step._asdict()
            )
            found = field.path_to(last)
        solved = perf_counter() - start
    _write(out, _PATH_WRITERS[out.suffix.lower()], found)
    typer.echo(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")
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


@cli.command()
def locate(
    mesh_file: _MeshFile,
    at: Annotated[
        _Point, typer.Option(parser=_position, metavar="X,Y,Z", help="The position, mesh units.")
    ],
    merge: _MergeOption = _Merge.NONE,
) -> None:
    """Find the point of the surface that is nearest to a position."""
    mesh, _ = _read(mesh_file, merge)
    import numpy as np

    with _step("Looking for the point"):
        place = _found(mesh, "--at", at)
    position = mesh.position(place)
    away = float(np.linalg.norm(position - at.point.position))
    typer.echo(f"point       {_written(place)}")
    typer.echo(f"position    {','.join(map(repr, position.tolist()))}")
    typer.echo(f"distance    {away!r}")


@cli.command()
def sample(
    name: Annotated[_SampleName, typer.Argument(help="Which one.")],
    out: Annotated[
        Path,
        typer.Argument(metavar="OUT.ply", callback=_writable(".ply"), help="Where it goes."),
    ],
    faces: Annotated[int, typer.Option(help="About how many faces.")] = 20_000,
) -> None:
    """Make a mesh to try things on."""
    from geodesic_core.samples import SAMPLES

    vertices, triangles = SAMPLES[name](faces)
    _write(out, _write_ply, (vertices, triangles))
    typer.echo(f"mesh        {len(vertices)} vertices, {len(triangles)} faces")
    typer.echo(f"written     {out}")


# Steps --------------------------------------------------------------------------------------------


def _read(mesh_file: Path, merge: _Merge) -> "tuple[TriangleMesh, float]":
    """Return the mesh of a file, and the seconds that took once the kernels were there."""
    with _step("Loading kernels (compiled on the first run)"):
        from geodesic_core import load_mesh, warm_up

        warm_up()
    with _step(f"Reading {mesh_file.name}"):
        start = perf_counter()
        mesh = load_mesh(mesh_file, merge=merge.value)
        seconds = perf_counter() - start
    return mesh, seconds


def _found(mesh: "TriangleMesh", option: str, written: _Point) -> "SurfacePoint":
    """Return the point of the mesh that an option names."""
    from app.points import resolve
    from geodesic_core.errors import InvalidPoint

    try:
        return resolve(mesh, written.point)
    except InvalidPoint as error:
        raise _Failure(f"{option} {written.text}: {error}") from None


class _Step(NamedTuple):
    """How a step reports its progress, and learns that Ctrl-C was pressed."""

    progress: Callable[[float], None]
    cancel: Callable[[], bool]


@contextmanager
def _step(label: str) -> Iterator[_Step]:
    """Show a bar on standard error, where that is a terminal, until the step is over.

    Ctrl-C ends the step at its next look-up: a KeyboardInterrupt that is raised in the midst of
    importing or of calling compiled code gets lost there, or becomes a SystemError. Pressed again,
    it works as usual.
    """
    from rich.console import Console
    from rich.progress import Progress

    pressed = False

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        signal.signal(signal.SIGINT, usual)

    usual = signal.signal(signal.SIGINT, note)
    console = Console(stderr=True)
    try:
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task(label, total=None)
            yield _Step(
                progress=lambda share: progress.update(task, total=1.0, completed=share),
                cancel=lambda: pressed,
            )
    except Exception:
        if not pressed:
            raise  # else it is what the step made of being cancelled
    finally:
        signal.signal(signal.SIGINT, usual)
    if pressed:
        raise KeyboardInterrupt


def _in_words(value: Any) -> str:
    match value:
        case {"count": 0}:
            return "0"
        case {"count": count, "ids": ids}:
            shown = ", ".join(map(str, ids))
            return f"{count} ({shown}{', …' if count > len(ids) else ''})"
        case bool():
            return "yes" if value else "no"
        case ((*low,), (*high,)):
            return " to ".join("(" + ", ".join(map(repr, end)) + ")" for end in (low, high))
        case _:
            return repr(value)


def _written(place: "SurfacePoint") -> str:
    """Return a point as options take it."""
    if place.vertex_index is not None:
        return f"v{place.vertex_index}"
    return f"f{place.face_index}:{','.join(map(repr, place.barycentric))}"


def _bound_in_words(bound: "ErrorBound") -> str:
    return f"{bound.value!r} ({bound.type}, {bound.kind})"


# Files --------------------------------------------------------------------------------------------


def _write(path: Path, write: Callable[[IO[bytes], Any], None], what: Any) -> None:
    """Write a file as a whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("wb") as file:
            write(file, what)
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, OSError):
            raise _Failure(f"cannot write {path}: {error.strerror}") from error
        raise


def _distances_to_npy(file: IO[bytes], field: "DistanceField") -> None:
    import numpy as np

    np.save(file, field.distances)


def _distances_to_csv(file: IO[bytes], field: "DistanceField") -> None:
    file.write(b"vertex,distance,nearest_source\n")
    columns = zip(field.distances.tolist(), field.nearest_source.tolist(), strict=True)
    for vertex, (value, nearest) in enumerate(columns):
        file.write(b"%d,%a,%d\n" % (vertex, value, nearest))


def _distances_to_json(file: IO[bytes], field: "DistanceField") -> None:
    from app.points import described

    _dump_json(
        file,
        {
            "sources": [
                described(field.mesh, field.mesh.point(source.point)) for source in field.sources
            ],
            "distances": field.distances,  # infinity becomes null
            "nearest_source": field.nearest_source,
            "error_bound": field.error_bound,
            "stats": field.stats.as_dict(),
        },
    )


def _path_to_obj(file: IO[bytes], path: "GeodesicPath") -> None:
    for x, y, z in path.points.tolist():
        file.write(b"v %a %a %a\n" % (x, y, z))
    count = len(path.points)
    element = b"l " if count > 1 else b"p "
    file.write(element + b" ".join(b"%d" % i for i in range(1, count + 1)) + b"\n")


def _path_to_json(file: IO[bytes], path: "GeodesicPath") -> None:
    locations = [{"face": p.face_index, "barycentric": p.barycentric} for p in path.locations]
    _dump_json(
        file,
        {
            "length": path.length,
            "points": path.points,
            "locations": locations,
            "faces": path.faces,
            "error_bound": path.error_bound,
            "steps": path.steps,
        },
    )


def _dump_json(file: IO[bytes], value: dict[str, Any]) -> None:
    import orjson

    file.write(orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE))


def _write_ply(file: IO[bytes], mesh: tuple[Any, Any]) -> None:
    import numpy as np

    vertices, faces = mesh
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    file.write(
        b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n"
        b"property double x\nproperty double y\nproperty double z\n"
        b"element face %d\nproperty list uchar int vertex_indices\nend_header\n"
        % (len(vertices), len(faces))
    )
    file.write(vertices.astype("<f8").tobytes())
    file.write(rows.tobytes())


_DISTANCE_WRITERS: dict[str, Callable[[IO[bytes], Any], None]] = {
    ".npy": _distances_to_npy,
    ".csv": _distances_to_csv,
    ".json": _distances_to_json,
}
_PATH_WRITERS: dict[str, Callable[[IO[bytes], Any], None]] = {
    ".obj": _path_to_obj,
    ".json": _path_to_json,
}
