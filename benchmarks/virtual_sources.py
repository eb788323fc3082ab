"""`fast_distance` at its first effort, against propagation of virtual sources in C++."""

import ctypes
import shutil
import subprocess
import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from benchmarks.certificates import MESHES
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import by_turns
from geodesic_core.arrays import Floats, Ints

SOURCE = Path(__file__).with_name("peers") / "virtual_sources" / "propagation.cpp"
TIME, ERROR = 1.2, 1.0
"""Of those of virtual sources, at most"""


def run(inputs: Inputs, runs: int) -> Section:
    """Compare times and mean errors from vertex 0."""
    rows: list[list[str]] = []
    compiler = shutil.which("g++")
    if compiler is None:
        print("g++ is not there: virtual sources are left out")
    else:
        gc.warm_up()
        with TemporaryDirectory() as folder:
            library = _compiled(compiler, Path(folder))
            for name, vertices, faces in inputs.arrays(MESHES):
                rows.append([name, f"{len(faces):,}", *_compared(library, vertices, faces, runs)])
    return Section(
        "Virtual sources",
        "One source (vertex 0) to all vertices of a prepared mesh, one thread, medians of "
        f"processor time of {runs} by turns: `fast_distance` with `effort=1`, and virtual sources "
        "after Trettner, Bommes and Kobbelt (2021) in single precision, `g++ -O3 -march=native`. "
        "Errors are against our exact distances; means are of their absolute values.",
        [
            "mesh",
            "faces",
            "virtual sources, ms",
            "ours, ms",
            "of their time",
            "their mean error, %",
            "ours, %",
            "of theirs",
            "their least and largest error, %",
            "ours, %",
        ],
        rows,
    )


def _compiled(compiler: str, folder: Path) -> ctypes.CDLL:
    target = folder / "propagation.so"
    options = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, "-o", target, SOURCE], check=True)
    library = ctypes.CDLL(str(target))
    library.prepare.restype = ctypes.c_void_p
    return library


def _compared(library: ctypes.CDLL, vertices: Floats, faces: Ints, runs: int) -> list[str]:
    mesh = gc.TriangleMesh(vertices, faces)
    solver, opposite = gc.Solver(mesh), _opposite(faces, len(vertices))
    corners = np.ascontiguousarray(faces, np.int32)
    arrays = _pointer(vertices), len(vertices), _pointer(corners), _pointer(opposite), len(faces)
    surface = ctypes.c_void_p(library.prepare(*arrays))
    found = np.empty(len(vertices), np.float32)
    theirs = partial(library.distances, surface, 0, _pointer(found))
    ours = partial(solver.fast_distance, 0, 1)
    (their_s, _), (our_s, field) = by_turns([theirs, ours], max(runs, 9), clock=time.process_time)
    library.drop(surface)
    exact = solver.exact_distance(0).distances
    reached = np.isfinite(exact) & (exact > 0)
    errors = [100 * (each[reached] / exact[reached] - 1) for each in (found, field.distances)]
    their_mean, our_mean = (float(np.abs(each).mean()) for each in errors)
    return [
        f"{1000 * their_s:.1f}",
        f"{1000 * our_s:.1f}",
        rated(our_s / their_s, TIME, at_least=False),
        f"{their_mean:.3f}",
        f"{our_mean:.3f}",
        rated(our_mean / their_mean, ERROR, at_least=False),
        *(f"{each.min():.2g}, {each.max():.2f}" for each in errors),
    ]


def _opposite(faces: Ints, vertices: int) -> NDArray[np.int32]:
    """Return the half-edge across each, 3 face + edge; -1 without one."""
    tails, heads = faces.reshape(-1).astype(np.int64), np.roll(faces, -1, axis=1).reshape(-1)
    keys = tails * vertices + heads
    order = np.argsort(keys)
    wanted = heads * np.int64(vertices) + tails
    places = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)]
    return np.where(keys[places] == wanted, places, -1).astype(np.int32)


def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
