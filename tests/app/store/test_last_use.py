"""The order of use, which is that of times, though clocks are moved."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from app.store.fields import FieldStore, field_files
from app.store.last_use import note_use, order_of_use
from app.store.meshes import MeshStore
from app.store.results import FolderResults, ResultStore, write_result

YEARS_S = 10 * 365.25 * 86_400


def in_order_of_use(*paths: Path) -> list[Path]:
    return sorted(paths, key=lambda path: order_of_use(path.stat()))


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Files, the last one used most recently."""
    paths = [tmp_path / str(number) for number in range(4)]
    for number, path in enumerate(paths):
        path.touch()
        os.utime(path, (number, time.time() - 100 + number))
    return paths


def test_what_is_used_comes_last(files: list[Path]) -> None:
    assert in_order_of_use(*reversed(files)) == files
    note_use(files[1])
    assert in_order_of_use(*files) == [files[0], files[2], files[3], files[1]]


def test_after_the_clock_was_set_forward(
    files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = time.time_ns() + int(YEARS_S * 1e9)
    monkeypatch.setattr(time, "time_ns", lambda: moved)
    os.utime(files[1], ns=(moved, moved))
    assert in_order_of_use(*files) == [files[0], files[2], files[3], files[1]]


def test_what_was_used_before_the_clock_was_set_back_comes_first(files: list[Path]) -> None:
    for path in files:
        seconds = path.stat().st_mtime + YEARS_S
        os.utime(path, (seconds, seconds))
    assert in_order_of_use(*files) == files
    note_use(files[1])
    assert in_order_of_use(*files) == [files[0], files[2], files[3], files[1]]


def test_the_clock_of_a_file_server_may_be_a_little_ahead(files: list[Path]) -> None:
    ahead = time.time() + 30
    os.utime(files[1], (ahead, ahead))
    assert in_order_of_use(*files) == [files[0], files[2], files[3], files[1]]


def set_ahead(path: Path) -> None:
    seconds = path.stat().st_mtime + YEARS_S
    os.utime(path, (seconds, seconds))


def test_a_new_field_is_not_evicted_for_old_ones_that_seem_newer(tmp_path: Path) -> None:
    arrays = {"distance": np.arange(30.0)}
    FieldStore(tmp_path, 10**9).write("m", "0", arrays, "code")
    (size,) = field_files(tmp_path).values()
    fields = FieldStore(tmp_path, 2 * size)
    fields.write("m", "1", arrays, "code")
    for path in field_files(tmp_path):
        set_ahead(path)

    fields.write("m", "2", arrays, "code")

    assert {path.stem for path in field_files(tmp_path)} == {"1", "2"}


def test_the_next_start_finds_meshes_and_results_in_the_same_order(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / "meshes" / name).mkdir(parents=True)
        write_result(tmp_path / "results", f"m/{name}", [b"x" * 40], {}, "code", is_cheap=False)
    set_ahead(tmp_path / "meshes" / "b")
    set_ahead(tmp_path / "results" / "m" / "b.json")
    assert list(MeshStore(tmp_path).sizes()) == ["b", "a"]

    results = ResultStore(FolderResults(tmp_path / "results"), 50, memory=0)
    results.prepare()
    results.make_room()
    assert [path.name for path in tmp_path.glob("results/m/*.body")] == ["a.body"]
