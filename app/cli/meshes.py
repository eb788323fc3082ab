"""Commands that check a mesh, or make one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import files
from app.cli.arguments import Merge, MergeOption, MeshFile, SampleName, writable
from app.cli.steps import read

if TYPE_CHECKING:
    pass


def info(mesh_file: MeshFile, merge: MergeOption = Merge.NONE) -> None:
    """Check a mesh, and print a report."""
    opened, seconds = read(mesh_file, merge)
    mesh = opened.mesh
    for name, value in mesh.report.as_dict().items():
        typer.echo(f"{name.replace('_', ' '):26}{_in_words(value)}")
    typer.echo(f"{'read in':26}{seconds:.3f} s")
    for warning in mesh.warnings:
        typer.echo(f"warning: {warning}")


def sample(
    name: Annotated[SampleName, typer.Argument(help="Name of the sample.")],
    out: Annotated[
        Path,
        typer.Argument(metavar="OUT.ply", callback=writable(".ply"), help="The file to write."),
    ],
    faces: Annotated[int, typer.Option(help="About how many faces.")] = 20_000,
) -> None:
    """Make a sample mesh."""
    import geodesic_core as gc
    from app.encoding import Surface
    from app.encoding.ply_mesh import ply_of

    mesh = gc.samples.SAMPLES[name](faces)
    files.write_file(out, ply_of(Surface(mesh.vertices, mesh.faces)))
    typer.echo(f"mesh        {len(mesh.vertices)} vertices, {len(mesh.faces)} faces")
    typer.echo(f"written     {out}")


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
