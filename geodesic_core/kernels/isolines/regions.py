r"""What reaches within a level in one face: discs and strips.

A window reaches, within a level L, what lies in a disc of radius L - σ around its unfolded
pseudosource and between its two rays. A corner of the face, and a source inside it, reach a whole
disc. Where the rays are parallel, what lies between them before the line D = L is a strip. Pieces
of curves in the face reach a strip to each side. So a region is what is on the near side of its
*front*, a circle or a line, and within up to three *sides*, which are straight::

             .---.   front: a circle       +<--e---+ C   front: a line
            /     \                        |       |
            \     /                        |       |
             \   /   sides: its rays       |       |     sides: its rays; of a piece's strip also
              \ /                          |       |     one behind the piece
               C                           +-------+

All is planar, in the frame of the face's first half-edge.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, half_edge_in_face, point_in_frame
from geodesic_core.kernels.sweep.state import FACE, NODE, SEGMENT_END
from geodesic_core.kernels.sweep.window import B0, B1, ROOT, SIGMA, SX, SY, Window, reaches
from geodesic_core.tolerances import GAP, LEVEL

# Columns of a front, with which a region begins
CX = 0  # centre of the circle; a point of the line
CY = 1
RADIUS = 2  # infinite of a line
EX = 3  # unit vector along the line, the near side on its left; zero of a circle
EY = 4
FRONT = 5

# Columns of a region: its front, and of each side
NX = 0  # the normal, inward, a unit; zero where there is no such side
NY = 1
DEPTH = 2  # how far inside (CX, CY) is
SIDE = 3
REGION = FRONT + 3 * SIDE

BEHIND = 1.5
"""How far the strip of a piece reaches from its front, as a multiple of the piece's distance from
there: beyond the piece, so that rounding leaves no gap, and not to the front of the other side."""


@kernel
def is_line(front: Floats) -> bool:
    """Whether a front is a line; the rest are circles."""
    return math.isinf(front[RADIUS])


@kernel
def end_of_sides(region: Floats) -> int:
    """Return the column after the last side that a region may have: discs have two."""
    return REGION if is_line(region) else REGION - SIDE


@kernel
def put_side(region: Floats, rank: int, nx: float, ny: float, depth: float) -> None:
    """Set one of a region's sides."""
    side = FRONT + SIDE * rank
    region[side + NX], region[side + NY], region[side + DEPTH] = nx, ny, depth


@kernel
def put_disc(region: Floats, x: float, y: float, radius: float) -> None:
    """Make a region without sides a disc."""
    region[CX], region[CY], region[RADIUS] = x, y, radius


@kernel
def put_strip(region: Floats, x: float, y: float, ex: float, ey: float, width: float) -> None:
    """Make a region a strip: its front from (x, y) along e, its sides at both ends."""
    region[CX], region[CY], region[RADIUS] = x, y, math.inf
    region[EX], region[EY] = ex, ey
    put_side(region, 0, ex, ey, 0.0)
    put_side(region, 1, -ex, -ey, width)


@kernel
def runs_along(
    front: Floats, slack: float, ox: float, oy: float, ux: float, uy: float, length: float
) -> bool:
    """Whether a front is a line that runs along an edge."""
    if not is_line(front):
        return False
    depth = front[EX] * (oy - front[CY]) - front[EY] * (ox - front[CX])
    rise = length * (front[EX] * uy - front[EY] * ux)
    return max(abs(depth), abs(depth + rise)) <= slack


@kernel
def rows_in_face(ints: Ints, face: int) -> tuple[int, int]:
    """Return the rows, sorted by face, that are of one face: from, to."""
    if len(ints) == 0:
        return 0, 0
    faces = ints[:, FACE]
    return int(np.searchsorted(faces, face)), int(np.searchsorted(faces, face + 1))


@kernel
def regions_of_face(topology: Any, field: Any, face: int, level: float) -> Floats:
    """Return what the windows, the sources and the corners of a face reach within a level.

    Windows come first: of what reaches equally far, they count.
    """
    geometry, kept = topology.geometry, field.kept
    first_site, end_site = rows_in_face(field.site_ints, face)
    first_piece, end_piece = rows_in_face(field.piece_ints, face)
    rows = kept.first[3 * face + 3] - kept.first[3 * face] + 3
    rows += end_site - first_site + 2 * (end_piece - first_piece)
    regions, count, reach = np.zeros((rows, REGION)), 0, level * (1.0 + LEVEL)
    ints = kept.windows.view(np.int32)
    for h in range(3 * face, 3 * face + 3):
        ox, oy, ux, uy = half_edge_in_face(geometry, h)
        gap = GAP * geometry[h, LENGTH]
        for i in range(kept.first[h], kept.first[h + 1]):
            w = kept.windows[i]
            sx, sy, sigma = w[SX], w[SY], w[SIGMA]
            sw = 0.0 if ints[i, ROOT] >= field.first_piece else 1.0
            window = Window(w[B0], w[B1], sx, sy, sigma, sw, ints[i, ROOT], 0.0, -1)
            if not reaches(window, reach):
                continue
            region = regions[count]
            count += 1
            if sw == 0.0:
                x1 = w[B1] + gap
                far = level - (sigma - sx * x1)  # from (x1, 0) along its ray, against s
                x, y = x1 - far * sx, -far * sy
                width = (x1 - w[B0] + gap) * -sy
                put_strip(
                    region,
                    ox + x * ux - y * uy,
                    oy + x * uy + y * ux,
                    sy * ux + sx * uy,
                    sy * uy - sx * ux,
                    width,
                )
                continue
            put_disc(region, ox + sx * ux - sy * uy, oy + sx * uy + sy * ux, level - sigma)
            for end in range(2):
                x = w[B0] - gap - sx if end == 0 else w[B1] + gap - sx
                length = math.hypot(x, sy)
                if length > 0.0:
                    turn = 1.0 if end == 0 else -1.0
                    nx, ny = -turn * sy / length, -turn * x / length
                    put_side(region, end, nx * ux - ny * uy, nx * uy + ny * ux, 0.0)
    for k in range(first_piece, end_piece):
        far = level - field.distance[field.piece_ints[k, NODE]]
        px, py = point_in_frame(geometry, 3 * face, field.piece_ends[k, :SEGMENT_END])
        qx, qy = point_in_frame(geometry, 3 * face, field.piece_ends[k, SEGMENT_END:])
        length = math.hypot(qx - px, qy - py)
        if far > 0.0:
            ex, ey = (qx - px) / length, (qy - py) / length
            put_strip(regions[count], px + far * ey, py - far * ex, ex, ey, length)
            put_side(regions[count], 2, ey, -ex, BEHIND * far)
            put_strip(regions[count + 1], qx - far * ey, qy + far * ex, -ex, -ey, length)
            put_side(regions[count + 1], 2, -ey, ex, BEHIND * far)
            count += 2
    for k in range(first_site, end_site):
        radius = level - field.distance[field.site_ints[k, NODE]]
        if radius >= 0.0:
            x, y = point_in_frame(geometry, 3 * face, field.site_weights[k])
            put_disc(regions[count], x, y, radius)
            count += 1
    for h in range(3 * face, 3 * face + 3):
        radius = level - field.distance[topology.links[h, TAIL]]
        if radius >= 0.0:
            ox, oy, _, _ = half_edge_in_face(geometry, h)
            put_disc(regions[count], ox, oy, radius)
            count += 1
    return regions[:count]


@kernel
def span_in_half_plane(lo: float, hi: float, depth: float, rate: float) -> tuple[float, float]:
    """Cut a span of a line to a half-plane, in which its place t is ``depth + rate t`` deep."""
    if rate > 0.0:
        return max(lo, -depth / rate), hi
    if rate < 0.0:
        return lo, min(hi, -depth / rate)
    return (lo, hi) if depth >= 0.0 else (1.0, 0.0)


@kernel
def span_on_line(
    region: Floats, slack: float, x: float, y: float, ex: float, ey: float, lo: float, hi: float
) -> tuple[float, float]:
    """Cut a span of the line from (x, y) along e to a region; nowhere if from > to.

    The region's front is moved outward by ``slack``.
    """
    wx, wy = x - region[CX], y - region[CY]
    if is_line(region):
        depth = region[EX] * wy - region[EY] * wx + slack
        lo, hi = span_in_half_plane(lo, hi, depth, region[EX] * ey - region[EY] * ex)
    else:
        radius, height, middle = (
            region[RADIUS] + slack,
            abs(ex * wy - ey * wx),
            -(wx * ex + wy * ey),
        )
        if height > radius:
            return 1.0, 0.0
        half = math.sqrt((radius - height) * (radius + height))
        lo, hi = max(lo, middle - half), min(hi, middle + half)
    for side in range(FRONT, end_of_sides(region), SIDE):
        nx, ny = region[side + NX], region[side + NY]
        depth = region[side + DEPTH] + nx * wx + ny * wy
        lo, hi = span_in_half_plane(lo, hi, depth, nx * ex + ny * ey)
    return lo, hi
