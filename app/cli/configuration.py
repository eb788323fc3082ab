"""Settings of commands: environment variables, and options that go before them."""

from typing import TYPE_CHECKING, Any

import typer

from app.cli.words import words_of

if TYPE_CHECKING:
    from app.settings import Settings


def read_settings(**options: Any) -> "Settings":
    """Return the settings; options that are None count as not given."""
    from pydantic import ValidationError

    from app.settings import Settings, variable_of

    given = {name: value for name, value in options.items() if value is not None}
    try:
        return Settings(**given)
    except ValidationError as error:
        faults = [
            ": ".join([*(variable_of(str(name)) for name in fault["loc"][:1]), words_of(fault)])
            for fault in error.errors()
            if fault["type"] != "default_factory_not_called"  # for another fault's sake
        ]
        raise typer.BadParameter("; ".join(faults)) from error
