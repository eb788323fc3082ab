"""Sites: points of a sweep that are no vertices, where it begins or which it is to reach.

A site has a node of its own, numbered after the vertices, and a row for each face that it belongs
to: one inside a face, one for each face of an edge. It emits windows over the edges of its faces,
as a vertex does over those opposite to it; and it is reached as the apex of a face is, by the
windows that cross its face. No vertex is inserted, so that there are no slivers.
"""

import math
from typing import Any

from geodesic_core.kernels.jit import kernel, pointer
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    NO_FACE,
    OPPOSITE,
    ROW,
    SIN_LEFT,
    TAIL,
    weights_in_frame,
)
from geodesic_core.kernels.sweep.relaxation import (
    bound_vertex,
    illuminate_vertex,
    precedence,
    relax_vertex,
)
from geodesic_core.kernels.sweep.segments import distance_to_segment
from geodesic_core.kernels.sweep.state import (
    ENTRY_EDGE,
    FACE,
    LIST,
    MARKS,
    NEXT_SITE,
    NODE,
    PREDECESSOR,
    SEGMENT,
    SITE,
    SITE_SHIFT,
    WINNER,
    merging,
    source_weight,
    view_of,
)
from geodesic_core.kernels.sweep.window import (
    B0,
    B1,
    INTS,
    REFERENCE,
    ROOT,
    SIGMA,
    SX,
    SY,
    WIDTH,
    distance_at,
    straight_distance,
)
from geodesic_core.kernels.sweep.window_lists import put_window, send_out
from geodesic_core.tolerances import BEND, FLAT, GAP


@kernel
def emit_site(wave: Any, k: int) -> None:
    """Send windows from the site of row k over all edges of its face, and reach the corners."""
    node, face = wave.site_ints[SITE * k + NODE], wave.site_ints[SITE * k + FACE]
    sigma = wave.distance[node]
    for h in range(3 * face, 3 * face + 3):
        x, y = weights_in_frame(wave.geometry, wave.site_weights, 3 * k, h)
        row = ROW * h
        length = wave.geometry[row + LENGTH]
        # In a face of no area the point lies on the edge all the same: see `emit_sector`.
        is_off_edge = wave.site_weights[3 * k + (h + 2) % 3] > 0.0
        if wave.links[row + OPPOSITE] != NO_FACE and is_off_edge:
            sy = min(-y, -FLAT * length)
            slot = put_window(wave, 0.0, length, length - x, sy, sigma, node, 0.0, -1 - node)
            send_out(wave, h, slot)
        ax = wave.geometry[row + COS_LEFT] * wave.geometry[row + LENGTH_LEFT]
        ay = wave.geometry[row + SIN_LEFT] * wave.geometry[row + LENGTH_LEFT]
        distance = sigma + math.hypot(ax - x, ay - y)
        apex = wave.links[row + APEX]
        if merging(wave):
            bound_vertex(wave, apex, distance)
            if wave.flags[apex]:
                illuminate_vertex(wave, apex, distance, h, x, y, 1.0)
        relax_vertex(wave, apex, distance, h, x, y, node, -1 - node)


@kernel
def watch_sites(topology: Any, wavefront: Any, bounds: Any, first: int) -> None:
    """Have the sites of the rows from ``first`` on reached by whatever crosses their faces."""
    wave = view_of(topology, wavefront, bounds)
    for k in range(first, wave.site_count):
        face = wave.site_ints[SITE * k + FACE]
        marks = wave.lists[LIST * 3 * face + MARKS]
        wave.site_ints[SITE * k + NEXT_SITE] = (marks >> SITE_SHIFT) - 1
        for h in range(3 * face, 3 * face + 3):
            others = wave.lists[LIST * h + MARKS] & ((1 << SITE_SHIFT) - 1)
            wave.lists[LIST * h + MARKS] = others | (k + 1) << SITE_SHIFT


@kernel
def reach_sites(wave: Any, h: int, count: int) -> None:
    """Offer the sites in the face of h the windows of scratch."""
    k = (wave.lists[LIST * h + MARKS] >> SITE_SHIFT) - 1
    while k >= 0:
        reach_site(wave, h, count, k)
        k = wave.site_ints[SITE * k + NEXT_SITE]


@kernel
def reach_site(wave: Any, h: int, count: int, k: int) -> None:
    """Offer the site of row k the nearest of the windows of scratch.

    Unlike an apex it asks them all: it has no neighbours that would make up for a gap.
    """
    node = wave.site_ints[SITE * k + NODE]
    x, y = weights_in_frame(wave.geometry, wave.site_weights, 3 * k, h)
    gap = GAP * wave.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
        b0, b1 = wave.scratch[w + B0], wave.scratch[w + B1]
        root = wave.scratch_ints[INTS * i + ROOT]
        sw, sigma = source_weight(wave, root), wave.scratch[w + SIGMA]
        relax_site(
            wave,
            node,
            way_through(x, y, b0, b1, sx, sy, sw, sigma, gap),
            h,
            sx,
            sy,
            root,
            wave.scratch_ints[INTS * i + REFERENCE] if merging(wave) else -1,
        )


@kernel
def way_through(
    x: float,
    y: float,
    b0: float,
    b1: float,
    sx: float,
    sy: float,
    sw: float,
    sigma: float,
    gap: float,
) -> float:
    """Distance through a window of a point of the face; the way is bent at its end if it must."""
    rise = y * sw - sy
    crossing = (sx * y - x * sy) / rise if rise > 0.0 else x
    if b0 - gap <= crossing <= b1 + gap:
        return straight_distance(x, y, sx, sy, sw, sigma)
    crossing = min(max(crossing, b0), b1)
    there = distance_at(crossing, sx, sy, sigma, sw)
    return (there + math.hypot(x - crossing, y)) * (1.0 + BEND)


@kernel
def relax_site(
    wave: Any, node: int, distance: float, via: int, sx: float, sy: float, root: int, reference: int
) -> None:
    """Offer a site a distance and what gives it; of equal ones that of the lower source wins."""
    known = wave.distance[node]
    if not precedence(distance, wave.origin[root], known, wave.origin[node]):
        return
    wave.distance[node] = min(distance, known)
    wave.winner[2 * node], wave.winner[2 * node + 1] = sx, sy
    wave.winner_ints[WINNER * node + ENTRY_EDGE] = via
    wave.winner_ints[WINNER * node + PREDECESSOR] = root
    wave.origin[node] = wave.origin[root]
    if merging(wave):
        wave.reference[node] = reference


@kernel
def reach_sites_inside(topology: Any, wavefront: Any, bounds: Any, first: int) -> None:
    """Offer the sites from row ``first`` on the paths that cross no edge, after the sweep.

    They come from the corners of their faces, or from sources and pieces in the same face.
    """
    wave = view_of(topology, wavefront, bounds)
    for k in range(first, wave.site_count):
        node, face = wave.site_ints[SITE * k + NODE], wave.site_ints[SITE * k + FACE]
        for h in range(3 * face, 3 * face + 3):
            x, y = weights_in_frame(wave.geometry, wave.site_weights, 3 * k, h)
            corner = wave.links[ROW * h + TAIL]
            distance = wave.distance[corner] + math.hypot(x, y)
            if distance < math.inf:
                relax_site(wave, node, distance, h, 0.0, 0.0, corner, -1 - corner)
        h = 3 * face
        x, y = weights_in_frame(wave.geometry, wave.site_weights, 3 * k, h)
        for source in range(first):
            if wave.site_ints[SITE * source + FACE] == face:
                root = wave.site_ints[SITE * source + NODE]
                sx, sy = weights_in_frame(wave.geometry, wave.site_weights, 3 * source, h)
                distance = wave.distance[root] + math.hypot(x - sx, y - sy)
                relax_site(wave, node, distance, h, sx, sy, root, -1 - root)
        ints, ends = pointer(wavefront.piece_ints), pointer(wavefront.piece_ends)
        for piece in range(len(wavefront.piece_ints)):
            if ints[SEGMENT * piece + FACE] == face:
                root = ints[SEGMENT * piece + NODE]
                distance = distance_to_segment(wave.geometry, ends, piece, h, x, y)
                distance += wave.distance[root]
                relax_site(wave, node, distance, h, 0.0, 0.0, root, -1 - root)
