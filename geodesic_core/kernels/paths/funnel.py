"""Strips of faces, and strings pulled taut in them.

A path becomes a strip of faces. A strip is known by its *portals*, the half-edges over which it
enters its faces: a portal's tail lies left of the path and its head right. A funnel walk finds the
shortest path within the strip. Where that bends around a vertex and the angle beyond the vertex is
less than π, the strip is led past the vertex on its other side. This goes on until the path is
straight wherever it can be: it is then shortest among all that lie near it.

It ends. A path on the other side of such a vertex is shorter, and there are not many strips whose
strings are no longer than a given length: a string crosses an edge within its length, and meets a
vertex at least its edges' heights after it has left the one before. What rounding hides is bounded
by STALLS, and all of it by the number of passes that the caller grants.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    APEX_ANGLE,
    BOUNDARY,
    COS_LEFT,
    COS_RIGHT,
    FANS,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    point_in_frame,
    previous,
)
from geodesic_core.tolerances import PASSES, STALLS, STRAIGHT

Place = tuple[float, float]

# On which side of a strip a vertex is
NEITHER = 0
RIGHT = 1
LEFT = 2


class Strip(NamedTuple):
    """Faces one after another, and the two points between which a string lies in them."""

    portals: Ints
    """(N,): the half-edges over which the faces after the first are entered"""
    faces: Longs
    """(2,): the first and the last face"""
    weights: Floats
    """(2, 3): the points in them"""


class String(NamedTuple):
    """A strip unfolded into the plane, and the shortest line in it."""

    ends: Floats
    """(N + 1, 4): left x, y and right x, y of each portal, and the last point twice; the first
    point is the origin"""
    bends: Ints
    """(K,): portals at whose ends it bends"""
    sides: Any
    """(K,): the sides of these ends"""
    length: float
    """Mesh units"""


@kernel
def shortened(topology: Topology, path: Ints) -> float:
    """Shorten a path along edges, given by its vertices; return its length, mesh units."""
    count = len(path) - 1
    faces = np.empty(count, np.int64)
    starts, ends = np.zeros((count, 3)), np.zeros((count, 3))
    for i in range(count):
        faces[i], corner, other = edge_in_face(topology, path[i], path[i + 1])
        starts[i, corner], ends[i, other] = 1.0, 1.0
    length, first = 0.0, 0
    while first < count:
        strip, first = strip_along(topology, faces, starts, ends, first)
        length += straightened(topology, strip, STRAIGHT, STRAIGHT, PASSES)[1].length
    return length


@kernel
def edge_in_face(topology: Topology, v: int, u: int) -> tuple[int, int, int]:
    """Return a face of the edge between two neighbours, and which of its corners they are."""
    h = topology.corners[topology.first_corner[v]]
    for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
        h = topology.corners[c]
        if topology.links[h, HEAD] == u:
            return h // 3, h % 3, (h + 1) % 3
        if topology.links[h, APEX] == u:
            break
    return h // 3, h % 3, (h + 2) % 3


@kernel
def straightened(
    topology: Topology, strip: Strip, straight: float, gain: float, passes: int
) -> tuple[Strip, String, bool]:
    """Lead a strip past its bends until its string is straight there, or gains no more.

    ``straight``: radians by which it may be bent; ``gain``: the share of its length that a pass is
    to gain. Return the strip, its string, and whether ``passes`` passes were enough.
    """
    length, stalls = math.inf, 0
    for _ in range(passes):
        strip = trimmed(topology, strip)
        string = pulled_taut(topology, strip)
        stalls = stalls + 1 if string.length >= length * (1.0 - gain) else 0
        length = min(length, string.length)
        if stalls > (STALLS if gain == 0.0 else 0):
            return strip, string, True
        changed, portals = around_bends(topology, strip, string, straight)
        if not changed:
            return strip, string, True
        strip = Strip(portals, strip.faces, strip.weights)
    strip = trimmed(topology, strip)
    return strip, pulled_taut(topology, strip), False


@kernel
def strip_along(
    topology: Topology, faces: Longs, starts: Floats, ends: Floats, begin: int
) -> tuple[Strip, int]:
    """Return the strip of a line, and its first segment that no strip joins to those before.

    ``faces`` (N,) hold the segments, from the weights of a row of ``starts`` to that of ``ends``;
    the line begins with segment ``begin``.
    """
    portals, size, i = np.empty(64, np.int32), 0, begin
    while i + 1 < len(faces):
        f, g, corner = faces[i], faces[i + 1], corner_with(ends[i], 1.0)
        if f != g and corner >= 0:
            v = topology.links[3 * f + corner, TAIL]
            degree = topology.first_corner[v + 1] - topology.first_corner[v]
            portals = with_room(portals, size, 2 * degree)
            first, end = size, around_vertex(topology.links, f, corner, g, RIGHT, portals, size)
            left = around_vertex(topology.links, f, corner, g, LEFT, portals, size + degree)
            is_left = end < 0
            if end >= 0 and left >= 0:  # the way with the lesser angle
                h = half_edge_from(topology.links, g, v)
                start = direction_from_tail(topology, 3 * f + corner, starts[i])
                _, around = fan_at(topology, portals[size + degree], LEFT)
                angle = turned(start, direction_from_tail(topology, h, ends[i + 1]), around)
                is_left = 2.0 * angle <= around
            if is_left:
                first, end = size + degree, left
            if end < 0:
                break
            size = reduced(topology.links, portals, size, first, end)
        elif f != g:
            h = edge_between(topology.links, f, g, starts[i + 1])
            if h < 0:
                break
            portals = with_room(portals, size, 1)
            portals[size] = h
            size = reduced(topology.links, portals, size, size, size + 1)
        i += 1
    ends_of = np.empty((2, 3))
    ends_of[0], ends_of[1] = starts[begin], ends[i]
    return Strip(portals[:size].copy(), np.array([faces[begin], faces[i]]), ends_of), i + 1


@inlined
def half_edge_from(links: Ints, face: int, v: int) -> int:
    """Half-edge of a face that leaves its corner v."""
    h = 3 * face
    while links[h, TAIL] != v:
        h += 1
    return h


@inlined
def direction_from_tail(topology: Topology, h: int, weights: Floats) -> float:
    """Direction from the tail of h to a point of its face, in the tail's unfolded fan, radians."""
    x, y = point_in_frame(topology.geometry, h, weights)
    return topology.geometry[following(h), APEX_ANGLE] + math.atan2(y, x)


@kernel
def with_room(portals: Ints, size: int, more: int) -> Ints:
    """Return portals with room for some more."""
    if size + more <= len(portals):
        return portals
    larger = np.empty(2 * (size + more), np.int32)
    larger[:size] = portals[:size]
    return larger


@inlined
def corner_with(weights: Floats, weight: float) -> int:
    """Return the corner of a face that has a weight, or -1."""
    for k in range(3):
        if weights[k] == weight:
            return k
    return -1


@kernel
def edge_between(links: Ints, f: int, g: int, weights: Floats) -> int:
    """Return the half-edge of face g over which f is, and a point on it; -1 if there is none."""
    found = -1
    for h in range(3 * g, 3 * g + 3):
        across, up = links[h, OPPOSITE], weights[(h + 2) % 3]
        if across >= 0 and across // 3 == f and (found < 0 or up < weights[(found + 2) % 3]):
            found = h
    return found


@inlined
def turned(start: float, end: float, around: float) -> float:
    """Angle counter-clockwise between two directions in a closed fan, of the angle ``around``."""
    angle = end - start
    return angle if angle >= 0.0 else angle + around


@kernel
def around_vertex(
    links: Ints, f: int, corner: int, g: int, side: int, portals: Ints, row: int
) -> int:
    """Write the portals from face f around its corner to face g, which have it on a side.

    Return the row after the last, -1 if a hole is in the way.
    """
    h = 3 * f + corner
    if side == RIGHT:  # clockwise: over the half-edge that leaves it
        h = following(following(h))
    while True:
        h = next_portal(links, h, side)
        if h < 0 or h // 3 == f:
            return -1
        portals[row] = h
        row += 1
        if h // 3 == g:
            return row


@inlined
def next_portal(links: Ints, h: int, side: int) -> int:
    """Portal after h around the vertex at its end on a side; negative if there is none."""
    return links[previous(h) if side == LEFT else following(h), OPPOSITE]


@inlined
def angle_at(geometry: Floats, h: int, side: int) -> float:
    """Angle of a face at the end of its portal on a side, radians."""
    if side == LEFT:
        return math.atan2(geometry[h, SIN_LEFT], geometry[h, COS_LEFT])
    return math.atan2(geometry[h, SIN_RIGHT], geometry[h, COS_RIGHT])


@kernel
def reduced(links: Ints, portals: Ints, size: int, begin: int, end: int) -> int:
    """Append portals from row ``begin`` to ``end`` to the first ``size``; return how many are left.

    What leads over an edge and back at once is left out. Modifies ``portals``.
    """
    for i in range(begin, end):
        h = portals[i]
        if size > 0 and links[portals[size - 1], OPPOSITE] == h:
            size -= 1
        else:
            portals[size] = h
            size += 1
    return size


@kernel
def trimmed(topology: Topology, strip: Strip) -> Strip:
    """Return a strip without the portals that its first or last point lies on."""
    links, portals, faces, weights = topology.links, strip.portals, strip.faces, strip.weights
    faces, weights = faces.copy(), weights.copy()
    lo, hi = 0, len(portals)
    while lo < hi and weights[0, (links[portals[lo], OPPOSITE] + 2) % 3] == 0.0:
        move_over(weights[0], links[portals[lo], OPPOSITE], portals[lo])
        faces[0] = portals[lo] // 3
        lo += 1
    while lo < hi and weights[1, (portals[hi - 1] + 2) % 3] == 0.0:
        move_over(weights[1], portals[hi - 1], links[portals[hi - 1], OPPOSITE])
        faces[1] = links[portals[hi - 1], OPPOSITE] // 3
        hi -= 1
    return Strip(portals[lo:hi], faces, weights)


@inlined
def move_over(weights: Floats, g: int, h: int) -> None:
    """Write the weights of a point on half-edge g as those in the face of its opposite h."""
    tail, head = weights[g % 3], weights[(g + 1) % 3]
    weights[h % 3], weights[(h + 1) % 3], weights[(h + 2) % 3] = head, tail, 0.0


@kernel
def pulled_taut(topology: Topology, strip: Strip) -> String:
    """Return the string of a strip."""
    size = len(strip.portals)
    ends = np.empty((size + 1, 4))
    unfold_strip(topology, strip, ends)
    bends, sides = np.empty(size, np.int32), np.empty(size, np.int8)
    length, count = pull_taut(ends, size, bends, sides)
    return String(ends, bends[:count], sides[:count], length)


@kernel
def unfold_strip(topology: Topology, strip: Strip, ends: Floats) -> None:
    """Unfold a strip into the plane: fill ``ends``, see `String`."""
    geometry, portals, size = topology.geometry, strip.portals, len(strip.portals)
    if size == 0:
        h = 3 * strip.faces[0]
        ax, ay = point_in_frame(geometry, h, strip.weights[0])
        bx, by = point_in_frame(geometry, h, strip.weights[1])
        ends[0, 0] = ends[0, 2] = bx - ax
        ends[0, 1] = ends[0, 3] = by - ay
        return
    h = topology.links[portals[0], OPPOSITE]
    ax, ay = point_in_frame(geometry, h, strip.weights[0])
    lx, ly, rx, ry = geometry[h, LENGTH] - ax, -ay, -ax, -ay
    for i in range(size):
        h = portals[i]
        ends[i, 0], ends[i, 1], ends[i, 2], ends[i, 3] = lx, ly, rx, ry
        ex, ey = (rx - lx) / geometry[h, LENGTH], (ry - ly) / geometry[h, LENGTH]
        along = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
        ahead = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
        if i + 1 == size:
            along, ahead = point_in_frame(geometry, h, strip.weights[1])
        ax, ay = lx + along * ex - ahead * ey, ly + along * ey + ahead * ex
        if i + 1 < size and portals[i + 1] == topology.links[previous(h), OPPOSITE]:
            rx, ry = ax, ay
        else:
            lx, ly = ax, ay
    ends[size, 0], ends[size, 1], ends[size, 2], ends[size, 3] = ax, ay, ax, ay


@inlined
def area(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Twice the area of the triangle a b c, positive if counter-clockwise."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@inlined
def angle_between(ax: float, ay: float, bx: float, by: float) -> float:
    """Angle between two vectors, radians, 0 to π."""
    return abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))


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
def pull_taut(ends: Floats, size: int, bends: Ints, sides: Any) -> tuple[float, int]:
    """Pull a string taut within a strip; return its length and the number of its bends.

    Fills ``bends`` with the portals at whose ends the string bends, and ``sides`` with the sides of
    these ends.
    """
    count, length = 0, 0.0
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
        length += math.hypot(bx - funnel.px, by - funnel.py)
        if portal >= size or count >= len(bends):
            return length, count
        bends[count], sides[count] = portal, side
        count += 1
        # On from the first portal that leaves this vertex behind
        i, column = portal + 1, 0 if side == LEFT else 2
        while i < size and ends[i, column] == bx and ends[i, column + 1] == by:
            i += 1
        funnel = open_funnel(ends, i, bx, by)
        i += 1


@kernel
def around_bends(
    topology: Topology, strip: Strip, string: String, straight: float
) -> tuple[bool, Ints]:
    """Lead a strip past its bends on their other side, where that shortens the path.

    Return whether its portals differ, and them.
    """
    links, portals = topology.links, strip.portals
    string = with_touched(string, straight)
    bends, sides, room = string.bends, string.sides, len(portals)
    for k in range(len(bends)):
        v = links[portals[bends[k]], TAIL if sides[k] == LEFT else HEAD]
        room += topology.first_corner[v + 1] - topology.first_corner[v]
    other, size, copied = np.empty(room, np.int32), 0, 0
    for k in range(len(bends)):
        first, last = run_at(links, portals, bends[k], sides[k])
        count, around = fan_at(topology, portals[first], sides[k])
        run = last + 1 - first
        # A run that another one has changed has its turn in the next pass
        if first < copied or count == 0:
            continue
        if run < count and around - angle_in_strip(
            topology, strip, string, k, first, last, around
        ) >= (math.pi - straight):
            continue
        end = size + first - copied
        other[size:end] = portals[copied:first]
        if run < count:
            other_side = LEFT if sides[k] == RIGHT else RIGHT
            h = links[portals[first], OPPOSITE]
            for _ in range(count - run):
                h = next_portal(links, h, other_side)
                other[end] = h
                end += 1
        else:  # once around the vertex, and more
            other[end : end + run - count] = portals[first : first + run - count]
            end += run - count
        size, copied = reduced(links, other, size, size, end), last + 1
    if copied == 0:
        return False, portals
    end = size + len(portals) - copied
    other[size:end] = portals[copied:]
    return True, other[: reduced(links, other, size, size, end)]


@kernel
def with_touched(string: String, straight: float) -> String:
    """Return a string that also counts as bends what it passes straight: ends of portals on it.

    Beside a tip, the other side of such a vertex may be shorter.
    """
    ends, size, k, count = string.ends, len(string.ends) - 1, 0, 0
    bends, sides = np.empty(2 * size, np.int32), np.empty(2 * size, np.int8)
    ax, ay = 0.0, 0.0
    for i in range(size):
        portal, column = size, 0
        if k < len(string.bends):
            portal, column = string.bends[k], 0 if string.sides[k] == LEFT else 2
        bx, by = ends[portal, column], ends[portal, column + 1]
        for side in (LEFT, RIGHT):
            end = 0 if side == LEFT else 2
            x, y = ends[i, end], ends[i, end + 1]
            if portal < size and end == column and x == bx and y == by:
                is_new = i == portal
            else:
                is_new = i == 0 or ends[i - 1, end] != x or ends[i - 1, end + 1] != y
                is_new = is_new and is_between(ax, ay, bx, by, x, y, straight)
            if is_new:
                bends[count], sides[count] = i, side
                count += 1
        is_left = ends[i + 1, column] != bx or ends[i + 1, column + 1] != by
        if portal < size and i >= portal and is_left:
            ax, ay, k = bx, by, k + 1
    return String(ends, bends[:count], sides[:count], string.length)


@inlined
def is_between(
    ax: float, ay: float, bx: float, by: float, x: float, y: float, straight: float
) -> bool:
    """Whether a point is on the line from a to b, seen from both but for an angle."""
    if (x - ax) * (bx - ax) + (y - ay) * (by - ay) <= 0.0:
        return False
    if (x - bx) * (ax - bx) + (y - by) * (ay - by) <= 0.0:
        return False
    nearer = min((x - ax) ** 2 + (y - ay) ** 2, (x - bx) ** 2 + (y - by) ** 2)
    whole = (bx - ax) ** 2 + (by - ay) ** 2
    return abs(area(ax, ay, bx, by, x, y)) <= straight * math.sqrt(whole) * math.sqrt(nearer)


@kernel
def run_at(links: Ints, portals: Ints, i: int, side: int) -> tuple[int, int]:
    """Return the first and the last of the portals around portal i that share its end on a side."""
    end = TAIL if side == LEFT else HEAD
    first, last, v = i, i, links[portals[i], end]
    while first > 0 and links[portals[first - 1], end] == v:
        first -= 1
    while last + 1 < len(portals) and links[portals[last + 1], end] == v:
        last += 1
    return first, last


@inlined
def fan_at(topology: Topology, portal: int, side: int) -> tuple[int, float]:
    """Return the number of faces all around the end of a portal on a side, and their angle.

    None, where a hole is among them.
    """
    v = topology.links[portal, TAIL if side == LEFT else HEAD]
    if not topology.flags[v] & (BOUNDARY | FANS):
        return topology.first_corner[v + 1] - topology.first_corner[v], topology.total_angle[v]
    h, count, angle = portal, 0, 0.0
    while True:
        angle += angle_at(topology.geometry, h, side)
        count += 1
        h = next_portal(topology.links, h, side)
        if h < 0:
            return 0, angle
        if h == portal:
            return count, angle


@kernel
def angle_in_strip(
    topology: Topology, strip: Strip, string: String, k: int, first: int, last: int, around: float
) -> float:
    """Angle at bend k between the parts of the string before and after it, through the strip.

    The portals from ``first`` to ``last`` share the vertex there; ``around`` is the angle of its
    fan, which they do not go all around.
    """
    ends, bends, sides = string.ends, string.bends, string.sides
    side, portals = sides[k], strip.portals
    here, there = (0, 2) if side == LEFT else (2, 0)
    bx, by = ends[first, here], ends[first, here + 1]
    px, py, after, column = 0.0, 0.0, len(portals), 0
    if k > 0:
        before = 0 if sides[k - 1] == LEFT else 2
        px, py = ends[bends[k - 1], before], ends[bends[k - 1], before + 1]
    if k + 1 < len(bends):
        after, column = bends[k + 1], 0 if sides[k + 1] == LEFT else 2
    ax, ay = ends[first, there] - bx, ends[first, there + 1] - by
    angle = angle_between(px - bx, py - by, ax, ay)
    start = direction_of(topology, portals[first], side)
    end = direction_of(topology, portals[last], side)
    angle += turned(start, end, around) if side == LEFT else turned(end, start, around)
    ax, ay = ends[last, there] - bx, ends[last, there + 1] - by
    return angle + angle_between(ax, ay, ends[after, column] - bx, ends[after, column + 1] - by)


@inlined
def direction_of(topology: Topology, portal: int, side: int) -> float:
    """Direction of a portal in the unfolded fan of its end on a side, radians."""
    h = portal if side == LEFT else topology.links[portal, OPPOSITE]
    return topology.geometry[following(h), APEX_ANGLE]


@kernel
def points_of(strip: Strip, string: String) -> tuple[Longs, Floats]:
    """Return where a string begins, crosses each portal, and ends: faces and weights in them.

    At a bend they are those of the vertex, exactly.
    """
    portals, ends = strip.portals, string.ends
    size = len(portals)
    faces, weights = np.empty(size + 2, np.int64), np.zeros((size + 2, 3))
    faces[0], weights[0] = strip.faces[0], strip.weights[0]
    faces[size + 1], weights[size + 1] = strip.faces[1], strip.weights[1]
    ax, ay, x, y, k = 0.0, 0.0, 0.0, 0.0, 0  # the part of the string begins at a, and goes on at x
    for i in range(size):
        h, lx, ly, rx, ry = portals[i], ends[i, 0], ends[i, 1], ends[i, 2], ends[i, 3]
        bend, column = size, 0
        if k < len(string.bends):
            bend, column = string.bends[k], 0 if string.sides[k] == LEFT else 2
        bx, by = ends[bend, column], ends[bend, column + 1]
        share = share_crossed((ax, ay), (bx, by), (x, y), (lx, ly), (rx, ry))
        x, y = lx + share * (rx - lx), ly + share * (ry - ly)
        if bend < size and ends[i, column] == bx and ends[i, column + 1] == by:
            share, x, y = column / 2.0, bx, by
            last = i + 1 == size or ends[i + 1, column] != bx or ends[i + 1, column + 1] != by
            if last and i >= bend:
                ax, ay, k = bx, by, k + 1
        faces[i + 1] = h // 3
        weights[i + 1, h % 3], weights[i + 1, (h + 1) % 3] = 1.0 - share, share
    return faces, weights


@inlined
def share_crossed(a: Place, b: Place, come_to: Place, left_end: Place, right_end: Place) -> float:
    """Share of the portal from its left to its right end at which the line from a to b crosses it.

    Of a portal along the line it is the point nearest to where the line has come to.
    """
    (ax, ay), (bx, by), (x, y), (lx, ly), (rx, ry) = a, b, come_to, left_end, right_end
    left, right = area(ax, ay, bx, by, lx, ly), area(ax, ay, bx, by, rx, ry)
    dx, dy = rx - lx, ry - ly
    if left - right > 1e-14 * (abs(bx - ax) + abs(by - ay)) * (abs(dx) + abs(dy)):
        share = left / (left - right)
    else:
        share = ((x - lx) * dx + (y - ly) * dy) / (dx * dx + dy * dy)
    return min(max(share, 0.0), 1.0)
