"""JSON: all members, with ``null`` for numbers that are not finite."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.views import Elements, Indices

_VALUES, _ELEMENTS = 2**11, 2**9
"""Values of arrays, and elements of lists, that are encoded at a time.

orjson reserves 40 bytes for the former, 256 for the latter. Above 128 kB malloc takes memory from
the kernel each time anew: with eight times as many, a million values took twice as long.
"""


def to_json(answer: Answer) -> Encoded:
    """Encode all members."""
    return document(answer.members), {}


def document(members: Mapping[str, Any]) -> Iterator[Buffer]:
    """Yield the parts of an object, its long members in blocks."""
    if all(_rows_at_a_time(value) is None for value in members.values()):
        yield dumped(members)
        return
    yield b"{"
    for i, (name, value) in enumerate(members.items()):
        yield b"%b%b:" % (b"," if i else b"", dumped(name))
        yield from _value(value)
    yield b"}"


def dumped(value: Any) -> bytes:
    """Return a value as JSON."""
    # orjson reads contiguous arrays of the machine's own numbers by itself; others go as lists.
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY, default=_as_list)


def _value(value: Any) -> Iterator[Buffer]:
    rows = _rows_at_a_time(value)
    if rows is None:
        yield dumped(value)
        return
    for start in range(0, len(value), rows):
        yield b"," if start else b"["
        yield dumped(value[start : start + rows])[1:-1]
    yield b"]"


def _rows_at_a_time(value: Any) -> int | None:
    """Return the number of rows of a value that are encoded at a time; None for all."""
    if not isinstance(value, np.ndarray | Indices | Elements | list | tuple):
        return None
    rows = _ELEMENTS
    if isinstance(value, np.ndarray) and value.size:
        rows = max(1, _VALUES * len(value) // value.size)
    return rows if len(value) > rows else None


def _as_list(value: NDArray[Any] | Indices | Elements) -> list[Any]:
    return value.tolist()
