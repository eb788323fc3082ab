"""Backtracing of shortest paths from a finished sweep (section 3.5).

Each vertex keeps its winning window: the half-edge that the window crossed last, the unfolded
pseudosource and the node of that pseudosource. A path consists of straight lines from node to node.
Each line is walked backward, from its end to its pseudosource, by unfolding the faces on the way.
There the path turns toward the pseudosource's own winning window. This copy replaces the paper's
walk around the pseudosource in search of a window, and with it every window list (section 7).

A merged window has no true pseudosource. Where the walk crosses the edge on which two windows were
merged, it turns toward the pseudosource of the one that covers the crossing (section 4.3). Such a
path is no shorter than the exact one, and longer than the field's value by ξ at most.

The sweep does not record from which face of an irregular edge a line came. There the walk *forks*:
it tries the faces in turn, and goes back to the latest fork when it is lost. Any line that ends at
the pseudosource, straight and of the right length, will do. Through sheets upon each other it comes
to the same place in many ways: from there on it is tried once.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.segments import distance_to_segment
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    FACE,
    LEFT,
    LEFT_REFERENCE,
    MERGE,
    MERGE_INTS,
    MERGED_ON,
    NODE,
    PREDECESSOR,
    RIGHT,
    RIGHT_REFERENCE,
    SEGMENT,
    SITE,
    SPLIT,
    WINNER,
    Merges,
    Sites,
    Vertices,
)
from geodesic_core.kernels.jit import inlined, kernel, pointer, pointers
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    AROUND,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OPPOSITE,
    PINCHED,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    previous,
    weights_in_frame,
)
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.tolerances import FORKS, GAP, ON_PATH, SAME_PLACE, TRIES, WIDEST_ERROR

LAST_AT = 1024
"""Half-edges that a walk remembers to have crossed, about; a power of two."""

ALL_LINES = 2**62
"""More than a path has"""

TRIED = 2048
"""Walks of a line that are remembered after forks, about; a power of two."""


class End(NamedTuple):
    """A node that a line of the path ends at, and the window that it was reached by."""

    node: int
    distance: float
    """Distance from the source, mesh units"""
    source: int
    """Index of the nearest source"""
    entry_edge: int
    """-1 at a source: no line ends there"""
    x: float
    """Position in the frame of the entry edge"""
    y: float
    sx: float
    """The pseudosource, in the same frame"""
    sy: float
    reference: int
    """As in `window`: -1 - the node of the pseudosource where nothing was merged"""
    crossing: float
    """Where the path crosses the entry edge; NaN where a straight line or nothing crosses it"""


NO_END = End(-1, math.inf, -1, -1, 0.0, 0.0, 0.0, 0.0, 0, math.nan)


class Winners(NamedTuple):
    """The results of a sweep that backtracing reads."""

    nearest: Ints
    """(N,): index of the nearest source, by node; -1 where unreached"""
    vertices: Vertices
    """Without what only a running sweep needs"""
    merges: Merges
    sites: Sites
    target: End
    """One more node, found after the sweep; `NO_END` for none"""

    def reached(self, node: int) -> tuple[float, int]:
        """Return the distance of a node, and the index of its nearest source."""
        if node == self.target.node:
            return self.target.distance, self.target.source
        return float(self.vertices.distance[node]), int(self.nearest[node])


class View(NamedTuple):
    """A mesh and the results of a sweep, with pointers in place of arrays.

    With the arrays themselves, each call counts their references: tracing took 2.5 to 3 times as
    long.
    """

    mesh: Topology
    winners: Winners
    vertex_count: int
    site_rows: int
    segment_rows: int
    merging: bool
    bends: bool
    """Whether a path may bend where it crosses its last edge, as those of fast sweeps do"""


class Line(NamedTuple):
    """A straight line of the path: the part that is fixed while it is walked."""

    source: int
    """Index of the nearest source of the node at which the walk begins"""
    length: float
    """Distance of that node from the source, mesh units"""
    sw: float
    """SW of the window, see `window`: 0 for parallel rays, else 1"""
    slack: float
    """Mesh units by which a distance along the line may exceed one that it is compared with"""


class Walk(NamedTuple):
    """The state of a walk: a point of the line, in the frame of the half-edge that it lies on."""

    half_edge: int
    x: float
    """Position on the half-edge, mesh units from its tail"""
    sx: float
    sy: float
    """The unfolded pseudosource; sy <= 0 where the face of the half-edge has been crossed, and
    sy >= 0 where it lies ahead"""
    sigma: float
    """σ of the window; for parallel rays the distance at x"""
    walked: float
    """Length of the line from its end to here, mesh units"""
    reference: int
    """Merges that are still to be undone, see `window`"""
    node_count: int
    """Number of nodes on the trail"""
    after: int
    """At an irregular edge, the half-edge whose face was tried last; -1 before the first"""


class Sight(NamedTuple):
    """The apex of the face ahead and the pseudosource, as seen from a walk."""

    apex: int
    ax: float
    ay: float
    """Position of the apex"""
    to_apex: float
    """Distance of the apex, mesh units"""
    to_source: float
    """Distance of the pseudosource, mesh units; 0 for parallel rays"""
    distance: float
    """Distance of the walk's point from the source along the line, mesh units"""


class Trail(NamedTuple):
    """The path so far, filled from its end, as raw pointers but for the last; see `trace_path`."""

    nodes: Ints
    parameters: Floats
    faces: Ints
    room: int
    last_at: Ints
    """(LAST_AT,): by half-edge, modulo LAST_AT: which node of the path lay on it last. Anything
    where none did: what is read here is compared with ``nodes``."""


class Forks(NamedTuple):
    """A stack of walks at points where another face may be tried, and what has been tried."""

    floats: Floats
    """(FORKS, 5): x, sx, sy, sigma, walked"""
    ints: Ints
    """(FORKS, 4): half_edge, reference, node_count, after"""
    tried_floats: Floats
    """(TRIED, 3): x, sx, sy of walks after a fork"""
    tried_ints: Ints
    """(TRIED, 3): the first node of their line, 0 where there is none; half_edge, reference"""


@kernel
def new_forks() -> Forks:
    """Return an empty stack of forks, of which nothing has been tried."""
    return Forks(
        np.empty((FORKS, 5)),
        np.empty((FORKS, 4), np.int32),
        np.empty((TRIED, 3)),
        np.zeros((TRIED, 3), np.int32),
    )


@kernel
def trace_path(
    topology: Topology,
    winners: Winners,
    target: int,
    nodes: Ints,
    parameters: Floats,
    faces: Ints,
) -> tuple[Outcome, int]:
    """Trace the path from node ``target`` to its source; return (outcome, number of nodes).

    Fills ``nodes`` and ``parameters`` with half-edges h, crossed at this share of their length, or
    -1 - v for a vertex or site v. Fills ``faces``: number i is crossed between the nodes i and
    i + 1. A vertex on the way continues the path with its own winner: a line may pass it straight
    on either side only where it is flat. O(faces crossed).
    """
    return trace_lines(topology, winners, target, ALL_LINES, nodes, parameters, faces)


@kernel
def trace_lines(
    topology: Topology,
    winners: Winners,
    target: int,
    lines: int,
    nodes: Ints,
    parameters: Floats,
    faces: Ints,
) -> tuple[Outcome, int]:
    """Trace the last lines of the same path, at most so many of them."""
    view = view_of(topology, winners)
    last_at = np.empty(LAST_AT, np.int32)
    trail = Trail(pointer(nodes), pointer(parameters), pointer(faces), len(nodes), last_at)
    forks = new_forks()
    nodes[0], parameters[0] = -1 - target, 0.0
    count, end = 1, end_at(view, target)
    while end.entry_edge >= 0 and lines > 0:
        outcome, count, v = trace_line(view, end, trail, forks, count)
        if outcome != Outcome.FINISHED:
            return outcome, count
        if count >= len(nodes):
            return Outcome.PATH_FULL, count
        nodes[count], parameters[count] = -1 - v, 0.0
        count, lines, end = count + 1, lines - 1, end_at(view, v)
    return Outcome.FINISHED, count


@kernel
def view_of(topology: Topology, winners: Winners) -> View:
    """Return the View of a mesh and of winners, which the caller must hold meanwhile."""
    return View(
        pointers(topology),
        pointers(winners),
        len(topology.total_angle),
        len(winners.sites.ints),
        len(winners.sites.segment_ints),
        len(winners.vertices.reference) > 0,
        len(winners.vertices.crossing) > 0,
    )


@kernel
def end_at(view: View, v: int) -> End:
    """Return node v as the end of a line."""
    winners, vertices = view.winners, view.winners.vertices
    if v == winners.target.node:
        return winners.target
    m = as_int64(vertices.winner_ints[WINNER * v + ENTRY_EDGE])
    reference = -1 - as_int64(vertices.winner_ints[WINNER * v + PREDECESSOR])
    if view.merging:
        reference = as_int64(vertices.reference[v])
    x, y = target_in_frame(view, v, m) if m >= 0 else (0.0, 0.0)
    return End(
        as_int64(v),
        vertices.distance[v],
        as_int64(winners.nearest[v]),
        m,
        x,
        y,
        vertices.winner[2 * v],
        vertices.winner[2 * v + 1],
        reference,
        vertices.crossing[v] if view.bends else math.nan,
    )


@kernel
def trace_line(
    view: View, end: End, trail: Trail, forks: Forks, count: int
) -> tuple[Outcome, int, int]:
    """Trace the line to its end; return (outcome, number of nodes, its first node).

    Appends to ``trail``; ``forks`` is scratch memory.
    """
    open_forks = 0
    line, walk, start = jump_to_window(view, end, count)
    trail.faces[count - 1] = walk.half_edge // 3
    if start >= 0:
        return Outcome.FINISHED, count, start
    for _ in range(TRIES * trail.room):
        walk = unmerge(view, walk)
        kind = view.mesh.links[ROW * walk.half_edge + OPPOSITE]
        h, same = next_face(view.mesh.links, walk.half_edge, walk.after)
        if kind == NO_FACE and open_forks == 0:
            start = nearer_end(view, line, walk)
            return (Outcome.FINISHED if start >= 0 else Outcome.LOST), walk.node_count, start
        is_lost = h < 0
        if not is_lost:
            if kind == IRREGULAR and open_forks < FORKS:
                open_forks = push_fork(forks, open_forks, walk, h)
            if walk.node_count >= trail.room:
                return Outcome.PATH_FULL, walk.node_count, -1
            walk = enter(view, line, walk, h, same)
            sight = look_ahead(view, line, walk)
            is_wrong = append_node(view, trail, walk, count) or is_too_far(view, line, walk, sight)
            is_lost = open_forks > 0 and (is_wrong or was_tried(view, forks, walk, count))
        if not is_lost:
            start = start_in_face(view, line, walk, sight, open_forks == 0)
            if start >= 0:
                return Outcome.FINISHED, walk.node_count, start
            is_left, is_tie = side_of_apex(view, line, walk, sight)
            if is_tie and open_forks < FORKS:
                other = leave(view, line, walk, not is_left)
                open_forks = push_fork(forks, open_forks, other, -1)
            walk = leave(view, line, walk, is_left)
            is_lost = open_forks > 0 and is_past_start(view, line, walk)
        if is_lost:
            if open_forks == 0:
                return Outcome.LOST, walk.node_count, -1
            open_forks -= 1
            walk = walk_at_fork(forks, open_forks)
    return Outcome.LOST, walk.node_count, -1


@kernel
def jump_to_window(view: View, end: End, count: int) -> tuple[Line, Walk, int]:
    """Begin the line to its end, on the half-edge that the winning window crossed last.

    Returns as well the node where the line begins, if that is in the same face; else -1.
    """
    mesh, winners, m, root = view.mesh, view.winners, end.entry_edge, pseudosource_of(end.reference)
    length = mesh.geometry[ROW * m + LENGTH]
    ax, ay, sx, sy, distance = end.x, end.y, end.sx, end.sy, end.distance
    sw = 0.0 if is_segment(view, root) else 1.0
    slack = (WIDEST_ERROR if view.merging else SAME_PLACE) * distance
    line = Line(end.source, distance, sw, slack)
    rise = sw * ay - sy
    x = (sx * ay - ax * sy) / rise if rise > 0.0 else sx
    x = min(max(x, 0.0), length)
    if not math.isnan(end.crossing):
        x = end.crossing
    walked = math.hypot(ax - x, ay)
    sigma = distance - walked
    if sw > 0.0:
        sigma -= math.hypot(sx - x, sy)
    start, tail, head = -1, mesh.links[ROW * m + TAIL], mesh.links[ROW * m + HEAD]
    if row_in_face(view, root, m // 3) >= 0 or segment_in_face(view, root, m // 3) >= 0:
        start = root
    elif tail == root or is_on_path(winners, tail, math.hypot(ax, ay), distance, line):
        start = as_int64(tail)
    elif head == root or is_on_path(winners, head, math.hypot(ax - length, ay), distance, line):
        start = as_int64(head)
    walk = Walk(m, x, sx, sy, sigma, walked, end.reference, as_int64(count), -1)
    return line, walk, start


@inlined
def as_int64(number: Any) -> int:
    """Return a number of an array of int32 as int64, like all numbers in the named tuples here."""
    return number + 0


@inlined
def pseudosource_of(reference: int) -> int:
    """Node of the pseudosource; -1 where it is unknown until merges are undone."""
    return -1 - reference if reference < 0 else -1


@inlined
def unmerge(view: View, walk: Walk) -> Walk:
    """Undo the merges on the half-edge of a walk: go on with the window that covered x (4.3)."""
    merges, merge_ints = view.winners.merges
    reference, sx, sy, sigma = walk.reference, walk.sx, walk.sy, walk.sigma
    while reference >= 0 and merge_ints[MERGE_INTS * reference + MERGED_ON] == walk.half_edge:
        is_left = walk.x <= merges[MERGE * reference + SPLIT]
        side = MERGE * reference + (LEFT if is_left else RIGHT)
        sx, sy, sigma = merges[side], merges[side + 1], merges[side + 2]
        before = LEFT_REFERENCE if is_left else RIGHT_REFERENCE
        reference = as_int64(merge_ints[MERGE_INTS * reference + before])
    return Walk(
        walk.half_edge,
        walk.x,
        sx,
        sy,
        sigma,
        walk.walked,
        reference,
        walk.node_count,
        walk.after,
    )


@kernel
def next_face(links: Ints, m: int, after: int) -> tuple[int, bool]:
    """Half-edge across that of m, and whether it runs the same way; -1 if there is none.

    Across an irregular edge it is the first, or the one that follows ``after``.
    """
    if links[ROW * m + OPPOSITE] != IRREGULAR:
        return (links[ROW * m + OPPOSITE] if after < 0 else -1), False
    same, h, is_next = True, m, after < 0
    while True:
        code = links[ROW * h + AROUND]
        h = code >> 1
        if code & 1 == 0:
            same = not same
        if h == m:
            return -1, False
        if is_next:
            return h, same
        is_next = h == after


@kernel
def nearer_end(view: View, line: Line, walk: Walk) -> int:
    """End of a boundary edge that the path goes on by, where rounding led its line over the edge.

    It is the end that lies nearer to the source on the way; -1 if it is farther than the line's.
    """
    distance, row = view.winners.vertices.distance, ROW * walk.half_edge
    tail, head = view.mesh.links[row + TAIL], view.mesh.links[row + HEAD]
    to_head = view.mesh.geometry[row + LENGTH] - walk.x
    end = tail if distance[tail] + walk.x <= distance[head] + to_head else head
    return end if distance[end] < line.length else -1


@inlined
def enter(view: View, line: Line, walk: Walk, h: int, same: bool) -> Walk:
    """Turn to the face across the edge, in the frame of its half-edge h; add a node."""
    length, x, sx = view.mesh.geometry[ROW * walk.half_edge + LENGTH], walk.x, walk.sx
    if not same:
        x, sx = length - x, line.sw * length - sx
    return Walk(
        h, x, sx, -walk.sy, walk.sigma, walk.walked, walk.reference, walk.node_count + 1, -1
    )


@inlined
def look_ahead(view: View, line: Line, walk: Walk) -> Sight:
    """Return the apex of the face ahead, and how far it and the pseudosource are."""
    geometry, row, x = view.mesh.geometry, ROW * walk.half_edge, walk.x
    ax = geometry[row + COS_LEFT] * geometry[row + LENGTH_LEFT]
    ay = geometry[row + SIN_LEFT] * geometry[row + LENGTH_LEFT]
    to_apex = math.sqrt((ax - x) * (ax - x) + ay * ay)
    to_source = 0.0
    if line.sw > 0.0:
        to_source = math.sqrt((walk.sx - x) * (walk.sx - x) + walk.sy * walk.sy)
    return Sight(
        as_int64(view.mesh.links[row + APEX]), ax, ay, to_apex, to_source, walk.sigma + to_source
    )


@inlined
def append_node(view: View, trail: Trail, walk: Walk, first: int) -> bool:
    """Append the walk's point to ``trail``; return whether the line, whose first is given, winds.

    In a face that the path did not come from, a line may wind about a tip without end, and fork at
    each turn. It does wind where it crosses a half-edge again. This is found at once but where too
    many half-edges have been crossed since to remember that one.
    """
    i, h = walk.node_count - 1, walk.half_edge
    trail.nodes[i], trail.parameters[i] = h, walk.x / view.mesh.geometry[ROW * h + LENGTH]
    trail.faces[i] = h // 3
    before = trail.last_at[h % LAST_AT]
    if first <= before < i and trail.nodes[before] == h:
        return True
    trail.last_at[h % LAST_AT] = i
    return False


@inlined
def is_too_far(view: View, line: Line, walk: Walk, sight: Sight) -> bool:
    """Whether a line through this face contradicts a distance.

    It is longer than the distance of its end, or a shorter way to the apex than the apex's distance
    allows. An apex beyond the limit of the sweep has none.
    """
    if walk.walked + sight.distance > line.length + line.slack:
        return True
    known = view.winners.vertices.distance[sight.apex]
    return known < math.inf and known > sight.distance + sight.to_apex + line.slack


@kernel
def start_in_face(view: View, line: Line, walk: Walk, sight: Sight, is_certain: bool) -> int:
    """Node of the face ahead at which the line begins; -1 if it goes on.

    After a fork it is not certain that the path came through this face. Then its pseudosource must
    be where it was unfolded to.
    """
    h, root, winners = walk.half_edge, pseudosource_of(walk.reference), view.winners
    distance = winners.vertices.distance
    length = view.mesh.geometry[ROW * h + LENGTH]
    most = math.inf if is_certain else sight.to_source
    most = most * (1.0 + SAME_PLACE) + GAP * length
    if row_in_face(view, root, h // 3) >= 0:
        px, py = target_in_frame(view, root, h)
        if math.hypot(px - walk.x, py) <= most:
            return root
    k = segment_in_face(view, root, h // 3)
    if k >= 0:
        ends = winners.sites.segment_ends
        off = distance_to_segment(view.mesh.geometry, ends, k, h, walk.x, 0.0)
        if is_certain or distance[root] + off <= walk.sigma + SAME_PLACE * length:
            return root
    is_root = sight.apex == root and sight.to_apex <= most
    if is_root or is_on_path(winners, sight.apex, sight.to_apex, sight.distance, line):
        return sight.apex
    return -1


@kernel
def is_on_path(winners: Winners, u: int, reach: float, here: float, line: Line) -> bool:
    """Whether a line that is at distance ``here``, ``reach`` from u, meets u.

    A vertex that is nearest to another source may lie as near: the path goes on past it.
    """
    distance, most = winners.vertices.distance, here + ON_PATH * line.length
    if winners.nearest[u] != line.source:
        return False
    return distance[u] + reach <= most and distance[u] < line.length


@inlined
def side_of_apex(view: View, line: Line, walk: Walk, sight: Sight) -> tuple[bool, bool]:
    """Return (whether the pseudosource is left of the apex, whether only rounding says so).

    The latter happens in faces of no area.
    """
    ahead = (sight.ax - walk.x) * walk.sy
    aside = sight.ay * (walk.sx - line.sw * walk.x)
    if view.mesh.flags[sight.apex] & PINCHED == 0:
        return ahead >= aside, False
    is_tie = abs(ahead - aside) <= GAP * (abs(ahead) + abs(aside))
    is_near = sight.to_apex <= GAP * view.mesh.geometry[ROW * walk.half_edge + LENGTH]
    return ahead >= aside, is_tie or is_near


@kernel
def leave(view: View, line: Line, walk: Walk, is_left: bool) -> Walk:
    """Hop over the face ahead, to its left or its right edge.

    The right edge is left as the left one is, in the mirror.
    """
    geometry, h, sw = view.mesh.geometry, walk.half_edge, line.sw
    row = ROW * h
    if is_left:
        m, side = previous(h), geometry[row + LENGTH_LEFT]
        cosine, sine = geometry[row + COS_LEFT], geometry[row + SIN_LEFT]
        x, sx = walk.x, walk.sx
    else:
        m, side = following(h), geometry[row + LENGTH_RIGHT]
        cosine, sine = geometry[row + COS_RIGHT], geometry[row + SIN_RIGHT]
        x, sx = geometry[row + LENGTH] - walk.x, sw * geometry[row + LENGTH] - walk.sx
    u, sx, sy = cross_edge(x, sx, walk.sy, sw, side, cosine, sine)
    step = math.hypot(u * cosine - x, u * sine)
    if is_left:
        u, sx = side - u, sw * side - sx
    sigma = walk.sigma if sw > 0.0 else walk.sigma - step
    return Walk(m, u, sx, -sy, sigma, walk.walked + step, walk.reference, walk.node_count, -1)


@kernel
def cross_edge(
    x: float, sx: float, sy: float, sw: float, length: float, cosine: float, sine: float
) -> tuple[float, float, float]:
    """Walk from (x, 0) toward s, of weight sw, and out over the left edge of a face.

    Returns the exit's distance from the tail, and s in the frame of that edge, whose own face is
    ahead again (y > 0).
    """
    along, ahead = sx * cosine + sy * sine, sy * cosine - sx * sine
    ex, ey = x * cosine, -x * sine
    if ahead <= 0.0:  # within rounding, s lies on the edge's line, or before it
        return min(max(along, 0.0), length), along, ahead
    u = ex - (along - sw * ex) * ey / (ahead - sw * ey)
    return min(max(u, 0.0), length), along, ahead


@inlined
def is_past_start(view: View, line: Line, walk: Walk) -> bool:
    """Whether the walk has gone beyond the pseudosource, which was not in the face just left.

    Where merges are still to be undone on the edge ahead, it has not. A pseudosource on the edge
    itself may be beyond, behind any number of faces of no area.
    """
    m, reference = walk.half_edge, walk.reference
    if reference >= 0 and view.winners.merges.ints[MERGE_INTS * reference + MERGED_ON] == m:
        return False
    close = SAME_PLACE * view.mesh.geometry[ROW * m + LENGTH]
    if line.sw == 0.0:
        return walk.sigma - view.winners.vertices.distance[pseudosource_of(reference)] < -close
    return -walk.sy < -close


@kernel
def was_tried(view: View, forks: Forks, walk: Walk, first: int) -> bool:
    """Whether a walk has been here before on the line with this first node; if not, remember it.

    A walk takes the place of the one in its row of the table.
    """
    h, length = walk.half_edge, view.mesh.geometry[ROW * walk.half_edge + LENGTH]
    row = (31 * h + int(256.0 * walk.x / length)) % TRIED
    floats, ints, near = forks.tried_floats, forks.tried_ints, SAME_PLACE * length
    if ints[row, 0] == first and ints[row, 1] == h and ints[row, 2] == walk.reference:
        off = max(abs(floats[row, 0] - walk.x), abs(floats[row, 1] - walk.sx))
        if max(off, abs(floats[row, 2] - walk.sy)) <= near:
            return True
    ints[row, 0], ints[row, 1], ints[row, 2] = first, h, walk.reference
    floats[row, 0], floats[row, 1], floats[row, 2] = walk.x, walk.sx, walk.sy
    return False


@kernel
def push_fork(forks: Forks, size: int, walk: Walk, after: int) -> int:
    """Store a walk that may go on otherwise, into the faces that follow ``after``.

    Writes row ``size`` of ``forks``; returns the new size.
    """
    floats, ints = forks.floats, forks.ints
    floats[size, 0], floats[size, 1], floats[size, 2] = walk.x, walk.sx, walk.sy
    floats[size, 3], floats[size, 4] = walk.sigma, walk.walked
    ints[size, 0], ints[size, 1] = walk.half_edge, walk.reference
    ints[size, 2], ints[size, 3] = walk.node_count, after
    return size + 1


@kernel
def walk_at_fork(forks: Forks, i: int) -> Walk:
    """Return the walk of row i of ``forks``."""
    floats, ints = forks.floats, forks.ints
    return Walk(
        as_int64(ints[i, 0]),
        floats[i, 0],
        floats[i, 1],
        floats[i, 2],
        floats[i, 3],
        floats[i, 4],
        as_int64(ints[i, 1]),
        as_int64(ints[i, 2]),
        as_int64(ints[i, 3]),
    )


@kernel
def row_in_face(view: View, node: int, face: int) -> int:
    """Row of a site in a face; -1 where it is not in that face, or no site."""
    if view.site_rows == 0 or node < view.winners.sites.ints[NODE]:
        return -1
    ints = view.winners.sites.ints
    for k in range(view.site_rows):
        if ints[SITE * k + NODE] == node and ints[SITE * k + FACE] == face:
            return k
    return -1


@inlined
def is_segment(view: View, node: int) -> bool:
    """Whether a node is a segment of a curve."""
    rows, ints = view.segment_rows, view.winners.sites.segment_ints
    return rows > 0 and ints[NODE] <= node <= ints[SEGMENT * (rows - 1) + NODE]


@kernel
def segment_in_face(view: View, node: int, face: int) -> int:
    """Row of a segment in a face; -1 where it is not in that face, or no segment."""
    if is_segment(view, node):
        ints = view.winners.sites.segment_ints
        for k in range(view.segment_rows):
            if ints[SEGMENT * k + NODE] == node and ints[SEGMENT * k + FACE] == face:
                return k
    return -1


@kernel
def target_in_frame(view: View, node: int, h: int) -> tuple[float, float]:
    """Position of a node in the frame of h: of the apex, or of a site in the face."""
    geometry, row = view.mesh.geometry, ROW * h
    if node < view.vertex_count:
        reach = geometry[row + LENGTH_LEFT]
        return geometry[row + COS_LEFT] * reach, geometry[row + SIN_LEFT] * reach
    k = row_in_face(view, node, h // 3)
    return weights_in_frame(geometry, view.winners.sites.weights, 3 * k, h)
