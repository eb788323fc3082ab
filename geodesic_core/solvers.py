"""The solvers: arguments in, sweeps, results out."""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from scipy.sparse import csr_array

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.distance_field import DistanceField, field_of
from geodesic_core.fields.path import EXACT, ErrorBound, GeodesicPath, joined, length_of
from geodesic_core.fields.repeatable_sweep import RepeatableSweep, stats_of
from geodesic_core.fields.sources import Sources, as_sources, component_of, disconnected
from geodesic_core.kernels.jit import sources_digest
from geodesic_core.kernels.sweep.bounds import Bounds, exact_bounds, merging_bounds
from geodesic_core.mesh.surface_point import Point, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.matrix import Layout, find_matrix
from geodesic_core.search.nearest import Nearest, find_nearest
from geodesic_core.search.path_search import PathSearch
from geodesic_core.search.target_sweep import TargetSweep
from geodesic_core.tolerances import AT_LIMIT, WIDEST_ERROR
from geodesic_core.validation import as_barriers, as_limit, check_choice, is_number

Retain = Literal["distances", "paths", "windows"]
"""How much a field holds in memory: each word includes the ones before it."""


def exact_distance(
    mesh: TriangleMesh,
    sources: Sources,
    max_distance: float | None = None,
    targets: Sequence[Point] = (),
    barriers: Iterable[int] = (),
    *,
    retain: Retain = "paths",
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> DistanceField:
    """Return the exact geodesic distance from the nearest source to every vertex (section 3).

    Parameters
    ----------
    mesh
        The surface.
    sources
        A vertex index, a `SurfacePoint`, a `Curve`, a `Source` with a start distance, or several
        of these.
    max_distance
        Vertices farther than this (mesh units) are not looked for; they count as unreachable.
    targets
        Points whose distances are found on the way, so that `DistanceField.distance_at` and
        `DistanceField.path_to` know them without a search of their own.
    barriers
        Ids of faces that act as holes, for this call: the field is that of
        `TriangleMesh.with_barriers`, which makes the same mesh once for many calls.
    retain
        What the field holds in memory; the rest is found by a second sweep when it is first needed.
        ``"distances"``: distances and nearest sources. ``"paths"``: also what
        `DistanceField.path_to` and `DistanceField.gradient` need, 36 bytes a vertex.
        ``"windows"``: also the windows of all faces, 64 bytes each. Then
        `DistanceField.distance_at` and `DistanceField.path_to` find any point by the windows of
        its face, and `DistanceField.isolines` does not sweep again. On large meshes retaining
        windows takes longer than the sweep.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Raises
    ------
    InvalidPoint, InvalidArgument
        A source that is not on the mesh, or inside a barrier; a limit out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        The sweep was stopped; the mesh is as good as before.

    Notes
    -----
    O(F^1.5 log F) in practice and O(F² log F) at worst. Memory: about a third of the mesh's own
    arrays, since windows are given back as soon as they are propagated, unless they are kept.
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    bounds = exact_bounds(as_limit(max_distance))
    mesh, control = _among(mesh, barriers, control)
    return _solve(mesh, sources, targets, bounds, EXACT, retain, control)


def approximate_distance(
    mesh: TriangleMesh,
    sources: Sources,
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    max_distance: float | None = None,
    targets: Sequence[Point] = (),
    barriers: Iterable[int] = (),
    *,
    retain: Retain = "distances",
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> DistanceField:
    """Return geodesic distances that are too short by a bounded error, never too long (section 4).

    Parameters
    ----------
    mesh, sources
        As in `exact_distance`.
    relative_error
        Share of the exact distance by which a distance may fall short: above 0 and below 1. None
        for no such bound, if there is an absolute one.
    absolute_error
        The same in mesh units. Where both are given, both hold.
    max_distance, targets, barriers
        As in `exact_distance`.
    retain
        What the field holds in memory; the rest is found by a second sweep when it is first needed.
        ``"distances"``: distances and nearest sources. ``"paths"``: also what
        `DistanceField.path_to` and `DistanceField.gradient` need, at most about as much as the
        mesh's own arrays. ``"windows"``: also the windows of all faces, 64 bytes each, which
        `DistanceField.isolines` needs.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Raises
    ------
    NotConverged
        The windows of an edge came up too often; not seen yet. A smaller error would help.
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    O(F log F) in practice. docs/accuracy.md tells what is guaranteed, and why.
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    relative, absolute = _as_errors(relative_error, absolute_error)
    limit = as_limit(max_distance)
    bounds = merging_bounds(limit, min(relative, WIDEST_ERROR), absolute)
    mesh, control = _among(mesh, barriers, control)
    if math.isfinite(relative):
        promise = ErrorBound("relative", relative, "guaranteed")
    else:
        promise = ErrorBound("absolute", absolute, "guaranteed")
    return _solve(mesh, sources, targets, bounds, promise, retain, control)


def shortest_path(
    mesh: TriangleMesh,
    source: Point,
    target: Point,
    waypoints: Sequence[Point] = (),
    max_distance: float | None = None,
    *,
    explain: bool = False,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> GeodesicPath:
    """Return an exact shortest path between two points of the surface (section 5).

    For many paths on one mesh, a `Solver` is faster.

    Parameters
    ----------
    mesh
        The surface.
    source, target
        Vertex indices, or `SurfacePoint` of vertices.
    waypoints
        Points that the path passes in order; it is shortest from each to the next.
    max_distance
        A path longer than this (mesh units), past all waypoints, is not looked for: the search ends
        once it is certain that there is no other.
    explain
        Also return what each step of the search did, in `GeodesicPath.steps`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Raises
    ------
    NoPath
        Two of the points are not connected, or the path is longer than ``max_distance``.
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    In practice O(region), a thin strip around the path and a larger one for its bounds; allocating
    the state is O(V + F), about two thirds of the mesh's own arrays.
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    limit = as_limit(max_distance)
    stops = _as_stops(mesh, source, target, waypoints)
    return _shortest_through(PathSearch(mesh), stops, limit, control, explain=explain)


class Solver:
    """Solvers of one mesh that keep between calls what they can share.

    Paths need scratch memory, about two thirds of the mesh's own arrays, and get faster with
    landmarks, which are added while paths are asked for (64 bytes a vertex); matrices and nearest
    candidates need a third. Not for use by several threads at once.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self._search: PathSearch | None = None
        self._sweeper: TargetSweep | None = None

    @property
    def nbytes(self) -> int:
        """Memory kept, bytes, the mesh not counted."""
        return sum(kept.nbytes for kept in (self._search, self._sweeper) if kept is not None)

    def exact_distance(
        self,
        sources: Sources,
        max_distance: float | None = None,
        targets: Sequence[Point] = (),
        barriers: Iterable[int] = (),
        *,
        retain: Retain = "paths",
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> DistanceField:
        """Do as `exact_distance` does, on this mesh."""
        return exact_distance(
            self.mesh,
            sources,
            max_distance,
            targets,
            barriers,
            retain=retain,
            progress=progress,
            cancel=cancel,
            deadline_s=deadline_s,
            memory_limit=memory_limit,
        )

    def approximate_distance(
        self,
        sources: Sources,
        relative_error: float | None = 1e-3,
        absolute_error: float | None = None,
        max_distance: float | None = None,
        targets: Sequence[Point] = (),
        barriers: Iterable[int] = (),
        *,
        retain: Retain = "distances",
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> DistanceField:
        """Do as `approximate_distance` does, on this mesh."""
        return approximate_distance(
            self.mesh,
            sources,
            relative_error,
            absolute_error,
            max_distance,
            targets,
            barriers,
            retain=retain,
            progress=progress,
            cancel=cancel,
            deadline_s=deadline_s,
            memory_limit=memory_limit,
        )

    def shortest_path(
        self,
        source: Point,
        target: Point,
        waypoints: Sequence[Point] = (),
        max_distance: float | None = None,
        *,
        explain: bool = False,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> GeodesicPath:
        """Do as `shortest_path` does, on this mesh; in time that does not depend on its size."""
        control = Control(progress, cancel, deadline_s, memory_limit)
        limit = as_limit(max_distance)
        stops = _as_stops(self.mesh, source, target, waypoints)
        search = self._kept_search()
        path = _shortest_through(search, stops, limit, control, explain=explain)
        search.add_landmark_if_due(stops[0], replace(control, progress=None))
        return path

    def distance_matrix(
        self,
        sources: Sequence[Point],
        targets: Sequence[Point],
        max_distance: float | None = None,
        layout: Layout = "dense",
        *,
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Floats | csr_array:
        """Do as `distance_matrix` does, on this mesh; keeps the memory of one of the threads."""
        control = Control(progress, cancel, deadline_s, memory_limit)
        keep = self._kept_sweeper, self._kept_search
        return find_matrix(
            self.mesh, *keep, sources, targets, max_distance, layout, threads, control
        )

    def nearest(
        self,
        source: Point,
        candidates: Sequence[Point],
        k: int = 1,
        max_distance: float | None = None,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> Nearest:
        """Do as `nearest` does, on this mesh; in time that does not depend on its size."""
        control = Control(progress, cancel, deadline_s, memory_limit)
        return find_nearest(
            self.mesh, self._kept_sweeper, source, candidates, k, max_distance, control
        )

    def _kept_search(self) -> PathSearch:
        if self._search is None:
            self._search = PathSearch(self.mesh)
        return self._search

    def _kept_sweeper(self) -> TargetSweep:
        if self._sweeper is None:
            self._sweeper = TargetSweep(self.mesh)
        return self._sweeper


def _shortest_through(
    search: PathSearch,
    stops: Sequence[SurfacePoint],
    limit: float,
    control: Control,
    *,
    explain: bool,
) -> GeodesicPath:
    """Search for leg after leg, each no longer than what those before and after it leave."""
    legs: list[GeodesicPath] = []
    positions = np.array([search.mesh.position(stop) for stop in stops])
    left = limit * (1.0 + AT_LIMIT)
    for here, there in pairwise(stops):
        leg_control = control.for_part(len(legs), len(stops) - 1)
        if legs:
            search.add_landmark_if_due(here, replace(control, progress=None))
        rest = length_of(positions[len(legs) + 1 :])
        try:
            leg = search.find(here, there, leg_control, explain=explain, limit=left - rest)
        except NoPath:
            raise NoPath(
                f"the path from {stops[0]} to {stops[-1]} is longer than max_distance = {limit:g}",
                "beyond_max_distance",
            ) from None
        left -= leg.length
        legs.append(leg)
    if control.progress is not None:
        control.progress(1.0)
    return legs[0] if len(legs) == 1 else joined(legs)


def warm_up() -> None:
    """Compile what distances and paths need, or load it from the cache on disk (0.1 s).

    Some tens of seconds, once on a machine. Curves, isolines and matrices add theirs when they are
    first asked for.
    """
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    mesh = TriangleMesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    exact_distance(mesh, 0).path_to(3)
    approximate_distance(mesh, 0, retain="paths").path_to(3)
    shortest_path(mesh, 0, 3, explain=True)
    mesh.report  # noqa: B018 - computed on access


def kernel_digest() -> str:
    """Return a digest of the kernels' sources: equal digests give answers equal to the bit.

    Returns
    -------
    str
        Hexadecimal; the same for equal sources on every machine.

    Examples
    --------
    >>> import geodesic_core as gc
    >>> gc.kernel_digest() == gc.kernel_digest()
    True
    """
    return sources_digest()


def _among(
    mesh: TriangleMesh, barriers: Iterable[int], control: Control
) -> tuple[TriangleMesh, Control]:
    """Return the mesh with its barriers, and the control of a call that holds what that takes."""
    faces = as_barriers(barriers, len(mesh.faces))
    if len(faces) == 0:
        return mesh, control
    control = control.holding(sum(array.nbytes for array in mesh.topology))
    control.check_memory(0)
    return mesh.with_barriers(faces), control


def _solve(
    mesh: TriangleMesh,
    sources: Sources,
    targets: Sequence[Point],
    bounds: Bounds,
    promise: ErrorBound,
    retain: Retain,
    control: Control,
) -> DistanceField:
    """Check the arguments, sweep, and make the result with what it is to retain."""
    check_choice("retain", retain, get_args(Retain))
    paths, windows = retain != "distances", retain == "windows"
    starts, places = as_sources(mesh, sources)
    ends = tuple(mesh.point(point, f"target {i}") for i, point in enumerate(targets))
    distances = np.array([start.start_distance for start in starts])
    sweep = RepeatableSweep.between(mesh, places, distances, ends, bounds)
    wave = sweep.run(control, paths=paths, windows=sweep.all_faces if windows else None)
    found = sweep.found(wave, paths=paths, windows=windows)
    stats = stats_of(mesh, wave, time.perf_counter() - control.began)
    return field_of(starts, places, ends, sweep, promise, found, stats)


def _as_stops(
    mesh: TriangleMesh, source: Point, target: Point, waypoints: Sequence[Point]
) -> list[SurfacePoint]:
    """Return the stops of a path, which must be connected."""
    stops = [mesh.point(source, "source")]
    stops += [mesh.point(point, f"waypoint {i}") for i, point in enumerate(waypoints)]
    stops.append(mesh.point(target, "target"))
    for here, there in pairwise(stops):
        if component_of(mesh, here) != component_of(mesh, there):
            message = f"{here} and {there} are in different connected components"
            raise disconnected(mesh, message, here, there)
    return stops


def _as_errors(relative: float | None, absolute: float | None) -> tuple[float, float]:
    if relative is None and absolute is None:
        raise InvalidArgument("relative_error and absolute_error are both None; give at least one")
    if relative is not None and not (is_number(relative) and 0.0 < relative < 1.0):
        raise InvalidArgument(
            f"relative_error is {relative!r}; it must be a number above 0 and below 1"
        )
    if absolute is not None and not (
        is_number(absolute) and absolute > 0.0 and math.isfinite(absolute)
    ):
        raise InvalidArgument(f"absolute_error is {absolute!r}; it must be a finite number above 0")
    return (
        math.inf if relative is None else float(relative),
        math.inf if absolute is None else float(absolute),
    )
