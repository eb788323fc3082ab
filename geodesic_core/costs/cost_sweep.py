"""Cost sweeps: sources and costs in, values and the tree of paths out."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.costs.nodes import graph_of
from geodesic_core.costs.surface_costs import SurfaceCosts
from geodesic_core.errors import InvalidPoint
from geodesic_core.kernels.costs import sweep as kernels
from geodesic_core.kernels.costs.graph import AT_GOAL, Front, Goal, Graph, Starts
from geodesic_core.kernels.front.counters import new_counters
from geodesic_core.kernels.mesh.half_edges import TAIL
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.mesh.curve import Polyline, segments_of, weights_by_face
from geodesic_core.mesh.edge_lengths import flat_points
from geodesic_core.mesh.surface_point import SurfacePoint, Weights
from geodesic_core.mesh.triangle_mesh import TriangleMesh

Detail = Literal["default", "fine"]

PER_EDGE: dict[str, int] = {"default": 2, "fine": 5}
PER_EDGE_BY_SLOPE: dict[str, int] = {"default": 4, "fine": 8}
"""Nodes on an edge of mean length. Slopes need more: what a step costs changes faster with its
direction, and has kinks."""

_FIRST_BUDGET = 100_000
"""Steps of the first slice: some milliseconds"""
_SMALLEST_BUDGET = 1000
_BYTES_A_NODE = 56
"""Of the front, and of the graph"""

NO_GOAL = Goal(-1, np.empty(0, np.int32), np.empty((0, 3)), np.zeros(4), 0.0)


Place = Mapping[int, Weights]
"""Weights of a point in each of its inner faces"""


class Arrival(NamedTuple):
    """The end of a path at a point inside a face, or on its edges."""

    cost: float
    """Infinite where no path is known"""
    node: int
    """The node before, or -1 - row of the starts where the path begins in the same face"""
    face: int
    """The inner face between"""
    share: float
    """Share of the way along the segment of a source from where it begins"""


@dataclass(frozen=True, eq=False)
class CostSweep:
    """What a sweep has found: its tree of paths holds all that they need."""

    mesh: TriangleMesh
    costs: SurfaceCosts
    """In the direction of the sweep, away from its sources"""
    graph: Graph
    front: Front
    starts: Starts

    @cached_property
    def values(self) -> Floats:
        """(V,) by the caller's vertex; infinite where it was not settled."""
        inner = self.mesh.topology.inner_vertex
        is_settled = self.front.nearest[inner] >= 0
        return np.where(is_settled, self.front.values[inner], np.inf)

    @property
    def nbytes(self) -> int:
        """Memory of the graph and of the state, without the mesh."""
        own = (self.graph.edge_of, self.graph.half_edge, self.graph.first_node)
        arrays = (*own, self.graph.edge_of_node, self.costs.factors, self.costs.heights)
        return sum(array.nbytes for array in (*arrays, *self.front))

    def best_at(self, place: Place) -> Arrival:
        """Return the cheapest way known to a point that has these weights in some inner faces."""
        best = Arrival(np.inf, -1, -1, 0.0)
        for face, weights in place.items():
            if not np.isfinite(self.costs.factors[face]):
                continue
            for arrive in (self._from_nodes, self._from_starts):
                arrival = arrive(face, np.array(weights))
                best = arrival if arrival.cost < best.cost else best
        return best

    def _from_nodes(self, face: int, end: Floats) -> Arrival:
        """Return the cheapest way over a node of a face to a point in it."""
        corners = self.mesh.topology.links[3 * face : 3 * face + 3, TAIL]
        nodes, weights = [corners.astype(np.int64)], [np.eye(3)]
        for i in range(3):
            e = int(self.graph.edge_of[3 * face + i])
            first, after = self.graph.first_node[e : e + 2].tolist()
            share = (np.arange(after - first) + 1.0) / (after - first + 1.0)
            if corners[i] > corners[(i + 1) % 3]:
                share = 1.0 - share
            nodes.append(np.arange(first, after))
            weights.append(
                (1.0 - share[:, None]) * np.eye(3)[i] + share[:, None] * np.eye(3)[i - 2]
            )
        every = np.concatenate(nodes)
        values = np.where(self.front.nearest[every] >= 0, self.front.values[every], np.inf)
        costs = values + self.steps_within(face, np.concatenate(weights), end)
        k = int(np.argmin(costs))
        return Arrival(float(costs[k]), int(every[k]), face, 0.0)

    def _from_starts(self, face: int, end: Floats) -> Arrival:
        """Return the cheapest way from a source in a face to a point in it."""
        best = Arrival(np.inf, -1, face, 0.0)
        for row in np.flatnonzero(self.starts.faces == face).tolist():
            ends = self.starts.weights[row].reshape(2, 3)
            first, last, place = flat_points(
                self.mesh.topology, np.full(3, face), np.vstack([ends, end])
            )
            square = float((last - first) @ (last - first))
            nearest = float((place - first) @ (last - first)) / square if square > 0.0 else 0.0
            share = min(max(nearest, 0.0), 1.0)
            start = (1.0 - share) * ends[0] + share * ends[1]
            cost = float(self.starts.values[row] + self.steps_within(face, start[None], end)[0])
            if cost < best.cost:
                best = Arrival(cost, -1 - row, face, share)
        return best

    def steps_within(self, face: int, starts: Floats, end: Floats) -> Floats:
        """Return the costs of steps in an inner face, from weights (N, 3) to weights."""
        apart = flat_points(self.mesh.topology, np.full(len(starts), face), end - starts)
        rises = np.zeros(len(starts))
        if not self.costs.is_symmetric:
            corners = self.mesh.topology.links[3 * face : 3 * face + 3, TAIL]
            rises = (end - starts) @ self.costs.heights[corners]
        faces = np.full(len(starts), face)
        return self.costs.of_steps(faces, (apart * apart).sum(axis=1), rises)


def nodes_on_edge(costs: SurfaceCosts, detail: Detail) -> int:
    """Return the number of nodes on an edge of mean length that a detail stands for."""
    return (PER_EDGE if costs.is_symmetric else PER_EDGE_BY_SLOPE)[detail]


def sweep_costs(
    mesh: TriangleMesh,
    costs: SurfaceCosts,
    starts: Starts,
    per_edge: int,
    limit: float,
    control: Control,
    goal: Goal = NO_GOAL,
) -> CostSweep:
    """Run a sweep from its starts to the goal, or over all that it reaches within a limit.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    graph = graph_of(mesh, per_edge, costs)
    count = int(graph.first_node[-1])
    control.check_memory(_BYTES_A_NODE * count)
    control.checkpoint(0.0)
    front = _new_front(count, limit)
    found = CostSweep(mesh, costs, graph, front, starts)
    if len(goal.faces):  # a path may begin in a face of the goal, and not leave it
        place = dict(zip(goal.faces.tolist(), map(tuple, goal.weights.tolist()), strict=True))
        front.bounds[AT_GOAL] = found.best_at(place).cost
    kernels.begin(graph, front, starts, goal)
    budget, outcome, shown = _FIRST_BUDGET, Outcome.RUNNING, 0.0
    while outcome == Outcome.RUNNING:
        control.checkpoint(shown)
        began = time.perf_counter()
        outcome = kernels.advance(graph, front, starts, goal, budget)
        faster = SLICE_SECONDS / max(time.perf_counter() - began, 1e-9)
        budget = max(int(budget * min(max(faster, 0.5), 2.0)), _SMALLEST_BUDGET)
        if control.progress is not None:
            settled = np.count_nonzero(front.nearest >= 0) / count
            shown = max(shown, min(settled, 1.0))
    return found


def _new_front(count: int, limit: float) -> Front:
    integers = [np.full(count, -1, np.int32) for _ in range(4)]
    predecessors, ways, nearest, heap_place = integers
    return Front(
        values=np.full(count, np.inf),
        shifts=np.zeros(count),
        predecessors=predecessors,
        ways=ways,
        nearest=nearest,
        heap_place=heap_place,
        heap=np.empty(count, np.int32),
        heap_keys=np.empty(count),
        bounds=np.array([limit, np.inf]),
        counters=new_counters(),
    )


def starts_of(
    mesh: TriangleMesh, costs: SurfaceCosts, lines: Sequence[Polyline], values: Sequence[float]
) -> Starts:
    """Return where the paths of sources begin, each given by its canonical points and its value.

    Raises
    ------
    InvalidPoint
        One lies in faces only that no path may enter.
    """
    faces: list[int] = []
    weights: list[tuple[float, ...]] = []
    sources: list[int] = []
    for i, line in enumerate(lines):
        parts = [(f, w + w) for f, w in weights_by_face(mesh, line[0]).items()]
        if len(line) > 1:
            parts += [(p.face, p.start + p.end) for some in segments_of(mesh, line) for p in some]
        is_open = [bool(np.isfinite(costs.factors[face])) for face, _ in parts]
        if not any(is_open):
            raise InvalidPoint(f"the source {i}, {line[0]}, {CLOSED}")
        for (face, at_corners), use in zip(parts, is_open, strict=True):
            if use:
                faces.append(face)
                weights.append(at_corners)
                sources.append(i)
    indices: Ints = np.array(sources, np.int32)
    return Starts(
        np.array(faces, np.int32),
        np.array(weights, np.float64).reshape(-1, 6),
        indices,
        np.array(values, np.float64)[indices],
    )


CLOSED = "lies in no face that a path may enter"
"""What is wrong with a point"""


def goal_of(mesh: TriangleMesh, costs: SurfaceCosts, point: SurfacePoint) -> Goal:
    """Return a canonical point as the goal of a search.

    Raises
    ------
    InvalidPoint
        It lies in faces only that no path may enter.
    """
    place = weights_by_face(mesh, point)
    if not any(np.isfinite(costs.factors[list(place)])):
        raise InvalidPoint(f"the target, {point}, {CLOSED}")
    position, least = np.zeros(4), 0.0
    if mesh.lengths is None:
        position[:3] = mesh.position_from_origin(point)
        position[3] = position[:3] @ costs.up
        least = costs.least
    if point.vertex_index is not None:
        vertex = int(mesh.topology.inner_vertex[point.vertex_index])
        return Goal(vertex, np.empty(0, np.int32), np.empty((0, 3)), position, least)
    faces = np.array(list(place), np.int32)
    return Goal(-1, faces, np.array(list(place.values())), position, least)
