"""Faces and edges as the checker of certificates has them, for kernels."""

from typing import NamedTuple

from geodesic_core.arrays import Flags, Floats, Longs


class Faces(NamedTuple):
    """The faces that paths may cross, and their edges."""

    edges: Longs
    """(E, 2): the vertices of each edge, the lower one first"""
    length: Floats
    """(E,)"""
    length_off: Floats
    """(E,): by how much it may be rounded"""
    is_rim: Flags
    """(E,): whether only one face has it"""
    corners: Longs
    """(F, 3): vertices"""
    of_face: Longs
    """(F, 3): the edge from each corner to the next one"""


class Numbers(NamedTuple):
    """What the checker calls the inner faces and vertices."""

    faces: Longs
    """By inner face; -1 where no path may cross it"""
    vertices: Longs
    """By inner vertex"""
