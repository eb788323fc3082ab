"""The command that asks the same questions of many meshes, several at a time."""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from app.cli.arguments import (
    NO_MERGE,
    STANDARD_STREAM,
    EffortOption,
    FormatOption,
    MaxDistance,
    MergeOption,
    MethodOption,
    RelativeError,
    SomeTargets,
    Sources,
    accuracy,
    writable,
)
from app.cli.ask import check
from app.cli.batch_rows import Questions, Row, ask
from app.cli.batch_table import csv_of, write_table
from app.cli.output import AsJson, Output, print_json, print_parts
from app.cli.parcels import answers_of
from app.cli.steps import showing

_FAILED = 1


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
    method: MethodOption = "exact",
    relative_error: RelativeError = None,
    effort: EffortOption = None,
    max_distance: MaxDistance = None,
    processes: Annotated[
        int | None,
        typer.Option(
            min=1, help="How many meshes to work on at a time; by default one for each core."
        ),
    ] = None,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Answer the same queries for many meshes; a mesh that fails does not stop the others.

    The table has a row for each mesh and source, with the largest and the mean distance of the
    vertices in reach. With targets it has a row for each target, with its distance. The exit code
    is 1 if any mesh failed.
    """
    output = Output(out, as_json)
    if out is None and not as_json:
        raise typer.BadParameter("give --out with a file, or --json")
    options = accuracy(method, relative_error, None, effort) | {"max_distance": max_distance}
    check("distances", sources=[0], **options)
    questions = Questions(source, target or [], options, merge.value, file_format)
    from app.settings import available_cores

    meshes = list(dict.fromkeys(meshes))  # once each, as patterns of a shell may overlap
    count = min(processes or available_cores(), len(meshes))
    start = perf_counter()
    rows = _rows_of(meshes, questions, count)
    seconds = perf_counter() - start
    ordered = [row for mesh in meshes for row in rows[mesh]]
    if as_json:
        print_json([asdict(row) for row in ordered])
    if out == STANDARD_STREAM:
        print_parts([csv_of(ordered)])
    elif out is not None:
        write_table(out, ordered)
    failed = {row.mesh: row.error for row in ordered if row.error is not None}
    output.say(f"meshes      {len(meshes)}, {len(failed)} of them failed")
    output.say(f"rows        {len(ordered)}")
    output.say(f"took        {seconds:.3f} s, {count} processes")
    output.say_written()
    for row in ordered:
        if row.warning is not None:
            typer.echo(f"{row.mesh}: warning: {row.warning}", err=True)
    for name, error in failed.items():
        typer.echo(f"{name}: {error}", err=True)
    if failed:
        raise typer.Exit(_FAILED)


def _rows_of(meshes: Sequence[Path], questions: Questions, processes: int) -> dict[Path, list[Row]]:
    """Return the rows of each mesh."""
    with showing("Loading kernels (compiled on the first run)"):
        from geodesic_core import compile_kernels

        compile_kernels(["exact", "paths"])
    rows: dict[Path, list[Row]] = {}
    with showing(f"Solving {len(meshes)} meshes") as step:
        for mesh, answer in answers_of(partial(ask, questions), meshes, processes, step.check):
            died = Row(str(mesh), error="the process died, perhaps for lack of memory")
            rows[mesh] = [died] if answer is None else answer
            step.progress(len(rows) / len(meshes))
    return rows
