"""Land: a rough raster on a map, with a gap."""

import numpy as np
import pytest

import geodesic_core as gc

TRANSFORM = (10.0, 0.0, 451_000.0, 0.0, -10.0, 5_199_000.0)
"""Pixels of 10 m, north-up, in UTM zone 32"""


def rough(rows: int = 30, columns: int = 40) -> np.ndarray:
    """Return heights that no plane is near."""
    row, column = np.mgrid[:rows, :columns]
    return 20.0 * np.sin(row / 3.0) * np.cos(column / 4.0) + 0.3 * column


@pytest.fixture(scope="session")
def land() -> gc.terrain.Terrain:
    """Return 30 rows and 40 columns: from 451005 to 451395 and from 5198705 to 5198995."""
    return gc.terrain.from_dem(rough(), TRANSFORM, crs="EPSG:32632")


@pytest.fixture(scope="session")
def plain() -> gc.terrain.Terrain:
    """Return level ground of 30 by 40 units, from 0.5 to 39.5 and to 29.5, of no CRS."""
    return gc.terrain.from_dem(np.zeros((30, 40)), (1, 0, 0, 0, -1, 30))


def map_areas(mesh: gc.TriangleMesh) -> np.ndarray:
    """Return the area of each face on the map; below 0 where it is turned over."""
    x, y, _ = np.moveaxis(mesh.vertices[mesh.faces] - mesh.vertices[0], 2, 0)
    areas = x * (np.roll(y, -1, 1) - np.roll(y, 1, 1))
    return 0.5 * areas.sum(axis=1)


def ring_area(ring: np.ndarray) -> float:
    x, y = (ring - ring[0]).T
    return 0.5 * float(x @ (np.roll(y, -1) - np.roll(y, 1)))


def is_inside(place: np.ndarray, ring: np.ndarray) -> bool:
    """Tell by the crossings of a ray whether a place is in a ring of corners."""
    (x, y), start, end = place, ring, np.roll(ring, -1, axis=0)
    crosses = (start[:, 1] > y) != (end[:, 1] > y)
    share = (y - start[crosses, 1]) / (end[crosses, 1] - start[crosses, 1])
    at = start[crosses, 0] + share * (end[crosses, 0] - start[crosses, 0])
    return bool((at > x).sum() % 2)


def star(centre: tuple[float, float], radius: float, corners: int = 18) -> np.ndarray:
    """Return the corners of a star, counterclockwise, none on a side of a pixel."""
    angle = 2.0 * np.pi * (np.arange(corners) + 0.123) / corners
    away = radius * np.where(np.arange(corners) % 2, 0.61, 1.0)
    return np.stack([centre[0] + away * np.cos(angle), centre[1] + away * np.sin(angle)], axis=1)


def polygon(*rings: np.ndarray) -> dict:
    """Return GeoJSON of rings of corners."""
    closed = [np.vstack([ring, ring[:1]]).tolist() for ring in rings]
    return {"type": "Polygon", "coordinates": closed}
