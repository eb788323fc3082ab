"""Contents of a mesh file: vertices and polygons, as every reader returns them."""

from collections.abc import Mapping, Sequence
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
    if not ignored:
        return ()
    what = ", ".join(f"{count} {name}" for name, count in ignored.items())
    return (
        f"The {kind} file also holds {what}, which are not part of the surface and were left out.",
    )


def note_on_rest(kind: str, rest: Sequence[bytes] | bytes) -> tuple[str, ...]:
    """Return a sentence on rows or bytes behind the last element; none where there are none."""
    if not rest or (isinstance(rest, bytes) and not rest.strip()):
        return ()
    unit = "bytes" if isinstance(rest, bytes) else "rows"
    return (f"Behind the last element of the {kind} file follow {len(rest)} {unit}, left out.",)
