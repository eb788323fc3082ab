"""A path along edges, shortened across the faces beside it (section 5, step 1).

The path becomes a strip of faces. A strip is known by its *portals*, the half-edges over which it
enters its faces: a portal's tail lies left of the path and its head right. A funnel walk finds the
shortest path within the strip. Where that bends around a vertex and the angle beyond the vertex is
less than π, the strip is led past the vertex on its other side. This goes on until the path is
straight wherever it can be: a local minimum, which is mostly the shortest path already.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    SEAM,
    SIN_LEFT,
    TAIL,
    Topology,
    following,
    previous,
)
from geodesic_core.tolerances import PASSES, STRAIGHT

# Sides on which a strip passes a vertex; a vertex that it cannot pass divides the path
NEITHER = 0
RIGHT = 1
LEFT = 2

_SPARE_PORTALS = 256
"""Room for portals that a strip gains when it is led past vertices, in all."""


@kernel
def shortened(topology: Topology, path: Ints) -> float:
    """Shorten a path along edges, given by its vertices; return its length, mesh units."""
    length = 0.0
    begin = 0
    sides = np.empty(len(path), np.int8)
    for i in range(1, len(path)):
        sides[i] = NEITHER
        if i + 1 < len(path):
            sides[i] = side_to_pass(topology, path[i - 1], path[i], path[i + 1])
        if sides[i] == NEITHER:
            length += shortened_part(topology, path[begin : i + 1], sides[begin : i + 1])
            begin = i
    return length


@kernel
def shortened_part(topology: Topology, path: Ints, sides: Any) -> float:
    """Shorten a part of a path that has a strip of faces beside it all along; return its length."""
    strip, size = strip_along(topology, path, sides)
    room = len(strip)
    other = np.empty(room, np.int32)
    ends = np.empty((room + 1, 4))
    bends, bend_sides = np.empty(room, np.int32), np.empty(room, np.int8)
    turns = np.empty(room)
    length = math.inf
    for _ in range(PASSES):
        if size == 0:  # the path is an edge
            return min(length, edge_length(topology, path[0], path[-1]))
        unfold_strip(topology, strip, size, ends)
        taut, count = pull_taut(ends, size, bends, bend_sides, turns)
        if taut >= length * (1.0 - STRAIGHT):
            return min(taut, length)
        length = taut
        changed, size = around_bends(topology, strip, size, bends[:count], bend_sides, turns, other)
        if not changed:
            return length
        strip, other = other, strip
    return length


@kernel
def edge_length(topology: Topology, v: int, u: int) -> float:
    """Length of the edge between two neighbours, mesh units."""
    h = corner_toward(topology, v, u, HEAD)
    if h >= 0:
        return float(topology.geometry[h, LENGTH])
    return float(topology.geometry[corner_toward(topology, v, u, APEX), LENGTH_LEFT])


@inlined
def corner_toward(topology: Topology, v: int, u: int, column: int) -> int:
    """Corner at v whose HEAD or APEX is u, or -1."""
    for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
        if topology.links[topology.corners[c], column] == u:
            return topology.corners[c]
    return -1


@kernel
def side_to_pass(topology: Topology, before: int, v: int, after: int) -> int:
    """Side of v with the lesser angle between two of its neighbours; one without a hole.

    At the end of an irregular edge there are more than two sides. Then it is NEITHER.
    """
    if topology.flags[v] & SEAM:
        return NEITHER
    right = angle_on_right(topology, before, v, after)
    left = angle_on_right(topology, after, v, before)
    if right == math.inf and left == math.inf:
        return NEITHER
    return RIGHT if right <= left else LEFT


@kernel
def angle_on_right(topology: Topology, before: int, v: int, after: int) -> float:
    """Angle at v from one neighbour counter-clockwise to another; infinite if a hole lies there."""
    angle = 0.0
    h = corner_toward(topology, v, before, HEAD)
    for _ in range(topology.first_corner[v + 1] - topology.first_corner[v]):
        if h < 0:
            return math.inf
        angle += math.atan2(topology.geometry[h, SIN_LEFT], topology.geometry[h, COS_LEFT])
        if topology.links[h, APEX] == after:
            return angle
        h = topology.links[previous(h), OPPOSITE]
    return math.inf


@kernel
def strip_along(topology: Topology, path: Ints, sides: Any) -> tuple[Ints, int]:
    """Return the portals of a strip along a path, with room for more, and their number."""
    links = topology.links
    room = _SPARE_PORTALS
    for v in path:
        room += 4 * (topology.first_corner[v + 1] - topology.first_corner[v])
    strip = np.empty(room, np.int32)
    size = 0
    for i in range(1, len(path) - 1):
        v, before, after = path[i], path[i - 1], path[i + 1]
        if sides[i] == RIGHT:
            h = corner_toward(topology, v, before, HEAD)
            if i > 1 and sides[i - 1] == LEFT:  # over the edge between the two
                strip[size] = h
                size += 1
            while links[h, APEX] != after:
                h = links[previous(h), OPPOSITE]
                strip[size] = h
                size += 1
        else:
            h = corner_toward(topology, v, before, APEX)
            if i > 1 and sides[i - 1] == RIGHT:
                strip[size] = previous(h)
                size += 1
            while links[h, HEAD] != after:
                across = links[h, OPPOSITE]
                strip[size] = across
                size += 1
                h = following(across)
    return strip, size


@kernel
def unfold_strip(topology: Topology, strip: Ints, size: int, ends: Floats) -> None:
    """Unfold a strip into the plane: fill ``ends`` with rows of left x, y and right x, y.

    Row i is portal i, and the last row the vertex at the end. The vertex at the start, before the
    first portal, is the origin.
    """
    geometry = topology.geometry
    h = topology.links[strip[0], OPPOSITE]
    ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
    ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
    lx, ly, rx, ry = geometry[h, LENGTH] - ax, -ay, -ax, -ay
    for i in range(size):
        h = strip[i]
        ends[i, 0], ends[i, 1], ends[i, 2], ends[i, 3] = lx, ly, rx, ry
        ex, ey = (rx - lx) / geometry[h, LENGTH], (ry - ly) / geometry[h, LENGTH]
        along = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
        ahead = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
        ax, ay = lx + along * ex - ahead * ey, ly + along * ey + ahead * ex
        if i + 1 < size and strip[i + 1] == topology.links[previous(h), OPPOSITE]:
            rx, ry = ax, ay
        else:
            lx, ly = ax, ay
    ends[size, 0], ends[size, 1], ends[size, 2], ends[size, 3] = ax, ay, ax, ay


@inlined
def area(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Twice the area of the triangle a b c, positive if counter-clockwise."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


class Funnel(NamedTuple):
    """The part of the plane that is in sight of the string's last bend, through the portals."""

    px: float
    py: float
    """The last bend, the funnel's apex"""
    lx: float
    ly: float
    """The end of a portal that bounds the sight on the left"""
    left: int
    """Number of that portal"""
    rx: float
    ry: float
    """The same on the right"""
    right: int


@inlined
def open_funnel(ends: Floats, i: int, px: float, py: float) -> Funnel:
    """Return the funnel from an apex through portal i."""
    return Funnel(px, py, ends[i, 0], ends[i, 1], i, ends[i, 2], ends[i, 3], i)


@inlined
def narrow_funnel(ends: Floats, i: int, funnel: Funnel) -> tuple[int, Funnel]:
    """Narrow a funnel to portal i; return the side on which it closes, or NEITHER, and it."""
    px, py, lx, ly, left, rx, ry, right = funnel
    nx, ny = ends[i, 2], ends[i, 3]
    if area(px, py, rx, ry, nx, ny) >= 0.0:
        if area(px, py, lx, ly, nx, ny) > 0.0:
            return LEFT, funnel
        rx, ry, right = nx, ny, i
    nx, ny = ends[i, 0], ends[i, 1]
    side = NEITHER
    if area(px, py, lx, ly, nx, ny) <= 0.0:
        if area(px, py, rx, ry, nx, ny) >= 0.0:
            lx, ly, left = nx, ny, i
        else:
            side = RIGHT
    return side, Funnel(px, py, lx, ly, left, rx, ry, right)


@kernel
def pull_taut(
    ends: Floats, size: int, bends: Ints, bend_sides: Any, turns: Floats
) -> tuple[float, int]:
    """Pull a string taut within a strip; return its length and the number of its bends.

    Fills ``bends`` with the portals at whose ends the string bends, ``bend_sides`` with the sides
    of these ends, and ``turns`` with the angles, radians.
    """
    count, length, dx, dy = 0, 0.0, 0.0, 0.0  # (dx, dy): the straight part before
    i, funnel = 1, open_funnel(ends, 0, 0.0, 0.0)
    while True:
        side = NEITHER
        while i <= size:
            side, funnel = narrow_funnel(ends, i, funnel)
            if side != NEITHER:
                break
            i += 1
        # The string reaches the end, or bends where the funnel closes
        bx, by, portal = ends[size, 0], ends[size, 1], size
        if side == LEFT:
            bx, by, portal = funnel.lx, funnel.ly, funnel.left
        elif side == RIGHT:
            bx, by, portal = funnel.rx, funnel.ry, funnel.right
        ex, ey = bx - funnel.px, by - funnel.py
        length += math.sqrt(ex * ex + ey * ey)
        if count > 0:
            turns[count - 1] = abs(math.atan2(dx * ey - dy * ex, dx * ex + dy * ey))
        if portal >= size or count >= len(bends):
            return length, count
        bends[count], bend_sides[count] = portal, side
        count += 1
        dx, dy = ex, ey
        # On from the first portal that leaves this vertex behind
        i, column = portal + 1, 0 if side == LEFT else 2
        while i < size and ends[i, column] == bx and ends[i, column + 1] == by:
            i += 1
        funnel = open_funnel(ends, i, bx, by)
        i += 1


@kernel
def around_bends(
    topology: Topology,
    strip: Ints,
    size: int,
    bends: Ints,
    bend_sides: Any,
    turns: Floats,
    other: Ints,
) -> tuple[bool, int]:
    """Lead a strip past its bends on their other side, where that shortens the path.

    Writes the new strip to ``other``; returns whether it differs, and its size.
    """
    links = topology.links
    copied, new_size = 0, 0
    for k in range(len(bends)):
        end = TAIL if bend_sides[k] == LEFT else HEAD
        first = last = bends[k]
        v = links[strip[first], end]
        beyond = topology.total_angle[v] - math.pi - turns[k]
        if beyond >= math.pi - STRAIGHT:
            continue
        while first > 0 and links[strip[first - 1], end] == v:
            first -= 1
        while last + 1 < size and links[strip[last + 1], end] == v:
            last += 1
        if copied > 0 and first <= copied:  # its face before is no longer on the strip
            continue
        end_size = pass_beyond(
            topology, strip, first, last, bend_sides[k], size, other, new_size + first - copied
        )
        if end_size < 0:
            continue
        for i in range(copied, first):
            other[new_size + i - copied] = strip[i]
        copied, new_size = last + 1, end_size
    if copied == 0 or new_size + size - copied > len(other):
        return False, size
    for i in range(copied, size):
        other[new_size + i - copied] = strip[i]
    return True, new_size + size - copied


@kernel
def pass_beyond(
    topology: Topology,
    strip: Ints,
    first: int,
    last: int,
    side: int,
    size: int,
    other: Ints,
    begin: int,
) -> int:
    """Write the portals around a vertex on its other side, which replace those from first to last.

    They are written to ``other`` from row ``begin`` on. Returns the row after the last, or -1 if a
    hole is in the way or there is no room. An edge at an end of the path is no portal.
    """
    links = topology.links
    entered = links[strip[first], OPPOSITE]
    if side == LEFT:
        h = links[following(entered), OPPOSITE]
        goal = previous(strip[last])
    else:
        h = links[previous(entered), OPPOSITE]
        goal = following(strip[last])
    if h == goal:
        # One face on both sides: the rest of the strip must begin and end where it did.
        if (
            last + 1 == size
            and first > 0
            and links[strip[first - 1], APEX] != links[strip[last], APEX]
        ):
            return -1
        if first == 0 and last + 1 < size:
            h_after = links[strip[last + 1], OPPOSITE]
            if links[h_after, APEX] != links[entered, APEX]:
                return -1
    is_end, row = first == 0, begin
    while h >= 0:
        if h == goal and last + 1 == size:
            return row
        if not is_end:
            if row >= len(other):
                return -1
            other[row] = h
            row += 1
        if h == goal:
            return row
        is_end = False
        h = links[following(h) if side == LEFT else previous(h), OPPOSITE]
    return -1
