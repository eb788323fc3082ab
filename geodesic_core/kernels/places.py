"""From the nodes of a traced path to points of the surface, in the caller's numbering."""

from typing import Any

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.topology import HEAD, OPPOSITE, TAIL, outer_half_edge


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
                outer = outer_half_edge(topology.outer_face, topology.corners[c])
                if lowest < 0 or outer < lowest:
                    lowest = outer
            face_of[i] = lowest // 3
            weights[i, max(lowest, 0) % 3] = 1.0
            continue
        outer = outer_half_edge(topology.outer_face, nodes[i])
        across = topology.links[nodes[i], OPPOSITE] >> 1
        if across >= 0:
            other = outer_half_edge(topology.outer_face, across)
            if other < outer:
                outer, t = other, 1.0 - t
        face, corner = outer // 3, outer % 3
        vertex_of[i], face_of[i] = -1, face
        weights[i, corner], weights[i, (corner + 1) % 3] = 1.0 - t, t
        u = topology.inner_vertex[faces[face, corner]]
        w = topology.inner_vertex[faces[face, (corner + 1) % 3]]
        for axis in range(3):
            points[i, axis] = (1.0 - t) * topology.positions[u, axis] + t * topology.positions[
                w, axis
            ]


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
