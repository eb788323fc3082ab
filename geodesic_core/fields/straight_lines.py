"""Straightest lines over the surface: from a point in a direction, for a length."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoDirection, NoTangentPlane
from geodesic_core.fields.path import EXACT, GeodesicPath
from geodesic_core.kernels.mesh import locations
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    point_in_frame,
)
from geodesic_core.kernels.mesh.locations import Locations
from geodesic_core.kernels.paths.straight_lines import (
    ANGLE,
    AT_BOUNDARY,
    AT_LENGTH,
    AT_NON_MANIFOLD,
    AT_VERTEX,
    DX,
    DY,
    FLOATS,
    HALF_EDGE,
    INTS,
    LEFT,
    STOP,
    VERTEX,
    Trail,
    X,
    Y,
    enter_face,
    load_line,
    store_line,
    through_vertex,
    trace_lines,
)
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.frames import axis_of, base_of, direction_of, frame_at
from geodesic_core.mesh.surface_curve import in_space, point_of, rows_of
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import WEIGHT

Stopped = Literal["length", "boundary", "barrier", "vertex", "non_manifold"]

_WORDS: dict[int, Stopped] = {
    AT_LENGTH: "length",
    AT_BOUNDARY: "boundary",
    AT_VERTEX: "vertex",
    AT_NON_MANIFOLD: "non_manifold",
}

_TRAIL = 1 << 16
"""Points that a call of the kernel traces, at most: some milliseconds"""

_TRAIL_BYTES = 20 * _TRAIL


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
    or a vertex where several fans of faces meet"""
    end_direction: float
    """Direction in which it would go on, radians in the frame of its last point; NaN where that has
    no tangent plane"""

    def __repr__(self) -> str:
        return f"StraightLine({self.summary}, stopped by {self.stopped})"


def directions_from(
    mesh: TriangleMesh, starts: Sequence[SurfacePoint], directions: ArrayLike
) -> Floats:
    """Return the kernels' angles of directions at canonical points, angles or vectors.

    Raises
    ------
    NoTangentPlane
        A start has none.
    NoDirection
        A vector has none on the surface.
    InvalidArgument
        They are neither finite angles nor finite vectors, one or as many as starts.
    """
    try:
        given = np.asarray(directions, np.float64)
    except (TypeError, ValueError):
        given = np.array(np.nan)
    count = len(starts)
    if given.shape not in ((), (count,), (3,), (count, 3)) or not np.isfinite(given).all():
        raise InvalidArgument(
            f"direction must be a finite angle or a vector of three, or {count} of them"
        )
    are_vectors = given.shape == (count, 3) or (given.shape == (3,) and count != 3)
    given = np.broadcast_to(given, (count, 3) if are_vectors else (count,))
    angles = np.empty(count)
    for i, start in enumerate(starts):
        try:
            frame = frame_at(mesh, start)
        except NoTangentPlane as error:
            raise NoTangentPlane(str(error), i) from None
        angle = direction_of(mesh, start, given[i]) if are_vectors else given[i]
        if math.isnan(angle):
            raise NoDirection(
                f"direction {i} is {given[i].tolist()}, which is zero, or along the normal at "
                f"{start}: it has no direction on the surface",
                i,
            )
        angles[i] = frame.kernel_angles(np.array(angle))
    return angles


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
    return np.broadcast_to(lengths, (count,))


def lines_from(
    mesh: TriangleMesh,
    starts: Sequence[SurfacePoint],
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
    ints, floats = np.zeros((len(starts), INTS), np.int64), np.zeros((len(starts), FLOATS))
    for i, start in enumerate(control.watched(starts)):
        _start(mesh, start, float(kernel_angles[i]), float(lengths[i]), ints, floats, i)
    trail = _traced(mesh, ints, floats, stops, control)
    return _as_paths(mesh, starts, lengths, ints, floats, trail)


def _start(
    mesh: TriangleMesh,
    start: SurfacePoint,
    angle: float,
    length: float,
    ints: Longs,
    floats: Floats,
    i: int,
) -> None:
    """Write a line that begins at a canonical point to row i. Modifies both arrays."""
    geometry = mesh.topology.geometry
    ints[i, [VERTEX, HALF_EDGE]], floats[i, ANGLE], floats[i, LEFT] = -1, angle, length
    if start.vertex_index is not None:
        ints[i, VERTEX] = v = mesh.topology.inner_vertex[start.vertex_index]
        faces, total = {}, float(mesh.topology.total_angle[v])
    else:
        faces = weights_by_face(mesh, start)
        total = len(faces) * math.pi if 0.0 in start.barycentric else math.inf
    if not -_OFF <= angle <= total + _OFF and not frame_at(mesh, start).is_closed:
        ints[i, STOP] = AT_BOUNDARY
    elif faces:
        number = 0 if len(faces) == 1 else min(max(int(angle // math.pi), 0), len(faces) - 1)
        face, weights = list(faces.items())[number]
        h = base_of(face, weights)
        x, y = point_in_frame(geometry, h, np.array(weights))
        line = enter_face(geometry, h, x, y, angle - number * math.pi, length)
        store_line(ints, floats, i, line)


_OFF = 1e-12
"""Radians by which a direction may miss the wedge of the surface at a boundary"""


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
            np.empty(_TRAIL),
            np.empty(_TRAIL, np.int32),
        )
        done, count = trace_lines(mesh.topology, ints, floats, done, stops, trail)
        trails.append([array[:count].copy() for array in trail])
        size += sum(array.nbytes for array in trails[-1])
    if control.progress is not None:
        control.progress(1.0)
    arrays: list[Any] = [np.concatenate(parts) for parts in zip(*trails, strict=True)]
    return Trail(*arrays)


def _as_paths(
    mesh: TriangleMesh,
    starts: Sequence[SurfacePoint],
    lengths: Floats,
    ints: Longs,
    floats: Floats,
    trail: Trail,
) -> list[StraightLine]:
    """Return lines that have ended as paths: a start each, its part of the trail, and an end."""
    is_inside = ints[:, STOP] == AT_LENGTH  # ends in a face, and not where the trail does
    inside = np.flatnonzero(is_inside)
    ends = _ends_in_faces(mesh, ints[inside, HALF_EDGE], floats[inside, X], floats[inside, Y])
    passed = np.bincount(trail.lines, minlength=len(starts))
    first = np.concatenate([[0], np.cumsum(1 + passed + is_inside)])
    all_rows = _empty_locations(int(first[-1]))
    is_passed = np.ones(len(all_rows.faces), np.bool_)
    is_passed[first[:-1]] = is_passed[first[1:][inside] - 1] = False
    _fill(all_rows, is_passed, _passed(mesh, trail))
    _fill(all_rows, first[:-1], _rows_of(mesh, starts))
    _fill(all_rows, first[1:][inside] - 1, ends)
    on_edges = first[1:][(ints[:, STOP] != AT_LENGTH) & (ints[:, VERTEX] < 0)] - 1
    canonical = [mesh.point(point_of(all_rows, row)) for row in on_edges]
    _fill(all_rows, on_edges, _rows_of(mesh, canonical))
    faces = np.empty(len(is_passed), np.int32)
    faces[is_passed] = mesh.topology.outer_face[trail.faces]
    faces[first[1:][inside] - 1] = mesh.topology.outer_face[ints[inside, HALF_EDGE] // 3]
    in_its_space, directions = in_space(mesh, all_rows), np.empty(len(starts))
    directions[inside] = _directions_in_faces(mesh, ints[inside, HALF_EDGE], floats[inside])
    lines = []
    for i, (lo, hi) in enumerate(pairwise(first.tolist())):
        end = point_of(all_rows, hi - 1)
        stop = int(ints[i, STOP])
        if stop != AT_LENGTH or 0.0 in end.barycentric:
            directions[i] = _direction_on_edge(mesh, end, ints[i], floats[i])
        lines.append(
            StraightLine(
                mesh=mesh,
                faces=faces[lo + 1 : hi],
                closed=False,
                length=float(lengths[i] - (0.0 if stop == AT_LENGTH else floats[i, LEFT])),
                located=rows_of(in_its_space, slice(lo, hi)),
                error_bound=EXACT,
                steps=None,
                stopped=_word(mesh, stop, end),
                end_direction=float(directions[i]),
            )
        )
    return lines


def _empty_locations(count: int) -> Locations:
    return Locations(
        np.empty(count, np.int32),
        np.empty((count, 3)),
        np.empty(count, np.int64),
        np.empty((count, 3)),
    )


def _fill(all_rows: Locations, rows: Any, located: Locations) -> None:
    columns: tuple[Any, ...] = all_rows
    for column, part in zip(columns, located, strict=True):
        column[rows] = part


def _passed(mesh: TriangleMesh, trail: Trail) -> Locations:
    """Return the points of a trail."""
    located = _empty_locations(len(trail.nodes))
    locations.locate_nodes(mesh.embedding, mesh.faces, trail.nodes, trail.parameters, located)
    return located


def _rows_of(mesh: TriangleMesh, points: Sequence[SurfacePoint]) -> Locations:
    """Return canonical points as locations."""
    places = {point: mesh.position_from_origin(point) for point in set(points)}
    vertices = (-1 if point.vertex_index is None else point.vertex_index for point in points)
    return Locations(
        np.array([point.face_index for point in points], np.int32),
        np.array([point.barycentric for point in points]).reshape(-1, 3),
        np.fromiter(vertices, np.int64, len(points)),
        np.array([places[point] for point in points]).reshape(-1, 3),
    )


def _ends_in_faces(mesh: TriangleMesh, h: Longs, x: Floats, y: Floats) -> Locations:
    """Return the points at (x, y) in the frames of half-edges, in their faces."""
    topology = mesh.topology
    columns = [LENGTH, LENGTH_LEFT, COS_LEFT, SIN_LEFT]
    length, to_left, cosine, sine = topology.geometry[h][:, columns].T
    with np.errstate(invalid="ignore", divide="ignore"):
        up = np.where(sine > 0.0, np.clip(y / (sine * to_left), 0.0, 1.0), 0.0)
    along = np.clip((x - up * cosine * to_left) / length, 0.0, 1.0 - up)
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
    _fill(located, beside, _rows_of(mesh, points))
    return located


def _word(mesh: TriangleMesh, stop: int, end: SurfacePoint) -> Stopped:
    """Return the word for why a line stops; an edge or a vertex of a blocked face is a barrier."""
    if stop == AT_BOUNDARY and len(mesh.barriers):
        corners = mesh.topology.inner_vertex[mesh.faces[end.face_index]]
        at = corners[np.array(end.barycentric) > 0.0]
        blocked = mesh.topology.inner_vertex[mesh.faces[mesh.barriers]]
        if (blocked[:, :, None] == at).any(axis=1).all(axis=1).any():
            return "barrier"
    return _WORDS[stop]


def _directions_in_faces(mesh: TriangleMesh, h: Longs, floats: Floats) -> Floats:
    """Return the directions of lines that end inside the faces of half-edges, in their frames.

    The same as `frame_at` would give, for many at once.
    """
    topology, base = mesh.topology, h - h % 3
    geometry = topology.geometry[base]
    axes = np.stack(  # of the three half-edges, in the frame of the first
        [
            np.zeros(len(h)),
            math.pi - np.arctan2(geometry[:, SIN_RIGHT], geometry[:, COS_RIGHT]),
            math.pi + np.arctan2(geometry[:, SIN_LEFT], geometry[:, COS_LEFT]),
        ],
        axis=1,
    )
    nodes = topology.inner_vertex[mesh.faces[topology.outer_face[h // 3]]]
    tails = topology.links[base[:, None] + np.arange(3), TAIL]
    first, second = (np.argmax(tails == nodes[:, [k]], axis=1) for k in (0, 1))
    is_same_way, row = second == (first + 1) % 3, np.arange(len(h))
    axis = np.where(is_same_way, axes[row, first], axes[row, second] + math.pi)
    turn = np.arctan2(floats[:, DY], floats[:, DX]) + axes[row, h % 3] - axis
    directions: Floats = np.mod(np.where(is_same_way, turn, -turn), 2.0 * math.pi)
    return directions


def _direction_on_edge(mesh: TriangleMesh, end: SurfacePoint, ints: Longs, floats: Floats) -> float:
    """Return the same of a line that ends on an edge or at a vertex; NaN if it has no plane."""
    try:
        frame, h = frame_at(mesh, end), int(ints[HALF_EDGE])
    except InvalidPoint:
        return math.nan
    if ints[VERTEX] >= 0 or h < 0:
        angle = float(floats[ANGLE])
    elif end.vertex_index is not None:  # as long as asked for: it was not sent on from there
        line = load_line(ints[None], floats[None], 0)
        v = int(mesh.topology.inner_vertex[end.vertex_index])
        angle = through_vertex(mesh.topology, line, v, True).angle
    else:
        faces = weights_by_face(mesh, end)
        base = base_of(h // 3, faces[h // 3])
        angle = list(faces).index(h // 3) * math.pi - axis_of(mesh, base, h)
        angle += math.atan2(floats[DY], floats[DX])
    return float(frame.angles(np.array(angle)))
