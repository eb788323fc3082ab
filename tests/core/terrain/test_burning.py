"""Polygons burnt into a surface: shores are where maps have them, whatever the pixels are."""

import json
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyogrio
import pyproj
import pytest
import shapely
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc
from geodesic_core.tolerances import ALONG_EDGE, MERGE
from tests.core.terrain.conftest import is_inside, map_areas, polygon, ring_area, star


def middles(mesh: gc.TriangleMesh) -> np.ndarray:
    return mesh.vertices[mesh.faces][:, :, :2].mean(axis=1)


def test_faces_of_a_polygon_are_those_inside_to_the_shore(land: gc.terrain.Terrain) -> None:
    shore = star((451_203.3, 5_198_846.1), 97.0)
    burnt = gc.terrain.burn(land, shapely.Polygon(shore), np.inf)
    areas, wet = map_areas(burnt.mesh), np.isinf(burnt.costs)
    assert areas.min() >= 0.0
    assert areas[wet].sum() == pytest.approx(ring_area(shore), rel=1e-9)
    assert areas.sum() == pytest.approx(390.0 * 290.0, rel=1e-12)
    thick = areas > 1e-6
    inside = [is_inside(each, shore) for each in middles(burnt.mesh)[thick]]
    assert_array_equal(wet[thick], inside)
    assert_array_equal(burnt.mesh.vertices[: len(land.mesh.vertices)], land.mesh.vertices)
    assert burnt.crs == land.crs
    # The surface is the old one: new vertices lie in its faces.
    new = burnt.mesh.vertices[len(land.mesh.vertices) :]
    on_old = [land.mesh.position(point)[2] for point in land.locate_xy(new[:, :2])]
    assert_allclose(new[:, 2], on_old, atol=1e-7)


def around(start: np.ndarray, end: np.ndarray, corners: np.ndarray) -> float:
    """Return the length of the shorter way around a convex polygon that parts two places."""
    lengths = []
    for side in (1.0, -1.0):
        across = np.array([-(end - start)[1], (end - start)[0]]) * side
        chain = [start]
        points = [*corners[(corners - start) @ across > 0.0], end]
        while chain[-1] is not end:  # wrap a string around what is on this side
            here = chain[-1]
            away = [p - here for p in points]
            angles = [np.arctan2(a @ across, a @ (end - start)) for a in away]
            best = max(range(len(points)), key=lambda i: (angles[i], np.hypot(*away[i])))
            chain.append(points.pop(best))
        lengths.append(sum(float(np.hypot(*(b - a))) for a, b in pairwise(chain)))
    return min(lengths)


@pytest.mark.parametrize("seed", range(3))
def test_a_lake_is_walked_around_on_its_true_shore(plain: gc.terrain.Terrain, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    lake = np.stack([20.0 + 9.0 * np.cos(angle), 15.0 + 9.0 * np.sin(angle)], axis=1)
    start, end = np.array([4.2, 14.6]), np.array([36.1, 15.3])
    burnt = gc.terrain.burn(plain, polygon(lake), np.inf)
    ends = burnt.locate_xy([start, end])
    expected = around(start, end, lake)
    assert expected > np.hypot(*(end - start))
    path = gc.shortest_path(burnt.open_mesh(), *ends)
    assert path.length == pytest.approx(expected, rel=1e-8)
    cheapest = gc.cheapest_path(burnt.mesh, *ends, burnt.costs)
    assert expected * (1 - 1e-8) <= cheapest.length <= expected * 1.002


def test_islands_and_several_polygons(plain: gc.terrain.Terrain) -> None:
    shore, island = star((12.3, 14.9), 9.0), star((12.1, 15.2), 3.0)[::-1]
    wood = star((28.7, 15.1), 7.0)
    two = {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {}, "geometry": polygon(shore, island)},
            {"type": "Feature", "properties": {}, "geometry": polygon(wood)},
        ],
    }
    burnt = gc.terrain.burn(plain, two, [np.inf, 2.5])
    areas = map_areas(burnt.mesh)
    expected = ring_area(shore) + ring_area(island)
    assert areas[np.isinf(burnt.costs)].sum() == pytest.approx(expected, rel=1e-9)
    assert areas[burnt.costs == 2.5].sum() == pytest.approx(ring_area(wood), rel=1e-9)
    with pytest.raises(gc.errors.NoPath):
        gc.shortest_path(
            burnt.mesh.with_barriers(np.flatnonzero(np.isinf(burnt.costs))),
            *burnt.locate_xy([[12.1, 15.2], [1.0, 1.0]]),
        )
    both = shapely.MultiPolygon([(shore, [island]), (wood, [])])
    again = gc.terrain.burn(plain, both, 3.0)
    assert map_areas(again.mesh)[again.costs == 3.0].sum() == pytest.approx(
        expected + ring_area(wood), rel=1e-9
    )


def test_what_is_burnt_later_counts(plain: gc.terrain.Terrain) -> None:
    wide = np.array([[10.2, 10.2], [20.7, 10.2], [20.7, 20.7], [10.2, 20.7]])
    narrow = wide + np.array([5.25, 0.0])
    burnt = gc.terrain.burn(gc.terrain.burn(plain, polygon(wide), 2.0), polygon(narrow), 3.0)
    at_once = gc.terrain.burn(plain, [polygon(wide), polygon(narrow)], [2.0, 3.0])
    for each in (burnt, at_once):
        areas = map_areas(each.mesh)
        assert areas[each.costs == 2.0].sum() == pytest.approx(5.25 * 10.5)
        assert areas[each.costs == 3.0].sum() == pytest.approx(10.5**2)


def test_polygons_may_reach_over_gaps_and_off_the_map() -> None:
    heights = np.zeros((30, 40))
    heights[10:20, 10:20] = np.nan  # without faces from x = 9.5 to 20.5, y = 9.5 to 20.5
    holed = gc.terrain.from_dem(heights, (1, 0, 0, 0, -1, 30))
    lake = np.array([[-5.0, 12.25], [25.25, 12.25], [25.25, 16.75], [-5.0, 16.75]])
    burnt = gc.terrain.burn(holed, polygon(lake), np.inf)
    wet = map_areas(burnt.mesh)[np.isinf(burnt.costs)].sum()
    assert wet == pytest.approx((25.25 - 0.5 - 11.0) * 4.5, rel=1e-9)
    everywhere = np.array([[-9.0, -9.0], [99.0, -9.0], [99.0, 99.0], [-9.0, 99.0]])
    whole = gc.terrain.burn(holed, polygon(everywhere), 4.0)
    assert whole.mesh is holed.mesh
    assert (whole.costs == 4.0).all()


@pytest.mark.parametrize("shift", [0.0, 0.3, -0.3])
def test_along_edge(land: gc.terrain.Terrain, shift: float) -> None:
    """Edges along those of the mesh are there already, also where they are off by rounding."""
    assert ALONG_EDGE < MERGE
    corners = np.array([[3, 4], [3, 20], [13, 30], [23, 30], [23, 4]])  # rows and columns
    places = land.mesh.vertices[corners @ [40, 1], :2] + shift * ALONG_EDGE * 10.0
    burnt = gc.terrain.burn(land, shapely.Polygon(places), np.inf)
    assert_array_equal(burnt.mesh.vertices, land.mesh.vertices)
    assert_array_equal(burnt.mesh.faces, land.mesh.faces)
    inside = np.isinf(burnt.costs)
    assert map_areas(burnt.mesh)[inside].sum() == pytest.approx(abs(ring_area(places)), rel=1e-9)


def test_any_surface_that_is_a_height_is_taken() -> None:
    plane = gc.samples.plane(50)
    square = np.array([[0.21, 0.2], [0.6, 0.2], [0.6, 0.7], [0.21, 0.7]])
    burnt = gc.terrain.burn(plane, polygon(square), 2.0)
    areas = map_areas(burnt.mesh)
    assert areas[burnt.costs == 2.0].sum() == pytest.approx(0.39 * 0.5, rel=1e-9)
    assert burnt.crs is None
    with pytest.raises(gc.errors.InvalidArgument, match="not a height over the plane"):
        gc.terrain.burn(gc.samples.sphere(80), polygon(square), 2.0)


def test_coordinates_are_turned_as_the_files_say(land: gc.terrain.Terrain, tmp_path: Path) -> None:
    shore = star((451_203.3, 5_198_846.1), 97.0)
    at_home = gc.terrain.burn(land, shapely.Polygon(shore), 2.0)
    expected = map_areas(at_home.mesh)[at_home.costs == 2.0].sum()
    to_wgs84 = pyproj.Transformer.from_crs(32632, 4326, always_xy=True)
    degrees = np.stack(to_wgs84.transform(*shore.T), axis=1)
    (tmp_path / "lake.geojson").write_text(json.dumps(polygon(degrees)))
    old = polygon(shore) | {"crs": {"type": "name", "properties": {"name": "EPSG:32632"}}}
    frame = SimpleNamespace(__geo_interface__=polygon(shore), crs="EPSG:32632")
    for given, crs in [
        (tmp_path / "lake.geojson", None),
        (polygon(degrees), None),
        ({"type": "Feature", "geometry": polygon(degrees)}, None),
        (old, None),
        (frame, None),
        (shapely.Polygon(degrees), "EPSG:4326"),
    ]:
        burnt = gc.terrain.burn(land, given, 2.0, crs=crs)
        found = map_areas(burnt.mesh)[burnt.costs == 2.0].sum()
        assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "driver"), [("lakes.gpkg", "GPKG"), ("lakes.shp", "ESRI Shapefile")]
)
def test_files_of_one_layer_are_as_their_polygons(
    land: gc.terrain.Terrain, tmp_path: Path, name: str, driver: str
) -> None:
    shores = [shapely.Polygon(star((451_103.3 + 180.0 * i, 5_198_846.1), 41.0)) for i in range(2)]
    expected = gc.terrain.burn(land, shores, [2.0, 3.0])
    write_layer(tmp_path / name, shores, driver=driver)
    found = gc.terrain.burn(land, tmp_path / name, [2.0, 3.0])
    placed = [np.unique(each.mesh.vertices.round(6), axis=0) for each in (found, expected)]
    assert_array_equal(*placed)  # a Shapefile has its rings clockwise
    assert_areas_are_those_of(expected, found)

    to_wgs84 = pyproj.Transformer.from_crs(32632, 4326, always_xy=True)
    degrees = [shapely.transform(shore, to_wgs84.transform, interleaved=False) for shore in shores]
    write_layer(tmp_path / name, degrees, driver=driver, crs="EPSG:4326")
    assert_areas_are_those_of(expected, gc.terrain.burn(land, tmp_path / name, [2.0, 3.0]))


def assert_areas_are_those_of(expected: gc.terrain.Terrain, found: gc.terrain.Terrain) -> None:
    for value in (2.0, 3.0):
        areas = [map_areas(each.mesh)[each.costs == value].sum() for each in (expected, found)]
        assert areas[1] == pytest.approx(areas[0], rel=1e-6)


def write_layer(
    path: Path, polygons: list[shapely.Polygon], *, crs: str = "EPSG:32632", **options: Any
) -> None:
    names: list[np.ndarray] = [np.arange(len(polygons))]
    pyogrio.raw.write(
        path, shapely.to_wkb(polygons), names, ["id"], geometry_type="Polygon", crs=crs, **options
    )


def test_files_of_several_layers_or_none_are_refused(
    land: gc.terrain.Terrain, tmp_path: Path
) -> None:
    shore = shapely.Polygon(star((451_203.3, 5_198_846.1), 97.0))
    path = tmp_path / "map.gpkg"
    write_layer(path, [shore], layer="lakes")
    write_layer(path, [shore], layer="woods")
    with pytest.raises(gc.errors.InvalidArgument, match=r"2 layers .lakes, woods.: write"):
        gc.terrain.burn(land, path, 2.0)
    path.write_bytes(path.read_bytes()[:999])
    with pytest.raises(gc.errors.InvalidArgument, match="holds no polygons"):
        gc.terrain.burn(land, path, 2.0)
    with pytest.raises(gc.errors.InvalidArgument, match=r"missing\.gpkg: No such file"):
        gc.terrain.burn(land, tmp_path / "missing.gpkg", 2.0)


def test_polygons_that_are_none_are_refused(land: gc.terrain.Terrain, tmp_path: Path) -> None:
    refused, burn = pytest.raises, gc.terrain.burn
    good = shapely.Polygon(star((451_203.3, 5_198_846.1), 97.0))
    bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    with refused(gc.errors.InvalidPolygon, match="1 crosses or touches itself: Self-i") as told:
        burn(land, [good, bow], np.inf)
    assert told.value.index == 1
    with refused(gc.errors.InvalidPolygon, match="0 does not meet the surface") as told:
        burn(land, shapely.box(0, 0, 1, 1), np.inf)
    assert told.value.index == 0
    for other in (shapely.Point(0, 0), shapely.LineString([(0, 0), (1, 1)]), shapely.Polygon()):
        with refused(gc.errors.InvalidPolygon, match="without area"):
            burn(land, other, np.inf)
    with refused(gc.errors.InvalidPolygon, match="no geometry"):
        burn(land, {"type": "Polygon", "coordinates": 5}, np.inf)
    with refused(gc.errors.InvalidPolygon, match="no numbers"):
        burn(land, polygon(np.array([(0, 0), (1, np.nan), (1, 0)])), np.inf)
    for value in (0.0, -1.0, np.nan, "high", [1.0, 2.0]):
        with refused(gc.errors.InvalidArgument, match="value is"):
            burn(land, good, value)
    for nothing in (5, []):
        with refused(gc.errors.InvalidArgument, match="no polygons"):
            burn(land, nothing, np.inf)
    (tmp_path / "bad.geojson").write_text("{")
    (tmp_path / "list.geojson").write_text("[]")
    with refused(gc.errors.InvalidArgument, match="is no GeoJSON"):
        burn(land, tmp_path / "bad.geojson", np.inf)
    with refused(gc.errors.InvalidArgument, match="an object, not a list"):
        burn(land, tmp_path / "list.geojson", np.inf)
    with refused(gc.errors.InvalidArgument, match="cannot read"):
        burn(land, tmp_path / "none.geojson", np.inf)
    with refused(gc.errors.InvalidArgument, match="lacks a part"):
        burn(land, {"type": "FeatureCollection"}, np.inf)
    with refused(gc.errors.UnsuitableCrs, match="that of the surface is not known"):
        burn(land.mesh, good, np.inf, crs="EPSG:4326")
    with refused(gc.errors.UnsuitableCrs, match="has no place in"):
        burn(land, good, np.inf, crs="EPSG:4326")
