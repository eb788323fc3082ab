"""The command that writes matrices of any size."""

import errno
import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import load_npz

import geodesic_core as gc
from tests.support.commands import Run, error_line


@pytest.fixture
def sphere(run: Run) -> Path:
    assert run("sample", "sphere", "--faces", 320, "sphere.ply").code == 0
    return Path("sphere.ply")


def written(name: str, *lines: str) -> str:
    Path(name).write_text("\n".join(lines), encoding="utf-8")
    return name


def test_points_of_files_are_those_of_the_library(run: Run, sphere: Path) -> None:
    mesh = gc.load_mesh(sphere)
    inside = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    some = written("some.txt", "# two points", "3", "", "  f40:0.2,0.3,0.5  ")
    other = written("other.txt", "7", "v20", "100")

    ran = run("matrix", sphere, "--points", some, "--out", "some.npy")
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("matrix") == "2 by 2"
    expected = gc.distance_matrix(mesh, [3, inside], [3, inside])
    np.testing.assert_allclose(np.load("some.npy"), expected, rtol=1e-13)

    blocked = written("blocked.txt", "0-9", "12,14")
    options = ["--sources", some, "--targets", other, "--barriers", f"@{blocked}"]
    options += ["--max-distance", 1.5, "--dtype", "float32", "--threads", 1]
    assert run("matrix", sphere, *options, "--out", "to.npz").figure("matrix") == "2 by 3"
    walled = mesh.with_barriers([*range(10), 12, 14])
    expected = gc.distance_matrix(walled, [3, inside], [7, 20, 100], 1.5)
    table = load_npz("to.npz")
    assert table.dtype == np.float32
    assert table.nnz == np.isfinite(expected).sum()
    cells = table.toarray()
    np.testing.assert_allclose(cells, np.where(np.isfinite(expected), expected, 0.0), rtol=1e-6)


def test_a_matrix_of_points_from_options_has_its_facts_beside_it(run: Run, sphere: Path) -> None:
    ask = ["matrix", sphere, "--source", 3, "--source", "f40:0.2,0.3,0.5", "--target", 7]
    ask += ["--barriers", "90-99"]
    walled = gc.load_mesh(sphere).with_barriers(range(90, 100))
    for name, more in (("dense.npy", []), ("sparse.npz", ["--layout", "sparse"])):
        assert run(*ask, *more, "--out", name).code == 0
        facts = json.loads(Path(f"{name}.json").read_text())
        assert facts["sources"] == [3, {"face": 40, "barycentric": [0.2, 0.3, 0.5]}]
        assert (facts["targets"], facts["shape"]) == ([7], [2, 1])
        assert facts["barriers"] == list(range(90, 100))
        assert (facts["mesh"], facts["method"]) == (walled.digest, "exact")
        assert (facts["units"], facts["error_bound"]["value"]) == ("mesh units", 0.0)
        assert facts["sha256"] == hashlib.sha256(Path(name).read_bytes()).hexdigest()
    assert run(*ask, "--out", "d.csv").code == 0
    assert not Path("d.csv.json").exists()


def test_a_label_of_a_brain_is_a_barrier(run: Run, sphere: Path) -> None:
    mesh = gc.load_mesh(sphere)
    vertices = np.flatnonzero(mesh.vertices[:, 0] > 0.5)
    rows = [f"{vertex} 0 0 0 0" for vertex in vertices]
    label = written("lh.wall.label", "#!ascii label", str(len(rows)), *rows)
    walled = mesh.with_barriers(gc.load_label(label, mesh))
    assert len(walled.barriers) > 10
    start, end = np.flatnonzero(mesh.vertices[:, 0] < 0.3)[[0, -1]].tolist()
    some = written("some.txt", str(start), str(end))
    barriers = ("--barriers", f"@{label}")
    assert run("matrix", sphere, "--points", some, *barriers, "--out", "m.npy").code == 0
    expected = gc.distance_matrix(walled, [start, end], [start, end])
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(np.load("m.npy"), expected, rtol=1e-13)
    path = ("path", sphere, "--source", start, "--target", end, *barriers)
    assert run(*path, "--out", "p.json").code == 0
    length = json.loads(Path("p.json").read_text())["length"]
    assert length == pytest.approx(expected[0, 1], rel=1e-13)

    written(label, "#!ascii label", "1", f"{len(mesh.vertices)} 0 0 0 0")
    ran = run(*path, "--out", "q.json")
    assert ran.code == 1
    assert f"{label} is not a label of this surface" in error_line(ran)
    ran = run("matrix", sphere, "--points", some, "--barriers", "@a.gii=wall", "--out", "n.npy")
    assert "cannot read a.gii" in error_line(ran)


@pytest.mark.slow
def test_all_vertices_by_each_method(run: Run, sphere: Path) -> None:
    mesh = gc.load_mesh(sphere)
    for options, bound in (
        ([], "0.0 (relative, guaranteed)"),
        (["--method", "approximate", "--relative-error", 0.01], "0.002 (relative, guaranteed)"),
        (["--method", "fast", "--effort", 1], "(relative, estimated)"),
    ):
        ran = run("matrix", sphere, "--points", "all", *options, "--out", "all.npy")
        assert ran.code == 0
        assert ran.figure("matrix") == "162 by 162"
        assert ran.figure("error bound").endswith(bound)
        expected = gc.exact_distance(mesh, 5).distances
        np.testing.assert_allclose(np.load("all.npy")[5], expected, rtol=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--out m.npy", "give --source and --target, or --points"),
        ("--source 0 --out m.npy", "give --source and --target, or --points"),
        ("--points a --targets b --out m.npy", "give --points, or both --sources and --targets"),
        ("--sources a --out m.npy", "give --points, or both --sources and --targets"),
        ("--points a --source 0 --out m.npy", "do not go with --points"),
        ("--points a --layout sparse --out m.npz", "do not go with --points"),
        ("--points a --out m.csv", "m.csv must end in .npy, .zarr, .npz or .parquet"),
        ("--points a --effort 2 --out m.npy", "--effort goes with --method fast only"),
        ("--source 0 --target 1 --threads 2 --out m.npy", "apply only to points from files"),
        ("--source 0 --target 1 --absolute-error 1 --out m.npy", "goes with --method approximate"),
        ("--source 0 --target 1 --out m.zarr", ".zarr does not go with --layout dense"),
        ("--points a --barriers @missing --out m.npy", "cannot read missing"),
        ("--points a --dtype int8 --out m.npy", "int8"),
    ],
)
def test_a_wrong_command_line_is_refused(
    run: Run, sphere: Path, options: str, message: str
) -> None:
    ran = run("matrix", sphere, *options.split())
    assert ran.code == 2
    assert message in error_line(ran)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["0", "x"], "points.txt, line 2: "),
        (["0", "", "162"], "points.txt, line 3: "),
        (["# none"], "points.txt has no points"),
    ],
)
def test_a_wrong_line_of_a_file_is_named(
    run: Run, sphere: Path, lines: list[str], message: str
) -> None:
    ran = run("matrix", sphere, "--points", written("points.txt", *lines), "--out", "m.npy")
    assert ran.code == 1
    assert message in error_line(ran)
    assert not Path("m.npy").exists()


def test_a_missing_file_of_points_is_named(run: Run, sphere: Path) -> None:
    ran = run("matrix", sphere, "--points", "missing.txt", "--out", "m.npy")
    assert ran.code == 1
    assert "cannot read missing.txt: No such file" in error_line(ran)


def test_a_matrix_that_finds_no_room_is_an_error(
    run: Run, sphere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)
    ran = run("matrix", sphere, "--points", "all", "--out", "m.npy")
    assert ran.code == 1
    assert error_line(ran) == "error: cannot write m.npy: No space left on device\n"
