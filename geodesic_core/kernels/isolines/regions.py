r"""Regions of one face that lie within a level: discs and bands.

A window reaches, within a level L, a disc of radius L - σ around its unfolded pseudosource, cut by
its two outermost rays. A corner of the face and a source inside it reach a whole disc. A parallel
window reaches the band between its outermost rays, up to the line D = L. A segment of a curve
inside the face reaches a band on each side. So a region lies on the near side of its *front*, a
circle or a line, and within up to three *sides*, which are straight::

             .---.   front: a circle       +<--e---+ C   front: a line
            /     \                        |       |
            \     /                        |       |
             \   /   sides: its rays       |       |     sides: its rays; of a segment's band
              \ /                          |       |     also one behind the segment
               C                           +-------+

All is planar, in the frame of the face's first half-edge.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.state import FACE, NODE, SEGMENT_END
from geodesic_core.kernels.front.window import ROOT, Window, reaches
from geodesic_core.kernels.isolines.face_windows import retained_window
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, half_edge_in_face, point_in_frame
from geodesic_core.tolerances import BEHIND, GAP, LEVEL

# Columns of a front, with which a region begins
CX = 0  # centre of the circle; a point of the line
CY = 1
RADIUS = 2  # infinite of a line
EX = 3  # unit vector along the line, the near side on its left; zero of a circle
EY = 4
FRONT = 5

# Columns of a region: those of its front, then three for each side
NX = 0  # the normal, inward, a unit; zero where there is no such side
NY = 1
DEPTH = 2  # how far inside (CX, CY) is
SIDE = 3
SIDES_END = FRONT + 3 * SIDE

# Columns of a region, after those of its sides: what reaches it
ORIGIN = SIDES_END  # node of the pseudosource, corner, point or segment
OVER = SIDES_END + 1  # which half-edge of the face a window crosses, 0 to 2; -1 of all others
REGION = SIDES_END + 2


@kernel
def is_line(front: Floats) -> bool:
    """Whether a front is a line; else it is a circle."""
    return math.isinf(front[RADIUS])


@kernel
def end_of_sides(region: Floats) -> int:
    """Return the column after the last side that a region may have: discs have two."""
    return SIDES_END if is_line(region) else SIDES_END - SIDE


@inlined
def put_side(region: Floats, rank: int, nx: float, ny: float, depth: float) -> None:
    """Set side number ``rank`` of ``region``: its inward unit normal, and its depth at (CX, CY)."""
    side = FRONT + SIDE * rank
    region[side + NX], region[side + NY], region[side + DEPTH] = nx, ny, depth


@inlined
def put_origin(region: Floats, node: int, over: int) -> None:
    """Set the node that a region is reached from, and the half-edge of the face that is crossed."""
    region[ORIGIN], region[OVER] = node, over


@inlined
def put_disc(region: Floats, x: float, y: float, radius: float) -> None:
    """Make ``region`` a whole disc."""
    region[CX], region[CY], region[RADIUS] = x, y, radius


@inlined
def put_band(region: Floats, x: float, y: float, ex: float, ey: float, width: float) -> None:
    """Make ``region`` a band: its front from (x, y) along e, its sides at both ends."""
    region[CX], region[CY], region[RADIUS] = x, y, math.inf
    region[EX], region[EY] = ex, ey
    put_side(region, 0, ex, ey, 0.0)
    put_side(region, 1, -ex, -ey, width)


@kernel
def runs_along(front: Floats, slack: float, edge: Any, length: float) -> bool:
    """Whether a front is a line that runs along an edge, given as by `half_edge_in_face`."""
    if not is_line(front):
        return False
    ox, oy, ux, uy = edge
    depth = front[EX] * (oy - front[CY]) - front[EY] * (ox - front[CX])
    rise = length * (front[EX] * uy - front[EY] * ux)
    return max(abs(depth), abs(depth + rise)) <= slack


@kernel
def rows_in_face(ints: Ints, face: int) -> tuple[int, int]:
    """Return the first row of a face and the row after its last; ``ints`` are sorted by face."""
    if len(ints) == 0:
        return 0, 0
    faces = ints[:, FACE]
    return int(np.searchsorted(faces, face)), int(np.searchsorted(faces, face + 1))


@kernel
def regions_of_face(topology: Any, field: Any, face: int, level: float) -> Floats:
    """Return the regions that windows, sources and corners of a face reach within a level.

    Windows come first: of regions that reach equally far, they take precedence.
    """
    topology, field = borrowed(topology), borrowed(field)
    windows, count = field.face_windows, 0
    first_site, end_site = rows_in_face(field.site_ints, face)
    first_segment, end_segment = rows_in_face(field.segment_ints, face)
    rows = windows.first[3 * face + 3] - windows.first[3 * face] + 3
    rows += end_site - first_site + 2 * (end_segment - first_segment)
    regions = np.zeros((rows, REGION))
    for h in range(3 * face, 3 * face + 3):
        count = add_window_regions(topology.geometry, field, h, level, regions, count)
    for k in range(first_segment, end_segment):
        far = level - field.distance[field.segment_ints[k, NODE]]
        if far > 0.0:
            px, py = point_in_frame(
                topology.geometry, 3 * face, field.segment_ends[k, :SEGMENT_END]
            )
            qx, qy = point_in_frame(
                topology.geometry, 3 * face, field.segment_ends[k, SEGMENT_END:]
            )
            put_segment_bands(regions[count : count + 2], px, py, qx, qy, far)
            for _ in range(2):
                put_origin(regions[count], field.segment_ints[k, NODE], -1)
                count += 1
    for k in range(first_site, end_site):
        radius = level - field.distance[field.site_ints[k, NODE]]
        if radius >= 0.0:
            x, y = point_in_frame(topology.geometry, 3 * face, field.site_weights[k])
            put_disc(regions[count], x, y, radius)
            put_origin(regions[count], field.site_ints[k, NODE], -1)
            count += 1
    for h in range(3 * face, 3 * face + 3):
        radius = level - field.distance[topology.links[h, TAIL]]
        if radius >= 0.0:
            x, y, _, _ = half_edge_in_face(topology.geometry, h)
            put_disc(regions[count], x, y, radius)
            put_origin(regions[count], topology.links[h, TAIL], -1)
            count += 1
    return regions[:count]


@inlined
def add_window_regions(
    geometry: Floats, field: Any, h: int, level: float, regions: Floats, count: int
) -> int:
    """Write the regions of the windows over h to ``regions`` from row ``count`` on.

    Returns the new count.
    """
    regions = borrowed(regions)
    face_windows, reach = field.face_windows, level * (1.0 + LEVEL)
    ints, edge = face_windows.windows.view(np.int32), half_edge_in_face(geometry, h)
    gap = GAP * geometry[h, LENGTH]
    for i in range(face_windows.first[h], face_windows.first[h + 1]):
        weight = 0.0 if ints[i, ROOT] >= field.first_segment else 1.0
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


@kernel
def span_in_half_plane(lo: float, hi: float, depth: float, rate: float) -> tuple[float, float]:
    """Cut a span of a line to a half-plane, in which its parameter t is ``depth + rate t`` deep."""
    if rate > 0.0:
        return max(lo, -depth / rate), hi
    if rate < 0.0:
        return lo, min(hi, -depth / rate)
    return (lo, hi) if depth >= 0.0 else (1.0, 0.0)


@kernel
def span_on_line(
    region: Floats, slack: float, x: float, y: float, ex: float, ey: float, lo: float, hi: float
) -> tuple[float, float]:
    """Cut the span [lo, hi] of the line from (x, y) along e to a region.

    The region's front is moved outward by ``slack``. The span is empty where lo > hi.
    """
    wx, wy = x - region[CX], y - region[CY]
    if is_line(region):
        depth = region[EX] * wy - region[EY] * wx + slack
        lo, hi = span_in_half_plane(lo, hi, depth, region[EX] * ey - region[EY] * ex)
    else:
        radius = region[RADIUS] + slack
        height, middle = abs(ex * wy - ey * wx), -(wx * ex + wy * ey)
        if height > radius:
            return 1.0, 0.0
        half = math.sqrt((radius - height) * (radius + height))
        lo, hi = max(lo, middle - half), min(hi, middle + half)
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * wx + ny * wy
        lo, hi = span_in_half_plane(lo, hi, depth, nx * ex + ny * ey)
    return lo, hi
