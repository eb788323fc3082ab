"""Places of answers and of their summaries: files, and standard output."""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import files
from app.cli.arguments import STANDARD_STREAM

if TYPE_CHECKING:
    from app.encoding import Answer

AsJson = Annotated[bool, typer.Option("--json", help="Print the answer as JSON, for programs.")]


@dataclass(frozen=True)
class Output:
    """The places of an answer: a file, standard output, or both.

    The summary goes to standard output, or to standard error where the answer is there.
    """

    out: Path | None
    as_json: bool

    def __post_init__(self) -> None:
        if self.out == STANDARD_STREAM and self.as_json:
            raise typer.BadParameter("--json and - both go to standard output: give one of them")

    def write(self, answer: "Answer", in_file: "Answer | None" = None) -> None:
        """Write an answer to its places; into a file ``in_file``, where that is another."""
        if self.out == STANDARD_STREAM:
            print_parts(files.encoded(answer, "csv"))
        elif self.out is not None:
            files.write_answer(self.out, in_file or answer)
        if self.as_json:
            print_parts([*files.encoded(answer, "json"), b"\n"])

    def say(self, line: str) -> None:
        """Print a line of the summary."""
        typer.echo(line, err=self.as_json or self.out == STANDARD_STREAM)

    def say_written(self) -> None:
        """Print where the answer is, if that is a file."""
        if self.out is not None and self.out != STANDARD_STREAM:
            self.say(f"written     {self.out}")


def print_json(document: Any) -> None:
    """Print a document as JSON."""
    import orjson

    typer.echo(orjson.dumps(document, option=orjson.OPT_INDENT_2))


def print_parts(parts: Iterable[bytes | memoryview]) -> None:
    """Write bytes to standard output."""
    sys.stdout.flush()
    sys.stdout.buffer.writelines(parts)
    sys.stdout.buffer.flush()
