"""Relaxation of vertices: least distances, and in a merging sweep their bounds and their light."""

import math

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.directions import note_direction
from geodesic_core.kernels.front.pruning import touch
from geodesic_core.kernels.front.queues import push_or_raise
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    FAR,
    LIGHT,
    LIT_FROM,
    LIT_TO,
    PREDECESSOR,
    SETTLED,
    WINNER,
    View,
    merging,
)
from geodesic_core.kernels.front.window import Window
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX_ANGLE,
    BOUNDARY,
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    PINCHED,
    ROW,
    SIN_LEFT,
)
from geodesic_core.tolerances import SLACK, TIE


@inlined
def precedence(distance: float, source: int, known: float, known_source: int) -> bool:
    """Whether a distance from one source goes before that from another: ties to the lower."""
    if source == known_source or known == math.inf or abs(distance - known) > TIE * known:
        return distance < known
    return source < known_source


@inlined
def record_winner(wave: View, node: int, via: int, sx: float, sy: float, root: int) -> None:
    """Note the window that wins a node: it crossed ``via``, from its pseudosource at (sx, sy)."""
    vertices = wave.vertices
    vertices.winner[2 * node], vertices.winner[2 * node + 1] = sx, sy
    vertices.winner_ints[WINNER * node + ENTRY_EDGE] = via
    vertices.winner_ints[WINNER * node + PREDECESSOR] = root
    vertices.source_index[node] = vertices.source_index[root]


@inlined
def relax_node(wave: View, node: int, distance: float, via: int, window: Window) -> None:
    """Offer a node a distance and the window that gives it; queue a vertex if it is the least.

    Of equal distances that of the lower source wins. Modifies the node and the heap.
    """
    vertices, is_vertex, root = wave.vertices, node < wave.sizes.vertices, window.root
    known = vertices.distance[node]
    if not precedence(distance, vertices.source_index[root], known, vertices.source_index[node]):
        return
    if is_vertex and vertices.status[node] == FAR:
        touch(wave, node)
    record_winner(wave, node, via, window.sx, window.sy, root)
    if merging(wave):
        vertices.reference[node] = window.reference
    note_direction(wave, node, window)
    vertices.distance[node] = distance
    if is_vertex and distance < known:
        push_or_raise(wave.queues, wave.counters, node, distance)


@kernel
def bound_vertex(wave: View, v: int, upper: float) -> None:
    """Note an upper bound of the exact distance of v. Modifies the bound and the light of v."""
    vertices = wave.vertices
    if upper < vertices.upper[v]:
        if (
            upper < vertices.distance[v]
        ):  # whatever reached v so far comes too late for a shortest path
            vertices.light[LIGHT * v + LIT_FROM], vertices.light[LIGHT * v + LIT_TO] = (
                1.0,
                -1.0,
            )
        vertices.upper[v] = upper


@kernel
def illuminate_vertex(
    wave: View, v: int, distance: float, via: int, sx: float, sy: float, sw: float
) -> None:
    """Note the direction in which v sees a pseudosource that reaches it at ``distance``.

    Where windows are merged, the winner's direction need not be that of the exact path: all that
    may be, by the upper bound, make a range. A vertex that has emitted its windows and sees it
    widen is queued again.
    """
    mesh, vertices = wave.mesh, wave.vertices
    if distance > vertices.upper[v] * (1.0 + SLACK):
        return
    angle = incoming_angle(wave, via, sx, sy, sw)
    row = LIGHT * v
    lo, hi = vertices.light[row + LIT_FROM], vertices.light[row + LIT_TO]
    if lo > hi:
        lo, hi = angle, angle
    else:
        if not mesh.flags[v] & (BOUNDARY | PINCHED):  # around a tip there may be no angle at all
            turn = mesh.total_angle[v]
            angle -= turn * math.floor((angle - 0.5 * (lo + hi)) / turn + 0.5)
        if lo <= angle <= hi:
            return
        lo, hi = min(lo, angle), max(hi, angle)
    vertices.light[row + LIT_FROM], vertices.light[row + LIT_TO] = lo, hi
    if vertices.status[v] == SETTLED:
        push_or_raise(wave.queues, wave.counters, v, vertices.distance[v])


@kernel
def incoming_angle(wave: View, via: int, sx: float, sy: float, sw: float) -> float:
    """Angle, in its unfolded fan, at which the apex of a half-edge sees a pseudosource.

    The pseudosource is at (sx, sy, sw) in the frame of the half-edge ``via``.
    """
    mesh = wave.mesh
    row = ROW * via
    # From the apex: toward the tail, and toward the pseudosource
    ex = -mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
    ey = -mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
    hx = ex + mesh.geometry[row + LENGTH]
    dx, dy = sx + sw * ex, sy + sw * ey
    if hx * dy - ey * dx > 0.0:  # beyond the head
        dx, dy = hx, ey
    turn = math.atan2(ex * dy - ey * dx, ex * dx + ey * dy)
    start: float = mesh.geometry[row + APEX_ANGLE]
    return start + max(turn, 0.0)


@kernel
def nearest_sources(distance: Floats, winner_ints: Ints, source_index: Ints) -> Ints:
    """Return for each node at a finite distance the index of its source; for others -1.

    Follow pseudosources to the source at the end of the sweep, since one may have changed its own
    source after it emitted. O(N).
    """
    result = np.full(len(distance), -1, np.int32)
    if not source_index.any():  # there is one source, and no chain to follow
        for v in range(len(distance)):
            if distance[v] < math.inf:
                result[v] = 0
        return result
    for start in range(len(distance)):
        if distance[start] == math.inf:
            continue
        v = start
        while result[v] < 0 and winner_ints[v, ENTRY_EDGE] >= 0:
            v = winner_ints[v, PREDECESSOR]
        found = result[v] if result[v] >= 0 else source_index[v]
        v = start
        while result[v] < 0:
            result[v] = found
            v = winner_ints[v, PREDECESSOR]
    return result
