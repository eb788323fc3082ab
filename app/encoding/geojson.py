"""GeoJSON: lines and points as features, in the units of the mesh."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.headers import headers_of
from app.encoding.json_document import dumped
from app.encoding.views import Line, Place

_UNITS = "those of the mesh, x, y and z: neither longitude nor latitude"


def to_geojson(answer: Answer) -> Encoded:
    """Encode lines or places; members of the answer beside them are those of the collection."""
    if answer.lines is not None:
        features = map(_of_line, answer.lines())
    else:
        assert answer.places is not None, "what comes as GeoJSON has lines or places"  # noqa: S101
        features = map(_of_place, answer.places())
    told = {name: value for name, value in answer.members.items() if name not in answer.shown}
    return Encoded(_written(told, features), headers_of(answer, answer.shown))


def _written(told: Mapping[str, Any], features: Iterable[Mapping[str, Any]]) -> Iterator[Buffer]:
    head = dumped({"type": "FeatureCollection", "units": _UNITS, **told})
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
    return {"geometry": geometry, "properties": line.told}


def _of_place(place: Place) -> Mapping[str, Any]:
    geometry = {"type": "Point", "coordinates": place.position} if place.position else None
    return {"geometry": geometry, "properties": place.told}
