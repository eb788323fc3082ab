"""The operations of the service, each as a conversation, and as a method of both clients."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, Literal, TypeVar
from uuid import uuid4

import httpx2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_client import uploads
from geodesic_client.answers import (
    JSON,
    NPY,
    NPZ,
    Border,
    Boundary,
    Cells,
    Cut,
    Distances,
    Isolines,
    Job,
    ListedMesh,
    LocatedPoint,
    LogMap,
    Loop,
    Matrix,
    Mean,
    Mesh,
    Neighbour,
    Path,
    Samples,
    Step,
    StoredMatrix,
    StraightLine,
    SurfaceLine,
    Sweep,
    to_array,
    to_borders,
    to_boundaries,
    to_cells,
    to_cut,
    to_distances,
    to_isolines,
    to_job,
    to_lines,
    to_listed_mesh,
    to_located,
    to_log_map,
    to_loops,
    to_matrix,
    to_mean,
    to_mesh,
    to_neighbours,
    to_path,
    to_paths,
    to_samples,
    to_steps,
    to_stored_matrix,
    to_sweep,
)
from geodesic_client.flow import (
    Flow,
    Progress,
    Query,
    Request,
    answer,
    ignore_progress,
    result_of,
    send,
)
from geodesic_client.method import Method
from geodesic_client.points import Point, as_points

T = TypeVar("T")
Accuracy = Literal["exact", "approximate", "fast"]
Kind = Literal[
    "distances",
    "path",
    "path/steps",
    "sweep",
    "paths",
    "isolines",
    "borders",
    "boundaries",
    "cut",
    "samples",
    "cells",
    "mean",
    "loop",
    "matrix",
    "nearest",
    "log-map",
    "trace",
    "locate",
]
ArrayName = Literal[
    "vertices",
    "faces",
    "lengths",
    "vertex_map",
    "face_map",
    "components",
    "face_of",
    "location_faces",
    "location_weights",
    "curve_edges",
    "edge_curves",
    "copy_of",
    "parts",
]

_PART_BYTES = 2**23
"""Bytes of a stored matrix that are read at a time"""
_PAGE = 1000
"""Meshes or jobs that are listed at a time"""


def about() -> Flow[Mapping[str, Any]]:
    """Return version, formats and limits of the service."""
    return (yield from _read("/v1"))


def upload(
    mesh: uploads.Source,
    *,
    format: str | None = None,  # noqa: A002 - the service's name for it
    merge: Literal["none", "exact"] | float = "none",
    name: str | None = None,
    progress: Progress = ignore_progress,
) -> Flow[Mesh]:
    """Store a mesh, and return it. The same mesh is never stored twice.

    Parameters
    ----------
    mesh
        The path of an OBJ, OFF, PLY, STL or GLB file, its bytes, or a pair of arrays: vertices
        (V, 3) and triangles (F, 3).
    format
        The format, if the suffix of the file name does not tell it.
    merge
        ``exact`` joins vertices at the same position; a distance in mesh units joins those no
        farther apart, and so all that steps of this length lead to, from vertex to vertex.
    name
        Name of the mesh for people; by default the name of the file. A mesh that is in the store
        already keeps its name.
    progress
        Called with the share that has been sent.
    """
    size, read = uploads.body_of(mesh, progress)
    parameters = {"format": uploads.format_of(mesh, format), "merge": str(merge)}
    called = uploads.name_of(mesh, name)
    if called is not None:
        parameters["name"] = called
    headers = {"Content-Type": "application/octet-stream", "Content-Length": str(size)}
    request = Request("POST", "/v1/meshes", parameters, headers, read)
    return to_mesh((yield from send(request)).json())


def sample(name: str, faces: int = 20_000) -> Flow[Mesh]:
    """Let the service make a sample, and return it; `about` lists the names of samples."""
    parameters: dict[str, str | int] = {"sample": name, "faces": faces}
    return to_mesh((yield from send(Request("POST", "/v1/meshes", parameters))).json())


def meshes(name: str | None = None) -> Flow[list[ListedMesh]]:
    """Return all meshes in the store, or those of a name, the newest first."""
    parameters = {} if name is None else {"name": name}
    return [to_listed_mesh(each) for each in (yield from _list("meshes", parameters))]


def mesh(mesh_id: str) -> Flow[Mesh]:
    """Return a mesh of the store, with its report."""
    return to_mesh((yield from _read(f"/v1/meshes/{mesh_id}")))


def delete_mesh(mesh: Mesh | str) -> Flow[None]:
    """Remove a mesh and its results from the store."""
    yield from send(Request("DELETE", _link(mesh)))


def array(mesh: Mesh | str, name: ArrayName) -> Flow[NDArray[Any]]:
    """Return an array of a mesh: its vertices, or its faces, for example."""
    return to_array((yield from send(Request("GET", f"{_link(mesh)}/arrays/{name}"))))


def distances(
    mesh: Mesh | str,
    sources: Point | Sequence[Point],
    *,
    targets: Sequence[Point] | None = None,
    method: Accuracy = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Literal[1, 2, 4, 8] | None = None,
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["nearest_source", "gradient", "lower", "upper", "violations"]] = (),
    certify: bool = False,
    cost: Mapping[str, Any] | None = None,
    progress: Progress = ignore_progress,
) -> Flow[Distances]:
    """Return the distance of each vertex, or of each target, from the nearest source.

    ``sources`` is a point, or several. With ``certify`` the distances are proved; ``lower`` and
    ``upper`` are bounds of each. With ``cost`` they are costs: ``{"slope": "tobler"}``, or
    ``{"faces": [...]}`` with one for each face, for example.
    """
    body = _body(
        sources=as_points(sources),
        targets=targets,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        effort=effort,
        max_distance=max_distance,
        barriers=barriers,
        include=include,
        certify=certify or None,  # older services do not know it
        cost=cost,
    )
    media_type = JSON if len(include) else NPY
    return (yield from _ask(mesh, "distances", body, to_distances, progress, media_type))


def path(
    mesh: Mesh | str,
    source: Point,
    target: Point,
    *,
    waypoints: Sequence[Point] = (),
    method: Accuracy = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Literal[1, 2, 4, 8] | None = None,
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    certify: bool = False,
    cost: Mapping[str, Any] | None = None,
    progress: Progress = ignore_progress,
) -> Flow[Path]:
    """Return the shortest path from source to target, past waypoints in their order.

    With ``certify`` it is proved that no path is shorter. With ``cost``, as for `distances`, the
    path is the cheapest.
    """
    body = _body(
        source=source,
        target=target,
        waypoints=waypoints,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        effort=effort,
        max_distance=max_distance,
        barriers=barriers,
        certify=certify or None,  # older services do not know it
        cost=cost,
    )
    return (yield from _ask(mesh, "path", body, to_path, progress))


def path_steps(
    mesh: Mesh | str,
    source: Point,
    target: Point,
    *,
    waypoints: Sequence[Point] = (),
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Step]]:
    """Return the steps of the search for the exact path; none where there is no path."""
    body = _body(
        source=source,
        target=target,
        waypoints=waypoints,
        max_distance=max_distance,
        barriers=barriers,
    )
    return (yield from _ask(mesh, "path/steps", body, to_steps, progress))


def sweep_steps(
    mesh: Mesh | str,
    sources: Point | Sequence[Point],
    steps: int = 200,
    *,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[Sweep]:
    """Return the windows of an exact sweep, step by step, on a mesh of at most 5000 faces."""
    body = _body(sources=as_points(sources), steps=steps, barriers=barriers)
    return (yield from _ask(mesh, "sweep", body, to_sweep, progress))


def paths(
    mesh: Mesh | str,
    source: Point,
    targets: Sequence[Point],
    *,
    method: Accuracy = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Literal[1, 2, 4, 8] | None = None,
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    cost: Mapping[str, Any] | None = None,
    progress: Progress = ignore_progress,
) -> Flow[list[Path]]:
    """Return the shortest path from a source to each of the targets.

    With ``cost``, as for `distances`, they are the cheapest.
    """
    body = _body(
        source=source,
        targets=targets,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        effort=effort,
        max_distance=max_distance,
        barriers=barriers,
        cost=cost,
    )
    return (yield from _ask(mesh, "paths", body, to_paths, progress))


def isolines(
    mesh: Mesh | str,
    sources: Point | Sequence[Point] | None = None,
    *,
    values: ArrayLike | None = None,
    levels: Sequence[float] | None = None,
    count: int | None = None,
    method: Literal["exact", "approximate"] = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    max_distance: float | None = None,
    chord_error: float | None = None,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["locations"]] = (),
    cost: Mapping[str, Any] | None = None,
    progress: Progress = ignore_progress,
) -> Flow[Isolines]:
    """Return the lines at some distances (``levels``), or at ``count`` evenly spaced ones.

    ``sources`` is a point, or several. In their place, ``values`` (V,) are your own: lines are at
    levels of these, and end where a value is NaN or infinite. With ``cost``, as for `distances`,
    lines are those of equal cost.
    """
    body = _body(
        sources=None if sources is None else as_points(sources),
        levels=levels,
        count=count,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        max_distance=max_distance,
        chord_error=chord_error,
        barriers=barriers,
        include=include,
        cost=cost,
    )
    arrays = {} if values is None else {"values": np.asarray(values, np.float64)}
    request = _request(mesh, "isolines", body, JSON, arrays=arrays)
    return (yield from answer(Query(request, to_isolines), progress))


def borders(
    mesh: Mesh | str,
    sources: Sequence[Point],
    *,
    max_distance: float | None = None,
    chord_error: float | None = None,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["locations"]] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Border]]:
    """Return the lines between the parts of the surface that are nearest to each source."""
    body = _body(
        sources=sources,
        max_distance=max_distance,
        chord_error=chord_error,
        barriers=barriers,
        include=include,
    )
    return (yield from _ask(mesh, "borders", body, to_borders, progress))


def boundaries(
    mesh: Mesh | str,
    *,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["locations"]] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Boundary]]:
    """Return the boundary of the surface, longest line first; none for a closed surface."""
    body = _body(barriers=barriers, include=include)
    return (yield from _ask(mesh, "boundaries", body, to_boundaries, progress))


def loops(
    mesh: Mesh | str,
    through: Point | None = None,
    *,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["locations"]] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Loop]]:
    """Return the shortest loop through a point that cannot be shrunk to a point.

    Without a point, return two loops for each handle of the surface, the shortest first.
    """
    body = _body(through=through, barriers=barriers, include=include)
    return (yield from _ask(mesh, "loop", body, to_loops, progress))


def straighten(
    mesh: Mesh | str,
    curves: SurfaceLine | Sequence[SurfaceLine | Sequence[Point]],
    *,
    free_ends: bool = False,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["locations"]] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Loop]]:
    """Return curves pulled tight, in their order: each the shortest near it, with the same ends.

    With ``free_ends``, ends on the boundary slide along it to where the curve is shortest. Curves
    are given as for `cut`. Lines of answers that are closed stay closed.
    """
    body = _body(
        curves=_as_curves(curves),
        free_ends=free_ends or None,  # older services do not know it
        barriers=barriers,
        include=include,
    )
    return (yield from _ask(mesh, "loop", body, to_loops, progress))


def cut(
    mesh: Mesh | str,
    curves: SurfaceLine | Sequence[SurfaceLine | Sequence[Point]],
    *,
    separate: bool = True,
    name: str | None = None,
    progress: Progress = ignore_progress,
) -> Flow[Cut]:
    """Cut a mesh along curves, which are edges of a new mesh in the store; return that.

    Curves are lines of other answers that have their locations, or lists of points, each in one
    face with the next. With ``separate`` the surface comes apart along them. `array` returns the
    arrays that lead back to the old mesh: ``face_of``, ``location_faces``, ``location_weights``,
    ``curve_edges``, ``edge_curves``, ``copy_of`` and ``parts``.
    """
    body = _body(curves=_as_curves(curves), separate=separate, name=name)
    return (yield from _ask(mesh, "cut", body, to_cut, progress))


def _as_curves(
    curves: SurfaceLine | Sequence[SurfaceLine | Sequence[Point]],
) -> list[dict[str, Any]]:
    return list(map(_as_curve, [curves] if isinstance(curves, SurfaceLine) else curves))


def _as_curve(curve: SurfaceLine | Sequence[Point]) -> dict[str, Any]:
    if not isinstance(curve, SurfaceLine):
        return {"polyline": curve}
    if not len(curve.locations):
        raise ValueError('a line has no locations: ask for it with include=["locations"]')
    return {"polyline": curve.locations, "closed": getattr(curve, "closed", False)}


def matrix(
    mesh: Mesh | str,
    sources: Sequence[Point],
    targets: Sequence[Point] | None = None,
    *,
    method: Accuracy = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Literal[1, 2, 4, 8] | None = None,
    max_distance: float | None = None,
    layout: Literal["dense", "sparse", "pairs"] = "dense",
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[Matrix]:
    """Return the distances from each source to each target, or for pairs of them.

    Without targets, the targets are the sources.
    """
    body = _body(
        sources=sources,
        targets=targets,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        effort=effort,
        max_distance=max_distance,
        layout=layout,
        barriers=barriers,
    )
    media_type = NPZ if layout == "sparse" else NPY
    return (yield from _ask(mesh, "matrix", body, to_matrix, progress, media_type))


def store_matrix(
    mesh: Mesh | str,
    sources: Sequence[Point] | Literal["all"],
    targets: Sequence[Point] | Literal["all"] | None = None,
    *,
    method: Accuracy = "exact",
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Literal[1, 2, 4, 8] | None = None,
    max_distance: float | None = None,
    layout: Literal["dense", "sparse"] = "dense",
    barriers: Sequence[int] = (),
    dtype: Literal["float64", "float32"] = "float64",
    progress: Progress = ignore_progress,
) -> Flow[StoredMatrix]:
    """Let the service compute any number of distances, and store them in a file.

    All workers of the service share the work. Without targets, the targets are the sources; then
    each pair is computed once. If a call was stopped, the next one continues where it stopped. A
    ``sparse`` matrix holds the finite distances only.
    """
    body = _body(
        sources=sources,
        targets=targets,
        method=method,
        relative_error=relative_error,
        absolute_error=absolute_error,
        effort=effort,
        max_distance=max_distance,
        layout=layout,
        barriers=barriers,
    )
    media_type = NPZ if layout == "sparse" else NPY
    request = _request(mesh, "matrix", body, media_type, {"dtype": dtype})
    headers = {**request.headers, "Prefer": "respond-async", "Idempotency-Key": uuid4().hex}
    job = to_job((yield from send(replace(request, headers=headers))).json())
    response = yield from result_of(job, progress, _range(0, 1))
    progress(1.0)
    return to_stored_matrix(job.id, response)


def matrix_rows(matrix: StoredMatrix, first: int, last: int) -> Flow[NDArray[Any]]:
    """Return the rows of a stored dense matrix from ``first`` to before ``last``."""
    if matrix.layout != "dense":
        raise ValueError("a sparse matrix cannot be read by rows; save_matrix saves it to a file")
    if not 0 <= first < last <= matrix.shape[0]:
        raise ValueError(f"rows {first} to {last} do not exist; the matrix has {matrix.shape[0]}")
    row = matrix.shape[1] * matrix.dtype.itemsize
    begin, end = (matrix.rows_at + row * number for number in (first, last))
    part = (yield from _part_of_result(matrix.job_id, begin, end)).content
    # A copy, because an array over bytes is read-only.
    return np.frombuffer(part, matrix.dtype).reshape(last - first, matrix.shape[1]).copy()


def save_matrix(
    matrix: StoredMatrix, path: str | PathLike[str], *, progress: Progress = ignore_progress
) -> Flow[None]:
    """Write a stored matrix to a file.

    `numpy.load` can map a dense one into memory; `scipy.sparse.load_npz` reads a sparse one.

    If a call was stopped, the next one continues where it stopped: received data are kept in a
    hidden file beside.
    """
    out = FilePath(path)
    scratch = out.with_name(f".{out.name}.{matrix.etag}.part")
    with scratch.open("ab") as file:
        while (begin := file.tell()) < matrix.size:
            end = min(begin + _PART_BYTES, matrix.size)
            file.write((yield from _part_of_result(matrix.job_id, begin, end)).content)
            progress(end / matrix.size)
    scratch.replace(out)


def nearest(
    mesh: Mesh | str,
    source: Point,
    candidates: Sequence[Point],
    *,
    k: int = 1,
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[Neighbour]]:
    """Return the ``k`` candidates that are nearest along the surface, nearest first."""
    body = _body(
        source=source, candidates=candidates, k=k, max_distance=max_distance, barriers=barriers
    )
    return (yield from _ask(mesh, "nearest", body, to_neighbours, progress))


def samples(
    mesh: Mesh | str,
    count: int | None = None,
    *,
    radius: float | None = None,
    start: Point | Sequence[Point] = (),
    iterations: int = 0,
    barriers: Sequence[int] = (),
    include: Sequence[Literal["distances"]] = (),
    progress: Progress = ignore_progress,
) -> Flow[Samples]:
    """Return points spread over a surface, each the farthest from those before.

    Until there are ``count`` of them, or every vertex is within ``radius`` of one. They then move
    ``iterations`` times to the middle of what is nearest to each.
    """
    body = _body(
        count=count,
        radius=radius,
        starts=as_points(start),
        iterations=iterations,
        barriers=barriers,
        include=include,
    )
    return (yield from _ask(mesh, "samples", body, to_samples, progress))


def cells(
    mesh: Mesh | str,
    sources: Sequence[Point],
    *,
    max_distance: float | None = None,
    chord_error: float | None = None,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[Cells]:
    """Return areas, centroids and neighbours of what is nearest to each source."""
    body = _body(
        sources=sources,
        max_distance=max_distance,
        chord_error=chord_error,
        barriers=barriers,
    )
    return (yield from _ask(mesh, "cells", body, to_cells, progress))


def mean(
    mesh: Mesh | str,
    points: Sequence[Point],
    weights: ArrayLike | None = None,
    *,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[Mean]:
    """Return the point whose squared distances from some points sum to the least."""
    given = None if weights is None else np.asarray(weights, np.float64)
    body = _body(points=as_points(points), weights=given, barriers=barriers)
    return (yield from _ask(mesh, "mean", body, to_mean, progress))


def log_map(
    mesh: Mesh | str,
    source: Point,
    *,
    x_axis: Point | Sequence[float] | None = None,
    rescale: bool = True,
    max_distance: float | None = None,
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[LogMap]:
    """Return how far each vertex is from a source, and in which direction.

    Angles are measured from ``x_axis``: a point to look at, or a vector in space.
    """
    body = _body(
        source=source, x_axis=x_axis, rescale=rescale, max_distance=max_distance, barriers=barriers
    )
    return (yield from _ask(mesh, "log-map", body, to_log_map, progress, NPY))


def trace(
    mesh: Mesh | str,
    starts: Point | Sequence[Point],
    directions: ArrayLike,
    lengths: ArrayLike,
    *,
    at_vertices: Literal["straight", "stop"] = "straight",
    barriers: Sequence[int] = (),
    progress: Progress = ignore_progress,
) -> Flow[list[StraightLine]]:
    """Return the straightest lines from some points in some directions, for some lengths.

    Directions are angles (N,), in radians, or vectors in space (N, 3). Of starts, directions and
    lengths there is one for all lines, or one for each.
    """
    given = np.asarray(directions, np.float64)
    body = _body(
        starts=as_points(starts),
        directions=given if given.ndim == 2 else np.atleast_1d(given),
        lengths=np.atleast_1d(np.asarray(lengths, np.float64)),
        at_vertices=at_vertices,
        barriers=barriers,
    )
    return (yield from _ask(mesh, "trace", body, to_lines, progress))


def locate(
    mesh: Mesh | str,
    positions: Sequence[Sequence[float]] | ArrayLike,
    *,
    max_distance: float | None = None,
    progress: Progress = ignore_progress,
) -> Flow[list[LocatedPoint | None]]:
    """Return the point of the surface nearest to each position (N, 3); None where too far."""
    body = _body(points=positions, max_distance=max_distance)
    return (yield from _ask(mesh, "locate", body, to_located, progress))


def jobs() -> Flow[list[Job]]:
    """Return all jobs of this caller, the newest first."""
    return [to_job(each) for each in (yield from _list("jobs"))]


def job(job_id: str) -> Flow[Job]:
    """Return the state of a job."""
    return to_job((yield from _read(f"/v1/jobs/{job_id}")))


def cancel_job(job: Job | str) -> Flow[Job]:
    """Stop a job that waits or runs; one that has finished stays, with its answer."""
    job_id = job.id if isinstance(job, Job) else job
    return to_job((yield from send(Request("POST", f"/v1/jobs/{job_id}/cancel"))).json())


def delete_job(job: Job | str) -> Flow[None]:
    """Remove a job and its answer; one that waits or runs is stopped."""
    job_id = job.id if isinstance(job, Job) else job
    yield from send(Request("DELETE", f"/v1/jobs/{job_id}"))


def _part_of_result(job_id: str, begin: int, end: int) -> Flow[httpx2.Response]:
    """Return the bytes of an answer from ``begin`` to before ``end``, or to its end."""
    request = Request("GET", f"/v1/jobs/{job_id}/results", headers=_range(begin, end))
    return (yield from send(request))


def _range(begin: int, end: int) -> dict[str, str]:
    return {"Range": f"bytes={begin}-{end - 1}"}


def _ask(
    mesh: Mesh | str,
    kind: Kind,
    body: Mapping[str, Any],
    decode: Callable[[httpx2.Response], T],
    progress: Progress,
    media_type: str = JSON,
) -> Flow[T]:
    return (yield from answer(Query(_request(mesh, kind, body, media_type), decode), progress))


def _request(
    mesh: Mesh | str,
    kind: Kind,
    body: Mapping[str, Any],
    media_type: str,
    parameters: Mapping[str, str] | None = None,
    arrays: Mapping[str, NDArray[np.float64]] | None = None,
) -> Request:
    content = json.dumps(body, default=_as_json, allow_nan=False).encode()
    headers = {"Content-Type": JSON, "Accept": media_type}
    if arrays:
        headers["Content-Type"], content = _as_form(content, arrays)
    return Request("POST", f"{_link(mesh)}/{kind}", parameters or {}, headers, content)


def _body(**members: Any) -> dict[str, Any]:
    return {name: value for name, value in members.items() if value is not None}


def _as_form(content: bytes, arrays: Mapping[str, NDArray[np.float64]]) -> tuple[str, bytes]:
    """Return JSON and arrays in numpy's format as a form: its Content-Type, and its bytes."""
    parts: dict[str, tuple[None, bytes, str]] = {"request": (None, content, JSON)}
    for name, array in arrays.items():
        file = BytesIO()
        np.save(file, array, allow_pickle=False)
        parts[name] = None, file.getvalue(), NPY
    form = httpx2.Request("POST", "http://localhost", files=parts)  # which encodes it
    return form.headers["Content-Type"], form.read()


def _as_json(value: Any) -> Any:
    """Return what numpy's numbers and arrays, and ranges, are in JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Sequence):
        return list(value)
    raise TypeError(f"{value!r} cannot be part of a query")


def _link(mesh: Mesh | str) -> str:
    return f"/v1/meshes/{mesh.id if isinstance(mesh, Mesh) else mesh}"


def _read(path: str) -> Flow[dict[str, Any]]:
    response: httpx2.Response = yield from send(Request("GET", path))
    document: dict[str, Any] = response.json()
    return document


def _list(
    name: Literal["meshes", "jobs"], only: Mapping[str, str] | None = None
) -> Flow[list[dict[str, Any]]]:
    found: list[dict[str, Any]] = []
    parameters: dict[str, str | int] = {"limit": _PAGE, **(only or {})}
    while True:
        part = (yield from send(Request("GET", f"/v1/{name}", dict(parameters)))).json()
        found += part[name]
        if part.get("next_cursor") is None:
            return found
        parameters["cursor"] = part["next_cursor"]


class Operations:
    """The methods of both clients."""

    about = Method(about)
    upload = Method(upload)
    sample = Method(sample)
    meshes = Method(meshes)
    mesh = Method(mesh)
    delete_mesh = Method(delete_mesh)
    array = Method(array)
    distances = Method(distances)
    path = Method(path)
    path_steps = Method(path_steps)
    sweep_steps = Method(sweep_steps)
    paths = Method(paths)
    isolines = Method(isolines)
    borders = Method(borders)
    boundaries = Method(boundaries)
    cut = Method(cut)
    matrix = Method(matrix)
    store_matrix = Method(store_matrix)
    matrix_rows = Method(matrix_rows)
    save_matrix = Method(save_matrix)
    nearest = Method(nearest)
    samples = Method(samples)
    cells = Method(cells)
    mean = Method(mean)
    loops = Method(loops)
    straighten = Method(straighten)
    log_map = Method(log_map)
    trace = Method(trace)
    locate = Method(locate)
    jobs = Method(jobs)
    job = Method(job)
    cancel_job = Method(cancel_job)
    delete_job = Method(delete_job)
