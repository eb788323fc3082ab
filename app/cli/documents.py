"""``geodesic docs``."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from app.cli.steps import Failure

_APP = Path(__file__).parents[1]
PLACES = (_APP / "site", _APP.parent / "docs" / "_build")
"""Where the documents are: in a wheel that was built with them, and in a checkout."""


def docs(
    chapter: Annotated[
        str, typer.Argument(help="As in index, howto/cortex, or operations#settings.")
    ] = "index",
    path: Annotated[
        bool, typer.Option("--path", help="Print where it is, and open nothing.")
    ] = False,
) -> None:
    """Open the documents in a browser; they need no network."""
    folder = next((place for place in PLACES if (place / "index.html").is_file()), None)
    if folder is None:
        raise Failure("this installation has no documents; scripts/docs in a checkout builds them")
    page, _, heading = chapter.partition("#")
    file = folder / f"{page}.html"
    if not file.is_file():
        raise Failure(f"there is no chapter {page}; index lists all")
    address = file.as_uri() + (f"#{heading}" if heading else "")
    typer.echo(file if path else address)
    if not path and not webbrowser.open(address):
        raise Failure("no browser can be opened here; open this address in one")
