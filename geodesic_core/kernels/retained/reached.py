"""The regions of a face that windows, sources and corners reach within a level.

A window reaches, within a level L, a disc of radius L - σ around its unfolded pseudosource, between
its two outermost rays. A corner of the face and a source inside it reach a whole disc. A parallel
window reaches the band between its outermost rays, up to the line D = L. A segment of a curve
inside the face reaches a band on each side, whose third side is behind the segment.

All is planar, in the frame of the face's first half-edge.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.regions import SIDES_END, put_band, put_disc, put_side
from geodesic_core.kernels.front.state import FACE, NODE, SEGMENT_END
from geodesic_core.kernels.front.window import ROOT, Window, reaches
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, half_edge_in_face, point_in_frame
from geodesic_core.kernels.retained.face_windows import retained_window
from geodesic_core.tolerances import BEHIND, GAP, LEVEL

# Columns of a region, after those of its sides: what reaches it
ORIGIN = SIDES_END  # node of the pseudosource, corner, point or segment
OVER = SIDES_END + 1  # which half-edge of the face a window crosses, 0 to 2; -1 of all others
REGION = SIDES_END + 2


@inlined
def put_origin(region: Floats, node: int, over: int) -> None:
    """Set the node that a region is reached from, and the half-edge of the face that is crossed."""
    region[ORIGIN], region[OVER] = node, over


@kernel
def rows_in_face(ints: Ints, face: int) -> tuple[int, int]:
    """Return the first row of a face and the row after its last; ``ints`` are sorted by face."""
    if len(ints) == 0:
        return 0, 0
    faces = ints[:, FACE]
    return int(np.searchsorted(faces, face)), int(np.searchsorted(faces, face + 1))


@kernel
def regions_of_face(topology: Any, swept: Any, face: int, level: float) -> Floats:
    """Return the regions that windows, sources and corners of a face reach within a level.

    Windows come first: of regions that reach equally far, they take precedence.
    """
    topology, swept = borrowed(topology), borrowed(swept)
    windows, count = swept.face_windows, 0
    first_site, end_site = rows_in_face(swept.site_ints, face)
    first_segment, end_segment = rows_in_face(swept.segment_ints, face)
    rows = windows.first[3 * face + 3] - windows.first[3 * face] + 3
    rows += end_site - first_site + 2 * (end_segment - first_segment)
    regions = np.zeros((rows, REGION))
    for h in range(3 * face, 3 * face + 3):
        count = add_window_regions(topology.geometry, swept, h, level, regions, count)
    for k in range(first_segment, end_segment):
        far = level - swept.distance[swept.segment_ints[k, NODE]]
        if far > 0.0:
            px, py = point_in_frame(
                topology.geometry, 3 * face, swept.segment_ends[k, :SEGMENT_END]
            )
            qx, qy = point_in_frame(
                topology.geometry, 3 * face, swept.segment_ends[k, SEGMENT_END:]
            )
            put_segment_bands(regions[count : count + 2], px, py, qx, qy, far)
            for _ in range(2):
                put_origin(regions[count], swept.segment_ints[k, NODE], -1)
                count += 1
    for k in range(first_site, end_site):
        radius = level - swept.distance[swept.site_ints[k, NODE]]
        if radius >= 0.0:
            x, y = point_in_frame(topology.geometry, 3 * face, swept.site_weights[k])
            put_disc(regions[count], x, y, radius)
            put_origin(regions[count], swept.site_ints[k, NODE], -1)
            count += 1
    for h in range(3 * face, 3 * face + 3):
        radius = level - swept.distance[topology.links[h, TAIL]]
        if radius >= 0.0:
            x, y, _, _ = half_edge_in_face(topology.geometry, h)
            put_disc(regions[count], x, y, radius)
            put_origin(regions[count], topology.links[h, TAIL], -1)
            count += 1
    return regions[:count]


@inlined
def add_window_regions(
    geometry: Floats, swept: Any, h: int, level: float, regions: Floats, count: int
) -> int:
    """Write the regions of the windows over h to ``regions`` from row ``count`` on.

    Returns the new count.
    """
    regions = borrowed(regions)
    face_windows, reach = swept.face_windows, level * (1.0 + LEVEL)
    ints, edge = face_windows.windows.view(np.int32), half_edge_in_face(geometry, h)
    gap = GAP * geometry[h, LENGTH]
    for i in range(face_windows.first[h], face_windows.first[h + 1]):
        weight = 0.0 if ints[i, ROOT] >= swept.first_segment else 1.0
        window = retained_window(face_windows.windows[i], ints[i, ROOT], weight)
        if reaches(window, reach):
            if weight == 0.0:
                put_parallel_window(regions[count], window, gap, level, edge)
            else:
                put_window(regions[count], window, gap, level, edge)
            put_origin(regions[count], window.root, h % 3)
            count += 1
    return count


@inlined
def put_window(region: Floats, window: Window, gap: float, level: float, edge: Any) -> None:
    """Make ``region`` the disc of a window between its outermost rays, widened by ``gap``."""
    ox, oy, ux, uy = edge
    sx, sy = window.sx, window.sy
    put_disc(region, ox + sx * ux - sy * uy, oy + sx * uy + sy * ux, level - window.sigma)
    for end in range(2):
        x = window.b0 - gap - sx if end == 0 else window.b1 + gap - sx
        length = math.hypot(x, sy)
        if length > 0.0:
            turn = 1.0 if end == 0 else -1.0
            nx, ny = -turn * sy / length, -turn * x / length
            put_side(region, end, nx * ux - ny * uy, nx * uy + ny * ux, 0.0)


@inlined
def put_parallel_window(
    region: Floats, window: Window, gap: float, level: float, edge: Any
) -> None:
    """Make ``region`` the band of a parallel window, widened by ``gap`` on both sides."""
    ox, oy, ux, uy = edge
    sx, sy, x1 = window.sx, window.sy, window.b1 + gap
    far = level - (window.sigma - sx * x1)  # from (x1, 0) along its ray, against s
    x, y = x1 - far * sx, -far * sy
    x, y = ox + x * ux - y * uy, oy + x * uy + y * ux
    put_band(region, x, y, sy * ux + sx * uy, sy * uy - sx * ux, (x1 - window.b0 + gap) * -sy)


@kernel
def put_segment_bands(
    bands: Floats, px: float, py: float, qx: float, qy: float, far: float
) -> None:
    """Make ``bands``, two regions, those on both sides of the segment pq, up to ``far`` from it."""
    length = math.hypot(qx - px, qy - py)
    ex, ey = (qx - px) / length, (qy - py) / length
    put_band(bands[0], px + far * ey, py - far * ex, ex, ey, length)
    put_side(bands[0], 2, ey, -ex, BEHIND * far)
    put_band(bands[1], qx - far * ey, qy + far * ex, -ex, -ey, length)
    put_side(bands[1], 2, -ey, ex, BEHIND * far)
