"""Distance fields: the results of the solvers."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InternalError, InvalidArgument, NoPath
from geodesic_core.facts import as_table
from geodesic_core.fields import picture
from geodesic_core.fields.borders import Border, borders_of, swept_borders
from geodesic_core.fields.fast_sweep import FastSweep
from geodesic_core.fields.field_file import SHOWN, write_field_file
from geodesic_core.fields.gradient import gradient_at_vertices
from geodesic_core.fields.isolines import (
    Drawing,
    Isoline,
    as_levels,
    crossed_faces,
    resolve_chord_error,
    spaced_levels,
)
from geodesic_core.fields.path import EXACT, ErrorBound, GeodesicPath, rounding_of, traced_path
from geodesic_core.fields.point_query import (
    Arrival,
    NearestSource,
    arrival_at,
    find_nearest_source,
    with_target,
)
from geodesic_core.fields.repeatable_sweep import Lazy, RepeatableSweep, SweepResult, SweepStats
from geodesic_core.fields.sources import Nodes, component_of, disconnected
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows
from geodesic_core.kernels.sweep.bounds import exact_bounds, merging_bounds, with_parallel_windows
from geodesic_core.mesh.curve import (
    Polyline,
    polylines_from_arrays,
    polylines_to_arrays,
)
from geodesic_core.mesh.surface_point import Curve, Point, Source, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import CUT_OFF


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Geodesic distances from the sources to all vertices, and queries on them.

    The solvers return it. Paths, points inside faces, gradients and isolines come from retained
    data, or from a second sweep if those data were not retained.

    ``numpy.asarray(field)`` is `distances`, and ``field[5]`` is the distance of vertex 5.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> field = gc.exact_distance(mesh, 0)

    >>> field.distances.round(3).tolist()  # or numpy.asarray(field)
    [0.0, 1.0, 1.0, 1.414]
    >>> float(field[2])  # of vertex 2
    1.0
    >>> field.path_to(3).points.tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    """

    mesh: TriangleMesh
    """The surface, with the barriers of the call"""
    sources: tuple[Source, ...]
    max_distance: float
    """Limit of the sweep, mesh units; infinite where none was given."""
    distances: Floats
    """(V,) float64, mesh units; infinite where unreachable or beyond ``max_distance``."""
    nearest_source: Ints
    """(V,) int32 index into ``sources``; -1 where unreachable; ties to the lowest."""
    error_bound: ErrorBound
    stats: SweepStats
    _polylines: tuple[Polyline, ...]
    """Canonical points of each source"""
    _targets: tuple[SurfacePoint, ...]
    """Targets of the sweep, canonical"""
    _sweep: RepeatableSweep
    """The sweep; of a fast field, the exact one of the same question"""
    _fast: FastSweep | None
    """The sweep of a fast field"""
    _result: SweepResult

    @classmethod
    def from_arrays(cls, mesh: TriangleMesh, arrays: Mapping[str, NDArray[Any]]) -> "DistanceField":
        """Return the field on ``mesh`` whose `arrays` these are.

        Its answers are the same to the bit; its sources are spelled canonically. Contents
        are trusted: they must be those of a field on this mesh.

        Parameters
        ----------
        mesh
            The surface that the field was found on.
        arrays
            The arrays of `arrays`, by name; they may be memory-mapped.

        Returns
        -------
        DistanceField
            The same field.

        Raises
        ------
        InvalidArgument
            A name is that of none of the field's arrays.
        KeyError
            One of the field's arrays is missing.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> again = gc.DistanceField.from_arrays(mesh, field.arrays())
        >>> again.path_to(3).length == field.path_to(3).length
        True
        """
        polylines = polylines_from_arrays("source", arrays)
        targets = tuple(point for (point,) in polylines_from_arrays("target", arrays))
        starts = arrays["start_distances"]
        sources = tuple(
            Source(line[0] if len(line) == 1 else Curve(line), start)
            for line, start in zip(polylines, starts.tolist(), strict=True)
        )
        limit, *errors = arrays["limits"].tolist()
        bounds = merging_bounds(limit, *errors) if errors else exact_bounds(limit)
        of_type, kind = arrays["promise"].tolist()
        created, kept, peak, peak_bytes = arrays["counts"].tolist()
        seconds = float(arrays["seconds"])
        sweep = RepeatableSweep.between(mesh, polylines, starts, targets, bounds, Control())
        field = field_of(
            sources,
            polylines,
            targets,
            sweep,
            FastSweep(sweep, int(arrays["effort"])) if "effort" in arrays else None,
            ErrorBound(of_type, float(arrays["promised"]), kind),
            SweepResult.from_arrays(arrays),
            SweepStats.of(mesh, created, kept, peak, peak_bytes, seconds),
        )
        if foreign := arrays.keys() - field.arrays().keys():
            raise InvalidArgument(
                f"arrays has {min(foreign)!r}, which is none of this field's arrays: give what "
                "DistanceField.arrays has returned, and nothing else"
            )
        return field

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the question and the result as arrays, for a store.

        Returns
        -------
        dict of str to numpy.ndarray
            Everything except the mesh and the results of later calls.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> field.arrays()["distance"].round(3).tolist()  # in the order of the topology
        [0.0, 1.0, 1.0, 1.414]
        """
        bounds, stats, promise = self._sweep.bounds, self.stats, self.error_bound
        errors = [bounds.relative_error, bounds.absolute_error] if bounds.merging else []
        counts = stats.windows_created, stats.windows_kept, stats.windows_peak, stats.peak_bytes
        return {
            **polylines_to_arrays("source", self._polylines),
            **polylines_to_arrays("target", [(target,) for target in self._targets]),
            "start_distances": self._sweep.start_distances,
            "limits": np.array([bounds.max_distance, *errors]),
            "promise": np.array([promise.type, promise.kind]),
            "promised": np.array(promise.value),
            **({} if self._fast is None else {"effort": np.array(self._fast.effort)}),
            **self._result.arrays(),
            "counts": np.array(counts, np.int64),
            "seconds": np.array(stats.seconds),
        }

    def save(self, path: str | Path) -> None:
        """Write the field into a file, for `load_field`.

        The file is an archive of numpy arrays. ``numpy.load(path)`` reads ``distances`` and
        ``nearest_source`` without this library; the rest is for `load_field` in the same version of
        the library, and binds the file to its mesh, which is not in it.

        Parameters
        ----------
        path
            The file, which ends in ``.npz``.

        Raises
        ------
        InvalidArgument
            The path does not end in ``.npz``, or the file cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "field.npz"
        >>> gc.exact_distance(gc.samples.plane(2), 0).save(file)
        >>> np.load(file)["distances"].round(3).tolist()
        [0.0, 1.0, 1.0, 1.414]
        """
        shown = {name: getattr(self, name) for name in SHOWN}
        write_field_file(path, self.mesh, shown, self.arrays())

    def to_pyvista(self) -> Any:
        """Return the mesh as one of PyVista, with the distances at its points.

        Returns
        -------
        pyvista.PolyData
            With ``distance``, float64 in mesh units, infinite where unreachable, and
            ``nearest_source`` at its points.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.

        Examples
        --------
        >>> surface = gc.exact_distance(gc.samples.plane(2), 0).to_pyvista()
        >>> surface.point_data["distance"].round(3).tolist()
        [0.0, 1.0, 1.0, 1.414]
        """
        surface = self.mesh.to_pyvista()
        surface.point_data["nearest_source"] = self.nearest_source
        surface.point_data["distance"] = self.distances
        surface.set_active_scalars("distance")
        return surface

    def plot(self, screenshot: str | Path | None = None) -> None:
        """Draw the surface, coloured by distance: in a window, in a notebook, or into a file.

        Sources are marked. Unreachable parts are grey.

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
        >>> file = Path(mkdtemp()) / "field.png"
        >>> gc.exact_distance(gc.samples.sphere(80), 0).plot(screenshot=file)
        >>> file.exists()
        True
        """
        with picture.picture(screenshot, "DistanceField.plot") as plotter:
            surface = self.to_pyvista()
            reached = np.where(np.isfinite(self.distances), self.distances, np.nan)
            surface.point_data["distance"] = reached
            plotter.add_mesh(surface, scalars="distance", cmap="viridis", nan_color=picture.SURFACE)
            plotter.add_points(
                np.array([self.mesh.position(p) for line in self._polylines for p in line]),
                color=picture.LINE,
                point_size=picture.POINT_SIZE,
                render_points_as_spheres=True,
            )

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """Return `distances`, as numpy asks for them: ``numpy.asarray(field)``."""
        return np.array(self.distances, dtype=dtype, copy=copy)

    def __getitem__(self, vertices: Any) -> Any:
        """Return the distance of a vertex, or those of some, indexed as `distances` are."""
        return self.distances[vertices]

    def __len__(self) -> int:
        return len(self.distances)

    def __repr__(self) -> str:
        facts = (f"{fact} {name}" for name, fact in self._counts().items())
        return f"DistanceField({', '.join(facts)}, {self.error_bound})"

    def _repr_html_(self) -> str:
        return as_table("DistanceField", self._counts() | {"accuracy": self.error_bound})

    def _counts(self) -> dict[str, object]:
        """Return facts by name, as both reprs tell them."""
        finite = np.isfinite(self.distances)
        unreached = len(finite) - int(np.count_nonzero(finite))
        farthest = f"{self.distances[finite].max(initial=0.0):.6g}"
        return {
            "vertices" if len(finite) != 1 else "vertex": len(finite),
            "source" if len(self.sources) == 1 else "sources": len(self.sources),
            **({"unreached": unreached} if unreached else {}),
            "farthest": farthest,
        }

    @property
    def nbytes(self) -> int:
        """Memory held, bytes, without the mesh; it grows by what later calls find."""
        result, later = self._result, self._winners_and_windows
        arrays: list[Any] = [result.distance, self.distances, self.nearest_source]
        arrays += self._winners.value or ()
        for windows in (result.windows, later.value[1] if later and later.value else None):
            arrays += windows or ()
        return sum(array.nbytes for array in arrays)

    @cached_property
    def _node_of(self) -> Mapping[SurfacePoint, int]:
        """Nodes of the targets."""
        return dict(zip(self._targets, self._sweep.nodes.targets.tolist(), strict=True))

    @cached_property
    def _winners(self) -> Lazy[Winners]:
        """Data of paths to vertices and targets, swept for again if not retained."""
        return Lazy((self._fast or self._sweep).find_winners, self._result.winners)

    @property
    def _exact_sweep(self) -> RepeatableSweep:
        """The sweep of the same question that merges nothing."""
        bounds = self._sweep.bounds
        if not bounds.merging:
            return self._sweep
        exact = exact_bounds(bounds.max_distance)
        if bounds.parallel:
            exact = with_parallel_windows(exact, bounds.first_segment)
        return replace(self._sweep, bounds=exact)

    @cached_property
    def _winners_and_windows(self) -> Lazy[tuple[Winners, FaceWindows]] | None:
        """Data by which any point is found exactly; None where a search back from it finds it."""
        sweep, bounds, result = self._sweep, self._sweep.bounds, self._result
        if result.winners is not None and result.windows is not None and not bounds.merging:
            return Lazy(sweep.find_winners_and_windows, (result.winners, result.windows))
        if bounds.parallel:  # a sweep back from a point ends at points, not on curves
            return Lazy(self._exact_sweep.find_winners_and_windows)
        if self._fast is not None:  # its distances are no lower bounds, which a search back needs
            return Lazy(sweep.find_winners_and_windows)
        return None

    def distance_at(
        self,
        point: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> float:
        """Return the distance of any point of the surface.

        At a vertex or a target of the sweep it is the sweep's value, O(1). Elsewhere it is exact,
        also for an approximate field. An exact field that retains its windows finds it there,
        O(windows of the face). Any other field runs an exact sweep from the point to the nearest
        source, in a thin strip that the field's own values bound. If a source is a curve or the
        field is a fast one, the first such point runs the whole sweep again, exactly, and retains
        its windows.

        Parameters
        ----------
        point
            A vertex index or a `SurfacePoint`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        float
            Mesh units; infinite where unreachable or beyond ``max_distance``.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> round(field.distance_at(gc.SurfacePoint.face(0, (0.5, 0.25, 0.25))), 6)
        0.559017
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        location = self.mesh.point(point)
        node = self._node(location)
        if node is not None:
            return float(self._result.distance[node])
        if self._winners_and_windows is None:
            return self._nearest_to(location, control).distance
        return self._arrival_at(location, *self._winners_and_windows.get(control)).distance

    def nearest_source_at(
        self,
        point: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> int:
        """Return the source nearest to any point of the surface.

        It is found as `distance_at` finds the distance.

        Parameters
        ----------
        point
            A vertex index or a `SurfacePoint`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        int
            Index into ``sources``; -1 where the point is unreachable. Ties go to the lowest.

        Raises
        ------
        InvalidPoint
            It is not a point of the mesh.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, [0, 3])
        >>> field.nearest_source_at(gc.SurfacePoint.edge(0, 1, 0.75))  # near 3
        1
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        location = self.mesh.point(point)
        node = self._node(location)
        if node is not None:
            return int(self._result.nearest[node])
        if self._winners_and_windows is None:
            return self._nearest_to(location, control).source
        return self._arrival_at(location, *self._winners_and_windows.get(control)).source

    def path_to(
        self,
        target: Point,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> GeodesicPath:
        """Return a path from the nearest source to any point of the surface (sections 3.5 and 4.3).

        In an exact field, the length of the path is the point's distance less the start distance of
        its source. In an approximate field it may be longer by the error bound; in a fast field it
        is not longer. A path to a vertex or a target of the sweep takes O(faces crossed). A field
        that does not retain paths runs the sweep again for the first of these. Paths to other
        points are found as `distance_at` finds their distances.

        Parameters
        ----------
        target
            A vertex index or a `SurfacePoint`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        GeodesicPath
            From the source to the target.

        Raises
        ------
        InvalidPoint
            The target is not a point of the mesh.
        NoPath
            It is not connected to a source, or lies beyond ``max_distance``.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> field.path_to(2).points.tolist()
        [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        location = self.mesh.point(target, "target")
        node = self._node(location)
        if node is not None:
            if math.isinf(self._result.distance[node]):
                raise self._no_path(location)
            return self._traced(location, self._winners.get(control), self._sweep.nodes, node)
        if self._winners_and_windows is None:
            path = self._nearest_to(location, control).path
            if path is None:
                raise self._no_path(location)
            return path()
        winners, windows = self._winners_and_windows.get(control)
        arrival = self._arrival_at(location, winners, windows)
        if arrival.source < 0:
            raise self._no_path(location)
        return self._traced(
            location, *with_target(self.mesh, winners, self._sweep.nodes, location, arrival)
        )

    @cached_property
    def gradient(self) -> Floats:
        """Unit vectors (V, 3), float64: where distance grows fastest, tangent to the surface.

        At each vertex, the direction opposite to the first segment of the shortest path to its
        nearest source. If several paths are equally short, it is that of one of them. NaN where
        a vertex lies at a source, and where `distances` is infinite. O(V). A field that does not
        retain paths first runs the sweep again, without control, unless `path_to` has found a path
        before.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> field.gradient.round(3).tolist()[1:]
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.707, 0.707, 0.0]]
        """
        return gradient_at_vertices(self.mesh, self._winners.get(Control()), self._sweep.nodes)

    def levels(self, count: int) -> Floats:
        """Return levels for `isolines`, evenly spaced between 0 and the largest finite distance.

        Parameters
        ----------
        count
            Number of levels, 1 or more.

        Returns
        -------
        numpy.ndarray
            (count,) float64, mesh units, ascending; 0 and the largest distance are left out.

        Raises
        ------
        InvalidArgument
            The count is not an integer of 1 or more, or no vertex but the sources is reached.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> field.levels(3).round(3).tolist()
        [0.354, 0.707, 1.061]
        """
        return spaced_levels(self.distances, count)

    def isolines(
        self,
        levels: Sequence[float],
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> list[list[Isoline]]:
        """Return for each level, in their order, the lines of points at that distance.

        They bound the part of the surface within that distance: closed, or open where they end at
        the boundary or at an edge of more than two faces. In each face they consist of circular
        arcs, and of straight lines beside curves; their ends and crossings of edges are exact, and
        between them arcs become chords. A vertex at the level itself counts as within. Levels
        beyond all distances, or beyond ``max_distance``, have no lines. In an approximate field the
        lines follow its own distances, and the same error bound holds. In a fast field the lines
        are exact: they come from an exact sweep, whose windows it retains.

        Parameters
        ----------
        levels
            Distances above 0, mesh units; `levels` spaces some evenly.
        chord_error
            Largest distance of a chord from its arc, mesh units; by default a thousandth of the
            mean edge length, at least a billionth of the bounding box's diagonal.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        list of list of Isoline
            The lines of each level.

        Raises
        ------
        InvalidArgument
            A level or the chord error is out of its domain.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        If windows are not retained, each call runs the sweep again. An exact field then retains
        only the windows of faces that the levels may pass. That takes far less memory than
        retaining all windows, and usually less time. O(windows), and for each level O(n² log n) for
        n windows in each face that it passes.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> near, far = field.isolines([0.5, 1.2])
        >>> len(near), near[0].closed, abs(near[0].length - 0.25 * np.pi) < 0.01
        (1, False, True)
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        return list(
            self._isolines(as_levels(levels), resolve_chord_error(self.mesh, chord_error), control)
        )

    def each_isoline(
        self,
        levels: Sequence[float],
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Iterator[list[Isoline]]:
        """Yield the lines of `isolines` level by level, each drawn when the iterator reaches it.

        Parameters
        ----------
        levels, chord_error
            As in `isolines`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Yields
        ------
        list of Isoline
            The lines of the next level.

        Raises
        ------
        InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `isolines`.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.exact_distance(mesh, 0)

        >>> [len(lines) for lines in field.each_isoline([0.5, 1.2, 9.0])]
        [1, 1, 0]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        return self._isolines(
            as_levels(levels), resolve_chord_error(self.mesh, chord_error), control
        )

    def _isolines(
        self, levels: Sequence[float], chord_error: float, control: Control
    ) -> Iterator[list[Isoline]]:
        # At its very limit the sweep is cut off by rounding: a line stays clear of that.
        highest = self.max_distance * (1.0 - CUT_OFF)
        within = [min(level, highest) for level in levels if level <= self.max_distance]
        if not within:
            yield from ([] for _ in levels)
            return
        distance, windows = self._result.distance, self._result.windows
        if self._fast is not None and self._winners_and_windows is not None:
            winners, windows = self._winners_and_windows.get(control.for_part(0, 2))
            distance, control = winners.distance, control.for_part(1, 2)
        elif windows is None:
            windows = self._windows_at(within, control.for_part(0, 2))
            control = control.for_part(1, 2)
        parts = 1 + len(levels)
        drawing = Drawing(
            self.mesh, windows, distance, self._sweep.nodes, control.for_part(0, parts)
        )
        for i, level in enumerate(levels):
            part = control.for_part(1 + i, parts)
            reached = level <= self.max_distance
            yield drawing.lines(min(level, highest), chord_error, part) if reached else []
        if control.progress is not None:
            control.progress(1.0)

    def borders(
        self,
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> list[Border]:
        """Return the borders of the sources' territories: their geodesic Voronoi diagram.

        The territory of a source is the part of the surface that is nearer to it than to any other
        source; start distances count. Each line separates two territories. It is closed, or ends
        where three of them or more meet, at the boundary, at an edge of more than two faces, or at
        ``max_distance``. In each face it consists of pieces of hyperbolas, of parabolas beside
        curves, and of straight lines. Its ends and crossings of edges are exact, and between them
        pieces become chords. Where a part of the surface is equally near to two sources, it belongs
        to the lower one. Every edge of the mesh whose ends have different nearest sources is
        crossed. The borders of an approximate or fast field are exact as well, from an exact sweep.

        Parameters
        ----------
        chord_error
            Largest distance of a chord from its curve, mesh units; as in `isolines`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        list of Border
            The lines, each with the two sources that it separates; none of a single source.

        Raises
        ------
        InvalidArgument
            The chord error is out of its domain.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        If windows are not retained, each call runs an exact sweep again, and retains only the
        windows of faces that borders may pass. O(windows), and O(n³) in each face that a border
        passes, for n windows that are nearest somewhere in it.

        Examples
        --------
        >>> mesh = gc.samples.plane(200)
        >>> field = gc.exact_distance(mesh, [0, 10, 110])  # three corners of the square
        >>> [line.sources for line in field.borders()]
        [(0, 1), (0, 2), (1, 2)]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        error, sweep = resolve_chord_error(self.mesh, chord_error), self._exact_sweep
        borders: list[Border] = []
        if len(self.sources) > 1:
            kept = self._winners_and_windows.value if self._winners_and_windows else None
            if kept is not None:
                winners, windows = kept
                borders = borders_of(
                    sweep, windows, winners.distance, winners.nearest, error, control
                )
            else:
                borders = swept_borders(sweep, self._result.nearest, error, control)
        if control.progress is not None:
            control.progress(1.0)
        return borders

    def _windows_at(self, levels: Sequence[float], control: Control) -> FaceWindows:
        """Return the windows of all faces that some levels may pass."""
        if self._sweep.bounds.merging:
            return self._sweep.find_windows(self._sweep.all_faces, control)
        faces = crossed_faces(self.mesh, self._result.distance, self.max_distance, levels)
        return self._sweep.find_windows(faces, control)

    def _traced(
        self, target: SurfacePoint, winners: Winners, nodes: Nodes, node: int
    ) -> GeodesicPath:
        """Return the path to a node, whose length must be the distance in the field.

        That of a fast sweep may be shorter: it goes on with what was found later.
        """
        distance = float(winners.distance[node])
        path = traced_path(self.mesh, winners, nodes, node, EXACT)
        start = self.sources[winners.nearest[node]].start_distance
        excess = start + path.length - distance
        is_fast, exact = len(winners.crossing) > 0, not self._sweep.bounds.merging
        most = rounding_of(self.mesh, distance)
        if (excess < -most and not is_fast) or (exact and excess > most):
            raise InternalError(
                f"the path to {target} has length {path.length}, but the field says "
                f"{distance - start}; please report this mesh"
            )
        if is_fast:
            return replace(path, error_bound=self.error_bound)
        if exact:
            return path
        share = max(excess, 0.0) / distance if distance > most else 0.0
        return replace(path, error_bound=ErrorBound("relative", share, "guaranteed"))

    def _node(self, location: SurfacePoint) -> int | None:
        if location.vertex_index is not None:
            return int(self.mesh.topology.inner_vertex[location.vertex_index])
        return self._node_of.get(location)

    def _arrival_at(
        self, location: SurfacePoint, winners: Winners, windows: FaceWindows
    ) -> Arrival:
        """Return the arrival of windows at a point."""
        nodes = self._sweep.nodes
        return arrival_at(self.mesh, winners, windows, nodes, location, self.max_distance)

    def _nearest_to(self, location: SurfacePoint, control: Control) -> NearestSource:
        sweep, starts = self._sweep, [line[0] for line in self._polylines]
        return find_nearest_source(
            self.mesh,
            starts,
            sweep.start_distances,
            self._result.distance,
            sweep.bounds,
            location,
            control,
        )

    def _no_path(self, target: SurfacePoint) -> NoPath:
        sources = [line[0] for line in self._polylines]
        if component_of(self.mesh, target) in {component_of(self.mesh, p) for p in sources}:
            return NoPath(
                f"{target} is farther than max_distance = {self.max_distance:g} from every source",
                "beyond_max_distance",
            )
        message = f"{target} is in another connected component than every source"
        return disconnected(self.mesh, message, target, *sources)


def field_of(
    sources: tuple[Source, ...],
    polylines: tuple[Polyline, ...],
    targets: tuple[SurfacePoint, ...],
    sweep: RepeatableSweep,
    fast: FastSweep | None,
    promise: ErrorBound,
    result: SweepResult,
    stats: SweepStats,
) -> DistanceField:
    """Return the field of a sweep and its result."""
    inner = sweep.mesh.topology.inner_vertex
    return DistanceField(
        mesh=sweep.mesh,
        sources=sources,
        max_distance=sweep.bounds.max_distance,
        distances=result.distance[inner],
        nearest_source=result.nearest[inner],
        error_bound=promise,
        stats=stats,
        _polylines=polylines,
        _targets=targets,
        _sweep=sweep,
        _fast=fast,
        _result=result,
    )
