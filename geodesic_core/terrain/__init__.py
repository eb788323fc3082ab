"""Terrain: elevation models as surfaces, polygons burnt into them, and files for maps.

Rasters are read by rasterio, coordinates turned by pyproj, and polygons looked at by shapely, which
the extra ``terrain`` brings. Lengths are in the unit of the raster's coordinates, which heights are
in as well.
"""

from geodesic_core.terrain.burning import burn
from geodesic_core.terrain.dem import from_dem
from geodesic_core.terrain.ground import Terrain

__all__ = ["Terrain", "burn", "from_dem"]
