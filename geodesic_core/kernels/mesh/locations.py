"""Locations: the points of traced paths and lines on the surface, in the caller's numbering."""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.jit import borrowed, inlined, kernel, pointer, prefetch
from geodesic_core.kernels.mesh.half_edges import HEAD, ROW, TAIL, Embedding, Topology, next_around
from geodesic_core.tolerances import WEIGHT


class Locations(NamedTuple):
    """Points of the surface, a row each."""

    faces: Ints
    """(N,): the canonical face, the lowest that holds the point; -1 for a vertex of no face"""
    weights: Floats
    """(N, 3): barycentric, in that face"""
    vertices: Longs
    """(N,): the vertex, or -1"""
    points: Floats
    """(N, 3): positions, mesh units from the mesh's origin"""


@kernel
def empty_locations(count: int) -> Locations:
    """Return room for so many points."""
    return Locations(
        np.empty(count, np.int32),
        np.empty((count, 3)),
        np.empty(count, np.int64),
        np.empty((count, 3)),
    )


AHEAD = 16
"""Nodes from one to that whose half-edge is fetched meanwhile"""


@kernel
def locate_nodes(
    embedding: Embedding, faces: Ints, nodes: Ints, parameters: Floats, locations: Locations
) -> None:
    """Fill ``locations`` with the points of nodes as `backtracing.trace_path` has them.

    ``faces`` are the caller's. Sites are skipped, but for their weights, which become 0.
    """
    embedding, locations = borrowed(embedding), borrowed(locations)
    faces, topology = borrowed(faces), embedding.topology
    links = pointer(topology.links)
    for i in range(len(nodes)):
        if i + AHEAD < len(nodes):
            prefetch(links, ROW * max(nodes[i + AHEAD], 0))
        v, t = -1 - nodes[i], parameters[i]
        if v < 0 and (t == 0.0 or 1.0 - t == 0.0 or 1.0 - t == 1.0):
            # At a vertex, also where t is too small to tell
            v = topology.links[nodes[i], TAIL if t < 0.5 else HEAD]
        for k in range(3):
            locations.weights[i, k] = 0.0
        if v < 0:
            locate_on_edge(embedding, faces, nodes[i], 1.0 - t, t, locations, i)
        elif v < len(topology.total_angle):
            locate_vertex(embedding, faces, v, locations, i)


@inlined
def locate_vertex(embedding: Embedding, faces: Ints, v: int, locations: Locations, i: int) -> None:
    """Fill row i of ``locations``, whose weights are 0, with inner vertex v."""
    topology, positions = embedding
    lowest = -1
    for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
        face = topology.outer_face[topology.corners[c] // 3]
        if lowest < 0 or face < lowest:
            lowest = face
    locations.faces[i], locations.vertices[i] = lowest, topology.outer_vertex[v]
    corner = corner_of(topology, faces, lowest, v) if lowest >= 0 else 0
    locations.weights[i, corner] = 1.0
    for axis in range(3):
        locations.points[i, axis] = positions[v, axis]


@inlined
def locate_on_edge(
    embedding: Embedding, faces: Ints, h: int, tail: float, head: float, locations: Locations,
    i: int,
) -> None:  # fmt: skip
    """Fill row i of ``locations``, whose weights are 0, with the point of h with these weights."""
    topology, positions = embedding
    links, outer_face = topology.links, topology.outer_face
    u, w = links[h, TAIL], links[h, HEAD]
    lowest, g = outer_face[h // 3], next_around(links, h)
    while g >= 0 and g != h:
        lowest = min(lowest, outer_face[g // 3])
        g = next_around(links, g)
    locations.faces[i], locations.vertices[i] = lowest, -1
    locations.weights[i, corner_of(topology, faces, lowest, u)] = tail
    locations.weights[i, corner_of(topology, faces, lowest, w)] = head
    for axis in range(3):
        locations.points[i, axis] = tail * positions[u, axis] + head * positions[w, axis]


@kernel
def locate_points(
    embedding: Embedding, faces: Ints, inner_faces: Longs, weights: Floats
) -> Locations:
    """Return the points of inner faces (N,) that have weights (N, 3) at inner corners."""
    count = len(inner_faces)
    located = empty_locations(count)
    for i in range(count):
        locate_in_face(embedding, faces, inner_faces[i], weights, i, located, i)
    return located


@kernel
def locate_in_face(
    embedding: Embedding, faces: Ints, face: int, weights: Floats, row: int, locations: Locations,
    i: int,
) -> None:  # fmt: skip
    """Fill row i of ``locations`` with the point of an inner face that has weights in a row."""
    topology, positions = embedding
    links, corners, zero, corner = topology.links, 0, -1, -1
    for k in range(3):
        locations.weights[i, k] = 0.0
        if weights[row, k] > WEIGHT:
            corners, corner = corners + 1, k
        else:
            zero = k
    if corners == 1:
        locate_vertex(embedding, faces, links[3 * face + corner, TAIL], locations, i)
    elif corners == 2:
        k, following = (zero + 1) % 3, (zero + 2) % 3
        tail, head = weights[row, k], weights[row, following]
        if weights[row, zero] != 0.0:
            tail = 1.0 - head
        locate_on_edge(embedding, faces, 3 * face + k, tail, head, locations, i)
    else:
        outer = topology.outer_face[face]
        locations.faces[i], locations.vertices[i] = outer, -1
        for axis in range(3):
            locations.points[i, axis] = 0.0
        for k in range(3):
            v = links[3 * face + k, TAIL]
            locations.weights[i, corner_of(topology, faces, outer, v)] = weights[row, k]
        for k in range(3):  # in the caller's order, so that it rounds as given points do
            v = topology.inner_vertex[faces[outer, k]]
            for axis in range(3):
                locations.points[i, axis] += locations.weights[i, k] * positions[v, axis]


@kernel
def corner_of(topology: Topology, faces: Ints, face: int, v: int) -> int:
    """Return the corner of the caller's face that inner vertex v is."""
    for k in range(2):
        if topology.inner_vertex[faces[face, k]] == v:
            return k
    return 2


@kernel
def drop_repeats(outer_face: Ints, crossed: Ints, locations: Locations, between: Ints) -> int:
    """Move the locations that differ from the one before to the front; return how many they are.

    A path through a vertex meets several edges at the same point. ``crossed`` holds the inner faces
    between the N locations, the last first, as `backtracing.trace_path` has them.

    Modifies ``locations``, and ``between`` (N - 1,): the caller's faces between those that are
    left.
    """
    faces, weights, vertices, points = locations
    count = 0
    for i in range(len(faces)):
        same = count > 0 and faces[i] == faces[count - 1]
        for k in range(3):
            same = same and weights[i, k] == weights[count - 1, k]
        if same:
            continue
        faces[count], vertices[count] = faces[i], vertices[i]
        for k in range(3):
            weights[count, k], points[count, k] = weights[i, k], points[i, k]
        if count > 0:
            between[count - 1] = outer_face[crossed[len(crossed) - i]]
        count += 1
    return count
