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
    path: Annotated[
        bool, typer.Option("--path", help="Print where they are, and open nothing.")
    ] = False,
) -> None:
    """Open the documents in a browser; they need no network."""
    indices = (place / "index.html" for place in PLACES)
    index = next(filter(Path.is_file, indices), None)
    if index is None:
        raise Failure("this installation has no documents; in a checkout, scripts/docs builds them")
    typer.echo(index)
    if not path and not webbrowser.open(index.as_uri()):
        raise Failure("no browser can be opened here; open the file above in one")
