"""From a validated query to its answer: the only place of the service that calls the solvers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app import schemas
from app.encoding import Answer
from app.errors import Fault
from app.mesh_store import OpenMesh
from app.points import described, resolve
from app.queries import (
    FAULTS_SHOWN,
    DistancesQuery,
    LocateQuery,
    Named,
    PathQuery,
    Query,
    refuse_points,
)
from geodesic_core.nodes import component_of

Places = Sequence[gc.SurfacePoint]


def answer(
    query: Query, opened: OpenMesh, *, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    """Answer ``query`` on an open mesh; stops with ``Cancelled`` once ``cancel`` says so."""
    match query:
        case DistancesQuery():
            return _distances(query, opened, cancel, memory_limit)
        case PathQuery():
            return _path(query, opened, cancel, memory_limit)
        case LocateQuery():
            return _locate(query, opened, cancel)


# Distances


def _distances(
    query: DistancesQuery, opened: OpenMesh, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    mesh, solver = opened.mesh, opened.solver
    places = _resolved(query.points(), mesh, cancel)
    sources, ends = places[: len(query.sources)], places[len(query.sources) :]
    targets = None if query.targets is None else ends
    options: dict[str, Any] = {
        "max_distance": query.max_distance,
        "targets": [place for place in ends if place.vertex_index is None],
        "cancel": cancel,
        "memory_limit": memory_limit,
    }
    starts = [
        gc.Source(place, source.start_distance)
        for place, source in zip(sources, query.sources, strict=True)
    ]
    if query.approximation is None:
        field = solver.exact_distance(starts, **options)
    else:
        field = solver.approximate_distance(starts, **asdict(query.approximation), **options)
    distances = _at(targets, field.distances, field.distance_at)
    members: dict[str, Any] = {
        "mesh_id": query.mesh_id,
        **_method(query),
        "error_bound": _error_bound(field.error_bound),
        "sources": [
            {**described(mesh, place), "start_distance": source.start_distance}
            for place, source in zip(sources, query.sources, strict=True)
        ],
    }
    if targets is not None:
        members["targets"] = [described(mesh, place) for place in targets]
    members |= {
        "distances": distances,
        "unreachable": _unreachable(mesh, sources, targets, distances),
        "stats": _stats(field.stats),
        "warnings": opened.warnings,
    }
    if query.nearest_source:
        nearest = _at(targets, field.nearest_source, field.nearest_source_at)
        members["nearest_source"] = [None if i < 0 else i for i in nearest.tolist()]
    return Answer(members, "distances")


def _at(
    targets: Places | None, at_vertices: NDArray[Any], at: Callable[[gc.SurfacePoint], Any]
) -> NDArray[Any]:
    """Return the values of a field at targets, or at all vertices."""
    if targets is None:
        return at_vertices
    vertices = [-1 if place.vertex_index is None else place.vertex_index for place in targets]
    values = at_vertices[vertices]
    for i, vertex in enumerate(vertices):
        if vertex < 0:
            values[i] = at(targets[i])
    return values


def _unreachable(
    mesh: gc.TriangleMesh,
    sources: Places,
    targets: Places | None,
    distances: NDArray[np.float64],
) -> Mapping[str, int]:
    ends = mesh.components
    if targets is not None:
        ends = np.array([component_of(mesh, place) for place in targets])
    with_a_source = np.isin(ends, [component_of(mesh, place) for place in sources])
    unreached = np.isinf(distances)
    return {
        "disconnected": int(np.count_nonzero(unreached & ~with_a_source)),
        "beyond_max_distance": int(np.count_nonzero(unreached & with_a_source)),
    }


# Paths


def _path(
    query: PathQuery, opened: OpenMesh, cancel: Callable[[], bool], memory_limit: int
) -> Answer:
    mesh = opened.mesh
    source, target, *waypoints = _resolved(query.points(), mesh, cancel)
    members: dict[str, Any] = {
        "mesh_id": query.mesh_id,
        **_method(query),
        "source": described(mesh, source),
        "target": described(mesh, target),
        "waypoints": [described(mesh, place) for place in waypoints],
        "warnings": opened.warnings,
    }
    options: dict[str, Any] = {"cancel": cancel, "memory_limit": memory_limit}
    try:
        if query.approximation is None:
            path = opened.solver.shortest_path(
                source, target, waypoints, explain=query.explain, **options
            )
        else:
            path = opened.solver.approximate_distance(
                source,
                **asdict(query.approximation),
                targets=[target],
                keep_windows=True,
                **options,
            ).path_to(target)
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


# That there is no path is known without error, by any method.
_CERTAIN = {"type": "relative", "value": 0.0, "kind": "guaranteed"}


def _method(query: DistancesQuery | PathQuery) -> Mapping[str, Any]:
    exact = query.approximation is None
    return {"method": "exact" if exact else "approximate", "exact": exact}


def _error_bound(bound: gc.ErrorBound) -> Mapping[str, Any]:
    return {"type": bound.type, "value": bound.value, "kind": bound.kind}


def _stats(stats: gc.SweepStats) -> Mapping[str, Any]:
    # An answer is the same in every run; the seconds are in `Server-Timing`.
    return {name: value for name, value in stats.as_dict().items() if name != "seconds"}


# Points


def _locate(query: LocateQuery, opened: OpenMesh, cancel: Callable[[], bool]) -> Answer:
    mesh = opened.mesh
    found: list[Mapping[str, Any] | None] = []
    for i, position in enumerate(query.positions):
        _look_up(cancel)
        try:
            place = mesh.locate(position, query.max_distance)
        except gc.errors.InvalidPoint as error:
            if query.max_distance is None:  # it did not miss: its numbers are too large
                raise refuse_points([Fault(f"/points/{i}", str(error))]) from None
            found.append(None)
            continue
        away = float(np.linalg.norm(mesh.position(place) - position))
        found.append({**described(mesh, place), "distance": away})
    members = {"mesh_id": query.mesh_id, "points": found, "warnings": opened.warnings}
    return Answer(members)


def _resolved(
    named: Named, mesh: gc.TriangleMesh, cancel: Callable[[], bool]
) -> list[gc.SurfacePoint]:
    """Return the points of the mesh that are meant, or refuse those that are none."""
    places: list[gc.SurfacePoint] = []
    faults: list[Fault] = []
    for where, point in named:
        _look_up(cancel)
        try:
            places.append(resolve(mesh, point))
        except gc.errors.InvalidPoint as error:
            faults.append(Fault(f"{where}/{_at_fault(point)}", str(error)))
            if len(faults) == FAULTS_SHOWN:
                break
    if faults:
        raise refuse_points(faults)
    return places


def _at_fault(point: schemas.Point | schemas.Source) -> str:
    """Return the member that is wrong with a point whose indices are sound."""
    match point:
        case schemas.EdgePoint():
            return "edge"
        case schemas.FacePoint():
            return "barycentric"
    return "position"


def _look_up(cancel: Callable[[], bool]) -> None:
    if cancel():
        raise gc.errors.Cancelled("cancelled while points were looked for")
