"""Dijkstra's search over the nodes of a graph, with each crossing moved once. Resumable in slices.

A node that a path reaches through a face opens the other faces of its edge. One that it reaches
along the edge opens the dearer ones. Nothing cheaper is lost: within a face costs obey the
triangle inequality.

A settled node has its path straightened where that has been bent last: the crossing before it
moves along its edge to where the path is cheapest (Snell's law), and the node's value falls. That
crossing is the node's own: for others its predecessor stays where it is. So the values are those of
paths all the same, and off by a third to a half as much as without, at a third more time.
"""

import math
from typing import Any, NamedTuple

from geodesic_core.kernels.costs.graph import (
    ALONG,
    AT_GOAL,
    LIMIT,
    SETTLED,
    Front,
    Goal,
    Graph,
    Starts,
    apex_of,
    half_edge_in,
    height,
    least_factor,
    next_of_edge,
    node_place,
    place_in_frame,
    runs_up,
    spacing,
)
from geodesic_core.kernels.costs.rule import cost_of, piece_of
from geodesic_core.kernels.front.counters import HEAP_SIZE, WORK
from geodesic_core.kernels.front.queues import pop_nearest, push_or_raise
from geodesic_core.kernels.jit import inlined, kernel, pointers
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
    previous,
)
from geodesic_core.kernels.outcome import Outcome


class Reached(NamedTuple):
    """A node as a path leaves it over a face: at (x, 0), at height z, in the frame of an edge."""

    node: int
    value: float
    x: float
    z: float


Place = tuple[float, float, float]
"""x and y in the frame of a half-edge, and the height"""


class Side(NamedTuple):
    """A half-edge across a face, in the frame of another one."""

    h: int
    tail: Place
    head: Place


class Bend(NamedTuple):
    """A path over an edge, which runs along x and is as steep as ``tilt``.

    In one face its cost is w0 times as high, in the other w1 times.
    """

    start: Place
    end: Place
    z_tail: float
    tilt: float
    w0: float
    w1: float


_ROUNDS = 3
"""Steps of Newton's method that move a crossing: more change no digit that counts."""
_ROUNDS_BY_SLOPE = 10
"""The same where slopes cost: the rule has kinks, so that half of the steps halve an interval."""
_SECTIONS = 60
"""Sections of a segment of a source that find where a path leaves it: 1e-12 of its length."""
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@kernel
def advance(graph_: Graph, front_: Front, starts_: Starts, goal_: Goal, budget: int) -> Outcome:
    """Settle nodes until so many steps are tried, or the search is over. Modifies the front."""
    graph, front, goal, starts = (
        pointers(graph_),
        pointers(front_),
        pointers(goal_),
        pointers(starts_),
    )
    counters, goal_faces = front.counters, len(goal_.faces)
    counters[WORK] = 0
    while counters[HEAP_SIZE] > 0:
        key = front.heap_keys[0]
        if key > front.bounds[LIMIT] or key >= front.bounds[AT_GOAL]:
            break
        if counters[WORK] >= budget:
            return Outcome.RUNNING
        n = pop_nearest(front, counters)
        front.heap_place[n] = SETTLED
        before = front.predecessors[n]
        front.nearest[n] = starts.sources[-1 - before] if before < 0 else front.nearest[before]
        if n < graph.vertices:
            if n == goal.vertex:
                front.bounds[AT_GOAL] = front.values[n]
            straighten_last(graph, front, starts, n)
            open_vertex(graph, front, goal, goal_faces, n)
        else:
            straighten_last(graph, front, starts, n)
            open_edge(graph, front, goal, goal_faces, n)
    return Outcome.FINISHED


@kernel
def begin(graph_: Graph, front_: Front, starts_: Starts, goal_: Goal) -> None:
    """Offer all nodes next to the sources their first values. Modifies the front."""
    graph, front, goal, starts = (
        pointers(graph_),
        pointers(front_),
        pointers(goal_),
        pointers(starts_),
    )
    for row in range(len(starts_.faces)):
        h = 3 * starts.faces[row]
        for corner in range(3):
            g = h + corner
            offer_start(graph, front, goal, starts, row, graph.links[ROW * g + TAIL])
            e = graph.edge_of[g]
            for n in range(graph.first_node[e], graph.first_node[e + 1]):
                offer_start(graph, front, goal, starts, row, n)


@inlined
def offer_start(graph: Any, front: Any, goal: Any, starts: Any, row: int, n: int) -> None:
    """Offer a node the path from the cheapest point of a segment in its face."""
    face = starts.faces[row]
    place = node_place(graph, n) if n >= graph.vertices else 0.0
    x, y, z = place_in_frame(graph, n, place, 3 * face)
    x0, y0, z0 = corner_mix(graph, starts.weights, 6 * row, 3 * face)
    x1, y1, z1 = corner_mix(graph, starts.weights, 6 * row + 3, 3 * face)
    low, high, share = 0.0, 1.0, 0.0
    if x0 != x1 or y0 != y1:
        for _ in range(_SECTIONS):
            a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            dx, dy = x - x0 - a * (x1 - x0), y - y0 - a * (y1 - y0)
            at_a = cost_of(graph.rule, dx * dx + dy * dy, z - z0 - a * (z1 - z0))
            dx, dy = x - x0 - b * (x1 - x0), y - y0 - b * (y1 - y0)
            if at_a <= cost_of(graph.rule, dx * dx + dy * dy, z - z0 - b * (z1 - z0)):
                high = b
            else:
                low = a
        share = low if low == 0.0 else high
    dx, dy = x - x0 - share * (x1 - x0), y - y0 - share * (y1 - y0)
    cost = cost_of(graph.rule, dx * dx + dy * dy, z - z0 - share * (z1 - z0))
    value = starts.values[row] + graph.factors[face] * cost
    offer(graph, front, goal, n, value, -1 - row, face, share)


@inlined
def corner_mix(graph: Any, weights: Any, first: int, h: int) -> tuple[float, float, float]:
    """Return the point of a face with weights at a place, in its first frame; and its height."""
    row = ROW * h
    ax, ay = apex_of(graph, h)
    u, v, w = weights[first], weights[first + 1], weights[first + 2]
    z = u * height(graph, graph.links[row + TAIL]) + v * height(graph, graph.links[row + HEAD])
    z += w * height(graph, graph.links[row + APEX])
    return v * graph.geometry[row + LENGTH] + w * ax, w * ay, z


@inlined
def offer(
    graph: Any, front: Any, goal: Any, n: int, value: float, before: int, way: int, shift: float
) -> None:
    """Offer a node the path over another node, or from a source."""
    if value < front.values[n] and front.heap_place[n] != SETTLED:
        front.values[n], front.predecessors[n] = value, before
        front.ways[n], front.shifts[n] = way, shift
        push_or_raise(front, front.counters, n, value + to_go(graph, goal, n))


@inlined
def to_go(graph: Any, goal: Any, n: int) -> float:
    """Return a lower bound of the cost from a node to the goal, that of the line through space.

    With the rule it holds as well: c(slope) is convex, and what a path costs by run is not below 0.
    """
    if goal.least == 0.0:
        return 0.0
    u, v, place = n, n, 0.0
    if n >= graph.vertices:
        h = graph.half_edge[graph.edge_of_node[n - graph.vertices]]
        u, v = graph.links[ROW * h + TAIL], graph.links[ROW * h + HEAD]
        place = node_place(graph, n) if u < v else 1.0 - node_place(graph, n)
    square = 0.0
    for axis in range(3):
        x, y = graph.positions[3 * u + axis], graph.positions[3 * v + axis]
        square += (x + place * (y - x) - goal.position[axis]) ** 2
    z = height(graph, u)
    z += place * (height(graph, v) - z)
    return goal.least * cost_of(graph.rule, square, goal.position[3] - z)


@kernel
def open_vertex(graph: Any, front: Any, goal: Any, goal_faces: int, v: int) -> None:
    """Offer the path over a vertex to all nodes of its faces."""
    value, z = front.values[v], height(graph, v)
    for c in range(graph.first_corner[v], graph.first_corner[v + 1]):
        h = graph.corners[c]
        step_along(graph, front, goal, v, value, h, 0.0, True)
        step_along(graph, front, goal, v, value, previous(h), 1.0, False)
        face = h // 3
        if graph.factors[face] == math.inf:
            continue
        ax, ay = apex_of(graph, h)
        length = graph.geometry[ROW * h + LENGTH]
        links = ROW * h
        head, apex = graph.links[links + HEAD], graph.links[links + APEX]
        at = Reached(v, value, 0.0, z)
        far = Side(following(h), (length, 0.0, height(graph, head)), (ax, ay, height(graph, apex)))
        cross(graph, front, goal, at, far)
        offer_goal(graph, front, goal, goal_faces, at, h)


@kernel
def open_edge(graph: Any, front: Any, goal: Any, goal_faces: int, n: int) -> None:
    """Offer the path over a node of an edge to the nodes of the faces where it may go on."""
    e = graph.edge_of_node[n - graph.vertices]
    value, way, place = front.values[n], front.ways[n], node_place(graph, n)
    first = graph.half_edge[e]
    least, h = least_factor(graph, e), first
    up = place if runs_up(graph, first) else 1.0 - place
    step_along(graph, front, goal, n, value, first, up, True)
    step_along(graph, front, goal, n, value, first, up, False)
    while True:
        face = h // 3
        factor = graph.factors[face]
        if face != way and factor != math.inf and not (way == ALONG and factor == least):
            t = place if runs_up(graph, h) else 1.0 - place
            open_face(graph, front, goal, goal_faces, n, h, t)
        h = next_of_edge(graph, h)
        if h < 0 or h == first:
            break


@inlined
def open_face(graph: Any, front: Any, goal: Any, goal_faces: int, n: int, h: int, t: float) -> None:
    """Offer the path over the point at share t of a half-edge to the nodes across its face."""
    row = ROW * h
    length = graph.geometry[row + LENGTH]
    x = t * length
    ax, ay = apex_of(graph, h)
    tail, head, apex = graph.links[row + TAIL], graph.links[row + HEAD], graph.links[row + APEX]
    z_tail, z_head, z_apex = height(graph, tail), height(graph, head), height(graph, apex)
    at = Reached(n, front.values[n], x, z_tail + t * (z_head - z_tail))
    far = (ax, ay, z_apex)
    cross(graph, front, goal, at, Side(following(h), (length, 0.0, z_head), far))
    cross(graph, front, goal, at, Side(previous(h), far, (0.0, 0.0, z_tail)))
    dx, face = ax - x, h // 3
    cost = graph.factors[face] * cost_of(graph.rule, dx * dx + ay * ay, z_apex - at.z)
    offer(graph, front, goal, apex, at.value + cost, n, face, shift_of(graph, n))
    offer_goal(graph, front, goal, goal_faces, at, h)


@inlined
def shift_of(graph: Any, n: int) -> float:
    """Return the place of a node on its edge; 0 for a vertex."""
    return node_place(graph, n) if n >= graph.vertices else 0.0


@kernel
def cross(graph: Any, front: Any, goal: Any, at: Reached, side: Side) -> None:
    """Offer the path over a node to the nodes of a half-edge across the face."""
    e, face = graph.edge_of[side.h], side.h // 3
    factor, step = graph.factors[face], spacing(graph, e)
    first, end = graph.first_node[e], graph.first_node[e + 1]
    s = step
    if not runs_up(graph, side.h):
        s, step = 1.0 - step, -step
    (x0, y0, z0), (x1, y1, z1) = side.tail, side.head
    dx, dy, dz = x0 - at.x, y0, z0 - at.z
    ex, ey, ez = x1 - x0, y1 - y0, z1 - z0
    place = shift_of(graph, at.node)
    front.counters[WORK] += end - first
    for m in range(first, end):
        rx, ry = dx + s * ex, dy + s * ey
        cost = at.value + factor * cost_of(graph.rule, rx * rx + ry * ry, dz + s * ez)
        if cost < front.values[m]:
            offer(graph, front, goal, m, cost, at.node, face, place)
        s += step


@inlined
def step_along(
    graph: Any, front: Any, goal: Any, n: int, value: float, h: int, t: float, forward: bool
) -> None:
    """Offer the path over the point at share t of a half-edge to the next node along it."""
    e = graph.edge_of[h]
    factor = least_factor(graph, e)
    if factor == math.inf:
        return
    step, first, end = spacing(graph, e), graph.first_node[e], graph.first_node[e + 1]
    up = runs_up(graph, h) == forward
    m = n + 1 if up else n - 1
    if n < graph.vertices:
        m = first if up else end - 1
    row = ROW * h
    if first <= m < end:
        share = step
    else:
        m = graph.links[row + HEAD] if forward else graph.links[row + TAIL]
        share = 1.0 - t if forward else t
    length = share * graph.geometry[row + LENGTH]
    rise = share * (height(graph, graph.links[row + HEAD]) - height(graph, graph.links[row + TAIL]))
    cost = cost_of(graph.rule, length * length, rise if forward else -rise)
    offer(graph, front, goal, m, value + factor * cost, n, ALONG, shift_of(graph, n))


@inlined
def offer_goal(graph: Any, front: Any, goal: Any, goal_faces: int, at: Reached, h: int) -> None:
    """Lower the cost at the goal to that of the path over a node, where the face holds the goal.

    The node is in the frame of the face's half-edge h.
    """
    face = h // 3
    for i in range(goal_faces):
        if goal.faces[i] == face:
            gx, gy, gz = corner_mix(graph, goal.weights, 3 * i, 3 * face)
            x0, y0, cosine, sine = frame_in_face(graph, h)
            px, py = x0 + at.x * cosine, y0 + at.x * sine
            square = (gx - px) * (gx - px) + (gy - py) * (gy - py)
            cost = at.value + graph.factors[face] * cost_of(graph.rule, square, gz - at.z)
            front.bounds[AT_GOAL] = min(front.bounds[AT_GOAL], cost)


@inlined
def frame_in_face(graph: Any, h: int) -> tuple[float, float, float, float]:
    """Return tail and direction of a half-edge in the frame of its face's first one."""
    first = h - h % 3
    row = ROW * first
    if h == first:
        return 0.0, 0.0, 1.0, 0.0
    if h == first + 1:
        cosine, sine = graph.geometry[row + COS_RIGHT], graph.geometry[row + SIN_RIGHT]
        return graph.geometry[row + LENGTH], 0.0, -cosine, sine
    cosine, sine = graph.geometry[row + COS_LEFT], graph.geometry[row + SIN_LEFT]
    reach = graph.geometry[row + LENGTH_LEFT]
    return reach * cosine, reach * sine, -cosine, -sine


@inlined
def start_in_frame(
    graph: Any, starts: Any, row: int, share: float, h: int
) -> tuple[float, float, float]:
    """Return a point of a source's segment in the frame of a half-edge of its face; its height."""
    first = 3 * (h // 3)
    xa, ya, za = corner_mix(graph, starts.weights, 6 * row, first)
    xb, yb, zb = corner_mix(graph, starts.weights, 6 * row + 3, first)
    xa, ya, za = xa + share * (xb - xa), ya + share * (yb - ya), za + share * (zb - za)
    x0, y0, cosine, sine = frame_in_face(graph, h)
    return (
        cosine * (xa - x0) + sine * (ya - y0),
        cosine * (ya - y0) - sine * (xa - x0),
        za,
    )


@inlined
def straighten_last(graph: Any, front: Any, starts: Any, n: int) -> None:
    """Move the last crossing of a node's path along its edge, and lower the node's value.

    The frames of both faces have that edge on their x axis, one turned over: the path comes from
    (x0, y0) and goes to (x1, -y1).
    """
    p, face = front.predecessors[n], front.ways[n]
    if p < graph.vertices or face < 0:
        return
    q, before = front.predecessors[p], front.ways[p]
    if before < 0:
        return
    e = graph.edge_of_node[p - graph.vertices]
    g, h = half_edge_in(graph, e, before), half_edge_in(graph, e, face)
    length = graph.geometry[ROW * h + LENGTH]
    if q >= 0:
        x0, y0, z0 = place_in_frame(graph, q, front.shifts[p], g)
    else:
        x0, y0, z0 = start_in_frame(graph, starts, -1 - q, front.shifts[p], g)
    x1, y1, z1 = place_in_frame(graph, n, shift_of(graph, n), h)
    up = runs_up(graph, h)
    if runs_up(graph, g) != up:
        x0 = length - x0
    z_tail = height(graph, graph.links[ROW * h + TAIL])
    tilt = (height(graph, graph.links[ROW * h + HEAD]) - z_tail) / length
    w0, w1 = graph.factors[before], graph.factors[face]
    x = node_place(graph, p) * length if up else (1.0 - node_place(graph, p)) * length
    bend = Bend((x0, y0, z0), (x1, y1, z1), z_tail, tilt, w0, w1)
    begin_cost = two_steps(graph, x, bend)
    low, high = 0.0, length
    for _ in range(_ROUNDS if graph.rule.pieces == 0 else _ROUNDS_BY_SLOPE):
        first0, second0 = slopes(graph, x - x0, y0, z_tail + tilt * x - z0, tilt)
        first1, second1 = slopes(graph, x1 - x, y1, z1 - z_tail - tilt * x, tilt)
        first, second = w0 * first0 - w1 * first1, w0 * second0 + w1 * second1
        if first > 0.0:
            high = x
        else:
            low = x
        x = x - first / second if second > 0.0 else math.inf
        if not low <= x <= high:
            x = 0.5 * (low + high)
    cost = two_steps(graph, x, bend)
    if cost < begin_cost:
        front.values[n] -= begin_cost - cost
        front.shifts[n] = x / length if up else 1.0 - x / length


@inlined
def two_steps(graph: Any, x: float, bend: Bend) -> float:
    """Return the cost of a path that crosses the edge at x."""
    (x0, y0, z0), (x1, y1, z1) = bend.start, bend.end
    z, a, b = bend.z_tail + bend.tilt * x, x - x0, x1 - x
    cost0 = cost_of(graph.rule, a * a + y0 * y0, z - z0)
    cost1 = cost_of(graph.rule, b * b + y1 * y1, z1 - z)
    return bend.w0 * cost0 + bend.w1 * cost1


@inlined
def slopes(graph: Any, x: float, y: float, rise: float, tilt: float) -> tuple[float, float]:
    """Return the first and the second derivative of a step's cost by x, as its rise grows by tilt.

    On a piece of the rule, the second is that of the run.
    """
    square = x * x + y * y
    if graph.rule.pieces == 0:
        length = math.sqrt(square)
        if length == 0.0:
            return 0.0, 0.0
        return x / length, y * y / (square * length)
    run_square = max(square - rise * rise, 0.0)
    run = math.sqrt(run_square)
    if run == 0.0:
        return 0.0, 0.0
    piece = piece_of(graph.rule, run, rise)
    by_run = (x - rise * tilt) / run
    by_slope = tilt - by_run * rise / run
    second = graph.rule.levels[piece] * max(1.0 - tilt * tilt - by_run * by_run, 0.0)
    second += graph.rule.bends[piece] * by_slope * by_slope
    first = graph.rule.levels[piece] * by_run + graph.rule.tilts[piece] * tilt
    return first, second / run
