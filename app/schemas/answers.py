"""Answers to queries."""

from typing import Any, Literal

from pydantic import BaseModel, Field

from app.schemas.meshes import Sample
from app.schemas.requests import Layout, Method

StepName = Literal["dijkstra", "shorten", "approximate", "backtrace", "exact", "path"]


class ErrorBound(BaseModel):
    """Bound of the difference between an answer and the exact one.

    Approximate distances are too short by that much at most; the length of an approximate path is
    too long by that much at most. With the method `fast` both are too long, and the bound is an
    estimate: in 19 of 20 measured fields, 99 of 100 vertices lie within it. A certified bound is
    proved for these very distances, which differ from their proved bounds by that much at most.
    """

    type: Literal["relative", "absolute"]
    value: float
    kind: Literal["guaranteed", "estimated", "certified"]


class ResolvedPoint(BaseModel):
    """A resolved point, in its canonical spelling."""

    vertex: int | None = Field(default=None, description="The vertex, if the point is one")
    face: int | None = Field(
        default=None, description="If the point is not a vertex: the lowest face that contains it"
    )
    barycentric: tuple[float, float, float] | None = Field(
        default=None, description="The weights of that face's corners"
    )
    position: tuple[float, float, float] | None = Field(
        description="Null on a mesh that is given by the lengths of its edges alone"
    )


class ResolvedCurve(BaseModel):
    """A resolved curve."""

    polyline: list[ResolvedPoint]


class ResolvedSource(ResolvedPoint):
    """A resolved source."""

    start_distance: float


class ResolvedCurveSource(ResolvedCurve):
    """A resolved source that is a curve."""

    start_distance: float


class Unreachable(BaseModel):
    """Number of missing distances, by reason."""

    disconnected: int
    beyond_max_distance: int


class Certificate(BaseModel):
    """What a proof of distances tells; as `npz` the answer is the proof itself."""

    holds: bool = Field(
        description="Whether it proves, to 1e-8 of the largest distance, what `method` promises"
    )
    relative_gap: float = Field(
        description="The largest difference of the bounds of a vertex, as a share of the largest "
        "distance"
    )
    worst_face: int = Field(description="The face that widens the gap most")
    worst_violation: float = Field(description="By how much it does, in mesh units")


class DistancesAnswer(BaseModel):
    """Distances in mesh units, or costs, ``null`` where unreachable."""

    kind: Literal["distances"]
    mesh_id: str
    method: Method | Literal["cheapest"]
    error_bound: ErrorBound
    sources: list[ResolvedSource | ResolvedCurveSource]
    targets: list[ResolvedPoint] | None = Field(default=None, description="The targets, if given")
    distances: list[float | None]
    nearest_source: list[int | None] | None = Field(
        default=None, description="Index into `sources` for each distance, if included"
    )
    gradient: list[tuple[float | None, float | None, float | None]] | None = Field(
        default=None,
        description="If included: a unit vector at each vertex, opposite to the first segment of "
        "its shortest path; three times `null` at sources and where unreachable",
    )
    lower: list[float | None] | None = Field(
        default=None,
        description="If included: proved lower bounds of the exact distances; those beyond "
        "`max_distance` have some, too",
    )
    upper: list[float | None] | None = Field(
        default=None, description="If included: lengths of paths, which bound them from above"
    )
    violations: list[float] | None = Field(
        default=None,
        description="If included: by how much each face widens the gap at most, in mesh units",
    )
    certificate: Certificate | None = Field(
        default=None, description="What the proof tells, if asked for by `certify`"
    )
    unreachable: Unreachable
    stats: dict[str, Any]
    warnings: list[str]


class Location(BaseModel):
    """A point of the surface in a face."""

    face: int
    barycentric: tuple[float, float, float]


class LineDocument(BaseModel):
    """A polyline on the surface."""

    closed: bool = Field(
        description="Whether the line leads from its last point back to the first, which is not "
        "repeated"
    )
    length: float = Field(description="The length in mesh units")
    points: list[tuple[float, float, float]] | None = Field(
        description="Null on a mesh that is given by the lengths of its edges alone"
    )
    faces: list[int] = Field(description="The face of each segment")
    locations: list[Location] | None = Field(
        default=None,
        description="The points again, on the surface: if included, and on a mesh without "
        "positions",
    )


class IsolineDocument(LineDocument):
    """A polyline of points at one distance, or of one value."""


class IsolineLevel(BaseModel):
    """The lines at one distance, or of one value."""

    level: float = Field(description="The distance in mesh units, or the value")
    lines: list[IsolineDocument] = Field(
        description="Closed lines, and open lines that end at the boundary or at an edge of three "
        "faces or more, or where values are missing; empty if no point is at that level"
    )


class IsolinesAnswer(BaseModel):
    """The lines of each level, in the order of the levels.

    Of values they are exact, with an error bound and a chord error of 0, without sources.
    """

    kind: Literal["isolines"]
    mesh_id: str
    method: Method | Literal["cheapest"]
    error_bound: ErrorBound = Field(description="Error bound of the distance of each line")
    chord_error: float = Field(
        description="Largest distance of chords from the exact lines, in mesh units"
    )
    sources: list[ResolvedSource | ResolvedCurveSource]
    isolines: list[IsolineLevel]
    stats: dict[str, Any]
    warnings: list[str]


class BorderDocument(LineDocument):
    """A polyline of points that are equally near to two sources, and no nearer to a third."""

    sources: tuple[int, int] = Field(
        description="The two sources whose territories the line separates: indices into `sources`, "
        "the lower first"
    )


class BordersAnswer(BaseModel):
    """The borders between the territories of sources: their geodesic Voronoi diagram."""

    kind: Literal["borders"]
    mesh_id: str
    chord_error: float = Field(
        description="Largest distance of chords from the exact lines, in mesh units"
    )
    sources: list[ResolvedSource | ResolvedCurveSource]
    borders: list[BorderDocument] = Field(
        description="Closed lines, and open lines that end where three territories or more meet, "
        "at the boundary, at an edge of three faces or more, or at `max_distance`"
    )
    stats: dict[str, Any]
    warnings: list[str]


class SamplesAnswer(BaseModel):
    """Points spread over the surface."""

    kind: Literal["samples"]
    mesh_id: str
    points: list[ResolvedPoint]
    radii: list[float | None] = Field(
        description="The covering radius with the points of `starts`, and after each one added; "
        "`null` while a part of the surface has no point"
    )
    covering_radius: float | None = Field(
        description="The distance of the farthest vertex from the nearest point, at the end"
    )
    costs: list[float] = Field(
        description="The sum of squared distances over the surface, before and after each "
        "iteration; never rising"
    )
    converged: bool | None = Field(
        description="Whether the last iteration moved no point; null if there were none"
    )
    distances: list[float | None] | None = Field(
        default=None, description="For `include`: in mesh units, `null` where unreachable"
    )
    nearest: list[int | None] | None = Field(
        default=None, description="For `include`: index of the nearest point of each vertex"
    )
    warnings: list[str]


class Neighbours(BaseModel):
    """Two cells that share a border."""

    sources: tuple[int, int] = Field(description="Indices into `sources`, the lower one first")
    length: float = Field(description="The length of their border, in mesh units")


class CellsAnswer(BaseModel):
    """The cells of sources."""

    kind: Literal["cells"]
    mesh_id: str
    chord_error: float
    sources: list[ResolvedSource | ResolvedCurveSource]
    areas: list[float] = Field(
        description="In mesh units squared; 0 where other sources are nearer everywhere"
    )
    centroids: list[ResolvedPoint | None] | None = Field(
        description="The middle of each cell, `null` for one without area; null if a source is a "
        "curve"
    )
    neighbours: list[Neighbours]
    warnings: list[str]


class MeanAnswer(BaseModel):
    """The mean of points on the surface: their Karcher mean."""

    kind: Literal["mean"]
    mesh_id: str
    points: list[ResolvedPoint]
    mean: ResolvedPoint
    variance: float = Field(
        description="The weighted mean of the squared distances, in mesh units squared"
    )
    converged: bool = Field(description="Whether no point near it is better")
    moves: int = Field(description="How often the search moved")
    warnings: list[str]


class LoopAnswer(BaseModel):
    """Loops that cannot be shrunk to a point, or curves pulled tight."""

    kind: Literal["loop"]
    mesh_id: str
    lines: list[LineDocument] = Field(
        description="The loop, which begins at its point; or the curves, in their order, open or "
        "closed as they were; or two loops for each handle, the shortest first"
    )
    warnings: list[str]


class BoundaryDocument(LineDocument):
    """A polyline of boundary edges, with the surface on its left."""

    vertices: list[int] = Field(description="The vertex at each point")


class BoundariesAnswer(BaseModel):
    """The boundary of the surface, longest curve first; empty for a surface without boundary."""

    kind: Literal["boundaries"]
    mesh_id: str
    boundaries: list[BoundaryDocument] = Field(
        description="Closed lines, and open lines that end at an edge of three faces or more"
    )
    warnings: list[str]


class CutAnswer(BaseModel):
    """A mesh of which curves are edges, and which is in the store like any other.

    Its arrays tell where all of it was on the mesh that was cut.
    """

    kind: Literal["cut"]
    mesh_id: str = Field(description="The mesh that was cut")
    cut_mesh_id: str = Field(
        description="The new mesh. For F faces and V vertices it has the arrays `face_of` (F): the "
        "old face that each is of; `location_faces` (V) and `location_weights` (V, 3): an old face "
        "that holds each vertex, -1 for none, and the weights in it; `curve_edges` (E, 2): "
        "vertices of the edges of curves, where they were before the surface came apart; "
        "`edge_curves` (P, 2): rows of `curve_edges` and the curves that run along them; `copy_of` "
        "(V): the vertex that each one was before the surface came apart; `parts` (F): the part "
        "that each face belongs to, bounded by curves"
    )
    vertices: int = Field(description="Number of vertices of the new mesh")
    faces: int = Field(description="Number of faces of the new mesh")
    parts: int = Field(description="Number of parts that the curves bound")
    snapped: Sample = Field(
        description="Points of curves that are within 2**-30 of a vertex or an edge, as a weight, "
        "and not on it: the curve runs through that instead. Each as a curve and a point of it"
    )
    warnings: list[str]


class SearchStep(BaseModel):
    """A step of the search for a leg; a leg leads from one stop to the next."""

    leg: int = Field(description="Number of the leg, from 0")
    name: StepName
    bound: float = Field(
        description="The smallest upper bound of the leg's length that is known after the step; "
        "after `exact`, the length"
    )
    windows: int = Field(description="Number of windows created")
    faces: list[int] = Field(description="The faces that were visited")


class Outline(BaseModel):
    """A path, or the reason why there is none."""

    status: Literal["ok", "no_path"]
    reason: Literal["disconnected", "beyond_max_distance", "beyond_max_cost"] | None = None
    length: float | None = Field(description="The length in mesh units; null without a path")
    points: list[tuple[float, float, float]] | None = Field(
        description="Null without a path, and on a mesh that is given by the lengths of its edges "
        "alone"
    )
    locations: list[Location] | None
    faces: list[int] | None = Field(description="The face of each segment of the path")
    cost: float | None = Field(
        default=None, description="With `cost`: what the path costs, which `error_bound` is about"
    )
    error_bound: ErrorBound


class PathAnswer(Outline):
    """A path from source to target, or the reason why there is none."""

    certificate: Certificate | None = Field(
        default=None,
        description="What the proof tells, if asked for by `certify`; `relative_gap` is that of "
        "the length",
    )

    kind: Literal["path"]
    mesh_id: str
    method: Method | Literal["cheapest"]
    source: ResolvedPoint
    target: ResolvedPoint
    waypoints: list[ResolvedPoint]
    warnings: list[str]


class StepsAnswer(BaseModel):
    """The steps of the search for a path."""

    kind: Literal["steps"]
    mesh_id: str
    steps: list[SearchStep] = Field(description="Leg by leg; empty where there is no path")
    warnings: list[str]


class SweepWindows(BaseModel):
    """Windows as columns: stretches of edges to which one pseudosource sends straight rays.

    A window that trimming makes shorter ends, and what is left begins as another one.
    """

    tails: list[int] = Field(description="The vertex from where `b0` and `b1` are measured")
    heads: list[int] = Field(description="The vertex at the other end of the edge")
    faces: list[int] = Field(
        description="The face that the window is about to cross, or has crossed; its rays come "
        "from the other side of the edge"
    )
    b0: list[float] = Field(description="Where it begins on the edge, in mesh units")
    b1: list[float] = Field(description="Where it ends")
    d0: list[float] = Field(description="Distance of `b0` from the pseudosource")
    d1: list[float] = Field(description="Distance of `b1`")
    sigma: list[float] = Field(description="Distance of the pseudosource from the source")
    pseudosources: list[int | None] = Field(
        description="The vertex that the rays come from; `null` for a source that is no vertex"
    )
    first: list[int] = Field(description="The step after which the window is there")
    crossed: list[int | None] = Field(
        description="The step in which it crosses its face, having waited in the queue"
    )
    last: list[int | None] = Field(
        description="The step in which trimming takes it away, or makes it shorter"
    )


class SweepAnswer(BaseModel):
    """What an exact sweep does, step by step. Step 0 is the start; columns have a row for each."""

    kind: Literal["sweep"]
    mesh_id: str
    sources: list[ResolvedPoint]
    fronts: list[float] = Field(
        description="Distance of the farthest vertex that has left the queue, in mesh units"
    )
    created: list[int] = Field(description="Windows created so far")
    crossed: list[int] = Field(description="Windows that have crossed a face so far")
    waiting: list[int] = Field(description="Windows that wait in the queue")
    trimmed: list[int] = Field(description="Windows trimmed away so far")
    distances: list[float | None] = Field(description="Of each vertex, `null` where unreachable")
    settled: list[int | None] = Field(description="The step in which each vertex left the queue")
    windows: SweepWindows
    warnings: list[str]


class PathTo(Outline):
    """The path to one of several targets."""

    target: ResolvedPoint


class PathsAnswer(BaseModel):
    """The paths from a source, in the order of their targets."""

    kind: Literal["paths"]
    mesh_id: str
    method: Method | Literal["cheapest"]
    source: ResolvedPoint | ResolvedCurve
    paths: list[PathTo]
    stats: dict[str, Any]
    warnings: list[str]


class MatrixEnd(ResolvedPoint):
    """A source or target of a matrix."""

    component: int = Field(
        description="The connected component of the mesh that contains the point. No path joins "
        "different components; other missing distances are beyond `max_distance`"
    )


class MatrixAnswer(BaseModel):
    """Distances in mesh units between many points."""

    kind: Literal["matrix"]
    mesh_id: str
    method: Method
    error_bound: ErrorBound
    layout: Layout
    sources: list[MatrixEnd]
    targets: list[MatrixEnd]
    shape: tuple[int, int] | None = Field(default=None, description="The shape of a sparse matrix")
    rows: list[int] | None = Field(
        default=None, description="Of a sparse matrix: the source of each distance"
    )
    columns: list[int] | None = Field(
        default=None, description="Of a sparse matrix: the target of each distance"
    )
    distances: list[list[float | None] | float | None] = Field(
        description="Dense: a row for each source. Pairs: one distance for each pair. In both, "
        "`null` where unreachable. Sparse: the finite distances, zeros included"
    )
    unreachable: Unreachable
    warnings: list[str]


class NearestPoint(ResolvedPoint):
    """A candidate that is among the nearest."""

    candidate: int = Field(description="Index into `candidates`")
    distance: float


class NearestAnswer(BaseModel):
    """The nearest candidates, nearest first; of equal distances the lower index goes first."""

    kind: Literal["nearest"]
    mesh_id: str
    method: Method
    error_bound: ErrorBound
    source: ResolvedPoint
    nearest: list[NearestPoint] = Field(description="Fewer than `k` if fewer are reachable")
    unreachable: Unreachable | None = Field(
        default=None,
        description="Number of missing candidates, by reason, if there are fewer than `k`",
    )
    warnings: list[str]


class LogMapAnswer(BaseModel):
    """Where all vertices lie as seen from a source: how far, and in which direction."""

    kind: Literal["log_map"]
    mesh_id: str
    source: ResolvedPoint
    total_angle: float = Field(
        description="Sum of the angles of the surface around the source, in radians"
    )
    distances: list[float | None] = Field(description="In mesh units; `null` where unreachable")
    angles: list[float | None] = Field(
        description="The angle on the surface at which the shortest path leaves the source: in "
        "radians, counter-clockwise seen from outside, from 0 up to `total_angle`. At a boundary, "
        "angles before the x axis are negative. `null` where unreachable and at the source"
    )
    coordinates: list[tuple[float | None, float | None]] = Field(
        description="Each vertex in the tangent plane; twice `null` where unreachable"
    )
    bends: list[int | None] = Field(
        description="Number of vertices that the path bends at. Behind the first bend all vertices "
        "have its direction. `null` where unreachable"
    )
    unreachable: Unreachable
    warnings: list[str]


class StraightLine(BaseModel):
    """A straightest line."""

    stopped: Literal["length", "boundary", "barrier", "vertex", "non_manifold", "collapsed"] = (
        Field(description="What it ends at; `length` if it is as long as asked for")
    )
    length: float = Field(description="The length in mesh units")
    end_direction: float | None = Field(
        description="The direction in which it would go on: an angle at its last point, in "
        "radians; null if directions have no meaning there"
    )
    points: list[tuple[float, float, float]] | None = Field(
        description="Null on a mesh that is given by the lengths of its edges alone"
    )
    locations: list[Location]
    faces: list[int] = Field(description="The face of each segment")


class TraceAnswer(BaseModel):
    """Straightest lines, in the order of the request."""

    kind: Literal["trace"]
    mesh_id: str
    starts: list[ResolvedPoint]
    lines: list[StraightLine]
    warnings: list[str]


class LocatedPoint(ResolvedPoint):
    """The point of the surface that is nearest to a position."""

    position: tuple[float, float, float]
    distance: float = Field(description="Distance from the position in mesh units")


class LocateAnswer(BaseModel):
    """The nearest points, ``null`` for each position that is farther away than allowed."""

    kind: Literal["locate"]
    mesh_id: str
    points: list[LocatedPoint | None]
    warnings: list[str]
