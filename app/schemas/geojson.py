"""GeoJSON (RFC 7946), as far as answers use it: lines and points with three coordinates."""

from typing import Any, Literal

from pydantic import BaseModel, Field

Coordinates = tuple[float, float, float]


class LineString(BaseModel):
    """A line: a path, an isoline, or a border."""

    type: Literal["LineString"]
    coordinates: list[Coordinates]


class PointGeometry(BaseModel):
    """A point."""

    type: Literal["Point"]
    coordinates: Coordinates


class Feature(BaseModel):
    """A line or a point with its properties."""

    type: Literal["Feature"]
    geometry: LineString | PointGeometry | None = Field(
        description="`null` where there is no path, no line or no point"
    )
    properties: dict[str, Any]


class FeatureCollection(BaseModel):
    """Lines or points, in the order of the JSON answer, and the other members of that answer."""

    type: Literal["FeatureCollection"]
    units: str
    features: list[Feature]
