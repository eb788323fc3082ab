"""Elevation models: rasters of heights as surfaces."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidArgument
from geodesic_core.extras import extra
from geodesic_core.io.grid import grid_faces
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.terrain.crs import as_map_crs
from geodesic_core.terrain.ground import Terrain
from geodesic_core.validation import is_number

Transform = Sequence[float]
"""Six numbers a, b, c, d, e, f: x = a · column + b · row + c, y = d · column + e · row + f. As
rasterio has them, whose nine are taken too."""


class _Grid(NamedTuple):
    rows: Longs
    """(V,): of each vertex"""
    columns: Longs
    """(V,)"""
    faces: Longs
    """(F, 3): counter-clockwise seen from above, where rows go south"""


class _Raster(NamedTuple):
    heights: Floats
    """(rows, columns), NaN in gaps"""
    transform: Any
    """None where the file has none"""
    crs: str | None
    """As WKT"""


def from_dem(
    source: str | Path | ArrayLike,
    transform: Transform | None = None,
    *,
    nodata: float | None = None,
    crs: Any = None,
    max_error: float | None = None,
) -> Terrain:
    r"""Return an elevation model as a surface: a vertex for each height that was measured.

    Vertices lie at the centres of pixels, so that the surface ends half a pixel inside of the
    raster's outline. (In a GeoTIFF whose pixels are points, GDAL has moved the outline by half a
    pixel, so that the centres are these points.) Four neighbours make two faces, divided from
    the first pixel of the first row to the second one of the second. Where one is missing there is
    a hole.

    Parameters
    ----------
    source
        A file, GeoTIFF, Esri ASCII grid or any other raster of one band that GDAL reads; or heights
        (rows, columns), in the unit of x and y. Values that an array masks, and those that are not
        finite, are gaps.
    transform
        Where corners of pixels are: a, b, c, d, e, f with x = a · column + b · row + c and
        y = d · column + e · row + f. An array needs it; a file may have its own.
    nodata
        A value that stands for a gap, besides those that a file declares.
    crs
        The CRS of x and y, as ``"EPSG:32632"``, or anything else that pyproj takes; by default the
        file's own, if it has one.
    max_error
        How far a measured height may lie above or below the surface, in the unit of heights. Then
        only as many vertices are taken as that needs, by greedy insertion (Delatin); None takes
        all. `Terrain.notes` tells the largest error that is left.

    Returns
    -------
    Terrain
        With costs of 1; without ``max_error`` its vertices are in the order of rows.

    Raises
    ------
    InvalidArgument
        The file cannot be read, or is no raster of one band; the heights are no numbers, or fewer
        than two rows or columns; there is no transform, or it has no area; or ``max_error`` is not
        above 0.
    UnsuitableCrs
        The CRS is not known, or its coordinates are degrees.
    MissingExtra
        rasterio, pyproj or pydelatin is not installed; the extra ``terrain`` brings them.

    Notes
    -----
    O(pixels); with ``max_error`` O(pixels · log(vertices)) in practice.

    Examples
    --------
    >>> heights = [[1.0, 2.0, -9999.0], [3.0, 4.0, 5.0]]
    >>> land = gc.terrain.from_dem(heights, (10, 0, 500, 0, -10, 900), nodata=-9999)
    >>> land.mesh.vertices[0].tolist()
    [505.0, 895.0, 1.0]
    >>> print(*land.notes, sep="\n")
    Vertices lie at the centres of pixels: the surface ends half a pixel inside of the raster.
    The raster has 1 gap, which is a hole of the surface.
    """
    raster = _read(Path(source)) if isinstance(source, str | Path) else _as_raster(source)
    transform = raster.transform if transform is None else transform
    if transform is None:
        raise InvalidArgument(
            "the raster does not tell where it is: give transform, six numbers from columns and "
            "rows to x and y"
        )
    affine = _as_affine(transform)
    crs = raster.crs if crs is None else crs
    known = None if crs is None else as_map_crs(crs)
    measured = np.isfinite(raster.heights)
    if nodata is not None:
        measured &= raster.heights != nodata
    grid, notes = _regular(measured), _notes(int((~measured).sum()), known)
    if max_error is not None:
        grid, left = _decimated(raster.heights, measured, max_error)
        what = f"{len(grid.rows):,} vertices for {measured.sum():,} measured heights"
        notes += (f"It has {what}, none of which lies more than {left:.3g} above or below it.",)
    row, column, faces = grid
    if not len(faces):
        raise InvalidArgument("no four neighbours of the raster are all measured: it has no faces")
    places = np.stack([column + 0.5, row + 0.5, np.ones(len(row))], axis=1) @ affine.T
    if np.linalg.det(affine[:, :2]) > 0.0:  # rows go north: seen from above, faces turn round
        faces = faces[:, [0, 2, 1]]
    mesh = TriangleMesh(np.column_stack([places, raster.heights[row, column]]), faces)
    return Terrain(mesh, np.ones(len(faces)), None if known is None else known.to_wkt(), notes)


def _regular(measured: NDArray[np.bool_]) -> _Grid:
    """Return two faces for each four neighbours that are all measured."""
    row, column = np.nonzero(measured)
    return _Grid(row, column, grid_faces(measured))


def _decimated(
    heights: Floats, measured: NDArray[np.bool_], max_error: float
) -> tuple[_Grid, float]:
    """Return few faces that are near all measured heights, and how near.

    Gaps count as far below: so their rims become vertices, and the faces inside are left out.
    """
    if not is_number(max_error) or not 0.0 < max_error < np.inf:
        raise InvalidArgument(f"max_error is {max_error!r}; it must be a finite number above 0")
    with extra("terrain", "pydelatin", "max_error"):
        from pydelatin import Delatin
    rows, columns = heights.shape
    known = heights[measured]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 0.0)
    far = 1e3 * (high - low + max_error)
    level = np.where(measured, heights - low, -far).astype(np.float32)
    found = Delatin(level, width=columns, height=rows, max_error=max_error)
    column, row = found.vertices[:, 0].astype(np.int64), found.vertices[:, 1].astype(np.int64)
    row = rows - 1 - row  # there the last row is at 0
    faces = found.triangles.astype(np.int64)
    faces = faces[measured[row, column][faces].all(axis=1)]
    (ax, bx, cx), (ay, by, cy) = column[faces].T, row[faces].T
    turned = (bx - ax) * (cy - ay) > (cx - ax) * (by - ay)  # seen from above, rows go down
    faces[turned] = faces[turned][:, [0, 2, 1]]
    used, faces = np.unique(faces, return_inverse=True)
    rounded = float(np.finfo(np.float32).eps) * float(high - low)
    grid = _Grid(row[used], column[used], faces.reshape(-1, 3))
    return grid, float(found.error) + rounded


def _notes(gaps: int, crs: Any) -> tuple[str, ...]:
    notes = [
        "Vertices lie at the centres of pixels: the surface ends half a pixel inside of the raster."
    ]
    if gaps:
        what = "1 gap, which is a hole" if gaps == 1 else f"{gaps} gaps, which are holes"
        notes.append(f"The raster has {what} of the surface.")
    unit = "metre" if crs is None else crs.axis_info[0].unit_name
    if unit != "metre":
        notes.append(
            f"Coordinates are in {unit}: heights must be as well, and what Tobler's and Naismith's "
            "rules tell is for metres."
        )
    return tuple(notes)


def _as_affine(transform: Any) -> Floats:
    """Return the first two rows of a transform, (2, 3)."""
    try:
        numbers = np.asarray(tuple(transform), np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape not in ((6,), (9,)) or not np.isfinite(numbers).all():
        raise InvalidArgument(f"transform is {transform!r}; it must be six finite numbers")
    affine: Floats = numbers[:6].reshape(2, 3)
    if np.linalg.det(affine[:, :2]) == 0.0:
        raise InvalidArgument(f"transform is {numbers.tolist()}; its pixels have no area")
    return affine


def _as_raster(heights: ArrayLike) -> _Raster:
    try:
        given: Any = np.ma.asarray(heights)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"the heights are no array: {error}") from error
    if given.dtype.kind not in "iuf" or given.ndim != 2 or min(given.shape) < 2:
        raise InvalidArgument(
            f"the heights have shape {given.shape} and type {given.dtype}; they must be numbers, "
            "two rows and columns or more"
        )
    return _Raster(given.astype(np.float64).filled(np.nan), None, None)


def _read(path: Path) -> _Raster:
    """Read a raster of one band."""
    with extra("terrain", "rasterio", "from_dem of a file"):
        import rasterio
    if not path.is_file():
        raise InvalidArgument(f"there is no file {path}")
    with warnings.catch_warnings():
        # A file without a transform has the identity, and is refused below.
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        try:
            with rasterio.open(path) as file:
                if file.count != 1:
                    raise InvalidArgument(f"{path} has {file.count} bands; heights are one")
                band = file.read(1, masked=True)
                scale, offset = file.scales[0], file.offsets[0]
                transform, crs = file.transform, file.crs
        except rasterio.errors.RasterioError as error:
            raise InvalidArgument(f"{path} is no raster that GDAL reads: {error}") from error
    heights = _as_raster(band).heights * scale + offset
    given = None if transform.is_identity else tuple(transform)
    return _Raster(heights, given, crs.to_wkt() if crs else None)
