"""The solvers: arguments in, sweep, results out; status codes become exceptions here."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InvalidArgument,
    InvalidPoint,
    MemoryLimitExceeded,
    NotConverged,
)
from geodesic_core.kernels import sweep, wavefront
from geodesic_core.kernels.backtrace import Winners
from geodesic_core.kernels.propagate import MERGES_FULL, POOL_FULL, RUNAWAY, SCRATCH_FULL
from geodesic_core.kernels.topology import HEAD, TAIL, Topology
from geodesic_core.kernels.wavefront import Bounds, Wavefront
from geodesic_core.mesh import TriangleMesh
from geodesic_core.result import (
    EXACT,
    DistanceField,
    ErrorBound,
    GeodesicPath,
    Source,
    Sources,
    SweepStats,
    vertex_of,
)
from geodesic_core.surface_point import SurfacePoint
from geodesic_core.tolerances import RUNS, WIDEST_ERROR

SLICE_SECONDS = 0.05
"""About how long the sweep runs before it looks up: what cancelling takes, at most."""

_FIRST_BUDGET = 1_000_000


@dataclass(frozen=True)
class Control:
    """How a caller watches a sweep and stops it."""

    progress: Callable[[float], None] | None = None
    """Called about every 50 ms with the share that is done, from 0 to 1, never decreasing."""
    cancel: Callable[[], bool] | None = None
    """Asked about every 50 ms; the sweep stops once it answers true."""
    deadline_s: float | None = None
    """Seconds granted, from the call."""
    memory_limit: int | None = None
    """Bytes granted for the state of the sweep, the mesh itself not counted."""


def exact_distance(
    mesh: TriangleMesh,
    sources: Sources,
    max_distance: float | None = None,
    *,
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
        A vertex index, a `SurfacePoint`, a `Source` with a start distance, or several of these.
    max_distance
        Vertices farther than this (mesh units) are not looked for; they count as unreachable.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Raises
    ------
    InvalidPoint, InvalidArgument
        A source that is not on the mesh; a limit out of its domain.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        The sweep was stopped; the mesh is as good as before.

    Notes
    -----
    O(F^1.5 log F) in practice and O(F² log F) at worst. Memory: about a third of the mesh's own
    arrays, since windows are given back as soon as they are propagated.
    """
    control = Control(progress, cancel, deadline_s, memory_limit)
    bounds = wavefront.exact_bounds(_as_limit(max_distance))
    return _solve(mesh, sources, bounds, EXACT, control, keeps=True)


def approximate_distance(
    mesh: TriangleMesh,
    sources: Sources,
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    max_distance: float | None = None,
    *,
    keep_windows: bool = False,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> DistanceField:
    """Return geodesic distances that are too short by a bounded error, never too long (section 4).

    Parameters
    ----------
    mesh, sources, max_distance
        As in `exact_distance`.
    relative_error
        Share of the exact distance by which a distance may fall short: above 0 and below 1. None
        for no such bound, if there is an absolute one.
    absolute_error
        The same in mesh units. Where both are given, both hold.
    keep_windows
        Keep what `DistanceField.path_to` needs, at most about as much as the mesh's own arrays.
        Else the first path runs the sweep again.
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
    limit = _as_limit(max_distance)
    bounds = wavefront.merging_bounds(limit, min(relative, WIDEST_ERROR), absolute)
    if math.isfinite(relative):
        promise = ErrorBound("relative", relative, "guaranteed")
    else:
        promise = ErrorBound("absolute", absolute, "guaranteed")
    return _solve(mesh, sources, bounds, promise, control, keeps=keep_windows)


def shortest_path(
    mesh: TriangleMesh,
    source: int | SurfacePoint,
    target: int | SurfacePoint,
    *,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> GeodesicPath:
    """Return an exact shortest path between two vertices (sections 3 and 3.5).

    Raises
    ------
    NoPath
        The two are not connected.
    InvalidPoint, InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`, whose parameters these are.
    """
    vertex_of(mesh, target, "target")
    field = exact_distance(
        mesh,
        source,
        progress=progress,
        cancel=cancel,
        deadline_s=deadline_s,
        memory_limit=memory_limit,
    )
    return field.path_to(target)


def warm_up() -> None:
    """Compile all kernels, or load them from the cache on disk (about 10 s, or 0.1 s)."""
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    mesh = TriangleMesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    exact_distance(mesh, 0).path_to(3)
    approximate_distance(mesh, 0, keep_windows=True).path_to(3)
    mesh.report  # noqa: B018 - computed on access


def _solve(
    mesh: TriangleMesh,
    sources: Sources,
    bounds: Bounds,
    promise: ErrorBound,
    control: Control,
    *,
    keeps: bool,
) -> DistanceField:
    """Check the arguments, sweep, and make the result; without ``keeps``, none for backtracing."""
    began = time.perf_counter()
    _check_control(control)
    starts = _as_sources(mesh, sources)
    wave = _sweep(mesh, starts, bounds, control, began, keeps=keeps)
    wave.distance[wave.distance > bounds.max_distance] = math.inf
    winners = _winners_of(wave)
    inner = mesh.topology.inner_vertex
    return DistanceField(
        mesh=mesh,
        sources=starts,
        max_distance=bounds.max_distance,
        distances=wave.distance[inner],
        nearest_source=winners.nearest[inner],
        error_bound=promise,
        stats=_stats(mesh, wave, time.perf_counter() - began),
        _winners=winners if keeps else None,
        _find_winners=partial(_find_winners, mesh, starts, bounds),
    )


def _find_winners(mesh: TriangleMesh, starts: tuple[Source, ...], bounds: Bounds) -> Winners:
    """Sweep again, and keep what backtracing needs: sweeps are the same to the bit."""
    wave = _sweep(mesh, starts, bounds, Control(), time.perf_counter(), keeps=True)
    return _winners_of(wave)


def _winners_of(wave: Wavefront) -> Winners:
    count = wave.counters[wavefront.MERGES]
    return Winners(
        nearest=sweep.nearest_sources(wave.distance, wave.winner_ints, wave.origin),
        distance=wave.distance,
        winner=wave.winner,
        winner_ints=wave.winner_ints,
        reference=wave.reference,
        merges=wave.merges[:count].copy(),
        merge_ints=wave.merge_ints[:count].copy(),
    )


def _sweep(
    mesh: TriangleMesh,
    starts: tuple[Source, ...],
    bounds: Bounds,
    control: Control,
    began: float,
    *,
    keeps: bool,
) -> Wavefront:
    vertices = np.array([vertex_of(mesh, start.point, "source") for start in starts], np.int64)
    distances = np.array([start.start_distance for start in starts])
    merges = bool(bounds.merging)
    wave = wavefront.new_wavefront(mesh.topology, merges=merges, paths=merges and keeps)
    _check_memory(wavefront.bytes_of(wave), control)
    inner = mesh.topology.inner_vertex[vertices]
    sweep.start_sweep(mesh.topology, wave, inner, distances, bounds)
    return _run(mesh, wave, bounds, vertices, control, began)


def _run(
    mesh: TriangleMesh,
    wave: Wavefront,
    bounds: Bounds,
    vertices: Any,
    control: Control,
    began: float,
) -> Wavefront:
    """Run the sweep to its end, slice by slice."""
    topology: Topology = mesh.topology
    reachable = int(np.isin(mesh.components, mesh.components[vertices]).sum())
    budget, shown, outcome = _FIRST_BUDGET, 0.0, sweep.RUNNING
    while outcome != sweep.FINISHED:
        share = _share_done(wave, reachable, bounds.max_distance)
        if control.progress is not None:
            shown = max(shown, share)
            control.progress(shown)
        if control.cancel is not None and control.cancel():
            raise Cancelled(f"cancelled with {share:.0%} done")
        if control.deadline_s is not None and time.perf_counter() - began > control.deadline_s:
            raise DeadlineExceeded(
                f"not finished within {control.deadline_s:g} s: {share:.0%} done"
            )
        slice_began = time.perf_counter()
        outcome = sweep.advance(topology, wave, bounds, budget)
        took = time.perf_counter() - slice_began
        if outcome == POOL_FULL:
            _check_memory(wavefront.bytes_of(wave) + wave.windows.nbytes, control)
            wave = wavefront.with_larger_pool(wave)
        elif outcome == SCRATCH_FULL:
            _check_memory(wavefront.bytes_of(wave) + wave.scratch.nbytes, control)
            wave = wavefront.with_larger_scratch(wave)
        elif outcome == MERGES_FULL:
            _check_memory(wavefront.bytes_of(wave) + wave.merges.nbytes, control)
            wave = wavefront.with_more_merges(wave)
        elif outcome == RUNAWAY:
            raise _not_converged(mesh, wave)
        elif outcome == sweep.RUNNING:
            budget = int(budget * min(max(SLICE_SECONDS / took, 0.5), 2.0))
    if control.progress is not None:
        control.progress(1.0)
    return wave


def _not_converged(mesh: TriangleMesh, wave: Wavefront) -> NotConverged:
    half_edge = int(np.argmax(wave.runs))
    ends = mesh.topology.links[half_edge, [TAIL, HEAD]]
    u, v = mesh.topology.outer_vertex[ends]
    return NotConverged(
        f"the windows of the edge between vertices {u} and {v} came up more than {RUNS} times; "
        f"ask for a smaller error, or for exact distances"
    )


def _share_done(wave: Wavefront, reachable: int, limit: float) -> float:
    """Return the share of the sweep that is done: vertices, or distance where it is limited."""
    share = float(wave.counters[wavefront.DONE_VERTICES]) / reachable
    if math.isfinite(limit) and wave.counters[0] > 0:
        share = max(share, float(wave.distance[wave.heap[0]]) / limit if limit else 1.0)
    return min(share, 1.0)


def _stats(mesh: TriangleMesh, wave: Wavefront, seconds: float) -> SweepStats:
    created = int(wave.counters[wavefront.CREATED])
    kept = int(wave.counters[wavefront.KEPT])
    return SweepStats(
        windows_created=created,
        windows_kept=kept,
        windows_peak=int(wave.counters[wavefront.PEAK]),
        windows_per_edge_created=created / mesh.edge_count,
        windows_per_edge_kept=kept / mesh.edge_count,
        peak_bytes=wavefront.bytes_of(wave),
        seconds=seconds,
    )


def _as_limit(max_distance: float | None) -> float:
    if max_distance is None:
        return math.inf
    if not _is_number(max_distance) or not max_distance >= 0.0:
        raise InvalidArgument(f"max_distance is {max_distance!r}; it must be a number, 0 or more")
    return float(max_distance)


def _as_errors(relative: float | None, absolute: float | None) -> tuple[float, float]:
    if relative is None and absolute is None:
        raise InvalidArgument("relative_error and absolute_error are both None; give at least one")
    if relative is not None and not (_is_number(relative) and 0.0 < relative < 1.0):
        raise InvalidArgument(
            f"relative_error is {relative!r}; it must be a number above 0 and below 1"
        )
    if absolute is not None and not (
        _is_number(absolute) and absolute > 0.0 and math.isfinite(absolute)
    ):
        raise InvalidArgument(f"absolute_error is {absolute!r}; it must be a finite number above 0")
    return (
        math.inf if relative is None else float(relative),
        math.inf if absolute is None else float(absolute),
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _as_sources(mesh: TriangleMesh, sources: Any) -> tuple[Source, ...]:
    if isinstance(sources, str | bytes):
        raise InvalidPoint(f"the source is {sources!r}; it must be a vertex index or a Source")
    if isinstance(sources, Source | SurfacePoint) or not isinstance(sources, Iterable):
        sources = [sources]
    found = []
    for i, item in enumerate(sources):
        source = item if isinstance(item, Source) else Source(item)
        vertex_of(mesh, source.point, f"source {i}")
        start = source.start_distance
        if not _is_number(start) or not (math.isfinite(start) and start >= 0.0):
            raise InvalidArgument(
                f"source {i} starts at {start!r}; it must be a finite number, 0 or more"
            )
        found.append(source)
    if not found:
        raise InvalidPoint("there are no sources: give at least one")
    return tuple(found)


def _check_control(control: Control) -> None:
    for name in ("deadline_s", "memory_limit"):
        value = getattr(control, name)
        if value is not None and (not _is_number(value) or not value > 0):
            raise InvalidArgument(f"{name} is {value!r}; it must be a number above 0")


def _check_memory(needed: int, control: Control) -> None:
    if control.memory_limit is not None and needed > control.memory_limit:
        raise MemoryLimitExceeded(
            f"the sweep needs {needed} bytes or more; memory_limit is {control.memory_limit}"
        )
