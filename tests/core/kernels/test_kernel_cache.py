"""Compiled kernels on disk: found, shared, locked, and never stale."""

import os
import shutil
import subprocess
import sys
import threading
from importlib import metadata
from pathlib import Path

import numba
import pytest
from packaging.requirements import Requirement

from geodesic_core import tolerances
from geodesic_core.kernels import jit
from geodesic_core.kernels.jit import cache, machine, progress
from geodesic_core.kernels.jit.cache import sources_digest
from tests.support.paths import ROOT
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(5)

KERNELS = Path(jit.__file__).parents[1]

USE = """
from geodesic_core.kernels import planar
from geodesic_core.kernels.jit.dispatcher import compiled_here
assert planar.distance(0.0, 3.0, 4.0) == 5.0
print(len(compiled_here))
"""


def start(code: str, folder: Path, **environment: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(  # noqa: S603 - this very Python
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder)} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def compiled_by(code: str, folder: Path, **environment: str) -> int:
    process = start(code, folder, **environment)
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    return int(output)


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """The sources of the kernels in a folder of their own, which `sources_digest` reads."""
    folder = tmp_path / "kernels"
    shutil.copytree(KERNELS, folder)
    shutil.copy(tolerances.__file__, tmp_path)
    monkeypatch.setattr(cache, "KERNELS", folder)
    return folder


def test_the_digest_depends_on_the_sources_alone(copied):
    digest = sources_digest()
    (copied / "notes.txt").write_text("no kernel")
    assert sources_digest() == digest


@pytest.mark.usefixtures("copied")
def test_the_digest_does_not_depend_on_the_folder(monkeypatch):
    copy = sources_digest()
    monkeypatch.setattr(cache, "KERNELS", KERNELS)
    assert sources_digest() == copy


@pytest.mark.parametrize("name", ["planar.py", "sweep/continuous_dijkstra.py", "../tolerances.py"])
def test_an_edit_of_any_source_changes_the_digest(copied, name):
    before = sources_digest()
    path = copied / name
    path.write_text(path.read_text() + "# edited\n")
    assert sources_digest() != before


def test_a_new_name_changes_the_digest(copied):
    before = sources_digest()
    (copied / "front" / "queues.py").rename(copied / "front" / "heap.py")
    assert sources_digest() != before


def test_another_numba_changes_the_digest(monkeypatch):
    before = sources_digest()
    monkeypatch.setattr(numba, "__version__", "0.0")
    assert sources_digest() != before


@pytest.mark.parametrize(
    ("name", "is_stale"), [("planar.py", True), ("../solvers.py", True), ("../notes.txt", False)]
)
def test_an_edit_of_the_library_makes_marks_of_workloads_stale(
    copied, name, is_stale, tmp_path, monkeypatch
):
    monkeypatch.setattr(cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(cache, "folders", lambda: [tmp_path])
    monkeypatch.setattr(cache, "is_in_use", lambda: True)
    monkeypatch.setattr(cache, "_library_digest", cache._library_digest.__wrapped__)
    assert not cache.is_complete("exact")
    cache.mark_complete("exact")
    assert cache.is_complete("exact")
    with (copied / name).open("a") as file:
        file.write("# edited\n")
    assert cache.is_complete("exact") is not is_stale


def test_the_cache_is_where_numba_or_the_desktop_keeps_caches(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/n")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache.users_folder() == Path("/n")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert cache.users_folder() == Path("/x/geodesic/kernels")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.users_folder().is_relative_to(Path.home())


@pytest.mark.jit
@pytest.mark.slow
def test_what_one_process_compiled_the_next_one_loads(tmp_path):
    assert compiled_by(USE, tmp_path) == 1
    assert compiled_by(USE, tmp_path) == 0


@pytest.mark.jit
@pytest.mark.slow
def test_of_processes_that_start_at_once_one_compiles(tmp_path):
    processes = [start(USE, tmp_path) for _ in range(3)]
    outputs = [process.communicate()[0] for process in processes]
    assert sum(map(int, outputs)) == 1


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("damage", [b"", b"x" * 10_000])
def test_a_damaged_file_is_compiled_again(tmp_path, damage):
    assert compiled_by(USE, tmp_path) == 1
    (stored,) = tmp_path.rglob("*.kernel")
    stored.write_bytes(damage)
    assert compiled_by(USE, tmp_path) == 1
    assert compiled_by(USE, tmp_path) == 0


@pytest.mark.jit
@pytest.mark.slow
def test_kernels_for_a_level_serve_each_machine_of_that_level(tmp_path):
    levels = machine.levels()
    if not levels:
        pytest.skip("this processor has no level that kernels are built for")
    level = {"NUMBA_CPU_NAME": levels[0], "NUMBA_CPU_FEATURES": ""}
    assert compiled_by(USE, tmp_path, **level) == 1
    assert compiled_by(USE, tmp_path) == 0
    assert compiled_by(USE, tmp_path, GEODESIC_CPU_LEVEL="none") == 1


def test_a_lower_level_hides_the_higher_ones(monkeypatch):
    monkeypatch.setattr(
        machine.binding,
        "get_host_cpu_features",
        lambda: dict.fromkeys(machine.LEVELS["x86-64-v3"], True),
    )
    assert machine.levels() == ["x86-64-v3", "x86-64-v2"]
    monkeypatch.setenv("GEODESIC_CPU_LEVEL", "x86-64-v2")
    assert machine.levels() == ["x86-64-v2"]
    monkeypatch.setenv("GEODESIC_CPU_LEVEL", "none")
    assert machine.levels() == []


def test_a_processor_without_a_feature_has_no_level_that_needs_it(monkeypatch):
    features = dict.fromkeys(machine.LEVELS["x86-64-v3"], True) | {"avx2": False}
    monkeypatch.setattr(machine.binding, "get_host_cpu_features", lambda: features)
    assert machine.levels() == ["x86-64-v2"]


@pytest.mark.jit
@pytest.mark.slow
def test_a_part_of_another_kernel_can_be_called_as_well(tmp_path):
    """Its code has no entry from Python, and to call it would end the process."""
    code = """
from geodesic_core.kernels.jit import dispatcher, kernel
@kernel
def half(x):
    return x / 2
@kernel
def quarter(x):
    return half(half(x))
assert quarter(8.0) == 2.0
assert half(8.0) == 4.0
assert quarter(4.0) == 1.0
print(len(half.overloads))
"""
    assert compiled_by(code, tmp_path) == 1


@pytest.mark.jit
@pytest.mark.slow
def test_a_folder_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "file").write_text("no folder")
    process = start(USE, tmp_path / "file")
    output, errors = process.communicate()
    assert (output.strip(), process.returncode) == ("1", 0)
    assert "NUMBA_CACHE_DIR" in errors


@pytest.mark.jit
@pytest.mark.slow
def test_on_a_full_disk_kernels_serve_the_process_that_compiled_them(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    process = start(limit + USE, tmp_path)
    output, errors = process.communicate()
    assert (output.strip(), process.returncode) == ("1", 0), errors
    assert "File too large" in errors
    assert "NUMBA_CACHE_DIR" in errors
    assert {path.suffix for path in tmp_path.rglob("*") if path.is_file()} <= {".lock"}


def test_long_compilation_is_reported(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(progress, "_FIRST_S", 0.0)
    monkeypatch.delenv("GEODESIC_QUIET", raising=False)
    for number in range(3):
        (tmp_path / f"{number}.kernel").touch()
    printed: list[str] = []
    with progress.shown(tmp_path):
        wait_until(lambda: printed.append(capfd.readouterr().err) or any(printed))
    assert f"Compiling kernels for this machine, once: 3 of {progress.KERNELS}" in "".join(printed)


def test_nothing_is_printed_when_quiet(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(progress, "_FIRST_S", 0.0)
    monkeypatch.setenv("GEODESIC_QUIET", "1")
    before = threading.active_count()
    with progress.shown(tmp_path):
        assert threading.active_count() == before
    assert capfd.readouterr().err == ""


def test_numba_has_an_upper_bound_within_which_these_tests_run():
    """`kernels/jit` uses parts of it that are not public: a newer one is tried here first."""
    requirements = map(Requirement, metadata.requires("geodesic-core") or ())
    (allowed,) = (each.specifier for each in requirements if each.name == "numba")
    assert any(bound.operator == "<" for bound in allowed)
    assert numba.__version__ in allowed
