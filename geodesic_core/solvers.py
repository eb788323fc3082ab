"""Solvers: arguments in, sweeps and searches, results out.

Each is a function of a mesh or of a `Solver`, and the method of the same name.
"""

from __future__ import annotations  # help() shows the names of types, not what they stand for

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.costs.cheapest_path import CheapestPath, find_cheapest_path
from geodesic_core.costs.cost_field import CostField, Direction, find_costs
from geodesic_core.costs.cost_sweep import Detail
from geodesic_core.costs.surface_costs import Cost, SurfaceCosts
from geodesic_core.cutting.cut import cut_along
from geodesic_core.cutting.cut_mesh import CutMesh
from geodesic_core.cutting.lines import as_line
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.distance_field import DistanceField, solve
from geodesic_core.fields.log_map import LogMap, log_map_of
from geodesic_core.fields.methods import Effort, Method, as_effort, promise_of, sweep_of
from geodesic_core.fields.path import ErrorBound, GeodesicPath, joined
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import as_points, as_sources, component_of, disconnected
from geodesic_core.fields.straight_lines import (
    StraightLine,
    as_lengths,
    directions_from,
    lines_from,
)
from geodesic_core.fields.sweep_result import Retain
from geodesic_core.fields.sweep_steps import SweepSteps, follow_sweep
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.kernels.jit.cache import sources_digest
from geodesic_core.loops.handle_loops import handle_loops_of
from geodesic_core.loops.paths_around import obstacle_of, paths_on_both_sides
from geodesic_core.loops.shortest_loop import shortest_loop_through
from geodesic_core.loops.tubes import shortest_nearby
from geodesic_core.matrices.matrix import Layout, find_matrix
from geodesic_core.mesh.barriers import with_barriers
from geodesic_core.mesh.canonical import each_of
from geodesic_core.mesh.frames import planes_at
from geodesic_core.mesh.surface_curve import Sources, SurfaceCurve, length_of, locations_of
from geodesic_core.mesh.surface_point import Curve, Point, Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.sampling.farthest_points import FarthestPoints, spread_points
from geodesic_core.sampling.mean_point import MeanPoint, find_mean
from geodesic_core.sampling.relaxation import RelaxedPoints, relaxed_points
from geodesic_core.search.nearest import Nearest, find_nearest
from geodesic_core.search.path_search import PathSearch
from geodesic_core.search.workspace import Workspace
from geodesic_core.tolerances import AT_LIMIT
from geodesic_core.validation import (
    as_barriers,
    as_limit,
    as_nonnegative,
    check_choice,
    is_index,
    is_number,
    unboxed,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.sparse import csr_array


def exact_distance(
    mesh: MeshLike | Solver,
    sources: Sources,
    max_distance: float | None = None,
    targets: Points = (),
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
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    sources
        A vertex index, a `SurfacePoint`, a `Curve`, a `Source` with a start distance, or several
        of these.
    max_distance
        Limit of the sweep, mesh units; None for no limit. Vertices beyond it count as unreachable.
    targets
        One or more points whose distances the same sweep finds. For these,
        `DistanceField.distance_at` and `DistanceField.path_to` need no further search.
    barriers
        Ids of faces that act as holes, for this call. The field is that of
        `TriangleMesh.with_barriers`, which prepares the blocked mesh once for many calls.
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

    Returns
    -------
    DistanceField
        Distances, (V,) float64 in mesh units, with the nearest source of each vertex, paths and
        isolines.

    Raises
    ------
    InvalidPoint
        A source or a target is not on the mesh, or lies inside a barrier.
    InvalidArgument
        Another argument is out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        The sweep was stopped; the mesh can still be used.

    Notes
    -----
    O(F^1.5 log F) in practice and O(F² log F) at worst. Memory: about a third of the mesh's own
    arrays. Windows are released as soon as they are propagated, unless they are retained.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> field = gc.exact_distance(mesh, 0)
    >>> field.distances.round(3).tolist()
    [0.0, 1.0, 1.0, 1.414]
    >>> gc.exact_distance((mesh.vertices, mesh.faces), 0).distances.round(3).tolist()
    [0.0, 1.0, 1.0, 1.414]
    >>> gc.exact_distance(mesh, [0, gc.Source(3, start_distance=0.25)]).nearest_source.tolist()
    [0, 0, 0, 1]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    question, control = _ask(mesh, sources, targets, max_distance, barriers, control)
    return solve(ExactSweep(question), retain, control)


def approximate_distance(
    mesh: MeshLike | Solver,
    sources: Sources,
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    max_distance: float | None = None,
    targets: Points = (),
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
        Share of the exact distance by which a distance may be too short: above 0 and below 1. None
        for no relative bound; then ``absolute_error`` must be given.
    absolute_error
        The same in mesh units. If both are given, both hold.
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

    Returns
    -------
    DistanceField
        Distances, (V,) float64 in mesh units, and their error bound. It is smaller than allowed
        where more merging would save nothing. On a rough mesh (`TriangleMesh.is_rough`) the
        distances are exact, because that takes less time.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    O(F log F) in practice. docs/accuracy.md explains what is guaranteed, and why.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> field = gc.approximate_distance(mesh, 0, relative_error=0.01)
    >>> field.error_bound
    ErrorBound(type='relative', value=0.002, kind='guaranteed')
    >>> bool(0.99 * 2**0.5 <= field.distances[3] <= 2**0.5)
    True
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    question, control = _ask(mesh, sources, targets, max_distance, barriers, control)
    sweep = sweep_of(question.mesh, "approximate", relative_error, absolute_error)
    return solve(sweep(question), retain, control)


def fast_distance(
    mesh: MeshLike | Solver,
    sources: Sources,
    effort: Effort = 2,
    max_distance: float | None = None,
    targets: Points = (),
    barriers: Iterable[int] = (),
    *,
    retain: Literal["distances", "paths"] = "paths",
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> DistanceField:
    """Return geodesic distances in one quick pass: lengths of paths, never too short.

    Each distance is the length of a path over the surface. It is usually longer than the shortest
    by less than 0.1 % to 1 %. This is not guaranteed: ``error_bound`` is an estimate.

    Parameters
    ----------
    mesh, sources
        As in `exact_distance`.
    effort
        1, 2, 4 or 8: the number of places on each half-edge at which windows are compared. More
        effort takes more time and lowers the error. Where 4 or 8 would take the time of an exact
        sweep, on small and on rough meshes, the sweep is exact; `error_bound` says so.
    max_distance, targets, barriers
        As in `exact_distance`.
    retain
        What the field holds in memory. ``"distances"``: distances and nearest sources. ``"paths"``:
        also what `DistanceField.path_to` and `DistanceField.gradient` need, 36 bytes a vertex.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    DistanceField
        Distances, (V,) float64 in mesh units, and their estimated error. Its isolines, and
        distances inside faces, come from an exact sweep, which runs when they are first needed.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    O(F) in practice. docs/accuracy.md explains how the error was measured.

    Examples
    --------
    >>> mesh = gc.samples.sphere(320)
    >>> field = gc.fast_distance(mesh, 0)
    >>> field.error_bound.kind
    'estimated'
    >>> exact = gc.exact_distance(mesh, 0)
    >>> bool(np.all(field.distances >= exact.distances * (1 - 1e-12)))
    True
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    check_choice("retain", retain, ("distances", "paths"))
    question, control = _ask(mesh, sources, targets, max_distance, barriers, control)
    sweep = sweep_of(question.mesh, "fast", effort=effort)
    return solve(sweep(question), retain, control)


def error_bound(
    mesh: MeshLike,
    method: Method,
    *,
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    effort: Effort = 2,
) -> ErrorBound:
    """Return the error bound of the distances that a method finds on a mesh, without solving.

    `DistanceField.error_bound` is the same. A matrix is an array, which does not have it.

    Parameters
    ----------
    mesh
        The surface, with its barriers: a `TriangleMesh`, or anything else that `as_mesh` takes.
    method
        ``"exact"``, ``"approximate"`` or ``"fast"``, see the solvers of these names.
    relative_error, absolute_error
        Allowed errors of approximate distances, as in `approximate_distance`.
    effort
        Effort of fast distances, as in `fast_distance`.

    Returns
    -------
    ErrorBound
        A share of the exact distance, or mesh units.

    Raises
    ------
    InvalidArgument
        An argument that the method takes is out of its domain.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.error_bound(mesh, "approximate", relative_error=0.01)
    ErrorBound(type='relative', value=0.002, kind='guaranteed')
    >>> gc.error_bound(mesh, "fast", effort=2)
    ErrorBound(type='relative', value=0.01, kind='estimated')
    """
    return promise_of(as_mesh(mesh), method, relative_error, absolute_error, effort)


def shortest_path(
    mesh: MeshLike | Solver,
    source: Point,
    target: Point,
    waypoints: Points = (),
    max_distance: float | None = None,
    *,
    method: Literal["exact", "fast"] = "exact",
    effort: Effort = 1,
    barriers: Iterable[int] = (),
    explain: bool = False,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> GeodesicPath:
    """Return a shortest path between two points of the surface, exact by default (section 5).

    For many paths on one mesh, a `Solver` is faster: its memory is reused, and landmarks narrow
    the search, so that the time of a call does not depend on the size of the mesh.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    source, target
        Vertex indices or `SurfacePoint`.
    waypoints
        Points that the path passes in order; it is shortest from each to the next.
    max_distance
        Largest length of the path past all waypoints, mesh units; None for no limit. The exact
        search ends once it is certain that every path is longer.
    method
        ``"exact"``, or ``"fast"``: a path that is as short as all that lie near it, in a third to
        two thirds of the time. It is usually the shortest; ``error_bound`` estimates its excess.
    effort
        Effort of a fast path: 1, 2, 4 or 8. More takes more time, and hardly lowers the excess.
    barriers
        As in `exact_distance`.
    explain
        Also record the steps of the search, in `GeodesicPath.steps`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    GeodesicPath
        Its points, (K, 3) float64, and its length, mesh units.

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

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> path = gc.shortest_path(mesh, 1, 2)  # across the edge between the triangles
    >>> path.points.tolist()
    [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0]]
    >>> round(path.length, 6)
    1.414214
    >>> gc.shortest_path(mesh, 0, 3, waypoints=[1]).length
    2.0
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    limit = as_limit(max_distance)
    check_choice("method", method, ("exact", "fast"))
    places = as_effort(effort)
    workspace, control = _workspace_of(mesh, barriers, control)
    stops = _as_stops(workspace.mesh, source, target, waypoints, control)
    with workspace.held(control):
        search = workspace.path_search()
        find = search.find if method == "exact" else partial(search.find_fast, effort=places)
        path = _shortest_through(search, partial(find, explain=explain), stops, limit, control)
        if isinstance(mesh, Solver) and mesh._workspace is workspace:  # there may be more paths
            search.add_landmark_if_due(stops[0], replace(control, progress=None))
        return path


def distance_matrix(
    mesh: MeshLike | Solver,
    sources: Points,
    targets: Points | None = None,
    max_distance: float | None = None,
    layout: Layout = "dense",
    *,
    method: Method = "exact",
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    effort: Effort = 2,
    barriers: Iterable[int] = (),
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> Floats | csr_array:
    """Return the geodesic distances from each source to each target, exact by default.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    sources, targets
        N and M vertex indices or `SurfacePoint`; a single one needs no list. Without targets, the
        targets are the sources.
    max_distance
        Limit of the sweeps, mesh units; None for no limit. Points beyond it count as unreachable.
    layout
        ``"dense"`` for an (N, M) array, infinite where unreachable; ``"sparse"`` for a
        `scipy.sparse.csr_array` of the same shape that holds the finite distances, zeros too;
        ``"pairs"`` for an (N,) array of the distances from each source to the target of the same
        index, with as many targets as sources.
    method
        ``"exact"``; ``"approximate"``, within ``relative_error`` and ``absolute_error``; or
        ``"fast"``, with an ``effort``. See the solvers of these names; `error_bound` returns the
        error bound.
    relative_error, absolute_error, effort
        For the method that takes them.
    barriers
        As in `exact_distance`.
    threads
        Largest number of threads; None for one per core that the process may use.
    progress, cancel, deadline_s, memory_limit
        See `Control`; the result counts as memory. Callbacks are called in the caller's thread.

    Returns
    -------
    numpy.ndarray or scipy.sparse.csr_array
        Distances, float64, mesh units, in the shape of the layout.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    One sweep starts from each point of the smaller side and ends at its farthest target. If both
    sides are the same points, half of the work suffices, and the matrix is symmetric to the bit.
    For pairs, a sweep starts from each point that is in many pairs; the other pairs are searched
    for as in `shortest_path`, in one thread. Approximate and fast sweeps do not end at their
    farthest target, and are not replaced by searches. The memory of each thread is a third of the
    mesh's own arrays, or up to two thirds for fast sweeps; that of the searches is two thirds.
    Results do not depend on the number of threads.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

    >>> gc.distance_matrix(mesh, [0, 1], [2, 3]).round(3).tolist()
    [[1.0, 1.414], [1.414, 1.0]]
    >>> gc.distance_matrix(mesh, [0, 1, 3]).round(3).tolist()  # between all of these
    [[0.0, 1.0, 1.414], [1.0, 0.0, 1.0], [1.414, 1.0, 0.0]]
    >>> gc.distance_matrix(mesh, [0, 1], [2, 3], layout="pairs").round(3).tolist()
    [1.0, 1.0]
    >>> gc.distance_matrix(mesh, [0, 1], [1, 2, 3], max_distance=1.0, layout="sparse").nnz
    4
    >>> gc.distance_matrix(mesh, 0, [1, 2, 3], method="fast").round(3).tolist()
    [[1.0, 1.0, 1.414]]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    workspace, control = _workspace_of(mesh, barriers, control)
    sweep = sweep_of(workspace.mesh, method, relative_error, absolute_error, effort)
    with workspace.held(control):
        return find_matrix(
            workspace, sweep, sources, targets, max_distance, layout, threads, control
        )


def nearest(
    mesh: MeshLike | Solver,
    source: Point,
    candidates: Points,
    k: int = 1,
    max_distance: float | None = None,
    *,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> Nearest:
    """Return the ``k`` candidates that are geodesically nearest to a point, exactly.

    For many calls on one mesh, a `Solver` is faster: the time of a call does not depend on the size
    of the mesh.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    source, candidates
        Vertex indices or `SurfacePoint`.
    k
        Number to find, from 1 to the number of candidates. Fewer are returned where fewer can be
        reached.
    max_distance
        Limit, mesh units; None for no limit. Candidates beyond it are left out.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    Nearest
        Indices into the candidates, (n,) int32, and distances, (n,) float64, nearest first.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    Distances that differ by rounding count as equal. The sweep goes no farther than the k-th
    nearest; allocating its state is O(V + F), which a `Solver` does once.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

    >>> gc.nearest(mesh, 0, [3, 2]).indices.tolist()
    [1]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    workspace, control = _workspace_of(mesh, barriers, control)
    with workspace.held(control):
        return find_nearest(workspace, source, candidates, k, max_distance, control)


def kernel_digest() -> str:
    """Return a digest of the kernels' sources: equal digests give answers equal to the bit.

    Returns
    -------
    str
        Hexadecimal; the same for equal sources on every machine.

    Examples
    --------
    >>> gc.kernel_digest() == gc.kernel_digest()
    True
    """
    return sources_digest()


def log_map(
    mesh: MeshLike | Solver,
    source: Point,
    *,
    x_axis: Point | ArrayLike | None = None,
    rescale: bool = True,
    max_distance: float | None = None,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> LogMap:
    """Return the exact logarithmic map: how far every vertex is, and in which direction.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    source
        A vertex index or a `SurfacePoint`: a vertex, a point on an edge or in a face.
    x_axis
        From where angles are measured: a point to look at, by its shortest path; or a vector in
        space, which is projected to the surface. None for the edge that leaves a vertex in its
        lowest face; elsewhere for the direction from corner 0 to corner 1 of the lowest face; and
        at a boundary for where the surface begins.
    rescale
        Whether `LogMap.coordinates` stretch or shrink the angles around the source to a full turn,
        as they do on a cone that becomes a plane. At a boundary they do only where the angles are
        more than that. Without it the coordinates show true angles.
    max_distance
        Limit of the sweep, mesh units; None for no limit. Vertices beyond it count as unreachable.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    LogMap
        Distances, (V,) float64 in mesh units, the same as those of `exact_distance` to the bit; and
        angles, (V,) float64, radians.

    Raises
    ------
    NoTangentPlane
        Several fans of faces meet at the source, or three faces or more at its edge.
    InvalidPoint
        The source is not on the mesh, or no path leads to the point at which the x axis looks.
    NoDirection
        The x axis is zero, or along the normal.
    NotEmbedded
        The x axis is a vector, and the mesh is given by its lengths.
    InvalidArgument
        Another argument is out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    Windows carry the direction through the sweep. On scans it takes a tenth more time than that of
    `exact_distance`; where the source sees most vertices straight, a quarter.
    Behind the first bend of a path all vertices have its direction: see `LogMap`.

    Examples
    --------
    >>> log_map = gc.log_map(gc.samples.plane(2), 0)
    >>> log_map.angles[1:].round(3).tolist()
    [0.0, 1.571, 0.785]
    >>> gc.log_map(gc.samples.plane(2), 0, x_axis=3).coordinates[3].round(3).tolist()
    [1.414, 0.0]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    limit = as_limit(max_distance)
    surface, control = _surface_of(mesh, barriers, control)
    point = unboxed(x_axis)
    targets = [point] if isinstance(point, SurfacePoint) or is_index(point) else []
    start = surface.point(source, "source")
    question = Question.of(surface, start, targets, limit, control)
    return log_map_of(question, control, None if targets else x_axis, rescale=rescale)


def sweep_steps(
    mesh: MeshLike | Solver,
    sources: Sources,
    steps: int = 200,
    barriers: Iterable[int] = (),
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> SweepSteps:
    """Return what the exact sweep does, step by step: windows, front, pseudosources (3.2 to 3.4).

    It is the sweep of `exact_distance` itself, to the bit, stopped between its steps: to teach it,
    to draw it, and to look into it. The first steps are one operation each, a vertex that leaves
    the queue or the windows of one edge that cross a face; later ones are as many as keep the front
    moving evenly.

    Parameters
    ----------
    mesh
        The surface, of at most 5000 faces: a `TriangleMesh`, anything else that `as_mesh` takes, or
        a `Solver`.
    sources
        A vertex index, a `SurfacePoint`, a `Source` with a start distance, or several of these.
    steps
        At most this many, 1 to 1000.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    SweepSteps
        The windows, each with the steps in which it came, crossed a face, and was trimmed away; and
        for each step the distance of the front and the numbers of windows.

    Raises
    ------
    InvalidPoint
        A source is not on the mesh.
    InvalidArgument
        The mesh has more faces, a source is a curve, or another argument is out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    Two sweeps. All windows are in memory: 100 bytes each, of which 5000 faces have 70 000 to
    100 000.

    Examples
    --------
    >>> steps = gc.sweep_steps(gc.samples.plane(8), 0)
    >>> int(steps.waiting[-1])  # at the end none is left in the queue
    0
    >>> at_first = steps.windows.at(1)  # the source has left the queue
    >>> set(at_first.pseudosources.tolist()), set(at_first.sigma.tolist())
    ({0}, {0.0})
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    question, control = _ask(mesh, sources, (), None, barriers, control)
    return follow_sweep(question, steps, control)


def trace(
    mesh: MeshLike | Solver,
    start: Points,
    direction: ArrayLike,
    length: ArrayLike,
    *,
    at_vertices: Literal["straight", "stop"] = "straight",
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> StraightLine | list[StraightLine]:
    """Return the straightest line from a point in a direction: the exponential map.

    On faces and over edges it is straight. Through a vertex it goes with equal angles on both
    sides, half of the sum of the angles there. It ends at the boundary, at barriers and where more
    than two faces meet.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    start
        A vertex index or a `SurfacePoint`, or N of them.
    direction
        An angle, radians, counter-clockwise in the frame of the start as in `log_map`; or a vector
        in space, (3,), which is projected to the surface. For N lines also (N,) or (N, 3).
    length
        Mesh units, 0 or more; for N lines also (N,).
    at_vertices
        ``"straight"``, or ``"stop"`` for lines that end at the first vertex they meet.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    StraightLine or list of StraightLine
        One for a single start, else N: paths that also tell why they end, and in which direction
        they would go on.

    Raises
    ------
    NoTangentPlane
        A start has none, as in `log_map`.
    InvalidPoint
        A start is not on the mesh.
    NoDirection
        A vector is zero, or along the normal.
    NotEmbedded
        A direction is a vector, and the mesh is given by its lengths.
    InvalidArgument
        Numbers of starts, directions and lengths differ, or another argument is out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    O(faces crossed). A line that meets a saddle, or passes it closely, ends far from its neighbour
    on the other side.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> line = gc.trace(mesh, 0, np.pi / 4, 1.0)
    >>> line.points[-1].round(3).tolist(), line.stopped
    ([0.707, 0.707, 0.0], 'length')
    >>> [line.stopped for line in gc.trace(mesh, [0, 3], [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], 2.0)]
    ['boundary', 'boundary']
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    check_choice("at_vertices", at_vertices, ("straight", "stop"))
    surface, control = _surface_of(mesh, barriers, control)
    given = list(control.watched(each_of(start, "start")))
    starts = [surface.point(point, f"start {i}") for i, point in enumerate(control.watched(given))]
    located = locations_of(surface, starts)
    frames = planes_at(surface, located)
    angles = directions_from(surface, located, frames, direction)
    lengths = as_lengths(length, len(starts))
    lines = lines_from(surface, located, frames, angles, lengths, at_vertices == "stop", control)
    return lines if isinstance(start, Iterable) else lines[0]


def cut(
    mesh: MeshLike | Solver,
    curves: Curve | SurfaceCurve | Sequence[Curve | SurfaceCurve],
    separate: bool = True,
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> CutMesh:
    """Return the mesh cut along curves, which then are edges of it.

    Curves may cross, touch and overlap, end anywhere, pass through vertices and run along edges. A
    curve of one point makes that a vertex. Faces that no curve meets stay as they are; each other
    one is triangulated anew, exactly: no face turns over, no vertex lies on an edge of another
    face, and distances on the surface stay the same.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`. Its
        barriers stay blocked.
    curves
        One or more: a `SurfaceCurve` on this mesh, as paths, isolines, borders and boundaries are,
        or a `Curve`.
    separate
        Whether the surface comes apart along the curves: each of their vertices is doubled, once
        for each fan of faces between them. An edge neither of whose ends would be doubled, as of a
        curve of one edge, gets one more vertex in its middle.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    CutMesh
        The new mesh, and where its vertices and faces were on the old one.

    Raises
    ------
    InvalidArgument
        There is no curve, or one is not a curve of this mesh.
    InvalidPoint
        A point of a curve is not on the mesh, or shares no face with the next.
    InvalidMesh
        A curve meets a vertex that an edge of zero length joins to another one.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        The call was stopped; the mesh can still be used.

    Notes
    -----
    O(V + F), and O(n log n) in practice for n new vertices; k curves that all cross in one face
    have k² / 2 crossings there. Points are told apart in steps of 2**-40 of an edge, and what is
    nearer than 2**-30, about 1e-9, is one: a curve that passes a vertex, an edge or another curve
    within this share of an edge runs through it, and moves by as much. Otherwise two curves that
    are close stay two, with thin faces between them. On a surface that is given by lengths, those
    of new edges are found in the faces laid out flat.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> cut = gc.cut(mesh, gc.shortest_path(mesh, 1, 2))
    >>> cut.parts.tolist()
    [0, 1, 1, 0]
    >>> gc.exact_distance(cut.mesh, 0).distances.round(3).tolist()
    [0.0, inf, 1.0, inf, inf, 0.707, 1.0, inf]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface = mesh.mesh if isinstance(mesh, Solver) else as_mesh(mesh)
    given = [curves] if isinstance(curves, Curve | SurfaceCurve) else list(curves)
    if not given:
        raise InvalidArgument("there are no curves: give at least one")
    lines = [as_line(surface, curve, f"curve {i}", control) for i, curve in enumerate(given)]
    return cut_along(surface, lines, control, separate=separate)


def farthest_points(
    mesh: MeshLike | Solver,
    count: int | None = None,
    radius: float | None = None,
    start: Points = 0,
    barriers: Iterable[int] = (),
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> FarthestPoints:
    """Return points spread over the surface: each the vertex farthest from those before it.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    count
        Number of points, those of ``start`` included.
    radius
        Covering radius to reach, mesh units. At least one of the two must be given; the first that
        is reached ends the call.
    start
        The points to begin with: a vertex index or a `SurfacePoint`, or several.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    FarthestPoints
        The points, the covering radius after each, and exact distances from the nearest one. Of
        vertices that are equally far, the lowest comes first. Each part of the surface gets a
        point.

    Raises
    ------
    InvalidArgument
        Neither is given, one is out of its domain, or the mesh has fewer points than ``count``.
    InvalidPoint
        A start is not on the mesh, or lies inside a barrier.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    One sweep over all of the mesh, and for each further point one over the part that is nearer to
    it, plus O(V): some 6 sweeps for 1,000 points of a mesh with 100,000 faces.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> samples = gc.farthest_points(mesh, 5, start=0)
    >>> mesh.vertices[samples.vertices, :2].tolist()
    [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]
    >>> samples.radius.round(3).tolist()
    [1.414, 1.0, 1.0, 0.707, 0.5]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    if count is None and radius is None:
        raise InvalidArgument("neither count nor radius is given: how many points shall there be?")
    if count is not None and not (is_index(count) and count > 0):
        raise InvalidArgument(f"count is {count!r}; it must be a whole number above 0")
    if radius is not None and not (is_number(radius) and radius >= 0.0):
        raise InvalidArgument(f"radius is {radius!r}; it must be a number, 0 or more")
    surface, control = _surface_of(mesh, barriers, control)
    points = as_points(surface, start, "start", control)
    question = Question.of(surface, points, (), math.inf, control)
    most, least = math.inf if count is None else count, -1.0 if radius is None else radius
    return spread_points(question, most, least, control)


def relax_points(
    mesh: MeshLike | Solver,
    points: Points,
    iterations: int = 20,
    density: ArrayLike | None = None,
    barriers: Iterable[int] = (),
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> RelaxedPoints:
    """Return points spread evenly, by Lloyd's method: each in the middle of its own cell.

    In each iteration every point moves straight to the centroid of what is nearest to it, in its
    log map; by less, where the sum of squared distances would rise.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    points
        Where they begin: one or more vertex indices or `SurfacePoint`; `farthest_points` finds good
        ones.
    iterations
        How often they move, at most; fewer if they converge.
    density
        (V,) numbers, 0 or more, at the vertices: where it is high, points come to lie closer. None
        for the same everywhere.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    RelaxedPoints
        The points, and the cost after each iteration, which never rises.

    Raises
    ------
    NoTangentPlane
        A point has none, as in `log_map`.
    InvalidPoint
        A point is not on the mesh.
    InvalidArgument
        Another argument is out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    A sweep for each iteration, and one more for each time that a move is halved. Distances are
    exact. The surface counts at its vertices, by a third of the area of their faces: so cells
    should have many vertices.

    Examples
    --------
    >>> mesh = gc.samples.plane(2000)  # the unit square
    >>> relaxed = gc.relax_points(mesh, gc.farthest_points(mesh, 5).points)
    >>> bool(relaxed.costs[-1] < relaxed.costs[0])
    True
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    if not (is_index(iterations) and iterations >= 0):
        raise InvalidArgument(f"iterations is {iterations!r}; it must be a whole number, 0 or more")
    surface, control = _surface_of(mesh, barriers, control)
    starts = tuple(as_points(surface, points, "point", control))
    mass = as_nonnegative("density", 1.0 if density is None else density, len(surface.vertices))
    return relaxed_points(surface, starts, iterations, mass, control)


def mean_point(
    mesh: MeshLike | Solver,
    points: Points,
    weights: ArrayLike | None = None,
    barriers: Iterable[int] = (),
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> MeanPoint:
    """Return the mean of points on a surface: where squared distances from them sum to the least.

    It is also called their Karcher or Fréchet mean. The search begins at the best vertex, so that
    it seldom ends in a place that is only better than all around it.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    points
        One or more vertex indices or `SurfacePoint`.
    weights
        (N,) numbers, 0 or more, of which one is above 0. None for the same for all.
    barriers
        As in `exact_distance`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    MeanPoint
        The point, the variance, and whether the search came to its end.

    Raises
    ------
    NoPath
        The points are in different parts of the surface.
    NoTangentPlane
        The search meets a point that has none, as in `log_map`.
    InvalidPoint
        A point is not on the mesh.
    InvalidArgument
        The weights are out of their domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    One sweep for each point, and one for each place that the search tries.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square
    >>> mean = gc.mean_point(mesh, [0, 3], weights=[3.0, 1.0])
    >>> mesh.position(mean.point).round(6).tolist()
    [0.25, 0.25, 0.0]
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, control = _surface_of(mesh, barriers, control)
    places = tuple(as_points(surface, points, "point", control))
    shares = as_nonnegative("weights", 1.0 if weights is None else weights, len(places))
    if not shares.sum() > 0.0:
        raise InvalidArgument("weights are all 0: one must be above 0")
    return find_mean(surface, places, shares / shares.sum(), control)


def straighten(
    curve: SurfaceCurve,
    *,
    free_ends: bool = False,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> SurfaceCurve:
    """Return a curve pulled tight: the shortest of those into which it can be moved, near it.

    Its ends stay, unless they are free. It is straight but for bends at vertices and at the
    boundary, where neither side leaves it less than half a turn. Where the faces that it crosses
    and those that share a vertex with one form a disc, it is the shortest on them; a curve on the
    other side of a hill may still be shorter.

    Parameters
    ----------
    curve
        A path, a straight line, a line of equal value, a border, a boundary, a loop, or any other
        one, made by `TriangleMesh.curve`.
    free_ends
        Whether ends on the boundary slide along it, to where the curve is shortest. Others stay.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    SurfaceCurve
        Never longer, rounding aside; closed if the curve is. Its bends are vertices, exactly. It
        stays off barriers of the curve's mesh. Where more than two faces meet at an edge, or the
        faces of a vertex form several fans, it passes where the curve does; so it does where a
        one-sided surface is joined to its other side.

    Raises
    ------
    NoLoop
        The curve is closed, or its ends are free, and it shrinks to a point.
    InvalidArgument
        The curve was resampled, or is a copy without its mesh; or its ends are to be free, and none
        is on the boundary.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        The call was stopped.

    Notes
    -----
    O(faces crossed) for each vertex that the curve moves past, and an exact sweep of the faces
    beside it. 400 faces take about ten milliseconds.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> bent = gc.shortest_path(mesh, 0, 120, waypoints=[10])
    >>> round(bent.length, 6), round(gc.straighten(bent).length, 6)
    (2.0, 1.414214)
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    tight = shortest_nearby(curve, control, free_ends=free_ends)
    control.checkpoint(1.0)
    return tight


def shortest_loop(
    mesh: MeshLike | Solver,
    through: Point,
    *,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> SurfaceCurve:
    """Return the shortest closed curve through a point that cannot be shrunk to a point.

    It runs around a hole or a handle, or between parts of the surface each of which has one.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    through
        A vertex index or a `SurfacePoint`.
    barriers
        As in `exact_distance`: faces that count as holes.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    SurfaceCurve
        It begins at the point; the shortest of all, not only of those near it. `straighten` takes
        the bend out that it may have there.

    Raises
    ------
    NoLoop
        On this part of the surface every loop shrinks to a point.
    InvalidMesh
        The mesh is no surface with two sides.
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    Exact sweeps over the universal cover, up to the length of the loop: of copies of the surface,
    as many as lie that near. It takes some ten sweeps where there is one handle, more where there
    are many.

    Examples
    --------
    >>> plate = gc.samples.obstacles(2000)  # with holes
    >>> loop = gc.shortest_loop(plate, through=0)
    >>> loop.closed, round(loop.length, 3)
    (True, 4.946)
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, control = _surface_of(mesh, barriers, control)
    loop = shortest_loop_through(surface, surface.point(through, "through"), control)
    control.checkpoint(1.0)
    return loop


def handle_loops(
    mesh: MeshLike | Solver,
    *,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> list[SurfaceCurve]:
    """Return two loops for each handle of a surface, such as one around it and one along it.

    Cut along all of them, no handle is left. None of them can be moved into others, nor into what
    these make up together. Which of the two goes around the handle and which along it is a question
    of the space around the surface, and not told.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    barriers
        As in `exact_distance`. Holes are no handles.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    list of SurfaceCurve
        Closed, as short as those near them; the shortest first. Empty where there is no handle.

    Raises
    ------
    InvalidMesh
        The mesh is no surface with two sides.
    InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    A few exact sweeps.

    Examples
    --------
    >>> knot = gc.samples.knot(2000)
    >>> [round(loop.length, 1) for loop in gc.handle_loops(knot)]
    [2.8, 25.7]
    >>> gc.handle_loops(gc.samples.sphere(320))
    []
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, control = _surface_of(mesh, barriers, control)
    loops = handle_loops_of(surface, control)
    control.checkpoint(1.0)
    return loops


def paths_around(
    mesh: MeshLike | Solver,
    source: Point,
    target: Point,
    obstacle: Point | SurfaceCurve | Iterable[int],
    *,
    barriers: Iterable[int] = (),
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> tuple[GeodesicPath, GeodesicPath]:
    """Return the shortest path on each side of an obstacle: left of it, and right.

    The sides are told by the shortest line of edges from the obstacle to the outside: the longest
    other boundary, or where there is none the vertex farthest from all three. Of the paths that
    cross it an even number of times, and of those that cross it an odd number, the shortest is
    returned. Each is exact, among all such paths, and may pass other holes on any side.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    source, target
        Vertex indices or `SurfacePoint`.
    obstacle
        A hole, as a curve of `TriangleMesh.boundaries`; a barrier, as the ids of its faces, which
        are to be connected; or a vertex, on which the paths may touch.
    barriers
        As in `exact_distance`: further faces that count as holes.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    tuple of GeodesicPath
        The path that has the obstacle on its right, and the one that has it on its left.

    Raises
    ------
    NoPath
        The points are not connected, or on one side of the obstacle only.
    InvalidMesh
        The mesh is no surface with two sides.
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `shortest_path`.

    Notes
    -----
    Two searches as that of `shortest_path`, on a mesh of twice as many faces.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> left, right = gc.paths_around(mesh, 55, 65, obstacle=range(86, 94))
    >>> round(left.length, 3), round(right.length, 3)
    (1.086, 1.086)
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, control = _surface_of(mesh, barriers, control)
    wide, place = surface, unboxed(obstacle)
    if isinstance(place, SurfacePoint) or is_index(place):
        place = surface.point(place, "obstacle")
    elif not isinstance(place, SurfaceCurve):
        surface, control = with_barriers(surface, place, control)
        place = None
    ends = surface.point(source, "source"), surface.point(target, "target")
    paths = paths_on_both_sides(surface, *ends, obstacle_of(surface, wide, place), control)
    control.checkpoint(1.0)
    return paths


def cost_distance(
    mesh: MeshLike | Solver,
    sources: Sources,
    cost: Cost,
    max_cost: float | None = None,
    barriers: Iterable[int] = (),
    *,
    direction: Direction = "from",
    detail: Detail = "default",
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> CostField:
    """Return what it costs to get from the nearest source to every vertex, where ways cost.

    The cost of a path is the sum of its lengths in faces, each times the cost of the face; or times
    a cost by slope in the direction of travel; or both. Each value is that of a path over the
    surface, so never below the cheapest, and a little above it.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    sources
        As in `exact_distance`; a `Source` starts at a cost, which is added.
    cost
        (F,) what a unit of length costs in each face, above 0; infinite where no path may go. Or a
        `SlopeCost`. Or a pair of both, whose product counts. Along an edge that of its cheaper face
        counts.
    max_cost
        Limit of the sweep; None for no limit. Vertices beyond it count as unreachable.
    barriers
        Ids of faces where no path may go either.
    direction
        ``"from"`` the sources, or ``"to"`` them: with costs by slope these differ.
    detail
        ``"default"``, or ``"fine"``: twice the time, a third of the error.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    CostField
        Costs, (V,) float64, with paths, and an estimate of their error.

    Raises
    ------
    InvalidPoint
        A source is not on the mesh, or in no face that a path may enter.
    InvalidArgument
        A cost is 0, negative or NaN, or another argument is out of its domain.
    NotEmbedded
        Slopes count, and the mesh has lengths alone.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    O(F log F): Dijkstra's search over the vertices and over points on the edges, with each path
    bent by Snell's law behind the last edge. Two to three exact sweeps by default, up to six where
    slopes count. Where costs are equal everywhere, `exact_distance` is exact, and faster.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> gc.cost_distance(mesh, 0, [1.0, 3.0]).costs.round(3).tolist()
    [0.0, 1.0, 2.707, 1.414]
    >>> hill = gc.TriangleMesh([[0, 0, 0], [1, 0, 0.1], [0, 1, 0]], [[0, 1, 2]])
    >>> walk = gc.SlopeCost("tobler")
    >>> round(float(gc.cost_distance(hill, 0, walk)[1]), 2)  # seconds, up
    1.01
    >>> round(float(gc.cost_distance(hill, 0, walk, direction="to")[1]), 2)  # down
    0.71
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, costs = _costs_of(mesh, cost, barriers)
    limit = as_limit(max_cost, "max_cost")
    check_choice("direction", direction, get_args(Direction))
    check_choice("detail", detail, get_args(Detail))
    given, lines = as_sources(surface, sources, control)
    return find_costs(surface, costs, given, lines, limit, direction, detail, control)


def cheapest_path(
    mesh: MeshLike | Solver,
    source: Point,
    target: Point,
    cost: Cost,
    max_cost: float | None = None,
    *,
    barriers: Iterable[int] = (),
    detail: Detail = "default",
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> CheapestPath:
    """Return the cheapest path from one point of the surface to another, where ways cost.

    It bends where costs change, as light does by Snell's law, runs along roads, and goes around
    what is closed.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, anything else that `as_mesh` takes, or a `Solver`.
    source, target
        Vertex indices or `SurfacePoint`.
    cost
        As in `cost_distance`.
    max_cost
        What the path may cost at most; None for no limit.
    barriers
        Ids of faces where no path may go either.
    detail
        ``"default"``, or ``"fine"``: twice the time, a tenth of the error. Straightening leaves
        little of either where costs are by face.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    CheapestPath
        Its points, its length, its cost, and an estimate of by how much another path may be
        cheaper. With costs by slope the way back may run elsewhere: ask for it.

    Raises
    ------
    NoPath
        The points are not connected, or the path costs more than ``max_cost``.
    InvalidPoint, InvalidArgument, NotEmbedded
        As in `cost_distance`.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.

    Notes
    -----
    A sweep as that of `cost_distance`, directed to the target; then the crossings of edges are
    moved to where the path is cheapest, by Newton's method.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> path = gc.cheapest_path(mesh, 1, 2, [1.0, 2.0])
    >>> path.points.round(3).tolist(), round(path.cost, 3)
    ([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0]], 2.121)
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    surface, costs = _costs_of(mesh, cost, barriers)
    limit = as_limit(max_cost, "max_cost")
    check_choice("detail", detail, get_args(Detail))
    ends = surface.point(source, "source"), surface.point(target, "target")
    path = find_cheapest_path(surface, costs, *ends, detail, limit, control)
    control.finish()
    return path


class Solver:
    """Solvers of one mesh that reuse memory and landmarks from call to call.

    Paths need scratch memory, about two thirds of the mesh's own arrays, and get faster with
    landmarks, which are added as searches go on (64 bytes a vertex). Matrices and nearest
    candidates need a third. Threads may share a solver: calls that use its memory wait for each
    other. A call with barriers does without both; for several with the same ones, make a solver of
    `TriangleMesh.with_barriers`.

    Parameters
    ----------
    mesh
        The surface of all calls: a `TriangleMesh`, or anything else that `as_mesh` takes.
        ``solver.mesh`` is the `TriangleMesh`.

    Examples
    --------
    >>> solver = gc.Solver(gc.samples.plane(2))
    >>> [round(solver.shortest_path(0, target).length, 3) for target in (1, 2, 3)]
    [1.0, 1.0, 1.414]
    """

    def __init__(self, mesh: MeshLike) -> None:
        self._workspace = Workspace(as_mesh(mesh))

    @property
    def mesh(self) -> TriangleMesh:
        """The surface of all calls."""
        return self._workspace.mesh

    def __reduce__(self) -> tuple[type[Solver], tuple[TriangleMesh]]:
        """Copy and pickle the mesh alone: memory and landmarks are found again."""
        return Solver, (self.mesh,)

    def __repr__(self) -> str:
        return f"Solver({self.mesh!r})"

    @property
    def nbytes(self) -> int:
        """Memory held between calls, bytes, without the mesh."""
        return self._workspace.nbytes

    # The functions above, which take a solver in place of a mesh.
    exact_distance = exact_distance
    approximate_distance = approximate_distance
    fast_distance = fast_distance
    shortest_path = shortest_path
    distance_matrix = distance_matrix
    nearest = nearest
    log_map = log_map
    sweep_steps = sweep_steps
    trace = trace
    cut = cut
    farthest_points = farthest_points
    relax_points = relax_points
    mean_point = mean_point
    shortest_loop = shortest_loop
    handle_loops = handle_loops
    paths_around = paths_around
    cost_distance = cost_distance
    cheapest_path = cheapest_path


def _surface_of(
    mesh: MeshLike | Solver, barriers: Iterable[int], control: Control
) -> tuple[TriangleMesh, Control]:
    """Return the mesh of a call with its barriers, and a control that counts their memory."""
    surface = mesh.mesh if isinstance(mesh, Solver) else as_mesh(mesh)
    return with_barriers(surface, barriers, control)


def _costs_of(
    mesh: MeshLike | Solver, cost: Cost, barriers: Iterable[int]
) -> tuple[TriangleMesh, SurfaceCosts]:
    """Return the mesh of a call and its costs, with infinite ones at its barriers."""
    surface = mesh.mesh if isinstance(mesh, Solver) else as_mesh(mesh)
    return surface, SurfaceCosts.of(surface, cost, as_barriers(barriers, len(surface.faces)))


def _workspace_of(
    mesh: MeshLike | Solver, barriers: Iterable[int], control: Control
) -> tuple[Workspace, Control]:
    """Return the workspace of a call: that of its solver, unless the call has barriers."""
    surface, control = _surface_of(mesh, barriers, control)
    if isinstance(mesh, Solver) and mesh.mesh is surface:
        return mesh._workspace, control
    return Workspace(surface), control


def _shortest_through(
    search: PathSearch,
    find: Callable[..., GeodesicPath],
    stops: Sequence[SurfacePoint],
    limit: float,
    control: Control,
) -> GeodesicPath:
    """Search for leg after leg, each no longer than the others leave of the limit."""
    legs: list[GeodesicPath] = []
    positions = np.array([search.mesh.position_for_bounds(stop) for stop in control.watched(stops)])
    left = limit if len(stops) == 2 else limit * (1.0 + AT_LIMIT)  # sums of legs round
    for here, there in pairwise(stops):
        leg_control = control.for_part(len(legs), len(stops) - 1)
        if legs:
            search.add_landmark_if_due(here, replace(control, progress=None))
        rest = length_of(positions[len(legs) + 1 :])
        try:
            leg = find(here, there, leg_control, limit=left - rest)
        except NoPath:
            raise NoPath(
                f"the path from {stops[0]} to {stops[-1]} is longer than max_distance = {limit:g}",
                "beyond_max_distance",
            ) from None
        left -= leg.length
        legs.append(leg)
    control.finish()
    return legs[0] if len(legs) == 1 else joined(legs)


def _ask(
    mesh: MeshLike | Solver,
    sources: Sources,
    targets: Points,
    max_distance: float | None,
    barriers: Iterable[int],
    control: Control,
) -> tuple[Question, Control]:
    """Return the question of a call, and a control that counts the memory of its barriers."""
    limit = as_limit(max_distance)
    surface, control = _surface_of(mesh, barriers, control)
    return Question.of(surface, sources, targets, limit, control), control


def _as_stops(
    mesh: TriangleMesh,
    source: Point,
    target: Point,
    waypoints: Points,
    control: Control,
) -> list[SurfacePoint]:
    """Return the stops of a path, which must be connected."""
    stops = [mesh.point(source, "source")]
    stops += [
        mesh.point(point, f"waypoint {i}")
        for i, point in enumerate(control.watched(each_of(waypoints, "waypoint")))
    ]
    stops.append(mesh.point(target, "target"))
    for here, there in control.watched(pairwise(stops)):
        if component_of(mesh, here) != component_of(mesh, there):
            message = f"{here} and {there} are in different connected components"
            raise disconnected(mesh, message, here, there)
    return stops
