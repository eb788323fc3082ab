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

from geodesic_core.kernels.front.state import View
from geodesic_core.kernels.front.window import Window, changed, distance_at
from geodesic_core.kernels.jit import inlined
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
    """Largest distance of s' from an end at which the window's outermost ray is in view.

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
def shortfall(window: Window, whole: Window) -> float:
    """D - D' where it is stationary within a window, for the merged one (s', σ'); else 0.

    There is at most one such point: where s, s' and the point are collinear.
    """
    if window.sy == whole.sy:
        return 0.0
    x = (whole.sx * window.sy - window.sx * whole.sy) / (window.sy - whole.sy)
    if window.b0 < x < window.b1:
        return distance_at(window, x) - distance_at(whole, x)
    return 0.0


@inlined
def accuracy(wave: View, xi: float, local: float, nearest: float) -> bool:
    """Whether the accumulated error ξ' and this merge's own are within bounds.

    ``nearest`` is the least distance over the merged window: what holds there holds throughout.
    """
    allowed = min(wave.bounds.relative_error * nearest, wave.bounds.absolute_error)
    return xi <= allowed and local <= LOCAL_SHARE * allowed


@inlined
def pseudosource_between(w0: Window, w1: Window) -> tuple[bool, float, float, float]:
    """Find s' and σ' with which w0 and w1 can be one: continuity, visibility, directionality (4.2).

    Return whether there is one, s'x, s'y and σ'.
    """
    b0, c1 = w0.b0, w1.b1
    r0 = math.sqrt((w0.sx - b0) * (w0.sx - b0) + w0.sy * w0.sy)
    r1 = math.sqrt((w1.sx - c1) * (w1.sx - c1) + w1.sy * w1.sy)
    width, d0, d1 = c1 - b0, r0 + w0.sigma, r1 + w1.sigma
    difference = d0 - d1
    spare = (width - difference) * (width + difference)
    if spare <= 0.0 or r0 <= 0.0 or r1 <= 0.0:
        return False, 0.0, 0.0, 0.0
    reach0 = visibility((w0.sx - b0) / r0, width, difference, spare)
    reach1 = visibility((c1 - w1.sx) / r1, width, -difference, spare)
    sigma = least_sigma(d0, d1, reach0, reach1)
    r0, r1 = d0 - sigma, d1 - sigma
    if r0 <= 0.0 or r1 <= 0.0:
        return False, 0.0, 0.0, 0.0
    along = continuity(width, r0, r1)
    height = directionality(along, r0)
    if height < 0.0:
        return False, 0.0, 0.0, 0.0
    return True, b0 + along, -math.sqrt(height), sigma


@inlined
def may_merge(wave: View, w0: Window, w1: Window, nearest: float) -> bool:
    """Whether two windows may be accurate enough as one, for ``nearest`` as in `accuracy`.

    Half of all pairs fail here already, before the conic costs anything.
    """
    if not accuracy(wave, max(w0.xi, w1.xi), 0.0, nearest):
        return False
    d0, d1 = distance_at(w0, w0.b0), distance_at(w1, w1.b1)
    meets = min(distance_at(w0, w0.b1), distance_at(w1, w1.b0))
    chord = d0 + (d1 - d0) * (w0.b1 - w0.b0) / (w1.b1 - w0.b0)  # nowhere below the merged window
    return accuracy(wave, meets - chord, meets - chord, nearest)


@inlined
def merged(wave: View, w0: Window, w1: Window) -> tuple[bool, Window]:
    """Merge w0 and w1, which meet or overlap; return whether they can be, and the merged window.

    Its root and reference are those of w0.
    """
    ends = min(distance_at(w0, w0.b0), distance_at(w1, w1.b1))
    if not may_merge(wave, w0, w1, ends):
        return False, w0
    exists, sx, sy, sigma = pseudosource_between(w0, w1)
    if not exists:
        return False, w0
    whole = changed(w0, w0.b0, w1.b1, sx, sy, sigma, 0.0, w0.reference)
    # The distances at the ends are kept; where the windows meet, and at the stationary points,
    # they are not.
    meets0 = distance_at(w0, w0.b1) - distance_at(whole, w0.b1)
    meets1 = distance_at(w1, w1.b0) - distance_at(whole, w1.b0)
    if min(meets0, meets1) < -LOWER_BOUND * ends:
        return False, w0
    nearest = distance_at(whole, min(max(sx, w0.b0), w1.b1))
    if not accuracy(wave, max(w0.xi + meets0, w1.xi + meets1), max(meets0, meets1), nearest):
        return False, w0
    most0 = max(meets0, shortfall(w0, whole))
    most1 = max(meets1, shortfall(w1, whole))
    xi = max(w0.xi + most0, w1.xi + most1)
    if not accuracy(wave, xi, max(most0, most1), nearest):
        return False, w0
    return True, changed(w0, w0.b0, w1.b1, sx, sy, sigma, xi, w0.reference)
