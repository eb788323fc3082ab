"""The ``geodesic`` command: its subcommands, its messages and its exit codes."""

import sys
from typing import Annotated

import typer
from typer.exceptions import TyperException

from app import __version__
from app.cli import batch, cluster, cluster_status, compilation, meshes, queries, serve, tables
from app.cli.steps import Failure, show_help_without_command
from app.cli.store import store
from app.cli.words import with_options

FAILED, INTERRUPTED = 1, 130
"""Exit codes: the work failed, Ctrl-C; typer's own for a wrong command line is 2."""

cli = typer.Typer(
    help="Geodesic distances and shortest paths on triangle meshes, exact or within an error.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main() -> None:
    """Run the command line: every foreseeable failure is one line on standard error."""
    try:
        code = cli(prog_name="geodesic", standalone_mode=False)
    except TyperException as error:
        code = _say_error(f"{error.format_message()} (geodesic --help tells more)", error.exit_code)
    except Exception as error:
        from geodesic_core.errors import GeodesicError, InternalError

        if not isinstance(error, GeodesicError | Failure) or isinstance(error, InternalError):
            raise
        code = _say_error(with_options(str(error)), FAILED)
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


@cli.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    show_help_without_command(context)


for command in (
    serve.serve,
    cluster.head,
    cluster.node,
    meshes.info,
    queries.distance,
    queries.path,
    queries.paths,
    queries.isolines,
    queries.borders,
    tables.matrix,
    batch.batch,
    queries.nearest,
    queries.locate,
    meshes.sample,
):
    cli.command()(command)

cli.command("compile")(compilation.compile_kernels)
cli.add_typer(store, name="store")
cli.add_typer(cluster_status.cluster, name="cluster")
