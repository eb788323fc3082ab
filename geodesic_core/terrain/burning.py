"""Polygons burnt into a surface: their edges are cut into it, and the faces inside cost otherwise.

An edge of a polygon stands upright on the map, and cuts each face along the part of it that lies
over the face. So the parts are found by face, without walking from one to the next: gaps of the
surface, and what is off the map, need no cases of their own. What meets at an edge of two faces is
joined by the cut.
"""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.cutting.cut import cut_along
from geodesic_core.cutting.lines import Line
from geodesic_core.errors import InvalidArgument, InvalidPolygon
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.terrain.ground import Terrain
from geodesic_core.terrain.polygons import Polygons, as_polygons, shapely_for
from geodesic_core.tolerances import ALONG_EDGE

_SHORT = 8.0
"""Mean sizes of faces: longer parts of polygons have boxes in which most faces are in vain"""


def burn(
    ground: Terrain | MeshLike,
    polygons: Polygons,
    value: ArrayLike,
    *,
    crs: Any = None,
) -> Terrain:
    """Return a surface with polygons cut into it, whose faces inside have the costs of a value.

    Edges of polygons become edges of the mesh, so that a shore is where the map has it, not along
    the sides of pixels. Between their corners they are straight in x and y. Holes of polygons stay
    as they are. Where polygons overlap, the last one counts, and it replaces what was burnt before.

    Parameters
    ----------
    ground
        The surface, which must be a height over the plane: a `Terrain`, or anything else that
        `as_mesh` takes.
    polygons
        A file: GeoJSON, GeoPackage, Shapefile or another one of one layer that GDAL reads; a
        dictionary of what is in GeoJSON; a geometry of shapely; a frame or a series of GeoPandas;
        or a list of these. Polygons and multipolygons.
    value
        The cost of the faces inside, above 0, infinite where no path may go: one number, or one for
        each polygon.
    crs
        That of the polygons. By default, GeoJSON is in WGS 84, unless it names another one, other
        files and frames tell their own, and geometries are in the coordinates of the surface. Where
        the CRS of the surface is not known, all are.

    Returns
    -------
    Terrain
        Its mesh and its costs; the faces around the polygons are those of the ground, divided.

    Raises
    ------
    InvalidPolygon
        One crosses itself, is no polygon, or does not meet the surface: it lies off the map, in a
        gap, or in another CRS.
    InvalidArgument
        The value is 0, negative or NaN, there are no polygons, or the surface is not a height over
        the plane.
    UnsuitableCrs
        A CRS is not known.
    MissingExtra
        shapely or pyproj is not installed; the extra ``terrain`` brings them.

    Notes
    -----
    O(F log F), and as `cut`: a line moves by 1e-9 of an edge at most.

    Examples
    --------
    >>> land = gc.terrain.from_dem(np.zeros((5, 5)), (1, 0, 0, 0, -1, 5))
    >>> lake = {"type": "Polygon", "coordinates": [[[2, 1], [3, 2.5], [2, 4], [1, 2.5], [2, 1]]]}
    >>> shore = gc.terrain.burn(land, lake, np.inf)
    >>> wet = np.isinf(shore.costs)
    >>> round(float(shore.mesh.face_areas[wet].sum()), 9)
    3.0
    >>> ends = shore.locate_xy([[0.5, 2.5], [4.5, 2.5]])
    >>> round(gc.shortest_path(shore.open_mesh(), *ends).length, 4)  # around the northern cape
    5.0368
    """
    given = ground if isinstance(ground, Terrain) else _as_terrain(as_mesh(ground))
    shapes = as_polygons(polygons, given.crs, crs)
    values = _as_values(value, len(shapes))
    corners = _corners_of(given.mesh)
    lines = _lines_along(shapes, corners, given.mesh)
    mesh, costs = given.mesh, given.costs.copy()
    if lines:
        cut = cut_along(mesh, lines, Control(), separate=False)
        mesh, costs = cut.mesh, given.costs[cut.face_of]
        corners = _corners_of(mesh, given.mesh.origin[:2])
    middles = corners.mean(axis=1)
    for number, (shape, each) in enumerate(zip(shapes, values.tolist(), strict=True)):
        inside = _inside(shape, middles, given.mesh.origin[:2])
        if not len(inside):
            raise InvalidPolygon(
                f"polygon {number} does not meet the surface: it lies off the map or in a gap, or "
                f"is in another CRS (its corners are from {_bounds_in_words(shape)})",
                number,
            )
        costs[inside] = each
    return Terrain(mesh, costs, given.crs, given.notes)


def _as_terrain(mesh: TriangleMesh) -> Terrain:
    mesh.require_embedded("burn")
    return Terrain(mesh, np.ones(len(mesh.faces)), None, ())


def _as_values(value: ArrayLike, count: int) -> Floats:
    given = np.asarray(value)
    if given.dtype.kind not in "iuf" or given.shape not in ((), (count,)) or not (given > 0).all():
        raise InvalidArgument(
            f"value is {value!r}; it must be a number above 0, or infinite, or one for each of the "
            f"{count} polygons"
        )
    values: Floats = np.broadcast_to(given.astype(np.float64), (count,))
    return values


def _corners_of(mesh: TriangleMesh, origin: Floats | None = None) -> Floats:
    """Return the corners of faces on the map, (F, 3, 2), measured from the mesh's origin."""
    start = mesh.origin[:2] if origin is None else origin
    corners: Floats = mesh.vertices[mesh.faces][:, :, :2] - start
    return corners


def _lines_along(shapes: list[Any], corners: Floats, mesh: TriangleMesh) -> list[Line]:
    """Return the edges of polygons as lines, one for each face that an edge passes over."""
    twice = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    wrong = np.flatnonzero(twice <= 0.0 if twice.sum() >= 0.0 else twice >= 0.0)
    if len(wrong):
        raise InvalidArgument(
            f"the surface is not a height over the plane: face {wrong[0]} is upright or turned over"
        )
    segments = _segments_of(shapes) - mesh.origin[:2]
    owners, faces = _met(segments, corners)
    start, end = (_weights(segments[owners, k], corners[faces], twice[faces]) for k in range(2))
    first, last = _within(start, end)
    kept = np.flatnonzero(last > first)
    rows = faces[kept]
    ends = [_at(share[kept, None], start[kept], end[kept]) for share in (first, last)]
    return [
        Line(np.array([face, face]), np.stack(weights), np.array([face]), closed=False)
        for face, *weights in zip(rows.tolist(), *ends, strict=True)
    ]


def _segments_of(shapes: list[Any]) -> Floats:
    """Return the edges of polygons, (S, 2, 2)."""
    shapely = shapely_for("burn")
    polygons = shapely.get_parts(shapes)
    rings = chain.from_iterable([each.exterior, *each.interiors] for each in polygons)
    places = [shapely.get_coordinates(ring) for ring in rings]
    edges = [np.stack([ring[:-1], ring[1:]], axis=1) for ring in places]
    segments: Floats = np.concatenate(edges)
    return segments


def _met(segments: Floats, corners: Floats) -> tuple[Longs, Longs]:
    """Return pairs of a segment and a face whose boxes meet, or those of a part of the segment."""
    shapely = shapely_for("burn")
    low, high = corners.min(axis=1), corners.max(axis=1)
    tree = shapely.STRtree(shapely.box(*low.T, *high.T))
    size = float(np.hypot(*(high - low).T).mean())
    lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    counts = np.maximum(np.ceil(lengths / (_SHORT * size)), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(segments)), counts)
    part = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = [
        _at(((part + k) / counts[owner])[:, None], segments[owner, 0], segments[owner, 1])
        for k in range(2)
    ]
    parts, faces = tree.query(shapely.linestrings(np.stack(ends, axis=1)))
    pairs = np.unique(np.stack([owner[parts], faces], axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _weights(places: Floats, corners: Floats, twice: Floats) -> Floats:
    """Return the barycentric weights of places in faces on the map, (N, 3)."""
    away = corners - places[:, None]
    parts = [_cross(away[:, k - 2], away[:, k - 1]) for k in range(3)]
    weights: Floats = np.stack(parts, axis=1) / twice[:, None]
    return weights


def _within(start: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Return from where to where, as shares, segments lie in faces; given by weights, (N, 3).

    Weights are linear along a segment, and none is below 0 within. What is outside by rounding
    counts as on the border, so that no segment along an edge is in neither face.
    """
    change = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = (-ALONG_EDGE - start) / change
    first = np.where(change > 0.0, crossing, 0.0).max(axis=1, initial=0.0)
    last = np.where(change < 0.0, crossing, 1.0).min(axis=1, initial=1.0)
    is_beside = ((change == 0.0) & (start < -ALONG_EDGE)).any(axis=1)
    return first, np.where(is_beside, first, last)


def _at(share: Floats, start: Floats, end: Floats) -> Floats:
    """Return what is so far from the start to the end; both to the bit at 0 and 1."""
    place: Floats = (1.0 - share) * start + share * end
    return place


def _cross(first: Floats, second: Floats) -> Floats:
    product: Floats = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return product


def _inside(shape: Any, middles: Floats, origin: Floats) -> Longs:
    """Return the faces whose middles are inside of a polygon."""
    shapely = shapely_for("burn")
    low, high = np.array(shape.bounds).reshape(2, 2) - origin
    near = np.flatnonzero(((middles >= low) & (middles <= high)).all(axis=1))
    shapely.prepare(shape)
    inside: Longs = near[shapely.contains_xy(shape, middles[near] + origin)]
    return inside


def _bounds_in_words(shape: Any) -> str:
    west, south, east, north = shape.bounds
    return f"{west:g}, {south:g} to {east:g}, {north:g}"
