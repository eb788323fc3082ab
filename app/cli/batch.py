"""The command that asks the same questions of many meshes, several at a time."""

import csv
import json
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from io import StringIO
from itertools import chain
from multiprocessing.synchronize import Barrier
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal, get_args, get_type_hints

import typer

from app.cli import files
from app.cli.arguments import (
    STANDARD_OUTPUT,
    EffortOption,
    MaxDistance,
    Merge,
    MergeOption,
    Method,
    MethodOption,
    Point,
    RelativeError,
    SomeTargets,
    Sources,
    accuracy,
    writable,
)
from app.cli.output import AsJson, Output, print_json, print_parts
from app.cli.steps import showing
from app.cli.words import with_options

_FAILED = 1
_PARCEL_BYTES, _PARCELS = 1 << 22, 8
"""Bytes of the files that a process is handed together, at most, but for a larger one; and parcels
for each process of what is left, at least. Handed meshes of 2 ms one by one, processes wait for
half of the time"""
_AHEAD = 3
"""Parcels for each process that it is at, or gets next"""


@dataclass(frozen=True)
class Row:
    """A row of the table: a question to a mesh, or a mesh that failed."""

    mesh: str
    vertices: int | None = None
    faces: int | None = None
    source: str | None = None
    target: str | None = None
    """None where the row is of all vertices"""
    distance: float | None = None
    """From source to target, mesh units; None where there is no path"""
    farthest: float | None = None
    """Largest distance of a vertex from the source, mesh units"""
    mean: float | None = None
    """Mean distance of the vertices"""
    unreachable: int | None = None
    """Vertices that were not reached"""
    error_bound: str | None = None
    read_s: float | None = None
    """Seconds of reading the mesh"""
    solve_s: float | None = None
    error: str | None = None
    """Why the mesh, or the question, has no answer"""


@dataclass(frozen=True)
class Questions:
    """The questions to each mesh."""

    sources: Sequence[Point]
    targets: Sequence[Point]
    options: dict[str, Any]
    """Of the solver, its method among them"""
    merge: Literal["none", "exact"]


def batch(
    meshes: Annotated[
        list[Path],
        typer.Argument(
            metavar="MESHES...", help="Mesh files, in the formats that `geodesic info` reads."
        ),
    ],
    source: Sources,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where the table goes: .csv or .parquet; - prints .csv. Not needed with --json.",
            callback=writable(".csv", ".parquet"),
        ),
    ] = None,
    target: SomeTargets = None,
    method: MethodOption = Method.EXACT,
    relative_error: RelativeError = None,
    effort: EffortOption = None,
    max_distance: MaxDistance = None,
    processes: Annotated[
        int | None,
        typer.Option(
            min=1, help="How many meshes to work on at a time; by default one for each core."
        ),
    ] = None,
    merge: MergeOption = Merge.NONE,
    as_json: AsJson = False,
) -> None:
    """Answer the same queries for many meshes; a mesh that fails does not stop the others.

    The table has a row for each mesh and source, with the largest and the mean distance of all
    vertices. With targets it has a row for each target, with its distance. The exit code is 1 if
    any mesh failed.
    """
    output = Output(out, as_json)
    if out is None and not as_json:
        raise typer.BadParameter("give --out with a file, or --json")
    options = accuracy(method, relative_error, None, effort) | {"max_distance": max_distance}
    questions = Questions(source, target or [], options, merge.value)
    from app.engine import fork_server
    from app.settings import available_cores

    count = min(processes or available_cores(), len(meshes))
    rows: dict[Path, list[Row]] = {}
    with showing("Loading kernels (compiled on the first run)"):
        fork_server.start()  # which loads them, if they are compiled
        from geodesic_core import compile_kernels

        compile_kernels(["exact", "paths"])
        pool = _pool(count)
    start, seconds = perf_counter(), 0.0
    with showing(f"Solving {len(meshes)} meshes") as step:
        for mesh, answers in _answers(meshes, questions, count, pool):
            rows[mesh] = answers
            seconds = perf_counter() - start
            step.progress(len(rows) / len(meshes))
            if step.cancel():
                break
    ordered = [row for mesh in meshes for row in rows[mesh]]
    if as_json:
        print_json([asdict(row) for row in ordered])
    if out == STANDARD_OUTPUT:
        print_parts([_csv(ordered)])
    elif out is not None:
        _write(out, ordered)
    failed = {row.mesh: row.error for row in ordered if row.error is not None}
    busy = sum(_seconds(answers) for answers in rows.values()) / (count * seconds)
    output.say(f"meshes      {len(meshes)}, {len(failed)} of them failed")
    output.say(f"rows        {len(ordered)}")
    output.say(f"took        {seconds:.3f} s, {count} processes, busy {busy:.0%} of the time")
    output.say_written()
    for name, error in failed.items():
        typer.echo(f"{name}: {error}", err=True)
    if failed:
        raise typer.Exit(_FAILED)


def _answers(
    meshes: Sequence[Path], questions: Questions, processes: int, pool: ProcessPoolExecutor
) -> Iterator[tuple[Path, list[Row]]]:
    """Yield the rows of each mesh, as they come from a pool, which is shut down.

    A process that dies takes all that run with it: those are asked again, each by itself.
    """
    ask = partial(_ask_each, _QUESTION, questions)
    left, lost = deque(_parcels(meshes, processes)), list[Path]()
    yield from _answers_of_pool(ask, left, lost, processes, pool)
    while left:
        yield from _answers_of_pool(ask, left, lost, processes, _pool(processes))
    for mesh in lost:
        died: list[Path] = []
        yield from _answers_of_pool(ask, deque([[mesh]]), died, 1, _pool(1))
        if died:
            yield mesh, [Row(str(mesh), error="the process died, perhaps for lack of memory")]


def _parcels(meshes: Sequence[Path], processes: int) -> Iterator[list[Path]]:
    """Yield meshes that are handed over together: fewer at the end, so that all end together."""
    sizes = [_size(mesh) for mesh in meshes]
    left = sum(sizes)
    parcel, total = list[Path](), 0
    for mesh, size in zip(meshes, sizes, strict=True):
        if parcel and total + size > min(_PARCEL_BYTES, left // (_PARCELS * processes)):
            yield parcel
            left -= total
            parcel, total = [], 0
        parcel.append(mesh)
        total += size
    yield parcel


def _size(mesh: Path) -> int:
    """Return the bytes of a file, 0 where there is none; who reads it says why."""
    try:
        return mesh.stat().st_size
    except OSError:
        return 0


def _answers_of_pool(
    ask: Callable[[Sequence[Path]], list[list[Row]]],
    left: deque[list[Path]],
    lost: list[Path],
    processes: int,
    pool: ProcessPoolExecutor,
) -> Iterator[tuple[Path, list[Row]]]:
    """Take parcels that are left, and yield the rows of their meshes; stop where a process dies.

    The meshes that were under way then are lost.
    """
    waiting: dict[Future[list[list[Row]]], list[Path]] = {}
    with pool:
        try:
            while left or waiting:
                while left and len(waiting) < _AHEAD * processes:
                    future = pool.submit(ask, left[0])
                    waiting[future] = left.popleft()
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    rows = future.result()
                    yield from zip(waiting.pop(future), rows, strict=True)
        except BrokenProcessPool:
            lost += chain.from_iterable(waiting.values())
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _pool(processes: int) -> ProcessPoolExecutor:
    """Return a pool whose processes are all there, and have loaded the kernels."""
    from app.engine import fork_server

    all_are_there = fork_server.CONTEXT.Barrier(processes)
    pool = ProcessPoolExecutor(processes, fork_server.CONTEXT, _begin, (all_are_there,))
    for begun in [pool.submit(_begun) for _ in range(processes)]:  # each starts one process
        begun.result()
    return pool


def _begin(all_are_there: Barrier) -> None:
    """Load the kernels, unless the fork server has, and wait for the other processes."""
    from geodesic_core import warm_up

    # Ctrl-C is for the command: processes end with the question that they are at.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm_up(["exact", "paths"])
    all_are_there.wait()


def _begun() -> None:
    """Do nothing, in a process that has begun."""


def _ask_each(
    ask: Callable[[Questions, Path], list[Row]], questions: Questions, meshes: Sequence[Path]
) -> list[list[Row]]:
    """Return the rows of each mesh of a parcel."""
    return [ask(questions, mesh) for mesh in meshes]


def _ask(questions: Questions, file: Path) -> list[Row]:
    """Return the rows of a mesh."""
    import geodesic_core as gc

    start = perf_counter()
    try:
        mesh = gc.load_mesh(file, merge=questions.merge)
    except (gc.GeodesicError, OSError) as error:
        return [Row(str(file), error=_line(error))]
    read = Row(str(file), len(mesh.vertices), len(mesh.faces), read_s=perf_counter() - start)
    return [
        row for source in questions.sources for row in _rows_from(questions, source, mesh, read)
    ]


def _rows_from(questions: Questions, source: Point, mesh: Any, read: Row) -> list[Row]:
    """Return the rows of a source."""
    import numpy as np

    import geodesic_core as gc
    from app.queries.points import resolve_point

    solvers: dict[str, Callable[..., gc.DistanceField]] = {
        "exact": gc.exact_distance,
        "approximate": gc.approximate_distance,
        "fast": gc.fast_distance,
    }
    options = dict(questions.options)
    solve = solvers[options.pop("method")]
    read, start = replace(read, source=source.text), perf_counter()
    try:
        targets = [resolve_point(mesh, target.point) for target in questions.targets]
        point = resolve_point(mesh, source.point)
        field = solve(mesh, point, targets=targets, retain="distances", **options)
    except gc.GeodesicError as error:
        return [replace(read, error=_line(error))]
    found = replace(read, error_bound=json.dumps(asdict(field.error_bound)))
    if not targets:
        reached = field.distances[np.isfinite(field.distances)]
        return [
            replace(
                found,
                farthest=float(reached.max()),
                mean=float(reached.mean()),
                unreachable=len(field.distances) - len(reached),
                solve_s=perf_counter() - start,
            )
        ]
    distances = [field.distance_at(target) for target in targets]
    seconds = perf_counter() - start
    return [
        replace(
            found,
            target=target.text,
            distance=distance if np.isfinite(distance) else None,
            solve_s=seconds / len(targets),
        )
        for target, distance in zip(questions.targets, distances, strict=True)
    ]


_QUESTION = _ask
"""What a process is asked for each mesh"""


def _seconds(rows: Sequence[Row]) -> float:
    """Return the seconds that a mesh took."""
    return (rows[0].read_s or 0.0) + sum(row.solve_s or 0.0 for row in rows)


def _line(error: Exception) -> str:
    return with_options(" ".join(str(error).split()))


def _csv(rows: Sequence[Row]) -> bytes:
    text = StringIO(newline="")
    table = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    table.writeheader()
    table.writerows(map(asdict, rows))
    return text.getvalue().encode()


def _write(path: Path, rows: Sequence[Row]) -> None:
    if path.suffix.lower() == ".csv":
        files.write_file(path, [_csv(rows)])
        return
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        from geodesic_core.errors import MissingExtra

        raise MissingExtra("a table in Parquet", "PyArrow", "tables") from error
    types = {float: pa.float64(), int: pa.int64(), str: pa.string()}
    columns = [
        (name, types[(*get_args(kind), kind)[0]]) for name, kind in get_type_hints(Row).items()
    ]
    schema = pa.schema(columns)
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows], schema), sink)
    files.write_file(path, [memoryview(sink.getvalue())])
