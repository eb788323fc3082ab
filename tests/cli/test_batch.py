"""The command that asks the same questions of many meshes."""

import csv
import multiprocessing
import os
import signal
from functools import partial
from pathlib import Path

import pyarrow.parquet
import pytest

import geodesic_core as gc
from app.cli import batch
from app.cli.batch_rows import Questions, Row, ask
from app.cli.points import Point
from tests.support.commands import Run, error_line


@pytest.fixture
def meshes(run: Run) -> list[Path]:
    paths = [Path(f"{name}.ply") for name in ("sphere", "knot", "plane")]
    for path in paths:
        assert run("sample", path.stem, "--faces", 2000, path).code == 0
    return paths


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_each_mesh_has_a_row_for_each_source(run: Run, meshes: list[Path]) -> None:
    ran = run("batch", *meshes, "--source", 0, "--source", "f3:0.2,0.3,0.5", "--out", "t.csv")
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("meshes") == "3, 0 of them failed"
    rows = rows_of(Path("t.csv"))
    assert [(row["mesh"], row["source"]) for row in rows] == [
        (str(path), source) for path in meshes for source in ("0", "f3:0.2,0.3,0.5")
    ]
    for row in rows:
        mesh = gc.load_mesh(row["mesh"])
        inside = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
        field = gc.exact_distance(mesh, 0 if row["source"] == "0" else inside)
        assert float(row["farthest"]) == field.distances.max()
        assert float(row["mean"]) == pytest.approx(field.distances.mean(), rel=1e-14)
        assert (int(row["faces"]), row["unreachable"]) == (len(mesh.faces), "0")


@pytest.mark.parametrize("failing", ["load_mesh", "exact_distance"])
def test_a_failure_that_nobody_expects_is_a_row_too(
    meshes: list[Path], monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    def fail(*_arguments: object, **_options: object) -> None:
        raise MemoryError("no room")

    monkeypatch.setattr(gc, failing, fail)
    questions = Questions([Point.parse("0")], [], {"method": "exact"}, "none")
    (row,) = ask(questions, meshes[0])
    assert row.error == "MemoryError: no room"


def test_a_mesh_without_a_vertex_in_reach_has_its_row(run: Run, meshes: list[Path]) -> None:
    inside = ("--source", "f0:0.3,0.3,0.4", "--max-distance", 1e-9)
    ran = run("batch", *meshes, *inside, "--out", "t.csv")
    assert (ran.code, ran.err) == (0, "")
    for row in rows_of(Path("t.csv")):
        assert (row["unreachable"], row["farthest"], row["mean"]) == (row["vertices"], "", "")


def test_a_mesh_that_is_named_twice_is_one(run: Run, meshes: list[Path]) -> None:
    files = [meshes[0], "missing.ply", meshes[0], "missing.ply"]
    ran = run("batch", *files, "--source", 0, "--out", "t.csv")
    assert ran.figure("meshes") == "2, 1 of them failed"
    assert [row["mesh"] for row in rows_of(Path("t.csv"))] == [str(meshes[0]), "missing.ply"]


def test_a_mesh_that_fails_does_not_stop_the_others(run: Run, meshes: list[Path]) -> None:
    Path("broken.ply").write_text("ply\nthis is none")
    files = [meshes[0], "broken.ply", "missing.ply", *meshes[1:]]
    ran = run(
        *("batch", *files, "--source", 0, "--target", 9, "--target", 1001),
        *("--method", "fast", "--processes", 1, "--out", "t.parquet"),
    )
    assert ran.code == 1
    assert ran.figure("meshes") == "5, 3 of them failed"
    rows = pyarrow.parquet.read_table("t.parquet").to_pylist()
    assert [(row["mesh"], row["target"]) for row in rows] == [
        ("sphere.ply", "9"),
        ("sphere.ply", "1001"),
        ("broken.ply", None),
        ("missing.ply", None),
        ("knot.ply", None),
        ("plane.ply", "9"),
        ("plane.ply", "1001"),
    ]
    assert "No such file" in rows[3]["error"]
    assert "vertex 1001" in rows[4]["error"]
    for row in (*rows[:2], *rows[5:]):
        field = gc.fast_distance(gc.load_mesh(row["mesh"]), 0)
        assert row["distance"] == field.distances[int(row["target"])]
    for name in ("broken.ply", "missing.ply", "knot.ply"):
        assert name in ran.err


def dying(questions: Questions, file: Path) -> list[Row]:
    """Ask as usual, but die at one of the meshes."""
    if file.stem == "knot":
        os.kill(os.getpid(), signal.SIGKILL)
    return ask(questions, file)


@pytest.mark.slow
def test_a_process_that_dies_costs_its_own_mesh_alone(
    run: Run, meshes: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "ask", dying)
    ran = run("batch", *meshes, "--source", 0, "--processes", 2, "--out", "t.csv")
    assert ran.code == 1
    assert ran.figure("meshes") == "3, 1 of them failed"
    assert ran.err.startswith("knot.ply: the process died")
    rows = rows_of(Path("t.csv"))
    assert [bool(row["error"]) for row in rows] == [False, True, False]
    for row in (rows[0], rows[2]):
        field = gc.exact_distance(gc.load_mesh(row["mesh"]), 0)
        assert float(row["farthest"]) == field.distances.max()


def interrupting(command: int, _questions: Questions, _file: Path) -> list[Row]:
    """Have somebody press Ctrl-C while a mesh takes long."""
    os.kill(command, signal.SIGINT)
    signal.pause()
    return []


@pytest.mark.slow
def test_ctrl_c_does_not_wait_for_the_meshes_under_way(
    run: Run, meshes: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    others = set(multiprocessing.active_children())
    monkeypatch.setattr(batch, "ask", partial(interrupting, os.getpid()))
    ran = run("batch", *meshes, "--source", 0, "--processes", 1, "--out", "t.csv")
    assert (ran.code, ran.err) == (130, "error: interrupted\n")
    assert not Path("t.csv").exists()
    assert set(multiprocessing.active_children()) == others


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--out t.csv", "--source"),
        ("--source 0 --out t.txt", "t.txt must end in .csv or .parquet"),
        ("--source x --out t.csv", "'x' is not a point"),
        ("--source 0 --effort 2 --out t.csv", "--effort goes with --method fast only"),
        ("--source 0 --processes 0 --out t.csv", "processes"),
    ],
)
def test_a_wrong_command_line_is_refused(run: Run, options: str, message: str) -> None:
    ran = run("batch", "mesh.ply", *options.split())
    assert ran.code == 2
    assert message in error_line(ran)
