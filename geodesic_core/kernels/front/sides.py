"""The two sides of a face over which windows leave it, each seen from where it begins."""

from typing import NamedTuple

from geodesic_core.kernels.front.state import View
from geodesic_core.kernels.jit import inlined
from geodesic_core.kernels.mesh.half_edges import (
    COS_LEFT,
    COS_RIGHT,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
)


class Side(NamedTuple):
    """One of the two other edges of a face, as seen from the end of the half-edge it starts at."""

    out: int
    """The half-edge across it, or NO_FACE, or IRREGULAR"""
    length: float
    cosine: float
    """Of the angle between it and the half-edge"""
    sine: float
    start: float
    """Place of that end on the half-edge: 0 on the left, its length on the right"""
    is_right: bool


@inlined
def left_of(wave: View, h: int) -> Side:
    """Return the edge from the tail of h to its apex."""
    geometry, row = wave.mesh.geometry, ROW * h
    return Side(
        wave.mesh.links[row + OUT_LEFT],
        geometry[row + LENGTH_LEFT],
        geometry[row + COS_LEFT],
        geometry[row + SIN_LEFT],
        0.0,
        False,
    )


@inlined
def right_of(wave: View, h: int) -> Side:
    """Return the edge from the head of h to its apex."""
    geometry, row = wave.mesh.geometry, ROW * h
    return Side(
        wave.mesh.links[row + OUT_RIGHT],
        geometry[row + LENGTH_RIGHT],
        geometry[row + COS_RIGHT],
        geometry[row + SIN_RIGHT],
        geometry[row + LENGTH],
        True,
    )
