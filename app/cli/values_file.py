"""Files of values at the vertices of a mesh: an array of numpy's, or text."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.text_file import NUMBER, Line, columns_in, lines_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

_VALUE = {"value", "values", "distance", "scalar"}
"""Names of the column of values in a header"""
_NONE = {"", "nan", "inf", "-inf"}
"""Numbers of vertices that have no value, in lower case"""


@dataclass(frozen=True)
class Values:
    """A value for each vertex, in their order; None where there is none."""

    given: list[float | None]

    @classmethod
    def read(cls, name: str) -> "Values":
        """Return the values of a ``.npy`` file, or those in a text file, one a line."""
        file = Path(name)
        return cls(_array_of(file) if file.suffix.lower() == ".npy" else _numbers_in(file))


def _array_of(file: Path) -> list[float | None]:
    import numpy as np

    try:
        array: NDArray[Any] = np.load(file, allow_pickle=False)
    except OSError as error:
        raise typer.BadParameter(f"cannot read {file}: {error.strerror}") from None
    except (ValueError, EOFError) as error:
        raise typer.BadParameter(f"{file} is no array of numpy's: {error}") from None
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        raise typer.BadParameter(
            f"{file} has the shape {array.shape} and the type {array.dtype}: it must be a list of "
            "real numbers, one for each vertex"
        )
    values = array.astype(np.float64)
    return [
        each if present else None
        for each, present in zip(values.tolist(), np.isfinite(values), strict=True)
    ]


def _numbers_in(file: Path) -> list[float | None]:
    lines = lines_of(file)
    column = None
    if lines and not _is_number(lines[0].fields()[0]):
        column = columns_in(lines[0], _VALUE)
        if column is None:
            raise typer.BadParameter(
                f"{file}, line {lines[0].number}: {lines[0].text!r} has no column named value"
            )
        lines = lines[1:]
    return [_number_in(file, line, None if column is None else column[0]) for line in lines]


def _number_in(file: Path, line: Line, column: int | None) -> float | None:
    """Return the number of a line; cells that are left empty at its end are missing."""
    fields = line.fields()
    if column is None and len(fields) == 1:
        column = 0
    text = fields[column] if column is not None and column < len(fields) else ""
    if column is None or not _is_number(text):
        raise typer.BadParameter(
            f"{file}, line {line.number}: {line.text!r} must be one number, or name the columns in "
            "the first line"
        )
    return None if text.lower() in _NONE else float(text)


def _is_number(text: str) -> bool:
    return NUMBER.fullmatch(text) is not None or text.lower() in _NONE
