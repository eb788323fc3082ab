"""The window: a stretch of an edge to which one pseudosource sends straight rays (section 3.1).

A window is a row of eight float64 in a pool, addressed by its slot. It lies on a half-edge and is
about to cross that half-edge's face; its rays come from y < 0 in the half-edge's frame.

=========  ==========================  =======================================================
column     paper                       meaning, unit
=========  ==========================  =======================================================
B0, B1     b0, b1                      ends on the half-edge, mesh units from its tail
SX, SY     d0, d1 and τ, in one        the unfolded pseudosource s in the half-edge's frame
           (of a strip: see below)
SIGMA      σ                           distance from s back to the source, mesh units
XI         ξ                           how much the window may fall short of the exact distance
=========  ==========================  =======================================================

The unfolded position replaces the two distances d0, d1, whose every use would cost a square root,
and its side of the edge replaces the direction τ.

A *strip* is a window whose rays are parallel: they leave a straight piece of a curve at right
angles. Its pseudosource lies at infinity: in homogeneous coordinates (SX, SY, SW), with SW = 0 and
(SX, SY) the unit vector against the rays; all others have SW = 1. Its distance function is linear:
D(x, y) = SIGMA - SX x - SY y, where SIGMA belongs to the frame's origin and may be negative. SW is
not stored, since ROOT tells it (`wavefront.source_weight`).

The rest of a row holds int32:

REFERENCE  what was merged into the window (4.3): a merge's index, or -1 - ROOT where nothing was
NEXT       slot of the next window of the same list (or of the next free slot), -1 at the end
ROOT       node of the pseudosource; of a merged window, of one of those that it replaces; of a
           strip, the piece that it comes from

XI and REFERENCE have a meaning in a merging sweep only.
"""

import math

from geodesic_core.kernels.jit import inlined

B0 = 0
B1 = 1
SX = 2
SY = 3
SIGMA = 4
XI = 5

WIDTH = 8  # float64 columns of a row
REFERENCE = 12  # int32 columns of a row
NEXT = 14
ROOT = 15
INTS = 16


@inlined
def distance_at(x: float, sx: float, sy: float, sigma: float, sw: float = 1.0) -> float:
    """Distance function D of a window at (x, 0)."""
    if sw == 0.0:
        return sigma - sx * x
    return math.sqrt((x - sx) * (x - sx) + sy * sy) + sigma


@inlined
def reaches(
    b0: float, b1: float, sx: float, sy: float, sigma: float, limit: float, sw: float = 1.0
) -> bool:
    """Whether the least distance over the window is within ``limit``."""
    if sw == 0.0:
        return sigma - max(sx * b0, sx * b1) <= limit
    x = min(max(sx, b0), b1) - sx
    room = limit - sigma
    return room >= 0.0 and x * x + sy * sy <= room * room


@inlined
def within(x: float, sx: float, sy: float, sw: float, sigma: float, limit: float) -> bool:
    """Whether the distance at (x, 0) is within ``limit``."""
    if sw == 0.0:
        return sigma - sx * x <= limit
    room = limit - sigma
    return room > 0.0 and room * room >= (sx - x) * (sx - x) + sy * sy


@inlined
def straight_distance(x: float, y: float, sx: float, sy: float, sw: float, sigma: float) -> float:
    """Distance function at a point of the face that the window is about to cross."""
    if sw == 0.0:
        return sigma - sx * x - sy * y
    return math.sqrt((x - sx) * (x - sx) + (y - sy) * (y - sy)) + sigma
