"""Curves on a surface: paths, lines of equal distance, borders, boundaries, and what they share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core import plotting
from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument, NotEmbedded
from geodesic_core.kernels.curves.chains import Lines
from geodesic_core.kernels.curves.line_points import locate_lines
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL
from geodesic_core.kernels.mesh.locations import Locations, drop_repeats, locate_points
from geodesic_core.mesh.curve_file import CurveRecord, write_curve_file
from geodesic_core.mesh.edge_lengths import flat_points, weights_in_faces
from geodesic_core.mesh.profile import Profile, profile_of
from geodesic_core.mesh.surface_point import Curve, Point, Points, Source, SurfacePoint
from geodesic_core.plotting import PATH, PATH_WIDTH, Camera
from geodesic_core.reprs import as_table
from geodesic_core.validation import is_index, is_number

if TYPE_CHECKING:  # which makes curves of its own
    from geodesic_core.mesh.triangle_mesh import TriangleMesh

NO_FACE = -1
"""The face of a chord that leaves the surface"""


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceCurve:
    """A polyline of points on a surface, each segment straight within a face.

    Paths, straightest lines, lines of equal value, borders and boundaries are such curves. Each can
    be a source of distances, and a cut.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square
    >>> (line,) = gc.exact_distance(mesh, 0).isolines([0.5])[0]  # a quarter of a circle
    >>> line.closed, abs(line.length - 0.25 * np.pi) < 0.01
    (False, True)
    >>> np.unique(np.linalg.norm(line.points, axis=1).round(9)).tolist()
    [0.5]
    >>> round(gc.exact_distance(mesh, line).distance_at(0), 2)
    0.5
    """

    mesh: "TriangleMesh | None"
    """The surface, with the barriers of the call; None in a copy or a pickle, which leaves it
    out."""
    faces: Ints
    """(K - 1,) int32, of a closed curve (K,): the face of the segment that begins at each point; -1
    for the chords of `resample`."""
    closed: bool
    """True where the last point is joined to the first, which is not repeated."""
    length: float
    """Length on the surface, mesh units."""
    located: Locations
    """Its points as arrays: ``faces`` (K,), ``weights`` (K, 3) in them, ``vertices`` (K,), -1 for
    none, and ``points`` (K, 3) in space, mesh units."""

    @property
    def points(self) -> Floats:
        """(K, 3) positions, mesh units.

        Raises
        ------
        NotEmbedded
            The mesh is given by lengths alone: use `locations`.
        """
        if np.isnan(self.located.points[:1, 0]).any():
            raise NotEmbedded(
                "the curve has no positions in space, as its mesh has lengths alone: use locations"
            )
        return self.located.points

    @cached_property
    def locations(self) -> tuple[SurfacePoint, ...]:
        """The K points on the surface, canonical."""
        return tuple(point_of(self.located, i) for i in range(len(self.located.faces)))

    @property
    def summary(self) -> str:
        """How many points it has, and its length, in words."""
        count = len(self.located.faces)
        points = "1 point" if count == 1 else f"{count} points"
        return f"{points}, {'closed, ' if self.closed else ''}length {self.length:.6g}"

    def on_mesh(self) -> "TriangleMesh":
        """Return the surface of the curve.

        Returns
        -------
        TriangleMesh
            `mesh`.

        Raises
        ------
        InvalidArgument
            The curve is a copy or comes from a pickle, and has no mesh.

        Examples
        --------
        >>> len(gc.shortest_path(gc.samples.plane(2), 0, 3).on_mesh().faces)
        2
        """
        if self.mesh is None:
            raise InvalidArgument(
                "a copy of a curve has no mesh, nor has one from a pickle: use the one that was "
                "copied"
            )
        return self.mesh

    def reversed(self) -> "SurfaceCurve":
        """Return the same curve, run through the other way; a closed one begins at the same point.

        Returns
        -------
        SurfaceCurve
            A path is a `GeodesicPath` again; of what else a curve is, only its course is left.

        Examples
        --------
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).reversed().points.tolist()
        [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
        """
        return SurfaceCurve(
            self.mesh, self.faces[::-1].copy(), self.closed, self.length, self._turned
        )

    @property
    def _turned(self) -> Locations:
        order = np.arange(len(self.located.faces))[::-1]
        return rows_of(self.located, np.roll(order, 1) if self.closed else order)

    def resample(
        self, spacing: float, start_near: Point | ArrayLike | None = None
    ) -> "SurfaceCurve":
        """Return points evenly spaced along the curve.

        Parameters
        ----------
        spacing
            Distance between neighbours along the curve, mesh units. It is changed a little, so that
            it divides the length.
        start_near
            A point of the surface, or a position in space: a closed curve begins at its point
            nearest to it, so that the beginnings of many curves are in line. An open curve begins
            where it does.

        Returns
        -------
        SurfaceCurve
            With the same length. What joins its points are chords, which may leave the surface:
            ``faces`` are -1, and it can be neither a source nor a cut.

        Raises
        ------
        InvalidArgument
            The spacing is not a finite number above 0, the curve is a copy without its mesh, or
            ``start_near`` is neither a point nor a position.

        Notes
        -----
        O(K + length / spacing).

        Examples
        --------
        >>> path = gc.shortest_path(gc.samples.plane(200), 0, 120)
        >>> even = path.resample(0.1)
        >>> len(even.points), np.linalg.norm(np.diff(even.points, axis=0), axis=1)[:3].round(3)
        (15, array([0.101, 0.101, 0.101]))
        """
        if not is_number(spacing) or not 0.0 < spacing < np.inf:
            raise InvalidArgument(f"spacing is {spacing!r}; it must be a finite number above 0")
        mesh, start, end = self._segments()
        ways = np.hypot(*flat_points(mesh.topology, self._inner_faces, end - start).T)
        along = np.concatenate([[0.0], np.cumsum(ways)])
        begin = 0.0
        if self.closed and start_near is not None:
            begin = self._nearest_along(mesh, start, end, along, start_near)
        count = max(round(along[-1] / spacing), 3 if self.closed else 1)
        steps = begin + along[-1] * (np.arange(count if self.closed else count + 1) / count)
        if self.closed:
            steps %= along[-1]
        k = np.clip(np.searchsorted(along, steps, "right") - 1, 0, len(ways) - 1)
        share = np.where(ways[k] > 0.0, (steps - along[k]) / np.maximum(ways[k], 1e-300), 0.0)
        share = np.clip(share, 0.0, 1.0)[:, None]
        located = located_in(mesh, self._inner_faces[k], (1.0 - share) * start[k] + share * end[k])
        chords = np.full(count, NO_FACE, np.int32)
        return SurfaceCurve(mesh, chords, self.closed, self.length, located)

    def profile(self) -> Profile:
        """Return the heights along the curve: z, over the plane of x and y.

        Returns
        -------
        Profile
            Of `points`, back to the first one where the curve is closed.

        Raises
        ------
        NotEmbedded
            The mesh is given by lengths alone.

        Examples
        --------
        >>> slope = gc.TriangleMesh([[0, 0, 0], [4, 0, 3], [0, 4, 0]], [[0, 1, 2]])
        >>> profile = slope.curve([0, 1]).profile()
        >>> profile.chainage.tolist(), profile.ascent, profile.slopes.tolist()
        ([0.0, 4.0], 3.0, [0.75])
        """
        points = self.points
        return profile_of(np.concatenate([points, points[:1]]) if self.closed else points)

    def save(self, path: str | Path) -> None:
        """Write the curve into a file, in the format that its suffix names.

        Parameters
        ----------
        path
            ``.obj``, ``.ply``, ``.vtp`` or ``.dxf``: a polyline; ``.csv``: a row for each point,
            with its face and weights; ``.json`` and ``.npz``: all of this, with the length;
            ``.geojson``: a feature in the coordinates of the mesh; ``.npy``: `points` alone. A
            closed polyline goes back to its first point; in all others the point is not repeated.

        Raises
        ------
        InvalidArgument
            The suffix is none of these, or the file cannot be written.
        MissingExtra
            What writes ``.dxf`` (ezdxf) or ``.vtp`` (PyVista) is not installed; the extras ``dxf``
            and ``plot`` bring them.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "path.obj"
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).save(file)
        >>> file.read_text().splitlines()
        ['v 0.0 0.0 0.0', 'v 1.0 1.0 0.0', 'l 1 2']
        """
        located = self.located
        record = CurveRecord(
            self.points, located.faces, located.weights, self.faces, self.closed, self._properties
        )
        write_curve_file(path, record)

    def to_pyvista(self) -> Any:
        """Return the curve as a line of PyVista.

        Returns
        -------
        pyvista.PolyData
            A polyline, or a point where there is one alone; with the length in
            ``field_data["length"]``.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.

        Examples
        --------
        >>> gc.shortest_path(gc.samples.plane(2), 1, 2).to_pyvista().n_points
        3
        """
        call = f"{type(self).__name__}.to_pyvista"
        line = plotting.line_of(self.points, call, closed=self.closed)
        line.field_data["length"] = [self.length]
        return line

    def plot(
        self,
        camera: Camera | None = None,
        title: str | None = None,
        save: str | Path | None = None,
    ) -> None:
        """Draw the curve on its surface: in a window, in a notebook, or into a file.

        Parameters
        ----------
        camera
            ``"iso"``, or the axis from which one looks: ``"+z"``, ``"-x"``…; by default ``"iso"``,
            and the flat side of what is flat.
        title
            A line above the picture.
        save
            A file to draw into, without a window: ``.png``, ``.jpg``, ``.tif`` or ``.bmp``.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.
        InvalidArgument
            The suffix is not that of a picture, the file cannot be written, or there is no such
            camera.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "path.png"
        >>> gc.shortest_path(gc.samples.sphere(80), 0, 9).plot(save=file)
        >>> file.exists()
        True
        """
        with plotting.picture(save, camera, title, f"{type(self).__name__}.plot") as plotter:
            if self.mesh is not None:
                plotting.draw_surface(plotter, self.mesh.to_pyvista())
            plotting.draw_lines(plotter, [self.to_pyvista()], PATH, PATH_WIDTH)
            if not self.closed:
                plotting.draw_points(plotter, self.points[[0, -1]])

    def __getstate__(self) -> dict[str, Any]:
        """Leave the mesh behind: it takes ten thousand times the memory of a curve."""
        return self.__dict__ | {"mesh": None}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.summary})"

    def _repr_html_(self) -> str:
        return as_table(type(self).__name__, self._shown)

    @property
    def _shown(self) -> dict[str, Any]:
        """What a notebook shows."""
        return {"points": len(self.located.faces), "closed": self.closed, "length": self.length}

    @property
    def _properties(self) -> dict[str, Any]:
        """What files hold besides points, as JSON has it."""
        return {"length": self.length, "closed": self.closed}

    @property
    def _inner_faces(self) -> Longs:
        mesh = self.on_mesh()
        if len(self.faces) and self.faces.min() < 0:
            raise InvalidArgument("the curve was resampled: resample the one that it came from")
        return mesh.inner_face[self.faces].astype(np.int64)

    def _segments(self) -> tuple["TriangleMesh", Floats, Floats]:
        """Return the mesh, and the weights of both ends of each segment in its inner face."""
        mesh, located = self.on_mesh(), self.located
        start, end = segment_weights(mesh, located, self._inner_faces, self.closed)
        return mesh, start, end

    def _nearest_along(
        self, mesh: "TriangleMesh", start: Floats, end: Floats, along: Floats, near: Any
    ) -> float:
        """Return how far along the curve its point nearest to a point, or a position, is."""
        position = position_of(mesh, near) - mesh.origin
        half_edges = 3 * self._inner_faces[:, None] + np.arange(3)
        corners = mesh.positions[mesh.topology.links[half_edges, TAIL]]
        first = (start[:, :, None] * corners).sum(axis=1)
        step = (end[:, :, None] * corners).sum(axis=1) - first
        square = np.maximum((step * step).sum(axis=1), 1e-300)
        share = np.clip(((position - first) * step).sum(axis=1) / square, 0.0, 1.0)
        away = np.linalg.norm(first + share[:, None] * step - position, axis=1)
        k = int(away.argmin())
        return float(along[k] + share[k] * (along[k + 1] - along[k]))


Sources = Points | Curve | SurfaceCurve | Source | Sequence[Point | Curve | SurfaceCurve | Source]
"""Every way to write the sources of a field"""


def as_written(curve: Curve | SurfaceCurve) -> Curve:
    """Return the points of a curve as a caller may write them; a closed one ends as it begins."""
    if isinstance(curve, Curve):
        return curve
    return Curve(curve.locations + curve.locations[:1] if curve.closed else curve.locations)


def curves_of(mesh: "TriangleMesh", lines: Lines) -> list[SurfaceCurve]:
    """Return the lines that kernels have linked as curves."""
    located, inner_faces, first = locate_lines(mesh.embedding, mesh.faces, lines)
    located = in_space(mesh, located)
    faces = mesh.topology.outer_face[inner_faces]
    curves = []
    for (lo, hi), closed in zip(pairwise(first.tolist()), lines.closed.tolist(), strict=True):
        if hi > lo:
            part = rows_of(located, slice(lo, hi))
            between = faces[lo : hi if closed else hi - 1]
            length = length_on(mesh, part, between, bool(closed))
            curve = SurfaceCurve(mesh, between, bool(closed), length, part)
            curves.append(curve if runs_as_wound(mesh, int(inner_faces[lo])) else curve.reversed())
    return curves


def curve_through(
    mesh: "TriangleMesh", faces: Longs, weights: Floats, between: Longs, *, closed: bool
) -> SurfaceCurve:
    """Return the curve through points of inner faces; a closed one ends where it begins.

    ``between`` holds the inner faces of its segments. Points that repeat are left out.
    """
    located = located_in(mesh, faces, weights)
    outer = np.empty(len(between), np.int32)
    crossed = between[::-1].astype(np.int32)
    count = drop_repeats(mesh.topology.outer_face, crossed, located, outer)
    located = rows_of(located, slice(0, count - 1 if closed and count > 1 else count))
    outer = outer[: count - 1]
    length = length_on(mesh, located, outer, closed)
    return SurfaceCurve(mesh, outer, closed, length, located)


def runs_as_wound(mesh: "TriangleMesh", inner_face: int) -> bool:
    """Tell whether an inner face runs as the caller wound it: it may have been turned over."""
    topology = mesh.topology
    corners = topology.inner_vertex[mesh.faces[topology.outer_face[inner_face]]].tolist()
    h = 3 * inner_face
    following = corners[(corners.index(topology.links[h, TAIL]) + 1) % 3]
    return bool(following == topology.links[h, HEAD])


def located_in(mesh: "TriangleMesh", inner_faces: Longs, weights: Floats) -> Locations:
    """Return the points of inner faces that have these weights, in space."""
    return in_space(mesh, locate_points(mesh.embedding, mesh.faces, inner_faces, weights))


def in_space(mesh: "TriangleMesh", located: Locations) -> Locations:
    """Return locations whose points are measured from the mesh's origin in the caller's space."""
    return located._replace(points=located.points + mesh.origin)


def rows_of(located: Locations, rows: Any) -> Locations:
    """Return some rows of locations."""
    return Locations(*(array[rows] for array in located))


def fill(located: Locations, rows: Any, points: Locations) -> None:
    """Write points to some rows of locations."""
    columns: tuple[Any, ...] = located
    for column, part in zip(columns, points, strict=True):
        column[rows] = part


def point_of(located: Locations, i: int) -> SurfacePoint:
    """Return a point of some locations."""
    u, v, w = located.weights[i].tolist()
    vertex = int(located.vertices[i])
    return SurfacePoint(int(located.faces[i]), (u, v, w), vertex if vertex >= 0 else None)


def locations_of(mesh: "TriangleMesh", points: Sequence[SurfacePoint]) -> Locations:
    """Return canonical points as locations, measured from the mesh's origin."""
    faces = np.array([point.face_index for point in points], np.int32)
    weights = np.array([point.barycentric for point in points], np.float64).reshape(-1, 3)
    vertices = np.array(
        [-1 if point.vertex_index is None else point.vertex_index for point in points],
        np.int64,
    )
    # Not a matrix product, whose last bit depends on where its arrays lie in memory.
    places = (weights[:, :, None] * (mesh.vertices[mesh.faces[faces]] - mesh.origin)).sum(axis=1)
    is_vertex = vertices >= 0
    places[is_vertex] = mesh.vertices[vertices[is_vertex]] - mesh.origin
    return Locations(faces, weights, vertices, places)


def draw_over(
    mesh: "TriangleMesh", plotter: Any, paths: Iterable[SurfaceCurve], points: Iterable[Point]
) -> None:
    """Draw curves and points over a surface."""
    lines = [curve.to_pyvista() for curve in paths]
    plotting.draw_lines(plotter, lines, PATH, PATH_WIDTH)
    plotting.draw_points(plotter, np.array([mesh.position(point) for point in points]))


def length_of(points: Floats) -> float:
    """Return the length of a polyline, mesh units."""
    steps = points[1:] - points[:-1]
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())


def length_on(mesh: "TriangleMesh", located: Locations, faces: Ints, closed: bool = False) -> float:
    """Return the length of a polyline on the surface, mesh units; its segments lie in ``faces``."""
    if mesh.lengths is None:
        points = located.points
        return length_of(np.vstack([points, points[:1]]) if closed else points)
    inner = mesh.inner_face[faces].astype(np.int64)
    start, end = segment_weights(mesh, located, inner, closed)
    return float(np.hypot(*flat_points(mesh.topology, inner, end - start).T).sum())


def segment_weights(
    mesh: "TriangleMesh", located: Locations, inner_faces: Longs, closed: bool
) -> tuple[Floats, Floats]:
    """Return the weights of both ends of the segments of a polyline, each in its inner face."""
    rows = np.arange(len(located.faces))
    ends = np.roll(rows, -1) if closed else rows[1:]
    start, end = (
        weights_in_faces(
            mesh.topology, mesh.faces, located.faces[part], located.weights[part], inner_faces
        )
        for part in (rows if closed else rows[:-1], ends)
    )
    return start, end


def position_of(mesh: "TriangleMesh", place: Any) -> Floats:
    """Return the position of a point of the surface, or a position itself, mesh units.

    Raises
    ------
    InvalidArgument, InvalidPoint
        It is neither, or the mesh has no positions.
    """
    if isinstance(place, SurfacePoint) or is_index(place):
        return mesh.position(place)
    try:
        position = np.asarray(place, np.float64)
    except (TypeError, ValueError):
        position = np.array(np.nan)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise InvalidArgument(
            f"start_near is {place!r}; it must be a point, or a position [x, y, z]"
        )
    return position
