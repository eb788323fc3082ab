"""Compilation of all kernels ahead: what it covers, and how it ends early."""

import os
import subprocess
import sys

import pytest

import geodesic_core as gc
from geodesic_core import compilation
from geodesic_core.errors import InternalError
from geodesic_core.kernels.jit import cache, machine, progress
from tests.support import each_kind
from tests.support.paths import ROOT

pytestmark = [pytest.mark.jit, pytest.mark.slow]


def run(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(  # noqa: S603 - this very Python
        [sys.executable, *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_no_question_needs_a_kernel_that_was_not_compiled_ahead():
    gc.compile_kernels()
    asked = run(each_kind.__file__)
    assert asked.returncode == 0, asked.stderr


def test_as_many_kernels_are_told_of_as_there_are():
    gc.compile_kernels()
    if machine.shared_target() == machine.target():
        pytest.skip("tests compile more kernels into the same folder")
    folder = cache.folder_for(machine.shared_target())
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


def test_a_process_that_fails_is_an_error(monkeypatch):
    def fail(_: str) -> "subprocess.Popen[bytes]":
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])

    monkeypatch.setattr(compilation, "_start", fail)
    monkeypatch.setattr(cache, "is_marked", lambda _: False)
    with pytest.raises(InternalError, match="exact failed with 3"):
        gc.compile_kernels(["exact"])


def test_a_processor_below_the_levels_compiles_and_says_so(tmp_path):
    """For itself: of what the package or the cache have for a level, it can use nothing."""
    program = """
import geodesic_core as gc
mesh = gc.TriangleMesh(*gc.samples.plane(2))
print(gc.exact_distance(mesh, 0).distances.round(3).tolist())
"""
    told = {"NUMBA_CACHE_DIR": str(tmp_path), "GEODESIC_CPU_LEVEL": "none", "GEODESIC_QUIET": ""}
    asked = run("-c", program, **told)
    assert asked.stdout.strip() == "[0.0, 1.0, 1.0, 1.414]"
    assert "Compiling kernels for this machine, once" in asked.stderr
    (folder,) = {path.parent for path in tmp_path.rglob("*.kernel")}
    assert not any(level in folder.name for level in machine.LEVELS)
