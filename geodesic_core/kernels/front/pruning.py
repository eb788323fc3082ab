"""Pruning of a search between two points: lower bounds, and resetting of touched state (5).

A point p may be on a path from the start, of length U at most, only where L(p) + D(p) <= U for its
distance D from where the sweep began and a lower bound L of the rest. L is known at vertices;
elsewhere on an edge it follows from the nearer end. Windows are dropped by it where the filter of
Xin and Wang drops them, in `trim_list`: at both ends of a list, where the bound's slope gathers
all that it finds.
"""

import math

from geodesic_core.arrays import Flags, Floats, Ints, Singles
from geodesic_core.kernels.front.bounds import LANDMARKS
from geodesic_core.kernels.front.counters import COUNTERS, FAR_FIRST, FREE_FIRST, TOUCHED
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    FACE,
    FAR,
    IN_RING,
    LIT_FROM,
    LIT_TO,
    MARKS,
    NODE,
    PREDECESSOR,
    RETAINED,
    SEEN,
    SENT_AT,
    SENT_FROM,
    SENT_TO,
    SIZE,
    View,
    Wavefront,
    is_pruned,
)
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import PINCHED, SEAM, TAIL, Topology
from geodesic_core.tolerances import LANDMARK_ERROR, SINGLE_PRECISION

# Stored distances from landmarks are lower bounds, rounded to single precision.
LEAST = 1.0 - SINGLE_PRECISION
MOST = (1.0 + SINGLE_PRECISION) / (1.0 - LANDMARK_ERROR)


@kernel
def touch(wave: View, v: int) -> None:
    """Note that v is no longer in its first state, and bound the rest of a path from it.

    Modifies the list of touched vertices, the status of v and the heuristic.
    """
    vertices = wave.vertices
    vertices.status[v] = SEEN
    vertices.touched[wave.counters[TOUCHED]] = v
    wave.counters[TOUCHED] += 1
    if is_pruned(wave):
        vertices.heuristic[v] = lower_bound_to_target(wave, v)


@kernel
def lower_bound_to_target(wave: View, v: int) -> float:
    """Lower bound of the distance from v to the end of a path.

    The value of an earlier sweep from there counts up to its ceiling. Had it pruned the path to
    v at a point q, then D(q) + L(q) would exceed the ceiling, and so D(v) + L'(v), where L' is a
    bound that no L exceeds by more than the way from v to it: the steepest.
    """
    straight = straight_to_start(wave, v)
    if wave.sizes.known > 0:
        return min(
            wave.bounds.pruning.known[v],
            wave.bounds.pruning.ceiling - steepest_to_start(wave, v, straight),
        )
    return least_to_start(wave, v, straight)


@inlined
def straight_to_start(wave: View, v: int) -> float:
    """Euclidean distance from v to the start."""
    positions, start = wave.bounds.pruning.positions, wave.bounds.pruning.position
    x = positions[3 * v] - start[0]
    y = positions[3 * v + 1] - start[1]
    z = positions[3 * v + 2] - start[2]
    return math.sqrt(x * x + y * y + z * z)


@inlined
def least_to_start(wave: View, v: int, straight: float) -> float:
    """Lower bound of the distance from v to the start: straight, or by a landmark.

    The exact distance from a landmark is known to be from LEAST to MOST times the stored one.
    """
    return most_by_landmarks(wave, v, straight, LEAST, MOST)


@inlined
def steepest_to_start(wave: View, v: int, straight: float) -> float:
    """Bound of `least_to_start` at any point q, less the distance of v and q."""
    return most_by_landmarks(wave, v, straight, MOST, LEAST)


@kernel
def most_by_landmarks(wave: View, v: int, straight: float, beyond: float, behind: float) -> float:
    """Return the most of ``straight`` and of what each landmark tells of the way to the start.

    The stored distance of v counts ``beyond`` times where the landmark lies beyond the start, and
    ``behind`` times where it lies behind v. A landmark of another component tells nothing.
    """
    pruning, most = wave.bounds.pruning, straight
    for i in range(pruning.landmark_count):
        if pruning.least[i] == math.inf:
            continue
        here = pruning.landmarks[LANDMARKS * v + i]
        most = max(most, beyond * here - pruning.most[i], pruning.least[i] - behind * here)
    return most


@kernel
def bound_landmarks(
    landmarks: Singles, count: int, corners: Ints, reaches: Floats, least: Floats, most: Floats
) -> None:
    """Bound the distances of a point from landmarks; it is ``reaches`` away from its ``corners``.

    Modifies ``least`` and ``most``, the first ``count`` of each.
    """
    for i in range(count):
        least[i], most[i] = -math.inf, math.inf
        for k in range(len(corners)):
            here = landmarks[corners[k], i]
            least[i] = max(least[i], LEAST * here - reaches[k])
            most[i] = min(most[i], MOST * here + reaches[k])


@inlined
def may_pass(wave: View, v: int) -> bool:
    """Whether a path of allowed length may pass v at its distance."""
    vertices = wave.vertices
    return (
        not is_pruned(wave)
        or vertices.distance[v] + vertices.heuristic[v] <= wave.bounds.pruning.limit
    )


@kernel
def forget(topology: Topology, wavefront: Wavefront) -> None:
    """Reset the wavefront to its first state, in time proportional to vertices touched, and sites.

    What it is to retain stays marked.

    Modifies the wavefront.
    """
    pool, vertices, sites = wavefront.pool, wavefront.vertices, wavefront.sites
    merges = len(vertices.upper) > 0
    forget_vertices(topology, wavefront)
    for k in range(len(sites.ints)):
        node, face = sites.ints[k, NODE], sites.ints[k, FACE]
        vertices.distance[node] = math.inf
        vertices.winner_ints[node, ENTRY_EDGE] = vertices.winner_ints[node, PREDECESSOR] = -1
        if merges:
            vertices.reference[node] = -1
        for h in range(3 * face, 3 * face + 3):
            pool.lists[h, MARKS] &= RETAINED
    for k in range(len(sites.segment_ints)):
        node = sites.segment_ints[k, NODE]
        vertices.distance[node] = math.inf
        vertices.winner_ints[node, ENTRY_EDGE] = vertices.winner_ints[node, PREDECESSOR] = -1


@kernel
def forget_vertices(topology: Topology, wavefront: Wavefront) -> None:
    """Reset the wavefront, but for sites and segments. O(vertices touched).

    Sites to reach stay marked as well. Modifies the wavefront.
    """
    pool, vertices = wavefront.pool, wavefront.vertices
    merges = len(vertices.upper) > 0
    for i in range(wavefront.counters[TOUCHED]):
        v = vertices.touched[i]
        vertices.distance[v] = math.inf
        vertices.winner_ints[v, ENTRY_EDGE] = vertices.winner_ints[v, PREDECESSOR] = -1
        vertices.status[v] = FAR
        wavefront.queues.heap_place[v] = -1
        if merges:
            vertices.upper[v] = math.inf
            vertices.reference[v] = -1
            vertices.light[v, LIT_FROM], vertices.light[v, LIT_TO] = 1.0, -1.0
            vertices.light[v, SENT_FROM], vertices.light[v, SENT_TO] = 1.0, -1.0
            vertices.light[v, SENT_AT] = math.inf
        for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
            # Windows lie only on faces of vertices that were touched.
            face = topology.corners[c] // 3
            for h in range(3 * face, 3 * face + 3):
                pool.lists[h, SIZE] = 0
                pool.lists[h, MARKS] &= ~IN_RING
                if topology.flags[v] & (SEAM | PINCHED):
                    pool.crossings[h] = -1
                pool.runs[h] = 0
    for i in range(COUNTERS):
        wavefront.counters[i] = 0
    wavefront.counters[FREE_FIRST] = wavefront.counters[FAR_FIRST] = -1


@kernel
def mark_visited(topology: Topology, distance: Floats, touched: Ints, visited: Flags) -> None:
    """Mark the faces, in the caller's numbering, all of whose corners are reached.

    Modifies ``visited`` (F,).
    """
    for v in touched:
        for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
            face = topology.corners[c] // 3
            reached = True
            for h in range(3 * face, 3 * face + 3):
                reached = reached and distance[topology.links[h, TAIL]] < math.inf
            if reached:
                visited[topology.outer_face[face]] = 1
