"""From a validated query to its answer: the only place of the service that calls the solvers."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import Answer
from app.mesh_store import OpenMesh
from app.queries import DistancesQuery, PathQuery, Query


def answer(
    query: Query, opened: OpenMesh, *, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    """Answer ``query`` on an open mesh; stops with ``Cancelled`` once ``cancel`` says so."""
    match query:
        case DistancesQuery():
            return _distances(query, opened, cancel, memory_limit)
        case PathQuery():
            return _path(query, opened, cancel, memory_limit)


def _distances(
    query: DistancesQuery, opened: OpenMesh, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    mesh, solver = opened.mesh, opened.solver
    sources = [gc.Source(source.vertex, source.start_distance) for source in query.sources]
    if query.approximation is None:
        field = solver.exact_distance(
            sources, query.max_distance, cancel=cancel, memory_limit=memory_limit
        )
    else:
        field = solver.approximate_distance(
            sources,
            **asdict(query.approximation),
            max_distance=query.max_distance,
            cancel=cancel,
            memory_limit=memory_limit,
        )
    asked = slice(None) if query.targets is None else np.array(query.targets)
    distances = field.distances[asked]
    members: dict[str, Any] = {
        "mesh_id": query.mesh_id,
        **_method(query),
        "error_bound": _error_bound(field.error_bound),
        "sources": [
            _point(mesh, source.vertex) | {"start_distance": source.start_distance}
            for source in query.sources
        ],
        "distances": distances,
        "unreachable": _unreachable(query, mesh, distances, asked),
        "stats": _stats(field.stats),
        "warnings": opened.warnings,
    }
    if query.nearest_source:
        nearest = field.nearest_source[asked]
        members["nearest_source"] = [None if i < 0 else i for i in nearest.tolist()]
    return Answer(members, "distances")


def _path(
    query: PathQuery, opened: OpenMesh, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    mesh = opened.mesh
    members: dict[str, Any] = {
        "mesh_id": query.mesh_id,
        **_method(query),
        "source": _point(mesh, query.source),
        "target": _point(mesh, query.target),
        "waypoints": [_point(mesh, vertex) for vertex in query.waypoints],
        "warnings": opened.warnings,
    }
    try:
        path = _find_path(query, opened.solver, cancel, memory_limit)
    except gc.errors.NoPath as error:
        nothing = {"status": "no_path", "reason": error.reason, "points": None}
        return Answer(members | nothing | {"error_bound": _CERTAIN}, "points")
    found: dict[str, Any] = {
        "status": "ok",
        "length": path.length,
        "points": path.points,
        "locations": [
            {"face": location.face_index, "barycentric": location.barycentric}
            for location in path.locations
        ],
        "faces": path.faces,
        "error_bound": _error_bound(path.error_bound),
    }
    values = 8 * len(path.points)
    if path.steps is not None:
        found["steps"] = path.steps
        values += sum(step.faces.size for step in path.steps)
    return Answer(members | found, "points", values)


def _find_path(
    query: PathQuery, solver: gc.Solver, cancel: Callable[[], bool], memory_limit: int
) -> gc.GeodesicPath:
    if query.approximation is None:
        return solver.shortest_path(
            query.source,
            query.target,
            query.waypoints,
            explain=query.explain,
            cancel=cancel,
            memory_limit=memory_limit,
        )
    field = solver.approximate_distance(
        query.source,
        **asdict(query.approximation),
        keep_windows=True,
        cancel=cancel,
        memory_limit=memory_limit,
    )
    return field.path_to(query.target)


# That there is no path is known without error, by any method.
_CERTAIN = {"type": "relative", "value": 0.0, "kind": "guaranteed"}


def _method(query: Query) -> Mapping[str, Any]:
    exact = query.approximation is None
    return {"method": "exact" if exact else "approximate", "exact": exact}


def _error_bound(bound: gc.ErrorBound) -> Mapping[str, Any]:
    return {"type": bound.type, "value": bound.value, "kind": bound.kind}


def _stats(stats: gc.SweepStats) -> Mapping[str, Any]:
    # An answer is the same in every run; the seconds are in `Server-Timing`.
    return {name: value for name, value in stats.as_dict().items() if name != "seconds"}


def _point(mesh: gc.TriangleMesh, vertex: int) -> dict[str, Any]:
    return {"vertex": vertex, "position": mesh.vertices[vertex].tolist()}


def _unreachable(
    query: DistancesQuery, mesh: gc.TriangleMesh, distances: NDArray[np.float64], asked: Any
) -> Mapping[str, int]:
    sources = [source.vertex for source in query.sources]
    with_a_source = np.isin(mesh.components[asked], mesh.components[sources])
    unreached = np.isinf(distances)
    return {
        "disconnected": int(np.count_nonzero(unreached & ~with_a_source)),
        "beyond_max_distance": int(np.count_nonzero(unreached & with_a_source)),
    }
