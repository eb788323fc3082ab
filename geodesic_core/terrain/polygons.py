"""Polygons as maps have them: GeoJSON, GeoPackage and other files, GeoPandas and shapely."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_core.errors import InvalidArgument, InvalidPolygon, UnsuitableCrs
from geodesic_core.extras import extra
from geodesic_core.terrain.crs import WGS84, turned

Polygons = Any
"""A path of a file: GeoJSON, GeoPackage or another one that GDAL reads; a dictionary of what is in
GeoJSON; what has ``__geo_interface__``, as geometries of shapely and frames of GeoPandas have; or
several of them"""


def shapely_for(call: str) -> Any:
    """Return shapely, of which no types are declared.

    Raises
    ------
    MissingExtra
        It is not installed.
    """
    with extra("terrain", "shapely", call):
        import shapely
    return shapely


def as_polygons(given: Polygons, ground: str | None, crs: Any) -> list[Any]:
    """Return polygons as shapely's, in the CRS of a surface; ``crs`` is that of all, if given.

    Raises
    ------
    InvalidArgument
        They are nothing that holds polygons, or there are none.
    InvalidPolygon
        One is no polygon, or crosses itself.
    UnsuitableCrs
        Their CRS is not known, or that of the surface where theirs is given.
    MissingExtra
        shapely or pyproj is not installed.
    """
    shapely = shapely_for("burn")
    if crs is not None and ground is None:
        raise UnsuitableCrs("the polygons have a CRS, but that of the surface is not known")
    found = [
        _as_polygon(shapely, number, geometry, own if crs is None else crs, ground)
        for number, (geometry, own) in enumerate(_geometries(given))
    ]
    if not found:
        raise InvalidArgument("there are no polygons: give at least one")
    return found


def _geometries(given: Polygons) -> Iterator[tuple[Any, Any]]:
    """Yield geometries as GeoJSON has them, each with its CRS; None for that of the surface."""
    if isinstance(given, str | Path):
        yield from _of_file(Path(given))
    elif hasattr(given, "__geo_interface__"):
        yield from _of_geojson(given.__geo_interface__, getattr(given, "crs", None))
    elif isinstance(given, Mapping):
        yield from _of_geojson(given, WGS84)
    elif isinstance(given, Sequence):
        for each in given:
            yield from _geometries(each)
    else:
        raise InvalidArgument(f"a {type(given).__name__} holds no polygons")


def _of_file(path: Path) -> Iterator[tuple[Any, Any]]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"cannot read {path}: {error.strerror}") from error
    if path.suffix.lower() not in (".json", ".geojson"):
        yield from _of_layer(path)
        return
    try:
        document = json.loads(content)
    except ValueError as error:
        raise InvalidArgument(f"{path} is no GeoJSON: {error}") from error
    yield from _of_geojson(document, WGS84)


def _of_layer(path: Path) -> Iterator[tuple[Any, Any]]:
    """Yield the geometries of the only layer of a file that GDAL reads."""
    with extra("terrain", "pyogrio", "burn"):
        import pyogrio
    try:
        layers = [str(name) for name, _ in pyogrio.list_layers(path)]
        if len(layers) != 1:
            raise InvalidArgument(
                f"{path} has {len(layers)} layers ({', '.join(layers)}): write the one that is "
                "meant to a file of its own"
            )
        about, _, geometries, _ = pyogrio.raw.read(path, columns=[])
    except pyogrio.errors.DataSourceError as error:
        raise InvalidArgument(f"{path} holds no polygons: {error}") from error
    for geometry in shapely_for("burn").from_wkb(geometries):
        yield geometry, about["crs"]


def _of_geojson(document: Any, crs: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the geometries of GeoJSON; a CRS that it names, as it did before 2016, counts."""
    if not isinstance(document, Mapping):
        raise InvalidArgument(f"GeoJSON is an object, not a {type(document).__name__}")
    try:
        named = (document.get("crs") or {}).get("properties", {}).get("name")
        crs = named if isinstance(named, str) else crs
        if document["type"] == "FeatureCollection":
            for feature in document["features"]:
                yield feature["geometry"], crs
        elif document["type"] == "Feature":
            yield document["geometry"], crs
        else:
            yield document, crs
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidArgument(f"the GeoJSON lacks a part: {error!r}") from error


def _as_polygon(shapely: Any, number: int, geometry: Any, crs: Any, ground: str | None) -> Any:
    try:
        with np.errstate(invalid="ignore"):  # NaN is refused below
            polygon = shapely.force_2d(shapely.geometry.shape(geometry))
    except Exception as error:  # any failure of a parser
        raise InvalidPolygon(f"polygon {number} is no geometry: {error}", number) from error
    if polygon.geom_type not in ("Polygon", "MultiPolygon") or polygon.is_empty:
        raise InvalidPolygon(f"polygon {number} is a {polygon.geom_type} without area", number)
    if not np.isfinite(shapely.get_coordinates(polygon)).all():
        raise InvalidPolygon(f"polygon {number} has corners that are no numbers", number)
    if crs is not None and ground is not None:
        polygon = shapely.transform(polygon, lambda places: turned(places, crs, ground))
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon)
        raise InvalidPolygon(f"polygon {number} crosses or touches itself: {reason}", number)
    return polygon
