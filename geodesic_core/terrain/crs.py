"""Coordinate reference systems, by pyproj."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import UnsuitableCrs
from geodesic_core.extras import extra

WGS84 = "EPSG:4326"
"""Longitude and latitude, degrees, in this order here: what GeoJSON and GPX hold."""


def as_crs(given: Any) -> Any:
    """Return what stands for a CRS as one of pyproj, without heights.

    Raises
    ------
    UnsuitableCrs
        It stands for none.
    MissingExtra
        pyproj is not installed.
    """
    with extra("terrain", "pyproj", "a CRS"):
        import pyproj
    try:
        return pyproj.CRS.from_user_input(given).to_2d()
    except pyproj.exceptions.CRSError as error:
        raise UnsuitableCrs(f"crs is {given!r}, which is not known: {_first(error)}") from error


def as_map_crs(given: Any) -> Any:
    """Return the CRS of a surface, whose coordinates must be lengths.

    Raises
    ------
    UnsuitableCrs
        It stands for none, or its coordinates are angles.
    MissingExtra
        pyproj is not installed.
    """
    crs = as_crs(given)
    if crs.is_geographic or crs.is_geocentric:
        raise UnsuitableCrs(
            f"coordinates in {crs.name} are no lengths on a map: bring the raster into a projected "
            "CRS first, as gdalwarp -t_srs does"
        )
    return crs


def turned(places: Floats, start: Any, end: Any) -> Floats:
    """Return places (N, 2), x and y or longitude and latitude, in another CRS.

    Raises
    ------
    UnsuitableCrs
        One of the two is not known, or a place lies where the other has no coordinates.
    MissingExtra
        pyproj is not installed.
    """
    with extra("terrain", "pyproj", "another CRS"):
        import pyproj
    ends = as_crs(start), as_crs(end)
    transformer = pyproj.Transformer.from_crs(*ends, always_xy=True)
    found = np.stack(transformer.transform(places[:, 0], places[:, 1]), axis=1)
    if not np.isfinite(found).all():
        bad = places[~np.isfinite(found).all(axis=1)][0]
        raise UnsuitableCrs(
            f"{bad.tolist()} in {ends[0].name} has no place in {ends[1].name}: is it in this CRS?"
        )
    return found


def _first(error: Exception) -> str:
    return str(error).splitlines()[0]
