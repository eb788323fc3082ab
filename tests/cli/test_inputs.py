"""Input of commands: meshes from standard input, files of points and of faces, labels."""

import gzip
import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.commands import Ran, Run, error_line

pytestmark = pytest.mark.slice(8)

CORNER_TO_CORNER = [[0.0, 2**0.5], [2**0.5, 0.0]]
WALL = [6, 7, 14, 15, 22, 23, 30, 31]
"""Faces of the square from x = 0.75 on"""


@pytest.fixture
def square(run: Run) -> Path:  # noqa: ARG001 - it goes to an empty folder
    """The unit square, of 5 × 5 vertices."""
    rows = [f"v {i / 4} {j / 4} 0" for j in range(5) for i in range(5)]
    for a in (5 * j + i + 1 for j in range(4) for i in range(4)):
        rows += [f"f {a} {a + 1} {a + 6}", f"f {a} {a + 6} {a + 5}"]
    path = Path("square.obj")
    path.write_text("\n".join(rows) + "\n")
    return path


# Standard input -----------------------------------------------------------------------------------


def piped(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))


@pytest.mark.parametrize(
    "arguments",
    [
        "info -",
        "distance - --source 0",
        "path - --source 0 --target 24",
        "paths - --source 0 --target 24",
        "isolines - --source 0 --count 2",
        "borders - --source 0 --source 24",
        "nearest - --source 0 --candidate 24",
        "locate - --at 0,0,0",
        "matrix - --source 0 --target 24",
        "matrix - --points all --out m.npy",
    ],
)
def test_each_command_reads_standard_input(
    run: Run, square: Path, monkeypatch: pytest.MonkeyPatch, arguments: str
) -> None:
    command = arguments.split()
    piped(monkeypatch, square.read_bytes())
    ran = run(*command, "--format", "obj")
    assert (ran.code, ran.err) == (0, "")
    from_file = run(*[square if each == "-" else each for each in command])
    timed = "took", "read in", "sha256", "continued"

    def lines(ran: Ran) -> list[str]:
        return [line for line in ran.out.splitlines() if not line.startswith(timed)]

    assert lines(ran) == lines(from_file)
    monkeypatch.setattr(sys, "stdin", None)
    ran = run(*command)
    assert ran.code == 2
    assert "name its format, as --format obj" in error_line(ran)


def test_a_format_may_be_named_for_any_file(
    run: Run, square: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = gc.load_mesh(square)
    off = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    off += [" ".join(map(repr, vertex)) for vertex in mesh.vertices.tolist()]
    off += [" ".join(map(str, [3, *face])) for face in mesh.faces.tolist()]
    Path("no-suffix").write_bytes(square.read_bytes())
    Path("square.dat").write_text("\n".join(off))
    for name, file_format in (("no-suffix", "obj"), ("square.dat", "OFF"), ("square.obj", ".obj")):
        assert run("info", name, "--format", file_format).figure("faces") == "32"
    piped(monkeypatch, Path("square.dat").read_bytes())
    assert run("info", "-", "--format", "off").figure("faces") == "32"
    assert "--format" in error_line(run("info", "no-suffix"))
    assert "'xyz'; it must be one of obj, " in error_line(run("info", square, "--format", "xyz"))
    ran = run("batch", "no-suffix", "--format", "obj", "--source", 0, "--json")
    assert json.loads(ran.out)[0]["farthest"] == pytest.approx(2**0.5)


# Files of points and of faces ---------------------------------------------------------------------


def matrix_of(run: Run, square: Path, content: bytes | str, name: str = "points.txt") -> Ran:
    data = content.encode() if isinstance(content, str) else content
    Path(name).write_bytes(data)
    return run("matrix", square, "--points", name, "--out", "d.npy")


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf0\n24\n",
        "0\r\n24\r\n".encode("utf-16"),
        b"\xfe\xff" + "0\n24".encode("utf-16-be"),
        "0  # start\n24  # end\n",
        "# two corners\n\n  0\t\n24",
        "vertex\n0\n24\n",
        '"Index"\n"0"\n"24"\n',
        "name;vertex;x\na;0;9\nb;24;9\n",
        "0, 24\n",
        "0;24",
        "0\t24\n",
        "0 24 # in one row",
        "0.000000000000000000e+00\n2.400000000000000000e+01\n",
        "0.0\n24.\n",
        "x,y,z\n0,0,0\n1,1,0\n",
        "\ufeffX;Y;Z\n0;0;0\n1;1;0\n",
        "id,z,x,y\n7,0,0,0\n8,0,1,1\n",
        '"Points:0","Points:1","Points:2"\n0,0,0\n1,1,0\n',
        "0 0 0\n1 1 0\n",
        "0.0 ,0.0 ,0.0\n1.0, 1.0, 0.0\n",
        "0;0;0\n1;1;0\n",
        "0,0,0,\n1,1,0,\n",
        "0\t0\t0\n1\t1\t0\n",
        "0.00e+00 0.00e+00 0.00e+00\n1.000e+00 1.000e+00 0.000e+00\n",
        "p0,0,0\np 1, 1, 0\n",
        "v0\nf31:0, 1, 0\n",
    ],
)
def test_points_come_as_other_programs_write_them(run: Run, square: Path, content: str) -> None:
    ran = matrix_of(run, square, content)
    assert (ran.code, ran.err) == (0, "")
    np.testing.assert_allclose(np.load("d.npy"), CORNER_TO_CORNER, rtol=1e-12)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x;y;z\n0,0;0,0;0,0\n1,0;1,0;0,0\n", "line 2: '0,0' has a decimal comma: write 0.0"),
        ("0,5\t1,5\t2,5", "line 1: '0,5' has a decimal comma: write 0.5"),
        ("0,0 1,5e-1 2,0\n", "line 1: '0,0' has a decimal comma: write 0.0"),
        ("x,y,z\n0;0,5;0\n", "line 2: '0,5' has a decimal comma: write 0.5"),
        ("0 24 12", "line 1: '0 24 12' may be a position or three vertices: write p0,24,12"),
        ("0 24\n1 2\n", "line 1: '0 24' has 2 columns: write one vertex per line, or"),
        ("1,0,0,0\n2,1,1,0\n", "line 1: '1,0,0,0' has 4 columns"),
        ("x,y,z\n0,0\n", "line 2: '0,0' has fewer columns than the header"),
        ("0\n1.5\n", "line 2: '1.5' is not a point"),
        ("0\nnan\n", "line 2: 'nan' is not a point"),
        ("0\n0 0 inf\n", "line 2: 'p0,0,inf' is not a point"),
        ("vv0\n24\n", "line 1: 'vv0' is not a point"),
        ("corner\n0\n24\n", "line 1: 'corner' is not a point"),
        ("0\n-1\n", "line 2: the point is vertex -1"),
        ("vertex\n", "points.txt has no points"),
        ("", "points.txt has no points"),
        ("0\n24\n".encode("utf-16-le"), "it is not text in UTF-8, or in UTF-16 with a byte order"),
        (b"\x93NUMPY\x01\0", "it is not text in UTF-8"),
        ("é\n".encode("latin-1"), "it is not text in UTF-8"),
    ],
)
def test_what_is_no_point_is_named_with_its_line(
    run: Run, square: Path, content: str, message: str
) -> None:
    ran = matrix_of(run, square, content)
    assert ran.code == 1
    assert message in error_line(ran)
    assert not Path("d.npy").exists()


@pytest.mark.parametrize(
    "content",
    [
        "6-7,14,15\n22\n23 30 31",
        b"\xef\xbb\xbf6-7;14;15\r\n22-23, 30-31\r\n",
        "6-7 14-15 22-23 30-31".encode("utf-16"),
        "# the wall\n6 # first\n7\n14\n15\n22\n23\n30\n31",
        "face\n6\n7\n14\n15\n22\n23\n30\n31\n",
        "area;Face\n1;6-7\n1;14-15\n2;22-23\n2;30-31\n",
        "".join(f"{face:.18e}\n" for face in WALL),
        "\t".join(map(str, WALL)),
    ],
)
def test_faces_come_as_other_programs_write_them(
    run: Run, square: Path, content: bytes | str
) -> None:
    Path("wall.txt").write_bytes(content.encode() if isinstance(content, str) else content)
    ran = run("distance", square, "--source", 0, "--barriers", "@wall.txt", "--out", "d.npy")
    assert (ran.code, ran.err) == (0, "")
    expected = gc.exact_distance(gc.load_mesh(square), 0, barriers=WALL).distances
    np.testing.assert_array_equal(np.load("d.npy"), expected)


@pytest.mark.parametrize("content", ["6.5\n", "vertex\n6\n", "6--7", "-6", "1e99", "6 x"])
def test_what_is_no_face_is_refused(run: Run, square: Path, content: str) -> None:
    Path("wall.txt").write_text(content)
    ran = run("distance", square, "--source", 0, "--barriers", "@wall.txt")
    assert ran.code == 2
    assert "is not a list of faces: write it as 3,7,40-59" in error_line(ran)


# Labels -------------------------------------------------------------------------------------------


def label_of(name: str, vertices: list[int]) -> str:
    rows = [f"{vertex} 0 0 0 0" for vertex in vertices]
    Path(name).write_text("\n".join(["#!ascii label", str(len(rows)), *rows, ""]))
    return name


def cortex(name: str = "lh.cortex.label") -> str:
    return label_of(name, [vertex for vertex in range(25) if vertex % 5 < 3])


def test_paths_may_be_kept_within_a_label(run: Run, square: Path) -> None:
    for label in (cortex(), cortex("CORTEX.LABEL")):
        ran = run("distance", square, "--source", 0, "--barriers", f"outside@{label}", "--json")
        expected = gc.exact_distance(gc.load_mesh(square), 0, barriers=WALL).distances
        found = np.array(json.loads(ran.out)["distances"], float)
        np.testing.assert_array_equal(found, np.where(np.isinf(expected), np.nan, expected))
    assert "names no label" in error_line(
        run("distance", square, "--source", 0, "--barriers", "outside@faces.txt")
    )


def test_a_label_is_a_source(run: Run, square: Path) -> None:
    Path("labels").mkdir()
    label = cortex("labels/cortex.label")
    Path("cortex.label.gz").write_bytes(gzip.compress(Path(label).read_bytes()))
    for source in (f"@{label}", "@cortex.label.gz"):
        assert run("distance", square, "--source", source, "--out", "d.npy").code == 0
        np.testing.assert_allclose(np.load("d.npy").reshape(5, 5), [[0, 0, 0, 0.25, 0.5]] * 5)
    assert run("distance", square, "--source", f"outside@{label}", "--out", "d.npy").code == 0
    np.testing.assert_allclose(np.load("d.npy").reshape(5, 5), [[0.75, 0.5, 0.25, 0, 0]] * 5)
    ran = run("isolines", square, "--source", f"@{label}", "--level", 0.2, "--json")
    drawn = json.loads(ran.out)["isolines"][0]["lines"]
    vertices = gc.load_label_vertices(label, square)
    (lines,) = gc.exact_distance(square, vertices).isolines([0.2])
    assert [line["points"] for line in drawn] == [line.points.tolist() for line in lines]
    ran = run("distance", square, "--source", 24, "--source", f"@{label}", "--json")
    assert len(json.loads(ran.out)["sources"]) == 16


@pytest.mark.parametrize(
    "command",
    [
        "borders square.obj --source 0 --source",
        "path square.obj --target 0 --source",
        "paths square.obj --target 0 --source",
        "nearest square.obj --source 0 --candidate",
        "matrix square.obj --target 0 --source",
    ],
)
@pytest.mark.usefixtures("square")
def test_other_points_are_no_labels(run: Run, command: str) -> None:
    ran = run(*command.split(), f"@{cortex('a.label')}")
    assert ran.code == 2
    assert "only the sources of distance and isolines may be labels" in error_line(ran)


def test_labels_that_block_nothing_are_told(run: Run, square: Path) -> None:
    two = label_of("two-corners.label", [0, 24])
    ran = run("distance", square, "--source", 0, "--barriers", f"@{two}")
    assert ran.code == 0
    assert ran.err.startswith("warning: two-corners.label: 2 vertices are in the label, but no fac")
    assert ran.figure("reached") == "25 of 25 vertices"
    ran = run("matrix", square, "--points", "all", "--barriers", f"@{two}", "--out", "m.npy")
    assert ran.err.startswith("warning: two-corners.label")
    none = label_of("none.label", [])
    assert "no vertex is in it" in error_line(
        run("distance", square, "--source", 0, "--barriers", f"@{none}")
    )


# What is hardly meant -----------------------------------------------------------------------------


def test_points_that_are_hardly_meant_are_told(run: Run, square: Path) -> None:
    away = "is 23.10844 away from the surface, at [14.0, 14.0, 14.0]"
    ran = run("path", square, "--source", "p0,0,0", "--target", "p14,14,14")
    assert (ran.code, ran.figure("length")) == (0, "1.4142135623730951")
    assert ran.err.startswith(f"warning: The target {away}; the nearest point of the surface was")
    assert f"warning: Source 0 {away}" in run("distance", square, "--source", "p14,14,14").err
    wall = ("--barriers", "6,7,14,15,22,23,30,31")
    ran = run("distance", square, "--source", 4, *wall)
    assert ran.figure("reached") == "1 of 25 vertices"
    blocked = "vertex 4, lies in blocked faces only: no path leads there."
    assert ran.err == f"warning: Source 0, {blocked}\n"
    ran = run("path", square, "--source", 0, "--target", 4, *wall)
    assert ran.code == 1
    assert ran.err.startswith(f"warning: The target, {blocked}\nerror: there is no path")

    Path("points.txt").write_text("0 0 0\n14 14 14\n")
    ran = run("matrix", square, "--points", "points.txt", "--out", "m.npy")
    assert ran.err.startswith(f"warning: points.txt, line 2 {away}")
    Path("some.txt").write_text("0\n4\n")
    ran = run("matrix", square, "--points", "some.txt", *wall, "--out", "w.npy")
    assert ran.err == f"warning: some.txt, line 2, {blocked}\n"
    assert np.isinf(np.load("w.npy")[0, 1])

    ran = run("batch", square, "--source", "p14,14,14", "--source", 0, "--json")
    first, second = json.loads(ran.out)
    assert first["warning"].startswith(f"p14,14,14 {away}")
    assert second["warning"] is None
    assert f"square.obj: warning: p14,14,14 {away}" in ran.err


def test_positions_of_a_file_are_sought_on_the_free_surface(run: Run, square: Path) -> None:
    """As those of options are."""
    Path("points.txt").write_text("0 0 0\n0.9 0.4 0\n")
    wall = ("--barriers", ",".join(map(str, WALL)))
    assert run("matrix", square, "--points", "points.txt", *wall, "--out", "m.npy").code == 0
    ends = ("--source", "p0,0,0", "--target", "p0.9,0.4,0")
    length = float(run("path", square, *ends, *wall).figure("length"))
    assert np.load("m.npy")[0, 1] == pytest.approx(length, rel=1e-12)


def test_warnings_of_the_mesh_are_told_with_each_answer(run: Run, square: Path) -> None:
    with square.open("a") as file:
        file.write("v 9 9 9\nl 1 2\n")
    expected = len(gc.load_mesh(square).warnings)
    assert expected > 1
    commands = ("distance", "--source", 0), ("matrix", "--points", "all", "--out", "m.npy")
    for command, *arguments in commands:
        ran = run(command, square, *arguments)
        assert ran.code == 0
        assert ran.err.count("warning: ") == ran.err.count("\n") == expected


# Refusals in words --------------------------------------------------------------------------------

DISTANCE = "distance square.obj --source 0"
REFUSED = [
    (
        f"{DISTANCE} --method nonsense",
        "'--method': 'nonsense' is not one of 'exact', 'approximate'",
    ),
    (f"{DISTANCE} --merge some", "'some' is neither 'none' nor 'exact', nor a distance"),
    (f"{DISTANCE} --max-distance far", "'--max-distance': 'far': it must be a number"),
    (f"{DISTANCE} --relative-error much", "'--relative-error': 'much': it must be a number"),
    (f"{DISTANCE} --absolute-error 1,5", "'--absolute-error': '1,5': it must be a number"),
    (f"{DISTANCE} --method fast --effort 3", "'--effort': '3' is not 1, 2, 4 or 8"),
    ("isolines square.obj --source 0 --level x", "'--level': 'x': it must be a number"),
    ("isolines square.obj --source 0 --count 1.5", "'--count': '1.5': it must be a whole number"),
    ("isolines square.obj --source 0 --count 0", "'--count': '0': it must be 1 or more"),
    (f"isolines square.obj --source 0 --count {'9' * 30}", "must be 9007199254740991 or less"),
    ("borders square.obj --source 0 --chord-error y", "'--chord-error': 'y': it must be a numb"),
    ("nearest square.obj --source 0 --candidate 1 -k two", "'-k': 'two': it must be a whole numb"),
    ("matrix square.obj --points all --out m.npy --threads 0", "'--threads': '0': it must be 1 or"),
    ("matrix square.obj --points all --out m.npy --dtype int8", "'--dtype': 'int8' is not one of"),
    ("matrix square.obj --points all --out m.npy --max-distance nan", "--max-distance is nan: it"),
    (
        "matrix square.obj --points all --out m.npy --max-distance -2 --service http://x",
        "--max-distance is -2.0: it must be 0 or more",
    ),
    (
        "matrix square.obj --points all --out m.npy --method approximate --absolute-error 0",
        "--absolute-error is 0.0: it must be above 0",
    ),
    ("batch square.obj --source 0 --json --max-distance nan", "--max-distance is nan: it must be"),
    ("batch square.obj --source 0 --json --processes x", "'--processes': 'x': it must be a whole"),
    (
        "batch square.obj --source 0 --json --method approximate --relative-error 7",
        "--relative-error is 7.0: it must be below 1",
    ),
    ("sample cube c.ply", "'cube' is not one of"),
    ("sample knot k.ply --faces x", "'--faces': 'x': it must be a whole number"),
    ("sample knot k.ply --faces 3", "--faces is 3; "),
    ("serve --port x", "'--port': 'x': it must be a whole number"),
    ("serve --port 70000", "'--port': '70000': it must be 65535 or less"),
    ("serve --engine nonsense", "GEODESIC_ENGINE: it must be 'local' or 'ray'"),
]


@pytest.mark.usefixtures("square")
@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_values_are_refused_in_words(run: Run, arguments: str, message: str) -> None:
    ran = run(*arguments.split())
    assert ran.code in (1, 2)
    assert message in error_line(ran)
    for foreign in ("Value error", "Input should", "parse", "validation", "pydantic", "/"):
        assert foreign not in ran.err.replace("http://", "")
