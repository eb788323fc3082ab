"""The command line, as its users meet it: what it prints, what it writes, how it fails."""

import csv
import json
import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from scipy.sparse import load_npz

import geodesic_core as gc
from app import __version__
from app.settings import Settings, variable_of
from tests.support.commands import Run, error_line
from tests.support.fresh import told_by
from tests.support.paths import ROOT

SLOW = {"igl", "trimesh", "manifold3d", "fastapi"}


@pytest.fixture
def plane(run: Run) -> Path:
    ran = run("sample", "plane", "--faces", 200, "plane.ply")
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("mesh") == "121 vertices, 200 faces"
    return Path("plane.ply")


@pytest.mark.parametrize("name", gc.samples.SAMPLES)
def test_a_sample_is_written_as_it_is(run: Run, name: str) -> None:
    assert run("sample", name, "--faces", 600, "mesh.ply").code == 0
    mesh = gc.load_mesh("mesh.ply")
    sample = gc.samples.SAMPLES[name](600)
    vertices, faces = sample.vertices, sample.faces
    assert mesh.vertices.tolist() == vertices.tolist()
    assert mesh.faces.tolist() == faces.tolist()


def test_info_tells_what_is_in_a_mesh(run: Run, plane: Path) -> None:
    ran = run("info", plane)
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("vertices") == "121"
    assert ran.figure("faces") == "200"
    assert ran.figure("boundary loops") == "1"
    assert ran.figure("euler characteristic") == "1"
    assert ran.figure("bounds") == "(0.0, 0.0, 0.0) to (1.0, 1.0, 0.0)"
    assert ran.figure("inconsistent orientation") == "no"
    assert ran.figure("read in").endswith(" s")
    assert "warning" not in ran.out


def test_info_names_elements_and_warns(run: Run) -> None:
    rows = ["v 0 0 0", "v 1 0 0", "v 0 1 0"] + ["v 5 5 5"] * 12 + ["f 1 2 3"]
    Path("lonely.obj").write_text("\n".join(rows))
    ran = run("info", "lonely.obj")
    assert ran.figure("isolated vertices") == "12 (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, …)"
    assert "unreachable" in ran.figure("warning:")


def test_info_tells_of_polygons_and_of_what_is_left_out(run: Run) -> None:
    rows = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "f 1 2 3 4", "f 1 2", "l 3 4"]
    Path("quad.obj").write_text("\n".join(rows))
    ran = run("info", "quad.obj")
    assert ran.figure("faces") == "3"
    assert ran.figure("triangulated polygons") == "1"
    assert ran.figure("repeated vertex faces") == "1 (2)"
    assert "left out" in ran.figure("warning:")
    assert "not part of the surface" in ran.out


def test_distance_writes_npy_csv_and_json(run: Run, plane: Path) -> None:
    expected = gc.exact_distance(gc.load_mesh(plane), [0, 120])
    for name in ("d.npy", "d.csv", "d.json"):
        ran = run("distance", plane, "--source", 0, "--source", 120, "--out", name)
        assert (ran.code, ran.err) == (0, "")
        assert ran.figure("reached") == "121 of 121 vertices"
        assert ran.figure("written") == name
    assert np.load("d.npy").tolist() == expected.distances.tolist()
    table = np.loadtxt("d.csv", delimiter=",", skiprows=1)
    assert table[:, 0].tolist() == list(range(121))
    assert table[:, 1].tolist() == expected.distances.tolist()
    assert table[:, 2].tolist() == expected.nearest_source.tolist()
    answer = json.loads(Path("d.json").read_text())
    assert [source["vertex"] for source in answer["sources"]] == [0, 120]
    assert answer["distances"] == expected.distances.tolist()
    assert answer["nearest_source"] == expected.nearest_source.tolist()
    farthest = int(np.argmax(expected.distances))
    assert ran.figure("farthest") == f"vertex {farthest} at {float(expected.distances.max())!r}"


def rows_of(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(Path(name).read_text().splitlines()))


@pytest.mark.slow
def test_lines_in_each_format(run: Run, knot: Path) -> None:
    """What the formats hold is checked over HTTP: the encoders are the same."""
    commands = {
        "path": ["--source", 3, "--target", 700],
        "paths": ["--source", 3, "--target", 700, "--target", 20],
        "isolines": ["--source", 3, "--level", 2.5],
        "borders": ["--source", 3, "--source", 700],
        "boundaries": ["--barriers", "3,40"],
        "trace": ["--from", 3, "--direction", 0.5, "--direction", 2, "--length", 4],
    }
    for command, arguments in commands.items():
        for suffix in ("csv", "obj"):
            assert run(command, knot, *arguments, "--out", f"{command}.{suffix}").code == 0
        drawn = Path(f"{command}.obj").read_text().splitlines()
        points = [[float(x) for x in line.split()[1:]] for line in drawn if line[:2] == "v "]
        rows = rows_of(f"{command}.csv")
        assert [[float(row[x]) for x in "xyz"] for row in rows] == points
    path = gc.shortest_path(gc.load_mesh(knot), 3, 700)
    assert run("path", knot, *commands["path"], "--out", "p.npy").code == 0
    assert np.load("p.npy").tolist() == path.points.tolist()


def test_distance_stops_at_max_distance(run: Run, plane: Path) -> None:
    ran = run("distance", plane, "--source", 0, "--max-distance", 0.35, "--out", "d.json")
    expected = gc.exact_distance(gc.load_mesh(plane), 0, 0.35).distances
    reached = np.isfinite(expected)
    assert 0 < reached.sum() < 121
    assert ran.figure("reached") == f"{reached.sum()} of 121 vertices"
    answer = json.loads(Path("d.json").read_text())["distances"]
    assert answer == [d if np.isfinite(d) else None for d in expected.tolist()]


def test_no_vertex_is_farthest_where_none_is_reached(run: Run, plane: Path) -> None:
    ran = run("distance", plane, "--source", "f0:0.3,0.3,0.4", "--max-distance", 1e-9)
    assert ran.figure("reached") == "0 of 121 vertices"
    assert "farthest" not in ran.out


@pytest.fixture
def knot(run: Run) -> Path:
    """A curved mesh, on which windows merge."""
    assert run("sample", "knot", "--faces", 3000, "knot.ply").code == 0
    return Path("knot.ply")


def test_path_writes_a_polyline_and_json(run: Run, plane: Path) -> None:
    expected = gc.shortest_path(gc.load_mesh(plane), 0, 115)
    for name in ("p.obj", "p.json"):
        ran = run("path", plane, "--source", 0, "--target", 115, "--out", name)
        assert (ran.code, ran.err) == (0, "")
        assert ran.figure("length") == repr(expected.length)
        assert ran.figure("error bound") == "0.0 (relative, guaranteed)"
    rows = [row.split() for row in Path("p.obj").read_text().splitlines()]
    points = [[float(x) for x in row[1:]] for row in rows if row[0] == "v"]
    assert points == expected.points.tolist()
    assert rows[-1] == ["l", *map(str, range(1, len(points) + 1))]
    answer = json.loads(Path("p.json").read_text())
    assert answer["points"] == points
    assert answer["length"] == expected.length
    assert answer["faces"] == expected.faces.tolist()
    assert len(answer["locations"]) == len(points)


def test_a_georeferenced_mesh_is_answered_where_it_lies(run: Run) -> None:
    """A path goes by way of its own points, given by the positions that it was told with."""
    sample = gc.samples.terrain(800)
    vertices, faces = sample.vertices, sample.faces
    moved = 0.005 * vertices + (3e6, 6.4e6, 100.0)
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in moved.tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    Path("geo.obj").write_text("\n".join(rows))
    ends = ["--source", 0, "--target", len(vertices) - 1]
    rounding = np.spacing(6.4e6)

    assert run("info", "geo.obj").figure("bounds") == (
        f"{tuple(moved.min(axis=0).tolist())} to {tuple(moved.max(axis=0).tolist())}"
    )
    assert run("path", "geo.obj", *ends, "--out", "p.json").code == 0
    path = json.loads(Path("p.json").read_text())
    assert path["points"][0] == moved[0].tolist()
    assert path["points"][-1] == moved[-1].tolist()
    middle = ",".join(map(repr, path["points"][len(path["points"]) // 2]))
    assert run("path", "geo.obj", *ends, "--via", f"p{middle}", "--out", "via.json").code == 0
    by_way = json.loads(Path("via.json").read_text())
    assert by_way["length"] == pytest.approx(path["length"], abs=4 * rounding)
    assert by_way["waypoints"][0]["barycentric"].count(0.0) == 1  # an edge, not beside it
    located = run("locate", "geo.obj", "--at", middle)
    assert float(located.figure("distance")) <= 2 * rounding


def test_a_path_by_way_of_others_tells_its_steps(run: Run, plane: Path) -> None:
    ends = ["--source", 0, "--target", 115]
    expected = gc.shortest_path(gc.load_mesh(plane), 0, 115, [60, 7], explain=True)
    assert expected.steps is not None

    ran = run("steps", plane, *ends, "--via", 60, "--via", 7, "--out", "p.json")

    assert (ran.code, ran.err) == (0, "")
    told = [row for row in ran.out.splitlines() if row.startswith("leg ")]
    assert len(told) == len(expected.steps) == 18
    for row, step in zip(told, expected.steps, strict=True):
        assert row.startswith(f"leg {step.leg}, {step.name} ")
        assert row.endswith(
            f"bound {step.bound!r}, {step.windows} windows, {len(step.faces)} faces"
        )
    answer = json.loads(Path("p.json").read_text())
    assert [step["faces"] for step in answer["steps"]] == [
        step.faces.tolist() for step in expected.steps
    ]


def test_locate_prints_a_point_that_others_take(run: Run, knot: Path) -> None:
    mesh = gc.load_mesh(knot)
    for at in ("1,2,0.5", "-1e1,.5,+2", ",".join(map(repr, mesh.vertices[5].tolist()))):
        ran = run("locate", knot, "--at", at)
        assert (ran.code, ran.err) == (0, "")
        position = np.array([float(x) for x in at.split(",")])
        place = mesh.locate(position)
        found = mesh.position(place)
        assert [float(x) for x in ran.figure("position").split(",")] == found.tolist()
        assert float(ran.figure("distance")) == np.linalg.norm(found - position)
        ends = ["--source", ran.figure("point"), "--target", 7]
        path = run("path", knot, *ends, "--out", "p.obj")
        assert path.figure("length") == repr(gc.shortest_path(mesh, place, 7).length)
    assert ran.figure("point") == "v5"
    assert float(ran.figure("distance")) == 0


def point_options(option: str, *points: object) -> list[object]:
    return [each for point in points for each in (option, point)]


def test_paths_are_written_with_those_that_are_not_there(run: Run, knot: Path) -> None:
    mesh = gc.load_mesh(knot)
    face = int(np.flatnonzero((mesh.faces == 20).any(axis=1))[0])
    inside = gc.SurfacePoint.face(face, (0.2, 0.3, 0.5))
    field = gc.exact_distance(mesh, 3, 4.0, [700, inside])
    targets = point_options("--target", 700, f"f{face}:0.2,0.3,0.5", "v3", 20)
    assert np.isinf(field.distances[700])
    ends = ["--source", 3, *targets, "--max-distance", 4]

    ran = run("paths", knot, *ends, "--out", "p.json")

    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("no path") == "to 700: beyond_max_distance"
    answer = json.loads(Path("p.json").read_text())["paths"]
    reason = answer[0]["status"], answer[0]["reason"], answer[0]["points"]
    assert reason == ("no_path", "beyond_max_distance", None)
    for found, target in zip(answer[1:], (inside, 3, 20), strict=True):
        path = field.path_to(target)
        assert (found["status"], found["length"]) == ("ok", path.length)
        assert found["points"] == path.points.tolist()
        assert repr(path.length) in ran.out
    assert run("paths", knot, *ends, "--out", "p.obj").code == 0
    rows = [row.split() for row in Path("p.obj").read_text().splitlines()]
    points = [row for row in rows if row[0] == "v"]
    elements = [row[1:] for row in rows if row[0] in "lp"]
    assert [row[0] for row in rows if row[0] in "lp"] == ["l", "p", "l"]
    assert [len(each) for each in elements] == [len(found["points"]) for found in answer[1:]]
    numbers = [number for each in elements for number in each]
    assert numbers == list(map(str, range(1, len(points) + 1)))


@pytest.mark.slow
@pytest.mark.parametrize("limit", [None, 4.0])
def test_matrices_are_the_library_s(run: Run, knot: Path, limit: float | None) -> None:
    mesh = gc.load_mesh(knot)
    inside = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    expected = gc.distance_matrix(mesh, [3, inside], [700, 3, 20], limit)
    sources = point_options("--source", 3, "f40:0.2,0.3,0.5")
    ends = [*sources, *point_options("--target", 700, 3, 20)]
    ends += [] if limit is None else ["--max-distance", limit]
    rows = [(i, j, expected[i, j]) for i in range(2) for j in range(3)]
    near = [row for row in rows if np.isfinite(row[2])]

    for layout, names in (("dense", "npy csv json"), ("sparse", "npz csv json")):
        for name in names.split():
            ran = run("matrix", knot, *ends, "--layout", layout, "--out", f"{layout}.{name}")
            assert (ran.code, ran.err) == (0, "")
            assert ran.figure("reached") == f"{len(near)} of 6 distances"
            assert ran.figure("written") == f"{layout}.{name}"
    assert np.load("dense.npy").tolist() == expected.tolist()
    answer = json.loads(Path("dense.json").read_text())["distances"]
    assert answer == [[d if np.isfinite(d) else None for d in row] for row in expected.tolist()]
    for layout, cells in (("dense", rows), ("sparse", near)):
        table = np.genfromtxt(f"{layout}.csv", delimiter=",", skip_header=1, filling_values=np.inf)
        assert [tuple(row) for row in table.tolist()] == cells
    table = load_npz("sparse.npz").tocoo()
    assert list(zip(table.row, table.col, table.data, strict=True)) == near
    answer = json.loads(Path("sparse.json").read_text())
    assert answer["shape"] == [2, 3]
    columns = answer["rows"], answer["columns"], answer["distances"]
    assert list(zip(*columns, strict=True)) == near


def test_nearest_prints_candidates_as_they_were_written(run: Run, knot: Path) -> None:
    texts = ["700", "f40:0.2,0.3,0.5", "v20", "9"]
    places = [700, gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)), 20, 9]
    mesh = gc.load_mesh(knot)
    expected = gc.nearest(mesh, 3, places, 3)
    candidates = point_options("--candidate", *texts)

    ran = run("nearest", knot, "--source", 3, *candidates, "-k", 3)

    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("found") == "3 of 3"
    told = [row.split() for row in ran.out.splitlines() if row.startswith("nearest")]
    assert [(row[1], float(row[3])) for row in told] == [
        (texts[i], away)
        for i, away in zip(expected.indices, expected.distances.tolist(), strict=True)
    ]
    limit = ["--max-distance", expected.distances[0]]
    ran = run("nearest", knot, "--source", 3, *candidates, "-k", 3, *limit)
    assert ran.figure("found") == "1 of 3"


@pytest.mark.parametrize("method", ["exact", "approximate"])
def test_gradients_are_written_beside_distances(run: Run, knot: Path, method: str) -> None:
    mesh = gc.load_mesh(knot)
    solve = gc.exact_distance if method == "exact" else gc.approximate_distance
    field = solve(mesh, 3, max_distance=4.0)
    arguments = "distance", knot, "--source", 3, "--max-distance", 4, "--method", method
    expected = np.column_stack([field.distances, field.gradient])
    assert np.isinf(expected).any()

    for out in ("g.npy", "g.csv", "g.json", "g.ply"):
        assert run(*arguments, "--gradient", "--out", out).code == 0

    np.testing.assert_array_equal(np.load("g.npy"), expected)
    with Path("g.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = "distance", "gradient_x", "gradient_y", "gradient_z"
    cells = [[float(row[name] or "nan") for name in names] for row in rows]
    np.testing.assert_array_equal(cells, np.where(np.isfinite(expected), expected, np.nan))
    told = json.loads(Path("g.json").read_text())["gradient"]
    np.testing.assert_array_equal(np.array(told, float), expected[:, 1:])
    assert b"property double gradient_z" in Path("g.ply").read_bytes()
    assert run(*arguments, "--out", "d.npy").code == 0
    np.testing.assert_array_equal(np.load("d.npy"), field.distances)


@pytest.mark.parametrize("method", ["exact", "approximate"])
def test_a_path_stops_at_max_distance(run: Run, knot: Path, method: str) -> None:
    length = gc.exact_distance(gc.load_mesh(knot), 3).distances[700]
    ends = "path", knot, "--source", 3, "--target", 700, "--out", "p.obj", "--method", method

    beyond = run(*ends, "--max-distance", 0.99 * length)
    within = run(*ends, "--max-distance", length)

    assert beyond.code == 1
    assert "within --max-distance" in error_line(beyond)
    assert float(within.figure("length")) == pytest.approx(length, rel=1e-3)


def test_merge_joins_a_cut_mesh(run: Run) -> None:
    rows = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 0 0", "v 1 1 0", "v 0 1 0", "f 1 2 3", "f 4 5 6"]
    Path("cut.obj").write_text("\n".join(rows))
    assert run("info", "cut.obj").figure("components") == "2"
    assert run("info", "cut.obj", "--merge", "exact").figure("components") == "1"
    apart = run("path", "cut.obj", "--source", 1, "--target", 5, "--out", "p.obj")
    assert apart.code == 1
    *warnings, error = apart.err.splitlines()
    assert len(warnings) == len(gc.load_mesh("cut.obj").warnings) > 0
    assert all(warning.startswith("warning: ") for warning in warnings)
    assert error.startswith("error: there is no path")
    assert "component" in error
    assert apart.out == ""
    assert not Path("p.obj").exists()
    joined = run(
        "path", "cut.obj", "--merge", "exact", "--source", 1, "--target", 3, "--out", "p.obj"
    )
    assert joined.code == 0


def test_merge_takes_a_distance(run: Run) -> None:
    rows = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 0 1e-7", "v 1 1 1e-7", "v 0 1 0"]
    Path("open.obj").write_text("\n".join([*rows, "f 1 2 3", "f 4 5 6"]))
    apart = run("info", "open.obj")
    assert "--merge 2e-07 joins them" in apart.out
    assert apart.figure("components") == "2"
    assert run("info", "open.obj", "--merge", "2e-07").figure("components") == "1"
    assert run("info", "open.obj", "--merge", "0").figure("components") == "2"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("info nowhere.ply", "cannot read nowhere.ply"),
        ("info plane.xyz", "cannot read plane.xyz"),
        ("info plane.stl", "STL"),
        ("distance plane.ply --source -1 --out d.npy", "-1"),
        ("distance plane.ply --source 121 --out d.npy", "121"),
        (
            "distance plane.ply --source 0 --max-distance -2 --out d.npy",
            "--max-distance is -2.0",
        ),
        (
            "distance plane.ply --source 0 --max-distance nan --out d.npy",
            "--max-distance is nan",
        ),
        ("path plane.ply --source 0 --target 999 --out p.obj", "target"),
        ("path plane.ply --method approximate --source 0 --target 999 --out p.obj", "target"),
        *(
            (f"path plane.ply {option} {text} {others} --out p.obj", f"{option} {text}: {message}")
            for option, others in (
                ("--source", "--target 1"),
                ("--target", "--source 1"),
                ("--via", "--source 1 --target 2"),
            )
            for text, message in (
                ("-1", "vertex -1 does not exist; the indices are 0 to 120"),
                ("v121", "vertex 121 does not exist; the indices are 0 to 120"),
                ("e0-120:0.5", "no edge joins the vertices 0 and 120"),
                ("e0-121:0.5", "vertex 121 does not exist; the indices are 0 to 120"),
                ("e0-1:1.5", "t is 1.5"),
                ("f200:1,0,0", "face 200 does not exist; the indices are 0 to 199"),
                ("f0:1,1,0", "the point has the weights (1.0, 1.0, 0.0) in face 0"),
                ("p0,0,1e99", "the position is"),
            )
        ),
        (
            "paths plane.ply --source 0 --target 1 --target 121 --out p.obj",
            "--target 121: vertex 121 does not exist; the indices are",
        ),
        (
            "paths plane.ply --source 0 --target 1 --max-distance -1 --out p.json",
            "--max-distance is -1.0",
        ),
        (
            "matrix plane.ply --source 0 --target v-1 --out m.npy",
            "--target v-1: vertex -1 does not exist; the indices are",
        ),
        (
            "matrix plane.ply --source e0-120:0.5 --target 1 --out m.npy",
            "--source e0-120:0.5: no edge joins",
        ),
        (
            "matrix plane.ply --source 0 --target 1 --max-distance nan --out m.npy",
            "--max-distance is nan",
        ),
        (
            "nearest plane.ply --source 0 --candidate f200:1,0,0",
            "--candidate f200:1,0,0: face 200 does not exist; the indices are",
        ),
        ("nearest plane.ply --source 0 --candidate 1 --max-distance -1", "--max-distance is -1.0"),
        (
            "path plane.ply --source 0 --target 1 --max-distance -1 --out p.obj",
            "--max-distance is -1.0",
        ),
        (
            "distance plane.ply --source 0/120 --out d.npy",
            "--source 120: shares no face with the point before it",
        ),
        (
            "paths plane.ply --source 0/999 --target 1 --out p.obj",
            "--source 999: vertex 999 does not exist; the indices are",
        ),
        ("locate plane.ply --at 0,0,-1e99", "--at 0,0,-1e99: the position is"),
        ("locate nowhere.ply --at 0,0,0", "cannot read nowhere.ply"),
        *(
            (
                f"{command} --method approximate {option} {value}",
                f"{option} is {float(value)!r}: it must be ",
            )
            for command in (
                "distance plane.ply --source 0 --out d.npy",
                "path plane.ply --source 0 --target 1 --out p.obj",
            )
            for option, value in (
                ("--relative-error", "0"),
                ("--relative-error", "1"),
                ("--relative-error", "-0.1"),
                ("--relative-error", "nan"),
                ("--absolute-error", "0"),
                ("--absolute-error", "inf"),
            )
        ),
        ("sample knot --faces 3 small.ply", "faces is 3"),
    ],
)
def test_what_fails_says_why_in_one_line(
    run: Run, plane: Path, arguments: str, message: str
) -> None:
    Path("plane.stl").write_bytes(plane.read_bytes())
    before = sorted(Path().iterdir())
    ran = run(*arguments.split())
    assert ran.code == 1
    assert message in error_line(ran)
    assert sorted(Path().iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("fly", "fly"),
        ("info", "MESH"),
        ("info plane.ply --quick", "--quick"),
        ("info plane.ply --merge some", "some"),
        ("info plane.ply --merge nan", "'nan' is neither 'none' nor 'exact', nor a distance"),
        ("info plane.ply --merge -1e-6", "'-1e-6' is neither"),
        ("info plane.ply --merge inf", "'inf' is neither"),
        ("distance plane.ply --out d.npy", "--source"),
        ("distance plane.ply --source x --out d.npy", "'--source': 'x' is not a point: write a"),
        ("distance plane.ply --source f0:1,0 --out d.npy", "'f0:1,0' is not a point"),
        ("distance plane.ply --source 1.5 --out d.npy", "'1.5' is not a point"),
        ("path plane.ply --source 0 --target p1,2 --out p.obj", "'--target': 'p1,2' is not"),
        ("path plane.ply --source 0 --target 1 --via 1-2 --out p.obj", "'--via': '1-2' is not"),
        ("path plane.ply --source p0,0,1e999 --target 1 --out p.obj", "1e999 is too large"),
        ("locate plane.ply", "--at"),
        ("locate plane.ply --at 1,2", "'1,2' is not a position: write it as x,y,z"),
        ("locate plane.ply --at 1,2,nan", "'1,2,nan' is not a position"),
        (
            "distance plane.ply --source 0 --out d.txt",
            "must end in .npy, .csv, .json, .ply or .func.gii",
        ),
        ("distance plane.ply --source 0 --out no/d.npy", "folder"),
        ("path plane.ply --source 0 --target 1 --out p.ply", ".json or .npy"),
        ("distance plane.ply --source 0 --out d.npy --method heat", "heat"),
        ("distance plane.ply --source 0 --out d.npy --relative-error much", "--relative-error"),
        (
            "distance plane.ply --source 0 --out d.npy --relative-error 0.1",
            "--relative-error goes with --method approximate only",
        ),
        (
            "path plane.ply --source 0 --target 1 --out p.obj --method exact --absolute-error 1",
            "--absolute-error goes with --method approximate only",
        ),
        (
            "path plane.ply --source 0 --target 1 --out p.obj --method approximate --via 3",
            "--via goes with --method exact only",
        ),
        ("distance plane.ply --source 0 --out d.npy --method fast --effort 3", "'3' is not 1, 2"),
        (
            "distance plane.ply --source 0 --out d.npy --effort 2",
            "--effort goes with --method fast only",
        ),
        (
            "paths plane.ply --source 0 --target 1 --out p.obj --method approximate --effort 2",
            "--effort goes with --method fast only",
        ),
        (
            "path plane.ply --source 0 --target 1 --out p.obj --method fast --relative-error 0.1",
            "--relative-error goes with --method approximate only",
        ),
        (
            "path plane.ply --source 0 --target 1 --out p.obj --method fast --via 3",
            "--via goes with --method exact only",
        ),
        ("isolines plane.ply --source 0 --count 2 --out l.obj --method fast", "'fast' is not one"),
        ("distance plane.ply --source 0/x --out d.npy", "'x' is not a point"),
        ("matrix plane.ply --source 0/1 --target 1 --out m.npy", "'0/1' is not a point"),
        ("paths plane.ply --source 0 --out p.obj", "--target"),
        ("paths plane.ply --source 0 --target 1 --out p.npy", ".csv or .json"),
        (
            "paths plane.ply --source 0 --target 1 --out p.obj --relative-error 0.1",
            "--relative-error goes with --method approximate only",
        ),
        ("matrix plane.ply --source 0 --target 1 --out m.txt", "m.txt must end in .npy, .npz"),
        ("matrix plane.ply --source 0 --target 1 --out m.npz", ".npz does not go with --layout d"),
        (
            "matrix plane.ply --source 0 --target 1 --out m.npy --layout sparse",
            ".npy does not go with --layout sparse",
        ),
        ("matrix plane.ply --source 0 --target 1 --out m.npy --layout rows", "rows"),
        (
            "matrix plane.ply --source 0 --target 1 --target 2 --out m.npy --layout pairs",
            "there are 1 sources and 2 targets; pairs need the same number of both",
        ),
        ("isolines plane.ply --source 0 --out l.obj", "give --count, or --level"),
        ("isolines plane.ply --source 0 --out l.obj --count 2 --level 1", "not both"),
        ("isolines plane.ply --source 0 --out l.obj --count 0", "--count"),
        ("isolines plane.ply --out l.obj --count 1", "give --source at least once, or --values"),
        ("isolines plane.ply --source 0 --out l.npy --count 1", ".csv or .json"),
        ("path plane.ply --source 0 --target 1 --out p.obj --barriers 3;4", "'3;4' is not a list"),
        ("nearest plane.ply --source 0 --candidate 1 --barriers -3", "--barriers"),
        ("nearest plane.ply --source 0", "--candidate"),
        ("nearest plane.ply --source 0 --candidate 1 -k 2", "-k is 2, but there are only 1"),
        ("nearest plane.ply --source 0 --candidate 1 -k 0", "-k"),
        ("nearest plane.ply --source 0 --candidate x", "'x' is not a point"),
        ("sample cube c.ply", "cube"),
        ("sample knot c.obj", ".ply"),
        ("serve --port 70000", "--port"),
    ],
)
def test_a_wrong_command_line_says_so_in_one_line(
    run: Run, plane: Path, arguments: str, message: str
) -> None:
    ran = run(*arguments.split())
    assert ran.code == 2
    assert message in error_line(ran)
    assert list(Path().iterdir()) == [plane]


def test_borders_are_drawn(run: Run, plane: Path) -> None:
    sources = ["--source", 0, "--source", 60, "--source", 99]
    ran = run("borders", plane, *sources, "--out", "b.json")
    assert (ran.code, ran.err) == (0, "")
    expected = gc.exact_distance(gc.load_mesh(plane), [0, 60, 99]).borders()
    drawn = json.loads(Path("b.json").read_text())["borders"]
    assert [tuple(line["sources"]) for line in drawn] == [line.sources for line in expected]
    assert [line["points"] for line in drawn] == [line.points.tolist() for line in expected]
    assert ran.out.count("border ") == len(expected) > 0


def test_a_log_map_is_the_library_s(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    for axis, looking in (("1,0.5,0", [1.0, 0.5, 0.0]), ("v60", 60)):
        ran = run("log-map", plane, "--source", 3, "--x-axis", axis, "--out", "map.npy")
        assert (ran.code, ran.err) == (0, "")
        own = gc.log_map(mesh, 3, x_axis=looking)
        columns = own.distances, own.angles, own.coordinates, own.bends
        np.testing.assert_array_equal(np.load("map.npy"), np.column_stack(columns))
    assert ran.figure("reached") == "121 of 121 vertices"
    assert ran.figure("bent") == f"{(own.bends > 0).sum()} of 121 paths"
    assert ran.figure("total angle") == repr(own.total_angle)
    ran = run("log-map", plane, "--source", 60, "--true-angles", "--json")
    own = gc.log_map(mesh, 60, rescale=False)
    assert json.loads(ran.out)["coordinates"] == own.coordinates.tolist()


def test_lines_go_straight_on(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    start = ["--from", "v60"]
    ran = run("trace", plane, *start, "--direction", "-1,0.5,0", "--length", 9, "--out", "t.json")
    assert (ran.code, ran.err) == (0, "")
    (line,) = json.loads(Path("t.json").read_text())["lines"]
    own = gc.trace(mesh, 60, [-1.0, 0.5, 0.0], 9.0)
    assert line["points"] == own.points.tolist()
    assert f"{own.length!r} long" in ran.out
    assert "stopped by boundary" in ran.out
    many = [option for angle in (0, 1, 2) for option in ("--direction", angle)]
    ran = run("trace", plane, *start, *many, "--length", 0.2, "--at-vertices", "stop", "--json")
    found = json.loads(ran.out)["lines"]
    expected = gc.trace(mesh, [60] * 3, [0.0, 1.0, 2.0], 0.2, at_vertices="stop")
    assert [line["points"] for line in found] == [line.points.tolist() for line in expected]


def test_points_are_spread_and_moved(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    ran = run("farthest", plane, "--count", 5, "--from", 7, "--from", 60, "--out", "p.csv")
    assert (ran.code, ran.err) == (0, "")
    own = gc.farthest_points(mesh, 5, start=[7, 60])
    assert [int(row["vertex"]) for row in rows_of("p.csv")] == own.vertices.tolist()
    assert (ran.figure("points"), ran.figure("reach")) == ("5", repr(own.radius[-1].item()))
    ran = run("farthest", plane, "--radius", 0.5, "--iterations", 3, "--out", "p.npy")
    relaxed = gc.relax_points(mesh, gc.farthest_points(mesh, radius=0.5).points, 3)
    places = [mesh.position(point) for point in relaxed.points]
    np.testing.assert_array_equal(np.load("p.npy")[:, :3], places)
    first, *_, last = relaxed.costs.tolist()
    assert ran.figure("cost") == f"{first!r}, then {last!r}: not converged"


def test_cells_and_means_are_the_library_s(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    sources = ["--source", 0, "--source", 60, "--source", 99]
    ran = run("cells", plane, *sources, "--max-distance", 0.4, "--out", "c.csv")
    assert (ran.code, ran.err) == (0, "")
    own = gc.exact_distance(mesh, [0, 60, 99], max_distance=0.4).cells()
    assert [float(row["area"]) for row in rows_of("c.csv")] == own.areas.tolist()
    assert f"of source 2: {own.areas[2].item()!r}" in ran.out
    assert ran.figure("neighbours") == f"{len(own.adjacency)} pairs"
    points = ["--at", 3, "--at", 60, "--at", 115]
    ran = run("mean", plane, *points, *("--weight", 1) * 2, "--weight", 2.5, "--out", "m.json")
    mean = gc.mean_point(mesh, [3, 60, 115], [1, 1, 2.5])
    assert ran.figure("variance").startswith(f"{mean.variance!r}, converged after {mean.moves}")
    answer = json.loads(Path("m.json").read_text())
    assert answer["mean"]["position"] == mesh.position(mean.point).tolist()


def test_loops_are_the_library_s(run: Run) -> None:
    assert run("sample", "knot", "--faces", 2000, "knot.ply").code == 0
    mesh = gc.load_mesh("knot.ply")
    ran = run("loop", "knot.ply", "--out", "loops.json", "--locations")
    assert (ran.code, ran.err) == (0, "")
    loops = gc.handle_loops(mesh)
    for loop in loops:
        assert f"loop        {loop.length!r} long, through {len(loop.faces)} faces" in ran.out
    assert run("loop", "knot.ply", "--through", 7, "--out", "loop.csv").code == 0
    own = gc.shortest_loop(mesh, 7)
    assert [[float(row[x]) for x in "xyz"] for row in rows_of("loop.csv")] == own.points.tolist()
    along = "--along", "@loops.json", "--along", "/".join(map(str, mesh.faces[9]))
    ran = run("straighten", "knot.ply", *along, "--out", "tight.json")
    lines = json.loads(Path("tight.json").read_text())["lines"]
    given = [
        *(mesh.curve(loop.locations, closed=True) for loop in loops),
        mesh.curve(mesh.faces[9]),
    ]
    for line, curve in zip(lines, map(gc.straighten, given), strict=True):
        assert (line["closed"], line["length"]) == (curve.closed, curve.length)
        assert line["points"] == curve.points.tolist()
    assert ran.figure("curve") == f"{lines[2]['length']!r} long, through 1 faces"
    assert run("sample", "sphere", "--faces", 320, "ball.ply").code == 0
    assert run("loop", "ball.ply").figure("loops") == "none: the surface has no handle"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("loop --through 60", "--through 60: every loop on this part of the surface shrinks"),
        ("loop --through 999", "--through 999: vertex 999 does not exist"),
        ("straighten --along 0/60", "--along 0/60: shares no face with the point before it"),
        ("straighten --along @ring.json", "--along @ring.json: the curve shrinks to a point"),
    ],
)
def test_loops_that_are_none(run: Run, plane: Path, arguments: str, message: str) -> None:
    ring = "isolines", plane, "--source", 60, "--level", 0.3, "--locations", "--out", "ring.json"
    assert run(*ring).code == 0
    command, *rest = arguments.split()
    ran = run(command, plane, *rest)
    assert ran.code != 0
    assert message in error_line(ran)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("farthest", "give --count or --radius, or both"),
        ("farthest --count 500", "--count: count is 500, but only 121 points"),
        ("farthest --count 3 --from 999", "--from 999: vertex 999 does not exist"),
        ("cells --source 0 --source 999", "--source 999: vertex 999 does not exist"),
        ("mean --at 0 --at 4 --weight 1", "--weight: give one for each of 2 points"),
        ("mean --at 0 --at 4 --weight 0 --weight 0", "--weight: one must be above 0"),
    ],
)
def test_samples_that_are_none(run: Run, plane: Path, arguments: str, message: str) -> None:
    command, *rest = arguments.split()
    ran = run(command, plane, *rest)
    assert ran.code != 0
    assert message in error_line(ran)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("trace --from 60 --direction north --length 1", "'north' is neither an angle in radians"),
        ("trace --from 60 --direction 1,0 --length 1", "'1,0' is neither an angle in radians"),
        ("trace --from 60 --direction 0,0,1 --length 1", "--direction 0,0,1: direction 0 is [0.0"),
        ("trace --from 999 --direction 1 --length 1", "--from 999: vertex 999 does not exist"),
        ("trace --from 60 --direction 1 --length -1", "--length is -1.0"),
        ("trace --from 60 --from 3 --direction 1 --length 1 --length 2 --length 3", "--from"),
        ("log-map --source 60 --x-axis 0,0,1", "--x-axis: x_axis has no direction"),
        ("log-map --source 60 --x-axis west", "west"),
    ],
)
def test_directions_that_are_none(run: Run, plane: Path, arguments: str, message: str) -> None:
    command, *rest = arguments.split()
    ran = run(command, plane, *rest)
    assert ran.code != 0
    assert message in error_line(ran)


def test_a_mesh_of_lengths_alone(run: Run) -> None:
    np.savez("one.npz", faces=[[0, 1, 2]], lengths=[[3.0, 4.0, 5.0]])
    assert run("info", "one.npz").figure("bounds") == "none"
    assert run("distance", "one.npz", "--source", 0, "--out", "d.npy").code == 0
    assert np.load("d.npy").tolist() == [0.0, 3.0, 5.0]
    assert run("path", "one.npz", "--source", 0, "--target", 1).figure("length") == "3.0"
    assert run("path", "one.npz", "--source", 0, "--target", 1, "--out", "p.csv").code == 0
    for command, out in (
        ("distance one.npz --source 0", "d.ply"),
        ("locate one.npz --at 0,0,0", ""),
    ):
        ran = run(*command.split(), *(["--out", out] if out else []))
        assert ran.code != 0
        assert "lengths alone" in error_line(ran)


def test_isolines_are_drawn(run: Run, plane: Path) -> None:
    field = gc.exact_distance(gc.load_mesh(plane), 60)
    for name in ("lines.obj", "lines.json"):
        ran = run("isolines", plane, "--source", 60, "--level", 0.3, "--level", 0.6, "--out", name)
        assert (ran.code, ran.err) == (0, "")
        assert ran.figure("level       0.3").startswith(": 1 closed, 0 open, 1.88")
        assert ran.figure("level       0.6").startswith(": 0 closed, 4 open")
        assert ran.figure("written") == name
    expected = field.isolines([0.3, 0.6])
    drawn = json.loads(Path("lines.json").read_text())["isolines"]
    assert [level["level"] for level in drawn] == [0.3, 0.6]
    for level, lines in zip(drawn, expected, strict=True):
        assert [line["points"] for line in level["lines"]] == [i.points.tolist() for i in lines]
        assert [line["closed"] for line in level["lines"]] == [i.closed for i in lines]
    spaced = run("isolines", plane, "--source", 60, "--count", 2, "--out", "lines.json")
    assert spaced.out.count("level ") == 2
    rough = run(
        *("isolines", plane, "--source", 60, "--count", 2, "--out", "lines.json"),
        *("--method", "approximate", "--chord-error", 0.01),
    )
    assert rough.figure("error bound") == "0.001 (relative, guaranteed)"


def test_a_mesh_is_cut_along_lines_of_files(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    assert run("path", plane, "--source", 0, "--target", 120, "--out", "path.json").code == 0
    ring = ("isolines", plane, "--source", 60, "--level", 0.3, "--locations")
    assert run(*ring, "--out", "ring.json").code == 0
    along = ("--along", "@path.json", "--along", "@ring.json", "--along", "0/1")
    path, rings = gc.shortest_path(mesh, 0, 120), gc.exact_distance(mesh, 60, retain="windows")
    lines = [path, *rings.isolines([0.3])[0], gc.Curve([0, 1])]
    own = gc.cut(mesh, lines)
    ran = run("cut", plane, *along, "--out", "cut.npz")
    assert ran.figure("cut") == f"{len(own.vertices)} vertices, {len(own.faces)} faces"
    assert ran.figure("parts") == str(own.parts.max() + 1)
    with np.load("cut.npz") as arrays:
        for name in ("vertices", "faces", "face_of", "location_faces", "curve_edges", "parts"):
            np.testing.assert_array_equal(arrays[name], getattr(own, name))
    again = gc.load_mesh("cut.npz")
    assert again.vertices.tobytes() == own.vertices.tobytes()
    np.testing.assert_array_equal(again.faces, own.faces)
    assert run("cut", plane, *along, "--out", "cut.ply").code == 0
    np.testing.assert_array_equal(gc.load_mesh("cut.ply").vertices, own.vertices)
    whole = run("cut", plane, *along, "--whole", "--json")
    assert json.loads(whole.out)["vertices"] == len(gc.cut(mesh, lines, False).vertices)
    nearly = f"0/f0:{1 - 2.0**-31!r},{2.0**-31!r},0"
    assert run("cut", plane, "--along", nearly).figure("snapped").startswith("1 points")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--along", "0/999"], "--along 0/999: vertex 999 does not exist"),
        (["--along", "0/60"], "--along 0/60: shares no face with the point before it"),
        (["--along", "@none.json"], "cannot read none.json"),
        (["--along", "@plane.ply"], "plane.ply is not JSON"),
        (["--along", "@line.json"], "line.json has no lines with locations"),
        (["--along", "0/1", "--out", "-"], "- must end in .ply, .npz or .json"),
        (["--along", "0/1", "--out", "c.obj"], "c.obj must end in .ply, .npz or .json"),
    ],
)
def test_cuts_that_are_refused(run: Run, plane: Path, arguments: list[str], message: str) -> None:
    Path("line.json").write_text('{"isolines": [{"level": 1, "lines": []}]}')
    ran = run("cut", plane, *arguments)
    assert ran.code != 0
    assert message in ran.err


def test_isolines_of_values_and_boundaries(run: Run, plane: Path) -> None:
    mesh = gc.load_mesh(plane)
    values = mesh.vertices[:, 0] - mesh.vertices[:, 1] ** 2
    values[60:63] = np.nan
    expected = gc.ScalarField(mesh, values).isolines([-0.25, 0.0])
    np.save("v.npy", values)
    cells = ["" if np.isnan(value) else repr(float(value)) for value in values]
    Path("v.csv").write_text("vertex,value\n" + "".join(f"{i},{x}\n" for i, x in enumerate(cells)))
    Path("v.txt").write_text("# heights\n" + "".join(f"{x or 'nan'}\n" for x in cells))
    for name in ("v.npy", "v.csv", "v.txt"):
        levels = "--level", -0.25, "--level", 0
        ran = run("isolines", plane, "--values", name, *levels, "--out", "lines.json")
        assert (ran.code, ran.err) == (0, "")
        drawn = json.loads(Path("lines.json").read_text())["isolines"]
        assert [[line["points"] for line in level["lines"]] for level in drawn] == [
            [line.points.tolist() for line in lines] for lines in expected
        ]
    assert ran.figure("level       0.0").startswith(f": 0 closed, {len(expected[1])} open")
    ran = run("boundaries", plane, "--barriers", "110", "--out", "rims.json")
    own = mesh.with_barriers([110]).boundaries()
    rims = json.loads(Path("rims.json").read_text())["boundaries"]
    assert [rim["points"] for rim in rims] == [rim.points.tolist() for rim in own]
    assert ran.out.count("boundary    closed, ") == len(own) == 2


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"1\n2 3\n", "line 2: '2 3' must be one number"),
        (b"height\n1\n", "'height' has no column named value"),
        (b"1\nup\n", "line 2: 'up' must be one number"),
        (b"1\n2\n", "--values: the values have shape (2,)"),
        (None, "cannot read v.txt"),
    ],
)
def test_files_that_hold_no_values(
    run: Run, plane: Path, content: bytes | None, words: str
) -> None:
    if content is not None:
        Path("v.txt").write_bytes(content)
    ran = run("isolines", plane, "--values", "v.txt", "--count", 2)
    assert ran.code != 0
    assert words in error_line(ran)


def test_arrays_that_hold_no_values(run: Run, plane: Path) -> None:
    np.save("v.npy", np.zeros((121, 2)))
    for words in ("has the shape (121, 2)", "is no array of numpy's"):
        ran = run("isolines", plane, "--values", "v.npy", "--count", 2)
        assert ran.code != 0
        assert words in error_line(ran)
        Path("v.npy").write_bytes(b"no array")


def test_barriers_are_in_the_way(run: Run, plane: Path) -> None:
    walled = gc.load_mesh(plane).with_barriers(range(100, 116))
    ends = ("--source", 0, "--target", 10)
    block = ("--barriers", "100,101-114,115")
    assert run("path", plane, *ends, "--out", "p.json", *block).code == 0
    length = json.loads(Path("p.json").read_text())["length"]
    assert length == gc.shortest_path(walled, 0, 10).length > 1.9
    assert (
        run("paths", plane, *ends, "--out", "ps.json", *block)
        .figure("path")
        .endswith(f"{length!r}, error bound 0.0 (relative, guaranteed)")
    )
    run("matrix", plane, *ends, "--out", "m.npy", *block)
    assert np.load("m.npy") == pytest.approx(length, rel=1e-12)
    run("distance", plane, "--source", 0, "--out", "d.npy", *block)
    assert np.load("d.npy")[10] == pytest.approx(length, rel=1e-12)
    near = ("--candidate", 10, "--candidate", 110)
    assert run("nearest", plane, "--source", 0, *near, *block).figure("nearest").startswith("110 ")


def test_barriers_that_are_no_faces(run: Run, plane: Path) -> None:
    for faces, message in (("3,200", "face 200"), ("0-199", "block every face")):
        ran = run("distance", plane, "--source", 0, "--out", "d.npy", "--barriers", faces)
        assert ran.code == 1
        assert message in error_line(ran)
    assert list(Path().iterdir()) == [plane]


def test_a_run_of_barriers_beyond_the_mesh_is_refused_before_it_is_listed(
    run: Run, plane: Path
) -> None:
    for command in (
        ("distance", plane, "--source", 0),
        ("matrix", plane, "--points", "all", "--out", "m.npy"),
    ):
        ran = run(*command, "--barriers", "3,0-999999999")
        assert ran.code == 1
        message = "error: --barriers: face 200 does not exist; the indices are 0 to 199\n"
        assert error_line(ran) == message


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("missing", "No such file or directory"),
        (".", "Is a directory"),
        ("plane.ply", "it is not text in UTF-8, or in UTF-16 with a byte order mark"),
    ],
)
def test_a_file_of_barriers_or_points_that_cannot_be_read(
    run: Run, plane: Path, name: str, reason: str
) -> None:
    ran = run("distance", plane, "--source", 0, "--barriers", f"@{name}")
    assert ran.code == 2
    assert f"'--barriers': cannot read {name}: {reason} (" in error_line(ran)
    ran = run("matrix", plane, "--points", name, "--out", "m.npy")
    assert (ran.code, error_line(ran)) == (1, f"error: cannot read {name}: {reason}\n")


def test_a_file_of_barriers_names_no_file(run: Run, plane: Path) -> None:
    Path("loop.txt").write_text("3\n@loop.txt\n")
    ran = run("distance", plane, "--source", 0, "--barriers", "@loop.txt")
    assert ran.code == 2
    assert "'@loop.txt' is not a list of faces" in error_line(ran)


def test_faces_that_run_backwards_are_refused(run: Run, plane: Path) -> None:
    ran = run("distance", plane, "--source", 0, "--barriers", "3,59-40")
    assert ran.code == 2
    assert "'59-40' runs backwards: write it as 40-59" in error_line(ran)


def test_an_output_that_cannot_be_written_is_an_error(run: Run, plane: Path) -> None:
    Path("d.npy").mkdir()
    ran = run("distance", plane, "--source", 0, "--out", "d.npy")
    assert ran.code == 1
    assert "cannot write d.npy" in error_line(ran)
    assert sorted(Path().iterdir()) == [Path("d.npy"), plane]


def test_ctrl_c_stops_the_sweep_and_leaves_nothing(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = gc.Solver.exact_distance

    def press_ctrl_c_at_the_first_look(
        *arguments: Any, cancel: Callable[[], bool], **_: Any
    ) -> Any:
        def press_and_look() -> bool:
            signal.raise_signal(signal.SIGINT)
            return cancel()

        return solve(*arguments, cancel=press_and_look)

    monkeypatch.setattr(
        "geodesic_core.fields.sweep._FIRST_BUDGET", 10
    )  # looks soon, on so small a mesh
    monkeypatch.setattr(gc.Solver, "exact_distance", press_ctrl_c_at_the_first_look)
    ran = run("distance", plane, "--source", 0, "--out", "d.npy")
    assert (ran.code, ran.out, ran.err) == (130, "", "error: interrupted\n")
    assert list(Path().iterdir()) == [plane]


def test_ctrl_c_while_a_mesh_is_read_takes_effect_after_it(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = gc.load_mesh
    usual = signal.getsignal(signal.SIGINT)

    def press_ctrl_c(*arguments: Any, **options: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return load(*arguments, **options)

    monkeypatch.setattr(gc, "load_mesh", press_ctrl_c)
    ran = run("info", plane)
    assert (ran.code, ran.out, ran.err) == (130, "", "error: interrupted\n")
    assert signal.getsignal(signal.SIGINT) is usual


def test_ctrl_c_pressed_twice_does_not_wait(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def press_ctrl_c_twice(*_: Any, **__: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("must not get here")

    monkeypatch.setattr(gc, "load_mesh", press_ctrl_c_twice)
    assert run("info", plane).code == 130


def test_ctrl_c_while_the_output_is_written_leaves_nothing(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def press_ctrl_c(*_: Any, **__: Any) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(csv, "writer", press_ctrl_c)
    assert run("distance", plane, "--source", 0, "--out", "d.csv").code == 130
    assert list(Path().iterdir()) == [plane]


def test_an_error_of_the_program_itself_is_not_hidden(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def break_down(*_: Any, **__: Any) -> None:
        raise gc.errors.InternalError("the sweep is broken")

    monkeypatch.setattr(gc.Solver, "exact_distance", break_down)
    with pytest.raises(gc.errors.InternalError):
        run("distance", plane, "--source", 0, "--out", "d.npy")


def test_version_and_help(run: Run) -> None:
    assert run("--version").out == f"geodesic {__version__}\n"
    usage = run("--help")
    assert usage.code == 0
    for command in (
        "serve",
        "info",
        "distance",
        "path",
        "paths",
        "isolines",
        "matrix",
        "nearest",
        "locate",
        "sample",
    ):
        assert command in usage.out
        assert "--help" in run(command, "--help").out


def loaded_by(*arguments: str) -> set[str]:
    """Return the packages that a command has loaded at its end."""
    told = told_by(
        f"import sys; sys.argv[1:] = {list(arguments)}\n"
        "from app.cli import main\n"
        "try: main()\n"
        "except SystemExit: print(*{name.partition('.')[0] for name in sys.modules})"
    )
    return set(told.splitlines()[-1].split())


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["matrix", "--help"], ["store", "--help"]]
)
def test_help_needs_no_numbers(arguments: list[str]) -> None:
    assert not loaded_by(*arguments) & {"numpy", "numba", "fastapi"}


@pytest.mark.slow
def test_commands_load_no_packages_that_they_do_not_need(tmp_path: Path) -> None:
    mesh, out = str(tmp_path / "mesh.ply"), str(tmp_path / "d.npy")
    assert not loaded_by("sample", "plane", mesh) & SLOW
    assert not loaded_by("distance", mesh, "--source", "0", "--out", out) & SLOW


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[uvicorn.Config]:
    """With what servers would have run."""
    configs: list[uvicorn.Config] = []

    def note(server: uvicorn.Server) -> None:
        configs.append(server.config)
        server.started = True

    monkeypatch.setattr(uvicorn.Server, "run", note)
    return configs


def test_serve_runs_the_application(
    run: Run, served: list[uvicorn.Config], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GEODESIC_DRAIN_S", "7.5")
    assert run("serve", "--host", "127.0.0.9", "--port", 8123).code == 0
    (config,) = served
    assert isinstance(config.app, FastAPI)
    assert (config.host, config.port) == ("127.0.0.9", 8123)
    assert config.timeout_graceful_shutdown == 8


def test_a_service_that_cannot_start_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uvicorn.Server, "run", lambda _: None)
    assert run("serve").code == 1


def test_serve_refuses_wrong_settings(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uvicorn.Server, "run", lambda _: pytest.fail("must not start"))
    monkeypatch.setenv("GEODESIC_WORKERS", "none")
    ran = run("serve")
    assert ran.code == 2
    assert "GEODESIC_WORKERS" in error_line(ran)
    assert "GEODESIC_WORKER_MEMORY" not in error_line(ran)
    monkeypatch.delenv("GEODESIC_WORKERS")
    monkeypatch.setenv("GEODESIC_WORKER", "2")
    ran = run("serve")
    assert ran.code == 2
    assert "GEODESIC_WORKER" in error_line(ran)


@pytest.mark.slow
@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.7", "example.org", "", "127.0.0.1.x"])  # noqa: S104
def test_serve_on_other_addresses_asks_for_keys(
    run: Run, served: list[uvicorn.Config], monkeypatch: pytest.MonkeyPatch, host: str
) -> None:
    ran = run("serve", "--host", host, "--port", 0)
    assert ran.code == 2
    assert "GEODESIC_API_KEYS" in error_line(ran)
    assert "GEODESIC_AUTH=off" in error_line(ran)
    assert not served

    monkeypatch.setenv("GEODESIC_API_KEYS", "alice:0123456789abcdef")
    assert run("serve", "--host", host, "--port", 0).code == 0
    monkeypatch.setenv("GEODESIC_AUTH", "off")
    ran = run("serve", "--host", host, "--port", 0)
    assert ran.code == 2
    assert "GEODESIC_AUTH is off, but GEODESIC_API_KEYS has keys" in error_line(ran)
    monkeypatch.delenv("GEODESIC_API_KEYS")
    assert run("serve", "--host", host, "--port", 0).code == 0
    assert [config.host for config in served] == [host, host]


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.10", "::1", "localhost"])
def test_serve_on_this_machine_needs_none(
    run: Run, served: list[uvicorn.Config], host: str
) -> None:
    assert run("serve", "--host", host, "--port", 0).code == 0
    assert [config.host for config in served] == [host]


def test_serve_shows_no_key_that_it_refuses(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODESIC_API_KEYS", "alice:0123456789abcdef,0123456789abcdef")
    ran = run("serve")
    assert ran.code == 2
    assert "GEODESIC_API_KEYS" in error_line(ran)
    assert "0123456789" not in ran.err + ran.out


def test_the_manual_names_every_setting_and_no_other() -> None:
    manual = (ROOT / "docs" / "operations.md").read_text()
    named = set(re.findall(r"^\| `(GEODESIC_\w+)`", manual, re.MULTILINE))
    assert named == {variable_of(field) for field in Settings.model_fields}


@pytest.mark.parametrize("method", [[], ["--method", "approximate", "--relative-error", 0.05]])
def test_proofs_are_files_for_the_checker(run: Run, plane: Path, method: list[object]) -> None:
    mesh = gc.load_mesh(plane)
    if method:
        certificate = gc.approximate_distance(mesh, [0, 7], 0.05).certify()
    else:
        certificate = gc.exact_distance(mesh, [0, 7]).certify()
    certificate.save("expected.npz")
    asked = (plane, "--source", 0, "--source", 7, *method)

    ran = run("certify", *asked, "--out", "proof.npz")

    assert Path("proof.npz").read_bytes() == Path("expected.npz").read_bytes()
    gap = f"to {certificate.relative_gap:.2g} of the largest distance"
    assert ran.figure("proved") == gap
    assert ran.figure("error bound").endswith("(absolute, certified)")
    assert run("distance", *asked, "--certify").figure("proved") == gap
    assert "proved" not in run("distance", *asked).out


def test_fast_distances_are_proved_as_well(run: Run, plane: Path) -> None:
    ran = run("distance", plane, "--source", 0, "--method", "fast", "--certify")
    assert ran.figure("error bound").endswith("(absolute, certified)")


def test_a_proof_is_an_archive(run: Run, plane: Path) -> None:
    assert "must end in .npz" in run("certify", plane, "--source", 0, "--out", "proof.csv").err
