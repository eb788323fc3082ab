"""The graph of a cost sweep: vertices, and points evenly spaced on each edge.

It is implicit: inside a face every node reaches every other, and along an edge each its neighbours.
Nodes are numbered vertices first, then edge after edge, from the end of lower number.
"""

from typing import Any, NamedTuple

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.costs.rule import Rule
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    AROUND,
    COS_LEFT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    ROW,
    SIN_LEFT,
    TAIL,
    following,
    previous,
)


class Graph(NamedTuple):
    """Nodes on a surface, in inner numbering, and what steps between them cost."""

    vertices: int
    geometry: Floats
    links: Ints
    first_corner: Ints
    corners: Ints
    """These four as in `Topology`"""
    edge_of: Ints
    """(3F,): edge of each half-edge"""
    half_edge: Ints
    """(E,): one half-edge of each edge"""
    first_node: Ints
    """(E + 1,): the nodes of each edge end where those of the next begin"""
    edge_of_node: Ints
    """(N - V,): by node less the number of vertices"""
    factors: Floats
    """(F,): cost by length, or by what the rule says; infinite where no path may go"""
    positions: Floats
    """(V, 3): mesh units from the mesh's origin"""
    heights: Floats
    """(V,): mesh units; without a rule, of no length"""
    rule: Rule


class Front(NamedTuple):
    """State of a cost sweep, an entry for each node."""

    values: Floats
    """Cost of the cheapest path known; infinite at first"""
    shifts: Floats
    """Place on its edge at which the node's path crosses that of its predecessor, see `node_place`;
    of a node next to a source, the share of the way along its segment"""
    predecessors: Ints
    """Node before; of one next to a source, -1 - row of `Starts`"""
    ways: Ints
    """Inner face of the last step, or `ALONG` an edge"""
    nearest: Ints
    """Source of the path, once the node is settled"""
    heap_place: Ints
    """Place in the heap; -1 where the node is not in it, `SETTLED` once it has left"""
    heap: Ints
    heap_keys: Floats
    """Values, and what the goal is away from there at least"""
    bounds: Floats
    """(2,): LIMIT and AT_GOAL"""
    counters: Longs
    """`HEAP_SIZE` and `WORK`, as those of all sweeps"""


class Starts(NamedTuple):
    """Where paths begin: segments of sources in faces, a point where both ends are the same."""

    faces: Ints
    """(R,): inner face"""
    weights: Floats
    """(R, 6): of both ends at its inner corners"""
    sources: Ints
    """(R,): index of the source"""
    values: Floats
    """(R,): cost at which it starts"""


class Goal(NamedTuple):
    """The one point that a sweep is to reach; none where there are neither faces nor a vertex."""

    vertex: int
    """Inner vertex, or -1"""
    faces: Ints
    """(G,): the inner faces that hold it"""
    weights: Floats
    """(G, 3): at their inner corners"""
    position: Floats
    """(4,): in space, mesh units from the mesh's origin, and its height"""
    least: float
    """Factor of the cheapest face: costs from a node are no less than those of the straight line to
    the goal at this factor. 0 where the search is not directed to the goal."""


ALONG = -2
SETTLED = -2

# Bounds of a sweep
LIMIT = 0  # paths that cost more are left out
AT_GOAL = 1  # cost of the cheapest path to the goal that is known


@inlined
def apex_of(graph: Any, h: int) -> tuple[float, float]:
    """Return the apex of a half-edge in its frame."""
    row = ROW * h
    reach = graph.geometry[row + LENGTH_LEFT]
    return reach * graph.geometry[row + COS_LEFT], reach * graph.geometry[row + SIN_LEFT]


@inlined
def next_of_edge(graph: Any, h: int) -> int:
    """Return the half-edge of the same edge in the next of its faces; negative if there is none."""
    opposite = graph.links[ROW * h + OPPOSITE]
    return graph.links[ROW * h + AROUND] >> 1 if opposite == IRREGULAR else opposite


@inlined
def runs_up(graph: Any, h: int) -> bool:
    """Whether the nodes of its edge are numbered from a half-edge's tail."""
    return graph.links[ROW * h + TAIL] < graph.links[ROW * h + HEAD]


@inlined
def spacing(graph: Any, e: int) -> float:
    """Return the distance of neighbours on an edge, a share of its length."""
    return 1.0 / (graph.first_node[e + 1] - graph.first_node[e] + 1)


@inlined
def node_place(graph: Any, n: int) -> float:
    """Return the place of a node on its edge, 0 to 1 from the end of lower number."""
    e = graph.edge_of_node[n - graph.vertices]
    return (n - graph.first_node[e] + 1) * spacing(graph, e)


@inlined
def least_factor(graph: Any, e: int) -> float:
    """Return the factor of the cheapest face of an edge."""
    first = graph.half_edge[e]
    least, h = graph.factors[first // 3], next_of_edge(graph, first)
    while h >= 0 and h != first:
        least = min(least, graph.factors[h // 3])
        h = next_of_edge(graph, h)
    return least


@inlined
def half_edge_in(graph: Any, e: int, face: int) -> int:
    """Return the half-edge of an edge in one of its faces."""
    h = 3 * face
    if graph.edge_of[h] == e:
        return h
    return h + 1 if graph.edge_of[h + 1] == e else h + 2


@inlined
def height(graph: Any, v: int) -> float:
    """Return the height of a vertex; 0 where there is no rule."""
    return graph.heights[v] if graph.rule.pieces > 0 else 0.0


@kernel
def place_in_frame(graph: Any, n: int, shift: float, h: int) -> tuple[float, float, float]:
    """Return a node of the face of a half-edge in its frame, and its height.

    An edge's node is taken at the place ``shift`` on its edge.
    """
    row = ROW * h
    ax, ay = apex_of(graph, h)
    length, tail, head, apex = (
        graph.geometry[row + LENGTH],
        graph.links[row + TAIL],
        graph.links[row + HEAD],
        graph.links[row + APEX],
    )
    if n < graph.vertices:
        if n == tail:
            return 0.0, 0.0, height(graph, tail)
        if n == head:
            return length, 0.0, height(graph, head)
        return ax, ay, height(graph, apex)
    e, g = graph.edge_of_node[n - graph.vertices], h
    x0, y0, u, x1, y1, v = 0.0, 0.0, tail, length, 0.0, head
    if graph.edge_of[h] != e:
        g = following(h)
        if graph.edge_of[g] == e:
            x0, y0, u, x1, y1, v = length, 0.0, head, ax, ay, apex
        else:
            g = previous(h)
            x0, y0, u, x1, y1, v = ax, ay, apex, 0.0, 0.0, tail
    s = shift if runs_up(graph, g) else 1.0 - shift
    low, high = height(graph, u), height(graph, v)
    return x0 + s * (x1 - x0), y0 + s * (y1 - y0), low + s * (high - low)
