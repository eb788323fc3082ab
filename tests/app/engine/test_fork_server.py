"""The fork server, and what workers find loaded."""

import ast
from pathlib import Path

import pytest

import geodesic_core as gc
from app.engine.fork_server import PRELOADED
from app.engine.worker_process import FIRST_KERNELS
from tests.support.fresh import told_by
from tests.support.paths import ROOT
from tests.support.syntax import syntax_tree

pytestmark = [pytest.mark.slow, pytest.mark.file_slice(2)]

WORK = [ROOT / "geodesic_core", ROOT / "app/encoding", ROOT / "app/queries"]
NOT_FOR_WORKERS = {"nibabel", "vtkmodules", "zarr", "pyarrow", "pyvista", "PIL", "trimesh"}
NOT_FOR_WORKERS |= {"ezdxf", "pydelatin", "pyogrio", "pyproj", "rasterio", "shapely"}
"""Packages for rare formats, maps and pictures, and VTK, which has processes of its own"""


def late_imports(path: Path) -> set[str]:
    """Return the modules that the functions of a source import."""
    functions = [node for node in ast.walk(syntax_tree(path)) if isinstance(node, ast.FunctionDef)]
    inner = [node for function in functions for node in ast.walk(function)]
    plain = {name.name for node in inner if isinstance(node, ast.Import) for name in node.names}
    return plain | {node.module or "" for node in inner if isinstance(node, ast.ImportFrom)}


def test_workers_find_loaded_what_is_imported_late() -> None:
    wanted = {name for room in WORK for path in room.rglob("*.py") for name in late_imports(path)}
    wanted = {name for name in wanted if name.partition(".")[0] not in NOT_FOR_WORKERS}
    assert {"igl", "scipy.sparse"} < wanted
    assert told_by(f"import sys, {PRELOADED}; print({wanted!r} - set(sys.modules))") == "set()\n"


COUNT_LOADED = f"""
from geodesic_core.kernels.jit.cache import StoredKernel
load, loaded = StoredKernel.load, []
StoredKernel.load = lambda self, context: loaded.append(self) or load(self, context)

import {PRELOADED}
print(len(loaded) > 0)
loaded.clear()
app.engine.worker_process.gc.warm_up(app.engine.worker_process.FIRST_KERNELS)
print(len(loaded))
"""


def test_workers_find_their_first_kernels_loaded() -> None:
    gc.compile_kernels(FIRST_KERNELS)
    assert told_by(COUNT_LOADED) == "True\n0\n"


def test_workers_leave_alone_what_they_share() -> None:
    """A collector that looked at it would write to each of its pages, and so copy them."""
    told = told_by(
        f"import gc, {PRELOADED}; print(gc.isenabled(), gc.get_freeze_count() > 100_000)"
    )
    assert told == "True True\n"
