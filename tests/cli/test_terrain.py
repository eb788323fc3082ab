"""Commands for terrain: files are those of the library, and what does not fit is one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

import geodesic_core as gc
from tests.core.terrain.conftest import TRANSFORM, polygon, rough, star
from tests.support.commands import Run, error_line

FROM, TO = "451022,5198933", "451381,5198718"
ENDS = [[451_022.0, 5_198_933.0], [451_381.0, 5_198_718.0]]


@pytest.fixture
def dem(tmp_path: Path) -> str:
    """Write a raster with a gap, a lake in its CRS and factors; return the raster's name."""
    heights = rough()
    heights[4:7, 30] = -9999.0
    facts = {"transform": Affine(*TRANSFORM), "crs": "EPSG:32632", "nodata": -9999.0}
    shape = {"height": 30, "width": 40, "count": 1, "dtype": "float64"}
    with rasterio.open(tmp_path / "dem.tif", "w", driver="GTiff", **shape, **facts) as file:
        file.write(heights, 1)
    lake = polygon(star((451_203.3, 5_198_846.1), 97.0))
    lake["crs"] = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}}
    (tmp_path / "lake.geojson").write_text(json.dumps(lake))
    faces = len(gc.terrain.from_dem(tmp_path / "dem.tif").mesh.faces)
    np.save(tmp_path / "faces.npy", 1.0 + np.arange(faces) % 3)
    return "dem.tif"


def test_a_path_around_a_lake_is_that_of_the_library(run: Run, dem: str) -> None:
    ran = run("terrain", "path", dem, "--from", FROM, "--to", TO, "--out", "direct.csv")
    assert (ran.code, ran.err) == (0, "")
    assert "which are holes of the surface" in ran.out
    ran = run(
        *("terrain", "path", dem, "--from", FROM, "--to", TO),
        *("--block", "lake.geojson", "--out", "way.gpx"),
    )
    assert (ran.code, ran.err) == (0, "")
    land = gc.terrain.from_dem(dem)
    direct = gc.shortest_path(land.mesh, *land.locate_xy(ENDS))
    land = gc.terrain.burn(land, "lake.geojson", np.inf)
    path = gc.shortest_path(land.open_mesh(), *land.locate_xy(ENDS))
    land.save("here.gpx", path)
    assert Path("way.gpx").read_bytes() == Path("here.gpx").read_bytes()
    assert ran.figure("length") == repr(path.length)
    assert ran.figure("ascent") == repr(path.profile().ascent)
    assert path.length > direct.length


@pytest.mark.parametrize(
    "cost", [["slope:tobler"], ["faces.npy"], ["slope:naismith", "faces.npy"]], ids=" ".join
)
def test_costs_are_those_of_the_library(run: Run, dem: str, cost: list[str]) -> None:
    options = [word for each in cost for word in ("--cost", each)]
    options += ["--block", "lake.geojson", "--json"]
    ran = run("terrain", "path", dem, "--from", FROM, "--to", TO, *options, "--out", "a.csv")
    assert ran.code == 0
    land = gc.terrain.from_dem(dem)
    if cost[-1] == "faces.npy":
        land = land.with_costs(np.load("faces.npy"))
    land = gc.terrain.burn(land, "lake.geojson", np.inf)
    rule = cost[0].removeprefix("slope:")
    costs = (land.costs, gc.SlopeCost(rule)) if rule != cost[0] else land.costs
    path = gc.cheapest_path(land.mesh, *land.locate_xy(ENDS), costs)
    land.save("b.csv", path)
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    told = json.loads(ran.out)
    assert (told["cost"], told["length"]) == (path.cost, path.length)
    ran = run(
        *("terrain", "reach", dem, "--from", FROM, "--levels", "60,120", "--towards"),
        *(*options, "--out", "a.geojson"),
    )
    assert ran.code == 0
    field = gc.cost_distance(land.mesh, land.locate_xy(ENDS[:1]), costs, direction="to")
    lines = field.isochrones([60.0, 120.0])
    assert json.loads(ran.out)["lines"] == [len(each) for each in lines]
    facts = [
        {"level": level} for level, each in zip([60.0, 120.0], lines, strict=True) for _ in each
    ]
    land.save("b.geojson", [line for each in lines for line in each], facts)
    assert Path("a.geojson").read_bytes() == Path("b.geojson").read_bytes()


def test_reach_without_costs_is_by_exact_distance(run: Run, dem: str) -> None:
    starts = ["--from", FROM, "--from", TO]
    ran = run("terrain", "reach", dem, *starts, "--levels", "100", "--out", "a.csv")
    assert (ran.code, ran.err) == (0, "")
    land = gc.terrain.from_dem(dem)
    (lines,) = gc.exact_distance(land.mesh, land.locate_xy(ENDS)).isolines([100.0])
    assert ran.figure("level") == f"100: {len(lines)} lines"
    land.save("b.csv", lines)
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_places_may_be_in_degrees(run: Run, dem: str) -> None:
    land = gc.terrain.from_dem(dem)
    land.save("ends.csv", land.mesh.curve([0, 1]))
    row = Path("ends.csv").read_text().splitlines()[1].split(",")
    place = ",".join(row[5:])
    ran = run(
        *("terrain", "path", dem, "--lonlat", "--from", place, "--to", place),
        *("--out", "here.geojson", "--json"),
    )
    assert json.loads(ran.out)["length"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--from", "1,2"], "the surface is not above or below"),
        (["--from", "451305,5198945"], "nothing was measured there"),
        (["--from", "1"], "a place is X,Y"),
        (["--from", "here,there"], "must be numbers"),
        (["--cost", "slope:rover"], "takes tobler or naismith"),
        (["--cost", "faces.txt"], "end in .npy"),
        (["--cost", "none.npy"], "cannot read none.npy"),
        (["--cost", "slope:tobler", "--cost", "slope:tobler"], "one rule and one file"),
        (["--block", "none.geojson"], "cannot read none.geojson"),
        (["--crs", "EPSG:4326"], "no lengths on a map"),
        (["--out", "x.kml"], "must end in .geojson"),
    ],
)
def test_what_does_not_fit_is_refused(run: Run, dem: str, options: list[str], words: str) -> None:
    given = ["--from", FROM, "--to", TO, "--out", "x.gpx"]
    ran = run("terrain", "path", dem, *given, *options)
    assert ran.code != 0
    assert words in error_line(ran)
    assert not Path("x.gpx").exists()


def test_reach_refuses_what_has_no_meaning(run: Run, dem: str) -> None:
    given = ["terrain", "reach", dem, "--from", FROM, "--out", "x.csv", "--levels"]
    assert "--towards needs --cost" in error_line(run(*given, "5", "--towards"))
    assert "nothing on this terrain" in error_line(run(*given, "1e9"))
    assert "must be numbers" in error_line(run(*given, "near"))


def test_geojson_without_a_crs_is_told(run: Run) -> None:
    Path("dem.asc").write_text("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n0 0\n0 0\n")
    given = ["terrain", "path", "dem.asc", "--from", "0.5,0.5", "--to", "1.5,1.5"]
    ran = run(*given, "--out", "way.geojson")
    assert ran.code == 0
    assert ran.err.startswith("warning: the CRS is not known")
    assert "GPX is in WGS 84" in error_line(run(*given, "--out", "way.gpx"))
