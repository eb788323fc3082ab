"""Commands that check a mesh, or make one."""

from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli import files
from app.cli.arguments import (
    NO_MERGE,
    STANDARD_STREAM,
    FormatOption,
    MergeOption,
    MeshFile,
    SampleName,
    writable,
)
from app.cli.output import AsJson, Output, print_json, print_parts
from app.cli.steps import MeshInput, read
from app.cli.summary import print_size
from app.cli.words import with_options


def info(
    mesh_file: MeshFile,
    file_format: FormatOption = None,
    merge: MergeOption = NO_MERGE,
    as_json: AsJson = False,
) -> None:
    """Check a mesh, and print a report."""
    opened, seconds = read(MeshInput(mesh_file, file_format, merge))
    mesh = opened.mesh
    warnings = [with_options(warning) for warning in mesh.warnings]
    if as_json:
        print_json({**mesh.report.as_dict(), "warnings": warnings, "read_s": seconds})
        return
    for name, value in mesh.report.as_dict().items():
        typer.echo(f"{name.replace('_', ' '):26}{_in_words(value)}")
    typer.echo(f"{'read in':26}{seconds:.3f} s")
    for warning in warnings:
        typer.echo(f"warning: {warning}")


def sample(
    name: Annotated[SampleName, typer.Argument(help="Name of the sample.")],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT.ply",
            callback=writable(".ply"),
            help="The file to write; - for standard output.",
        ),
    ],
    faces: Annotated[int, typer.Option(help="About how many faces.")] = 20_000,
    as_json: AsJson = False,
) -> None:
    """Make a sample mesh."""
    output = Output(out, as_json)
    import geodesic_core as gc
    from app.encoding import Surface
    from app.encoding.ply_mesh import ply_of

    mesh = gc.samples.SAMPLES[name](faces)
    parts = ply_of(Surface(mesh.vertices, mesh.faces))
    if out == STANDARD_STREAM:
        print_parts(parts)
    else:
        files.write_file(out, parts)
    if as_json:
        sizes = {"vertices": len(mesh.vertices), "faces": len(mesh.faces)}
        print_json({**sizes, "written": str(out)})
        return
    print_size(output, mesh)
    output.say_written()


def _in_words(value: Any) -> str:
    match value:
        case {"count": 0}:
            return "0"
        case {"count": count, "ids": ids}:
            shown = ", ".join(map(str, ids))
            return f"{count} ({shown}{', …' if count > len(ids) else ''})"
        case bool():
            return "yes" if value else "no"
        case None:
            return "none"
        case ((*low,), (*high,)):
            return " to ".join("(" + ", ".join(map(repr, end)) + ")" for end in (low, high))
        case _:
            return repr(value)
