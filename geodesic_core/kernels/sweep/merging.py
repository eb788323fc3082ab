r"""Two adjacent windows of one edge merged into one, within bounds (section 4).

The merged window covers both; its distance is never above theirs, and below by no more than ξ::

                 q0       split       q1
       -----------+---------+----------+-----------      y = 0
                   \   w0    \   w1   /
                    \         s1     /
                     s0             /
                       \           /     s' keeps the distances at q0 and q1: a conic with these
                            s'           foci. It lies between the lines q0 s0 and q1 s1.

Directionality (τ) needs no test here: all windows of a half-edge come from the same side, and s'
is chosen there.
"""

import math
from typing import Any

from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.sweep.window import distance_at
from geodesic_core.tolerances import GRAZING, LOCAL_SHARE, LOWER_BOUND


@inlined
def directionality(along: float, reach: float) -> float:
    """Height of s' above the edge's line, squared; -1 if it is not clearly on the windows' side.

    ``along`` and ``reach`` are its place along the edge and its distance, both from q0.
    """
    square = reach * reach - along * along
    return square if square > GRAZING * GRAZING * reach * reach else -1.0


@inlined
def visibility(cosine: float, width: float, difference: float, spare: float) -> float:
    """How far from an end s' may lie so that the window's outermost ray stays in view.

    On the conic, s' turns outward as it moves away: to the line toward the old pseudosource, whose
    angle to the edge has this ``cosine``, but not beyond. ``difference`` is this end's distance
    less the other's, ``spare`` the squared width less its square.
    """
    turn = 2.0 * (width * cosine - difference)
    return spare / turn if turn > 0.0 else math.inf


@inlined
def least_sigma(d0: float, d1: float, reach0: float, reach1: float) -> float:
    """Least σ' with both visibility constraints, for distances d0, d1 at the ends (4.2)."""
    return max(0.0, d0 - reach0, d1 - reach1)


@inlined
def continuity(width: float, r0: float, r1: float) -> float:
    """Place along the edge, from q0, of the point at r0 from q0 and r1 from q1: on the conic."""
    return ((r0 - r1) * (r0 + r1) + width * width) / (2.0 * width)


@inlined
def shortfall(
    lo: float, hi: float, nx: float, ny: float, n_sigma: float, sx: float, sy: float, sigma: float
) -> float:
    """D - D' where it is stationary in (lo, hi), for a window (s, σ) and the merged one (n, σ').

    There is one such point: where s, s' and the point are collinear. Without it, 0.
    """
    if sy == ny:
        return 0.0
    x = (nx * sy - sx * ny) / (sy - ny)
    if lo < x < hi:
        return distance_at(x, sx, sy, sigma) - distance_at(x, nx, ny, n_sigma)
    return 0.0


@inlined
def accuracy(wave: Any, xi: float, local: float, nearest: float) -> bool:
    """Whether the accumulated error ξ' and this merge's own are within bounds.

    ``nearest`` is the least distance over the merged window: what holds there holds throughout.
    """
    allowed = min(wave.bounds.relative_error * nearest, wave.bounds.absolute_error)
    return xi <= allowed and local <= LOCAL_SHARE * allowed


@kernel
def merged(
    wave: Any,
    b0: float,
    b1: float,
    s0x: float,
    s0y: float,
    sigma0: float,
    xi0: float,
    c0: float,
    c1: float,
    s1x: float,
    s1y: float,
    sigma1: float,
    xi1: float,
) -> tuple[bool, float, float, float, float]:
    """Merge the windows [b0, b1] and [c0, c1]; return (whether it can be, s'x, s'y, σ', ξ')."""
    refused = (False, 0.0, 0.0, 0.0, 0.0)
    r0 = math.sqrt((s0x - b0) * (s0x - b0) + s0y * s0y)
    r1 = math.sqrt((s1x - c1) * (s1x - c1) + s1y * s1y)
    width, d0, d1 = c1 - b0, r0 + sigma0, r1 + sigma1
    if not accuracy(wave, max(xi0, xi1), 0.0, min(d0, d1)):
        return refused
    # Half of all pairs fail here already, before the conic costs anything.
    meets = min(distance_at(b1, s0x, s0y, sigma0), distance_at(c0, s1x, s1y, sigma1))
    chord = d0 + (d1 - d0) * (b1 - b0) / width  # nowhere below the merged window
    if not accuracy(wave, meets - chord, meets - chord, min(d0, d1)):
        return refused
    difference = d0 - d1
    spare = (width - difference) * (width + difference)
    if spare <= 0.0 or r0 <= 0.0 or r1 <= 0.0:
        return refused
    reach0 = visibility((s0x - b0) / r0, width, difference, spare)
    reach1 = visibility((c1 - s1x) / r1, width, -difference, spare)
    sigma = least_sigma(d0, d1, reach0, reach1)
    r0, r1 = d0 - sigma, d1 - sigma
    if r0 <= 0.0 or r1 <= 0.0:
        return refused
    along = continuity(width, r0, r1)
    height = directionality(along, r0)
    if height < 0.0:
        return refused
    sx, sy = b0 + along, -math.sqrt(height)
    # The distances at the ends are kept; where the windows meet, and at the stationary points,
    # they are not.
    meets0 = distance_at(b1, s0x, s0y, sigma0) - distance_at(b1, sx, sy, sigma)
    meets1 = distance_at(c0, s1x, s1y, sigma1) - distance_at(c0, sx, sy, sigma)
    if min(meets0, meets1) < -LOWER_BOUND * min(d0, d1):
        return refused
    nearest = distance_at(min(max(sx, b0), c1), sx, sy, sigma)
    if not accuracy(wave, max(xi0 + meets0, xi1 + meets1), max(meets0, meets1), nearest):
        return refused
    most0 = max(meets0, shortfall(b0, b1, sx, sy, sigma, s0x, s0y, sigma0))
    most1 = max(meets1, shortfall(c0, c1, sx, sy, sigma, s1x, s1y, sigma1))
    xi = max(xi0 + most0, xi1 + most1)
    if not accuracy(wave, xi, max(most0, most1), nearest):
        return refused
    return True, sx, sy, sigma, xi
