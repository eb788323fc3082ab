"""The pruned search: which part of the surface a path may pass, and what a search has touched (5).

A point p may be on a path from the start, of length U at most, only where L(p) + D(p) <= U for its
distance D from where the sweep began and a lower bound L of the rest. L is known at vertices;
elsewhere on an edge it is what the nearer ends leave. Windows are dropped by it where the filter of
Xin and Wang drops them, in `propagate.collect`: at both ends of a list, where the bound's slope
gathers all that it finds.
"""

import math
from typing import Any

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import PINCHED, SEAM, TAIL
from geodesic_core.kernels.sweep.state import (
    COUNTERS,
    ENTRY_EDGE,
    FACE,
    FAR,
    FREE_FIRST,
    LANDMARKS,
    LIGHT,
    LIST,
    LIT_FROM,
    LIT_TO,
    MARKS,
    NODE,
    PREDECESSOR,
    SENT_AT,
    SENT_FROM,
    SENT_TO,
    SITE,
    SIZE,
    TOUCHED,
    WINNER,
    merging,
    view_of,
)
from geodesic_core.tolerances import LANDMARK_ERROR

# Stored distances from landmarks are lower bounds, rounded to single precision.
LEAST = 1.0 - 1e-6
MOST = (1.0 + 1e-6) / (1.0 - LANDMARK_ERROR)


@kernel
def touch(wave: Any, v: int) -> None:
    """Note that v is no longer as it was at first, and bound the rest of a path from it."""
    wave.touched[wave.counters[TOUCHED]] = v
    wave.counters[TOUCHED] += 1
    if wave.pruned:
        wave.heuristic[v] = lower_bound_to_target(wave, v)


@kernel
def lower_bound_to_target(wave: Any, v: int) -> float:
    """Lower bound of the distance from v to where a path is to end.

    What an earlier sweep from there knows of v counts up to its ceiling. Had it pruned the path to
    v at a point q, then D(q) + L(q) would exceed the ceiling, and so D(v) + L'(v), where L' is a
    bound that no L exceeds by more than the way from v to it: the steepest.
    """
    straight = straight_to_start(wave, v)
    if wave.knows:
        return min(wave.known[v], wave.ceiling - steepest_to_start(wave, v, straight))
    return least_to_start(wave, v, straight)


@inlined
def straight_to_start(wave: Any, v: int) -> float:
    """Euclidean distance from v to the start."""
    x = wave.positions[3 * v] - wave.start[0]
    y = wave.positions[3 * v + 1] - wave.start[1]
    z = wave.positions[3 * v + 2] - wave.start[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def least_to_start(wave: Any, v: int, straight: float) -> float:
    """Lower bound of the distance from v to the start: straight, or by a landmark.

    The exact distance from a landmark is known to be from LEAST to MOST times the stored one. A
    landmark of another component tells nothing.
    """
    least = straight
    for i in range(wave.landmark_count):
        if wave.least[i] == math.inf:
            continue
        here = wave.landmarks[LANDMARKS * v + i]
        bound = max(LEAST * here - wave.most[i], wave.least[i] - MOST * here)
        if bound > least:
            least = bound
    return least


@kernel
def steepest_to_start(wave: Any, v: int, straight: float) -> float:
    """Return what `least_to_start`, at any point q, exceeds by the distance of v and q at most."""
    steepest = straight
    for i in range(wave.landmark_count):
        if wave.least[i] == math.inf:
            continue
        here = wave.landmarks[LANDMARKS * v + i]
        bound = max(MOST * here - wave.most[i], wave.least[i] - LEAST * here)
        if bound > steepest:
            steepest = bound
    return steepest


@inlined
def may_pass(wave: Any, v: int) -> bool:
    """Whether a path of allowed length may pass v at its distance."""
    return not wave.pruned or wave.distance[v] + wave.heuristic[v] <= wave.limit


@kernel
def forget(topology: Any, wavefront: Any, bounds: Any) -> None:
    """Set the wavefront back to how it was at first, in time proportional to what was touched."""
    wave = view_of(topology, wavefront, bounds)
    for i in range(wave.counters[TOUCHED]):
        v = wave.touched[i]
        wave.distance[v] = math.inf
        wave.winner_ints[WINNER * v + ENTRY_EDGE] = -1
        wave.winner_ints[WINNER * v + PREDECESSOR] = -1
        wave.status[v] = FAR
        wave.heap_place[v] = -1
        if merging(wave):
            wave.upper[v] = math.inf
            wave.reference[v] = -1
            row = LIGHT * v
            wave.light[row + LIT_FROM], wave.light[row + LIT_TO] = 1.0, -1.0
            wave.light[row + SENT_FROM], wave.light[row + SENT_TO] = 1.0, -1.0
            wave.light[row + SENT_AT] = math.inf
        for c in range(wave.first_corner[v], wave.first_corner[v + 1]):
            # Windows lie only on faces of vertices that were touched.
            face = wave.corners[c] // 3
            for h in range(3 * face, 3 * face + 3):
                wave.lists[LIST * h + SIZE] = 0
                wave.lists[LIST * h + MARKS] = 0
                if wave.flags[v] & (SEAM | PINCHED):
                    wave.passed[h] = -1
                if merging(wave):
                    wave.runs[h] = 0
    for k in range(wave.site_count):
        node, face = wave.site_ints[SITE * k + NODE], wave.site_ints[SITE * k + FACE]
        wave.distance[node] = math.inf
        wave.winner_ints[WINNER * node + ENTRY_EDGE] = -1
        wave.winner_ints[WINNER * node + PREDECESSOR] = -1
        if merging(wave):
            wave.reference[node] = -1
        for h in range(3 * face, 3 * face + 3):
            wave.lists[LIST * h + MARKS] = 0
    for i in range(COUNTERS):
        wave.counters[i] = 0
    wave.counters[FREE_FIRST] = -1


@kernel
def mark_visited(topology: Any, distance: Floats, touched: Ints, visited: Flags) -> None:
    """Mark the faces, in the caller's numbering, all of whose corners have been reached."""
    for v in touched:
        for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
            face = topology.corners[c] // 3
            reached = True
            for h in range(3 * face, 3 * face + 3):
                reached = reached and distance[topology.links[h, TAIL]] < math.inf
            if reached:
                visited[topology.outer_face[face]] = 1
