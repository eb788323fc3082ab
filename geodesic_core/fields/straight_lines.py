"""Straightest lines over the surface: from a point in a direction, for a length."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoDirection
from geodesic_core.fields.path import EXACT, GeodesicPath
from geodesic_core.kernels.mesh.frames import Frame
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    TAIL,
)
from geodesic_core.kernels.mesh.locations import Locations, empty_locations, locate_nodes
from geodesic_core.kernels.paths.straight_lines import (
    AT_BOUNDARY,
    AT_COLLAPSED,
    AT_LENGTH,
    AT_NON_MANIFOLD,
    AT_VERTEX,
    HALF_EDGE,
    LEFT,
    PASSED,
    STOP,
    VERTEX,
    Trail,
    X,
    Y,
    begin_lines,
    directions_of_ends,
    trace_lines,
)
from geodesic_core.mesh.frames import directions_of, frames_at
from geodesic_core.mesh.surface_curve import fill, locations_of, point_of, rows_of
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import WEIGHT

Stopped = Literal["length", "boundary", "barrier", "vertex", "non_manifold", "collapsed"]

_WORDS: dict[int, Stopped] = {
    AT_LENGTH: "length",
    AT_BOUNDARY: "boundary",
    AT_VERTEX: "vertex",
    AT_NON_MANIFOLD: "non_manifold",
    AT_COLLAPSED: "collapsed",
}

_TRAIL = 1 << 16
"""Points that a call of the kernel traces, at most: some milliseconds"""

_TRAIL_BYTES = 24 * _TRAIL


@dataclass(frozen=True, eq=False, repr=False)
class StraightLine(GeodesicPath):
    """A straightest line: locally as short as can be, but seldom the shortest path to its end.

    Examples
    --------
    >>> line = gc.trace(gc.samples.plane(2), 0, np.pi / 8, 9.0)
    >>> line.stopped, round(line.length, 3)
    ('boundary', 1.082)
    """

    stopped: Stopped
    """What it ends at: ``"length"``, as long as asked for; ``"boundary"``; ``"barrier"``;
    ``"vertex"``, where lines were to end there; ``"non_manifold"``, an edge of three faces or more,
    or a vertex where several fans of faces meet; ``"collapsed"``, faces without
    area, in which it would circle on one spot for ever"""
    end_direction: float
    """Direction in which it would go on, radians in the frame of its last point; NaN where that has
    no tangent plane"""

    def __repr__(self) -> str:
        return f"StraightLine({self.summary}, stopped by {self.stopped})"


def directions_from(
    mesh: TriangleMesh, starts: Locations, frames: Frame, directions: ArrayLike
) -> Floats:
    """Return the kernels' angles of directions at canonical points, angles or vectors.

    Raises
    ------
    NoDirection
        A vector has none on the surface.
    InvalidArgument
        They are neither finite angles nor finite vectors, one or as many as starts.
    """
    try:
        given = np.asarray(directions, np.float64)
    except (TypeError, ValueError):
        given = np.array(np.nan)
    count = len(starts.faces)
    if given.shape not in ((), (count,), (3,), (count, 3)) or not np.isfinite(given).all():
        raise InvalidArgument(
            f"direction must be a finite angle or a vector of three, or {count} of them"
        )
    are_vectors = given.shape == (count, 3) or (given.shape == (3,) and count != 3)
    if not are_vectors:
        return frames.kernel_angles(np.broadcast_to(given, (count,)))
    vectors = np.broadcast_to(given, (count, 3))
    angles = directions_of(mesh, starts, frames, vectors)
    for i in np.flatnonzero(np.isnan(angles)).tolist():
        raise NoDirection(
            f"direction {i} is {vectors[i].tolist()}, which is zero, or along the normal at "
            f"{point_of(starts, i)}: it has no direction on the surface",
            i,
        )
    return frames.kernel_angles(angles)


def as_lengths(length: ArrayLike, count: int) -> Floats:
    """Return the lengths of so many lines.

    Raises
    ------
    InvalidArgument
        They are not finite numbers, 0 or more: one, or as many as lines.
    """
    try:
        lengths = np.asarray(length, np.float64)
    except (TypeError, ValueError):
        lengths = np.array(np.nan)
    if lengths.shape not in ((), (count,)) or not (np.isfinite(lengths) & (lengths >= 0.0)).all():
        raise InvalidArgument(f"length must be a finite number, 0 or more, or {count} of them")
    return np.broadcast_to(lengths, (count,)).copy()  # kernels are compiled for arrays of their own


def lines_from(
    mesh: TriangleMesh,
    starts: Locations,
    frames: Frame,
    kernel_angles: Floats,
    lengths: Floats,
    stops: bool,
    control: Control,
) -> list[StraightLine]:
    """Return straightest lines from canonical points; O(faces crossed).

    Angles are the kernels' own, see `Frame`. With ``stops`` lines end at vertices.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    ints, floats = begin_lines(
        mesh.topology, mesh.faces, mesh.inner_face, starts, frames, kernel_angles, lengths
    )
    trail = _traced(mesh, ints, floats, stops, control)
    return _as_paths(mesh, starts, lengths, ints, floats, trail)


def _traced(
    mesh: TriangleMesh, ints: Longs, floats: Floats, stops: bool, control: Control
) -> Trail:
    """Trace lines to their ends, which the rows tell then; return all points of their trails."""
    trails: list[list[Any]] = []
    done, size = 0, ints.nbytes + floats.nbytes + _TRAIL_BYTES
    while done < len(ints) or not trails:
        control.check_memory(size)
        control.checkpoint(done / max(len(ints), 1))
        trail = Trail(
            np.empty(_TRAIL, np.int32),
            np.empty(_TRAIL, np.int32),
            np.empty(_TRAIL, np.int32),
            np.empty(_TRAIL),
            np.empty(_TRAIL, np.int32),
        )
        done, count = trace_lines(mesh.topology, ints, floats, done, stops, trail)
        trails.append([array[:count].copy() for array in trail])
        size += sum(array.nbytes for array in trails[-1])
    control.finish()
    arrays: list[Any] = [np.concatenate(parts) for parts in zip(*trails, strict=True)]
    return Trail(*arrays)


def _as_paths(
    mesh: TriangleMesh,
    starts: Locations,
    lengths: Floats,
    ints: Longs,
    floats: Floats,
    trail: Trail,
) -> list[StraightLine]:
    """Return lines that have ended as paths: a start each, its part of the trail, and an end."""
    is_inside = ints[:, STOP] == AT_LENGTH  # ends in a face, and not where the trail does
    first = np.concatenate([[0], np.cumsum(1 + ints[:, PASSED] + is_inside)])
    located, faces = _located(mesh, trail, first)
    fill(located, first[:-1], starts)
    last, h = first[1:] - 1, ints[is_inside, HALF_EDGE]
    ends = _ends_in_faces(mesh, h, floats[is_inside, X], floats[is_inside, Y])
    fill(located, last[is_inside], ends)
    faces[last[is_inside]] = mesh.topology.outer_face[h // 3]
    on_edges = last[~is_inside & (ints[:, VERTEX] < 0)]
    canonical = [mesh.point(point_of(located, row)) for row in on_edges]
    fill(located, on_edges, locations_of(mesh, canonical))
    ends = rows_of(located, last)
    directions, stopped = _end_directions(mesh, ends, ints, floats), _words(mesh, ends, ints)
    done = np.where(is_inside, lengths, lengths - floats[:, LEFT])
    located.points[:] += mesh.origin  # as `in_space` does, which copies
    return [
        StraightLine(
            mesh=mesh,
            faces=faces[lo + 1 : hi],
            closed=False,
            length=length,
            located=rows_of(located, slice(lo, hi)),
            error_bound=EXACT,
            steps=None,
            stopped=word,
            end_direction=direction,
        )
        for (lo, hi), length, word, direction in zip(
            pairwise(first.tolist()), done.tolist(), stopped, directions.tolist(), strict=True
        )
    ]


def _located(mesh: TriangleMesh, trail: Trail, first: Longs) -> tuple[Locations, Ints]:
    """Return the points of lines that begin at these rows, and the faces before them.

    Starts and ends in faces, which are not on the trail, are left open.
    """
    count, rows = int(first[-1]), first[trail.lines] + 1 + trail.numbers
    nodes = np.full(count, _NOWHERE, np.int32)
    parameters, faces = np.zeros(count), np.empty(count, np.int32)
    nodes[rows], parameters[rows] = trail.nodes, trail.parameters
    faces[rows] = mesh.topology.outer_face[trail.faces]
    located = empty_locations(count)
    locate_nodes(mesh.embedding, mesh.faces, nodes, parameters, located)
    return located, faces


_NOWHERE = np.iinfo(np.int32).min
"""A node that `locate_nodes` skips, as it does sites"""


def _ends_in_faces(mesh: TriangleMesh, h: Longs, x: Floats, y: Floats) -> Locations:
    """Return the points at (x, y) in the frames of half-edges, in their faces."""
    topology = mesh.topology
    columns = [LENGTH, LENGTH_LEFT, COS_LEFT, SIN_LEFT]
    length, to_left, cosine, sine = topology.geometry[h][:, columns].T
    apex = cosine * to_left
    with np.errstate(invalid="ignore", divide="ignore"):
        beyond = np.where(x < 0.0, x / apex, (x - length) / (apex - length))
        flat = np.where((x < 0.0) | (x > length), beyond, 0.0)  # the face has no area
        up = np.clip(np.where(sine > 0.0, y / (sine * to_left), flat), 0.0, 1.0)
    along = np.clip((x - up * apex) / length, 0.0, 1.0 - up)
    share = np.stack([np.maximum(1.0 - along - up, 0.0), along, up], axis=1)
    faces = topology.outer_face[h // 3]
    at = topology.links[h][:, [TAIL, HEAD, APEX]]
    nodes = topology.inner_vertex[mesh.faces[faces]]
    weights = (share[:, None] * (nodes[:, :, None] == at[:, None])).sum(axis=2)
    corners = mesh.vertices[mesh.faces[faces]] - mesh.origin
    located = Locations(
        faces, weights, np.full(len(h), -1, np.int64), (weights[:, :, None] * corners).sum(axis=1)
    )
    beside = np.flatnonzero((weights <= WEIGHT).any(axis=1))  # on an edge, or at a vertex
    points = [
        mesh.point(SurfacePoint.face(int(faces[i]), tuple(weights[i].tolist()))) for i in beside
    ]
    fill(located, beside, locations_of(mesh, points))
    return located


def _words(mesh: TriangleMesh, ends: Locations, ints: Longs) -> list[Stopped]:
    """Return why lines stop; an edge or a vertex of a blocked face is a barrier."""
    words = [_WORDS[stop] for stop in ints[:, STOP].tolist()]
    if len(mesh.barriers):
        blocked = mesh.topology.inner_vertex[mesh.faces[mesh.barriers]]
        for i in np.flatnonzero(ints[:, STOP] == AT_BOUNDARY).tolist():
            corners = mesh.topology.inner_vertex[mesh.faces[ends.faces[i]]]
            at = corners[ends.weights[i] > 0.0]
            if (blocked[:, :, None] == at).any(axis=1).all(axis=1).any():
                words[i] = "barrier"
    return words


def _end_directions(mesh: TriangleMesh, ends: Locations, ints: Longs, floats: Floats) -> Floats:
    """Return the directions of lines at their ends, in their frames; NaN where there is no plane.

    Radians.
    """
    angles = directions_of_ends(mesh.topology, mesh.faces, mesh.inner_face, ends, ints, floats)
    return frames_at(mesh, ends).angles(angles)
