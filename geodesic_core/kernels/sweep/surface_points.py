"""Sites: points of a sweep that are no vertices, as its sources or its targets.

A site has a node of its own, numbered after the vertices, and a row for each face that it belongs
to: one inside a face, one for each face of an edge. It emits windows over the edges of its faces,
as a vertex does over those opposite to it; and it is reached as the apex of a face is, by the
windows that cross its face. No vertex is inserted, so that there are no slivers.
"""

import math
from typing import Any

from geodesic_core.arrays import Ints
from geodesic_core.kernels.front.bounds import merging
from geodesic_core.kernels.front.relaxation import (
    bound_vertex,
    illuminate_vertex,
    precedence,
    relax_vertex,
)
from geodesic_core.kernels.front.state import (
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
    view_of,
)
from geodesic_core.kernels.front.window import (
    Window,
    distance_at,
    emitted_window,
    load_window,
    straight_distance,
)
from geodesic_core.kernels.jit import kernel
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
from geodesic_core.kernels.sweep.segments import distance_to_segment
from geodesic_core.kernels.sweep.window_lists import send_out
from geodesic_core.tolerances import BEND, FLAT, GAP


@kernel
def emit_site(wave: Any, k: int) -> None:
    """Send windows from the site of row k over all edges of its face, and reach the corners.

    Modifies lists and vertices.
    """
    mesh, sites = wave.mesh, wave.sites
    node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
    sigma = wave.vertices.distance[node]
    for h in range(3 * face, 3 * face + 3):
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        row = ROW * h
        length = mesh.geometry[row + LENGTH]
        # In a face of no area the point lies on the edge all the same: see `emit_sector`.
        is_off_edge = sites.weights[3 * k + (h + 2) % 3] > 0.0
        if mesh.links[row + OPPOSITE] != NO_FACE and is_off_edge:
            sy = min(-y, -FLAT * length)
            window = emitted_window(wave, 0.0, length, length - x, sy, sigma, node, 0.0)
            send_out(wave, h, window)
        ax = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        ay = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        distance = sigma + math.hypot(ax - x, ay - y)
        apex = mesh.links[row + APEX]
        if merging(wave):
            bound_vertex(wave, apex, distance)
            if mesh.flags[apex]:
                illuminate_vertex(wave, apex, distance, h, x, y, 1.0)
        relax_vertex(wave, apex, distance, h, x, y, node, -1 - node)


@kernel
def watch_sites(sites: Ints, lists: Ints, first: int) -> None:
    """Have the sites from row ``first`` on reached by the windows that cross their faces.

    ``sites`` (S, 3) and ``lists`` (3F, 4) are those of `Sites` and `Pool`; modifies NEXT_SITE of
    the first and MARKS of the second.
    """
    for k in range(first, len(sites)):
        face = sites[k, FACE]
        sites[k, NEXT_SITE] = (lists[3 * face, MARKS] >> SITE_SHIFT) - 1
        for h in range(3 * face, 3 * face + 3):
            others = lists[h, MARKS] & ((1 << SITE_SHIFT) - 1)
            lists[h, MARKS] = others | (k + 1) << SITE_SHIFT


@kernel
def reach_sites(wave: Any, h: int, count: int) -> None:
    """Offer the sites in the face of h the windows of scratch."""
    k = (wave.pool.lists[LIST * h + MARKS] >> SITE_SHIFT) - 1
    while k >= 0:
        reach_site(wave, h, count, k)
        k = wave.sites.ints[SITE * k + NEXT_SITE]


@kernel
def reach_site(wave: Any, h: int, count: int, k: int) -> None:
    """Offer the site of row k the nearest of the windows of scratch. Modifies its node.

    Unlike an apex it tries them all: it has no neighbours that would make up for a gap.
    """
    mesh, sites = wave.mesh, wave.sites
    node = sites.ints[SITE * k + NODE]
    x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
    gap = GAP * mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        window = load_window(wave, wave.pool.scratch, i)
        there = way_through(window, x, y, gap)
        relax_site(wave, node, there, h, window.sx, window.sy, window.root, window.reference)


@kernel
def way_through(window: Window, x: float, y: float, gap: float) -> float:
    """Distance through a window of a point of the face; the way is bent at its end if it must."""
    rise = y * window.weight - window.sy
    crossing = (window.sx * y - x * window.sy) / rise if rise > 0.0 else x
    if window.b0 - gap <= crossing <= window.b1 + gap:
        return straight_distance(window, x, y)
    crossing = min(max(crossing, window.b0), window.b1)
    there = distance_at(window, crossing)
    return (there + math.hypot(x - crossing, y)) * (1.0 + BEND)


@kernel
def relax_site(
    wave: Any, node: int, distance: float, via: int, sx: float, sy: float, root: int, reference: int
) -> None:
    """Offer a site a distance and the window that gives it; ties go to the lower source.

    Modifies its node.
    """
    vertices = wave.vertices
    known = vertices.distance[node]
    if not precedence(distance, vertices.source_index[root], known, vertices.source_index[node]):
        return
    vertices.distance[node] = min(distance, known)
    vertices.winner[2 * node], vertices.winner[2 * node + 1] = sx, sy
    vertices.winner_ints[WINNER * node + ENTRY_EDGE] = via
    vertices.winner_ints[WINNER * node + PREDECESSOR] = root
    vertices.source_index[node] = vertices.source_index[root]
    if merging(wave):
        vertices.reference[node] = reference


@kernel
def reach_sites_inside(topology: Any, wavefront: Any, bounds: Any, first: int) -> None:
    """Offer the sites from row ``first`` on the paths that cross no edge, after the sweep.

    They come from the corners of their faces, or from sources and segments in the same face.
    Modifies the nodes of the sites.
    """
    wave = view_of(topology, wavefront, bounds)
    mesh, vertices, sites = wave.mesh, wave.vertices, wave.sites
    for k in range(first, wave.sizes.sites):
        node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
        for h in range(3 * face, 3 * face + 3):
            x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
            corner = mesh.links[ROW * h + TAIL]
            distance = vertices.distance[corner] + math.hypot(x, y)
            if distance < math.inf:
                relax_site(wave, node, distance, h, 0.0, 0.0, corner, -1 - corner)
        h = 3 * face
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        for source in range(first):
            if sites.ints[SITE * source + FACE] == face:
                root = sites.ints[SITE * source + NODE]
                sx, sy = weights_in_frame(mesh.geometry, sites.weights, 3 * source, h)
                distance = vertices.distance[root] + math.hypot(x - sx, y - sy)
                relax_site(wave, node, distance, h, sx, sy, root, -1 - root)
        for segment in range(wave.sizes.segments):
            if sites.segment_ints[SEGMENT * segment + FACE] == face:
                root = sites.segment_ints[SEGMENT * segment + NODE]
                ends = sites.segment_ends
                distance = distance_to_segment(mesh.geometry, ends, segment, h, x, y)
                distance += vertices.distance[root]
                relax_site(wave, node, distance, h, 0.0, 0.0, root, -1 - root)
