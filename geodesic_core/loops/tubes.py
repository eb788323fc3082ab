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
from geodesic_core.fields.path import EXACT, GeodesicPath, joined, traced_path
from geodesic_core.fields.question import Question
from geodesic_core.fields.straighten import straightened_curve
from geodesic_core.fields.sweep_result import all_winners
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.mesh.half_edges import BOUNDARY, FANS, SEAM, TAIL
from geodesic_core.loops.covers import cover_of
from geodesic_core.mesh.surface_curve import SurfaceCurve, curve_through, point_of, rows_of
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
    for part in islice(rounds(control.for_part(1, 2)), MOST_PASSES):
        nearer = _through_tubes(tight, part.for_part(0, 2))
        nearer = straightened_curve(nearer, part.for_part(1, 2), free_ends=free_ends)
        if nearer.length >= tight.length * (1.0 - SHORTER):
            break
        tight = nearer
    return tight


def _through_tubes(curve: SurfaceCurve, control: Control) -> SurfaceCurve:
    """Return a curve whose parts are the shortest in their tubes."""
    count = len(curve.faces)
    parts = [(0, count // 2), (count // 2, count)] if curve.closed else [(0, count)]
    parts, legs = [part for part in parts if part[0] < part[1]], []
    while parts:
        control.checkpoint(0.0)
        first, end = parts.pop(0)
        leg = _leg(curve, first, end)
        if end - first > 1:
            shortest = _shortest_in_tube(leg, control)
            if shortest is None:
                middle = (first + end) // 2
                parts[:0] = [(first, middle), (middle, end)]
                continue
            leg = min(leg, shortest, key=lambda path: path.length)
        legs.append(leg)
    if not legs:
        return curve
    path = joined(legs)
    if not curve.closed:
        return path
    located = rows_of(path.located, slice(0, -1))
    return SurfaceCurve(path.mesh, path.faces, True, path.length, located)


def _leg(curve: SurfaceCurve, first: int, end: int) -> GeodesicPath:
    """Return some segments of a curve as a path."""
    mesh, starts, ends = curve._segments()
    faces = curve._inner_faces[first:end]
    points = np.append(faces, faces[-1]), np.vstack([starts[first:end], ends[end - 1]])
    return _as_path(curve_through(mesh, *points, faces, closed=False))


def _as_path(curve: SurfaceCurve) -> GeodesicPath:
    return GeodesicPath(**vars(curve), error_bound=EXACT, steps=None)


def _shortest_in_tube(leg: GeodesicPath, control: Control) -> GeodesicPath | None:
    """Return the shortest path in the tube of a path; None if the tube is no disc."""
    mesh = leg.on_mesh()
    half_edges = len(mesh.topology.links)
    kept = np.zeros(half_edges // 3, bool)
    kept[_tube(mesh, leg._inner_faces)] = True
    cover = cover_of(mesh, np.zeros((1, half_edges), np.int64), kept, control)
    if not _is_disc(cover.mesh):
        return None
    start, end = (cover.lifted(point_of(leg.located, i), 0) for i in (0, -1))
    control = control.holding(cover.mesh.nbytes)
    question = Question.of(cover.mesh, start, [end], math.inf, control)
    winners = all_winners(ExactSweep(question).run(control, "paths"))
    node = int(question.nodes.targets[0])
    return _as_path(cover.lowered(traced_path(cover.mesh, winners, question.nodes, node, EXACT)))


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
