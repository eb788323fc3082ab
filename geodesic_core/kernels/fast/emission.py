"""Windows that sources emit, and vertices where several fans of faces meet."""

import math
from typing import Any

from geodesic_core.kernels.fast.places import offer_over, relax
from geodesic_core.kernels.fast.state import view_of
from geodesic_core.kernels.front.state import (
    FACE,
    NODE,
    SEGMENT,
    SITE,
)
from geodesic_core.kernels.front.window import emitted_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    OPPOSITE,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
    previous,
    weights_in_frame,
)
from geodesic_core.kernels.sweep.segments import (
    distance_to_segment,
    is_off_edge,
    parallel_window,
    perpendicular_to,
    place_segment,
)
from geodesic_core.kernels.sweep.window_lists import faces_beyond
from geodesic_core.tolerances import FLAT, SLANT


@kernel
def room_around(wave: Any, v: int) -> int:
    """Return how many windows v may emit, with those of the vertices that it reaches, at most."""
    mesh = wave.mesh
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    room = 3 * (last - first)
    for c in range(first, last):
        if mesh.links[ROW * mesh.corners[c] + OUT_RIGHT] == IRREGULAR:
            room += faces_beyond(wave, following(mesh.corners[c]))
    return room


@kernel
def emit_around(wave: Any, v: int) -> None:
    """Emit into every face at v, and along its edges. Modifies the wavefront."""
    mesh, sigma = wave.mesh, wave.front.distance[v]
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h = mesh.corners[c]
        row, before = ROW * h, previous(h)  # whose apex is the head of h
        length, reach = mesh.geometry[row + LENGTH], mesh.geometry[row + LENGTH_RIGHT]
        place = mesh.geometry[ROW * before + LENGTH]
        relax(wave, mesh.links[row + HEAD], sigma + length, before, place, 0.0, v, place)
        if mesh.links[row + OUT_LEFT] < 0:
            distance = sigma + mesh.geometry[row + LENGTH_LEFT]
            relax(wave, mesh.links[row + APEX], distance, h, 0.0, 0.0, v, 0.0)
        sx = reach - mesh.geometry[row + COS_RIGHT] * length
        # In a face of no area v lies on the edge across, from where no ray would leave.
        sy = min(-mesh.geometry[row + SIN_RIGHT] * length, -FLAT * reach)
        window = emitted_window(wave, 0.0, reach, sx, sy, sigma, v, 0.0)
        offer_over(wave, mesh.links[row + OUT_RIGHT], following(h), reach, window)


@kernel
def emit_site(wave: Any, k: int) -> None:
    """Emit from the site of row k over all edges of its face, and reach the corners."""
    mesh, sites = wave.mesh, wave.front.sites
    node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
    sigma = wave.front.distance[node]
    for h in range(3 * face, 3 * face + 3):
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        row = ROW * h
        length = mesh.geometry[row + LENGTH]
        if sites.weights[3 * k + (h + 2) % 3] > 0.0:  # it is off the edge
            sy = min(-y, -FLAT * length)
            window = emitted_window(wave, 0.0, length, length - x, sy, sigma, node, 0.0)
            offer_over(wave, mesh.links[row + OPPOSITE], h, length, window)
        ax = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        ay = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        distance = sigma + math.hypot(ax - x, ay - y)
        relax(wave, mesh.links[row + APEX], distance, h, x, y, node, math.nan)


@kernel
def emit_segment(wave: Any, k: int) -> None:
    """Emit the parallel windows of the segment of row k, and reach the corners of its face."""
    mesh, sites, distance = wave.mesh, wave.front.sites, wave.front.distance
    node, face = sites.segment_ints[SEGMENT * k + NODE], sites.segment_ints[SEGMENT * k + FACE]
    for h in range(3 * face, 3 * face + 3):
        length = mesh.geometry[ROW * h + LENGTH]
        segment = place_segment(mesh.geometry, sites.segment_ends, k, h)
        if segment.dx > SLANT and is_off_edge(sites.segment_ends, k, h):
            window = parallel_window(wave, distance[node], node, length, segment)
            if window.b1 > window.b0:
                offer_over(wave, mesh.links[ROW * h + OPPOSITE], h, length, window)
        is_foot, reach, sx, sy = perpendicular_to(mesh.geometry, h, segment)
        if is_foot:
            apex = mesh.links[ROW * h + APEX]
            relax(wave, apex, distance[node] + reach, h, sx, sy, node, math.nan)


@kernel
def reach_sites_inside(topology: Any, wavefront: Any, bounds: Any, first: int) -> None:
    """Offer the sites from row ``first`` on the paths that cross no edge, after the sweep.

    They come from the corners of their faces, or from sources and segments in the same face.
    Modifies the nodes of the sites.
    """
    wave = view_of(topology, wavefront, bounds)
    mesh, front, sites = wave.mesh, wave.front, wave.front.sites
    for k in range(first, wave.sizes.sites):
        node, face = sites.ints[SITE * k + NODE], sites.ints[SITE * k + FACE]
        for h in range(3 * face, 3 * face + 3):
            x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
            corner = mesh.links[ROW * h + TAIL]
            distance = front.distance[corner] + math.hypot(x, y)
            if distance < math.inf:
                relax(wave, node, distance, h, 0.0, 0.0, corner, 0.0)
        h = 3 * face
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        for source in range(first):
            if sites.ints[SITE * source + FACE] == face:
                root = sites.ints[SITE * source + NODE]
                sx, sy = weights_in_frame(mesh.geometry, sites.weights, 3 * source, h)
                distance = front.distance[root] + math.hypot(x - sx, y - sy)
                relax(wave, node, distance, h, sx, sy, root, math.nan)
        for segment in range(wave.sizes.segments):
            if sites.segment_ints[SEGMENT * segment + FACE] == face:
                root = sites.segment_ints[SEGMENT * segment + NODE]
                ends = sites.segment_ends
                distance = distance_to_segment(mesh.geometry, ends, segment, h, x, y)
                distance += front.distance[root]
                relax(wave, node, distance, h, 0.0, 0.0, root, math.nan)
