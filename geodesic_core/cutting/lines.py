"""Curves to cut along, all as the same arrays."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.mesh.curve import polyline_of, shared_face
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.surface_point import Curve
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class Line(NamedTuple):
    """A polyline of K points, each of whose segments lies in a face; in the caller's numbers."""

    location_faces: Longs
    """(K,): a face that holds each point"""
    location_weights: Floats
    """(K, 3): weights in it"""
    faces: Longs
    """(K - 1,), or (K,) if closed: the face that holds the segment from each point to the next"""
    closed: bool
    """Whether a segment leads from the last point to the first"""


NO_LINE = Line(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0, np.int64), closed=False)
"""A line of no points, along which nothing is cut."""


def as_line(mesh: TriangleMesh, curve: object, name: str, control: Control) -> Line:
    """Return a curve as a line; ``name`` is how messages call it.

    Raises
    ------
    InvalidArgument
        It is no curve, or that of another mesh.
    InvalidPoint
        One of its points is not on the mesh, or shares no face with the next.
    Cancelled, DeadlineExceeded
        As the control says.
    """
    line = _line_of(mesh, curve, name, control)
    is_placed = (line.location_faces >= 0) & (line.location_faces < len(mesh.faces))
    if not is_placed.all():
        raise InvalidPoint(f"point {is_placed.argmin()} of {name} is in no face of the mesh")
    return line


def _line_of(mesh: TriangleMesh, curve: object, name: str, control: Control) -> Line:
    if isinstance(curve, SurfaceCurve):
        if curve.mesh is not None and not _has_faces_of(curve.mesh, mesh):
            raise InvalidArgument(f"{name} is a curve on another mesh: it has other faces")
        if (curve.faces < 0).any():
            raise InvalidArgument(f"{name} was resampled: cut along the curve that it came from")
        located = curve.located
        return Line(
            located.faces.astype(np.int64),
            located.weights,
            curve.faces.astype(np.int64),
            curve.closed,
        )
    if isinstance(curve, Curve):
        points = polyline_of(mesh, curve, name, control)
        between = [shared_face(mesh, *ends) for ends in control.watched(pairwise(points))]
        return Line(
            np.array([point.face_index for point in points], np.int64),
            np.array([point.barycentric for point in points]),
            np.array(between, np.int64),
            closed=False,
        )
    raise InvalidArgument(f"{name} is {curve!r}; it must be a Curve or a SurfaceCurve")


def _has_faces_of(mesh: TriangleMesh, other: TriangleMesh) -> bool:
    return mesh is other or np.array_equal(mesh.faces, other.faces)
