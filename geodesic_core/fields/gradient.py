"""Gradients at the vertices: the directions in which distance grows fastest."""

import numpy as np

from geodesic_core.arrays import Flags, Floats
from geodesic_core.fields.path import located_path
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.front.state import ENTRY_EDGE, NODE, PREDECESSOR
from geodesic_core.kernels.mesh.half_edges import APEX, COS_LEFT, HEAD, LENGTH_LEFT, SIN_LEFT, TAIL
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import ROUNDED_POSITION, SAME_PLACE


def gradient_at_vertices(mesh: TriangleMesh, winners: Winners, nodes: Nodes) -> Floats:
    """Return unit vectors (V, 3) away from where the path to each vertex comes from; NaN for none.

    The winning window has the pseudosource in the plane of the face that the path ends in. A face
    of no area has no such plane: there the path is traced. O(V).
    """
    topology = mesh.topology
    gradient = np.full(mesh.vertices.shape, np.nan)
    vertices = winners.vertices
    via = vertices.winner_ints[: len(gradient), ENTRY_EDGE]
    is_parallel = _is_parallel(winners)
    reached = np.flatnonzero((via >= 0) & np.isfinite(vertices.distance[: len(gradient)]))
    reached = reached[~_lies_on_curve(mesh, winners, is_parallel)[reached]]
    via = via[reached]
    geometry, positions = topology.geometry[via], mesh.positions
    tail, head, apex = (positions[topology.links[via, k]] for k in (TAIL, HEAD, APEX))
    reach = geometry[:, LENGTH_LEFT]
    at_apex = np.column_stack([geometry[:, COS_LEFT] * reach, geometry[:, SIN_LEFT] * reach])
    away = at_apex - vertices.winner[reached]
    parallel = is_parallel[reached]
    away[parallel] = -vertices.winner[reached[parallel]]  # a parallel window has a direction only
    if len(vertices.crossing):  # the path may bend where it crosses its last edge
        crossing = vertices.crossing[reached]
        crosses = np.isfinite(crossing)
        away[crosses] = at_apex[crosses]
        away[crosses, 0] -= crossing[crosses]
    along = _unit(head - tail)
    across = apex - tail
    across = _unit(across - np.einsum("ij,ij->i", across, along)[:, None] * along)
    gradient[reached] = _unit(away[:, :1] * along + away[:, 1:] * across)
    for v in reached[np.isnan(gradient[reached, 0])]:
        located, _ = located_path(mesh, winners, nodes, v)
        away = located.points[-1] - located.points
        away = away[np.linalg.norm(away, axis=1) > SAME_PLACE * vertices.distance[v]]
        if len(away):  # else it lies at the source
            gradient[v] = _unit(away[-1:])[0]
    return gradient[topology.inner_vertex]


def _is_parallel(winners: Winners) -> Flags:
    """Tell which nodes are reached from a segment of a curve."""
    predecessors = winners.vertices.winner_ints[:, PREDECESSOR]
    segments = winners.sites.segment_ints
    if len(segments) == 0:
        return np.zeros(len(predecessors), np.bool_)
    is_parallel: Flags = predecessors >= segments[0, NODE]
    return is_parallel


def _lies_on_curve(mesh: TriangleMesh, winners: Winners, is_parallel: Flags) -> Flags:
    """Tell which nodes lie on the segment that reaches them, as corners of flat faces may."""
    lies, distance = np.zeros_like(is_parallel), winners.vertices.distance
    nodes = np.flatnonzero(is_parallel & np.isfinite(distance))
    segments = winners.vertices.winner_ints[nodes, PREDECESSOR]
    away = distance[nodes] - distance[segments]
    lies[nodes] = away <= ROUNDED_POSITION * mesh.extent
    return lies


def _unit(vectors: Floats) -> Floats:
    with np.errstate(invalid="ignore"):  # of no length, no direction: NaN
        unit: Floats = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
