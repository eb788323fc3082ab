"""Answers, as values with numpy arrays, and how they are decoded."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import httpx2
import numpy as np
from numpy.typing import NDArray

NPY = "application/x-npy"
NPZ = "application/x-npz"
JSON = "application/json"

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ErrorBound:
    """The most by which an answer differs from the exact one; 0 for exact ones."""

    type: str
    """``relative`` or ``absolute``"""
    value: float
    kind: str
    """``guaranteed``, ``estimated``, or ``certified``: proved for this answer"""


@dataclass(frozen=True)
class Mesh:
    """A mesh in the store of the service."""

    id: str
    name: str | None
    """The name given with its first upload, if any"""
    vertices: int
    faces: int
    warnings: Sequence[str]
    report: Mapping[str, Any] = field(repr=False)
    """The report of the service about it"""


@dataclass(frozen=True)
class ListedMesh:
    """A mesh in a list of the store; `Client.mesh` returns the rest."""

    id: str
    name: str | None
    """The name given with its first upload, if any"""
    vertices: int
    faces: int
    created: str
    """When it was stored, RFC 3339"""


@dataclass(frozen=True)
class Certificate:
    """What a proof of distances tells."""

    holds: bool
    """Whether it proves what the method promises, to 1e-8 of the largest distance"""
    relative_gap: float
    """The largest difference of the bounds of a vertex, as a share of the largest distance"""
    worst_face: int
    """The face that widens the gap most"""
    worst_violation: float
    """By how much it does, mesh units"""


@dataclass(frozen=True)
class Distances:
    """Distances of all vertices, or of the targets; infinite where they cannot be reached."""

    mesh_id: str
    method: str
    distances: Floats
    error_bound: ErrorBound
    unreachable: Mapping[str, int]
    """Number of missing distances, by reason"""
    nearest_source: Integers | None
    """Index of the nearest source, −1 where unreachable; None if it was not requested"""
    gradient: Floats | None
    """The direction in which distance grows, (V, 3); None if it was not requested"""
    lower: Floats | None = None
    """Proved lower bounds of the distances; None if they were not requested"""
    upper: Floats | None = None
    """Proved upper bounds, lengths of paths; None if they were not requested"""
    violations: Floats | None = None
    """By how much each face widens the gap at most, mesh units; None if it was not requested"""
    certificate: Certificate | None = None
    """What the proof tells; None if none was requested"""


@dataclass(frozen=True)
class Path:
    """A shortest path, or the reason why there is none."""

    length: float
    """Infinite where there is no path"""
    points: Floats
    """(K, 3), from source to target; (0, 3) where there is no path, or the mesh has no positions"""
    faces: Integers
    """The face of each piece, (K − 1,)"""
    locations: Sequence[Mapping[str, Any]]
    """The points again, each as a face and the weights of its corners"""
    error_bound: ErrorBound
    reason: str | None
    """``disconnected``, ``beyond_max_distance`` or ``beyond_max_cost``; None for a path"""
    certificate: Certificate | None = None
    """What the proof of its length tells; None if none was requested"""
    cost: float | None = None
    """What it costs, if ``cost`` was given"""


@dataclass(frozen=True)
class Step:
    """A step of the search for a path."""

    leg: int
    """Number of the leg, from one stop to the next"""
    name: str
    bound: float
    """The smallest upper bound of the leg's length that is known after the step"""
    windows: int
    """Windows that were created"""
    faces: Integers
    """The faces that were visited"""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line on the surface."""

    points: Floats
    """(K, 3), or (0, 3) on a mesh without positions"""
    faces: Integers
    """The face of each piece"""
    closed: bool
    length: float
    locations: Sequence[Mapping[str, Any]] = ()
    """Its points, each as a face and the weights of its corners: where they were asked for, and on
    a mesh without positions"""


@dataclass(frozen=True, kw_only=True)
class Isoline(Line):
    """A line of points at one distance, or of one value."""


@dataclass(frozen=True)
class IsolineLevel:
    """The lines at one distance, or of one value."""

    level: float
    lines: Sequence[Isoline]


@dataclass(frozen=True)
class Isolines:
    """Lines of equal distance, or of equal values, which are exact."""

    levels: Sequence[IsolineLevel]
    chord_error: float
    error_bound: ErrorBound


@dataclass(frozen=True, kw_only=True)
class Border(Line):
    """A line of points that are equally near to two sources, and no nearer to a third."""

    sources: tuple[int, int]
    """The two sources whose territories it separates: indices of the request, the lower first"""


@dataclass(frozen=True, kw_only=True)
class Boundary(Line):
    """A line along edges that have one face, with the surface on its left."""

    vertices: Integers
    """(K,)"""


@dataclass(frozen=True, kw_only=True)
class Loop(Line):
    """A loop that cannot be shrunk to a point, or a curve pulled tight, which may be open."""


@dataclass(frozen=True)
class Matrix:
    """Distances between many points; infinite where they cannot be reached.

    A dense matrix has a row for each source. For pairs there is one distance for each pair. A
    sparse matrix has the finite distances only, with the source (``rows``) and the target
    (``columns``) of each.
    """

    distances: Floats
    error_bound: ErrorBound
    rows: Integers | None = None
    columns: Integers | None = None


@dataclass(frozen=True)
class StoredMatrix:
    """A matrix that the service keeps in a file: the answer of a job.

    `matrix_rows` reads some rows of a dense one, `save_matrix` saves either to a file. The service
    keeps it until the job is deleted or expires.
    """

    job_id: str
    layout: str
    """``dense`` in numpy's format, or ``sparse`` as `scipy.sparse.load_npz` reads it"""
    shape: tuple[int, int]
    """The numbers of sources and of targets"""
    dtype: np.dtype[Any]
    method: str
    error_bound: ErrorBound
    size: int
    """Bytes of the file"""
    etag: str
    """Names the content"""

    @property
    def rows_at(self) -> int:
        """Bytes before the first row of a dense matrix."""
        return self.size - self.shape[0] * self.shape[1] * self.dtype.itemsize


@dataclass(frozen=True)
class Neighbour:
    """One of the nearest candidates."""

    candidate: int
    """Index into the candidates"""
    distance: float


@dataclass(frozen=True)
class Samples:
    """Points spread over a surface."""

    points: Sequence[Mapping[str, Any]]
    """N points, as they can be sent again: a vertex, or a face and weights"""
    positions: Floats
    """(N, 3), or (0, 3) on a mesh that is given by the lengths of its edges alone"""
    radii: Floats
    """Covering radius with the first points, and after each one added; infinite while a part has
    no point"""
    costs: Floats
    """Sum of squared distances before and after each iteration; empty without iterations"""
    converged: bool | None
    """Whether the last iteration moved no point; None without iterations"""
    distances: Floats | None = None
    """(V,), from the nearest point; infinite where unreachable"""
    nearest: Integers | None = None
    """(V,), index of the nearest point; -1 where unreachable"""


@dataclass(frozen=True)
class Cells:
    """The parts of a surface that are nearest to each of N sources."""

    areas: Floats
    """(N,), mesh units squared"""
    centroids: Sequence[Mapping[str, Any] | None] | None
    """N points, None for a cell without area; None if a source is a curve"""
    adjacency: Integers
    """(M, 2), pairs of sources whose cells share a border"""
    border_lengths: Floats
    """(M,), mesh units"""


@dataclass(frozen=True)
class Mean:
    """The mean of points on a surface."""

    point: Mapping[str, Any]
    """A vertex, or a face and weights"""
    position: Floats | None
    """(3,); None on a mesh that is given by the lengths of its edges alone"""
    variance: float
    """Mesh units squared"""
    converged: bool
    moves: int


@dataclass(frozen=True)
class LogMap:
    """Where each vertex lies as seen from a source: how far, and in which direction."""

    distances: Floats
    """(V,), infinite where unreachable"""
    angles: Floats
    """(V,), radians, at which the shortest path leaves the source; NaN where unreachable"""
    coordinates: Floats
    """(V, 2), in the tangent plane; NaN where unreachable"""
    bends: Integers
    """(V,), vertices that the path bends at; −1 where unreachable"""
    total_angle: float
    """Sum of the angles of the surface around the source, radians"""


@dataclass(frozen=True)
class Sweep:
    """What an exact sweep does, step by step; S is the number of steps, with the start."""

    fronts: Floats
    """(S,), distance of the farthest vertex that has left the queue, mesh units"""
    created: Integers
    """(S,), windows created so far"""
    crossed: Integers
    """(S,), windows that have crossed a face so far"""
    waiting: Integers
    """(S,), windows that wait in the queue"""
    trimmed: Integers
    """(S,), windows trimmed away so far"""
    distances: Floats
    """(V,), infinite where unreachable"""
    settled: Integers
    """(V,), step in which each vertex left the queue; −1 for never"""
    windows: Mapping[str, Floats | Integers]
    """Columns by name, as the interface document tells, ``tails`` to ``last``; −1 for none"""


@dataclass(frozen=True)
class StraightLine:
    """A straightest line."""

    length: float
    points: Floats
    """(K, 3), or (0, 3) on a mesh that is given by the lengths of its edges alone"""
    faces: Integers
    """The face of each piece, (K − 1,)"""
    locations: Sequence[Mapping[str, Any]]
    """Its K points, each as a face and the weights of its corners"""
    stopped: str
    """``length``, ``boundary``, ``barrier``, ``vertex``, ``non_manifold`` or ``collapsed``"""
    end_direction: float
    """Radians at the last point; NaN where directions have no meaning"""


SurfaceLine = Path | Isoline | Border | Boundary | Loop | StraightLine
"""A line that can be a curve of a request, where it has its locations"""


@dataclass(frozen=True)
class Cut:
    """A mesh that was cut along curves, and is in the store of the service."""

    mesh_id: str
    """The new mesh, for `Client.mesh`, `Client.array` and all queries"""
    cut_from: str
    """The mesh that was cut"""
    vertices: int
    faces: int
    parts: int
    """Number of parts that the curves bound"""
    snapped: int
    """Points of curves that were nearly on a vertex or an edge, and moved there"""
    warnings: Sequence[str]


@dataclass(frozen=True)
class LocatedPoint:
    """The point of the surface that is nearest to a position."""

    point: Mapping[str, Any]
    """As a source or target of a query"""
    position: tuple[float, float, float]
    distance: float


@dataclass(frozen=True)
class Job:
    """A query that is answered in the background."""

    id: str
    kind: str
    mesh_id: str
    status: str
    progress: float

    @property
    def is_finished(self) -> bool:
        """Whether nothing will change."""
        return self.status not in ("accepted", "running")


def to_array(response: httpx2.Response) -> NDArray[Any]:
    """Return the array of a response in numpy's format."""
    array: NDArray[Any] = np.load(BytesIO(response.content), allow_pickle=False)
    return array


def to_mesh(document: Mapping[str, Any]) -> Mesh:
    """Return a mesh, from its report."""
    members = {name: document[name] for name in ("id", "name", "vertices", "faces", "warnings")}
    return Mesh(**members, report=document)


def to_listed_mesh(document: Mapping[str, Any]) -> ListedMesh:
    """Return a mesh of a list."""
    names = ("id", "name", "vertices", "faces", "created")
    return ListedMesh(*(document[name] for name in names))


def to_job(document: Mapping[str, Any]) -> Job:
    """Return a job, from its document."""
    names = ("id", "kind", "mesh_id", "status", "progress")
    return Job(*(document[name] for name in names))


def to_distances(response: httpx2.Response) -> Distances:
    """Return distances, from numpy's format or from JSON."""
    if _media_type(response) == NPY:
        members = _members_of_headers(response)
        distances = to_array(response).astype(np.float64, copy=False)
    else:
        members = response.json()
        distances = _with_infinity(members["distances"])
    nearest, gradient = members.get("nearest_source"), members.get("gradient")
    lower, upper, violations = (members.get(name) for name in ("lower", "upper", "violations"))
    return Distances(
        mesh_id=members["mesh_id"],
        method=members["method"],
        distances=distances,
        error_bound=ErrorBound(**members["error_bound"]),
        unreachable=members["unreachable"],
        nearest_source=None if nearest is None else _with_minus_one(nearest),
        gradient=None if gradient is None else np.array(gradient, np.float64),
        lower=None if lower is None else _with_infinity(lower),
        upper=None if upper is None else _with_infinity(upper),
        violations=None if violations is None else np.array(violations, np.float64),
        certificate=_to_certificate(members),
    )


def _to_certificate(members: Mapping[str, Any]) -> Certificate | None:
    certificate = members.get("certificate")
    return None if certificate is None else Certificate(**certificate)


def to_path(response: httpx2.Response) -> Path:
    """Return a path, from JSON."""
    return _to_path(response.json())


def to_paths(response: httpx2.Response) -> list[Path]:
    """Return paths, from JSON, in the order of their targets."""
    return [_to_path(each) for each in response.json()["paths"]]


def _to_path(document: Mapping[str, Any]) -> Path:
    length = document.get("length")
    return Path(
        length=np.inf if length is None else length,
        points=np.array(document["points"] or [], np.float64).reshape(-1, 3),
        faces=np.array(document.get("faces") or [], np.int64),
        locations=document.get("locations") or [],
        error_bound=ErrorBound(**document["error_bound"]),
        reason=document.get("reason"),
        certificate=_to_certificate(document),
        cost=document.get("cost"),
    )


def to_steps(response: httpx2.Response) -> list[Step]:
    """Return the steps of a search."""
    return [
        Step(**{**each, "faces": np.array(each["faces"], np.int64)})
        for each in response.json()["steps"]
    ]


def to_isolines(response: httpx2.Response) -> Isolines:
    """Return isolines."""
    document = response.json()
    levels = [
        IsolineLevel(each["level"], [Isoline(**_members_of(line)) for line in each["lines"]])
        for each in document["isolines"]
    ]
    return Isolines(levels, document["chord_error"], ErrorBound(**document["error_bound"]))


def to_borders(response: httpx2.Response) -> list[Border]:
    """Return borders."""
    return [
        Border(sources=(line["sources"][0], line["sources"][1]), **_members_of(line))
        for line in response.json()["borders"]
    ]


def to_boundaries(response: httpx2.Response) -> list[Boundary]:
    """Return boundaries."""
    return [
        Boundary(vertices=np.array(line["vertices"], np.int64), **_members_of(line))
        for line in response.json()["boundaries"]
    ]


def to_loops(response: httpx2.Response) -> list[Loop]:
    """Return loops, or curves pulled tight."""
    return [Loop(**_members_of(line)) for line in response.json()["lines"]]


def to_cut(response: httpx2.Response) -> Cut:
    """Return a cut mesh."""
    answer = response.json()
    return Cut(
        mesh_id=answer["cut_mesh_id"],
        cut_from=answer["mesh_id"],
        vertices=answer["vertices"],
        faces=answer["faces"],
        parts=answer["parts"],
        snapped=answer["snapped"]["count"],
        warnings=answer["warnings"],
    )


def to_matrix(response: httpx2.Response) -> Matrix:
    """Return a matrix, from numpy's formats."""
    bound = ErrorBound(**_members_of_headers(response)["error_bound"])
    if _media_type(response) == NPY:
        return Matrix(to_array(response).astype(np.float64, copy=False), bound)
    with np.load(BytesIO(response.content), allow_pickle=False) as table:  # as SciPy writes it
        rows = np.repeat(np.arange(len(table["indptr"]) - 1), np.diff(table["indptr"]))
        return Matrix(table["data"], bound, rows, table["indices"].astype(np.int64))


def to_stored_matrix(job_id: str, response: httpx2.Response) -> StoredMatrix:
    """Return a matrix in a file, from the response with some part of it."""
    members = _members_of_headers(response)
    rows, columns = map(int, members["shape"].split(","))
    return StoredMatrix(
        job_id=job_id,
        layout=members["layout"],
        shape=(rows, columns),
        dtype=np.dtype(members["dtype"]),
        method=members["method"],
        error_bound=ErrorBound(**members["error_bound"]),
        size=int(response.headers["content-range"].rpartition("/")[2]),
        etag=response.headers["etag"].strip('"'),
    )


def to_neighbours(response: httpx2.Response) -> list[Neighbour]:
    """Return the nearest candidates, nearest first."""
    return [Neighbour(each["candidate"], each["distance"]) for each in response.json()["nearest"]]


def to_samples(response: httpx2.Response) -> Samples:
    """Return points that were spread, from JSON."""
    members = response.json()
    distances, nearest = members.get("distances"), members.get("nearest")
    return Samples(
        points=[_as_point(each) for each in members["points"]],
        positions=_positions_of(members["points"]),
        radii=_with_infinity(members["radii"]),
        costs=np.array(members["costs"], np.float64),
        converged=members["converged"],
        distances=None if distances is None else _with_infinity(distances),
        nearest=None if nearest is None else _with_minus_one(nearest),
    )


def to_cells(response: httpx2.Response) -> Cells:
    """Return cells, from JSON."""
    members = response.json()
    centroids, pairs = members["centroids"], members["neighbours"]
    return Cells(
        areas=np.array(members["areas"], np.float64),
        centroids=centroids and [each and _as_point(each) for each in centroids],
        adjacency=np.array([pair["sources"] for pair in pairs], np.int64).reshape(-1, 2),
        border_lengths=np.array([pair["length"] for pair in pairs], np.float64),
    )


def to_mean(response: httpx2.Response) -> Mean:
    """Return the mean of points, from JSON."""
    members = response.json()
    positions = _positions_of([members["mean"]])
    return Mean(
        point=_as_point(members["mean"]),
        position=positions[0] if len(positions) else None,
        variance=members["variance"],
        converged=members["converged"],
        moves=members["moves"],
    )


def _as_point(described: Mapping[str, Any]) -> Mapping[str, Any]:
    names = "vertex", "face", "barycentric"
    return {name: described[name] for name in names if described.get(name) is not None}


def _positions_of(described: Sequence[Mapping[str, Any]]) -> Floats:
    positions = [each["position"] for each in described if each["position"] is not None]
    return np.array(positions, np.float64).reshape(-1, 3)


def to_log_map(response: httpx2.Response) -> LogMap:
    """Return a log map, from numpy's format."""
    columns = to_array(response).astype(np.float64, copy=False)
    return LogMap(
        distances=columns[:, 0],
        angles=columns[:, 1],
        coordinates=columns[:, 2:4],
        bends=columns[:, 4].astype(np.int64),
        total_angle=float(_members_of_headers(response)["total_angle"]),
    )


def to_sweep(response: httpx2.Response) -> Sweep:
    """Return the steps of a sweep, from JSON."""
    document = response.json()
    columns = {name: document[name] for name in ("created", "crossed", "waiting", "trimmed")}
    windows = document["windows"].items()
    lengths = ("b0", "b1", "d0", "d1", "sigma")
    return Sweep(
        fronts=np.array(document["fronts"], np.float64),
        **{name: np.array(column, np.int64) for name, column in columns.items()},
        distances=_with_infinity(document["distances"]),
        settled=_indices(document["settled"]),
        windows={
            name: np.array(column, np.float64) if name in lengths else _indices(column)
            for name, column in windows
        },
    )


def to_lines(response: httpx2.Response) -> list[StraightLine]:
    """Return straightest lines, from JSON."""
    return [_to_line(each) for each in response.json()["lines"]]


def _to_line(line: Mapping[str, Any]) -> StraightLine:
    direction = line["end_direction"]
    return StraightLine(
        length=line["length"],
        points=np.array(line["points"] or [], np.float64).reshape(-1, 3),
        faces=np.array(line["faces"], np.int64),
        locations=line["locations"],
        stopped=line["stopped"],
        end_direction=np.nan if direction is None else direction,
    )


def to_located(response: httpx2.Response) -> list[LocatedPoint | None]:
    """Return the nearest points, None for positions that are too far away."""
    return [None if each is None else _to_located(each) for each in response.json()["points"]]


def _members_of(line: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "points": np.array(line["points"] or [], np.float64).reshape(-1, 3),
        "faces": np.array(line["faces"], np.int64),
        "closed": line["closed"],
        "length": line["length"],
        "locations": line.get("locations") or (),
    }


def _to_located(each: Mapping[str, Any]) -> LocatedPoint:
    names = ("vertex",) if "vertex" in each else ("face", "barycentric")
    point = {name: each[name] for name in names}
    return LocatedPoint(point, tuple(each["position"]), each["distance"])


def _media_type(response: httpx2.Response) -> str:
    return str(response.headers["content-type"]).partition(";")[0]


def _members_of_headers(response: httpx2.Response) -> dict[str, Any]:
    """Return the members of an answer that an array has no room for."""
    members: dict[str, Any] = {}
    for name, value in response.headers.items():
        if name.startswith("geodesic-"):
            member = name.removeprefix("geodesic-").replace("-", "_")
            members[member] = json.loads(value) if value[:1] in "[{" else value
    return members


def _indices(values: Sequence[int | None]) -> Integers:
    return np.array([-1 if each is None else each for each in values], np.int64)


def _with_infinity(values: Sequence[float | None]) -> Floats:
    numbers = np.array(values, np.float64)
    numbers[np.isnan(numbers)] = np.inf  # null
    return numbers


def _with_minus_one(values: Sequence[int | None]) -> Integers:
    return np.array([-1 if value is None else value for value in values], np.int64)
