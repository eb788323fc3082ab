"""Shortest paths from a finished sweep (section 3.5).

Each vertex keeps its winning window: the half-edge it came over, the unfolded pseudosource and the
pseudosource's id. A path is walked from vertex to pseudosource by unfolding the faces on the line
between them; at a pseudosource it turns toward that vertex's own winner. This copy replaces the
paper's walk around the pseudosource in search of a window, and with it every window list
(section 7).

Merged windows have no true pseudosource. Where the path crosses the edge on which two were merged,
it turns toward the pseudosource of the one that it meets there (section 4.3): it is a path on the
surface, no shorter than the exact one, and longer than the field says by ξ at most.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import kernel, pointer
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    AROUND,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OPPOSITE,
    PINCHED,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
    point_in_frame,
    previous,
)
from geodesic_core.kernels.sweep.segments import distance_to_segment, is_segment
from geodesic_core.kernels.sweep.state import (
    ENTRY_EDGE,
    FACE,
    LEFT,
    LEFT_REFERENCE,
    MERGED_ON,
    NODE,
    PREDECESSOR,
    RIGHT,
    RIGHT_REFERENCE,
    SPLIT,
)
from geodesic_core.tolerances import GAP, ON_PATH, SAME_PLACE, WIDEST_ERROR


class Winners(NamedTuple):
    """What a finished sweep leaves for backtracing: arrays of its `Wavefront`, and one more."""

    nearest: Ints
    """(N,): index of the nearest source, by node; -1 where unreached"""
    distance: Floats
    winner: Floats
    winner_ints: Ints
    reference: Ints
    merges: Floats
    merge_ints: Ints
    site_ints: Ints
    site_weights: Floats
    piece_ints: Ints
    piece_ends: Floats


# Outcomes
TRACED = 0
NO_ROOM = 1  # the path has more points than the arrays hold: grow, and call again
LOST = 2  # the line left the surface: a defect

TRIES = 64
"""How many edges a straight piece is tried over, per point of the longest path, before it is lost.

Sheets upon each other, around a sharp tip, can be gone through in more ways than time allows.
"""

FORKS = 64
"""Irregular edges on a straight piece where other faces are still to be tried, at most."""


@kernel
def cross_edge(
    x: float, sx: float, sy: float, sw: float, length: float, cosine: float, sine: float
) -> tuple[float, float, float]:
    """Walk from (x, 0) toward s, of weight sw, and out over the left edge of a face.

    Returns the exit's distance from the tail and s in the frame of that edge, whose own face is
    ahead again (y > 0).
    """
    along, ahead = sx * cosine + sy * sine, sy * cosine - sx * sine
    ex, ey = x * cosine, -x * sine
    if ahead <= 0.0:  # within rounding, s lies on the edge's line, or before it
        return min(max(along, 0.0), length), along, ahead
    u = ex - (along - sw * ex) * ey / (ahead - sw * ey)
    return min(max(u, 0.0), length), along, ahead


@kernel
def leave(
    geometry: Floats,
    h: int,
    x: float,
    sx: float,
    sy: float,
    sw: float,
    is_left: bool,
) -> tuple[int, float, float, float, float]:
    """Walk from (x, 0) on h toward s, out over the left or the right edge of the face.

    Returns that half-edge, the exit in its frame, s in the same, behind it, and how far it was.
    """
    if is_left:
        m, side = previous(h), geometry[h, LENGTH_LEFT]
        cosine, sine = geometry[h, COS_LEFT], geometry[h, SIN_LEFT]
    else:  # the same, in the mirror
        m, side = following(h), geometry[h, LENGTH_RIGHT]
        cosine, sine = geometry[h, COS_RIGHT], geometry[h, SIN_RIGHT]
        x, sx = geometry[h, LENGTH] - x, sw * geometry[h, LENGTH] - sx
    u, sx, sy = cross_edge(x, sx, sy, sw, side, cosine, sine)
    step = math.hypot(u * cosine - x, u * sine)
    if is_left:
        u, sx = side - u, sw * side - sx
    return m, u, sx, -sy, step


@kernel
def put_fork(
    forks: Floats,
    fork_ints: Ints,
    i: int,
    m: int,
    x: float,
    sx: float,
    sy: float,
    walked: float,
    sigma: float,
    after: int,
    reference: int,
    count: int,
) -> None:
    """Note at i where a line may go on otherwise: over m, into the faces that follow ``after``."""
    forks[i, 0], forks[i, 1], forks[i, 2], forks[i, 3], forks[i, 4] = x, sx, sy, walked, sigma
    fork_ints[i, 0], fork_ints[i, 1] = m, after
    fork_ints[i, 2], fork_ints[i, 3] = reference, count


@kernel
def row_in_face(winners: Any, node: int, face: int) -> int:
    """Row of a site in a face; -1 where it is not in that face, or no site."""
    rows = len(winners.site_ints)
    if rows == 0 or node < winners.site_ints[0, NODE]:
        return -1
    for k in range(rows):
        if winners.site_ints[k, NODE] == node and winners.site_ints[k, FACE] == face:
            return k
    return -1


@kernel
def segment_in_face(winners: Any, node: int, face: int) -> int:
    """Row of a piece in a face; -1 where it is not in that face, or no piece."""
    if is_segment(winners.piece_ints, node):
        for k in range(len(winners.piece_ints)):
            if winners.piece_ints[k, NODE] == node and winners.piece_ints[k, FACE] == face:
                return k
    return -1


@kernel
def target_in_frame(topology: Any, winners: Any, node: int, h: int) -> tuple[float, float]:
    """Where the target lies in the frame of h: the apex, or a site in the face."""
    geometry = topology.geometry
    if node < len(topology.total_angle):
        reach = geometry[h, LENGTH_LEFT]
        return geometry[h, COS_LEFT] * reach, geometry[h, SIN_LEFT] * reach
    return point_in_frame(geometry, h, winners.site_weights[row_in_face(winners, node, h // 3)])


@kernel
def is_on_path(winners: Any, u: int, reach: float, here: float, target: int) -> bool:
    """Whether a path to ``target`` that is at distance ``here``, ``reach`` from u, meets u.

    A vertex that is nearest to another source may lie as near: the path goes on past it.
    """
    distance = winners.distance
    if winners.nearest[u] != winners.nearest[target]:
        return False
    allowed = here + ON_PATH * distance[target]
    return distance[u] + reach <= allowed and distance[u] < distance[target]


@kernel
def nearer_end(winners: Any, u: int, to_u: float, w: int, to_w: float, target: int) -> int:
    """End of a boundary edge over which a line that follows the boundary strays by rounding; or -1.

    The path goes on by that end which lies nearer to the source on the way.
    """
    distance = winners.distance
    end = u if distance[u] + to_u <= distance[w] + to_w else w
    return end if distance[end] < distance[target] else -1


@kernel
def unmerge(
    winners: Any, reference: int, h: int, x: float, sx: float, sy: float, sigma: float
) -> tuple[int, float, float, float]:
    """Undo the merges on h: the window that covered x; its reference, sx, sy and σ."""
    while reference >= 0 and winners.merge_ints[reference, MERGED_ON] == h:
        left = x <= winners.merges[reference, SPLIT]
        column = LEFT if left else RIGHT
        sx, sy = winners.merges[reference, column], winners.merges[reference, column + 1]
        sigma = winners.merges[reference, column + 2]
        reference = winners.merge_ints[reference, LEFT_REFERENCE if left else RIGHT_REFERENCE]
    return reference, sx, sy, sigma


@kernel
def next_face(links: Ints, m: int, after: int) -> tuple[int, bool]:
    """Half-edge across that of m, and whether it runs the same way; -1 if there is none.

    Across an irregular edge the first is returned, or that which follows ``after``.
    """
    if links[m, OPPOSITE] != IRREGULAR:
        return (links[m, OPPOSITE] if after < 0 else -1), False
    same, h, passed = True, m, after < 0
    while True:
        code = links[h, AROUND]
        h = code >> 1
        if code & 1 == 0:
            same = not same
        if h == m:
            return -1, False
        if passed:
            return h, same
        passed = h == after


@kernel
def trace_path(
    topology: Any,
    winners: Any,
    target: int,
    nodes: Ints,
    parameters: Floats,
    faces: Ints,
) -> tuple[int, int]:
    """Trace the path from node ``target`` to its source; return (outcome, number of nodes).

    A vertex on the way takes over with its own winner: a line through it may go on straight on
    either side only where it is flat. What is filled in is a half-edge h, crossed at ``parameters``
    of its length, or -1 - v for a vertex or site v. ``faces[i]`` is crossed between the nodes i and
    i + 1. O(faces crossed).
    """
    nodes[0], parameters[0] = -1 - target, 0.0
    count, v = 1, target
    while winners.winner_ints[v, ENTRY_EDGE] >= 0:
        outcome, count, v = trace_line(topology, winners, v, nodes, parameters, faces, count)
        if outcome != TRACED:
            return outcome, count
        if count >= len(nodes):
            return NO_ROOM, count
        nodes[count], parameters[count] = -1 - v, 0.0
        count += 1
    return TRACED, count


@kernel
def trace_line(
    topology: Any,
    winners: Any,
    v: int,
    nodes: Ints,
    parameters: Floats,
    faces: Ints,
    count: int,
) -> tuple[int, int, int]:
    """Trace the straight piece that ends at node v; return (outcome, nodes so far, its beginning).

    Across an irregular edge it is not known from which face the path came: the faces are tried in
    turn. Of several that lead to the pseudosource, straight and at the right distance, any will do.
    A wrong one is given up where a vertex is farther than the way to it would be.
    """
    links, geometry, distance = topology.links, topology.geometry, winners.distance
    m, root = winners.winner_ints[v, ENTRY_EDGE], winners.winner_ints[v, PREDECESSOR]
    sx, sy, sigma = winners.winner[v, 0], winners.winner[v, 1], 0.0
    reference = winners.reference[v] if len(winners.reference) > 0 else -1 - root
    if reference >= 0:
        root = -1  # not known before the merges are undone
    sw = 0.0 if is_segment(winners.piece_ints, root) else 1.0
    face, length = m // 3, geometry[m, LENGTH]
    ax, ay = target_in_frame(topology, winners, v, m)
    faces[count - 1] = face
    if row_in_face(winners, root, face) >= 0 or segment_in_face(winners, root, face) >= 0:
        return TRACED, count, root
    tail, head = links[m, TAIL], links[m, HEAD]
    if tail == root or is_on_path(winners, tail, math.hypot(ax, ay), distance[v], v):
        return TRACED, count, tail
    if head == root or is_on_path(winners, head, math.hypot(ax - length, ay), distance[v], v):
        return TRACED, count, head
    # From there back over m itself
    rise = sw * ay - sy
    x = (sx * ay - ax * sy) / rise if rise > 0.0 else sx
    x = min(max(x, 0.0), length)
    walked = math.hypot(ax - x, ay)
    sigma = distance[v] - walked  # of a strip, the distance at x
    if sw > 0.0:
        sigma -= math.hypot(sx - x, sy)
    # Where other faces may be tried: what was known there, and which one was the last
    forks, fork_ints = np.empty((FORKS, 5)), np.empty((FORKS, 4), np.int32)
    fork_count, after, milestone = 0, -1, count
    slack = (WIDEST_ERROR if len(winners.reference) > 0 else SAME_PLACE) * distance[v]
    for _ in range(TRIES * len(nodes)):
        # At (x, 0) on m, whose face lies ahead; the pseudosource is behind
        if reference >= 0:
            reference, sx, sy, sigma = unmerge(winners, reference, m, x, sx, sy, sigma)
            root = -1 - reference if reference < 0 else -1
        h, same = next_face(links, m, after)
        is_lost = h < 0
        if is_lost and after < 0 and fork_count == 0 and links[m, OPPOSITE] == NO_FACE:
            length = geometry[m, LENGTH]
            stop = nearer_end(winners, links[m, TAIL], x, links[m, HEAD], length - x, v)
            return (TRACED if stop >= 0 else LOST), count, stop
        if not is_lost:
            if links[m, OPPOSITE] == IRREGULAR and fork_count < FORKS:
                put_fork(
                    forks, fork_ints, fork_count, m, x, sx, sy, walked, sigma, h, reference, count
                )
                fork_count += 1
            length = geometry[m, LENGTH]
            sy = -sy
            if not same:
                x, sx = length - x, sw * length - sx
            if count >= len(nodes):
                return NO_ROOM, count, -1
            nodes[count], parameters[count], face = h, x / length, h // 3
            faces[count] = face
            # In a face that the path did not come from, a line may wind about a tip without end.
            milestone = min(milestone, count)
            is_wound = milestone < count and nodes[milestone] == h
            count += 1
            if count >= 2 * milestone:
                milestone = count - 1
            # At (x, 0) on h, its face and the pseudosource ahead
            apex = links[h, APEX]
            ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
            ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
            reach = math.sqrt((ax - x) * (ax - x) + ay * ay)
            rest = math.sqrt((sx - x) * (sx - x) + sy * sy) if sw > 0.0 else 0.0
            here = sigma + rest
            is_too_long = walked + here > distance[v] + slack
            is_wrong = is_wound or is_too_long or distance[apex] > here + reach + slack
            is_lost = fork_count > 0 and is_wrong
            if not is_lost:
                # The root may be in this face, but elsewhere, where the path did not come from it.
                most = rest if fork_count > 0 else math.inf
                if row_in_face(winners, root, face) >= 0:
                    px, py = target_in_frame(topology, winners, root, h)
                    if math.hypot(px - x, py) <= most * (1.0 + SAME_PLACE) + GAP * length:
                        return TRACED, count, root
                k = segment_in_face(winners, root, face)
                if k >= 0:
                    ends = pointer(winners.piece_ends)
                    off = distance_to_segment(pointer(geometry), ends, k, h, x, 0.0)
                    if fork_count == 0 or distance[root] + off <= sigma + SAME_PLACE * length:
                        return TRACED, count, root
                is_root = apex == root and reach <= most * (1.0 + SAME_PLACE) + GAP * length
                if is_root or is_on_path(winners, apex, reach, here, v):
                    return TRACED, count, apex
            ahead, aside = (ax - x) * sy, ay * (sx - sw * x)
            is_left = ahead >= aside  # s is left of the apex
            # In a face of no area rounding alone may say so.
            is_tie = abs(ahead - aside) <= GAP * (abs(ahead) + abs(aside))
            is_tie = topology.flags[apex] & PINCHED != 0 and (is_tie or reach <= GAP * length)
            if is_tie and not is_lost and fork_count < FORKS:
                g, u, ux, uy, step = leave(geometry, h, x, sx, sy, sw, not is_left)
                far, below = walked + step, sigma if sw > 0.0 else sigma - step
                put_fork(
                    forks, fork_ints, fork_count, g, u, ux, uy, far, below, -1, reference, count
                )
                fork_count += 1
            m, x, sx, sy, step = leave(geometry, h, x, sx, sy, sw, is_left)
            walked, left = walked + step, -sy  # how far the root is, at least
            if sw == 0.0:
                sigma -= step
                left = sigma - distance[root]
            # In a face that the path did not come from, the line ends where there is no root; or
            # before it meets the edge on which windows were merged. A root that lies on the edge
            # may be beyond, in a face of no area.
            is_due = reference >= 0 and winners.merge_ints[reference, MERGED_ON] == m
            close = SAME_PLACE * geometry[m, LENGTH]
            ends = left < -close or (sw > 0.0 and left <= close and rest <= close)
            is_lost = is_lost or (fork_count > 0 and not is_due and ends)
            after = -1
        if is_lost:
            if fork_count == 0:
                return LOST, count, -1
            fork_count -= 1
            x, sx = forks[fork_count, 0], forks[fork_count, 1]
            sy, walked, sigma = forks[fork_count, 2], forks[fork_count, 3], forks[fork_count, 4]
            m, after = fork_ints[fork_count, 0], fork_ints[fork_count, 1]
            reference, count = fork_ints[fork_count, 2], fork_ints[fork_count, 3]
            root = -1 - reference if reference < 0 else -1
    return LOST, count, -1
