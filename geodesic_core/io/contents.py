"""Contents of a mesh file: vertices and polygons, as every reader returns them."""

from collections.abc import Mapping
from typing import NamedTuple

from geodesic_core.arrays import Floats, Longs


class FileContents(NamedTuple):
    """Vertices and polygons of a file, in its own numbering."""

    vertices: Floats
    """(V, 3), as the file has them"""
    corners: Longs
    """(C,): vertices of all polygons, one polygon after the other"""
    sizes: Longs
    """(P,): how many corners each polygon has"""
    notes: tuple[str, ...] = ()
    """Sentences on what was left out"""


def note_on_ignored(kind: str, ignored: Mapping[str, int]) -> tuple[str, ...]:
    """Return a sentence on elements that are no part of the surface; none where there are none.

    ``ignored`` counts them by name.
    """
    held = [f"{count} {name}" for name, count in ignored.items() if count]
    if not held:
        return ()
    what = ", ".join(held)
    return (
        f"The {kind} file also holds {what}, which are not part of the surface and were left out.",
    )


BEHIND = "behind its last element"
"""Where the rows or bytes are that a file has after all that it declares."""
