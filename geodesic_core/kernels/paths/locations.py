"""From the nodes of a traced path to points of the surface, in the caller's numbering."""

from typing import Any

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL, next_around


@kernel
def place_nodes(
    topology: Any,
    faces: Ints,
    nodes: Ints,
    parameters: Floats,
    face_of: Ints,
    weights: Floats,
    vertex_of: Longs,
    points: Floats,
) -> None:
    """Fill the canonical face, its barycentric weights, the vertex (or -1) and the position.

    Nodes as in `backtrace.trace_path`; a vertex of no face has face -1, and sites are left as they
    are. ``faces`` are the caller's.
    """
    for i in range(len(nodes)):
        v, t = -1 - nodes[i], parameters[i]
        if v < 0 and (t == 0.0 or 1.0 - t == 0.0 or 1.0 - t == 1.0):
            # At a vertex, also where t is too small to tell
            v = topology.links[nodes[i], TAIL if t < 0.5 else HEAD]
        weights[i, 0], weights[i, 1], weights[i, 2] = 0.0, 0.0, 0.0
        if v >= len(topology.total_angle):
            continue  # a site
        if v >= 0:
            vertex_of[i] = topology.outer_vertex[v]
            points[i] = topology.positions[v]
            lowest = -1
            for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
                face = topology.outer_face[topology.corners[c] // 3]
                if lowest < 0 or face < lowest:
                    lowest = face
            face_of[i] = lowest
            weights[i, corner_of(topology, faces, lowest, v) if lowest >= 0 else 0] = 1.0
            continue
        h = nodes[i]
        u, w = topology.links[h, TAIL], topology.links[h, HEAD]
        lowest, g = topology.outer_face[h // 3], h
        while True:
            g = next_around(topology.links, g)
            if g < 0 or g == h:
                break
            lowest = min(lowest, topology.outer_face[g // 3])
        vertex_of[i], face_of[i] = -1, lowest
        weights[i, corner_of(topology, faces, lowest, u)] = 1.0 - t
        weights[i, corner_of(topology, faces, lowest, w)] = t
        for axis in range(3):
            points[i, axis] = (1.0 - t) * topology.positions[u, axis] + t * topology.positions[
                w, axis
            ]


@kernel
def corner_of(topology: Any, faces: Ints, face: int, v: int) -> int:
    """Return which corner of a face inner vertex v is; both as the caller has them."""
    for k in range(2):
        if topology.inner_vertex[faces[face, k]] == v:
            return k
    return 2


@kernel
def leave_out_repeated(face_of: Ints, weights: Floats, kept: Flags) -> None:
    """Mark which places differ from the one before: a path through a vertex meets several edges."""
    for i in range(len(face_of)):
        kept[i] = 1
        if i > 0 and face_of[i] == face_of[i - 1]:
            same = True
            for k in range(3):
                same = same and weights[i, k] == weights[i - 1, k]
            kept[i] = 0 if same else 1
