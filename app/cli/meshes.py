"""Commands about a mesh itself."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import files
from app.cli.arguments import Merge, MergeOption, MeshFile, Point, SampleName, position, writable
from app.cli.steps import point_of, read, showing

if TYPE_CHECKING:
    from geodesic_core import SurfacePoint


def info(mesh_file: MeshFile, merge: MergeOption = Merge.NONE) -> None:
    """Check a mesh and tell what is in it."""
    mesh, seconds = read(mesh_file, merge)
    for name, value in mesh.report.as_dict().items():
        typer.echo(f"{name.replace('_', ' '):26}{_in_words(value)}")
    typer.echo(f"{'read in':26}{seconds:.3f} s")
    for warning in mesh.warnings:
        typer.echo(f"warning: {warning}")


def locate(
    mesh_file: MeshFile,
    at: Annotated[
        Point, typer.Option(parser=position, metavar="X,Y,Z", help="The position, mesh units.")
    ],
    merge: MergeOption = Merge.NONE,
) -> None:
    """Find the point of the surface that is nearest to a position."""
    mesh, _ = read(mesh_file, merge)
    import numpy as np

    with showing("Looking for the point"):
        place = point_of(mesh, "--at", at)
    position = mesh.position(place)
    away = float(np.linalg.norm(position - at.point.position))
    typer.echo(f"point       {_written(place)}")
    typer.echo(f"position    {','.join(map(repr, position.tolist()))}")
    typer.echo(f"distance    {away!r}")


def sample(
    name: Annotated[SampleName, typer.Argument(help="Which one.")],
    out: Annotated[
        Path,
        typer.Argument(metavar="OUT.ply", callback=writable(".ply"), help="Where it goes."),
    ],
    faces: Annotated[int, typer.Option(help="About how many faces.")] = 20_000,
) -> None:
    """Make a mesh to try things on."""
    import geodesic_core as gc
    from app.encoding import Surface
    from app.encoding.ply_mesh import ply_of

    vertices, triangles = gc.samples.SAMPLES[name](faces)
    files.write_file(out, ply_of(Surface(vertices, triangles)))
    typer.echo(f"mesh        {len(vertices)} vertices, {len(triangles)} faces")
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


def _written(place: "SurfacePoint") -> str:
    """Return a point as options take it."""
    if place.vertex_index is not None:
        return f"v{place.vertex_index}"
    return f"f{place.face_index}:{','.join(map(repr, place.barycentric))}"
