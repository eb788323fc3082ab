"""Straightest lines: from a point in a direction, straight on over edges and through vertices.

A line is straight on a face, and over an edge in the unfolded plane. Through a vertex it goes with
equal angles on both sides, each of them half of the vertex's total angle (Polthier and Schmies,
*Straightest Geodesics on Polyhedral Surfaces*, 1998). It ends where it is as long as asked for, or
where it cannot go on.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.jit import borrowed, inlined, kernel, pointer, prefetch
from geodesic_core.kernels.mesh.frames import Frame, axis_of, half_edge_at
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
    LENGTH_RIGHT,
    NO_FACE,
    OPPOSITE,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    next_around,
    point_in_frame,
    previous,
)
from geodesic_core.kernels.mesh.locations import Locations
from geodesic_core.tolerances import THROUGH_VERTEX

# Why a line ends
GOES_ON = 0
AT_LENGTH = 1
AT_BOUNDARY = 2
AT_VERTEX = 3  # lines are to end at vertices
AT_NON_MANIFOLD = 4  # an edge of several faces, or a vertex where several fans meet
AT_COLLAPSED = 5  # it circles on one spot, in faces without area

# Columns of the state of lines, a row each
VERTEX = 0  # int: the line is at this vertex; -1 where it is on a half-edge
HALF_EDGE = 1  # int: the line is on it, about to cross its face
STOP = 2  # int: see above
PASSED = 3  # int: edges and vertices that the line has passed
STILL = 4  # int: how many of these since it last moved
INTS = 5
ANGLE = 0  # float: at a vertex, the direction in its unfolded fan, radians
X = 1  # float: on a half-edge, the position in its frame
Y = 2  # float: 0 but at the end of a line
DX = 3  # float: the direction in that frame, a unit vector
DY = 4
LEFT = 5  # float: length left to go, mesh units
FLOATS = 6


class Line(NamedTuple):
    """A line at a vertex, or on a half-edge whose face it is about to cross."""

    vertex: int
    half_edge: int
    stop: int
    angle: float
    x: float
    y: float
    dx: float
    dy: float
    left: float


@inlined
def on_half_edge(h: int, x: float, dx: float, dy: float, left: float) -> Line:
    """Return a line at x on a half-edge, with so much left to go."""
    return Line(-1, h, GOES_ON, 0.0, x, 0.0, dx, dy, left)


@inlined
def stopped(line: Line, stop: int) -> Line:
    """Return a line that ends where it is, in its face."""
    x, y, dx, dy = line.x, line.y, line.dx, line.dy
    return Line(-1, line.half_edge, stop, 0.0, x, y, dx, dy, line.left)


@inlined
def ahead(line: Line, far: float) -> Line:
    """Return a line farther on in its face."""
    x, y, left = line.x + far * line.dx, line.y + far * line.dy, line.left - far
    return Line(-1, line.half_edge, GOES_ON, 0.0, x, y, line.dx, line.dy, left)


class Trail(NamedTuple):
    """Points at which lines cross edges and vertices, each with the face crossed before."""

    lines: Ints
    """(N,): the line of each point; those of several lines take turns"""
    numbers: Ints
    """(N,): how many the line had passed before"""
    nodes: Ints
    """(N,): a half-edge, or -1 - an inner vertex"""
    parameters: Floats
    """(N,): share of the half-edge from its tail"""
    faces: Ints
    """(N,): inner face"""


TOGETHER = 16
"""Lines that take turns, a face each, so that the next face of one is fetched while others go on.

One after the other they would wait for memory: on meshes of 100,000 faces four fifths of the time.
"""


@kernel
def trace_lines(
    topology: Topology, ints: Longs, floats: Floats, first: int, stops: bool, trail: Trail
) -> tuple[int, int]:
    """Trace lines from row ``first`` on, until all end or the trail is full.

    Return the first line that has not ended, and the number of points on the trail, which are those
    where lines leave faces. With ``stops`` lines end at vertices. Modifies the rows: where a line
    ends, HALF_EDGE, X and Y say where, and DX and DY in which direction; at a vertex, VERTEX and
    ANGLE do.
    """
    topology, trail = borrowed(topology), borrowed(trail)
    ints, floats = borrowed(ints), borrowed(floats)
    count, room, end = 0, len(trail.nodes), len(ints)
    turns = np.full(TOGETHER, end)
    row = first - 1
    for k in range(TOGETHER):
        row = next_going(ints, row)
        turns[k] = row
    while turns.min() < end and count + TOGETHER <= room:
        for k in range(TOGETHER):
            i = turns[k]
            if i < end:
                count = pass_face(topology, ints, floats, i, stops, trail, count)
                if ints[i, STOP] != GOES_ON:
                    row = next_going(ints, row)
                    turns[k] = row
    return turns.min(), count


@inlined
def next_going(ints: Longs, row: int) -> int:
    """Return the first row behind this one whose line goes on, or the number of rows."""
    row = min(row + 1, len(ints))
    while row < len(ints) and ints[row, STOP] != GOES_ON:
        row += 1
    return row


@inlined
def pass_face(
    topology: Topology, ints: Longs, floats: Floats, i: int, stops: bool, trail: Trail, count: int
) -> int:
    """Move the line of row i to the next face, or to its end; return the length of the trail."""
    line = load_line(ints, floats, i)
    if line.vertex >= 0:
        line = into_corner(topology, line)
    line, m, parameter = cross_face(topology, line)
    if line.stop == GOES_ON:
        v = vertex_at(topology.links, m, parameter)
        trail.lines[count], trail.nodes[count] = i, -1 - v if v >= 0 else m
        trail.numbers[count], trail.parameters[count] = ints[i, PASSED], parameter
        trail.faces[count] = line.half_edge // 3
        count, ints[i, PASSED] = count + 1, ints[i, PASSED] + 1
        ints[i, STILL] = ints[i, STILL] + 1 if line.left == floats[i, LEFT] else 0
        if v >= 0:
            line = through_vertex(topology, line, v, stops)
        elif ints[i, STILL] > len(topology.links):  # it has been here before
            line = stopped(line, AT_COLLAPSED)
        else:
            line = over_edge(topology, line, m, parameter)
            fetch_face(topology, line.half_edge)
    store_line(ints, floats, i, line)
    return count


@inlined
def fetch_face(topology: Topology, h: int) -> None:
    """Prefetch what a line reads that enters a face over the half-edge h."""
    prefetch(pointer(topology.geometry), ROW * h)
    links = pointer(topology.links)
    prefetch(links, ROW * following(h))
    prefetch(links, ROW * previous(h))


@inlined
def load_line(ints: Longs, floats: Floats, i: int) -> Line:
    """Return the line of row i."""
    return Line(
        ints[i, VERTEX],
        ints[i, HALF_EDGE],
        ints[i, STOP],
        floats[i, ANGLE],
        floats[i, X],
        floats[i, Y],
        floats[i, DX],
        floats[i, DY],
        floats[i, LEFT],
    )


@inlined
def store_line(ints: Longs, floats: Floats, i: int, line: Line) -> None:
    """Write a line to row i. Modifies both arrays."""
    ints[i, VERTEX], ints[i, HALF_EDGE], ints[i, STOP] = line.vertex, line.half_edge, line.stop
    floats[i, ANGLE], floats[i, X], floats[i, Y] = line.angle, line.x, line.y
    floats[i, DX], floats[i, DY], floats[i, LEFT] = line.dx, line.dy, line.left


@kernel
def into_corner(topology: Topology, line: Line) -> Line:
    """Return a line at a vertex as one on the half-edge that begins the corner it goes into."""
    corner, last = topology.first_corner[line.vertex], topology.first_corner[line.vertex + 1]
    while corner + 1 < last and topology.corner_angles[corner + 1] <= line.angle:
        corner += 1
    inward = line.angle - topology.corner_angles[corner]
    h: Any = np.int64(topology.corners[corner])  # one type of a line
    dy = max(math.sin(inward), 0.0)
    return on_half_edge(h, 0.0, math.cos(inward), dy, line.left)


@kernel
def cross_face(topology: Topology, line: Line) -> tuple[Line, int, float]:
    """Cross the face ahead; return the line, and the node and the parameter where it leaves it.

    The line returned is where it leaves the face, or where it ends within it, in the frame that it
    entered by.
    """
    geometry, h, x, dx, dy = topology.geometry, line.half_edge, line.x, line.dx, line.dy
    length, to_left = geometry[h, LENGTH], geometry[h, LENGTH_LEFT]
    ax, ay = geometry[h, COS_LEFT] * to_left, geometry[h, SIN_LEFT] * to_left
    to_apex = math.hypot(ax - x, ay)
    turn = dx * ay - dy * (ax - x)  # times the distance of the apex: how far the line passes it by
    if dy <= THROUGH_VERTEX and (dx > 0.0 or x > 0.0):  # along the half-edge
        far = length - x if dx > 0.0 else x
        node, parameter = h, 1.0 if dx > 0.0 else 0.0
    elif abs(turn) <= THROUGH_VERTEX * to_apex:
        far, node, parameter = to_apex, previous(h), 0.0
    elif turn > 0.0:  # over the edge from the head to the apex
        cosine, sine = geometry[h, COS_RIGHT], geometry[h, SIN_RIGHT]
        rise = dx * sine + dy * cosine
        far, node = (length - x) * sine / rise, following(h)
        parameter = (length - x) * dy / rise / geometry[h, LENGTH_RIGHT]
    else:  # over the edge from the tail to the apex
        cosine, sine = geometry[h, COS_LEFT], geometry[h, SIN_LEFT]
        rise = dy * cosine - dx * sine
        far, node = x * sine / rise, previous(h)
        parameter = 1.0 - x * dy / rise / to_left
    if line.left <= far:
        return stopped(ahead(line, line.left), AT_LENGTH), node, parameter
    return ahead(line, far), node, parameter


@inlined
def vertex_at(links: Ints, m: int, parameter: float) -> int:
    """Return the end of a half-edge that a share of it is, or -1."""
    v: Any = np.int64(-1)
    if parameter <= THROUGH_VERTEX:
        v = np.int64(links[m, TAIL])
    elif 1.0 - parameter <= THROUGH_VERTEX:
        v = np.int64(links[m, HEAD])
    return v


@kernel
def over_edge(topology: Topology, line: Line, m: int, parameter: float) -> Line:
    """Return a line that leaves its face by the half-edge m, in the frame of the face beyond."""
    geometry, h, dx, dy = topology.geometry, line.half_edge, line.dx, line.dy
    across: Any = np.int64(topology.links[m, OPPOSITE])
    if across < 0:
        return stopped(line, AT_BOUNDARY if across == NO_FACE else AT_NON_MANIFOLD)
    if m == following(h):
        cosine, sine, length = geometry[h, COS_RIGHT], geometry[h, SIN_RIGHT], LENGTH_RIGHT
    else:
        cosine, sine, length = geometry[h, COS_LEFT], -geometry[h, SIN_LEFT], LENGTH_LEFT
    x = (1.0 - parameter) * geometry[h, length]  # and not another cache line, of m
    dx, dy = dx * cosine - dy * sine, dx * sine + dy * cosine
    return on_half_edge(across, x, dx, dy, line.left)


@kernel
def through_vertex(topology: Topology, line: Line, v: int, stops: bool) -> Line:
    """Return a line that comes to v as it goes straight on, or ends there.

    At a boundary it goes on where the surface has half a turn on one side of it, and on one alone.
    Where it cannot go on, its direction is half a turn from where it came.
    """
    total, back = topology.total_angle[v], direction_back(topology, line, v)
    stop, onward = GOES_ON, back + math.pi
    if topology.flags[v] & FANS:
        stop = AT_NON_MANIFOLD
    elif topology.flags[v] & BOUNDARY:
        is_left = total - back >= math.pi - THROUGH_VERTEX
        if is_left == (back >= math.pi - THROUGH_VERTEX):
            stop = AT_BOUNDARY
        else:
            onward = min(onward, total) if is_left else max(back - math.pi, 0.0)
    else:
        onward = back + 0.5 * total
        if onward >= total:
            onward -= total
    if stops and stop == GOES_ON:
        stop = AT_VERTEX
    x, y, dx, dy = line.x, line.y, line.dx, line.dy
    return Line(v, line.half_edge, stop, onward, x, y, dx, dy, line.left)


@kernel
def direction_back(topology: Topology, line: Line, v: int) -> float:
    """Direction at v, in its unfolded fan, in which a line came that crossed the face of v."""
    geometry, h = topology.geometry, line.half_edge
    if topology.links[h, APEX] == v:
        ax = geometry[h, COS_LEFT] * geometry[h, LENGTH_LEFT]
        ay = geometry[h, SIN_LEFT] * geometry[h, LENGTH_LEFT]
        turn = math.atan2(ax * line.dy - ay * line.dx, ax * line.dx + ay * line.dy)
        return float(geometry[h, APEX_ANGLE]) + max(turn, 0.0)
    if topology.links[h, TAIL] == v:
        return float(geometry[following(h), APEX_ANGLE])
    at_head = math.atan2(geometry[h, SIN_RIGHT], geometry[h, COS_RIGHT])
    return float(geometry[previous(h), APEX_ANGLE]) + at_head


@kernel
def begin_lines(
    topology: Topology,
    faces: Ints,
    inner_face: Ints,
    located: Locations,
    frames: Frame,
    angles: Floats,
    lengths: Floats,
) -> tuple[Longs, Floats]:
    """Return rows of lines from canonical points, in the kernels' angles, for these lengths.

    ``faces`` are the caller's. A line that leads off the surface ends where it begins.
    """
    count = len(angles)
    ints, floats = np.zeros((count, INTS), np.int64), np.zeros((count, FLOATS))
    weights = np.empty(3)  # at the corners of the inner face
    for i in range(count):
        v, angle, total = located.vertices[i], angles[i], frames.total_angle[i]
        ints[i, VERTEX], ints[i, HALF_EDGE] = topology.inner_vertex[v] if v >= 0 else -1, -1
        floats[i, ANGLE], floats[i, LEFT] = angle, lengths[i]
        if not frames.is_closed[i] and not -OFF_WEDGE <= angle <= total + OFF_WEDGE:
            ints[i, STOP] = AT_BOUNDARY
        elif v < 0:
            h: Any = half_edge_at(topology, faces, inner_face, located, i)
            if h < 0:
                h = np.int64(3 * inner_face[located.faces[i]])
            elif frames.is_closed[i] and angle >= math.pi:
                h, angle = np.int64(next_around(topology.links, h)), angle - math.pi
            for k in range(3):
                node = topology.links[h // 3 * 3 + k, TAIL]
                weights[k] = weight_of(topology, faces, located, i, node)
            x, y = point_in_frame(topology.geometry, h, weights)
            line = enter_face(topology.geometry, h, x, y, angle, lengths[i])
            store_line(ints, floats, i, line)
    return ints, floats


OFF_WEDGE = 1e-12
"""Radians by which a direction may miss the wedge of the surface at a boundary"""


@inlined
def weight_of(topology: Topology, faces: Ints, located: Locations, i: int, v: int) -> float:
    """Weight that a point has of an inner vertex, 0 where that is none of its face."""
    for k in range(3):
        if topology.inner_vertex[faces[located.faces[i], k]] == v:
            return float(located.weights[i, k])
    return 0.0


@kernel
def directions_of_ends(
    topology: Topology,
    faces: Ints,
    inner_face: Ints,
    located: Locations,
    ints: Longs,
    floats: Floats,
) -> Floats:
    """Return the kernels' angles in which lines would go on at their ends, canonical points."""
    angles, links = np.empty(len(ints)), topology.links
    for i in range(len(ints)):
        h, v = ints[i, HALF_EDGE], located.vertices[i]
        angle = math.atan2(floats[i, DY], floats[i, DX])
        if ints[i, VERTEX] >= 0 or h < 0:
            angle = floats[i, ANGLE]
        elif v >= 0:  # as long as asked for: it was not sent on from there
            line = load_line(ints, floats, i)
            angle = through_vertex(topology, line, topology.inner_vertex[v], True).angle
        else:
            base: Any = half_edge_at(topology, faces, inner_face, located, i)
            if base < 0:
                base = np.int64(3 * inner_face[located.faces[i]])
                angle += axis_of(topology.geometry, h, base)
            elif base // 3 == h // 3:
                angle -= axis_of(topology.geometry, base, h)
            else:
                base = np.int64(next_around(links, base))
                angle += math.pi - axis_of(topology.geometry, base, h)
        angles[i] = angle
    return angles


@kernel
def enter_face(geometry: Floats, h: int, x: float, y: float, angle: float, left: float) -> Line:
    """Return a line from a point inside a face, as if it had come in over an edge.

    (x, y) and ``angle`` are in the frame of h.
    """
    dx, dy, nearest = math.cos(angle), math.sin(angle), math.inf
    line = on_half_edge(h, x, dx, dy, left)
    for _ in range(3):
        if dy > 0.0 and y < nearest * dy:
            nearest = y / dy
            place = min(max(x - nearest * dx, 0.0), geometry[h, LENGTH])
            line = on_half_edge(h, place, dx, dy, left + nearest)
        # To the frame of the following half-edge
        cosine, sine, x = -geometry[h, COS_RIGHT], geometry[h, SIN_RIGHT], x - geometry[h, LENGTH]
        x, y = x * cosine + y * sine, y * cosine - x * sine
        dx, dy = dx * cosine + dy * sine, dy * cosine - dx * sine
        h = following(h)
    return line
