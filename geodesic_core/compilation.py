"""Compilation of kernels ahead of their first use, in as many processes as there are cores.

A kernel is compiled for the types of its arguments, so the way to compile it is to use it: each of
the `QUESTIONS` asks something small.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from geodesic_core import samples
from geodesic_core.errors import Cancelled, InternalError
from geodesic_core.kernels.jit import cache, machine, progress
from geodesic_core.mesh.curve import Curve
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.solvers import Solver, approximate_distance, exact_distance

_POLL_S = 0.1


def _mesh() -> TriangleMesh:
    return TriangleMesh(*samples.plane(8))


def _curve(mesh: TriangleMesh) -> Curve:
    return Curve(mesh.faces[0, :2].tolist())


_INSIDE = SurfacePoint.face(0, (0.2, 0.3, 0.5))


def _exact() -> None:
    mesh = _mesh()
    exact_distance(mesh, 0, targets=[_INSIDE])
    exact_distance(mesh, 0, retain="windows").distance_at(_INSIDE)
    mesh.report  # noqa: B018 - computed on access


def _paths() -> None:
    mesh = _mesh()
    exact_distance(mesh, 0).path_to(8)
    Solver(mesh).shortest_path(0, 8, explain=True)
    Solver(mesh).nearest(0, [3, 8])


def _approximate() -> None:
    approximate_distance(_mesh(), 0, targets=[_INSIDE], retain="paths").path_to(8)


def _isolines() -> None:
    exact_distance(_mesh(), 0).isolines([0.1])


def _curves() -> None:
    mesh = _mesh()
    exact_distance(mesh, _curve(mesh), targets=[_INSIDE]).isolines([0.1])


def _approximate_curves() -> None:
    mesh = _mesh()
    approximate_distance(mesh, _curve(mesh), targets=[_INSIDE])


QUESTIONS: dict[str, Callable[[], None]] = {
    "exact": _exact,
    "approximate": _approximate,
    "paths": _paths,
    "curves": _curves,
    "approximate curves": _approximate_curves,
    "isolines": _isolines,
}
"""What needs kernels of its own. Neighbours share few, so that their processes seldom wait."""


def compile_kernels(
    questions: Sequence[str] | None = None, *, cancel: Callable[[], bool] | None = None
) -> None:
    """Compile the kernels that are neither in the package nor in the cache on disk.

    Parameters
    ----------
    questions
        What to compile for, of ``"exact"``, ``"approximate"``, ``"paths"``, ``"curves"``,
        ``"approximate curves"`` and ``"isolines"``; None for all.
    cancel
        Called ten times a second; compilation ends once it returns True.

    Raises
    ------
    Cancelled
        ``cancel`` returned True. What was compiled so far is in the cache.
    InternalError
        A process that compiles failed; its message is on standard error.

    Notes
    -----
    All kernels take about 80 s of processor time, in as many processes as there are cores. Progress
    is written to standard error, unless ``GEODESIC_QUIET`` is set.

    Examples
    --------
    >>> gc.compile_kernels(["exact"])
    """
    waiting = [name for name in questions or QUESTIONS if not cache.is_marked(name)]
    if getattr(sys, "frozen", False):  # there is no interpreter to start
        for name in waiting:
            answer(name)
        return
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        with progress.of_folder(cache.folder_for(machine.shared_target())):
            while waiting or running:
                while waiting and len(running) < (os.cpu_count() or 1):
                    name = waiting.pop(0)
                    running[name] = _start(name)
                time.sleep(_POLL_S)
                if cancel is not None and cancel():
                    raise Cancelled
                for name in [name for name in running if running[name].poll() is not None]:
                    code = running.pop(name).returncode
                    if code:
                        raise InternalError(f"compiling kernels for {name} failed with {code}")
    finally:
        for process in running.values():
            process.terminate()
            process.wait()


def warm_up(questions: Sequence[str] | None = None) -> None:
    """Load kernels into this process, and compile those before that are missing.

    Without it, the first question of each kind does the same for the kernels that it needs. All
    take 0.3 s to load.

    Parameters
    ----------
    questions
        As in `compile_kernels`.

    Raises
    ------
    InternalError
        A process that compiles failed; its message is on standard error.

    Examples
    --------
    >>> gc.warm_up(["exact"])
    """
    compile_kernels(questions)
    for name in questions or QUESTIONS:
        answer(name)


def answer(name: str) -> None:
    """Ask one of the `QUESTIONS`, and mark its kernels as compiled."""
    QUESTIONS[name]()
    cache.mark(name)


def _start(name: str) -> "subprocess.Popen[bytes]":
    """Start a process that compiles what a question needs, and writes nothing but errors."""
    root = str(Path(__file__).parents[1])
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")])),
        "GEODESIC_QUIET": "1",
    }
    target = machine.shared_target()
    if target in machine.LEVELS:
        environment |= {"NUMBA_CPU_NAME": target, "NUMBA_CPU_FEATURES": ""}
    program = f"from geodesic_core import compilation as c; c.answer({name!r})"
    command = [sys.executable, "-c", program]
    return subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL)  # noqa: S603
