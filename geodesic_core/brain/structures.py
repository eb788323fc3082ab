"""Hemispheres, as the formats of brain imaging name them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.errors import InvalidArgument
from geodesic_core.io.unpacking import NamedBytes

Side = Literal["left", "right"]

_SIDES: Mapping[str, Side] = {
    **dict.fromkeys(("l", "lh", "left"), "left"),
    **dict.fromkeys(("r", "rh", "right"), "right"),
}
STRUCTURE = "AnatomicalStructurePrimary"
"""Name of a structure in the metadata of GIFTI"""
_IN_GIFTI = re.compile(rb"AnatomicalStructurePrimary.{0,80}?Cortex(Left|Right)", re.DOTALL)


@dataclass(frozen=True)
class Structure:
    """A hemisphere: its vertices among those of a cortex."""

    side: Side
    first: int
    """The first of its vertices"""
    count: int
    """Number of its vertices"""
    faces: int
    """Number of its faces"""

    @property
    def name(self) -> str:
        """As GIFTI has it, such as ``CortexLeft``."""
        return f"Cortex{self.side.title()}"

    @property
    def cifti_name(self) -> str:
        """As CIFTI has it, such as ``CIFTI_STRUCTURE_CORTEX_LEFT``."""
        return f"CIFTI_STRUCTURE_CORTEX_{self.side.upper()}"

    @property
    def part(self) -> slice:
        """Its vertices."""
        return slice(self.first, self.first + self.count)

    def of(self, vertices: NDArray[np.signedinteger[Any]]) -> Longs:
        """Return those of some vertices that it has, in its own numbers."""
        own = vertices.astype(np.int64) - self.first
        inside: Longs = own[(own >= 0) & (own < self.count)]
        return inside


def only(structures: Sequence[Structure], file: object, remedy: str) -> Structure:
    """Return the one structure that a file holds.

    Raises
    ------
    InvalidArgument
        There are two.
    """
    if len(structures) > 1:
        raise InvalidArgument(f"{file} holds one hemisphere: {remedy}")
    return structures[0]


def side_of_file(file: NamedBytes) -> Side | None:
    """Return the side that a file tells: GIFTI by its metadata, others by their names."""
    found = _IN_GIFTI.search(file.data)
    return _SIDES[found[1].decode().lower()] if found else side_named(PurePath(file.name).name)


def side_named(text: str) -> Side | None:
    """Return the side that a name has among its words, such as ``sub-1_hemi-L_white``."""
    sides = {_SIDES[word] for word in re.split(r"[^a-z]+", text.lower()) if word in _SIDES}
    return sides.pop() if len(sides) == 1 else None


def side_of_image(image: Any) -> Side | None:
    """Return the side that a GIFTI image of nibabel tells in its metadata."""
    tables = [image.meta, *(array.meta for array in image.darrays)]
    names = {table[STRUCTURE].removeprefix("Cortex") for table in tables if STRUCTURE in table}
    return side_named(names.pop()) if len(names) == 1 else None
