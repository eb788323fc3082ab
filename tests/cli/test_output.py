"""Output of commands: answers on standard output, and then their summaries on standard error."""

import csv
import json
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from app.cli import steps
from app.cli.steps import showing
from tests.support.commands import Run, error_line

ASKED = {
    "distance": ["--source", 0],
    "path": ["--source", 0, "--target", 115],
    "paths": ["--source", 0, "--target", 115, "--target", 3],
    "isolines": ["--source", 60, "--count", 2],
    "matrix": ["--source", 0, "--target", 115],
    "nearest": ["--source", 0, "--candidate", 115],
    "locate": ["--at", "0.5,0.5,1"],
}
each_command = pytest.mark.parametrize("command", ASKED)


@pytest.fixture
def plane(run: Run) -> Path:
    assert run("sample", "plane", "--faces", 200, "plane.ply").code == 0
    return Path("plane.ply")


@each_command
def test_an_answer_needs_no_file(run: Run, plane: Path, command: str) -> None:
    ran = run(command, plane, *ASKED[command])
    assert (ran.code, ran.err) == (0, "")
    assert "written" not in ran.out
    assert list(Path().iterdir()) == [plane]


def test_a_path_prints_its_length(run: Run, plane: Path) -> None:
    ran = run("path", plane, "--source", 0, "--target", 115)
    assert float(ran.figure("length")) == gc.shortest_path(str(plane), 0, 115).length


@each_command
def test_a_hyphen_prints_rows_and_the_summary_goes_to_standard_error(
    run: Run, plane: Path, command: str
) -> None:
    assert run(command, plane, *ASKED[command], "--out", "rows.csv").code == 0
    ran = run(command, plane, *ASKED[command], "--out", "-")
    assert ran.code == 0
    assert ran.out == Path("rows.csv").read_text()
    assert len(list(csv.reader(StringIO(ran.out)))) > 1
    assert "mesh  " in ran.err or "point  " in ran.err
    assert "written" not in ran.err
    assert not Path("-").exists()


def test_json_goes_with_a_file(run: Run, plane: Path) -> None:
    ran = run("distance", plane, "--source", 0, "--json", "--out", "d.npy")
    assert json.loads(ran.out)["distances"] == np.load("d.npy").tolist()
    assert "written     d.npy" in ran.err


@each_command
def test_json_and_rows_do_not_both_go_to_standard_output(
    run: Run, plane: Path, command: str
) -> None:
    ran = run(command, plane, *ASKED[command], "--json", "--out", "-")
    assert ran.code == 2
    assert "--json and - both go to standard output: give one of them" in error_line(ran)


def test_what_fails_prints_nothing_on_standard_output(run: Run, plane: Path) -> None:
    for way in (["--json"], ["--out", "-"], []):
        ran = run("path", plane, "--source", 0, "--target", 999, *way)
        assert ran.code == 1
        assert "--target 999: vertex 999 does not exist; the indices are 0 to 120" in error_line(
            ran
        )


def test_info_as_json(run: Run) -> None:
    rows = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 0", "f 1 2 3", "f 4 2 3"]
    Path("cut.obj").write_text("\n".join(rows))
    told = json.loads(run("info", "cut.obj", "--json").out)
    report = gc.load_mesh("cut.obj").report.as_dict()
    assert told["duplicate_vertices"] == {"count": 1, "ids": [3]}
    assert told.keys() == report.keys() | {"warnings", "read_s"}
    assert any("--merge exact joins them" in warning for warning in told["warnings"])
    assert "--merge exact joins them" in run("info", "cut.obj").out


@pytest.mark.slow
def test_a_sample_can_be_piped() -> None:
    piped = subprocess.run(
        [sys.executable, "-c", "from app.cli import main; main()", "sample", "plane", "-"],
        capture_output=True,
        check=True,
    )
    assert len(gc.load_mesh(piped.stdout, "ply").faces) == 20_000
    assert piped.stderr.startswith(b"mesh  ")


def test_a_sample_says_in_json_what_it_is(run: Run) -> None:
    ran = run("sample", "plane", "--faces", 2, "p.ply", "--json")
    assert json.loads(ran.out) == {"vertices": 4, "faces": 2, "written": "p.ply"}
    assert run("sample", "plane", "-", "--json").code == 2


@pytest.mark.slow
def test_a_reader_that_has_enough_is_no_error(tmp_path: Path) -> None:
    mesh = gc.samples.plane(20_000)
    (tmp_path / "plane.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices.tolist())
        + "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    )
    arguments = ["distance", str(tmp_path / "plane.obj"), "--source", "0", "--out", "-"]
    reading, writing = os.pipe()
    os.close(reading)
    ran = subprocess.run(  # noqa: S603
        [sys.executable, "-c", "from app.cli import main; main()", *arguments],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert "Traceback" not in ran.stderr


@pytest.mark.slow
def test_batch_prints_rows_or_json(run: Run, plane: Path) -> None:
    ask = ["batch", plane, "--source", 0, "--target", 3, "--processes", 1]
    rows, told = run(*ask, "--out", "-"), run(*ask, "--json")
    (row,) = csv.DictReader(StringIO(rows.out))
    (item,) = json.loads(told.out)
    assert float(row["distance"]) == item["distance"] == pytest.approx(0.3)
    for ran in (rows, told):
        assert ran.code == 0
        assert ran.err.startswith("meshes      1, 0 of them failed")
    assert "give --out with a file, or --json" in error_line(run(*ask))


def test_a_matrix_of_points_from_files_is_described_in_json(run: Run, plane: Path) -> None:
    ran = run("matrix", plane, "--points", "all", "--out", "m.npy", "--json")
    told = json.loads(ran.out)
    assert (told["shape"], told["written"]) == ([121, 121], "m.npy")
    assert "matrix      121 by 121" in ran.err
    refused = run("matrix", plane, "--points", "all", "--json")
    assert refused.code == 2
    assert "--points needs --out, a file for the matrix" in error_line(refused)
    assert run("matrix", plane, "--points", "all", "--out", "-").code == 2


@pytest.mark.parametrize("group", [[], ["store"]])
def test_a_command_that_is_missing_shows_the_help(run: Run, group: list[str]) -> None:
    bare, asked = run(*group), run(*group, "--help")
    assert (bare.code, bare.err) == (0, "")
    assert bare.out == asked.out
    assert "Commands:" in bare.out


@pytest.mark.usefixtures("plane")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("isolines plane.ply --source 0 --level -1", "--level: a distance must be greater than 0"),
        ("isolines plane.ply --source 0 --level nan", "--level is nan: it must be a finite numb"),
        (
            "isolines plane.ply --source 0 --count 1 --chord-error 0",
            "--chord-error is 0.0: it must be above 0",
        ),
        (
            "matrix plane.ply --points all --out m.npy --max-distance -1",
            "--max-distance is -1.0: it must be 0 or more",
        ),
        (
            "matrix plane.ply --points all --out m.npy --method approximate --relative-error 2",
            "--relative-error is 2.0: it must be below 1",
        ),
        (
            "path plane.ply --source 0 --target 115 --max-distance 0.1",
            "there is no path within --max-distance 0.1",
        ),
    ],
)
def test_faults_are_told_in_options(run: Run, arguments: str, message: str) -> None:
    ran = run(*arguments.split())
    assert ran.code == 1
    assert message in error_line(ran)
    assert "Input" not in ran.err


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("GEODESIC_WORKERS", "none", "it must be a whole number"),
        ("GEODESIC_WORKERS", "0", "it must be above 0"),
        ("GEODESIC_DRAIN_S", "soon", "it must be a number"),
        ("GEODESIC_AUTH", "maybe", "it must be 'on' or 'off'"),
    ],
)
def test_faults_of_settings_are_told_in_plain_words(
    run: Run, monkeypatch: pytest.MonkeyPatch, variable: str, value: str, words: str
) -> None:
    monkeypatch.setenv(variable, value)
    ran = run("serve")
    assert ran.code == 2
    assert f"{variable}: {words}" in error_line(ran)


def test_shells_complete_commands(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shellingham.detect_shell", lambda: ("bash", "/bin/bash"))
    assert "complete" in run("--show-completion").out
    monkeypatch.setenv("_GEODESIC_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "geodesic pa")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert run().out.split() == ["path", "paths"]


def test_steps_show_their_progress_in_logs_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with showing("Working") as step:
        step.progress(0.25)
        monkeypatch.setattr(steps, "_LOG_INTERVAL_S", 0.0)
        step.progress(0.5)
    assert capsys.readouterr() == ("", "Working: 50%\n")
