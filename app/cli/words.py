"""Faults in the words of the command line: options, where models and the library have names."""

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import typer

_WORDS = {
    "enum": "it must be {expected}",
    "extra_forbidden": "there is no such setting",
    "finite_number": "it must be a finite number",
    "float_parsing": "it must be a number",
    "greater_than": "it must be above {gt:.16g}",
    "greater_than_equal": "it must be {ge:.16g} or more",
    "int_from_float": "it must be a whole number",
    "int_parsing": "it must be a whole number",
    "int_parsing_size": "it has too many digits",
    "less_than": "it must be below {lt:.16g}",
    "less_than_equal": "it must be {le:.16g} or less",
    "literal_error": "it must be {expected}",
}
"""What is wrong, by the kinds of faults that pydantic finds; other kinds have words of ours."""


def words_of(fault: Mapping[str, Any]) -> str:
    """Return what is wrong with a value that a model refuses."""
    words = _WORDS.get(fault["type"])
    if words is not None:
        return words.format(**fault.get("ctx", {}))
    message: str = fault["msg"]
    return message.removeprefix("Value error, ")


def refusal_of(fault: Mapping[str, Any]) -> str:
    """Return what is wrong with the value of an option, and the value itself."""
    words = words_of(fault)
    return words if fault["type"] not in _WORDS else f"{fault['input']!r}: {words}"


def say_warning(message: str) -> None:
    """Print a warning on standard error."""
    typer.echo(f"warning: {with_options(message)}", err=True)


@contextmanager
def told_warnings() -> Iterator[None]:
    """Print warnings of the library on standard error."""
    with warnings.catch_warnings(record=True, action="always") as told:
        yield
    for warning in told:
        say_warning(str(warning.message))


def with_options(message: str) -> str:
    """Return a message of the library with options in the place of its arguments."""
    message = _MERGE.sub(r"--merge \1", message)
    message = message.replace("the file type is missing;", "its format is missing, --format;")
    return _ARGUMENTS.sub(lambda found: "--" + found[0].replace("_", "-"), message)


_MERGE = re.compile(r"\bmerge='?([\w.+-]+)'?")
_ARGUMENTS = re.compile(
    r"\b(max_distance|relative_error|absolute_error|chord_error)\b|^(faces|threads)(?= is )"
)
