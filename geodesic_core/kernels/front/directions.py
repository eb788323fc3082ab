"""Directions in which shortest paths leave their source, carried by the windows of a sweep.

Every source has a frame. At a vertex, angles count counter-clockwise in its unfolded fan, from
where that begins; in a face, from its first half-edge; on an edge, from the half-edge of its first
face, and each further face has the half turn that follows.

The *turn* of a half-edge is the angle of its x axis in the frame of the source, unfolded along a
window. A ray at polar angle φ leaves the source at turn + φ, or at turn - φ where the half-edge is
seen in the mirror. A turn is right as it is, not modulo 2π: the fan of a vertex may have another
total angle. Windows lit by a source itself have a turn. Behind a bend all rays leave the source as
the path to the bend does, which predecessors tell after the sweep. To carry a vector through a
bend, the sweep gives windows from there a turn as well, in the frame of the bend.
"""

import math

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    FACE,
    NODE,
    PREDECESSOR,
    SITE,
    WIDTH,
    WINNER,
    Sites,
    Vertices,
    View,
    directed,
    mirrors,
)
from geodesic_core.kernels.front.window import TURN, Window, turned
from geodesic_core.kernels.jit import borrowed, inlined, kernel, pointers
from geodesic_core.kernels.mesh.build import angle_of
from geodesic_core.kernels.mesh.half_edges import (
    APEX_ANGLE,
    COS_LEFT,
    COS_RIGHT,
    LENGTH_LEFT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    weights_in_frame,
)


@inlined
def left_angle(geometry: Floats, h: int) -> float:
    """Angle at the tail of a half-edge."""
    return angle_of(geometry[ROW * h + COS_LEFT], geometry[ROW * h + SIN_LEFT])


@inlined
def right_angle(geometry: Floats, h: int) -> float:
    """Angle at the head of a half-edge."""
    return angle_of(geometry[ROW * h + COS_RIGHT], geometry[ROW * h + SIN_RIGHT])


@inlined
def turn_at_tail(geometry: Floats, h: int) -> float:
    """Turn of h where its tail is the source."""
    turn: float = geometry[ROW * following(h) + APEX_ANGLE]
    return turn


@kernel
def turn_across_face(geometry: Floats, h: int) -> float:
    """Turn across the edge from the head of h to its apex, where the tail of h is the source."""
    return turn_at_tail(geometry, h) - right_angle(geometry, h)


@kernel
def turns_at_site(geometry: Floats, sites: Sites, k: int, h: int) -> tuple[float, float]:
    """Return the turns of h, in the face of the site of row k, the source, and across h."""
    base, turn = h - h % 3, 0.0
    for i in range(3):
        if sites.weights[3 * k + i] == 0.0:  # on the edge opposite to corner i
            base = h - h % 3 + (i + 1) % 3
    first = k
    while first > 0 and sites.ints[SITE * (first - 1) + NODE] == sites.ints[SITE * k + NODE]:
        first -= 1
        turn += math.pi
    if h == base:
        return turn, turn + math.pi
    if h == following(base):
        turn -= right_angle(geometry, base)
        return turn + math.pi, turn
    turn += left_angle(geometry, base)
    return turn - math.pi, turn


@inlined
def lit_from_vertex(wave: View, window: Window, v: int, h: int) -> Window:
    """Return a window from vertex v, the tail of h, with its turn if it carries one.

    It lies on the far edge of the face of h.
    """
    if directed(wave):
        is_source = wave.vertices.winner_ints[WINNER * v + ENTRY_EDGE] < 0
        if is_source or wave.bounds.directed_from_bends:
            return turned(window, turn_across_face(wave.mesh.geometry, h), 0)
    return window


@inlined
def lit_from_site(wave: View, window: Window, k: int, h: int) -> Window:
    """Return a window from the site of row k over edge h of its face, with its turn."""
    if directed(wave):
        return turned(window, turns_at_site(wave.mesh.geometry, wave.sites, k, h)[1], 0)
    return window


@inlined
def turns_to_sides(wave: View, h: int, count: int) -> tuple[float, float]:
    """Return the turns of the left and of the right edge of a face against h; 0 if not needed.

    ``count`` windows of scratch are about to cross the face: most often none is lit by a source.
    """
    is_lit = False
    if directed(wave):
        for i in range(count):
            turn = wave.pool.scratch[WIDTH * i + TURN]
            is_lit = is_lit or turn == turn
    if not is_lit:
        return 0.0, 0.0
    return left_angle(wave.mesh.geometry, h), -right_angle(wave.mesh.geometry, h)


@inlined
def turned_by(window: Window, turn: float) -> Window:
    """Return the window in a frame that is turned against its own, counter-clockwise."""
    return turned(
        window, window.turn - turn if window.mirrored else window.turn + turn, window.mirrored
    )


@inlined
def seen_in_mirror(wave: View, window: Window) -> Window:
    """Return the window, which `reversed_window` turned over, with its turn there."""
    if mirrors(wave):
        over = turned_by(window, math.pi)
        return turned(over, over.turn, 1 - over.mirrored)
    return window


@inlined
def note_direction(wave: View, node: int, window: Window) -> None:
    """Note at a node the turn of the window by which it is reached. Modifies the node."""
    if directed(wave):
        wave.vertices.turn[node], wave.vertices.mirrored[node] = window.turn, window.mirrored


@kernel
def row_of_site(sites: Sites, node: int, face: int) -> int:
    """Return the row of a site in one of its faces."""
    for k in range(len(sites.ints)):
        if sites.ints[k, NODE] == node and sites.ints[k, FACE] == face:
            return k
    return -1


@inlined
def straight_angle(topology: Topology, vertices: Vertices, sites: Sites, v: int) -> float:
    """Return the angle at which the last leg of the path to node v leaves its predecessor.

    That is a source, or a bend if the sweep carries directions from there.
    """
    geometry, site_rows = pointers(topology.geometry), pointers(sites)
    h, source = vertices.winner_ints[v, ENTRY_EDGE], vertices.winner_ints[v, PREDECESSOR]
    x = geometry[ROW * h + COS_LEFT] * geometry[ROW * h + LENGTH_LEFT]
    y = geometry[ROW * h + SIN_LEFT] * geometry[ROW * h + LENGTH_LEFT]
    if v >= len(topology.total_angle):
        x, y = weights_in_frame(geometry, site_rows.weights, 3 * row_of_site(sites, v, h // 3), h)
    turn = vertices.turn[v]
    if math.isnan(turn):  # the path crosses no edge
        if source >= len(topology.total_angle):
            turn = turns_at_site(geometry, site_rows, row_of_site(sites, source, h // 3), h)[0]
        elif topology.links[h, TAIL] == source:
            turn = turn_at_tail(geometry, h)
        else:
            turn = turn_at_tail(geometry, following(h)) + right_angle(geometry, h) - math.pi
    direction = math.atan2(y - vertices.winner[v, 1], x - vertices.winner[v, 0])
    return turn - direction if vertices.mirrored[v] else turn + direction


@kernel
def angles_at_sources(topology: Topology, vertices: Vertices, sites: Sites) -> tuple[Floats, Ints]:
    """Return the angles at which shortest paths leave their source, and how often they bend.

    (N,) radians in the frame of the source, by node; NaN where unreached, and at a source. (N,)
    numbers of bends, -1 where unreached. O(N).
    """
    topology, vertices, sites = borrowed(topology), borrowed(vertices), borrowed(sites)
    count = len(vertices.distance)
    angles, bends = np.full(count, np.nan), np.full(count, -1, np.int32)
    chain = np.empty(count, np.int32)
    for start in range(count):
        if vertices.distance[start] == math.inf:
            continue
        v, size = start, 0
        while bends[v] < 0 and vertices.winner_ints[v, ENTRY_EDGE] >= 0:
            chain[size] = v
            size += 1
            v = vertices.winner_ints[v, PREDECESSOR]
        bends[v] = max(bends[v], 0)
        for i in range(size - 1, -1, -1):
            v, root = chain[i], vertices.winner_ints[chain[i], PREDECESSOR]
            if vertices.winner_ints[root, ENTRY_EDGE] < 0:
                angles[v], bends[v] = straight_angle(topology, vertices, sites, v), 0
            else:
                angles[v], bends[v] = angles[root], bends[root] + 1
    return angles, bends


@kernel
def angles_of_legs(topology: Topology, vertices: Vertices, sites: Sites) -> tuple[Floats, Floats]:
    """Return the angles at both ends of the straight last leg of the path to each vertex.

    (N,) radians by node, at which the leg leaves its source or bend, and at which it is seen from
    the vertex; NaN where unreached, and at sources. The sweep carries directions from bends. O(N).
    """
    topology, vertices, sites = borrowed(topology), borrowed(vertices), borrowed(sites)
    count = len(vertices.distance)
    leaving, arriving = np.full(count, np.nan), np.full(count, np.nan)
    for v in range(len(topology.total_angle)):
        if vertices.distance[v] < math.inf and vertices.winner_ints[v, ENTRY_EDGE] >= 0:
            leaving[v] = straight_angle(topology, vertices, sites, v)
            arriving[v] = angle_back(topology, vertices, v)
    return leaving, arriving


@kernel
def angle_back(topology: Topology, vertices: Vertices, v: int) -> float:
    """Return the angle, in the fan of vertex v, of the way back along the path that reached it."""
    geometry, h = topology.geometry, vertices.winner_ints[v, ENTRY_EDGE]  # v is its apex
    ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
    ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
    dx, dy = ax - vertices.winner[v, 0], ay - vertices.winner[v, 1]
    turn = math.atan2(ax * dy - ay * dx, ax * dx + ay * dy)
    return float(geometry[h, APEX_ANGLE]) + max(turn, 0.0)
