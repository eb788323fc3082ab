"""Folders of commands that were killed, and of those that live."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.ray_folder import ray_folder

HOLD = """
import sys
from app.cli.ray_folder import ray_folder

with ray_folder() as folder:
    (folder / "session").mkdir()
    print(folder, flush=True)
    sys.stdin.read()
"""


def holder(temporary: Path) -> "subprocess.Popen[str]":
    """Start a process that has a folder until it may end."""
    return subprocess.Popen(  # noqa: S603 - ours
        [sys.executable, "-c", HOLD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
    )


def told(process: "subprocess.Popen[str]") -> Path:
    assert process.stdout is not None
    return Path(process.stdout.readline().strip())


def test_a_start_removes_the_folders_of_the_dead_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    of_other_programs = tmp_path / "geodesic-ray-other"
    of_other_programs.mkdir()
    with holder(tmp_path) as living, holder(tmp_path) as killed:
        one, other = told(living), told(killed)
        killed.kill()
        killed.wait()
        with ray_folder() as own:
            assert not other.exists()
            assert set(tmp_path.iterdir()) == {one, own, of_other_programs}
            assert (one / "session").is_dir()
        living.communicate("")
    assert set(tmp_path.iterdir()) == {of_other_programs}
