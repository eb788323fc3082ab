"""Compilation of all kernels ahead: what it covers, and how it ends early."""

import os
import subprocess
import sys

import pytest

import geodesic_core as gc
from geodesic_core import compilation
from geodesic_core.errors import Cancelled, InternalError, InvalidArgument
from geodesic_core.kernels.jit import cache, machine, progress
from tests.support import each_kind
from tests.support.paths import ROOT
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.jit, pytest.mark.slow, pytest.mark.file_slice(4)]


def run(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(  # noqa: S603 - this very Python
        [sys.executable, *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_no_call_needs_a_kernel_that_was_not_compiled_ahead():
    gc.compile_kernels()
    asked = run(each_kind.__file__)
    assert asked.returncode == 0, asked.stderr


@pytest.mark.file_slice(1)  # in each run
def test_the_reported_number_of_kernels_is_the_true_one():
    gc.compile_kernels()
    if machine.best_target() == machine.target():
        pytest.skip("tests compile more kernels into the same folder")
    folder = cache.folder_for(machine.best_target())
    assert len(list(folder.glob("*.kernel"))) == progress.KERNELS


def test_it_can_be_cancelled(tmp_path):
    program = """
import geodesic_core as gc
try:
    gc.compile_kernels(cancel=lambda: True)
except gc.errors.Cancelled:
    print("cancelled")
"""
    ended = run("-c", program, NUMBA_CACHE_DIR=str(tmp_path))
    assert ended.stdout.strip() == "cancelled"
    assert not list(tmp_path.rglob("*.all"))


@pytest.mark.parametrize("workloads", ["exact", ["exactt"], ["exact", 3], 3], ids=repr)
@pytest.mark.parametrize("call", [gc.compile_kernels, gc.warm_up])
def test_unknown_workloads_are_refused(call, workloads):
    with pytest.raises(InvalidArgument, match="workload"):
        call(workloads)


def test_no_workload_is_none_to_compile(monkeypatch):
    monkeypatch.setattr(cache, "is_complete", lambda _: False)
    monkeypatch.setattr(compilation, "_start", lambda _: pytest.fail("started"))
    gc.compile_kernels([])


def test_cancelling_says_so(monkeypatch):
    monkeypatch.setattr(cache, "is_complete", lambda _: False)
    with pytest.raises(Cancelled, match="cancelled with 0% done"):
        gc.compile_kernels(cancel=lambda: True)
    with pytest.raises(InvalidArgument, match="cancel is 3"):
        gc.compile_kernels(cancel=3)


def test_a_process_that_fails_is_an_error(monkeypatch):
    def fail(_: list[str]) -> "subprocess.Popen[bytes]":
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])

    monkeypatch.setattr(compilation, "_start", fail)
    monkeypatch.setattr(cache, "is_complete", lambda _: False)
    with pytest.raises(InternalError, match="failed with exit code 3"):
        gc.compile_kernels(["exact"])


SHARED = """
import os, sys, time
from geodesic_core import compilation
log, dies_at = sys.argv[1:]
def workload(name):
    def run():
        if name == dies_at:
            print("here", flush=True)
            time.sleep(60)
        with open(log, "a") as lines:
            print(name, file=lines)
    return run
compilation.WORKLOADS = {name: workload(name) for name in "abc"}
compilation.run_shared("abc")
"""


def test_each_workload_is_run_once_by_the_processes_that_share_them(tmp_path):
    log = tmp_path / "log"
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", SHARED, str(log)]
    dying = subprocess.Popen([*command, "a"], env=environment, stdout=subprocess.PIPE)  # noqa: S603
    assert dying.stdout.readline() == b"here\n"  # it holds "a"
    others = [subprocess.Popen([*command, "-"], env=environment) for _ in range(2)]  # noqa: S603
    wait_until(lambda: log.exists() and len(log.read_text().split()) == 2)
    dying.kill()
    dying.wait()
    assert [other.wait() for other in others] == [0, 0]
    assert sorted(log.read_text().split()) == ["a", "b", "c"]
    dying.stdout.close()


def test_plain_python_leaves_no_record_of_compiled_kernels(tmp_path):
    program = 'from geodesic_core import compilation; compilation.run("exact")'
    ended = run("-c", program, NUMBA_CACHE_DIR=str(tmp_path), NUMBA_DISABLE_JIT="1")
    assert ended.returncode == 0, ended.stderr
    assert not list(tmp_path.rglob("*.all"))


def test_without_a_folder_to_write_to_nothing_is_compiled_ahead(tmp_path):
    (tmp_path / "file").write_text("no folder")
    program = """
from geodesic_core import compilation
compilation._start = None
compilation.compile_kernels(["exact"])
"""
    ended = run("-c", program, NUMBA_CACHE_DIR=str(tmp_path / "file"), GEODESIC_CPU_LEVEL="none")
    assert ended.returncode == 0, ended.stderr
    assert "cannot be written" in ended.stderr


def test_an_unknown_level_is_refused(monkeypatch):
    monkeypatch.setenv("GEODESIC_CPU_LEVEL", "x86-64-v9")
    with pytest.raises(InvalidArgument, match="x86-64-v9, not one of x86-64-v3, x86-64-v2, none"):
        machine.levels()


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("mesh.report.components", "1"),
        pytest.param(
            "gc.exact_distance(mesh, 0).distances.round(3).tolist()",
            "[0.0, 1.0, 1.0, 1.414]",
            marks=pytest.mark.full,  # many kernels: 17 s
        ),
    ],
)
def test_a_processor_below_the_levels_compiles_and_says_so(question, answer, tmp_path):
    """For itself: of what the package or the cache have for a level, it can use nothing."""
    program = f"""
import geodesic_core as gc
mesh = gc.samples.plane(2)
print({question})
"""
    environment = {
        "NUMBA_CACHE_DIR": str(tmp_path),
        "GEODESIC_CPU_LEVEL": "none",
        "GEODESIC_QUIET": "",
    }
    asked = run("-c", program, **environment)
    assert asked.stdout.strip() == answer
    assert "Compiling kernels for this machine, once" in asked.stderr
    (folder,) = {path.parent for path in tmp_path.rglob("*.kernel")}
    assert not any(level in folder.name for level in machine.LEVELS)
