"""Points and curves of the surface, as clients write them."""

from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictInt,
    Tag,
)

T = TypeVar("T")

LARGEST_COUNT = 2**53 - 1
"""The largest integer that every reader of JSON keeps exactly"""
Count = Annotated[StrictInt, Field(ge=1, le=LARGEST_COUNT)]


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A number of JSON: an integer or a float, and neither a text nor a boolean"""
NonNegative = Annotated[Number, Field(ge=0)]
Positive = Annotated[Number, Field(gt=0)]
Triple = tuple[Number, Number, Number]
FailFastList = Annotated[list[T], Field(fail_fast=True)]
"""A list that is refused at its first faulty item: a body has room for millions of them."""

MOST_MEMBERS = 20
"""Members of an object beyond which it is refused whole: each unknown one would be an error."""


class StrictModel(BaseModel):
    """A model that refuses fields it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class VertexPoint(StrictModel):
    """A vertex."""

    vertex: StrictInt = Field(description="Index of a vertex, from 0", examples=[0])


class BareVertex(VertexPoint):
    """A vertex, written as its index alone."""


class EdgePoint(StrictModel):
    """A point of an edge."""

    edge: tuple[StrictInt, StrictInt] = Field(
        description="The two vertices that the edge joins", examples=[[0, 1]]
    )
    t: Number = Field(
        description="Share of the way from the first vertex to the second, 0 to 1", examples=[0.3]
    )


class FacePoint(StrictModel):
    """A point of a face."""

    face: StrictInt = Field(description="Index of a face, from 0", examples=[7])
    barycentric: Triple = Field(
        description="Weights of the face's corners, in their order: 0 or more, with the sum 1 up "
        "to rounding",
        examples=[[0.2, 0.3, 0.5]],
    )


class PositionPoint(StrictModel):
    """The point of the surface that is nearest to a position."""

    position: Triple = Field(description="x, y, z in mesh units", examples=[[1.0, 2.0, 3.0]])
    max_distance: NonNegative | None = Field(
        default=None, description="Largest distance of the surface from the position, in mesh units"
    )


class Start(StrictModel):
    """The member that a source adds to a point."""

    start_distance: NonNegative = Field(
        default=0.0, description="The distance at the source itself"
    )


class VertexSource(VertexPoint, Start):
    """A source at a vertex."""


class BareVertexSource(BareVertex, Start):
    """A source at a vertex, written as its index alone."""


class EdgeSource(EdgePoint, Start):
    """A source on an edge."""


class FaceSource(FacePoint, Start):
    """A source in a face."""


class PositionSource(PositionPoint, Start):
    """A source at the point of the surface that is nearest to a position."""


POINT_TAGS = {name: f"by {name}" for name in ("vertex", "edge", "face", "position", "polyline")}
"""The tag of each spelling of a point, and of curves, by the member that only it has."""
BARE_TAG = "by index"
"""The tag of a vertex that is written as its index alone"""


def _tag(value: Any) -> str | None:
    # Called for every point that is validated or serialized; a query may have 100 000.
    if type(value) is int or isinstance(value, BareVertex):
        return BARE_TAG
    fields = value if isinstance(value, dict) else getattr(value, "__dict__", ())
    if len(fields) > MOST_MEMBERS:
        return None
    for name, tag in POINT_TAGS.items():
        if name in fields:
            return tag
    return None


def _with_name(value: Any) -> Any:
    return {"vertex": value} if type(value) is int else value


_INDEX = Annotated[StrictInt, Field(description="Index of a vertex, from 0", examples=[0])]
_FROM_INDEX = BeforeValidator(_with_name, json_schema_input_type=_INDEX)

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
    Annotated[BareVertex, _FROM_INDEX, Tag(BARE_TAG)]
    | Annotated[VertexPoint, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgePoint, Tag(POINT_TAGS["edge"])]
    | Annotated[FacePoint, Tag(POINT_TAGS["face"])]
    | Annotated[PositionPoint, Tag(POINT_TAGS["position"])],
    _BY_FIELD,
]
"""A point of the surface, in one of five spellings."""


class Curve(StrictModel):
    """A curve on the surface: straight segments, each inside one face."""

    polyline: FailFastList[Point] = Field(
        min_length=1,
        description="Points, each in one face with the next; the `locations` of a path are such "
        "points",
        examples=[[{"vertex": 0}, {"vertex": 1}]],
    )


class SurfaceCurve(Curve):
    """A curve on the surface, open or closed."""

    closed: StrictBool = Field(
        default=False,
        description="Whether the curve leads from its last point back to the first, which is not "
        "repeated: as `closed` of lines in answers",
    )


class CurveSource(Curve, Start):
    """A source that is a curve: distances start at all of its points."""


PointOrCurve = Annotated[
    Annotated[BareVertex, _FROM_INDEX, Tag(BARE_TAG)]
    | Annotated[VertexPoint, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgePoint, Tag(POINT_TAGS["edge"])]
    | Annotated[FacePoint, Tag(POINT_TAGS["face"])]
    | Annotated[PositionPoint, Tag(POINT_TAGS["position"])]
    | Annotated[Curve, Tag(POINT_TAGS["polyline"])],
    _BY_FIELD_OR_CURVE,
]
"""A point or a curve where paths start."""
Source = Annotated[
    Annotated[BareVertexSource, _FROM_INDEX, Tag(BARE_TAG)]
    | Annotated[VertexSource, Tag(POINT_TAGS["vertex"])]
    | Annotated[EdgeSource, Tag(POINT_TAGS["edge"])]
    | Annotated[FaceSource, Tag(POINT_TAGS["face"])]
    | Annotated[PositionSource, Tag(POINT_TAGS["position"])]
    | Annotated[CurveSource, Tag(POINT_TAGS["polyline"])],
    _BY_FIELD_OR_CURVE,
]
"""A point or a curve where distances start, at ``start_distance``."""

LIST_TAG, NAME_TAG = "as a list", "as a name"
_POINT_TAG, _VECTOR_TAG = "as a point", "as a vector"
_ANGLES_TAG, _VECTORS_TAG = "as angles", "as vectors"
TAGS = frozenset(
    {
        BARE_TAG,
        *POINT_TAGS.values(),
        LIST_TAG,
        NAME_TAG,
        _POINT_TAG,
        _VECTOR_TAG,
        _ANGLES_TAG,
        _VECTORS_TAG,
    }
)
"""All tags: they come in the places of faults, and are no members"""


def tag_of_list_or_name(value: Any) -> str:
    """Return which of two spellings a value is meant to be in."""
    return NAME_TAG if isinstance(value, str) else LIST_TAG


Ends = Annotated[
    Annotated[FailFastList[Point], Field(min_length=1), Tag(LIST_TAG)]
    | Annotated[Literal["all"], Tag(NAME_TAG)],
    Discriminator(tag_of_list_or_name),
]
"""The points on one side of a matrix, or all vertices."""


def _tag_of_axis(value: Any) -> str:
    return _VECTOR_TAG if isinstance(value, list | tuple) else _POINT_TAG


Axis = Annotated[
    Annotated[Triple, Tag(_VECTOR_TAG)] | Annotated[Point, Tag(_POINT_TAG)],
    Discriminator(_tag_of_axis),
]
"""A direction at a point: a vector in space, or a point of the surface to look at."""


def _tag_of_directions(value: Any) -> str:
    first = value[0] if isinstance(value, list) and value else None
    return _VECTORS_TAG if isinstance(first, list | tuple) else _ANGLES_TAG


Directions = Annotated[
    Annotated[FailFastList[Number], Field(min_length=1), Tag(_ANGLES_TAG)]
    | Annotated[FailFastList[Triple], Field(min_length=1), Tag(_VECTORS_TAG)],
    Discriminator(_tag_of_directions),
]
"""Directions at some points: angles, radians, or vectors in space."""
