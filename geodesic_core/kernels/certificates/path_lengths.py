"""Upper bounds of distances: lengths of traced paths, with all rounding counted.

A path is traced line by line: at the vertex where a line begins, the path of that vertex goes on,
and its bound is known. Each segment is measured in the plane of the face that it crosses. Where it
crosses an edge is a share s of the edge's length, which is taken as exact, from both faces. The
lengths hold for any path over the surface that ends at a source: nothing is assumed of the trace.

A segment is d1·e + d2·f, by the differences of two weights of its ends, which lie between 0 and 1,
and the edges e and f at the face's first corner. Let u be the rounding of an operation and S the
sum of |ex|, |fx| and |fy|. Then 1 - s is off by u, a difference by 3 u, a coordinate of the segment
by 5 u S, and the square root of the squares by 4 u S. Together that is less than `ROUNDED` · S, to
which the errors of e and f are added. Adding a line to the bound where it begins rounds once more,
which the factor 1 + 4 u makes up for.
"""

import math
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.certificates.faces import Faces, Numbers
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL, Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import Winners, trace_lines
from geodesic_core.tolerances import HALF_ULP as U

ROUNDED = 20.0 * U
"""Bound of the rounding of a segment's length, as a share of S"""

# Columns of a plane
EX = 0  # the edge from a face's first corner to its second one, along x
FX = 1  # that to the third one
FY = 2
SLACK = 3  # by how much the length of a segment in the face may be rounded
PLANE = 4

_FIRST_ROOM = 1024
"""Nodes of a path that there is room for at first"""


class Surface(NamedTuple):
    """The faces that paths may cross, and their planes."""

    faces: Faces
    numbers: Numbers
    planes: Floats
    """(F, PLANE)"""


class Starts(NamedTuple):
    """Where paths may begin."""

    at_vertices: Floats
    """(V,): start distance by the checker's vertex; infinite where no source is"""
    corners: Longs
    """(S, 3): those of the face of each source that is no vertex, by its node"""
    weights: Floats
    """(S, 3)"""
    rows: Longs
    """(S,): the row of its face; -1 where it lies on an edge, and so in several faces"""
    distances: Floats
    """(S,)"""


@kernel
def measure_paths(
    topology: Topology,
    winners: Winners,
    surface: Surface,
    starts: Starts,
    targets: Ints,
    bounds: Floats,
) -> None:
    """Fill in upper bounds of the distances of some nodes, and of all where their paths bend.

    ``bounds`` has one for each node, NaN where it is not known yet; infinite where no path can be
    traced. Each line of a path is measured once: what follows a bend is known from there.

    O(faces that lines cross).
    """
    room, most = _FIRST_ROOM, 4 * len(surface.numbers.faces) + _FIRST_ROOM
    nodes, parameters = np.empty(room, np.int32), np.empty(room)
    faces = np.empty(room, np.int32)
    chain, lengths = np.empty(len(bounds), np.int64), np.empty(len(bounds))
    for target in targets:
        v, size = target, 0
        while math.isnan(bounds[v]) and size < len(chain):
            outcome, count = trace_lines(topology, winners, v, 1, nodes, parameters, faces)
            if outcome == Outcome.PATH_FULL and room <= most:
                room *= 4
                nodes, parameters = np.empty(room, np.int32), np.empty(room)
                faces = np.empty(room, np.int32)
                continue
            if outcome != Outcome.FINISHED:
                bounds[v] = math.inf
            elif count == 1:
                bounds[v] = start_at(surface, starts, nodes[0])
            else:
                chain[size] = v
                lengths[size] = length_of(
                    topology, surface, starts, nodes, parameters, faces, count
                )
                v, size = -1 - nodes[count - 1], size + 1
        for i in range(size - 1, -1, -1):
            bounds[chain[i]] = (bounds[v] + lengths[i]) * (1.0 + 4.0 * U)
            v = chain[i]


@kernel
def length_of(
    topology: Topology,
    surface: Surface,
    starts: Starts,
    nodes: Ints,
    parameters: Floats,
    faces: Ints,
    count: int,
) -> float:
    """Return an upper bound of the length of a line of a path; infinite if it is none."""
    topology, surface, starts = borrowed(topology), borrowed(surface), borrowed(starts)
    total, segments, rows = 0.0, count - 1, surface.planes
    for i in range(segments):
        row = surface.numbers.faces[faces[i]]
        if row < 0:
            return math.inf
        v0, w0, off0 = weights_in(topology, surface, starts, row, nodes[i], parameters[i])
        v1, w1, off1 = weights_in(topology, surface, starts, row, nodes[i + 1], parameters[i + 1])
        x = (v1 - v0) * rows[row, EX] + (w1 - w0) * rows[row, FX]
        y = (w1 - w0) * rows[row, FY]
        size = rows[row, EX] + abs(rows[row, FX]) + rows[row, FY]
        total += math.sqrt(x * x + y * y) + (rows[row, SLACK] + (off0 + off1) * size)
    return total * (1.0 + 2.0 * U * (segments + 4)) * (1.0 + 4.0 * U)


@inlined
def weights_in(
    topology: Topology, surface: Surface, starts: Starts, row: int, node: int, share: float
) -> tuple[float, float, float]:
    """Return the weights of a node at the second and third corner of a face, and their error.

    The error is a share of S; infinite where the node is no point of the face.
    """
    v, count = -1 - node, len(surface.numbers.vertices)
    if v >= count:
        return weights_of_source(surface, starts, row, v - count)
    if v >= 0:
        tail = head = surface.numbers.vertices[v]
        share = 0.0
    else:
        tail = surface.numbers.vertices[topology.links[node, TAIL]]
        head = surface.numbers.vertices[topology.links[node, HEAD]]
        share = min(max(share, 0.0), 1.0)
    second = third = 0.0
    is_tail = is_head = False
    for k in range(3):
        weight = 0.0
        if surface.faces.corners[row, k] == tail:
            is_tail, weight = True, 1.0 - share
        elif surface.faces.corners[row, k] == head:
            weight = share
        is_head = is_head or surface.faces.corners[row, k] == head
        second, third = (weight if k == 1 else second), (weight if k == 2 else third)
    return second, third, 0.0 if is_tail and is_head else math.inf


@kernel
def weights_of_source(
    surface: Surface, starts: Starts, row: int, source: int
) -> tuple[float, float, float]:
    """Return the same of a source that is no vertex; its weights may not add up to 1."""
    second = third = total = 0.0
    is_in = starts.rows[source] in (-1, row)
    for c in range(3):
        weight, is_corner = starts.weights[source, c], False
        for k in range(3):
            if surface.faces.corners[row, k] == starts.corners[source, c]:
                is_corner = True
                second, third = (weight if k == 1 else second), (weight if k == 2 else third)
        is_in = is_in and (is_corner or weight == 0.0)
        total += weight
    return second, third, 4.0 * abs(total - 1.0) + 16.0 * U if is_in else math.inf


@inlined
def start_at(surface: Surface, starts: Starts, node: int) -> float:
    """Return the start distance of the source at a node; infinite where there is none."""
    v, count = -1 - node, len(surface.numbers.vertices)
    if v < 0:
        return math.inf
    return (
        starts.distances[v - count]
        if v >= count
        else starts.at_vertices[surface.numbers.vertices[v]]
    )
