"""PLY: the mesh with values at its vertices, binary and little-endian."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.colours import colours_of, largest_of
from app.encoding.headers import headers_of
from app.encoding.views import Indices, Surface, embedded

_ROWS = 2**11
"""Rows that are written at a time: few enough for malloc to reuse their memory."""
_KINDS = {"f": ("double", "<f8"), "i": ("int", "<i4")}
_RGB = "red", "green", "blue"


def to_ply(answer: Answer) -> Encoded:
    """Encode the surface."""
    assert answer.surface is not None, "an answer in PLY has a surface"  # noqa: S101
    embedded(answer.surface.vertices)
    return ply_of(answer.surface), headers_of(answer, answer.shown)


def ply_of(surface: Surface) -> Iterator[Buffer]:
    """Yield the parts of a file; trimesh's own writer would round positions to float32."""
    columns: dict[str, NDArray[Any]] = dict(zip("xyz", surface.vertices.T, strict=True))
    for name, column in surface.values.items():
        columns[name] = column.array if isinstance(column, Indices) else column
    kinds = {name: _KINDS[column.dtype.kind] for name, column in columns.items()}
    shown = columns[next(iter(surface.values))] if surface.values else None
    if shown is not None:
        kinds |= dict.fromkeys(_RGB, ("uchar", "|u1"))
    properties = "".join(f"property {kind} {name}\n" for name, (kind, _) in kinds.items())
    yield (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(surface.vertices)}\n{properties}"
        f"element face {len(surface.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    largest = largest_of(shown) if shown is not None else 0.0
    for part in _parts(len(surface.vertices)):
        rows = np.empty(len(part), [(name, kind) for name, (_, kind) in kinds.items()])
        for name, column in columns.items():
            rows[name] = column[part.start : part.stop]
        if shown is not None:
            colours = colours_of(shown[part.start : part.stop], largest)
            for name, colour in zip(_RGB, colours.T, strict=True):
                rows[name] = colour
        yield rows.tobytes()
    for part in _parts(len(surface.faces)):
        corners = np.empty(len(part), [("count", "|u1"), ("corners", "<i4", 3)])
        corners["count"] = 3
        corners["corners"] = surface.faces[part.start : part.stop]
        yield corners.tobytes()


def _parts(count: int) -> Iterator[range]:
    return (range(start, min(start + _ROWS, count)) for start in range(0, count, _ROWS))
