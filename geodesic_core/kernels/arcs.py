r"""One level in one face: the edge of all that is nearer, in closed form.

A window reaches, within a level L, what lies in a disc of radius L - σ around its unfolded
pseudosource and between its two rays. A corner of the face, and a source inside it, reach a whole
disc. What is no farther than L is the union of these, cut to the face. Its edge consists of arcs of
their circles: of each what lies in the face, between its rays, and in none of the others::

              .---.
             / \ / \        Two discs of rays from below: of each circle that part counts
            /  |X|  \       which the other does not reach.
           |  / | \  |

All is planar, in the frame of the face's first half-edge. Arcs are intervals of angles,
counter-clockwise, so that the nearer side is on their left.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.topology import (
    COS_LEFT,
    COS_RIGHT,
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    point_in_frame,
)
from geodesic_core.kernels.wavefront import FACE, NODE
from geodesic_core.kernels.window import B0, B1, SIGMA, SX, SY, reaches
from geodesic_core.tolerances import GAP, LEVEL

# Columns of a disc
CX = 0
CY = 1
RADIUS = 2
N0X = 3  # the normal, inward, of the ray at b0; zero where there is no ray
N0Y = 4
N1X = 5
N1Y = 6
DISC = 7

# Columns of an arc, of the circle around (CX, CY)
FROM_ANGLE = 3
TO_ANGLE = 4
ARC = 5

TURN = 2.0 * math.pi
_INTERVALS = 16  # that a circle, a face and a window's two rays can have in common, at most


@kernel
def half_edge_in_face(geometry: Floats, h: int) -> tuple[float, float, float, float]:
    """Tail and direction of h in the frame of its face's first half-edge."""
    first = h - h % 3
    if h == first:
        return 0.0, 0.0, 1.0, 0.0
    if h == first + 1:
        x = geometry[first, LENGTH]
        return x, 0.0, -geometry[first, COS_RIGHT], geometry[first, SIN_RIGHT]
    cosine, sine = geometry[first, COS_LEFT], geometry[first, SIN_LEFT]
    reach = geometry[first, LENGTH_LEFT]
    return reach * cosine, reach * sine, -cosine, -sine


@kernel
def with_room(rows: Any, needed: int) -> Any:
    """Return the rows in an array that has room for so many."""
    if needed <= len(rows):
        return rows
    larger = np.empty((max(2 * len(rows), needed), rows.shape[1]), rows.dtype)
    for i in range(len(rows)):
        for column in range(rows.shape[1]):
            larger[i, column] = rows[i, column]
    return larger


@kernel
def discs_of_face(topology: Any, field: Any, face: int, level: float) -> Floats:
    """Return what the windows, the corners and the sources of a face reach within a level.

    Windows come first: of what reaches equally far, they count.
    """
    geometry, kept = topology.geometry, field.kept
    rows = kept.first[3 * face + 3] - kept.first[3 * face]
    discs = np.zeros((rows + 3 + field.source_rows, DISC))
    count, reach = 0, level * (1.0 + LEVEL)
    for h in range(3 * face, 3 * face + 3):
        ox, oy, ux, uy = half_edge_in_face(geometry, h)
        gap = GAP * geometry[h, LENGTH]
        for i in range(kept.first[h], kept.first[h + 1]):
            w = kept.windows[i]
            sx, sy = w[SX], w[SY]
            if not reaches(w[B0], w[B1], sx, sy, w[SIGMA], reach):
                continue
            disc = discs[count]
            count += 1
            disc[CX], disc[CY] = ox + sx * ux - sy * uy, oy + sx * uy + sy * ux
            disc[RADIUS] = level - w[SIGMA]
            for end in range(2):
                x = w[B0] - gap - sx if end == 0 else w[B1] + gap - sx
                length = math.hypot(x, sy)
                if length > 0.0:
                    turn = 1.0 if end == 0 else -1.0
                    nx, ny = -turn * sy / length, -turn * x / length
                    disc[N0X + 2 * end] = nx * ux - ny * uy
                    disc[N0Y + 2 * end] = nx * uy + ny * ux
    for k in range(field.source_rows):
        if field.site_ints[k, FACE] == face:
            radius = level - field.distance[field.site_ints[k, NODE]]
            if radius >= 0.0:
                disc = discs[count]
                count += 1
                disc[CX], disc[CY] = point_in_frame(geometry, 3 * face, field.site_weights[k])
                disc[RADIUS] = radius
    for h in range(3 * face, 3 * face + 3):
        radius = level - field.distance[topology.links[h, TAIL]]
        if radius >= 0.0:
            disc = discs[count]
            count += 1
            disc[CX], disc[CY], _, _ = half_edge_in_face(geometry, h)
            disc[RADIUS] = radius
    return discs[:count]


@kernel
def span_on_edge(
    disc: Floats, ox: float, oy: float, ux: float, uy: float, length: float
) -> tuple[float, float]:
    """Where a disc, between its rays, meets an edge: from, to; nowhere if from > to."""
    wx, wy = ox - disc[CX], oy - disc[CY]
    height, middle = abs(ux * wy - uy * wx), -(wx * ux + wy * uy)
    if height > disc[RADIUS]:
        return 1.0, 0.0
    half = math.sqrt((disc[RADIUS] - height) * (disc[RADIUS] + height))
    lo, hi = max(middle - half, 0.0), min(middle + half, length)
    for n in (N0X, N1X):
        rate = disc[n] * ux + disc[n + 1] * uy
        depth = disc[n] * wx + disc[n + 1] * wy
        if rate > 0.0:
            lo = max(lo, -depth / rate)
        elif rate < 0.0:
            hi = min(hi, -depth / rate)
        elif depth < 0.0:
            return 1.0, 0.0
    return lo, hi


@kernel
def clip(intervals: Floats, count: int, start: float, width: float) -> int:
    """Cut intervals of angles to an arc; return how many are left."""
    cut, left = np.empty((_INTERVALS, 2)), 0
    for i in range(count):
        lo, hi = intervals[i, 0], intervals[i, 1]
        turn = start + TURN * math.floor((lo - start) / TURN)
        while turn < hi and left < _INTERVALS:
            a, b = max(turn, lo), min(turn + width, hi)
            if b > a:
                cut[left, 0], cut[left, 1] = a, b
                left += 1
            turn += TURN
    for i in range(left):
        intervals[i, 0], intervals[i, 1] = cut[i, 0], cut[i, 1]
    return left


@kernel
def clip_to_half_plane(
    intervals: Floats, count: int, radius: float, depth: float, nx: float, ny: float
) -> int:
    """Cut intervals of a circle to n·p >= 0, its centre at ``depth`` inside; n a unit, or zero."""
    if count == 0 or depth >= radius or (nx == 0.0 and ny == 0.0):
        return count
    if depth <= -radius:
        return 0
    half = math.acos(-depth / radius)
    return clip(intervals, count, math.atan2(ny, nx) - half, 2.0 * half)


@kernel
def clip_to_disc(
    intervals: Floats, count: int, radius: float, dx: float, dy: float, other: float
) -> int:
    """Cut intervals of a circle to a disc of radius ``other``, whose centre is at -(dx, dy)."""
    if count == 0 or other <= 0.0:
        return 0
    d = math.hypot(dx, dy)
    excess = (other - radius) * (other + radius) - d * d
    if excess >= 2.0 * radius * d:
        return count
    if excess <= -2.0 * radius * d:
        return 0
    half = math.acos(excess / (2.0 * radius * d))
    return clip(intervals, count, math.atan2(dy, dx) + half, TURN - 2.0 * half)


@kernel
def arcs_within(topology: Any, face: int, discs: Floats) -> tuple[Floats, Any]:
    """Return the arcs of the discs' circles in the face and between their rays; whose each is."""
    geometry = topology.geometry
    arcs, owners, count = np.empty((len(discs), ARC)), np.empty((len(discs), 1), np.int32), 0
    intervals = np.empty((_INTERVALS, 2))
    ax, ay, _, _ = half_edge_in_face(geometry, 3 * face + 2)
    middle_x, middle_y = (geometry[3 * face, LENGTH] + ax) / 3.0, ay / 3.0
    for i in range(len(discs)):
        disc = discs[i]
        radius = disc[RADIUS]
        if radius <= 0.0:
            continue
        # A whole circle begins where it is farthest from the face.
        intervals[0, 0] = math.atan2(disc[CY] - middle_y, disc[CX] - middle_x)
        intervals[0, 1], left = intervals[0, 0] + TURN, 1
        for h in range(3 * face, 3 * face + 3):
            ox, oy, ux, uy = half_edge_in_face(geometry, h)
            depth = ux * (disc[CY] - oy) - uy * (disc[CX] - ox)
            left = clip_to_half_plane(intervals, left, radius, depth, -uy, ux)
        for n in (N0X, N1X):
            left = clip_to_half_plane(intervals, left, radius, 0.0, disc[n], disc[n + 1])
        arcs, owners = with_room(arcs, count + left), with_room(owners, count + left)
        for k in range(left):
            arcs[count, CX], arcs[count, CY], arcs[count, RADIUS] = disc[CX], disc[CY], radius
            arcs[count, FROM_ANGLE], arcs[count, TO_ANGLE] = intervals[k, 0], intervals[k, 1]
            owners[count, 0] = i
            count += 1
    return arcs[:count], owners[:count]


@kernel
def is_apart(arc: Floats, disc: Floats, reach: float) -> bool:
    """Whether an arc surely is beyond a disc or one of its rays: asked first, without arctangents.

    An arc strays from its chord by no more than its sagitta.
    """
    width = arc[TO_ANGLE] - arc[FROM_ANGLE]
    sagitta = 2.0 * arc[RADIUS]
    if width < math.pi:
        sagitta = arc[RADIUS] * (1.0 - math.cos(0.5 * width))
    x0, y0 = point_on(arc, arc[FROM_ANGLE])
    x1, y1 = point_on(arc, arc[TO_ANGLE])
    x0, y0, x1, y1 = x0 - disc[CX], y0 - disc[CY], x1 - disc[CX], y1 - disc[CY]
    for n in (N0X, N1X):
        nx, ny = disc[n], disc[n + 1]
        if max(nx * x0 + ny * y0, nx * x1 + ny * y1) + sagitta < 0.0:
            return True
    nearest = min(math.hypot(x0, y0), math.hypot(x1, y1))
    return nearest - 0.5 * arc[RADIUS] * width > reach


@kernel
def point_on(arc: Floats, angle: float) -> tuple[float, float]:
    """Point of an arc's circle."""
    return (
        arc[CX] + arc[RADIUS] * math.cos(angle),
        arc[CY] + arc[RADIUS] * math.sin(angle),
    )


@kernel
def outer_arcs(topology: Any, face: int, discs: Floats, level: float, shortest: float) -> Floats:
    """Return the edge of the union of the discs in the face: arcs that no other disc reaches.

    Where circles coincide within `LEVEL`, the first counts: of it nothing is taken that another
    does not reach by more, and from the others all that it reaches but for as much. What is not
    longer than ``shortest`` is left out. O(n² log n) for n discs.
    """
    arcs, owners = arcs_within(topology, face, discs)
    outer, count = np.empty((len(arcs) + 4, ARC)), 0
    slack = LEVEL * level
    hidden, intervals = np.empty((64, 2)), np.empty((_INTERVALS, 2))
    for a in range(len(arcs)):
        arc, owner, hidden_count = arcs[a], owners[a, 0], 0
        lo, hi, radius = arc[FROM_ANGLE], arc[TO_ANGLE], arc[RADIUS]
        for j in range(len(discs)):
            disc = discs[j]
            reach = disc[RADIUS] + (slack if j < owner else -slack)
            if j == owner or is_apart(arc, disc, reach):
                continue
            dx, dy = arc[CX] - disc[CX], arc[CY] - disc[CY]
            intervals[0, 0], intervals[0, 1], left = lo, hi, 1
            for n in (N0X, N1X):
                depth = disc[n] * dx + disc[n + 1] * dy
                left = clip_to_half_plane(intervals, left, radius, depth, disc[n], disc[n + 1])
            left = clip_to_disc(intervals, left, radius, dx, dy, reach)
            hidden = with_room(hidden, hidden_count + left)
            for k in range(left):  # kept in order
                place = hidden_count
                while place > 0 and hidden[place - 1, 0] > intervals[k, 0]:
                    hidden[place, 0], hidden[place, 1] = hidden[place - 1, 0], hidden[place - 1, 1]
                    place -= 1
                hidden[place, 0], hidden[place, 1] = intervals[k, 0], intervals[k, 1]
                hidden_count += 1
        outer = with_room(outer, count + hidden_count + 1)
        for k in range(hidden_count + 1):
            end = hidden[k, 0] if k < hidden_count else hi
            if (end - lo) * radius > shortest:
                outer[count, CX], outer[count, CY], outer[count, RADIUS] = arc[CX], arc[CY], radius
                outer[count, FROM_ANGLE], outer[count, TO_ANGLE] = lo, end
                count += 1
            if k < hidden_count:
                lo = max(lo, hidden[k, 1])
    return outer[:count]
