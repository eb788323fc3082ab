"""Answers of queries, and encoded answers."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.encoding.views import Line, Surface, Table

Buffer = bytes | memoryview


@dataclass(frozen=True)
class Answer:
    """The members of an answer, arrays among them, and its views for other formats.

    Attributes
    ----------
    members
        By name, in the order of the JSON object; arrays where they are large.
    arrays
        Names of the members that make the body in binary formats (an empty body where the member is
        ``None``); the other members become headers where they are small. The distances of a sparse
        matrix come with their rows and columns. Empty for an answer without a binary format.
    shown
        Names of the members that the views show; the others become headers where they are small.
    values
        Number of values in JSON, where the query could not tell it before; else 0.
    table, lines, surface
        The views, or functions that make them; None for a view that it lacks. There is at least one
        line.
    array
        Makes the body in binary formats where it is not the first of the ``arrays`` itself.
    named
        Arrays by name, for npz where the answer is no sparse matrix.
    """

    members: Mapping[str, Any]
    arrays: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()
    values: int = 0
    table: Table | None = None
    lines: Callable[[], Sequence[Line]] | None = None
    surface: Surface | None = None
    array: Callable[[], NDArray[np.float64]] | None = None
    named: Mapping[str, NDArray[Any]] | None = None


Encoded = tuple[Iterable[Buffer], Mapping[str, str]]
"""The parts of a body, made one after the other, and the headers that its content gives"""
