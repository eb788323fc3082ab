"""Paths as the edges that they cross, straightened, also past the vertices that they touch."""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.costs.cost_sweep import Arrival, CostSweep
from geodesic_core.kernels.costs import straightening
from geodesic_core.kernels.costs.graph import ALONG
from geodesic_core.kernels.mesh.half_edges import (
    BOUNDARY,
    FANS,
    HEAD,
    PINCHED,
    SEAM,
    TAIL,
    Topology,
)
from geodesic_core.mesh.canonical import half_edges_around
from geodesic_core.mesh.edge_lengths import flat_points

_AT_VERTEX = 1e-6
"""Share of an edge from its end where a crossing counts as at the vertex"""
_ENOUGH = 1e-9
"""Share of the cost by which a round must lower it to be followed by another"""
_MOST_ROUNDS = 12

_NONE = -1


class Crossings(NamedTuple):
    """A path: its points, and the faces between them.

    A point lies on an edge, at a place that may change; at a vertex; or, the first and the last
    one, anywhere in a face.
    """

    edges: Longs
    """(K,), or -1"""
    places: Floats
    """(K,): on the edge, 0 to 1 from its end of lower number"""
    vertices: Longs
    """(K,): inner vertex, or -1"""
    weights: Floats
    """(K, 3): of a point that is neither, in the face beside it"""
    faces: Longs
    """(K - 1,): inner faces"""


class _Points:
    """Points and faces of a path that is put together, step by step."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, float, int, Floats]] = []
        self.faces: list[int] = []

    def on_edge(self, e: int, place: float) -> None:
        self.rows.append((e, place, _NONE, np.zeros(3)))

    def at_vertex(self, v: int) -> None:
        self.rows.append((_NONE, 0.0, v, np.zeros(3)))

    def in_face(self, face: int, weights: Floats, topology: Topology) -> None:
        """Add a point of a face, which is a vertex where it has but one weight."""
        if np.count_nonzero(weights) == 1:
            self.at_vertex(int(topology.links[3 * face + int(np.argmax(weights)), TAIL]))
        else:
            self.rows.append((_NONE, 0.0, _NONE, weights))

    def path(self) -> Crossings:
        """Return them as a path."""
        edges, places, vertices, weights = zip(*self.rows, strict=True)
        return Crossings(
            np.array(edges, np.int64),
            np.array(places, np.float64),
            np.array(vertices, np.int64),
            np.array(weights, np.float64),
            np.array(self.faces, np.int64),
        )


def traced(sweep: CostSweep, vertex: int) -> Crossings:
    """Return the path of a sweep to an inner vertex that it has settled."""
    points = _Points()
    points.at_vertex(vertex)
    return _traced_back(sweep, points, vertex, 0.0)


def traced_inside(sweep: CostSweep, arrival: Arrival, weights: Floats) -> Crossings:
    """Return the path of a sweep to a point of a face, by how it arrives there."""
    points, graph, node = _Points(), sweep.graph, arrival.node
    points.in_face(arrival.face, weights, sweep.mesh.topology)
    points.faces.append(arrival.face)
    if 0 <= node < graph.vertices:
        points.at_vertex(node)
    elif node >= 0:
        e = int(graph.edge_of_node[node - graph.vertices])
        first, after = graph.first_node[e : e + 2].tolist()
        points.on_edge(e, (node - first + 1) / (after - first + 1))
    return _traced_back(sweep, points, node, arrival.share)


def _traced_back(sweep: CostSweep, points: _Points, node: int, share: float) -> Crossings:
    """Return the path from its source over a node to points that follow, the last first."""
    graph, front, starts = sweep.graph, sweep.front, sweep.starts
    face = points.faces[-1] if points.faces else _NONE
    while node >= 0:
        before, way, share = (
            int(front.predecessors[node]),
            int(front.ways[node]),
            float(front.shifts[node]),
        )
        face = _cheapest_along(sweep, node, before) if way == ALONG else way
        points.faces.append(face)
        if before >= graph.vertices:
            points.on_edge(int(graph.edge_of_node[before - graph.vertices]), share)
        elif before >= 0:
            points.at_vertex(before)
        node = before
    row = starts.weights[-1 - node]
    points.in_face(face, (1.0 - share) * row[:3] + share * row[3:], sweep.mesh.topology)
    points.rows.reverse()
    points.faces.reverse()
    return points.path()


def _cheapest_along(sweep: CostSweep, node: int, before: int) -> int:
    """Return the cheapest face of the edge along which two nodes are neighbours."""
    graph, vertices = sweep.graph, sweep.graph.vertices
    e = int(graph.edge_of_node[max(node, before) - vertices])
    around = half_edges_around(graph.links, int(graph.half_edge[e]))
    return min((h // 3 for h in around), key=lambda face: (graph.factors[face], face))


def straightened(sweep: CostSweep, path: Crossings, control: Control) -> tuple[Crossings, float]:
    """Return a path straightened, also past the vertices that it touches; and its cost.

    All these vertices are passed on their left by turns with all on their right. What is cheaper at
    a vertex after all is drawn back to it.
    """
    path, cost = _straightened(sweep, _compact(sweep, path))
    failures = 0
    for i in range(_MOST_ROUNDS):
        control.checkpoint(0.0)
        beside = _released(sweep, path, left=i % 2 == 0)
        lower = np.inf
        if beside is not None:
            beside, lower = _straightened(sweep, beside)
        if beside is not None and lower < (1.0 - _ENOUGH) * cost:
            path, cost, failures = beside, lower, 0
        elif failures:
            break
        else:
            failures = 1
    return path, cost


def _straightened(sweep: CostSweep, path: Crossings) -> tuple[Crossings, float]:
    """Return a path, compact, with its crossings moved to where they are cheapest; and its cost."""
    places, is_free = path.places.copy(), (path.edges >= 0).astype(np.uint8)
    steps = _steps_of(sweep, path)
    straightening.straighten(sweep.costs.rule, steps, places, is_free)
    path = _compact(sweep, path._replace(places=places))
    return path, cost_of(sweep, path)


def cost_of(sweep: CostSweep, path: Crossings) -> float:
    """Return what a path costs, step by step."""
    steps = _steps_of(sweep, path)
    s, t = path.places[:-1, None], path.places[1:, None]
    x0, x1 = straightening.X0, straightening.X1
    starts = steps[:, x0 : x0 + 3] + s * steps[:, x0 + 3 : x0 + 6]
    ends = steps[:, x1 : x1 + 3] + t * steps[:, x1 + 3 : x1 + 6]
    apart = ends - starts
    square = (apart[:, :2] * apart[:, :2]).sum(axis=1)
    return float(sweep.costs.of_steps(path.faces, square, apart[:, 2]).sum())


def weights_beside(sweep: CostSweep, path: Crossings, points: slice) -> tuple[Floats, Floats]:
    """Return the weights of points of a path in the faces beside them, and how they change.

    ``points`` are all but the last, in the faces after them, or all but the first, in those before.
    The second are the weights' changes from place 0 to place 1.
    """
    topology, graph = sweep.mesh.topology, sweep.graph
    corners = topology.links[3 * path.faces[:, None] + np.arange(3), TAIL]
    edges, vertices = path.edges[points], path.vertices[points]
    h = graph.half_edge[np.maximum(edges, 0)]
    ends = np.sort(topology.links[h][:, [TAIL, HEAD]], axis=1)
    on_edge = edges >= 0
    low = np.where(on_edge, ends[:, 0], vertices)
    base = (corners == low[:, None]).astype(np.float64)
    inside = ~on_edge & (vertices < 0)
    base[inside] = path.weights[points][inside]
    change = np.where(on_edge[:, None], (corners == ends[:, 1:]) - base, 0.0)
    return base, change


def _steps_of(sweep: CostSweep, path: Crossings) -> Floats:
    """Return the steps of a path as `straighten` takes them."""
    topology, costs, count = sweep.mesh.topology, sweep.costs, len(path.faces)
    steps = np.zeros((count, straightening.STEP))
    corners = topology.links[3 * path.faces[:, None] + np.arange(3), TAIL]
    for first, points in ((straightening.X0, slice(0, -1)), (straightening.X1, slice(1, None))):
        for column, weights in enumerate(weights_beside(sweep, path, points)):
            at = first + 3 * column
            steps[:, at : at + 2] = flat_points(topology, path.faces, weights)
            if not costs.is_symmetric:
                steps[:, at + 2] = (weights * costs.heights[corners]).sum(axis=1)
    steps[:, straightening.FACTOR] = costs.factors[path.faces]
    return steps


def _vertices_at(sweep: CostSweep, path: Crossings) -> list[int]:
    """Return the vertex at which each point lies; -1 for none."""
    links = sweep.mesh.topology.links
    ends = np.sort(links[sweep.graph.half_edge[np.maximum(path.edges, 0)]][:, [TAIL, HEAD]], axis=1)
    on_edge = path.edges >= 0
    at = np.where(on_edge & (path.places <= _AT_VERTEX), ends[:, 0], path.vertices)
    at = np.where(on_edge & (path.places >= 1.0 - _AT_VERTEX), ends[:, 1], at)
    return [int(v) for v in at]


def _compact(sweep: CostSweep, path: Crossings) -> Crossings:
    """Return a path without points that repeat, and none between two steps in one face.

    Points at a vertex become that vertex. Costs do not rise but for that: within a face they obey
    the triangle inequality.
    """
    at = _vertices_at(sweep, path)
    points, last = _Points(), len(at) - 1
    for i in range(last + 1):
        row = (int(path.edges[i]), float(path.places[i]), int(path.vertices[i]), path.weights[i])
        if at[i] >= 0:
            row = (_NONE, 0.0, at[i], np.zeros(3))
        if points.rows and _is_same(points.rows[-1], row):
            if points.faces:
                points.faces.pop()
            else:
                points.rows[-1] = row
        elif len(points.faces) >= 2 and points.faces[-1] == points.faces[-2]:
            points.rows[-1] = row
            points.faces.pop()
        else:
            points.rows.append(row)
        if i < last:
            points.faces.append(int(path.faces[i]))
    return points.path()


def _is_same(row: tuple[int, float, int, Floats], other: tuple[int, float, int, Floats]) -> bool:
    if row[0] != other[0] or row[2] != other[2]:
        return False
    if row[0] < 0 and row[2] < 0:
        return np.array_equal(row[3], other[3])
    return abs(row[1] - other[1]) <= _AT_VERTEX


def _released(sweep: CostSweep, path: Crossings, *, left: bool) -> Crossings | None:
    """Return a path that crosses the edges on one side of each vertex that it touches, at it.

    None where there is no such vertex. The path must be compact.
    """
    points, last, released = _Points(), len(path.faces), False
    for i in range(last + 1):
        v, around = int(path.vertices[i]), None
        if v >= 0 and 0 < i < last:
            around = _around(sweep, v, int(path.faces[i - 1]), int(path.faces[i]), left)
        if around is None:
            points.rows.append((int(path.edges[i]), float(path.places[i]), v, path.weights[i]))
        else:
            released = True
            for k, (edge, place, face) in enumerate(around):
                points.on_edge(edge, place)
                if k < len(around) - 1:
                    points.faces.append(face)
        if i < last:
            points.faces.append(int(path.faces[i]))
    return points.path() if released else None


def _around(
    sweep: CostSweep, v: int, start: int, end: int, left: bool
) -> list[tuple[int, float, int]] | None:
    """Return the edges between two faces of a vertex on one side, each with the face beyond it.

    With each edge comes its place at the vertex. None where no path may go on that side.
    """
    topology, graph, costs = sweep.mesh.topology, sweep.graph, sweep.costs
    if topology.flags[v] & (FANS | SEAM | PINCHED):
        return None
    fan = topology.corners[topology.first_corner[v] : topology.first_corner[v + 1]].tolist()
    faces = [h // 3 for h in fan]
    k, around = faces.index(start), []
    while faces[k] != end:
        h = fan[k]
        if left:  # the edge before it in its face, which ends at the vertex
            h += 2 if h % 3 == 0 else -1
        k += 1 if left else -1
        if not 0 <= k < len(fan):
            if topology.flags[v] & BOUNDARY:
                return None
            k %= len(fan)
        if not np.isfinite(costs.factors[faces[k]]):
            return None
        u, w = topology.links[h, TAIL], topology.links[h, HEAD]
        around.append((int(graph.edge_of[h]), 0.0 if v == min(u, w) else 1.0, faces[k]))
    return around
