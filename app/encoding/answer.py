"""An answer on its way out, and what becomes of it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.encoding.views import Line, Place, Surface, Table

Buffer = bytes | memoryview


@dataclass(frozen=True)
class Answer:
    """An answer: members of all sizes, among them arrays, and how other formats show them.

    Attributes
    ----------
    members
        In the order of the JSON object; arrays where they are large.
    arrays
        Names of the members that are the body in binary formats (empty where that is ``None``); the
        small ones become headers. The distances of a sparse matrix come with their rows and
        columns. No names for an answer that has no such format.
    shown
        Names of the members that the views show; the small ones of the others become headers.
    values
        How many values its JSON has, where the query did not tell before it was answered.
    table, lines, places, surface
        Its views, or what makes them: None where it has no such view. There is at least one line.
    """

    members: Mapping[str, Any]
    arrays: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()
    values: int = 0
    table: Table | None = None
    lines: Callable[[], Sequence[Line]] | None = None
    places: Callable[[], Sequence[Place]] | None = None
    surface: Surface | None = None


@dataclass(frozen=True)
class Encoded:
    """What is sent: the parts of the body, made one after the other, and headers of its own."""

    parts: Iterable[Buffer]
    headers: Mapping[str, str] = field(default_factory=dict)
