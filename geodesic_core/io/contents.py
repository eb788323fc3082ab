"""Contents of a mesh file: vertices and polygons, as every reader returns them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs

_NOTHING: Mapping[str, int] = MappingProxyType({})

BEHIND = "behind its last element"
"""Where the rows or bytes are that a file has after all that it declares."""


class FileContents(NamedTuple):
    """Vertices and polygons of a file, in its own numbering."""

    vertices: Floats
    """(V, 3), as the file has them"""
    corners: Longs
    """(C,): vertices of all polygons, one polygon after the other"""
    sizes: Longs
    """(P,): how many corners each polygon has"""
    left_out: Mapping[str, int] = _NOTHING
    """How much the file holds that is no part of the surface, by name"""
    notes: tuple[str, ...] = ()
    """Sentences on how the file was read"""
    lengths: NDArray[Any] | None = None
    """(P, 3) of a file of triangles that gives the lengths of their edges; it may have no vertices
    then"""

    @classmethod
    def of_triangles(
        cls,
        vertices: Floats,
        faces: NDArray[Any],
        left_out: Mapping[str, int] = _NOTHING,
        notes: tuple[str, ...] = (),
    ) -> FileContents:
        """Return the contents of a file of triangles, (F, 3)."""
        corners = np.asarray(faces, np.int64).reshape(-1)
        return cls(vertices, corners, np.full(len(faces), 3, np.int64), left_out, notes)

    def left_out_in_words(self) -> str:
        """Return what was left out as a part of a sentence, empty where nothing was."""
        return ", ".join(f"{count} {name}" for name, count in self.left_out.items() if count)
