"""Paths in files of each format, and what a path leaves behind."""

import copy
import csv
import json
import pickle
from pathlib import Path

import meshio
import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument

MESH = gc.samples.knot(500)
PATH = gc.shortest_path(MESH, 3, 120)
POINT = gc.shortest_path(MESH, 3, 3)
SUFFIXES = ("obj", "ply", "csv", "json", "geojson", "npy")


@pytest.mark.parametrize("path", [PATH, POINT], ids=["line", "point"])
def test_each_format_holds_the_same_points(path: gc.GeodesicPath, tmp_path: Path) -> None:
    for suffix in SUFFIXES:
        path.save(tmp_path / f"path.{suffix}")
    points = path.points.tolist()
    count = len(points)

    rows = [row.split() for row in (tmp_path / "path.obj").read_text().splitlines()]
    assert [[float(x) for x in row[1:]] for row in rows if row[0] == "v"] == points
    assert rows[-1] == ["l" if count > 1 else "p", *map(str, range(1, count + 1))]
    rows = [row.split() for row in (tmp_path / "path.ply").read_text().splitlines()]
    body = rows[rows.index(["end_header"]) + 1 :]
    assert [[float(x) for x in row] for row in body[:count]] == points
    assert body[count:] == [[str(i), str(i + 1)] for i in range(count - 1)]
    with (tmp_path / "path.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [[float(row[x]) for x in "xyz"] for row in table] == points
    for row, place in zip(table, path.locations, strict=True):
        assert int(row["face"]) == place.face_index
        assert tuple(float(row[u]) for u in "uvw") == place.barycentric
    document = json.loads((tmp_path / "path.json").read_text())
    assert document["points"] == points
    assert document["faces"] == path.faces.tolist()
    assert document["length"] == path.length
    assert document["error_bound"] == {"type": "relative", "value": 0.0, "kind": "guaranteed"}
    assert [place["face"] for place in document["locations"]] == [
        place.face_index for place in path.locations
    ]
    feature = json.loads((tmp_path / "path.geojson").read_text())
    assert feature["geometry"] == {
        "type": "LineString" if count > 1 else "Point",
        "coordinates": points if count > 1 else points[0],
    }
    assert feature["properties"]["length"] == path.length
    assert np.load(tmp_path / "path.npy").tolist() == points


def test_a_reader_of_another_library_reads_the_polyline(tmp_path: Path) -> None:
    PATH.save(tmp_path / "PATH.OBJ")
    assert meshio.read(tmp_path / "PATH.OBJ", "obj").points.tolist() == PATH.points.tolist()


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("path.txt", r"must end in .obj, .ply, .vtp, .dxf, .csv, .json, .geojson, .npz or .npy"),
        ("path", r"path is 'path'; it must end in"),
        ("no/path.obj", "its folder does not exist"),
        (None, "path is None; it must be a string or a Path"),
    ],
)
def test_a_place_where_no_path_can_be_written_is_refused(path: str, message: str) -> None:
    with pytest.raises(InvalidArgument, match=message):
        PATH.save(path)


def test_a_folder_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "path.obj").mkdir()
    with pytest.raises(InvalidArgument, match=r"cannot write .*path.obj: "):
        PATH.save(tmp_path / "path.obj")
    assert [each.name for each in tmp_path.iterdir()] == ["path.obj"]


@pytest.mark.jit
def test_a_path_knows_its_surface_and_leaves_it_behind_when_it_is_copied() -> None:
    assert PATH.mesh is MESH
    assert gc.exact_distance(MESH, 3).path_to(120).mesh is MESH
    assert gc.shortest_path(MESH, 3, 120, waypoints=[7]).mesh is MESH
    for twin in (pickle.loads(pickle.dumps(PATH)), copy.copy(PATH), copy.deepcopy(PATH)):  # noqa: S301
        assert twin.mesh is None
        assert twin.points.tolist() == PATH.points.tolist()
        assert twin.locations == PATH.locations
    assert len(pickle.dumps(PATH)) < 200 * len(PATH.points) + 2000
