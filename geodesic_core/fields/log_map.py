"""The exact logarithmic map: where the surface lies on the tangent plane of a source."""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoDirection
from geodesic_core.fields.question import Question
from geodesic_core.fields.straight_lines import lines_from
from geodesic_core.fields.sweeps import DirectedSweep
from geodesic_core.kernels.front.directions import angles_at_sources
from geodesic_core.kernels.mesh.frames import Frame
from geodesic_core.mesh.frames import directions_of, frame_at, frames_at
from geodesic_core.mesh.surface_curve import locations_of
from geodesic_core.mesh.surface_point import Point, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import ROUNDED_TURN
from geodesic_core.validation import as_vector


class Polar(NamedTuple):
    """Where a point lies as seen from a source.

    Examples
    --------
    >>> log_map = gc.log_map(gc.samples.plane(2), 0)
    >>> log_map.at(3).angle == np.pi / 4
    True
    """

    distance: float
    """Mesh units."""
    angle: float
    """Radians, at which the shortest path leaves the source."""


@dataclass(frozen=True, eq=False, repr=False)
class LogMap:
    """Where each vertex lies as seen from a source: how far, and in which direction.

    On a polyhedron shortest paths bend at saddles and at the boundary. All that lies behind the
    first bend of a path is seen in the direction of that bend: so many vertices share a direction,
    and coordinates are no smooth chart there. ``bends`` tells where.

    Examples
    --------
    >>> log_map = gc.log_map(gc.samples.plane(2), 0)
    >>> log_map.coordinates.round(3).tolist()
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    >>> log_map.bends.tolist()
    [0, 0, 0, 0]
    """

    mesh: TriangleMesh
    """The surface, with the barriers of the call."""
    source: SurfacePoint
    """Canonical."""
    distances: Floats
    """(V,) mesh units; infinite where unreachable."""
    angles: Floats
    """(V,) radians: the angle on the surface at which the shortest path leaves the source,
    counter-clockwise seen from outside, from 0 up to `total_angle`. NaN where unreachable and at
    the source. At a boundary, angles before the x axis are negative."""
    bends: Ints
    """(V,) int32: vertices that the path bends at; -1 where unreachable."""
    total_angle: float
    """Sum of the angles of the surface around the source, radians."""
    _max_distance: float
    _frame: Frame
    _axis: float
    """Angle of the x axis in the frame"""
    _scale: float
    """Angle in the plane for one of the surface"""

    @property
    def coordinates(self) -> Floats:
        """(V, 2) float64, mesh units: each vertex in the tangent plane; NaN where unreachable."""
        turns = np.where(self.distances == 0.0, 0.0, self.angles * self._scale)
        radii = np.where(np.isfinite(self.distances), self.distances, np.nan)
        return np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1)

    def at(self, point: Point) -> Polar:
        """Return where any point of the surface lies.

        Parameters
        ----------
        point
            A vertex index or a `SurfacePoint`.

        Returns
        -------
        Polar
            Its distance, and the angle of the shortest path; infinite and NaN if unreachable, or
            beyond the limit of the map.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.

        Notes
        -----
        A sweep for a point that is no vertex.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> gc.log_map(mesh, 0).at(gc.SurfacePoint.edge(0, 1, 0.5)).distance == 5**0.5 / 2
        True
        """
        place = self.mesh.point(point)
        if place.vertex_index is not None:
            v = place.vertex_index
            return Polar(float(self.distances[v]), float(self.angles[v]))
        control = Control()
        question = Question.of(self.mesh, self.source, place, self._max_distance, control)
        distances, angles, _ = _swept(question, control)
        node = question.nodes.targets[0]
        angle = self._frame.angles(angles[[node]]) - self._axis
        return Polar(float(distances[node]), float(self._in_range(angle)[0]))

    def exp(self, coordinates: ArrayLike) -> list[SurfacePoint]:
        """Return the points at coordinates in the tangent plane: where straight lines end.

        Up to its first bend a shortest path is straight, so that this is the inverse of the map
        there. Where a line meets a saddle, points on both sides of it end far apart.

        Parameters
        ----------
        coordinates
            (N, 2), mesh units, or the two of one point.

        Returns
        -------
        list of SurfacePoint
            N canonical points. A line that meets the boundary ends there.

        Raises
        ------
        InvalidArgument
            They are not pairs of finite numbers.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> [mesh.position(point).tolist() for point in gc.log_map(mesh, 0).exp([0.5, 0.25])]
        [[0.5, 0.25, 0.0]]
        """
        try:
            pairs = np.atleast_2d(np.asarray(coordinates, np.float64))
        except (TypeError, ValueError):
            pairs = np.empty((0, 0))
        if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
            raise InvalidArgument("coordinates must be pairs of finite numbers, (N, 2)")
        turns = np.mod(np.arctan2(pairs[:, 1], pairs[:, 0]), 2.0 * math.pi) / self._scale
        angles = self._frame.kernel_angles(turns + self._axis)
        starts = locations_of(self.mesh, [self.source] * len(angles))
        frames, lengths = frames_at(self.mesh, starts), np.hypot(*pairs.T)
        lines = lines_from(self.mesh, starts, frames, angles, lengths, False, Control())
        return [line.locations[-1] for line in lines]

    def _in_range(self, angles: Floats) -> Floats:
        """Return angles from 0 up to the total angle; at a boundary, from the x axis on."""
        if self._frame.is_closed:
            return np.mod(angles, self.total_angle)
        return np.clip(angles, -self._axis, self.total_angle - self._axis)

    def __repr__(self) -> str:
        reached = int(np.isfinite(self.distances).sum())
        return f"LogMap(from {self.source}, {reached} of {len(self.distances)} vertices reached)"


def log_map_of(question: Question, control: Control, x_axis: Any, *, rescale: bool) -> LogMap:
    """Return the log map of a question whose source is one point.

    The x axis is a vector, or leads to the target of the question, if that has one.

    Raises
    ------
    NoTangentPlane
        The source has none.
    InvalidPoint
        No path leads to the target.
    NoDirection
        The x axis has none.
    InvalidArgument
        True angles do not fit into a plane.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    mesh, ((source,),) = question.mesh, question.polylines
    frame = frame_at(mesh, source)
    turn = 2.0 * math.pi
    if not rescale and frame.total_angle > turn * (1.0 + ROUNDED_TURN):
        raise InvalidArgument(
            f"the angles around {source} sum to {frame.total_angle:.6g}, more than a full turn: "
            "they do not fit into a plane without rescale=True"
        )
    axis = 0.0
    if x_axis is not None:
        at, vectors = locations_of(mesh, [source]), as_vector("x_axis", x_axis)[None]
        axis = float(directions_of(mesh, at, frames_at(mesh, at), vectors)[0])
    if math.isnan(axis):
        raise NoDirection("x_axis has no direction on the surface: it is zero, or along the normal")
    distances, angles, bends = _swept(question, control)
    inner, angles = mesh.topology.inner_vertex, frame.angles(angles)
    for node in question.nodes.targets:
        axis = float(angles[node])
    if math.isnan(axis):
        raise InvalidPoint(
            f"the x axis leads to {question.targets[0]}, which is the source itself, or which no "
            "path leads to: choose another point"
        )
    log_map = LogMap(
        mesh=mesh,
        source=source,
        distances=distances[inner],
        angles=angles[inner] - axis,
        bends=bends[inner],
        total_angle=frame.total_angle,
        _max_distance=question.max_distance,
        _frame=frame,
        _axis=axis,
        _scale=frame.scale if rescale else 1.0,
    )
    return replace(log_map, angles=log_map._in_range(log_map.angles))


def _swept(question: Question, control: Control) -> tuple[Floats, Floats, Ints]:
    """Return distances, the kernels' angles and numbers of bends, by node."""
    wave = DirectedSweep(question).run(control)
    mesh, sites = question.mesh, question.nodes.sites
    return wave.vertices.distance, *angles_at_sources(mesh.topology, wave.vertices, sites)
