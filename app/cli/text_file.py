"""Text files that options name, as spreadsheets and other programs write them."""

import codecs
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

import typer

NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")
_COMMENT = re.compile(r"#.*")
_UTF16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE


class Line(NamedTuple):
    """A line that has more than a comment."""

    number: int
    """In the file, from 1"""
    text: str
    """Without its comment, and without blanks around it"""

    def fields(self) -> list[str]:
        """Return what semicolons, tabs, commas or blanks separate: the first of these that occur.

        Raises ``BadParameter`` where a number has a decimal comma.
        """
        text = self.text
        by = next((separator for separator in ";\t" if separator in text), None)
        fields = [field.strip().strip("\"'") for field in text.rstrip(by).split(by)]
        wrong = next(filter(_DECIMAL_COMMA.fullmatch, fields), None)
        if wrong is not None and len(fields) > 1:
            raise typer.BadParameter(
                f"{wrong!r} has a decimal comma: write {wrong.replace(',', '.')}"
            )
        if by is None and "," in text:
            fields = [field.strip().strip("\"'") for field in text.rstrip(", ").split(",")]
        return fields


def lines_of(file: Path) -> list[Line]:
    """Return the lines of a file in UTF-8, or in UTF-16 with a byte order mark.

    Raises ``BadParameter`` where it cannot be read.
    """
    try:
        data = file.read_bytes()
        text = data.decode("utf-16" if data.startswith(_UTF16) else "utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    except OSError as error:
        raise typer.BadParameter(f"cannot read {file}: {error.strerror}") from None
    if "\0" in text:
        raise typer.BadParameter(
            f"cannot read {file}: it is not text in UTF-8, or in UTF-16 with a byte order mark"
        )
    bare = ((i, _COMMENT.sub("", line).strip()) for i, line in enumerate(text.splitlines(), 1))
    return [Line(number, text) for number, text in bare if text]


def columns_in(header: Line, *wanted: Collection[str]) -> list[int] | None:
    """Return the places of columns, each known by several names; None where one is missing."""
    names = [field.lower() for field in header.fields()]
    places = [next((i for i, name in enumerate(names) if name in known), -1) for known in wanted]
    return None if -1 in places else places


def at(line: Line, places: Sequence[int]) -> list[str]:
    """Return the fields of a line in some columns; raise ``BadParameter`` where it has fewer."""
    fields = line.fields()
    if len(fields) <= max(places):
        raise typer.BadParameter(f"{line.text!r} has fewer columns than the header")
    return [fields[place] for place in places]


def whole(text: str) -> str:
    """Return the digits of a whole number that is written as a float; any other text as it is."""
    if text.isdecimal() or not NUMBER.fullmatch(text) or not float(text).is_integer():
        return text
    return str(int(float(text)))
