"""Files of lines on a map: GeoJSON, GPX and CSV."""

import csv
import io
import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.costs.cheapest_path import CheapestPath
from geodesic_core.errors import NotWgs84, UnsuitableCrs
from geodesic_core.files import as_output, written
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.terrain.crs import WGS84, turned

_GPX = "http://www.topografix.com/GPX/1/1"


class _Line(NamedTuple):
    points: Floats
    """(K, 3) in the coordinates of the surface; a closed line ends where it begins"""
    degrees: Floats | None
    """(K, 2) longitude and latitude in WGS 84; None where the CRS is not known"""
    properties: dict[str, Any]


def write_map_file(
    path: str | Path,
    curves: Sequence[SurfaceCurve],
    properties: Sequence[Mapping[str, Any]],
    crs: str | None,
) -> None:
    """Write curves in the format that the suffix names.

    Raises
    ------
    InvalidArgument
        The suffix is none of these formats', or the file cannot be written.
    UnsuitableCrs
        The format needs WGS 84, and the CRS is not known.
    MissingExtra
        pyproj is not installed.
    """
    target = as_output(path, *_WRITERS)
    lines = [_as_line(*each, crs) for each in zip(curves, properties, strict=True)]
    content = _WRITERS[target.suffix.lower()](lines)
    with written(target) as file:
        file.write(content)


def _as_line(curve: SurfaceCurve, properties: Mapping[str, Any], crs: str | None) -> _Line:
    points = np.concatenate([curve.points, curve.points[:1]]) if curve.closed else curve.points
    facts = {"length": curve.length, **properties}
    if isinstance(curve, CheapestPath):
        facts = {"cost": curve.cost, **facts}
    degrees = None if crs is None else turned(points[:, :2], crs, WGS84)
    return _Line(points, degrees, facts)


def _geojson(lines: Sequence[_Line]) -> bytes:
    if any(line.degrees is None for line in lines):
        message = "the CRS is not known: the GeoJSON has the coordinates of the surface, not WGS 84"
        warnings.warn(message, NotWgs84, stacklevel=4)
    features = []
    for points, degrees, properties in lines:
        places = points[:, :2] if degrees is None else degrees
        rows = np.column_stack([places, points[:, 2]]).tolist()
        is_line = len(rows) > 1
        geometry = {
            "type": "LineString" if is_line else "Point",
            "coordinates": rows if is_line else rows[0],
        }
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def _gpx(lines: Sequence[_Line]) -> bytes:
    root = ET.Element("gpx", version="1.1", creator="geodesic-core", xmlns=_GPX)
    for points, degrees, properties in lines:
        if degrees is None:
            raise UnsuitableCrs("GPX is in WGS 84, and the CRS of the surface is not known")
        track = ET.SubElement(root, "trk")
        name = ", ".join(f"{key} {value}" for key, value in properties.items())
        ET.SubElement(track, "name").text = name
        segment = ET.SubElement(track, "trkseg")
        for (longitude, latitude), height in zip(
            degrees.tolist(), points[:, 2].tolist(), strict=True
        ):
            # GPX's own numbers have no exponents; nine digits are a tenth of a millimetre.
            place = {"lat": f"{latitude:.9f}", "lon": f"{longitude:.9f}"}
            point = ET.SubElement(segment, "trkpt", place)
            ET.SubElement(point, "ele").text = f"{height:.4f}"
    return bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True))


def _csv(lines: Sequence[_Line]) -> bytes:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    has_degrees = any(line.degrees is not None for line in lines)
    degrees_too = ["longitude", "latitude"] if has_degrees else []
    rows.writerow(["curve", "distance", "x", "y", "z", *degrees_too])
    for number, (points, degrees, _) in enumerate(lines):
        steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
        distances = np.concatenate([[0.0], np.cumsum(steps)])
        columns = [distances, points] if degrees is None else [distances, points, degrees]
        rows.writerows([number, *row] for row in np.column_stack(columns).tolist())
    return text.getvalue().encode()


_WRITERS: Mapping[str, Callable[[Sequence[_Line]], bytes]] = {
    ".geojson": _geojson,
    ".gpx": _gpx,
    ".csv": _csv,
}
