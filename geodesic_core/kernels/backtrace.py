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

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.topology import (
    APEX,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    OPPOSITE,
    OUT_LEFT,
    OUT_RIGHT,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
)
from geodesic_core.kernels.wavefront import (
    FACE,
    FROM,
    LEFT,
    LEFT_REFERENCE,
    MERGED_ON,
    NODE,
    RIGHT,
    RIGHT_REFERENCE,
    SPLIT,
    VIA,
)
from geodesic_core.tolerances import ON_PATH


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


# Outcomes
TRACED = 0
NO_ROOM = 1  # the path has more points than the arrays hold: grow, and call again
LOST = 2  # the line left the surface: a defect


@kernel
def cross_edge(
    x: float, sx: float, sy: float, length: float, cosine: float, sine: float
) -> tuple[float, float, float]:
    """Walk from (x, 0) toward s and out over the left edge of a face.

    Returns the exit's distance from the tail and s in the frame of that edge, whose own face is
    ahead again (y > 0).
    """
    along, ahead = sx * cosine + sy * sine, sy * cosine - sx * sine
    ex, ey = x * cosine, -x * sine
    if ahead <= ey:  # parallel within rounding: s lies on the edge's line
        return min(max(along, 0.0), length), along, ahead
    u = ex - (along - ex) * ey / (ahead - ey)
    return min(max(u, 0.0), length), along, ahead


@kernel
def row_in_face(winners: Any, node: int, face: int) -> int:
    """Row of a site in a face; -1 where it is not in that face, or is a vertex."""
    rows = len(winners.site_ints)
    if rows == 0 or node < winners.site_ints[0, NODE]:
        return -1
    for k in range(rows):
        if winners.site_ints[k, NODE] == node and winners.site_ints[k, FACE] == face:
            return k
    return -1


@kernel
def target_in_frame(topology: Any, winners: Any, node: int, h: int) -> tuple[float, float]:
    """Where the target lies in the frame of its VIA h: at the apex, or a site in the face."""
    geometry = topology.geometry
    ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
    ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
    if node < len(topology.total_angle):
        return ax, ay
    k = row_in_face(winners, node, h // 3)
    along, up = winners.site_weights[k, (h + 1) % 3], winners.site_weights[k, (h + 2) % 3]
    return along * geometry[h, LENGTH] + up * ax, up * ay


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
    links, geometry = topology.links, topology.geometry
    distance, winner_ints = winners.distance, winners.winner_ints
    nodes[0], parameters[0] = -1 - target, 0.0
    count = 1
    v = target
    while winner_ints[v, VIA] >= 0:
        h, root = winner_ints[v, VIA], winner_ints[v, FROM]
        sx, sy, sigma = winners.winner[v, 0], winners.winner[v, 1], 0.0
        reference = winners.reference[v] if len(winners.reference) > 0 else -1 - root
        if reference >= 0:
            root = -1  # not known before the merges are undone
        face, length = h // 3, geometry[h, LENGTH]
        ax, ay = target_in_frame(topology, winners, v, h)
        to_tail, to_head = math.hypot(ax, ay), math.hypot(ax - length, ay)
        tail, head, stop = links[h, TAIL], links[h, HEAD], -1
        if row_in_face(winners, root, face) >= 0:
            stop = root
        elif tail == root or is_on_path(winners, tail, to_tail, distance[v], v):
            stop = tail
        elif head == root or is_on_path(winners, head, to_head, distance[v], v):
            stop = head
        else:
            # From there back over h itself
            x = sx if ay <= sy else (sx * ay - ax * sy) / (ay - sy)
            x = min(max(x, 0.0), length)
            sigma = distance[v] - math.hypot(ax - x, ay) - math.hypot(sx - x, sy)
            if reference >= 0:
                reference, sx, sy, sigma = unmerge(winners, reference, h, x, sx, sy, sigma)
                root = -1 - reference if reference < 0 else -1
            h, x, sx, sy = links[h, OPPOSITE] >> 1, length - x, length - sx, -sy
        while stop < 0:
            # At (x, 0) on h, its face and the pseudosource ahead
            if h < 0:  # a window came from nowhere
                return LOST, count
            if count >= len(nodes):
                return NO_ROOM, count
            faces[count - 1], nodes[count], parameters[count] = face, h, x / geometry[h, LENGTH]
            count += 1
            if reference >= 0:
                length = geometry[h, LENGTH]
                # As the windows see it that were merged here: from the other side
                reference, sx, sy, sigma = unmerge(
                    winners, reference, links[h, OPPOSITE] >> 1, length - x, length - sx, -sy, sigma
                )
                sx, sy = length - sx, -sy
                root = -1 - reference if reference < 0 else -1
            face, apex = h // 3, links[h, APEX]
            if row_in_face(winners, root, face) >= 0:
                stop = root
                break
            ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
            ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
            reach = math.sqrt((ax - x) * (ax - x) + ay * ay)
            here = sigma + math.sqrt((sx - x) * (sx - x) + sy * sy)
            if apex == root or is_on_path(winners, apex, reach, here, v):
                stop = apex
                break
            if (ax - x) * sy - ay * (sx - x) >= 0.0:  # s is left of the apex
                x, sx, sy = cross_edge(
                    x,
                    sx,
                    sy,
                    geometry[h, LENGTH_LEFT],
                    geometry[h, COS_LEFT],
                    geometry[h, SIN_LEFT],
                )
                if links[h, OUT_LEFT] < 0:
                    to_apex = geometry[h, LENGTH_LEFT] - x
                    stop = nearer_end(winners, links[h, TAIL], x, apex, to_apex, v)
                    if stop < 0:
                        return LOST, count
                    break
                h = links[h, OUT_LEFT]
            else:  # the same, in the mirror
                length, reach = geometry[h, LENGTH], geometry[h, LENGTH_RIGHT]
                x, sx, sy = cross_edge(
                    length - x,
                    length - sx,
                    sy,
                    reach,
                    geometry[h, COS_RIGHT],
                    geometry[h, SIN_RIGHT],
                )
                x, sx = reach - x, reach - sx
                if links[h, OUT_RIGHT] < 0:
                    stop = nearer_end(winners, apex, x, links[h, HEAD], reach - x, v)
                    if stop < 0:
                        return LOST, count
                    break
                h = links[h, OUT_RIGHT]
        if count >= len(nodes):
            return NO_ROOM, count
        faces[count - 1], nodes[count], parameters[count] = face, -1 - stop, 0.0
        count += 1
        v = stop
    return TRACED, count
