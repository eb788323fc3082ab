"""What goes over the wire: bodies, parameters and answers. Wire models only, no logic."""

from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    PositiveInt,
    StrictBool,
    StrictInt,
    Tag,
)

Merge = Literal["none", "exact"]
MeshFormat = Literal["obj", "off", "ply", "stl", "glb"]
SampleName = Literal["knot", "sphere", "terrain", "obstacles", "plane"]
Method = Literal["exact", "approximate"]
JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
Layout = Literal["dense", "sparse", "pairs"]
StepName = Literal["dijkstra", "shorten", "approximate", "backtrace", "exact", "path"]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Coordinate, Field(gt=0)]
Triple = tuple[Coordinate, Coordinate, Coordinate]


class StrictModel(BaseModel):
    """A model that refuses fields it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


# Requests


class VertexPoint(StrictModel):
    """A vertex."""

    vertex: StrictInt = Field(description="Index of a vertex, from 0", examples=[0])


class EdgePoint(StrictModel):
    """A point of an edge."""

    edge: tuple[StrictInt, StrictInt] = Field(
        description="The two vertices that the edge joins", examples=[[0, 1]]
    )
    t: Coordinate = Field(
        description="Share of the way from the first of them to the second, 0 to 1", examples=[0.3]
    )


class FacePoint(StrictModel):
    """A point of a face."""

    face: StrictInt = Field(description="Index of a face, from 0", examples=[7])
    barycentric: Triple = Field(
        description="Weights of the corners in their order: 0 or more, 1 in all, but for rounding",
        examples=[[0.2, 0.3, 0.5]],
    )


class PositionPoint(StrictModel):
    """The point of the surface that is nearest to a position."""

    position: Triple = Field(description="x, y, z in mesh units", examples=[[1.0, 2.0, 3.0]])
    max_distance: NonNegative | None = Field(
        default=None, description="How far the surface may be from there"
    )


class Start(StrictModel):
    """What a source adds to a point."""

    start_distance: NonNegative = Field(
        default=0.0, description="What distances count from, instead of 0"
    )


class VertexSource(VertexPoint, Start):
    """A source at a vertex."""


class EdgeSource(EdgePoint, Start):
    """A source on an edge."""


class FaceSource(FacePoint, Start):
    """A source in a face."""


class PositionSource(PositionPoint, Start):
    """A source at the point of the surface that is nearest to a position."""


POINT_TAGS = {name: f"by {name}" for name in ("vertex", "edge", "face", "position", "polyline")}
"""What tells points, written in any way, and curves apart: a field that each has, and what pydantic
calls it."""


def _tag(written: Any) -> str | None:
    # Called for every point that is read or written down; a query may have 100 000.
    fields = written if isinstance(written, dict) else getattr(written, "__dict__", ())
    for name, tag in POINT_TAGS.items():
        if name in fields:
            return tag
    return None


_WAYS = "vertex, edge and t, face and barycentric, or position"
_BY_FIELD = Discriminator(
    _tag, custom_error_type="point", custom_error_message=f"A point has {_WAYS}"
)
_BY_FIELD_OR_CURVE = Discriminator(
    _tag,
    custom_error_type="source",
    custom_error_message=f"A point has {_WAYS}; a curve has polyline",
)

Point = Annotated[
    Annotated[VertexPoint, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgePoint, Tag(POINT_TAGS["edge"])]
    | Annotated[FacePoint, Tag(POINT_TAGS["face"])]
    | Annotated[PositionPoint, Tag(POINT_TAGS["position"])],
    _BY_FIELD,
]
"""A point of the surface, in any of four ways."""


class Polyline(StrictModel):
    """A curve on the surface: straight from each point to the next, in a face that both are in."""

    polyline: list[Point] = Field(
        min_length=1,
        description="The `locations` of a path are such points",
        examples=[[{"vertex": 0}, {"vertex": 1}]],
    )


class CurveSource(Polyline, Start):
    """A source that is a curve: distances start at all of its points."""


Origin = Annotated[
    Annotated[VertexPoint, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgePoint, Tag(POINT_TAGS["edge"])]
    | Annotated[FacePoint, Tag(POINT_TAGS["face"])]
    | Annotated[PositionPoint, Tag(POINT_TAGS["position"])]
    | Annotated[Polyline, Tag(POINT_TAGS["polyline"])],
    _BY_FIELD_OR_CURVE,
]
"""A point, or a curve, where paths start."""

Source = Annotated[
    Annotated[VertexSource, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgeSource, Tag(POINT_TAGS["edge"])]
    | Annotated[FaceSource, Tag(POINT_TAGS["face"])]
    | Annotated[PositionSource, Tag(POINT_TAGS["position"])]
    | Annotated[CurveSource, Tag(POINT_TAGS["polyline"])],
    _BY_FIELD_OR_CURVE,
]
"""A point, or a curve, where distances start, at ``start_distance``."""


class Accuracy(StrictModel):
    """How exact the answer has to be."""

    method: Method = "exact"
    relative_error: Annotated[FiniteFloat, Field(gt=0, lt=1)] | None = Field(
        default=None,
        description="For `approximate`: share of the exact distance by which one may fall short; "
        "0.001 where neither error is given",
    )
    absolute_error: Annotated[FiniteFloat, Field(gt=0)] | None = Field(
        default=None,
        description="For `approximate`: the same in mesh units; where both errors are given, "
        "both hold",
    )


class AmongBarriers(StrictModel):
    """A question that is asked of a mesh without some of its faces."""

    barriers: list[StrictInt] = Field(
        default=[],
        description="Indices of faces that are blocked: holes, at whose corners paths may bend",
        examples=[[7, 8]],
    )


class DistancesRequest(Accuracy, AmongBarriers):
    """Distances from the nearest of ``sources`` to all vertices, or to ``targets`` only."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"sources": [{"vertex": 0}]},
                {
                    "sources": [{"position": [1.0, 2.0, 3.0]}],
                    "targets": [{"face": 7, "barycentric": [0.2, 0.3, 0.5]}],
                },
            ]
        }
    )

    sources: list[Source] = Field(min_length=1)
    targets: list[Point] | None = Field(default=None, min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="What is farther than this is left unreached"
    )
    include: list[Literal["nearest_source", "gradient"]] = Field(
        default=[],
        description="What else to tell of each, in JSON, CSV and PLY: `nearest_source`, its index "
        "in `sources`; `gradient`, the direction in which distance grows fastest, of all vertices "
        "only",
    )


class IsolinesRequest(Accuracy, AmongBarriers):
    """Lines of equal distance from the nearest of ``sources``: at ``levels``, or at ``count``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"sources": [{"vertex": 0}], "count": 10},
                {"sources": [{"vertex": 0}, {"vertex": 7}], "levels": [0.5, 1.0]},
            ]
        }
    )

    sources: list[Source] = Field(min_length=1)
    levels: list[Positive] | None = Field(
        default=None, min_length=1, description="Distances in mesh units; these or `count`"
    )
    count: Annotated[StrictInt, Field(ge=1)] | None = Field(
        default=None,
        description="How many levels to space evenly between 0 and the largest distance of a "
        "vertex that is reached, both left out",
    )
    max_distance: NonNegative | None = Field(
        default=None, description="There are no lines at levels above this"
    )
    chord_error: Positive | None = Field(
        default=None,
        description="How far lines may stray inside of faces, in mesh units: there they are arcs, "
        "of which the answer has chords. A thousandth of the mean edge length if not given, a "
        "billionth of the bounding box's diagonal at least",
    )


_LONGEST = "There is no path that is longer than this, past all waypoints"


class PathRequest(Accuracy, AmongBarriers):
    """The shortest path from ``source`` to ``target``, past ``waypoints`` in their order."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"source": {"vertex": 0}, "target": {"vertex": 99}},
                {"source": {"vertex": 0}, "target": {"vertex": 99}, "waypoints": [{"vertex": 7}]},
            ]
        }
    )

    source: Point
    target: Point
    waypoints: list[Point] = Field(
        default=[],
        description="The path is shortest from each stop to the next; for `exact` only",
    )
    max_distance: NonNegative | None = Field(default=None, description=_LONGEST)
    explain: StrictBool = Field(
        default=False,
        description="Also tell what each step of the search did, in `steps`; for `exact` and JSON "
        "only, and not cacheable, since it tells seconds",
    )


class PathsRequest(Accuracy, AmongBarriers):
    """The shortest paths from ``source`` to each of ``targets``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"source": {"vertex": 0}, "targets": [{"vertex": 7}, {"vertex": 9}]}]
        }
    )

    source: Origin
    targets: list[Point] = Field(min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="There is no path to what is farther than this"
    )


class MatrixRequest(AmongBarriers):
    """Exact distances from each of ``sources`` to each of ``targets``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "sources": [{"vertex": 0}, {"vertex": 1}],
                    "targets": [{"vertex": 7}, {"face": 7, "barycentric": [0.2, 0.3, 0.5]}],
                }
            ]
        }
    )

    sources: list[Point] = Field(min_length=1)
    targets: list[Point] = Field(min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="What is farther than this is left unreached"
    )
    layout: Layout = Field(
        default="dense",
        description="`dense`: a row for each source; `sparse`: what can be reached, with its row "
        "and column; `pairs`: from each source to the target of the same index",
    )


class NearestRequest(AmongBarriers):
    """The ``k`` of some ``candidates`` that are geodesically nearest to ``source``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"source": {"vertex": 0}, "candidates": [{"vertex": 7}, {"vertex": 9}], "k": 1}
            ]
        }
    )

    source: Point
    candidates: list[Point] = Field(min_length=1)
    k: Annotated[StrictInt, Field(ge=1)] = Field(
        default=1, description="How many to find, at most the number of candidates"
    )
    max_distance: NonNegative | None = Field(
        default=None, description="Candidates farther than this are left out"
    )


class LocateRequest(StrictModel):
    """The points of the surface that are nearest to some positions."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"points": [[1.0, 2.0, 3.0]], "max_distance": 0.5}]}
    )

    points: list[Triple] = Field(min_length=1, description="Positions: x, y, z in mesh units")
    max_distance: NonNegative | None = Field(
        default=None, description="How far the surface may be from each"
    )


AnswerFormat = Literal["json", "npy", "npz", "octets", "obj", "ply", "csv", "svg", "geojson"]


class AnswerParameters(StrictModel):
    """How the answer is to be written, or whether only to tell what it would take."""

    format: AnswerFormat | None = Field(default=None, description="Overrides `Accept`")
    dtype: Literal["float64", "float32"] = Field(
        default="float64", description="Of the numbers in `npy`, `npz` and `octets`"
    )
    estimate: bool = Field(
        default=False,
        description="Do not compute: answer with an `Estimate` of what it would take, in JSON",
    )


class PathAnswerParameters(AnswerParameters):
    """How the answer is to be written, and whether with the steps of the search."""

    explain: bool = Field(
        default=False, description="Also tell what each step of the search did, in `steps`"
    )


_WRITTEN = (
    "A vertex as `v12`, a point of the edge between two vertices as `e12-13:0.3`, of a face as "
    "`f7:0.2,0.3,0.5`, or what is nearest to a position as `p1,2,3`"
)


class PathParameters(PathAnswerParameters, Accuracy):
    """The stops of a path.

    Each is a vertex as ``v12``, a point of an edge as ``e12-13:0.3``, of a face as
    ``f7:0.2,0.3,0.5``, or a position as ``p1,2,3``.
    """

    source: str = Field(alias="from", description=_WRITTEN, examples=["v0"])
    target: str = Field(alias="to", description=_WRITTEN, examples=["f7:0.2,0.3,0.5"])
    via: list[str] = Field(
        default=[],
        description="A waypoint, written likewise; may be given again, in order",
        examples=[["v7"]],
    )
    max_distance: NonNegative | None = Field(default=None, description=_LONGEST)


class UploadParameters(StrictModel):
    """How the mesh of an upload is to be read, or which sample to make."""

    format: MeshFormat | None = Field(default=None, description="Overrides `Content-Type`")
    merge: Merge = Field(default="none", description="`exact` joins vertices at the same position")
    sample: SampleName | None = Field(default=None, description="Make this instead of reading one")
    faces: PositiveInt | None = Field(default=None, description="Faces of the sample, about; 20000")


class ListParameters(StrictModel):
    """Which part of a list to answer with."""

    limit: int = Field(default=50, ge=1, le=1000)
    cursor: str | None = Field(default=None, description="`next_cursor` of the previous part")


# Answers


class Sample(BaseModel):
    """How many elements of a kind there are, and the ids of the first ten; an edge has two."""

    count: int
    ids: list[int | tuple[int, int]]


class MeshDocument(BaseModel):
    """The report of a mesh in the store."""

    id: str
    vertices: int
    faces: int = Field(description="All of them, those that repeat a vertex as well")
    warnings: list[str] = Field(description="A sentence or two each, with the remedy")
    created: str = Field(description="When it was stored, RFC 3339")
    arrays: dict[str, str] = Field(description="Where its arrays can be read, by name")
    edges: int
    triangulated_polygons: int = Field(
        description="Polygons that became several faces; the array `face_map` leads back to them"
    )
    components: int
    component_vertices: Sample = Field(description="The lowest vertex of each component")
    boundary_loops: int
    euler_characteristic: int
    saddle_vertices: int
    boundary_vertices: int
    bow_tie_vertices: Sample = Field(description="Where several fans of faces meet")
    isolated_vertices: Sample = Field(description="Of no face of the surface")
    duplicate_vertices: Sample = Field(
        description="At the position of an earlier one; `merge=exact` joins them"
    )
    repeated_vertex_faces: Sample = Field(
        description="Made of fewer than three different vertices: no part of the surface"
    )
    zero_length_edges: Sample = Field(
        description="Between different vertices at one position: their ends are one place"
    )
    collapsed_faces: Sample = Field(
        description="With such an edge: what is left is an edge of other faces, or a vertex"
    )
    duplicate_faces: Sample = Field(description="Of the same three vertices as an earlier one")
    degenerate_faces: Sample = Field(description="Of the surface, but without area")
    non_manifold_edges: Sample
    inconsistent_orientation: bool
    misoriented_edges: Sample
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    mean_edge_length: float


class MeshList(BaseModel):
    """A part of the meshes in the store, in the order of their ids."""

    meshes: list[MeshDocument]
    next_cursor: str | None = None


class ErrorBound(BaseModel):
    """How far an answer can be from the exact one.

    Approximate distances are too short by that much at most; the length of an approximate path is
    too long by that much at most.
    """

    type: Literal["relative", "absolute"]
    value: float
    kind: Literal["guaranteed", "estimated"]


class ResolvedPoint(BaseModel):
    """A point as it was understood: in one spelling, however it was written."""

    vertex: int | None = Field(default=None, description="Where the point is a vertex")
    face: int | None = Field(
        default=None, description="Where it is none: the lowest face that it is in"
    )
    barycentric: tuple[float, float, float] | None = Field(
        default=None, description="The weights of that face's corners"
    )
    position: tuple[float, float, float]


class ResolvedCurve(BaseModel):
    """A curve as it was understood."""

    polyline: list[ResolvedPoint]


class ResolvedSource(ResolvedPoint):
    """A source as it was understood."""

    start_distance: float


class ResolvedCurveSource(ResolvedCurve):
    """A source that is a curve, as it was understood."""

    start_distance: float


class Unreachable(BaseModel):
    """How many distances there are not, by reason."""

    disconnected: int
    beyond_max_distance: int


class DistancesAnswer(BaseModel):
    """Distances in mesh units, ``null`` where unreachable."""

    mesh_id: str
    method: Method
    exact: bool
    error_bound: ErrorBound
    sources: list[ResolvedSource | ResolvedCurveSource]
    targets: list[ResolvedPoint] | None = Field(default=None, description="Where given")
    distances: list[float | None]
    nearest_source: list[int | None] | None = Field(
        default=None, description="Index into `sources` for each distance, where asked for"
    )
    gradient: list[tuple[float | None, float | None, float | None]] | None = Field(
        default=None,
        description="A unit vector at each vertex, against the direction in which its shortest "
        "path sets out, where asked for; `null` three times at sources and where unreachable",
    )
    unreachable: Unreachable
    stats: dict[str, Any]
    warnings: list[str]


class IsolineDocument(BaseModel):
    """A polyline of points at one distance."""

    closed: bool = Field(
        description="Whether it leads from its last point back to the first, which is not repeated"
    )
    length: float
    points: list[tuple[float, float, float]]
    faces: list[int] = Field(description="The face that each piece lies in")


class IsolineLevel(BaseModel):
    """The lines at one distance."""

    level: float = Field(description="The distance, mesh units")
    lines: list[IsolineDocument] = Field(
        description="Closed, or open where they end at the boundary, or at an edge of three faces "
        "or more; none where nothing is at that distance"
    )


class IsolinesAnswer(BaseModel):
    """The lines of each level, in the order of the levels."""

    mesh_id: str
    method: Method
    exact: bool
    error_bound: ErrorBound = Field(description="Of the distance that each line is at")
    chord_error: float = Field(description="How far chords stray from lines at most, mesh units")
    sources: list[ResolvedSource | ResolvedCurveSource]
    isolines: list[IsolineLevel]
    stats: dict[str, Any]
    warnings: list[str]


class Location(BaseModel):
    """A point of the surface in a face."""

    face: int
    barycentric: tuple[float, float, float]


class SearchStep(BaseModel):
    """What a step of the search for a leg did: a leg leads from one stop to the next."""

    leg: int = Field(description="From 0")
    name: StepName
    seconds: float
    bound: float = Field(
        description="The least upper bound of the leg's length that is known after the step; after "
        "`exact`, the length"
    )
    windows: int = Field(description="Windows created")
    faces: list[int] = Field(description="The region that was visited")


class Outline(BaseModel):
    """A path, or the reason why there is none."""

    status: Literal["ok", "no_path"]
    reason: Literal["disconnected", "beyond_max_distance"] | None = None
    length: float | None = None
    points: list[tuple[float, float, float]] | None
    locations: list[Location] | None = None
    faces: list[int] | None = Field(
        default=None, description="The face that each piece of the path crosses"
    )
    error_bound: ErrorBound


class PathAnswer(Outline):
    """A path from source to target, or the reason why there is none."""

    mesh_id: str
    method: Method
    exact: bool
    source: ResolvedPoint
    target: ResolvedPoint
    waypoints: list[ResolvedPoint]
    steps: list[SearchStep] | None = Field(
        default=None, description="Of the search, leg by leg, where asked for by `explain`"
    )
    warnings: list[str]


class PathTo(Outline):
    """The path to one of several targets."""

    target: ResolvedPoint


class PathsAnswer(BaseModel):
    """The paths from a source, in the order of their targets."""

    mesh_id: str
    method: Method
    exact: bool
    source: ResolvedPoint | ResolvedCurve
    paths: list[PathTo]
    stats: dict[str, Any]
    warnings: list[str]


class MatrixEnd(ResolvedPoint):
    """A source or target of a matrix."""

    component: int = Field(
        description="The connected component of the mesh that it is in: where source and target "
        "differ in it, there is no path; else what is missing is beyond `max_distance`"
    )


class MatrixAnswer(BaseModel):
    """Distances in mesh units between many points."""

    mesh_id: str
    method: Method
    exact: bool
    error_bound: ErrorBound
    layout: Layout
    sources: list[MatrixEnd]
    targets: list[MatrixEnd]
    shape: tuple[int, int] | None = Field(default=None, description="Of a sparse matrix")
    rows: list[int] | None = Field(
        default=None, description="Of a sparse matrix: the source of each distance"
    )
    columns: list[int] | None = Field(
        default=None, description="Of a sparse matrix: the target of each distance"
    )
    distances: list[list[float | None]] | list[float | None] = Field(
        description="Dense: a row for each source. Pairs: one for each. Both `null` where "
        "unreachable. Sparse: those that can be reached, zeros too"
    )
    unreachable: Unreachable
    warnings: list[str]


class NearestPoint(ResolvedPoint):
    """A candidate that is among the nearest."""

    candidate: int = Field(description="Index into `candidates`")
    distance: float


class NearestAnswer(BaseModel):
    """The nearest candidates, nearest first; of equal distances the lower index goes first."""

    mesh_id: str
    method: Method
    exact: bool
    error_bound: ErrorBound
    source: ResolvedPoint
    nearest: list[NearestPoint] = Field(
        description="There are fewer than `k` where fewer can be reached"
    )
    unreachable: Unreachable | None = Field(
        default=None, description="Why the other candidates are none, where there are fewer"
    )
    warnings: list[str]


class Estimate(BaseModel):
    """What an answer is likely to take, told without computing it."""

    mesh_id: str
    is_estimate: Literal[True]
    seconds: float = Field(
        description="On a free worker; meshes and machines differ from it by a factor of 3 and more"
    )
    memory_bytes: int = Field(
        description="Beside the mesh, as `GEODESIC_QUERY_MEMORY_BYTES` limits it; within a factor "
        "of 3"
    )
    response_bytes: int = Field(
        description="Of the body, before compression, within 5 %; with `max_distance`, and for "
        "paths and isolines, as if geodesics were straight, so that these take some times as much "
        "where surfaces wind"
    )
    media_type: str = Field(description="Of the response that is estimated")


class LocatedPoint(ResolvedPoint):
    """The point of the surface that is nearest to a position."""

    distance: float = Field(description="How far it is from there")


class LocateAnswer(BaseModel):
    """The nearest points, ``null`` for each position that is farther away than allowed."""

    mesh_id: str
    points: list[LocatedPoint | None]
    warnings: list[str]


class FaultDocument(BaseModel):
    """One element of the request that is wrong."""

    pointer: str = Field(description="JSON pointer into the body, or `/query/…`, `/header/…`")
    message: str


class ProblemDocument(BaseModel):
    """An error, as RFC 9457 has it."""

    type: str
    title: str
    status: int
    detail: str
    instance: str
    code: str
    request_id: str
    errors: list[FaultDocument] | None = None
    limit: float | None = None
    actual: float | None = None
    setting: str | None = None
    hint: str | None = None


class JobDocument(BaseModel):
    """A query that is answered whether its client waits or not."""

    id: str
    kind: str = Field(description="Of query, such as `distances`")
    mesh_id: str
    status: JobStatus
    progress: float = Field(description="Share of the work that is done, 0 to 1")
    created: str = Field(description="RFC 3339, as all times")
    started: str | None = Field(default=None, description="When a worker began")
    finished: str | None = None
    problem: ProblemDocument | None = Field(default=None, description="Of one that failed")
    links: dict[str, str] = Field(description="Where its results and events are")


class JobList(BaseModel):
    """A part of the jobs, the newest first."""

    jobs: list[JobDocument]
    next_cursor: str | None = None


class Health(BaseModel):
    """Whether the service lives, or is ready."""

    status: Literal["ok", "starting"]


class Index(BaseModel):
    """Where to find what."""

    service: str
    version: str
    page: str = Field(description="Whether this address has a page to show to browsers")
    links: dict[str, str]


class About(BaseModel):
    """Version, formats and the limits in force."""

    version: str
    methods: list[Method]
    mesh_formats: list[str]
    answer_formats: dict[str, str]
    samples: list[str]
    limits: dict[str, int | float] = Field(description="By the environment variable that sets it")


class ProblemCode(BaseModel):
    """What an error code means."""

    code: str
    status: int
    title: str
    meaning: str
