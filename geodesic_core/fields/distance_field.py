"""Distance fields: the results of the solvers."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import DTypeLike, NDArray

from geodesic_core import plotting
from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.borders import Border, borders_of, swept_borders
from geodesic_core.fields.cells import Cells, cells_of
from geodesic_core.fields.certificate import Certificate, certified
from geodesic_core.fields.fast_sweep import FastSweep
from geodesic_core.fields.field_file import SHOWN, write_field_file
from geodesic_core.fields.gradient import gradient_at_vertices
from geodesic_core.fields.isolines import (
    Drawing,
    as_levels,
    drawn_levels,
    resolve_chord_error,
    spaced_levels,
)
from geodesic_core.fields.log_map import LogMap, log_map_of
from geodesic_core.fields.path import ErrorBound, GeodesicPath
from geodesic_core.fields.point_query import PointQueries
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import disconnected
from geodesic_core.fields.sweep_result import (
    Retain,
    SweepResult,
    SweepStats,
    arrays_of,
    stats_of,
)
from geodesic_core.fields.sweeps import ExactSweep, MergingSweep, Sweep
from geodesic_core.fields.transport import transported
from geodesic_core.kernels.retained.face_windows import FaceWindows
from geodesic_core.mesh.surface_curve import SurfaceCurve, draw_over
from geodesic_core.mesh.surface_point import Point, Source, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.plotting import Camera
from geodesic_core.reprs import as_table
from geodesic_core.tolerances import CUT_OFF
from geodesic_core.validation import as_angle, check_choice

_BEYOND_LIMIT = 10.0
"""Chord errors by which borders of cells go beyond ``max_distance``"""


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
    _sweep: Sweep
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
        question = Question.from_arrays(mesh, arrays)
        created, kept, peak, peak_bytes = arrays["counts"].tolist()
        field = field_of(
            sweep_from_arrays(question, arrays),
            SweepResult.from_arrays(arrays, question.nodes.sites),
            SweepStats.of(mesh, created, kept, peak, peak_bytes, float(arrays["seconds"])),
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
        stats = self.stats
        counts = stats.windows_created, stats.windows_kept, stats.windows_peak, stats.peak_bytes
        return {
            **self._sweep.question.arrays(),
            **self._sweep.arrays(),
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
        return plotting.with_distances(surface, self.distances, self.nearest_source)

    def plot(
        self,
        isolines: int | Sequence[float] = 0,
        paths: Iterable[SurfaceCurve] = (),
        points: Iterable[Point] = (),
        *,
        camera: Camera | None = None,
        title: str | None = None,
        save: str | Path | None = None,
    ) -> None:
        """Draw the surface, coloured by distance: in a window, in a notebook, or into a file.

        Sources are marked. Unreachable parts are grey.

        Parameters
        ----------
        isolines
            Levels of lines to draw, or how many, evenly spaced.
        paths, points
            Curves of any kind, and points, to draw as well.
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
        >>> file = Path(mkdtemp()) / "field.png"
        >>> field = gc.exact_distance(gc.samples.sphere(80), 0)
        >>> field.plot(isolines=8, paths=[field.path_to(9)], title="From the pole", save=file)
        >>> file.exists()
        True
        """
        with plotting.picture(save, camera, title, "DistanceField.plot") as plotter:
            plotting.draw_surface(plotter, self.to_pyvista())
            levels = drawn_levels(isolines, self.levels)
            lines = chain.from_iterable(self.isolines(levels) if len(levels) else [])
            shown = [line.to_pyvista() for line in lines]
            plotting.draw_lines(plotter, shown, plotting.ISOLINE, plotting.ISOLINE_WIDTH)
            sources = self._sweep.question.polylines
            places = [[self.mesh.position(point) for point in line] for line in sources]
            curves = [plotting.line_of(np.array(each), "plot") for each in places if len(each) > 1]
            plotting.draw_lines(plotter, curves, plotting.PATH, plotting.PATH_WIDTH)
            alone = [line[0] for line in sources if len(line) == 1]
            draw_over(self.mesh, plotter, paths, [*alone, *points])

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
        held: list[Any] = [self.distances, self.nearest_source, *self._result.arrays().values()]
        winners, exact = self._points.winners.value, self._points.exact.value
        held += [] if winners is None else arrays_of(winners).values()
        held += [] if exact is None else exact[1]
        return sum({id(array): array.nbytes for array in held}.values())

    @cached_property
    def _points(self) -> PointQueries:
        return PointQueries(self._sweep, self._result)

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
        return self._points.distance_at(self.mesh.point(point), control)

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
        return self._points.nearest_source_at(self.mesh.point(point), control)

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
        point = self.mesh.point(target, "target")
        path = self._points.path_to(point, control)
        if path is None:
            raise self._no_path(point)
        return path

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
        self.mesh.require_embedded("a gradient")
        winners = self._points.winners.get(Control())
        return gradient_at_vertices(self.mesh, winners, self._sweep.question.nodes)

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
    ) -> list[list[SurfaceCurve]]:
        """Return for each level, in their order, the lines of points at that distance.

        They bound the part of the surface within that distance, which is on their right. They are
        closed, or open where they end at the boundary or at an edge of more than two faces. In each
        face they consist of circular arcs, and of straight lines beside curves; their ends and
        crossings of edges are exact, and between them arcs become chords. A vertex at the level
        itself counts as within. Levels beyond all distances, or beyond ``max_distance``, have no
        lines. In an approximate field the lines follow its own distances, and the same error bound
        holds. In a fast field the lines are exact: they come from an exact sweep, whose windows it
        retains.

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
        list of list of SurfaceCurve
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
    ) -> Iterator[list[SurfaceCurve]]:
        """Yield the lines of `isolines` level by level, each drawn when the iterator reaches it.

        Parameters
        ----------
        levels, chord_error
            As in `isolines`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Yields
        ------
        list of SurfaceCurve
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
    ) -> Iterator[list[SurfaceCurve]]:
        # At its very limit the sweep is cut off by rounding: a line stays clear of that.
        highest = self.max_distance * (1.0 - CUT_OFF)
        within = [min(level, highest) for level in levels if level <= self.max_distance]
        if not within:
            yield from ([] for _ in levels)
            return
        distance, windows = self._result.distance, self._result.windows
        if windows is None:
            distance, windows = self._windows_at(within, control.for_part(0, 2))
            control = control.for_part(1, 2)
        parts = 1 + len(levels)
        nodes = self._sweep.question.nodes
        drawing = Drawing(self.mesh, windows, distance, nodes, control.for_part(0, parts))
        for i, level in enumerate(levels):
            part = control.for_part(1 + i, parts)
            reached = level <= self.max_distance
            yield drawing.lines(min(level, highest), chord_error, part) if reached else []
        control.finish()

    def log_map(
        self,
        *,
        x_axis: Sequence[float] | None = None,
        rescale: bool = True,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> LogMap:
        """Return the log map of the field's source, as `log_map` does.

        Parameters
        ----------
        x_axis
            A vector in space, from whose projection angles are measured; None as in `log_map`.
        rescale
            As in `log_map`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        LogMap
            With the distances of the field, to the bit.

        Raises
        ------
        InvalidArgument
            The field is not exact, or its source is not one point without a start distance: there
            is no one direction then. Or another argument is out of its domain.
        InvalidPoint
            The source has no tangent plane.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        Runs the sweep again, whose windows then carry directions.

        Examples
        --------
        >>> gc.exact_distance(gc.samples.plane(2), 0).log_map().angles.round(3).tolist()
        [nan, 0.0, 1.571, 0.785]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        question = self._question_of_one_point("a log map", control)
        return log_map_of(question, control, x_axis, rescale=rescale)

    def transport(
        self,
        angle: float,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Floats:
        """Return a vector at the source, carried along the shortest path to each vertex.

        On a straight way a vector keeps its angle with the path. At a vertex, where the angles sum
        to another total than a full turn, it keeps that in the tangent plane: see `TangentFrames`.
        So a vector that is carried there and back is the same.

        Parameters
        ----------
        angle
            Radians, in the frame of the source as in `log_map`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        numpy.ndarray
            (V,) float64, radians, from 0 up to the total angle, in the frame of each vertex: that
            of `TriangleMesh.tangent_frames`, whose `vectors` makes vectors of them. NaN where
            unreachable, where several fans of faces meet, and behind bends there.

        Raises
        ------
        InvalidArgument
            The field is not exact, or its source is not one point without a start distance. Or
            the angle is not a finite number.
        InvalidPoint
            The source has no tangent plane.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        Runs the sweep again, whose windows then carry directions.

        Examples
        --------
        >>> field = gc.exact_distance(gc.samples.plane(2), 0)
        >>> field.transport(np.pi / 4).round(3).tolist()
        [0.785, 5.498, 2.356, 3.927]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        question = self._question_of_one_point("transport", control)
        return transported(question, as_angle(angle), control)

    def _question_of_one_point(self, name: str, control: Control) -> Question:
        """Return the question of the field without its targets, for an answer of this name.

        Raises ``InvalidArgument`` where the field is not exact, or its source is not a point.
        """
        question = self._sweep.question
        if self._sweep.exact is not self._sweep:
            raise InvalidArgument(f"only exact fields have {name}: use exact_distance")
        if question.has_curves or question.start_distances.tolist() != [0.0]:
            raise InvalidArgument(
                f"{name} has one source, a point without a start distance: use one field for each"
            )
        return Question.of(self.mesh, question.sources, (), question.max_distance, control)

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
        borders = self._borders(resolve_chord_error(self.mesh, chord_error), control)
        control.finish()
        return borders

    def _borders(self, error: float, control: Control) -> list[Border]:
        if len(self.sources) == 1:
            return []
        sweep, exact = self._sweep.exact, self._points.exact.value
        if exact is None:
            return swept_borders(sweep, self._result.nearest, error, control)
        return borders_of(sweep, *exact, error, control)

    def cells(
        self,
        chord_error: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Cells:
        """Return the sources' territories as cells: the mesh cut apart along their borders.

        Parameters
        ----------
        chord_error
            Largest distance of a chord from the border that it stands for, mesh units; as in
            `borders`.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        Cells
            Areas, centroids, neighbours and meshes. With ``max_distance`` they end there. Those of
            an approximate or fast field are exact as well, from an exact sweep.

        Raises
        ------
        InvalidArgument
            The chord error is out of its domain.
        InvalidMesh
            A border meets a vertex that an edge of zero length joins to another one.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        O(V + F) beside what `borders` takes.

        Examples
        --------
        >>> field = gc.exact_distance(gc.samples.plane(200), [0, 10])  # two corners of the square
        >>> field.cells().areas.round(9).tolist()
        [0.5, 0.5]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        error, question = resolve_chord_error(self.mesh, chord_error), self._sweep.question
        limit = question.max_distance
        # Borders go beyond the line of the limit, whose chords may leave out where two arcs meet.
        question = replace(question, max_distance=limit + _BEYOND_LIMIT * error)
        field = self
        if self._sweep.exact is not self._sweep or math.isfinite(limit):
            field = solve(ExactSweep(question), "distances", control.for_part(0, 2))
            control = control.for_part(1, 2)
        borders = field._borders(error, control.for_part(0, 2))
        control = control.for_part(1, 2)
        limits: list[SurfaceCurve] = []
        if math.isfinite(limit):
            (limits,) = field._isolines([limit], error, control.for_part(0, 2))
            control = control.for_part(1, 2)
        return cells_of(field, borders, limits, limit, control)

    def certify(
        self,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Certificate:
        """Prove the distances: return lower and upper bounds, with what proves them.

        After that `error_bound` is certified: the largest difference between a distance and its
        bounds, mesh units. A fast field is proved by an exact sweep: its distances are the lengths
        of paths, and no less than ``lower``.

        Parameters
        ----------
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        Certificate
            With bounds of all vertices, those beyond ``max_distance`` included.

        Raises
        ------
        InvalidArgument
            A source is a curve.
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `Control`; the field can still be used.

        Notes
        -----
        A field that is fast, does not retain its windows, or has a limit, sweeps again.
        O(F + windows + faces that the straight lines of all paths cross): about twenty times as
        long as a sweep without a limit.

        Examples
        --------
        >>> field = gc.exact_distance(gc.samples.sphere(80), 0)
        >>> certificate = field.certify()
        >>> bool((certificate.lower <= certificate.upper).all())
        True
        >>> field.error_bound.kind, field.error_bound.value < 1e-9
        ('certified', True)
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        certificate = certified(self._sweep, self._result, control)
        known = np.isfinite(self.distances)
        apart = [
            np.abs(bounds[known] - self.distances[known]).max(initial=0.0)
            for bounds in (certificate.lower, certificate.upper)
        ]
        # What is known of the field changes, and not the field.
        bound = ErrorBound("absolute", float(max(apart)), "certified")
        object.__setattr__(self, "error_bound", bound)
        return certificate

    def _windows_at(self, levels: Sequence[float], control: Control) -> tuple[Floats, FaceWindows]:
        """Sweep for distances by node, and the windows of all faces that some levels may pass."""
        sweep, distance = self._sweep.covering, self._result.distance
        if sweep is not None:
            return distance, sweep.find_windows(sweep.faces_passed(distance, levels), control)
        winners, windows = self._points.exact.get(control)
        return winners.vertices.distance, windows

    def _no_path(self, target: SurfacePoint) -> NoPath:
        if self._sweep.question.connects(target):
            return NoPath(
                f"{target} is farther than max_distance = {self.max_distance:g} from every source",
                "beyond_max_distance",
            )
        message = f"{target} is in another connected component than every source"
        sources = [line[0] for line in self._sweep.question.polylines]
        return disconnected(self.mesh, message, target, *sources)


def field_of(sweep: Sweep, result: SweepResult, stats: SweepStats) -> DistanceField:
    """Return the field of a sweep and its result."""
    question = sweep.question
    inner = question.mesh.topology.inner_vertex
    return DistanceField(
        mesh=question.mesh,
        sources=question.sources,
        max_distance=question.max_distance,
        distances=result.distance[inner],
        nearest_source=result.nearest[inner],
        error_bound=sweep.promise,
        stats=stats,
        _sweep=sweep,
        _result=result,
    )


def sweep_from_arrays(question: Question, arrays: Mapping[str, NDArray[Any]]) -> Sweep:
    """Return the sweep that its own arrays tell, see `Sweep.arrays`."""
    if "effort" in arrays:
        return FastSweep(question, int(arrays["effort"]))
    if "errors" in arrays:
        return MergingSweep(question, *arrays["errors"].tolist())
    return ExactSweep(question)


def solve(sweep: Sweep, retain: Retain, control: Control) -> DistanceField:
    """Run a sweep, and return the field with what it is to retain.

    Raises
    ------
    InvalidArgument
        It cannot retain that.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    check_choice("retain", retain, get_args(Retain))
    wave = sweep.run(control, retain)
    seconds = time.perf_counter() - control.began
    stats = stats_of(sweep.question.mesh, wave, seconds)
    return field_of(sweep, SweepResult.of(wave, retain), stats)
