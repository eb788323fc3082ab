"""Compilation of kernels, and their cache."""

import shutil
from pathlib import Path

import numba
import numpy as np
import pytest

from geodesic_core import tolerances
from geodesic_core.kernels import jit
from geodesic_core.kernels.jit import inlined, kernel, pointer, sources_digest
from geodesic_core.kernels.sweep import continuous_dijkstra

KERNELS = Path(jit.__file__).parent


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """The sources of the kernels in a folder of their own, which `sources_digest` reads."""
    folder = tmp_path / "kernels"
    shutil.copytree(KERNELS, folder)
    shutil.copy(tolerances.__file__, tmp_path)
    monkeypatch.setattr(jit, "__file__", str(folder / "jit.py"))
    return folder


def test_the_digest_depends_on_the_sources_alone(copied):
    digest = sources_digest()
    (copied / "notes.txt").write_text("no kernel")
    assert sources_digest() == digest


@pytest.mark.usefixtures("copied")
def test_the_digest_does_not_depend_on_the_folder(monkeypatch):
    copy = sources_digest()
    monkeypatch.setattr(jit, "__file__", str(KERNELS / "jit.py"))
    assert sources_digest() == copy


@pytest.mark.parametrize("name", ["planar.py", "sweep/continuous_dijkstra.py", "../tolerances.py"])
def test_an_edit_of_any_source_changes_the_digest(copied, name):
    before = sources_digest()
    path = copied / name
    path.write_text(path.read_text() + "# edited\n")
    assert sources_digest() != before


def test_a_new_name_changes_the_digest(copied):
    before = sources_digest()
    (copied / "sweep" / "queues.py").rename(copied / "sweep" / "heap.py")
    assert sources_digest() != before


def test_another_numba_changes_the_digest(monkeypatch):
    before = sources_digest()
    monkeypatch.setattr(numba, "__version__", "0.0")
    assert sources_digest() != before


def test_the_cache_is_where_numba_or_the_desktop_keeps_caches(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/n")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert jit._cache_directory() == f"/n/{sources_digest()}"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert jit._cache_directory() == f"/x/geodesic/kernels/{sources_digest()}"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert jit._cache_directory().startswith(str(Path.home()))


@pytest.mark.jit
def test_kernels_are_kept_under_the_digest():
    assert sources_digest() in continuous_dijkstra.advance.stats.cache_path


@pytest.mark.parametrize("decorate", [kernel, inlined])
def test_other_numba_code_keeps_its_own_cache(decorate, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "theirs")
    decorate(previous_of)
    assert numba.config.CACHE_DIR == "theirs"


def previous_of(x):
    return x - 1


def second_of_flat(array):
    return pointer(array)[array.shape[1]]


@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.uint8])
def test_a_pointer_is_a_flat_view(dtype):
    array = np.arange(12, dtype=dtype).reshape(3, 4)
    assert numba.njit(second_of_flat)(array) == 4
    assert jit._interpreted_pointer(array)[4] == 4


def test_a_pointer_writes_through():
    def write(array):
        pointer(array)[5] = 42.0

    array = np.zeros((2, 3))
    numba.njit(write)(array)
    assert array[1, 2] == 42.0
    jit._interpreted_pointer(array)[0] = 7.0
    assert array[0, 0] == 7.0
