"""The ``geodesic`` command: its subcommands, its messages and its exit codes."""

import sys
from typing import Annotated

import typer
from typer.exceptions import TyperException

from app import __version__
from app.cli import batch, compilation, documents, meshes, queries, serve, tables
from app.cli.cortex import cortex
from app.cli.steps import Failure, show_help_without_command
from app.cli.store import store
from app.cli.terrain import terrain
from app.cli.words import refusal_of, with_options

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
        code = _say_error(f"{_in_words(error)} (geodesic --help tells more)", error.exit_code)
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


def _in_words(error: TyperException) -> str:
    """Return what is wrong with a command line, where typer quotes pydantic."""
    from pydantic import ValidationError

    is_of_option = getattr(error, "param", None) is not None
    if is_of_option and isinstance(error.__cause__, ValidationError):
        error.message = refusal_of(error.__cause__.errors(include_url=False)[0])
    return error.format_message()


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


for function in (serve.serve, meshes.info, meshes.sample, tables.matrix, batch.batch):
    cli.command()(function)
for name, command in queries.COMMANDS.items():
    cli.command(name)(queries.function_of(command))
cli.command("compile")(compilation.compile_kernels)
cli.command()(documents.docs)
cli.add_typer(cortex, name="cortex")
cli.add_typer(store, name="store")
cli.add_typer(terrain, name="terrain")
