"""Sites: points of a sweep that are no vertices, as its sources or its targets.

A site has a node of its own, numbered after the vertices, and a row for each face that it belongs
to: one inside a face, one for each face of an edge. It emits windows over the edges of its faces,
as a vertex does over those opposite to it; and it is reached as the apex of a face is, by the
windows that cross its face. No vertex is inserted, so that there are no slivers.

Sweeps differ in what they do with an emitted window, and with a node that is reached. Each kind
hands in its `Delivery`, and the kernels here are compiled for each.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.directions import lit_from_site
from geodesic_core.kernels.front.segments import (
    distance_to_segment,
    is_off_edge,
    parallel_window,
    perpendicular_to,
    place_segment,
)
from geodesic_core.kernels.front.state import (
    FACE,
    NODE,
    PREDECESSOR,
    SEGMENT,
    SITE,
    WINNER,
    View,
)
from geodesic_core.kernels.front.window import (
    Window,
    distance_at,
    emitted_window,
    straight_distance,
)
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    ROW,
    SIN_LEFT,
    TAIL,
    weights_in_frame,
)
from geodesic_core.tolerances import BEND, FLAT, SLANT


class Delivery(NamedTuple):
    """Three kernels of a kind of sweep, for the windows and nodes that it is offered."""

    start_at: Callable[[View, int, float], None]
    """(wave, v, start): reach a vertex as a source, whose index it has already"""
    reach_straight: Callable[[View, int, float, int, float, float, int], None]
    """(wave, node, reach, via, sx, sy, root): offer a node the straight way of this length from
    ``root``, which lies at (sx, sy) in the frame of the half-edge ``via``"""
    send_out: Callable[[View, int, int, Window], None]
    """(wave, out, g, window): send a window that leaves a face by its half-edge g to ``out``,
    across that edge: a half-edge, NO_FACE or IRREGULAR"""


@kernel
def start_from(
    wave: View, sources: Ints, source_indices: Ints, start_distances: Floats, delivery: Delivery
) -> None:
    """Reach the nodes of the sources; sites and segments among them emit their windows.

    ``source_indices`` (N,) are the sources that the nodes ``sources`` (N,) belong to, of which each
    has a start distance, mesh units. Modifies the wavefront.
    """
    vertices, sites = wave.vertices, wave.sites
    for i in range(len(sources)):
        node, start = sources[i], start_distances[source_indices[i]]
        if start >= vertices.distance[node]:
            continue
        vertices.source_index[node] = source_indices[i]
        if node < wave.sizes.vertices:
            delivery.start_at(wave, node, start)
        else:
            vertices.distance[node] = start
            vertices.winner_ints[WINNER * node + PREDECESSOR] = node
    for k in range(wave.sizes.sites):
        if vertices.distance[sites.ints[SITE * k + NODE]] < math.inf:
            emit_site(wave, k, delivery)
    if len(wave.bounds.parallel) > 0:
        for k in range(wave.sizes.segments):
            if vertices.distance[sites.segment_ints[SEGMENT * k + NODE]] < math.inf:
                emit_segment(wave, k, delivery)


@kernel
def emit_site(wave: View, k: int, delivery: Delivery) -> None:
    """Send windows from the site of row k over all edges of its face, and reach the corners.

    Modifies the wavefront.
    """
    mesh, sites = wave.mesh, wave.sites
    node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
    sigma = wave.vertices.distance[node]
    for h in range(3 * face, 3 * face + 3):
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        row = ROW * h
        length = mesh.geometry[row + LENGTH]
        # In a face of no area the point lies on the edge all the same: see `emit_sector`.
        if sites.weights[3 * k + (h + 2) % 3] > 0.0:  # it is off the edge
            sy = min(-y, -FLAT * length)
            window = emitted_window(wave, 0.0, length, length - x, sy, sigma, node, 0.0)
            window = lit_from_site(wave, window, k, h)
            delivery.send_out(wave, mesh.links[row + OPPOSITE], h, window)
        ax = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        ay = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        reach = math.hypot(ax - x, ay - y)
        delivery.reach_straight(wave, mesh.links[row + APEX], reach, h, x, y, node)


@kernel
def emit_segment(wave: View, k: int, delivery: Delivery) -> None:
    """Send the parallel windows of the segment of row k over the edges of its face.

    Reach the corners of the face. Modifies the wavefront.
    """
    mesh, sites = wave.mesh, wave.sites
    node, face = sites.segment_ints[SEGMENT * k + NODE], sites.segment_ints[SEGMENT * k + FACE]
    for h in range(3 * face, 3 * face + 3):
        length = mesh.geometry[ROW * h + LENGTH]
        segment = place_segment(mesh.geometry, sites.segment_ends, k, h)
        if segment.dx > SLANT and is_off_edge(sites.segment_ends, k, h):
            window = parallel_window(wave, wave.vertices.distance[node], node, length, segment)
            if window.b1 > window.b0:
                delivery.send_out(wave, mesh.links[ROW * h + OPPOSITE], h, window)
        is_foot, reach, sx, sy = perpendicular_to(mesh.geometry, h, segment)
        if is_foot:
            delivery.reach_straight(wave, mesh.links[ROW * h + APEX], reach, h, sx, sy, node)


@kernel
def reach_inside(wave: View, first: int, delivery: Delivery) -> None:
    """Offer the sites from row ``first`` on the paths that cross no edge, after the sweep.

    They come from the corners of their faces, or from sources and segments in the same face.
    Modifies the nodes of the sites.
    """
    for k in range(first, wave.sizes.sites):
        reach_site_inside(wave, k, 0, first, delivery)


@kernel
def reach_site_inside(wave: View, k: int, first: int, last: int, delivery: Delivery) -> None:
    """Offer the site of row k such paths; rows from ``first`` to before ``last`` are of sources.

    Modifies its node.
    """
    mesh, sites = wave.mesh, wave.sites
    node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
    for h in range(3 * face, 3 * face + 3):
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        corner, reach = mesh.links[ROW * h + TAIL], math.hypot(x, y)
        delivery.reach_straight(wave, node, reach, h, 0.0, 0.0, corner)
    h = 3 * face
    x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
    for source in range(first, last):
        if sites.ints[SITE * source + FACE] == face:
            root = sites.ints[SITE * source + NODE]
            sx, sy = weights_in_frame(mesh.geometry, sites.weights, 3 * source, h)
            reach = math.hypot(x - sx, y - sy)
            delivery.reach_straight(wave, node, reach, h, sx, sy, root)
    for segment in range(wave.sizes.segments):
        if sites.segment_ints[SEGMENT * segment + FACE] == face:
            root = sites.segment_ints[SEGMENT * segment + NODE]
            reach = distance_to_segment(mesh.geometry, sites.segment_ends, segment, h, x, y)
            delivery.reach_straight(wave, node, reach, h, 0.0, 0.0, root)


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
