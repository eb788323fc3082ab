"""Curves pulled tight, and the shortest in their tubes.

The tube of a curve is the faces that it crosses, and those that share a vertex with one. If it is a
disc, each curve in it can be moved to any other with the same ends: an exact sweep of the tube
finds the shortest near the curve. If it is none, as where a curve meets itself or goes around a
hole, the curve is halved.
"""

import math
from itertools import islice

import numpy as np

from geodesic_core.arrays import Longs
from geodesic_core.control import Control, rounds
from geodesic_core.fields.path import EXACT, traced_path
from geodesic_core.fields.question import Question
from geodesic_core.fields.straighten import (
    Line,
    joined,
    straightened_curve,
    straightened_line,
)
from geodesic_core.fields.sweep_result import all_winners
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.mesh.half_edges import BOUNDARY, FANS, SEAM, TAIL
from geodesic_core.loops.covers import cover_of
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import MOST_PASSES, SHORTER


def shortest_nearby(
    curve: SurfaceCurve, control: Control, *, free_ends: bool = False
) -> SurfaceCurve:
    """Return a curve pulled tight, and no longer than any with the same ends in its tubes.

    Each round but the last makes it shorter, by more than SHORTER of its length.

    Raises
    ------
    InvalidArgument, NoLoop, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `straightened_curve`.
    """
    tight = straightened_curve(curve, control.for_part(0, 2), free_ends=free_ends)
    mesh, closed = tight.on_mesh(), tight.closed
    for part in islice(rounds(control.for_part(1, 2)), MOST_PASSES):
        if len(tight.faces) == 0:
            break
        line = _through_tubes(mesh, Line.of(tight), part.for_part(0, 2), closed=closed)
        last = part.for_part(1, 2)
        nearer = straightened_line(mesh, line, last, closed=closed, free_ends=free_ends)
        if nearer.length >= tight.length * (1.0 - SHORTER):
            break
        tight = nearer
    return tight


def _through_tubes(mesh: TriangleMesh, line: Line, control: Control, *, closed: bool) -> Line:
    """Return a line whose parts are the shortest in their tubes."""
    count = len(line.faces)
    middle = count // 2 if closed else 0
    parts = [line.part(0, middle), line.part(middle, count)]
    found = []
    while parts:
        control.checkpoint(0.0)
        part = parts.pop(0)
        count = len(part.faces)
        shortest = _shortest_in_tube(mesh, part, control) if count > 1 else part
        if shortest is None:
            parts[:0] = [part.part(0, count // 2), part.part(count // 2, count)]
        else:
            found.append(shortest)
    return joined(found)


def _shortest_in_tube(mesh: TriangleMesh, line: Line, control: Control) -> Line | None:
    """Return the shortest line in the tube of a line; None if the tube is no disc."""
    half_edges = len(mesh.topology.links)
    kept = np.zeros(half_edges // 3, bool)
    kept[_tube(mesh, line.faces)] = True
    in_one_sheet = np.broadcast_to(np.int64(0), (1, half_edges))
    cover = cover_of(mesh, in_one_sheet, kept, control)
    if not _is_disc(cover.mesh):
        return None
    start = cover.point_in(int(line.faces[0]), line.starts[0], 0)
    end = cover.point_in(int(line.faces[-1]), line.ends[-1], 0)
    control = control.holding(cover.mesh.nbytes)
    question = Question.of(cover.mesh, start, [end], math.inf, control)
    winners = all_winners(ExactSweep(question).run(control, "paths"))
    node = int(question.nodes.targets[0])
    path = traced_path(cover.mesh, winners, question.nodes, node, EXACT)
    return Line.of(cover.lowered(path))


def _tube(mesh: TriangleMesh, faces: Longs) -> Longs:
    """Return some inner faces and those that share a vertex with one."""
    topology = mesh.topology
    vertices = np.unique(topology.links[3 * faces[:, None] + np.arange(3), TAIL])
    first, end = (topology.first_corner[vertices + i].astype(np.int64) for i in (0, 1))
    ranges = np.repeat(end - np.cumsum(end - first), end - first)
    found: Longs = topology.corners[ranges + np.arange(len(ranges))].astype(np.int64) // 3
    return found


def _is_disc(mesh: TriangleMesh) -> bool:
    """Whether a mesh is connected, has a boundary, and no hole: then its Euler number is 1."""
    topology = mesh.topology
    is_surface = not (topology.flags & (SEAM | FANS)).any()
    has_rim = bool((topology.flags & BOUNDARY).any())
    number = len(topology.total_angle) - mesh.edge_count + len(topology.links) // 3
    return is_surface and has_rim and number == 1 and not mesh.components.any()
