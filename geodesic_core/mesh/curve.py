"""Curves on the surface: polylines each of whose segments lies in a face."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.kernels.mesh.half_edges import APEX, TAIL
from geodesic_core.mesh.canonical import half_edges_around
from geodesic_core.mesh.edge_lengths import flat_points, weights_in_faces
from geodesic_core.mesh.surface_curve import SurfaceCurve, curve_through
from geodesic_core.mesh.surface_point import Curve, Point, SurfacePoint, Weights

if TYPE_CHECKING:  # which makes curves
    from geodesic_core.mesh.triangle_mesh import TriangleMesh

Polyline = tuple[SurfacePoint, ...]
"""The canonical points of a curve; of a point, itself alone."""

_NO_VERTEX = -1


class SegmentInFace(NamedTuple):
    """A segment of a curve in one of the faces that it lies in."""

    face: int
    """Inner face"""
    start: Weights
    """Weights of its beginning at the face's inner corners"""
    end: Weights
    """Weights of its end there"""


def polyline_of(mesh: "TriangleMesh", curve: Curve, name: str, control: Control) -> Polyline:
    """Return the canonical points of a curve; ``name`` is how messages call it.

    Raises
    ------
    InvalidArgument
        It has no points.
    InvalidPoint
        One is not a point of the mesh, or shares no face with the next.
    Cancelled, DeadlineExceeded
        As the control says.
    """
    if isinstance(curve.points, str | bytes) or not isinstance(curve.points, Iterable):
        raise InvalidArgument(
            f"the points of {name} are {curve.points!r}; give a sequence of points"
        )
    points = tuple(
        mesh.point(point, f"point {i} of {name}")
        for i, point in enumerate(control.watched(curve.points))
    )
    if not points:
        raise InvalidArgument(f"{name} is a curve without points; give at least one")
    for i, (start, end) in enumerate(control.watched(pairwise(points))):
        if shared_face(mesh, start, end) is None:
            raise InvalidPoint(
                f"the points {i} and {i + 1} of {name}, {start} and {end}, have no face in common; "
                "add the points where the curve crosses edges: a shortest path has them"
            )
    return points


def share_a_face(mesh: "TriangleMesh", start: Point, end: Point) -> bool:
    """Tell whether two points have a face in common, as neighbours on a `Curve` must.

    Parameters
    ----------
    mesh
        The surface.
    start, end
        Vertex indices or `SurfacePoint`.

    Returns
    -------
    bool
        True where a straight segment in a face joins them, and where they are the same.

    Raises
    ------
    InvalidPoint
        One is not a point of the mesh.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> mesh = gc.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]])
    >>> gc.share_a_face(mesh, 0, 2)
    True
    >>> gc.share_a_face(mesh, 1, 3)
    False
    """
    ends = mesh.point(start, "start"), mesh.point(end, "end")
    return shared_face(mesh, *ends) is not None


def shared_face(mesh: "TriangleMesh", start: SurfacePoint, end: SurfacePoint) -> int | None:
    """Return the lowest face that two canonical points have in common; None if they have none."""
    if start == end:
        return start.face_index
    shared = weights_by_face(mesh, start).keys() & weights_by_face(mesh, end)
    return int(mesh.topology.outer_face[list(shared)].min()) if shared else None


def curve_on(mesh: "TriangleMesh", points: Sequence[Point], *, closed: bool) -> SurfaceCurve:
    """Return the curve through some points.

    Raises
    ------
    InvalidArgument
        There are no points.
    InvalidPoint
        One is not a point of the mesh or lies in blocked faces only, or two share no face.
    """
    stops = polyline_of(mesh, Curve(points), "the curve", Control())
    if closed and shared_face(mesh, stops[-1], stops[0]) is None:
        raise InvalidPoint(f"no face holds the last point, {stops[-1]}, and the first, {stops[0]}")
    stops = (*stops, stops[0]) if closed else stops
    faces = np.array([point.face_index for point in stops], np.int32)
    weights = np.array([point.barycentric for point in stops])
    between = np.array([shared_face(mesh, *ends) for ends in pairwise(stops)], np.int64)
    inner = np.where(faces >= 0, mesh.inner_face[faces], -1).astype(np.int64)
    if (inner < 0).any():
        raise InvalidPoint(f"{stops[int(inner.argmin())]} is in no face that is free")
    weights = weights_in_faces(mesh.topology, mesh.faces, faces, weights, inner)
    inner_between = mesh.inner_face[between].astype(np.int64)
    return curve_through(mesh, inner, weights, inner_between, closed=closed)


def segments_of(
    mesh: "TriangleMesh", polyline: Iterable[SurfacePoint]
) -> list[list[SegmentInFace]]:
    """Return the segments of a polyline, each in all faces that hold it.

    Segments of no length are left out.
    """
    segments = []
    for start, end in pairwise(polyline):
        places = mesh.position_from_origin(start), mesh.position_from_origin(end)
        is_long = start != end if mesh.lengths is not None else not np.array_equal(*places)
        if is_long:
            at_start, at_end = weights_by_face(mesh, start), weights_by_face(mesh, end)
            shared = [face for face in at_start if face in at_end]
            segments.append([SegmentInFace(face, at_start[face], at_end[face]) for face in shared])
    return segments


def weights_by_face(mesh: "TriangleMesh", point: SurfacePoint) -> dict[int, Weights]:
    """Return each inner face that a canonical point belongs to, with its weights there."""
    topology = mesh.topology
    if point.vertex_index is not None:
        v = topology.inner_vertex[point.vertex_index]
        leaving = topology.corners[topology.first_corner[v] : topology.first_corner[v + 1]].tolist()
        return {h // 3: (float(h % 3 == 0), float(h % 3 == 1), float(h % 3 == 2)) for h in leaving}
    corners = topology.inner_vertex[mesh.faces[point.face_index]].tolist()
    share = dict(zip(corners, point.barycentric, strict=True))

    def weights_in(face: int) -> Weights:
        u, v, w = topology.links[3 * face : 3 * face + 3, TAIL].tolist()
        return share.get(u, 0.0), share.get(v, 0.0), share.get(w, 0.0)

    face = int(mesh.inner_face[point.face_index])
    if 0.0 not in point.barycentric:
        return {face: weights_in(face)}
    (h,) = (h for h in range(3 * face, 3 * face + 3) if share[topology.links[h, APEX]] == 0.0)
    return {g // 3: weights_in(g // 3) for g in half_edges_around(topology.links, h)}


def length_in_face(mesh: "TriangleMesh", start: SurfacePoint, end: SurfacePoint) -> float:
    """Return the distance of two canonical points in one face, within it, mesh units."""
    if mesh.lengths is None:
        return float(
            np.linalg.norm(mesh.position_from_origin(start) - mesh.position_from_origin(end))
        )
    face = int(mesh.inner_face[start.face_index])
    apart = np.array(weights_by_face(mesh, start)[face]) - weights_by_face(mesh, end)[face]
    return float(np.hypot(*flat_points(mesh.topology, np.array([face]), apart[None])[0]))


def foot_on(
    mesh: "TriangleMesh", segment: SegmentInFace, inner_face: int, point: SurfacePoint
) -> SurfacePoint:
    """Return the canonical point of a segment that is nearest to a point of an inner face.

    The segment lies in that face as well.
    """
    topology = mesh.topology
    corners = topology.links[3 * inner_face : 3 * inner_face + 3, TAIL].tolist()
    own = topology.links[3 * segment.face : 3 * segment.face + 3, TAIL].tolist()
    start, end = (
        np.array([dict(zip(own, weights, strict=True)).get(v, 0.0) for v in corners])
        for weights in (segment.start, segment.end)
    )
    weights = np.stack([start, end, weights_by_face(mesh, point)[inner_face]])
    first, last, place = flat_points(topology, np.full(3, inner_face), weights)
    along = last - first
    t = min(max(float((place - first) @ along / (along @ along)), 0.0), 1.0)
    share = dict(zip(corners, ((1.0 - t) * start + t * end).tolist(), strict=True))
    face = int(topology.outer_face[inner_face])
    u, v, w = (share[v] for v in topology.inner_vertex[mesh.faces[face]].tolist())
    return mesh.point(SurfacePoint.face(face, (u, v, w)))


def polylines_to_arrays(name: str, lines: Sequence[Polyline]) -> dict[str, NDArray[Any]]:
    """Return canonical points, line by line, as arrays whose names begin with ``name``."""
    points = list(chain.from_iterable(lines))
    vertices = [_NO_VERTEX if p.vertex_index is None else p.vertex_index for p in points]
    return {
        f"{name}_sizes": np.array([len(line) for line in lines], np.int64),
        f"{name}_faces": np.array([point.face_index for point in points], np.int64),
        f"{name}_weights": np.array([point.barycentric for point in points]).reshape(-1, 3),
        f"{name}_vertices": np.array(vertices, np.int64),
    }


def polylines_from_arrays(name: str, arrays: Mapping[str, NDArray[Any]]) -> tuple[Polyline, ...]:
    """Return the lines that were `polylines_to_arrays` under this name."""
    rows = zip(
        *(arrays[f"{name}_{part}"].tolist() for part in ("faces", "weights", "vertices")),
        strict=True,
    )
    points = iter(
        SurfacePoint(face, tuple(weights), None if vertex == _NO_VERTEX else vertex)
        for face, weights, vertex in rows
    )
    sizes = arrays[f"{name}_sizes"].tolist()
    return tuple(tuple(next(points) for _ in range(size)) for size in sizes)
