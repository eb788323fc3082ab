"""Nodes of a cost sweep: the vertices of a mesh, and points on its edges."""

import numpy as np

from geodesic_core.arrays import Ints
from geodesic_core.costs.surface_costs import SurfaceCosts
from geodesic_core.kernels.costs.graph import Graph
from geodesic_core.kernels.mesh.half_edges import AROUND, IRREGULAR, LENGTH, OPPOSITE, Topology
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_MOST = 8
"""Times the points of an edge of mean length that an edge may have: a face costs their square."""


def graph_of(mesh: TriangleMesh, per_edge: int, costs: SurfaceCosts) -> Graph:
    """Return the graph with so many nodes on an edge of mean length; O(F)."""
    topology, vertices = mesh.topology, len(mesh.vertices)
    edge_of, half_edge = edges_of(topology)
    lengths = topology.geometry[half_edge, LENGTH]
    mean = lengths.mean() if len(lengths) else 1.0
    counts = np.rint((per_edge + 1) * lengths / mean - 1.0)
    counts = np.clip(counts, max(per_edge // 2, 1), _MOST * per_edge).astype(np.int32)
    first = np.empty(len(half_edge) + 1, np.int32)
    first[0] = vertices
    np.cumsum(counts, out=first[1:])
    first[1:] += vertices
    return Graph(
        vertices=vertices,
        geometry=topology.geometry,
        links=topology.links,
        first_corner=topology.first_corner,
        corners=topology.corners,
        edge_of=edge_of,
        half_edge=half_edge,
        first_node=first,
        edge_of_node=np.repeat(np.arange(len(half_edge), dtype=np.int32), counts),
        factors=costs.factors,
        positions=mesh.positions,
        heights=costs.heights,
        rule=costs.rule,
    )


def edges_of(topology: Topology) -> tuple[Ints, Ints]:
    """Return the edge of each half-edge, and one half-edge of each edge, the lowest."""
    links = topology.links
    lowest = np.arange(len(links), dtype=np.int32)
    opposite = links[:, OPPOSITE]
    np.minimum(lowest, opposite, out=lowest, where=opposite >= 0)
    for h in np.flatnonzero(opposite == IRREGULAR).tolist():
        g = int(links[h, AROUND]) >> 1
        while g != h:
            lowest[h] = min(lowest[h], g)
            g = int(links[g, AROUND]) >> 1
    is_first = lowest == np.arange(len(links))
    number = np.cumsum(is_first, dtype=np.int32) - 1
    return number[lowest].astype(np.int32), np.flatnonzero(is_first).astype(np.int32)
