"""The window: a stretch of an edge to which one pseudosource sends straight rays (section 3.1).

A window lies on a half-edge and is about to cross that half-edge's face; its rays come from y < 0
in the half-edge's frame.

=============  =======================  =========================================================
field          paper                    meaning, unit
=============  =======================  =========================================================
b0, b1         b0, b1                   ends on the half-edge, mesh units from its tail
sx, sy         d0, d1 and τ, in one     the unfolded pseudosource s in the half-edge's frame
               (if parallel: see below)
sigma          σ                        distance from s back to the source, mesh units
weight                                  1; 0 where the rays are parallel
root                                    node of the pseudosource; of a merged window, of one of
                                        those that it replaces; of a parallel one, its segment
xi             ξ                        how much it may fall short of the exact distance
reference      reference list (4.3)     what was merged into it: a merge's index, or -1 - root;
                                        in an exact sweep, its last crossing of an irregular edge
                                        (a slot), or < 0: see `irregular_edges`
turn                                    in a directed sweep, of a window lit by a source itself:
                                        angle of the half-edge in the frame of the source, radians,
                                        see `directions`; else NaN, unless bends have frames, too
mirrored                                in a directed sweep, whether that frame is seen in the
                                        mirror: 1 or 0
=============  =======================  =========================================================

The unfolded position replaces the two distances d0, d1, whose every use would cost a square root,
and its side of the edge replaces the direction τ. ξ has a meaning in a merging
sweep only.

A window is *parallel* where its rays leave a straight segment of a curve at right angles. Its
pseudosource lies at infinity: in homogeneous coordinates (sx, sy, weight), with weight 0 and
(sx, sy) the unit vector against the rays. Its distance function is linear:
D(x, y) = sigma - sx x - sy y, where sigma belongs to the frame's origin and may be negative.

In memory a window is a row of eight float64, the last two of them four int32, in a pool where its
number is its *slot*; kernels read and write whole windows, as values. The weight is not stored,
since the root tells it. What a column holds depends on the kind of sweep:

=======  =================  =================  ==================================================
column   exact              merging            fast
=======  =================  =================  ==================================================
0 to 4   B0 … SIGMA         B0 … SIGMA         B0 … SIGMA
5        TURN, if directed  XI                 KEY: its least distance, by which it is due
int 12   REFERENCE          REFERENCE          HALF_EDGE: that it is to cross; -1 - v where vertex
                                               v is to emit all around, from SIGMA
int 13   MIRRORED, if       free               WON: bits of the places at which it was the nearest
         directed; DEPTH
         of a crossing
int 14   NEXT               NEXT               NEXT
int 15   ROOT               ROOT               ROOT
=======  =================  =================  ==================================================

NEXT is the slot of the next window of the same list or bucket, or of the next free one, -1 at the
end; of a recorded crossing the one before; of a retained window its half-edge. A merging sweep and
a fast one have no float64 to spare, a fast one no int32.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.front.state import (
    WIDTH,
    View,
    directed,
    merging,
    mirrors,
    source_weight,
)
from geodesic_core.kernels.jit import as_ints, inlined
from geodesic_core.kernels.planar import distance

# Columns of a row, float64
B0 = 0
B1 = 1
SX = 2
SY = 3
SIGMA = 4
TURN = 5
XI = 5
KEY = 5

# Columns of a row, int32
REFERENCE = 12
HALF_EDGE = 12
MIRRORED = 13
DEPTH = 13
WON = 13
NEXT = 14
ROOT = 15
INTS = 16  # columns in all


class Window(NamedTuple):
    """A window as a value."""

    b0: float
    b1: float
    sx: float
    sy: float
    sigma: float
    weight: float
    root: int
    xi: float
    reference: int
    turn: float
    mirrored: int


NO_WINDOW = Window(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0, 0.0, -1, math.nan, 0)
"""An empty window."""


@inlined
def load_window(wave: View, rows: Floats, i: int) -> Window:
    """Return the window of row i of the pool, or of scratch."""
    w, ints = WIDTH * i, as_ints(rows)
    root: Any = np.int64(ints[INTS * i + ROOT])  # one type, so that kernels are compiled once
    reference: Any = np.int64(ints[INTS * i + REFERENCE])
    xi, turn, mirrored = 0.0, math.nan, 0
    if merging(wave):
        xi = rows[w + XI]
    if directed(wave):
        turn = rows[w + TURN]
    if mirrors(wave):
        mirrored = int(ints[INTS * i + MIRRORED])
    return Window(
        rows[w + B0],
        rows[w + B1],
        rows[w + SX],
        rows[w + SY],
        rows[w + SIGMA],
        source_weight(wave, root),
        root,
        xi,
        reference,
        turn,
        mirrored,
    )


@inlined
def store_window(wave: View, rows: Floats, i: int, window: Window) -> None:
    """Write a window to row i. Modifies ``rows``."""
    w, ints = WIDTH * i, as_ints(rows)
    rows[w + B0], rows[w + B1] = window.b0, window.b1
    rows[w + SX], rows[w + SY] = window.sx, window.sy
    rows[w + SIGMA] = window.sigma
    ints[INTS * i + ROOT] = window.root
    ints[INTS * i + REFERENCE] = window.reference
    if merging(wave):
        rows[w + XI] = window.xi
    if directed(wave):
        rows[w + TURN] = window.turn
    if mirrors(wave):
        ints[INTS * i + MIRRORED] = window.mirrored


@inlined
def emitted_window(
    wave: View, b0: float, b1: float, sx: float, sy: float, sigma: float, root: int, xi: float
) -> Window:
    """Return a window as the pseudosource ``root`` emits it, with nothing merged into it."""
    node: Any = np.int64(root)
    weight = source_weight(wave, node)
    return Window(b0, b1, sx, sy, sigma, weight, node, xi, -1 - node, math.nan, 0)


@inlined
def ray_from(wave: View, sx: float, sy: float, root: int) -> Window:
    """Return a straight way that crosses no edge as a window: from ``root``, at (sx, sy)."""
    return emitted_window(wave, 0.0, 0.0, sx, sy, 0.0, root, 0.0)


@inlined
def changed(
    window: Window,
    b0: float,
    b1: float,
    sx: float,
    sy: float,
    sigma: float,
    xi: float,
    reference: int,
) -> Window:
    """Return the window with all changed but its root, and what it tells of directions."""
    weight, root, turn = window.weight, window.root, window.turn
    return Window(b0, b1, sx, sy, sigma, weight, root, xi, reference, turn, window.mirrored)


@inlined
def seen_over(window: Window, b0: float, b1: float, sx: float, sy: float) -> Window:
    """Return the window as it goes on over another edge, in the frame of the half-edge there."""
    return changed(window, b0, b1, sx, sy, window.sigma, window.xi, window.reference)


@inlined
def between(window: Window, b0: float, b1: float) -> Window:
    """Return the window with other ends."""
    return seen_over(window, b0, b1, window.sx, window.sy)


@inlined
def at_sigma(window: Window, sigma: float) -> Window:
    """Return the window with another σ."""
    b0, b1, sx, sy = window.b0, window.b1, window.sx, window.sy
    return changed(window, b0, b1, sx, sy, sigma, window.xi, window.reference)


@inlined
def referring_to(window: Window, reference: int) -> Window:
    """Return the window with another reference: to a merge, or to the last crossing."""
    b0, b1, sx, sy = window.b0, window.b1, window.sx, window.sy
    return changed(window, b0, b1, sx, sy, window.sigma, window.xi, reference)


@inlined
def reversed_window(window: Window, length: float) -> Window:
    """Return the window in the frame that runs along its edge, of this length, the other way."""
    sigma = window.sigma
    if window.weight != 1.0:  # it belongs to the origin, which is at the other end
        sigma -= window.sx * length
    b0, b1, sx = length - window.b1, length - window.b0, length * window.weight - window.sx
    return changed(window, b0, b1, sx, window.sy, sigma, window.xi, window.reference)


@inlined
def turned(window: Window, turn: float, mirrored: int) -> Window:
    """Return the window with another turn."""
    b0, b1, sx, sy, sigma = window.b0, window.b1, window.sx, window.sy, window.sigma
    weight, root, xi, reference = window.weight, window.root, window.xi, window.reference
    return Window(b0, b1, sx, sy, sigma, weight, root, xi, reference, turn, mirrored)


@inlined
def distance_at(window: Window, x: float) -> float:
    """Distance function D at (x, 0)."""
    return distance(x, window.sx, window.sy, window.weight) + window.sigma


@inlined
def straight_distance(window: Window, x: float, y: float) -> float:
    """Distance function D at a point of the face that the window is about to cross."""
    sx, sy = window.sx, window.sy
    if window.weight == 0.0:
        return window.sigma - sx * x - sy * y
    return math.sqrt((x - sx) * (x - sx) + (y - sy) * (y - sy)) + window.sigma


@inlined
def reaches(window: Window, limit: float) -> bool:
    """Whether the least distance over the window is within ``limit``."""
    b0, b1, sx, sy = window.b0, window.b1, window.sx, window.sy
    if window.weight == 0.0:
        return window.sigma - max(sx * b0, sx * b1) <= limit
    x = min(max(sx, b0), b1) - sx
    room = limit - window.sigma
    return room >= 0.0 and x * x + sy * sy <= room * room


@inlined
def is_beyond(wave: View, window: Window) -> bool:
    """Whether the least distance over the window is beyond the limit of the sweep."""
    limit = wave.bounds.max_distance
    return limit < math.inf and not reaches(window, limit)


@inlined
def is_within(window: Window, x: float, limit: float) -> bool:
    """Whether the distance at (x, 0) is within ``limit``."""
    sx, sy = window.sx, window.sy
    if window.weight == 0.0:
        return window.sigma - sx * x <= limit
    room = limit - window.sigma
    return room > 0.0 and room * room >= (sx - x) * (sx - x) + sy * sy
