"""Paths over the surface, and how they are made from backtraced crossings."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from geodesic_core import plotting
from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InternalError, InvalidArgument, NotEmbedded
from geodesic_core.fields.path_file import PathRecord, write_path_file
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths import backtracing, locations
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.paths.locations import Locations
from geodesic_core.mesh.curve import foot_on
from geodesic_core.mesh.edge_lengths import flat_points, weights_in_faces
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.transport import carried_along
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.reprs import as_table
from geodesic_core.tolerances import PATH_LENGTH, ROUNDED_POSITION
from geodesic_core.validation import as_angle


@dataclass(frozen=True, slots=True)
class ErrorBound:
    """Bound of the difference between an answer and the exact one.

    ``value`` is a share of the exact answer where ``type`` is ``"relative"``, else mesh units.
    ``kind`` tells whether the bound is proved or estimated. For approximate distances it is proved
    that they are too short by no more than the bound. That they are never too long is argued and
    measured, but not proved.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0).error_bound
    ErrorBound(type='relative', value=0.0, kind='guaranteed')
    """

    type: Literal["relative", "absolute"]
    value: float
    kind: Literal["guaranteed", "estimated"]

    def __str__(self) -> str:
        if self.value == 0.0 and self.kind == "guaranteed":
            return "exact"
        return f"{self.kind} {self.type} error {self.value:g}"


EXACT = ErrorBound("relative", 0.0, "guaranteed")
"""The bound of exact answers: floating-point rounding aside, there is no error."""


StepName = Literal["dijkstra", "shorten", "approximate", "backtrace", "exact", "path"]


@dataclass(frozen=True, slots=True, eq=False)
class SearchStep:
    """Step of the search between two points (section 5, figure 10).

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> [step.name for step in gc.shortest_path(mesh, 0, 3, explain=True).steps]
    ['dijkstra', 'shorten', 'approximate', 'backtrace', 'exact', 'path']
    """

    leg: int
    """Number of the leg, from one stop to the next, counted from 0."""
    name: StepName
    seconds: float
    bound: float
    """The least upper bound of the distance that is known after the step, mesh units; after
    "exact", the distance."""
    windows: int
    """Windows created."""
    faces: Ints
    """(N,) int32: the region that was visited."""


@dataclass(frozen=True, eq=False)
class GeodesicPath:
    """A path over the surface, from its source to its target.

    An exact field gives shortest paths. An approximate one gives paths whose length U is an upper
    bound of the exact distance, as the field's value D is a lower bound: ``error_bound`` holds
    (U - D) / D.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> path = gc.shortest_path(mesh, 1, 2)
    >>> path.points.tolist()
    [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0]]
    >>> path.faces.tolist()
    [0, 1]
    >>> str(path.locations[1])
    'the point (0.5, 0.0, 0.5) of face 0'
    """

    mesh: TriangleMesh | None
    """The surface, with the barriers of the call; None in a copy or a pickle, which leaves it
    out."""
    _points: Floats
    faces: Ints
    """(K - 1,) int32: the face between each point and the next."""
    length: float
    """Sum of the distances between neighbouring points before those were rounded, mesh units."""
    error_bound: ErrorBound
    steps: tuple[SearchStep, ...] | None
    """Steps of the search between two points, leg by leg; None without ``explain``."""
    _location_faces: Ints
    _location_weights: Floats
    _location_vertices: Longs

    @property
    def points(self) -> Floats:
        """(K, 3) positions, mesh units.

        Raises
        ------
        NotEmbedded
            The mesh is given by lengths alone: use `locations`.
        """
        if np.isnan(self._points[0, 0]):
            raise NotEmbedded(
                "the path has no positions in space, as its mesh has lengths alone: use locations"
            )
        return self._points

    @cached_property
    def locations(self) -> tuple[SurfacePoint, ...]:
        """The K points on the surface, canonical."""
        return tuple(
            SurfacePoint(face, (u, v, w), vertex if vertex >= 0 else None)
            for face, (u, v, w), vertex in zip(
                self._location_faces.tolist(),
                self._location_weights.tolist(),
                self._location_vertices.tolist(),
                strict=True,
            )
        )

    def transport(self, angle: float) -> float:
        """Return a vector at the first point, carried along the path to the last one.

        As `DistanceField.transport` does; along any path of a mesh.

        Parameters
        ----------
        angle
            Radians, in the frame of the first point as in `log_map`.

        Returns
        -------
        float
            Radians, in the frame of the last point.

        Raises
        ------
        InvalidPoint
            One of its ends, or a vertex that it passes through, has no tangent plane.
        InvalidArgument
            The angle is not a finite number. Or the path is a copy or comes from a pickle, and has
            no mesh.

        Notes
        -----
        O(K).

        Examples
        --------
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).transport(np.pi / 4) == 5 * np.pi / 4
        True
        """
        if self.mesh is None:
            raise InvalidArgument("a copy of a path has no mesh: use the path that was copied")
        return carried_along(self.mesh, self.locations, self.faces, as_angle(angle))

    def save(self, path: str | Path) -> None:
        """Write the path into a file, in the format that its suffix names.

        Parameters
        ----------
        path
            ``.obj`` or ``.ply``: a polyline; ``.csv``: a row for each point, with its face and
            weights; ``.json``: all of this, with length and error bound; ``.geojson``: a feature in
            the coordinates of the mesh; ``.npy``: `points` alone.

        Raises
        ------
        InvalidArgument
            The suffix is none of these, or the file cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "path.obj"
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).save(file)
        >>> file.read_text().splitlines()
        ['v 0.0 0.0 0.0', 'v 1.0 1.0 0.0', 'l 1 2']
        """
        properties = {"length": self.length, "error_bound": asdict(self.error_bound)}
        locations = self._location_faces, self._location_weights
        write_path_file(path, PathRecord(self.points, *locations, self.faces, properties))

    def to_pyvista(self) -> Any:
        """Return the path as a line of PyVista.

        Returns
        -------
        pyvista.PolyData
            A polyline, or a point where source and target are one; with the length in
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
        line = plotting.line_of(self.points, "GeodesicPath.to_pyvista")
        line.field_data["length"] = [self.length]
        return line

    def plot(self, screenshot: str | Path | None = None) -> None:
        """Draw the path on its surface: in a window, in a notebook, or into a file.

        Parameters
        ----------
        screenshot
            A file to draw into, without a window: ``.png``, ``.jpg``, ``.tif`` or ``.bmp``.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.
        InvalidArgument
            The suffix is not that of a picture, or the file cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "path.png"
        >>> gc.shortest_path(gc.samples.sphere(80), 0, 9).plot(screenshot=file)
        >>> file.exists()
        True
        """
        with plotting.picture(screenshot, "GeodesicPath.plot") as plotter:
            if self.mesh is not None:
                plotting.draw_surface(plotter, self.mesh.to_pyvista())
            plotting.draw_line(plotter, self.to_pyvista())
            plotting.draw_points(plotter, self.points[[0, -1]])

    def __getstate__(self) -> dict[str, Any]:
        """Leave the mesh behind: it takes ten thousand times the memory of a path."""
        return self.__dict__ | {"mesh": None}

    def __repr__(self) -> str:
        points = "1 point" if len(self._points) == 1 else f"{len(self._points)} points"
        return f"GeodesicPath({points}, length {self.length:.6g}, {self.error_bound})"

    def _repr_html_(self) -> str:
        ends = {"from": self.locations[0], "to": self.locations[-1], "length": self.length}
        return as_table(
            "GeodesicPath", ends | {"points": len(self._points), "accuracy": self.error_bound}
        )


def trace(mesh: TriangleMesh, winners: Winners, v: int) -> tuple[Ints, Floats, Ints]:
    """Trace the path from node v to its source: nodes, parameters and inner faces."""
    room = 256
    while True:
        nodes, parameters = np.empty(room, np.int32), np.empty(room)
        faces = np.empty(room, np.int32)
        outcome, count = backtracing.trace_path(mesh.topology, winners, v, nodes, parameters, faces)
        if outcome == Outcome.FINISHED:
            return nodes[:count], parameters[:count], faces[: count - 1]
        # A shortest path crosses a face at most once, and an approximate one hardly more often:
        # a longer walk is lost as well.
        if outcome == Outcome.LOST or room > 4 * len(mesh.faces) + 256:
            raise InternalError(
                f"the path to node {v} left the surface after {count} points; "
                f"please report this mesh"
            )
        room *= 4


def traced_path(
    mesh: TriangleMesh, winners: Winners, nodes_of_sweep: Nodes, v: int, bound: ErrorBound
) -> GeodesicPath:
    """Return the path from its source to node v; O(faces crossed)."""
    located, faces = located_path(mesh, winners, nodes_of_sweep, v)
    return GeodesicPath(
        mesh=mesh,
        _points=located.points + mesh.origin,
        faces=faces,
        length=length_on(mesh, located, faces),
        error_bound=bound,
        steps=None,
        _location_faces=located.faces,
        _location_weights=located.weights,
        _location_vertices=located.vertices,
    )


def located_path(
    mesh: TriangleMesh, winners: Winners, nodes_of_sweep: Nodes, v: int
) -> tuple[Locations, Ints]:
    """Return the points of the path from its source to node v, and the faces between them."""
    nodes, parameters, crossed = trace(mesh, winners, v)
    count = len(nodes)
    faces, vertices = np.empty(count, np.int32), np.empty(count, np.int64)
    weights, points = np.empty((count, 3)), np.empty((count, 3))
    nodes, parameters = nodes[::-1].copy(), parameters[::-1].copy()
    located = Locations(faces, weights, vertices, points)
    locations.locate_nodes(mesh.embedding, mesh.faces, nodes, parameters, located)
    for i in (count - 1, 0):
        node = -1 - int(nodes[i])
        if node < len(mesh.vertices):
            continue
        segment = nodes_of_sweep.segment(node)
        if segment is None:
            point = nodes_of_sweep.site(node)
        else:
            after = point_of(located, 1)
            point = foot_on(mesh, segment, int(crossed[-1]), after)
        points[i] = mesh.position_from_origin(point)
        faces[i], weights[i] = point.face_index, point.barycentric
        vertices[i] = -1 if point.vertex_index is None else point.vertex_index
    between = np.empty(count - 1, np.int32)
    count = locations.drop_repeats(mesh.topology.outer_face, crossed, located, between)
    located = Locations(faces[:count], weights[:count], vertices[:count], points[:count])
    return located, between[: count - 1]


def point_of(located: Locations, i: int) -> SurfacePoint:
    """Return a point of some locations."""
    u, v, w = located.weights[i].tolist()
    vertex = int(located.vertices[i])
    return SurfacePoint(int(located.faces[i]), (u, v, w), vertex if vertex >= 0 else None)


def rounding_of(mesh: TriangleMesh, distance: float) -> float:
    """Return how much the length of a path may differ from a distance by rounding, mesh units."""
    return PATH_LENGTH * distance + ROUNDED_POSITION * mesh.extent


def length_of(points: Floats) -> float:
    """Return the length of a polyline, mesh units."""
    steps = points[1:] - points[:-1]
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())


def length_on(mesh: TriangleMesh, located: Locations, faces: Ints) -> float:
    """Return the length of a polyline on the surface, mesh units; its segments lie in ``faces``."""
    if mesh.lengths is None:
        return length_of(located.points)
    inner = mesh.inner_face[faces].astype(np.int64)
    start, end = (
        weights_in_faces(
            mesh.topology, mesh.faces, located.faces[part], located.weights[part], inner
        )
        for part in (slice(None, -1), slice(1, None))
    )
    steps = flat_points(mesh.topology, inner, end - start)  # their differences, as it is linear
    return float(np.hypot(*steps.T).sum())


def reversed_path(path: GeodesicPath) -> GeodesicPath:
    """Return the path from its target to its source."""
    return replace(
        path,
        _points=path._points[::-1].copy(),
        faces=path.faces[::-1].copy(),
        _location_faces=path._location_faces[::-1].copy(),
        _location_weights=path._location_weights[::-1].copy(),
        _location_vertices=path._location_vertices[::-1].copy(),
    )


def joined(legs: Sequence[GeodesicPath]) -> GeodesicPath:
    """Return exact paths, each from the end of the one before, as one path."""

    def chained(name: str) -> Any:  # the first point of a leg is the last of the one before
        arrays = [getattr(leg, name) for leg in legs]
        return np.concatenate([arrays[0], *(array[1:] for array in arrays[1:])])

    steps = [replace(step, leg=i) for i, leg in enumerate(legs) for step in (leg.steps or ())]
    return GeodesicPath(
        mesh=legs[0].mesh,
        _points=chained("_points"),
        faces=np.concatenate([leg.faces for leg in legs]),
        length=sum(leg.length for leg in legs),
        error_bound=EXACT,
        steps=tuple(steps) or None,
        _location_faces=chained("_location_faces"),
        _location_weights=chained("_location_weights"),
        _location_vertices=chained("_location_vertices"),
    )
