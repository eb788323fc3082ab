"""Paths on maps: coordinates in WGS 84 are right, and files hold what paths do."""

import csv
import json
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc

GPX = "{http://www.topografix.com/GPX/1/1}"


def utm_32(longitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """Return eastings and northings by Krüger's series, good to a millimetre in its zone."""
    a, f = 6_378_137.0, 1.0 / 298.257223563
    n = f / (2.0 - f)
    radius = a / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
    alpha = [
        n / 2.0 - 2.0 * n**2 / 3.0 + 5.0 * n**3 / 16.0,
        13.0 * n**2 / 48.0 - 3.0 * n**3 / 5.0,
        61.0 * n**3 / 240.0,
    ]
    phi, away = np.radians(latitude), np.radians(longitude - 9.0)
    e = 2.0 * np.sqrt(n) / (1.0 + n)
    t = np.sinh(np.arctanh(np.sin(phi)) - e * np.arctanh(e * np.sin(phi)))
    xi, eta = np.arctan2(t, np.cos(away)), np.arctanh(np.sin(away) / np.sqrt(1.0 + t * t))
    east, north = eta.copy(), xi.copy()
    for j, each in enumerate(alpha, 1):
        east += each * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
        north += each * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
    return np.stack([500_000.0 + 0.9996 * radius * east, 0.9996 * radius * north], axis=1)


@pytest.fixture(scope="module")
def way(land: gc.terrain.Terrain) -> gc.CheapestPath:
    ends = land.locate_xy([[451_022.0, 5_198_933.0], [451_131.0, 5_198_858.0]])
    return gc.cheapest_path(land.mesh, *ends, (land.costs, gc.SlopeCost("tobler")))


def test_files_are_in_wgs84(land: gc.terrain.Terrain, way: gc.CheapestPath, tmp_path: Path) -> None:
    land.save(tmp_path / "way.geojson", way)
    document = json.loads((tmp_path / "way.geojson").read_text())
    (feature,) = document["features"]
    places = np.array(feature["geometry"]["coordinates"])
    assert (document["type"], feature["geometry"]["type"]) == ("FeatureCollection", "LineString")
    assert_allclose(utm_32(*places[:, :2].T), way.points[:, :2], atol=2e-3)
    assert_array_equal(places[:, 2], way.points[:, 2])
    assert feature["properties"] == {"cost": way.cost, "length": way.length}

    land.save(tmp_path / "way.gpx", way)
    root = ET.parse(tmp_path / "way.gpx").getroot()  # noqa: S314 - our own
    points = root.findall(f"{GPX}trk/{GPX}trkseg/{GPX}trkpt")
    degrees = [[float(each.get("lon", "")), float(each.get("lat", ""))] for each in points]
    assert_allclose(degrees, places[:, :2], atol=6e-10)
    heights = [float(each.findtext(f"{GPX}ele", "")) for each in points]
    assert_allclose(heights, way.points[:, 2], atol=6e-5)

    land.save(tmp_path / "way.csv", way)
    with (tmp_path / "way.csv").open() as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    assert_array_equal(np.stack([columns[axis] for axis in "xyz"], axis=1), way.points)
    assert_array_equal(columns["distance"], way.profile().chainage)
    assert_array_equal(columns["longitude"], places[:, 0])


def test_places_in_degrees_are_found(land: gc.terrain.Terrain) -> None:
    place = np.array([[9.0 - 0.6398, 46.9407]])  # near the middle of the land
    point = land.locate_xy(place[0], "EPSG:4326")
    assert_allclose(land.mesh.position(point)[:2], utm_32(*place.T)[0], atol=2e-3)
    assert land.locate_xy(place, "EPSG:4326") == [point]


def test_without_a_crs_gpx_is_refused_and_geojson_is_told(
    plain: gc.terrain.Terrain, tmp_path: Path
) -> None:
    field = gc.exact_distance(plain.mesh, plain.locate_xy([20.0, 15.0]), max_distance=6.0)
    lines = field.isolines([3.0, 5.0])
    rings = [ring for (ring,) in lines]
    with pytest.raises(gc.errors.UnsuitableCrs, match="GPX is in WGS 84"):
        plain.save(tmp_path / "rings.gpx", rings)
    assert list(tmp_path.iterdir()) == []
    with pytest.warns(gc.errors.NotWgs84, match="not WGS 84"):
        plain.save(tmp_path / "rings.geojson", rings, [{"level": 3}, {"level": 5}])
    features = json.loads((tmp_path / "rings.geojson").read_text())["features"]
    for feature, ring in zip(features, rings, strict=True):
        places = feature["geometry"]["coordinates"]
        assert places == [*ring.points.tolist(), ring.points[0].tolist()]
        radius = np.hypot(*(np.array(places)[:, :2] - [20.0, 15.0]).T)
        assert_allclose(radius, feature["properties"]["level"], rtol=1e-9)
    plain.save(tmp_path / "rings.csv", rings)
    head, *rows = (tmp_path / "rings.csv").read_text().splitlines()
    assert head == "curve,distance,x,y,z"
    assert len(rows) == sum(len(ring.points) + 1 for ring in rings)
    with pytest.raises(gc.errors.UnsuitableCrs, match="that of the surface is not known"):
        plain.locate_xy([9.0, 47.0], "EPSG:4326")
    with pytest.raises(gc.errors.InvalidArgument, match="1 properties for 2 curves"):
        plain.save(tmp_path / "rings.csv", rings, [{}])
    with pytest.raises(gc.errors.InvalidArgument, match="must end in"):
        plain.save(tmp_path / "rings.kml", rings)


def test_a_path_of_one_point_is_a_point(land: gc.terrain.Terrain, tmp_path: Path) -> None:
    land.save(tmp_path / "here.geojson", gc.shortest_path(land.mesh, 7, 7))
    (feature,) = json.loads((tmp_path / "here.geojson").read_text())["features"]
    assert feature["geometry"]["type"] == "Point"


def test_profiles_have_the_slopes_of_the_ground(
    land: gc.terrain.Terrain, way: gc.CheapestPath
) -> None:
    profile = way.profile()
    rises = np.diff(way.points[:, 2])
    assert profile.ascent - profile.descent == pytest.approx(rises.sum())
    assert profile.ascent + profile.descent == pytest.approx(np.abs(rises).sum())
    run = np.hypot(*np.diff(way.points[:, :2], axis=0).T)
    assert np.hypot(run, rises).sum() == pytest.approx(way.length)
    pace = gc.SlopeCost("tobler").at(profile.slopes)
    assert way.cost == pytest.approx(float((pace * np.diff(profile.chainage)).sum()), rel=1e-9)
    x, y, _ = land.mesh.vertices.T
    tilted = gc.TriangleMesh(np.stack([x, y, 0.3 * x - 0.4 * y], axis=1), land.mesh.faces)
    path = gc.shortest_path(tilted, 0, 331)
    along = path.points[-1, :2] - path.points[0, :2]
    slope = along @ [0.3, -0.4] / np.hypot(*along)
    assert_allclose(path.profile().slopes, slope, rtol=1e-5)
    ring = gc.exact_distance(tilted, 620, max_distance=60.0).isolines([50.0])[0][0]
    round_trip = ring.profile()
    assert round_trip.ascent == pytest.approx(round_trip.descent)
    assert len(round_trip.heights) == len(ring.points) + 1


@pytest.mark.jit
def test_isochrones_are_lines_of_equal_cost(plain: gc.terrain.Terrain) -> None:
    field = gc.cost_distance(plain.mesh, plain.locate_xy([20.0, 15.0]), 2.0 * plain.costs)
    (ring,), nothing = field.isochrones([12.0, 1e6])
    assert nothing == []
    values = gc.ScalarField(plain.mesh, field.costs).at(list(ring.locations))
    assert_allclose(values, 12.0, rtol=1e-12)
    radius = np.hypot(*(ring.points[:, :2] - [20.0, 15.0]).T)
    assert radius.max() <= 6.0 + 1e-9
    assert radius.min() >= 6.0 / (1.0 + field.error_bound.value) - 0.05  # linear between vertices
