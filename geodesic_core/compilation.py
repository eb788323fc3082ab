"""Compilation of kernels ahead of their first use, in as many processes as there are cores.

A kernel is compiled for the types of its arguments, so the way to compile it is to run it: each of
the `WORKLOADS` solves something small.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from geodesic_core import samples
from geodesic_core.control import Control
from geodesic_core.errors import InternalError, InvalidArgument
from geodesic_core.fields.scalar_field import ScalarField
from geodesic_core.kernels.jit import cache, machine, progress
from geodesic_core.matrices.threads import available_cores
from geodesic_core.mesh.surface_point import Curve, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.solvers import (
    Solver,
    approximate_distance,
    cost_distance,
    cut,
    distance_matrix,
    exact_distance,
    farthest_points,
    fast_distance,
    handle_loops,
    log_map,
    shortest_path,
    straighten,
)
from geodesic_core.validation import check_choice

_POLL_S = 0.1
_INSIDE = SurfacePoint.face(0, (0.2, 0.3, 0.5))


def _mesh() -> TriangleMesh:
    return samples.plane(8)


def _curve(mesh: TriangleMesh) -> Curve:
    return Curve(mesh.faces[0, :2].tolist())


def _exact() -> None:
    mesh = _mesh()
    exact_distance(mesh, 0, targets=[_INSIDE])
    field = exact_distance(mesh, 0, retain="windows")
    field.path_to(_INSIDE)
    field.path_to(8)
    mesh.report  # noqa: B018 - computed on access
    TriangleMesh(mesh.vertices, mesh.faces, merge=1e-9)


def _paths() -> None:
    mesh = _mesh()
    # First what precedes the sweep of a search: another process compiles the sweep meanwhile.
    Solver(mesh).shortest_path(0, 8, explain=True)
    Solver(mesh).nearest(0, [3, 8])
    shortest_path(mesh, 0, 8, method="fast")


def _approximate() -> None:
    mesh = _mesh()
    approximate_distance(mesh, 0, targets=[_INSIDE], retain="paths").path_to(8)
    distance_matrix(mesh, 0, method="approximate")


def _fast() -> None:
    mesh = _mesh()
    fast_distance(mesh, 0, targets=[_INSIDE]).path_to(8)
    distance_matrix(mesh, 0, method="fast")


def _fast_curves() -> None:
    mesh = _mesh()
    fast_distance(mesh, _curve(mesh), targets=[_INSIDE])


def _isolines() -> None:
    mesh = _mesh()
    exact_distance(mesh, 0).isolines([0.1])
    ScalarField(mesh, mesh.vertices[:, 0]).isolines([0.1])


def _borders() -> None:
    exact_distance(_mesh(), [0, 1]).borders()


def _curves() -> None:
    mesh = _mesh()
    exact_distance(mesh, _curve(mesh), targets=[_INSIDE])


def _approximate_curves() -> None:
    mesh = _mesh()
    approximate_distance(mesh, _curve(mesh), targets=[_INSIDE])


def _maps() -> None:
    log_map(_mesh(), 0, x_axis=_INSIDE).exp([0.1, 0.1])
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [1, 1, 1]]
    faces = [[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 2, 5]]  # an edge of three: seen in the mirror
    log_map(TriangleMesh(corners, faces), 5)
    TriangleMesh.from_lengths([[0, 1, 2]], np.ones((1, 3)))
    exact_distance(_mesh(), 0).transport(0.0)


def _cuts() -> None:
    mesh = _mesh()
    cut(mesh, _curve(mesh))


def _loops() -> None:
    straighten(shortest_path(_mesh(), 0, 8))
    handle_loops(samples.knot(500))


def _costs() -> None:
    mesh = _mesh()
    cost_distance(mesh, 0, np.ones(len(mesh.faces))).path_to(8)


def _samples() -> None:
    farthest_points(_mesh(), 2)


def _certificates() -> None:
    exact_distance(_mesh(), 0, retain="windows").certify()


WORKLOADS: dict[str, Callable[[], None]] = {
    "exact": _exact,
    "approximate": _approximate,
    "curves": _curves,
    "approximate-curves": _approximate_curves,
    "isolines": _isolines,
    "fast": _fast,
    "borders": _borders,
    "fast-curves": _fast_curves,
    "paths": _paths,
    "maps": _maps,
    "cuts": _cuts,
    "loops": _loops,
    "certificates": _certificates,
    "costs": _costs,
    "samples": _samples,
}
"""Calls that together use all kernels, in an order that suits two processes.

Each process takes the next one that is free. Every other workload shares code, so that each process
finds much of it translated.
"""


def compile_kernels(
    workloads: Sequence[str] | None = None, *, cancel: Callable[[], bool] | None = None
) -> None:
    """Compile the kernels that are neither in the package nor in the cache on disk.

    Parameters
    ----------
    workloads
        Kinds of calls to compile for: ``"exact"``, ``"approximate"``, ``"paths"``, ``"curves"``,
        ``"approximate-curves"``, ``"fast"``, ``"fast-curves"``, ``"isolines"``, ``"borders"``,
        ``"maps"``, ``"cuts"``, ``"loops"``, ``"certificates"``, ``"costs"`` and ``"samples"``;
        None for all.
    cancel
        Called before compilation begins and then ten times a second; compilation ends once it
        returns True. Not called where no kernel is missing.

    Raises
    ------
    InvalidArgument
        A kind of call is unknown, or ``cancel`` cannot be called.
    Cancelled
        ``cancel`` returned True. Kernels that were finished are in the cache.
    InternalError
        A compiling process failed; its message is on standard error.

    Notes
    -----
    All kernels take about 200 s of processor time, in as many processes as there are cores. The
    number of compiled kernels is written to standard error, unless ``GEODESIC_QUIET`` is set. Where
    the cache cannot be written, nothing is compiled ahead.

    Examples
    --------
    >>> gc.compile_kernels(["exact"])
    """
    names, control = _checked(workloads), Control(cancel=cancel)
    waiting = [name for name in names if not cache.is_complete(name)]
    if not waiting or not cache.is_in_use():
        return
    if getattr(sys, "frozen", False):  # an application without an interpreter to start
        run_shared(waiting)
        return
    control.checkpoint(0.0)
    running: list[subprocess.Popen[bytes]] = []
    try:
        with progress.shown(cache.folder_for(machine.best_target())):
            running += [_start(waiting) for _ in range(min(available_cores(), len(waiting)))]
            while running:
                time.sleep(_POLL_S)
                control.checkpoint(sum(map(cache.is_complete, waiting)) / len(waiting))
                for process in [each for each in running if each.poll() is not None]:
                    running.remove(process)
                    if process.returncode:
                        raise InternalError(
                            f"compiling kernels failed with exit code {process.returncode}"
                        )
    finally:
        for process in running:
            process.terminate()
            process.wait()


def _checked(workloads: Sequence[str] | None) -> Sequence[str]:
    """Return the names of workloads, all of them for None.

    Raises
    ------
    InvalidArgument
        They are no names of workloads.
    """
    names = list(WORKLOADS)
    if workloads is None:
        return names
    if isinstance(workloads, str) or not isinstance(workloads, Iterable):
        raise InvalidArgument(f"workloads is {workloads!r}; it must be a sequence of names")
    chosen = list(workloads)
    for name in chosen:
        check_choice("workload", name, names)
    return chosen


def warm_up(workloads: Sequence[str] | None = None) -> None:
    """Load kernels into this process, after compiling those that are missing.

    Without it, kernels are loaded or compiled at their first use. Loading all takes 0.3 s.

    Parameters
    ----------
    workloads
        As in `compile_kernels`.

    Raises
    ------
    InvalidArgument
        A kind of call is unknown.
    InternalError
        A compiling process failed; its message is on standard error.

    Examples
    --------
    >>> gc.warm_up(["exact"])
    """
    names = _checked(workloads)
    compile_kernels(names)
    for name in names:
        run(name)


def run(name: str) -> None:
    """Run one of the `WORKLOADS`, and record that its kernels are compiled."""
    WORKLOADS[name]()
    cache.mark_complete(name)


def run_shared(names: Sequence[str]) -> None:
    """Run workloads together with all processes that do the same: each is run by one of them.

    One process for several workloads is better than a process for each. Kernels that they share are
    translated once.
    """
    from filelock import Timeout  # not needed where all is compiled

    for timeout in (0.0, -1.0):  # first those that are free; then wait for the others
        for name in names:
            with suppress(Timeout), cache.claim(name, timeout):
                if not cache.is_complete(name):
                    run(name)


def _start(names: Sequence[str]) -> "subprocess.Popen[bytes]":
    """Start a process that compiles the kernels of workloads, and prints only errors."""
    root = str(Path(__file__).parents[1])
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")])),
        "GEODESIC_QUIET": "1",
    }
    target = machine.best_target()
    if target in machine.LEVELS:
        environment |= {"NUMBA_CPU_NAME": target, "NUMBA_CPU_FEATURES": ""}
    program = f"from geodesic_core import compilation; compilation.run_shared({list(names)!r})"
    command = [sys.executable, "-c", program]
    return subprocess.Popen(  # noqa: S603
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for the process that started it
    )
