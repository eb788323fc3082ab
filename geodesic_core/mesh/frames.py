"""Frames at points of a mesh, and the directions of vectors in them."""

import math

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import NoTangentPlane
from geodesic_core.kernels.mesh.frames import Frame, find_frames
from geodesic_core.kernels.mesh.half_edges import FANS
from geodesic_core.kernels.mesh.locations import Locations
from geodesic_core.mesh.canonical import cross
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.surface_curve import locations_of, point_of, rows_of
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import NO_DIRECTION


def frame_at(mesh: TriangleMesh, point: SurfacePoint) -> Frame:
    """Return the frame of a canonical point.

    Raises
    ------
    NoTangentPlane
        It has none.
    """
    frames = frames_at(mesh, locations_of(mesh, [point]))
    if math.isnan(frames.start[0]):
        raise NoTangentPlane(_why_no_plane(mesh, point))
    start, sense, total_angle, is_closed = (column[0].item() for column in frames)
    return Frame(start, sense, total_angle, is_closed)


def frames_at(mesh: TriangleMesh, located: Locations) -> Frame:
    """Return the frames of canonical points, as arrays; see `find_frames`."""
    return find_frames(mesh.topology, mesh.faces, mesh.inner_face, located)


def planes_at(mesh: TriangleMesh, located: Locations) -> Frame:
    """Return the frames of canonical points that all have a tangent plane.

    Raises
    ------
    NoTangentPlane
        One has none.
    """
    frames = frames_at(mesh, located)
    for i in np.flatnonzero(np.isnan(frames.start)).tolist():
        raise NoTangentPlane(_why_no_plane(mesh, point_of(located, i)), i)
    return frames


def _why_no_plane(mesh: TriangleMesh, point: SurfacePoint) -> str:
    why = f"{len(weights_by_face(mesh, point))} faces meet at an edge"
    if point.vertex_index is not None:
        has_fans = mesh.topology.flags[mesh.topology.inner_vertex[point.vertex_index]] & FANS
        why = "several fans of faces meet" if has_fans else "no free face has an angle there"
    return (
        f"{point} has no tangent plane, as {why}: directions have no meaning there; choose a point "
        "beside it"
    )


def directions_of(mesh: TriangleMesh, located: Locations, frames: Frame, vectors: Floats) -> Floats:
    """Return the directions of vectors in space (N, 3), projected to the surface at N points.

    (N,) radians in the frames of the points; NaN where a projection has no direction. Raises
    `NotEmbedded` where the surface is given by its lengths.
    """
    mesh.require_embedded("a direction")
    scales = np.ones(len(vectors))
    x_axes, y_axes = np.empty((2, len(vectors), 3))
    is_vertex = located.vertices >= 0
    if is_vertex.any():
        planes, at = mesh.tangent_frames(), located.vertices[is_vertex]
        x_axes[is_vertex], y_axes[is_vertex] = planes.x_axes[at], planes.y_axes[at]
        scales[is_vertex] = planes.scales[at]
    beside = ~is_vertex
    x_axes[beside], y_axes[beside] = _axes_in_faces(
        mesh, rows_of(located, beside), Frame(*(column[beside] for column in frames))
    )
    x, y = np.vecdot(x_axes, vectors), np.vecdot(y_axes, vectors)
    # Not numpy's arctan2, whose last bit depends on the processor
    turns = np.mod(list(map(math.atan2, y.tolist(), x.tolist())), 2.0 * math.pi)
    is_lost = np.hypot(x, y) <= NO_DIRECTION * _lengths(vectors)
    directions: Floats = np.where(is_lost, np.nan, turns / scales)
    return directions


def _axes_in_faces(mesh: TriangleMesh, located: Locations, frames: Frame) -> tuple[Floats, Floats]:
    """Return the axes of the tangent planes of points that are no vertices, (N, 3) each."""
    corners, row = mesh.vertices[mesh.faces[located.faces]], np.arange(len(located.faces))
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # At a boundary along that, else along the edge from corner 0 to corner 1
    beyond = np.where(frames.is_closed, 2, np.argmax(located.weights == 0.0, axis=1))
    x_axes = corners[row, (beyond + 2) % 3] - corners[row, (beyond + 1) % 3]
    x_axes /= _lengths(x_axes)[:, None]
    normals /= _lengths(normals)[:, None]
    return x_axes, cross(normals, x_axes)


def _lengths(vectors: Floats) -> Floats:
    lengths: Floats = np.sqrt(np.vecdot(vectors, vectors))
    return lengths
