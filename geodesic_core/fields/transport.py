"""Parallel transport along the shortest paths to all vertices."""

import math

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweeps import DirectedSweep
from geodesic_core.kernels.front.directions import angles_at_sources, angles_of_legs
from geodesic_core.kernels.front.state import PREDECESSOR
from geodesic_core.kernels.mesh.half_edges import FANS
from geodesic_core.kernels.mesh.locations import empty_locations, locate_nodes
from geodesic_core.mesh.frames import frame_at, frames_at
from geodesic_core.mesh.transport import is_straight
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.mesh.vertex_frames import is_open, scales_of


def transported(question: Question, angle: float, control: Control) -> Floats:
    """Return a vector at the source of a question as its paths carry it to each vertex.

    (V,) radians in the frame of each vertex; NaN where unreached, where a vertex has no tangent
    plane, and behind such bends. O(V) after a sweep.

    Raises
    ------
    InvalidPoint
        The source has no tangent plane.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    mesh, ((source,),) = question.mesh, question.polylines
    frame, topology = frame_at(mesh, source), mesh.topology
    vertices = DirectedSweep(question, from_bends=True).run(control).vertices
    _, bends = angles_at_sources(topology, vertices, question.nodes.sites)
    leaving, arriving = angles_of_legs(topology, vertices, question.nodes.sites)
    count, scales = len(topology.flags), np.ones(len(bends))
    scales[:count] = np.where(topology.flags & FANS, np.nan, scales_of(topology))
    turns = np.full(len(bends), np.nan)
    turns[question.nodes.sources] = frame.turn_of(angle)
    sides, is_closed = np.where(vertices.mirrored, -1.0, 1.0), ~is_open(topology)
    for reached in _by_bends(bends, np.isfinite(leaving)):
        at = vertices.winner_ints[reached, PREDECESSOR]
        offset = turns[at] - scales[at] * leaving[reached]  # from the direction of the leg
        vertex = np.minimum(at, count - 1)  # a source that is none has no way back
        fan = topology.total_angle[vertex], is_closed[vertex]
        straight = is_straight(arriving[at], leaving[reached], *fan)
        offset[straight] = (turns[at] - scales[at] * arriving[at] - math.pi)[straight]
        turns[reached] = scales[reached] * arriving[reached] + math.pi + sides[reached] * offset
    return _in_frames(mesh, turns[:count], scales[:count])


def _by_bends(bends: Ints, is_reached: Flags) -> list[Longs]:
    """Return the nodes that are reached, in groups, those with fewer bends before others."""
    order = np.flatnonzero(is_reached)
    order = order[np.argsort(bends[order], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(bends[order])) + 1)


def _in_frames(mesh: TriangleMesh, turns: Floats, scales: Floats) -> Floats:
    """Return angles (V,) in the frames of vertices from turns of inner vertices."""
    nodes = -1 - np.arange(len(turns), dtype=np.int32)
    located = empty_locations(len(nodes))
    locate_nodes(mesh.embedding, mesh.faces, nodes, np.zeros(len(nodes)), located)
    frames = frames_at(mesh, located)
    away = frames.sense * (turns - scales * frames.start)
    angles: Floats = np.mod(away, 2.0 * math.pi) / scales
    return angles[mesh.topology.inner_vertex]
