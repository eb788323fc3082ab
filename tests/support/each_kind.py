"""One question of each kind, asked of the installed library: ``python each_kind.py``.

Each is the first call of a process, and a table tells how long it takes. Ends with an error where
one is not answered, or where a kernel had to be compiled.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path

import geodesic_core as gc
from geodesic_core.kernels.jit import cache
from geodesic_core.kernels.jit.dispatcher import compiled_here

MESH = gc.samples.terrain(2000)
LAST = len(MESH.vertices) - 1
POINT = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
ON_EDGE = MESH.point_on_edge(*MESH.faces[7, :2].tolist(), 0.4)
CURVE = gc.Curve(MESH.faces[0, :2].tolist())


def read() -> object:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mesh.obj")
        lines = [f"v {x} {y} {z}" for x, y, z in MESH.vertices.tolist()]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in MESH.faces.tolist()]
        path.write_text("\n".join(lines))
        return gc.load_mesh(path).report


def irregular() -> object:
    """Three faces at one edge."""
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]
    mesh = gc.TriangleMesh(vertices, [(0, 1, 2), (1, 0, 3), (0, 1, 4)])
    return gc.exact_distance(mesh, 2).path_to(3)


QUESTIONS: dict[str, Callable[[], object]] = {
    "straightened": lambda: gc.straighten(gc.shortest_path(MESH, 0, LAST, [ON_EDGE])),
    "loop through a point": lambda: gc.shortest_loop(gc.samples.knot(500), POINT),
    "loops of handles": lambda: gc.handle_loops(gc.samples.knot(500)),
    "paths around": lambda: gc.paths_around(MESH, 0, LAST, len(MESH.vertices) // 2),
    "exact": lambda: gc.exact_distance(MESH, 0),
    "path of a field": lambda: gc.exact_distance(MESH, [0, POINT]).path_to(LAST),
    "path to a point": lambda: gc.exact_distance(MESH, ON_EDGE, targets=[POINT]).path_to(POINT),
    "distance at a point": lambda: gc.exact_distance(MESH, 0).distance_at(POINT),
    "windows": lambda: gc.exact_distance(MESH, 0, retain="windows").distance_at(POINT),
    "gradient": lambda: gc.exact_distance(MESH, 0).gradient,
    "two points": lambda: gc.shortest_path(MESH, POINT, LAST, explain=True),
    "fast two points": lambda: gc.shortest_path(MESH, POINT, LAST, method="fast"),
    "waypoints": lambda: gc.Solver(MESH).shortest_path(0, LAST, [ON_EDGE]),
    "approximate": lambda: gc.approximate_distance(MESH, 0),
    "approximate path": lambda: gc.approximate_distance(MESH, POINT).path_to(LAST),
    "fast": lambda: gc.fast_distance(MESH, 0, 1),
    "fast path": lambda: gc.fast_distance(MESH, POINT, targets=[ON_EDGE]).path_to(ON_EDGE),
    "fast curve": lambda: gc.fast_distance(MESH, CURVE, targets=[POINT]).path_to(POINT),
    "isolines": lambda: gc.exact_distance(MESH, 0).isolines([0.1, 0.2]),
    "borders": lambda: gc.exact_distance(MESH, [0, 8]).borders(),
    "approximate isolines": lambda: gc.approximate_distance(MESH, 0).isolines([0.1]),
    "approximate targets": lambda: gc.approximate_distance(MESH, 0, targets=[POINT]).path_to(POINT),
    "curve": lambda: gc.exact_distance(MESH, CURVE, targets=[POINT]).path_to(POINT),
    "isolines of a curve": lambda: gc.exact_distance(MESH, CURVE).isolines([0.1]),
    "approximate curve": lambda: gc.approximate_distance(MESH, CURVE, targets=[POINT]).path_to(
        POINT
    ),
    "barriers": lambda: gc.exact_distance(MESH, LAST, barriers=[0, 1]).path_to(LAST // 2),
    "certificate": lambda: gc.exact_distance(MESH, 0).certify(),
    "log map": lambda: gc.log_map(MESH, POINT),
    "sweep steps": lambda: gc.sweep_steps(MESH, POINT, 9),
    "straight line": lambda: gc.trace(MESH, POINT, [0.5], [1.0]),
    "samples": lambda: gc.farthest_points(MESH, 4),
    "cells": lambda: gc.exact_distance(MESH, [0, LAST]).cells().areas,
    "relaxed": lambda: gc.relax_points(MESH, [0, LAST], 1),
    "mean": lambda: gc.mean_point(MESH, [0, LAST]),
    "level sets": lambda: gc.ScalarField(MESH, MESH.vertices[:, 2]).isolines([0.0]),
    "boundaries": lambda: MESH.boundaries,
    "cut": lambda: gc.cut(MESH, [CURVE, gc.shortest_path(MESH, 0, LAST)]).mesh,
    "costs": lambda: gc.cost_distance(MESH, CURVE, 1.0).path_to(POINT),
    "costs by slope": lambda: gc.cheapest_path(MESH, POINT, LAST, gc.SlopeCost("tobler")),
    "limit": lambda: gc.exact_distance(MESH, 0, max_distance=0.3),
    "matrix": lambda: gc.distance_matrix(MESH, [0, POINT], [LAST]),
    "nearest": lambda: gc.nearest(MESH, 0, [5, LAST], k=2),
    "file and report": read,
    "irregular edge": irregular,
}


def ask(name: str) -> None:
    start = time.perf_counter()
    assert QUESTIONS[name]() is not None
    print(f"{time.perf_counter() - start:6.2f} s  {name}", flush=True)  # noqa: T201 - its output
    if compiled_here:
        sys.exit(f"compiled: {compiled_here}; looked for in {cache.folders()}")


def main() -> None:
    forked = get_context("fork")  # nothing but the mesh has been made so far
    for name in QUESTIONS:
        process = forked.Process(target=ask, args=(name,))
        process.start()
        process.join()
        if process.exitcode:
            sys.exit(f"failed: {name}")


if __name__ == "__main__":
    main()
