"""GeoJSON: lines and points as features, in the units of the mesh."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.headers import headers_of
from app.encoding.json_document import dumped
from app.encoding.views import Line, PointFeature

_UNITS = "those of the mesh, x, y and z: neither longitude nor latitude"


def to_geojson(answer: Answer) -> Encoded:
    """Encode lines or points; the other members of the answer become those of the collection."""
    if answer.lines is not None:
        features = map(_of_line, answer.lines())
    else:
        assert answer.points is not None, "an answer in GeoJSON has lines or points"  # noqa: S101
        features = map(_of_point, answer.points())
    members = {name: value for name, value in answer.members.items() if name not in answer.shown}
    return Encoded(_written(members, features), headers_of(answer, answer.shown))


def _written(members: Mapping[str, Any], features: Iterable[Mapping[str, Any]]) -> Iterator[Buffer]:
    head = dumped({"type": "FeatureCollection", "units": _UNITS, **members})
    yield head[:-1] + b',"features":['
    for i, feature in enumerate(features):
        yield (b",\n" if i else b"\n") + dumped({"type": "Feature", **feature})
    yield b"]}\n"


def _of_line(line: Line) -> Mapping[str, Any]:
    points: Any = line.points
    match len(points):
        case 0:
            geometry = None
        case 1:
            geometry = {"type": "Point", "coordinates": points[0]}
        case _:
            if line.is_closed:
                points = [*points.tolist(), points[0].tolist()]
            geometry = {"type": "LineString", "coordinates": points}
    return {"geometry": geometry, "properties": line.properties}


def _of_point(point: PointFeature) -> Mapping[str, Any]:
    geometry = {"type": "Point", "coordinates": point.position} if point.position else None
    return {"geometry": geometry, "properties": point.properties}
