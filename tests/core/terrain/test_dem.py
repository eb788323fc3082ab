"""Elevation models: vertices are where pixels are, gaps are holes, and the rest is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
import rasterio
from numpy.testing import assert_allclose, assert_array_equal
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine, xy

import geodesic_core as gc
from tests.core.terrain.conftest import TRANSFORM, map_areas, rough

GRID = """ncols 4
nrows 3
xllcorner 1000.5
yllcorner 2000.25
cellsize 2.5
NODATA_value -99
1 2 3 4
5 6 -99 8
9 10 11 12
"""


def write(path: Path, heights: np.ndarray, **profile: object) -> Path:
    rows, columns = heights.shape[-2:]
    bands = heights.reshape(-1, rows, columns)
    shape = {"height": rows, "width": columns, "count": len(bands), "dtype": heights.dtype}
    with rasterio.open(path, "w", driver="GTiff", **shape, **profile) as file:
        file.write(bands)
    return path


@pytest.mark.parametrize("registration", ["Area", "Point"])
def test_vertices_are_the_centres_of_pixels(tmp_path: Path, registration: str) -> None:
    heights = rough().astype(np.float32)
    heights[4:7, 5] = -9999.0
    facts = {"transform": Affine(*TRANSFORM), "crs": "EPSG:32632", "nodata": -9999.0}
    path = write(tmp_path / "dem.tif", heights, **facts)
    with rasterio.open(path, "r+") as file:
        file.update_tags(AREA_OR_POINT=registration)
    land = gc.terrain.from_dem(path)
    with rasterio.open(path) as file:
        rows, columns = np.nonzero(heights != -9999.0)
        expected = np.stack(xy(file.transform, rows, columns, offset="center"), axis=1)
    assert_allclose(land.mesh.vertices[:, :2], expected, rtol=1e-15)
    assert_array_equal(land.mesh.vertices[:, 2], heights[rows, columns])
    assert "WGS 84 / UTM zone 32N" in repr(land)
    assert land.notes[1] == "The raster has 3 gaps, which are holes of the surface."
    assert len(land.mesh.faces) == 2 * (29 * 39 - 8)
    assert_allclose(map_areas(land.mesh), 50.0, rtol=1e-9)  # none is turned over
    with pytest.raises(gc.errors.NoHeight, match="nothing was measured there"):
        land.locate_xy([451_000.0 + 55.0, 5_199_000.0 - 55.0])


def test_an_ascii_grid_is_the_mesh_that_load_mesh_reads(tmp_path: Path) -> None:
    path = tmp_path / "dem.asc"
    path.write_text(GRID)
    land, mesh = gc.terrain.from_dem(path), gc.load_mesh(path)
    assert land.crs is None
    assert_allclose(land.mesh.vertices, mesh.vertices, rtol=1e-15)
    assert_array_equal(land.mesh.faces, mesh.faces)


@pytest.mark.parametrize(
    "turn", [(0.0, -10.0, 10.0, 0.0), (10.0, 0.0, 0.0, 10.0), (7.0, 7.0, 7.0, -7.0)]
)
def test_faces_look_up_however_the_raster_is_turned(turn: tuple[float, ...]) -> None:
    a, b, d, e = turn
    land = gc.terrain.from_dem(rough(5, 6), (a, b, 100.0, d, e, 200.0))
    assert_allclose(map_areas(land.mesh), 0.5 * abs(a * e - b * d))
    number = 2 * 6 + 3
    expected = [a * 3.5 + b * 2.5 + 100.0, d * 3.5 + e * 2.5 + 200.0, rough(5, 6)[2, 3]]
    assert_allclose(land.mesh.vertices[number], expected)


def test_gaps_of_arrays_are_what_they_mask_and_what_nodata_says(tmp_path: Path) -> None:
    heights = rough(6, 6)
    masked = np.ma.masked_array(heights, np.zeros((6, 6), bool))
    masked[2, 2] = np.ma.masked
    holed, valued = heights.copy(), heights.copy()
    holed[2, 2], valued[2, 2] = np.nan, 7777.0
    meshes = [
        gc.terrain.from_dem(masked, TRANSFORM).mesh,
        gc.terrain.from_dem(holed, TRANSFORM).mesh,
        gc.terrain.from_dem(valued, TRANSFORM, nodata=7777.0).mesh,
        gc.terrain.from_dem(
            write(tmp_path / "dem.tif", valued, transform=Affine(*TRANSFORM)), nodata=7777.0
        ).mesh,
    ]
    for mesh in meshes:
        assert_array_equal(mesh.vertices, meshes[0].vertices)
        assert_array_equal(mesh.faces, meshes[0].faces)
    assert (len(meshes[0].vertices), len(meshes[0].boundaries())) == (35, 2)


def test_what_is_no_elevation_model_is_refused(tmp_path: Path) -> None:
    heights, refused = rough(4, 4), pytest.raises
    with refused(gc.errors.InvalidArgument, match="does not tell where it is"):
        gc.terrain.from_dem(heights)
    with pytest.warns(NotGeoreferencedWarning):
        nowhere = write(tmp_path / "nowhere.tif", heights)
    with refused(gc.errors.InvalidArgument, match="does not tell where it is"):
        gc.terrain.from_dem(nowhere)
    facts = {"transform": Affine(*TRANSFORM)}
    with refused(gc.errors.InvalidArgument, match="has 3 bands"):
        gc.terrain.from_dem(write(tmp_path / "rgb.tif", np.stack([heights] * 3), **facts))
    with refused(gc.errors.InvalidArgument, match="no file"):
        gc.terrain.from_dem(tmp_path / "none.tif")
    (tmp_path / "text.tif").write_text("no raster")
    with refused(gc.errors.InvalidArgument, match="no raster that GDAL reads"):
        gc.terrain.from_dem(tmp_path / "text.tif")
    for transform in ((1, 2, 3), (1, 0, 0, 1, 0, 0), (np.nan,) * 6, 5, "abcdef"):
        with refused(gc.errors.InvalidArgument, match="transform is"):
            gc.terrain.from_dem(heights, transform)  # type: ignore[arg-type]
    for values in (heights[0], heights[:1], [["a", "b"]] * 2, heights > 0):
        with refused(gc.errors.InvalidArgument, match="the heights have shape"):
            gc.terrain.from_dem(values, TRANSFORM)
    with refused(gc.errors.InvalidArgument, match="it has no faces"):
        gc.terrain.from_dem(heights * np.nan, TRANSFORM)
    with refused(gc.errors.UnsuitableCrs, match="no lengths on a map"):
        gc.terrain.from_dem(heights, TRANSFORM, crs=4326)
    with refused(gc.errors.UnsuitableCrs, match="is not known"):
        gc.terrain.from_dem(heights, TRANSFORM, crs="EPSG:nowhere")


def test_other_units_than_metres_are_told() -> None:
    (_, note) = gc.terrain.from_dem(rough(3, 3), TRANSFORM, crs="EPSG:2263").notes
    assert note.startswith("Coordinates are in US survey foot")


def test_costs_are_one_for_each_face() -> None:
    land = gc.terrain.from_dem(rough(3, 3), TRANSFORM)
    assert land.with_costs([2] * 8).costs.tolist() == [2.0] * 8
    for costs in ([1.0] * 7, ["a"] * 8, 1.0):
        with pytest.raises(gc.errors.InvalidArgument, match="one for each face"):
            land.with_costs(costs)
    with pytest.raises(gc.errors.InvalidArgument, match="other costs than 1 and infinity"):
        land.with_costs([2] * 8).open_mesh()
    assert land.open_mesh() is land.mesh


# Few triangles


def heights_on(land: gc.terrain.Terrain, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return how high each face is at the centre of a pixel; NaN beside it."""
    a, b, c = np.moveaxis(land.mesh.vertices[land.mesh.faces], 1, 0)
    place = np.array(TRANSFORM).reshape(2, 3) @ [column + 0.5, row + 0.5, 1.0]
    u, v, w = b - a, c - a, place - a[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / area
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / area
    inside = np.minimum(np.minimum(s, t), 1.0 - s - t) >= -1e-9
    return np.where(inside, a[:, 2] + s * u[:, 2] + t * v[:, 2], np.nan)


@pytest.mark.parametrize("max_error", [0.05, 1.0, 10.0])
@pytest.mark.parametrize("gaps", [False, True])
def test_no_height_is_farther_than_the_error_from_few_triangles(
    max_error: float, gaps: bool
) -> None:
    heights = rough() + 3000.0
    if gaps:
        heights[4:9, 12:20] = np.nan
        heights[20, 5] = np.nan
    whole = gc.terrain.from_dem(heights, TRANSFORM)
    land = gc.terrain.from_dem(heights, TRANSFORM, max_error=max_error)
    (told,) = re.findall(r"more than (\S+) above or below", land.notes[-1])
    assert float(told) <= max_error * 1.001 + 1e-4
    assert len(land.mesh.vertices) < len(whole.mesh.vertices)
    assert (map_areas(land.mesh) > 0.0).all()
    assert set(map(tuple, land.mesh.vertices)) <= set(map(tuple, whole.mesh.vertices))
    covered = 0
    for row, column in np.ndindex(heights.shape):
        found = heights_on(land, row, column)
        found = found[np.isfinite(found)]
        if np.isnan(heights[row, column]):
            assert not len(found)
        elif len(found):
            covered += 1
            assert np.abs(found - heights[row, column]).max() <= float(told) * 1.001 + 1e-9
    assert covered >= len(whole.mesh.vertices)
    area, of_whole = map_areas(land.mesh).sum(), map_areas(whole.mesh).sum()
    assert area >= of_whole * (1.0 - 1e-9)
    if not gaps:
        assert_allclose(area, of_whole, rtol=1e-9)


@pytest.mark.parametrize("max_error", [0.0, -1.0, np.inf, np.nan, "1", True])
def test_errors_that_are_none(max_error: object) -> None:
    with pytest.raises(gc.errors.InvalidArgument, match="max_error is"):
        gc.terrain.from_dem(rough(), TRANSFORM, max_error=max_error)  # type: ignore[arg-type]
