"""Bodies and parameters of queries."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictInt,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError

from app.schemas.meshes import MeshName
from app.schemas.points import (
    LIST_TAG,
    MOST_MEMBERS,
    NAME_TAG,
    Axis,
    Count,
    Directions,
    Ends,
    FailFastList,
    NonNegative,
    Number,
    Point,
    PointOrCurve,
    Positive,
    Source,
    StrictModel,
    SurfaceCurve,
    Triple,
    tag_of_list_or_name,
)

BoundedMethod = Literal["exact", "approximate"]
Method = Literal["exact", "approximate", "fast"]
Layout = Literal["dense", "sparse", "pairs"]


def _no_boolean(value: Any) -> Any:
    if isinstance(value, bool):
        raise PydanticCustomError("number", "Input should be a number, not a boolean")
    return value


Effort = Annotated[Literal[1, 2, 4, 8], BeforeValidator(_no_boolean)]
"""A number; `Literal` by itself takes `true` for 1"""


Iterations = Annotated[StrictInt, Field(ge=0, le=1000)]


class Accuracy(StrictModel):
    """The accuracy of an answer."""

    method: Method = Field(
        default="exact",
        description="`approximate`: within an allowed error; `fast`: in one quick pass, with an "
        "estimate of the error",
    )
    relative_error: Annotated[Positive, Field(lt=1)] | None = Field(
        default=None,
        description="For `approximate`: the allowed error, as a share of the exact distance; 0.001 "
        "if neither error is given",
    )
    absolute_error: Positive | None = Field(
        default=None,
        description="For `approximate`: the allowed error in mesh units; if both errors are given, "
        "both hold",
    )


class AccuracyOrEffort(Accuracy):
    """The accuracy of an answer, or the effort of a fast one."""

    effort: Effort | None = Field(
        default=None,
        description="For `fast`: more effort takes more time and lowers the error; 2 by default. "
        "With 4 and 8 the sweep is exact where that takes no longer, as `error_bound` tells",
    )


class QueryBody(StrictModel):
    """The body of a query."""

    bounded_lists: ClassVar[Mapping[str, str]] = {
        "sources": "max_sources",
        "waypoints": "max_waypoints",
        "levels": "max_levels",
    }
    """Setting that bounds the length of a list, by its name"""
    arrays: ClassVar[Sequence[str]] = ()
    """Lists of numbers that may come in numpy's format as well, as parts of a form"""

    @model_validator(mode="before")
    @classmethod
    def _has_few_members(cls, data: Any) -> Any:
        if isinstance(data, dict) and len(data) > MOST_MEMBERS:
            message = "A query has at most {limit} members, but this one has {count}"
            raise PydanticCustomError(
                "members", message, {"limit": MOST_MEMBERS, "count": len(data)}
            )
        return data


class AmongBarriers(QueryBody):
    """A query on a mesh with blocked faces."""

    barriers: FailFastList[StrictInt] = Field(
        default=[],
        description="Indices of blocked faces. They act as holes, and paths may bend at their "
        "corners",
        examples=[[7, 8]],
    )


Slope = Annotated[
    Annotated[Literal["tobler", "naismith"], Tag(NAME_TAG)]
    | Annotated[FailFastList[tuple[Number, Positive]], Tag(LIST_TAG)],
    Discriminator(tag_of_list_or_name),
]
"""What ways cost by their slope: a rule of walkers, or pairs of a slope and its cost."""


class SurfaceCost(StrictModel):
    """What ways cost: by face, by slope, or by the product of both."""

    faces: FailFastList[Positive | None] | None = Field(
        default=None,
        description="What a unit of length costs in each face, above 0; `null` where no path goes",
    )
    slope: Slope | None = Field(
        default=None,
        description="What a unit of length on the map costs by its slope in the direction of "
        "travel: `tobler` and `naismith` are seconds a metre; or pairs of a slope, ascending, and "
        "its cost, which must be convex",
        examples=["tobler"],
    )
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"] = Field(
        default="+z", description="For `slope`: the axis of heights"
    )
    zigzag: StrictBool = Field(
        default=True,
        description="For `slope`: whether slopes beyond the pairs are climbed in zig-zag; if not, "
        "faces that are steeper are closed",
    )
    direction: Literal["from", "to"] = Field(
        default="from", description="`to`: the costs of getting to the sources"
    )
    detail: Literal["default", "fine"] = Field(
        default="default", description="`fine`: twice the time, a third of the error"
    )
    max_cost: NonNegative | None = Field(
        default=None, description="Points that cost more count as unreachable"
    )

    @model_validator(mode="after")
    def _says_what_costs(self) -> "SurfaceCost":
        if self.faces is None and self.slope is None:
            raise PydanticCustomError("cost", "Give the costs of faces, or a slope, or both")
        return self


class AskingForLines(AmongBarriers):
    """A query for lines on the surface."""

    include: FailFastList[Literal["locations"]] = Field(
        default=[],
        description="`locations`: also the points of lines as faces and weights. On a mesh without "
        "positions they come in any case",
    )


IncludedWithDistances = Literal["nearest_source", "gradient", "lower", "upper", "violations"]


class DistancesRequest(AccuracyOrEffort, AmongBarriers):
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

    sources: FailFastList[Source] = Field(min_length=1)
    targets: FailFastList[Point] | None = Field(default=None, min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="Points farther than this, in mesh units, count as unreachable"
    )
    include: FailFastList[IncludedWithDistances] = Field(
        default=[],
        description="Further values of each point, in JSON, CSV and PLY: `nearest_source`, an "
        "index into `sources`; `gradient`, the direction in which distance grows fastest, for all "
        "vertices only; with `certify`, `lower` and `upper`, the proved bounds, and of each face, "
        "in JSON only, `violations`",
    )
    certify: StrictBool = Field(
        default=False,
        description="Also prove the distances of vertices, from sources that are points. It takes "
        "about fifteen times as long as exact distances. The answer has a `certificate`, and as "
        "`npz` it is the file that `geodesic-verify` checks",
    )
    cost: SurfaceCost | None = Field(
        default=None,
        description="Find what the cheapest ways cost instead of how long the shortest are. "
        "`distances` are costs then; what is about distances does not go with it",
    )


class IsolinesRequest(Accuracy, AskingForLines):
    """Lines of equal distance from the nearest of ``sources``, or of equal ``values``.

    They are drawn at ``levels``, or at ``count`` of them.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"sources": [{"vertex": 0}], "count": 10},
                {"sources": [{"vertex": 0}, {"vertex": 7}], "levels": [0.5, 1.0]},
                {"values": [0.5, -1.0, None, 2.0], "levels": [0.0]},
            ]
        }
    )

    arrays: ClassVar[Sequence[str]] = ("values",)

    method: BoundedMethod = Field(
        default="exact",
        description="`fast` is not available: lines need windows, which it does not have",
    )
    sources: FailFastList[Source] = Field(
        default=[], description="Where distances start, at least one; give these or `values`"
    )
    values: FailFastList[Number | None] | None = Field(
        default=None,
        description="A number for each vertex, linear on each face, or `null` where there is none. "
        "Goes without `sources` and all that is about distances: `method` with its errors, "
        "`max_distance` and `chord_error`. Lines have the higher values on their left",
    )
    levels: FailFastList[Number] | None = Field(
        default=None,
        min_length=1,
        description="Distances in mesh units, greater than 0, or any values; give these or `count`",
    )
    count: Count | None = Field(
        default=None,
        description="Number of levels, evenly spaced between 0 and the largest distance of a "
        "reachable vertex, or between the lowest and the highest of `values`, both left out",
    )
    max_distance: NonNegative | None = Field(
        default=None, description="There are no lines at levels above this"
    )
    chord_error: Positive | None = Field(
        default=None,
        description="Largest distance of the returned chords from the exact lines, which are arcs "
        "inside faces, in mesh units. At least a billionth of the bounding box's diagonal; a "
        "thousandth of the mean edge length if not given",
    )
    cost: SurfaceCost | None = Field(
        default=None,
        description="Draw lines of equal cost, such as isochrones, instead of equal distance; they "
        "are straight in each face. What is about distances does not go with it",
    )


_CHORD_ERROR: Any = Field(
    default=None,
    description="Largest distance of chords from the exact lines, which are mostly hyperbolas "
    "inside faces, in mesh units. At least a billionth of the bounding box's diagonal; a "
    "thousandth of the mean edge length if not given",
)


class BordersRequest(AskingForLines):
    """The borders of the territories of ``sources``; always exact."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"sources": [{"vertex": 0}, {"vertex": 7}]}]}
    )

    sources: FailFastList[Source] = Field(min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="Territories, and with them borders, end at this distance"
    )
    chord_error: Positive | None = _CHORD_ERROR


class BoundariesRequest(AskingForLines):
    """The boundary of the surface. Blocked faces are no part of it: their rim is a boundary."""

    model_config = ConfigDict(json_schema_extra={"examples": [{}]})


class SamplesRequest(AmongBarriers):
    """Points spread over the surface, each the farthest from those before."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"count": 20}, {"radius": 0.5, "starts": [{"vertex": 0}], "iterations": 5}]
        }
    )

    count: Count | None = Field(
        default=None, description="The number of points, those of `starts` included"
    )
    radius: NonNegative | None = Field(
        default=None,
        description="The covering radius to reach, in mesh units. Give at least one of the two; "
        "the first that is reached counts",
    )
    starts: FailFastList[Point] = Field(
        default=[], description="The points to begin with; vertex 0 if there are none"
    )
    iterations: Iterations = Field(
        default=0,
        description="How often the points then move to the middle of what is nearest to each, by "
        "Lloyd's method; fewer if they converge",
    )
    include: FailFastList[Literal["distances"]] = Field(
        default=[],
        description="`distances`: also the distance of each vertex from the nearest point, and the "
        "index of that",
    )


class CellsRequest(AmongBarriers):
    """The cells of ``sources``: what is nearer to each of them than to the others."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"sources": [{"vertex": 0}, {"vertex": 7}]}]}
    )

    sources: FailFastList[Source] = Field(min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="Cells end at this distance, in mesh units"
    )
    chord_error: Positive | None = _CHORD_ERROR


class MeanRequest(AmongBarriers):
    """The point whose squared distances from ``points`` sum to the least."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"points": [{"vertex": 0}, {"vertex": 7}]}]}
    )

    points: FailFastList[Point] = Field(min_length=1)
    weights: FailFastList[NonNegative] | None = Field(
        default=None, min_length=1, description="One for each point; the same for all if not given"
    )


class LoopRequest(AskingForLines):
    """The shortest loop ``through`` a point, ``curves`` pulled tight, or the loops of handles."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"through": {"vertex": 0}},
                {"curves": [{"polyline": [0, 1, 3], "closed": True}]},
                {},
            ]
        }
    )

    through: Point | None = Field(
        default=None, description="The point that the loop begins at, and returns to"
    )
    curves: FailFastList[SurfaceCurve] | None = Field(
        default=None,
        min_length=1,
        description="Curves to pull tight: each becomes the shortest near it, with its ends where "
        "they are. The `locations` of lines in answers are such points. With neither of the two, "
        "two loops are looked for at each handle",
    )
    free_ends: bool = Field(
        default=False,
        description="Whether ends of `curves` on the boundary slide along it, to where each is "
        "shortest",
    )


class CutRequest(QueryBody):
    """A surface that is cut along ``curves``, which become edges of a new mesh."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"curves": [{"polyline": [{"vertex": 0}, {"vertex": 1}]}]},
                {
                    "curves": [{"polyline": [0, 1, 3], "closed": True}],
                    "separate": False,
                    "name": "terrain with a border",
                },
            ]
        }
    )

    curves: FailFastList[SurfaceCurve] = Field(
        min_length=1,
        description="At least one. They may cross, touch and overlap, end anywhere, pass through "
        "vertices and run along edges; one of a single point makes that a vertex",
    )
    separate: StrictBool = Field(
        default=True, description="Whether the surface comes apart along the curves"
    )
    name: MeshName | None = Field(
        default=None,
        description="Name of the new mesh for people; one that is in the store already keeps its "
        "own",
    )


class Stops(AmongBarriers):
    """A source, a target, and ``waypoints`` on the way, in their order."""

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
    waypoints: FailFastList[Point] = Field(
        default=[],
        description="The path is shortest from each stop to the next; not for `approximate`",
    )
    max_distance: NonNegative | None = Field(
        default=None, description="Longest path to look for, past all waypoints, in mesh units"
    )


EFFORT_OF_PATHS = 1
"""Their sweep only chooses between ways, which are pulled tight afterwards"""


class PathRequest(AccuracyOrEffort, Stops):
    """The shortest path from ``source`` to ``target``, past ``waypoints`` in their order."""

    effort: Effort | None = Field(
        default=None,
        description="For `fast`: more effort takes more time, and seldom gives a shorter path; "
        f"{EFFORT_OF_PATHS} by default",
    )
    certify: StrictBool = Field(
        default=False,
        description="Also prove that no path is shorter, for `exact` without waypoints, where one "
        "end is a vertex. The answer has a `certificate`, and as `npz` it is the file that "
        "`geodesic-verify` checks, with the source; with the target if that is no vertex",
    )
    cost: SurfaceCost | None = Field(
        default=None,
        description="Find the cheapest path instead of the shortest. Goes without `waypoints`, and "
        "without what is about distances",
    )


class StepsRequest(Stops):
    """The steps of the search for the exact path."""


class SweepRequest(AmongBarriers):
    """The exact sweep from ``sources``, step by step, on a mesh of at most 5000 faces."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"sources": [{"vertex": 0}], "steps": 20}]}
    )

    sources: FailFastList[Point] = Field(min_length=1)
    steps: Annotated[StrictInt, Field(ge=1, le=1000)] = Field(
        default=200, description="At most this many, of even pace but for the first"
    )


class PathsRequest(AccuracyOrEffort, AmongBarriers):
    """The shortest paths from ``source`` to each of ``targets``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"source": {"vertex": 0}, "targets": [{"vertex": 7}, {"vertex": 9}]}]
        }
    )

    source: PointOrCurve
    targets: FailFastList[Point] = Field(min_length=1)
    max_distance: NonNegative | None = Field(
        default=None, description="Targets farther than this, in mesh units, have no path"
    )
    cost: SurfaceCost | None = Field(
        default=None,
        description="Find the cheapest paths instead of the shortest: from the source, or to it "
        "where its `direction` is `to`. What is about distances does not go with it",
    )


class MatrixRequest(AccuracyOrEffort, AmongBarriers):
    """Distances from each of ``sources`` to each of ``targets``."""

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

    bounded_lists: ClassVar[Mapping[str, str]] = {}  # by their product, and the size of the body

    sources: Ends = Field(description="Points, or `all` for every vertex")
    targets: Ends = Field(
        default_factory=lambda known: known.get("sources", "all"),
        description="Points, or `all` for every vertex; the sources if not given. If they are the "
        "sources, each pair is computed once",
    )
    max_distance: NonNegative | None = Field(
        default=None, description="Points farther than this, in mesh units, count as unreachable"
    )
    layout: Layout = Field(
        default="dense",
        description="`dense`: a row for each source; `sparse`: the finite distances, with row and "
        "column; `pairs`: from each source to the target of the same index",
    )


class NearestRequest(AmongBarriers):
    """The ``k`` candidates that are geodesically nearest to ``source``."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"source": {"vertex": 0}, "candidates": [{"vertex": 7}, {"vertex": 9}], "k": 1}
            ]
        }
    )

    source: Point
    candidates: FailFastList[Point] = Field(min_length=1)
    k: Count = Field(default=1, description="Number of candidates to find, at most all of them")
    max_distance: NonNegative | None = Field(
        default=None, description="Candidates farther than this are left out"
    )


class LogMapRequest(AmongBarriers):
    """How far all vertices are from ``source``, and in which direction; always exact."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"source": {"vertex": 0}},
                {"source": {"vertex": 0}, "x_axis": {"vertex": 7}, "max_distance": 2.0},
            ]
        }
    )

    source: Point
    x_axis: Axis | None = Field(
        default=None,
        description="From where angles are measured: a point to look at, by its shortest path, or "
        "a vector in space, which is projected to the surface. If not given: the edge that leaves "
        "a vertex in its lowest face, from corner 0 to corner 1 of the lowest face for other "
        "points, and where the surface begins at a boundary",
    )
    rescale: StrictBool = Field(
        default=True,
        description="Whether `coordinates` stretch or shrink the angles around the source to a "
        "full turn",
    )
    max_distance: NonNegative | None = Field(
        default=None, description="Vertices farther than this, in mesh units, count as unreachable"
    )


class TraceRequest(AmongBarriers):
    """Straightest lines from ``starts``. Each list has one item for all lines, or one for each."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"starts": [{"vertex": 0}], "directions": [0.0, 1.5], "lengths": [2.0]},
                {"starts": [{"vertex": 0}], "directions": [[1.0, 0.0, 0.0]], "lengths": [2.0]},
            ]
        }
    )

    starts: FailFastList[Point] = Field(min_length=1)
    directions: Directions = Field(
        description="Angles, in radians, counter-clockwise from where those of a log map begin; or "
        "vectors in space, which are projected to the surface"
    )
    lengths: FailFastList[NonNegative] = Field(min_length=1, description="Lengths in mesh units")
    at_vertices: Literal["straight", "stop"] = Field(
        default="straight",
        description="`straight`: on through vertices, with equal angles on both sides; `stop`: to "
        "the first vertex",
    )


class LocateRequest(QueryBody):
    """The points of the surface that are nearest to some positions."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"points": [[1.0, 2.0, 3.0]], "max_distance": 0.5}]}
    )

    points: FailFastList[Triple] = Field(
        min_length=1, description="Positions: x, y, z in mesh units"
    )
    max_distance: NonNegative | None = Field(
        default=None, description="Largest distance of the surface from a position, in mesh units"
    )


AnswerFormat = Literal["json", "npy", "npz", "octets", "obj", "ply", "csv"]


_FORMAT: Any = Field(default=None, description="Overrides `Accept`")


class AnswerParameters(StrictModel):
    """The representation of the answer."""

    format: AnswerFormat | None = _FORMAT
    dtype: Literal["float64", "float32"] = Field(
        default="float64", description="Type of the numbers in `npy`, `npz` and `octets`"
    )


_SPELLINGS = (
    "A vertex as `12` or `v12`, a point of the edge between two vertices as `e12-13:0.3`, of a "
    "face as `f7:0.2,0.3,0.5`, or the point nearest to a position as `p1,2,3`"
)


class PathParameters(StrictModel):
    """The stops of a path, and how to find and to write it.

    Each stop is a vertex as ``12`` or ``v12``, a point of an edge as ``e12-13:0.3``, of a face as
    ``f7:0.2,0.3,0.5``, or a position as ``p1,2,3``.
    """

    source: str = Field(alias="from", description=_SPELLINGS, examples=["v0"])
    target: str = Field(alias="to", description=_SPELLINGS, examples=["f7:0.2,0.3,0.5"])
    via: list[str] = Field(
        default=[],
        description="A waypoint, in the same spellings; repeat it for several, in order",
        examples=[["v7"]],
    )
    method: Method = Field(
        default="exact",
        description="`approximate` within an error of 0.001, `fast` with an effort of "
        f"{EFFORT_OF_PATHS}",
    )
    format: AnswerFormat | None = _FORMAT
