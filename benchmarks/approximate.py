"""Approximate distances from vertex 0: against potpourri3d, against exact ones, and growth."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import potpourri3d as peer

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import by_turns
from geodesic_core.arrays import Floats, Ints

ERROR = 1e-3
COARSE = 1e-2

PATIENCE_S = 10.0
"""Seconds after which no further round begins: a heat solver of icosphere 7 factorises as long."""


class Peers(NamedTuple):
    """Targets against peers: times faster than each, and times slower than a factorised query."""

    heat: float
    marching: float
    query: float


PEERS = {
    "turbine.ply": Peers(heat=3.0, marching=1.3, query=4.0),
    "horse97k.ply": Peers(heat=5.0, marching=2.5, query=2.0),
    "dragon100k.ply": Peers(heat=3.0, marching=2.5, query=4.0),
    "icosphere 7": Peers(heat=30.0, marching=2.5, query=1.0),
}
ACCURACY = 10.0
"""The mean error of the more accurate peer, as a multiple of ours, at least."""


class Merging(NamedTuple):
    """Targets of a merging sweep: times faster than an exact one, and windows per edge."""

    faster: float = 1.0
    kept: float | None = None


MERGING = {
    "fandisk.obj": Merging(),
    "fandisk10k.ply": Merging(),
    "turbine.ply": Merging(),
    "rockerarm20k.ply": Merging(),
    "buddha30k.ply": Merging(),
    "armadillo86k.ply": Merging(),
    "horse97k.ply": Merging(faster=2.2, kept=1.6),
    "dragon100k.ply": Merging(kept=2.4),
    "icosphere 6": Merging(),
    "icosphere 7": Merging(faster=12.0, kept=1.3),
}
MEAN_ERROR = 0.04
"""Percent, at most."""

PATHS_MEMORY = 1.2
"""Memory of a solve that retains paths, at most, as a share of the mesh's own arrays."""

LEVELS = range(4, 9)
EXPONENT = 1.1


def run(inputs: Inputs, runs: int) -> Section:
    """Compare with the heat method and fast marching: from arrays to distances, and the query."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(PEERS):
        cold: list[Callable[[], Any]] = [
            partial(_cold, vertices, faces),
            partial(_cold_heat, vertices, faces),
            partial(_cold_marching, vertices, faces),
        ]
        (cold_s, ours), (heat_s, heats), (marching_s, marched) = by_turns(cold, runs, PATIENCE_S)
        (mesh, field), (heat, heated) = ours, heats
        query: list[Callable[[], Any]] = [
            partial(gc.approximate_distance, mesh, 0, COARSE),
            partial(heat.compute_distance, 0),
        ]
        (coarse_s, _), (query_s, _) = by_turns(query, runs)
        exact = gc.exact_distance(mesh, 0).distances
        error, *errors = (_errors(d, exact).mean() for d in (field.distances, heated, marched))
        asked = PEERS[name]
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{cold_s:.4f}",
                f"{heat_s:.3f}",
                rated(heat_s / cold_s, asked.heat, at_least=True),
                f"{marching_s:.3f}",
                rated(marching_s / cold_s, asked.marching, at_least=True),
                f"{100 * error:.4f}",
                f"{100 * errors[0]:.2f}",
                f"{100 * errors[1]:.2f}",
                rated(min(errors) / error, ACCURACY, at_least=True),
                f"{coarse_s:.4f}",
                f"{query_s:.4f}",
                rated(coarse_s / query_s, asked.query, at_least=False),
            ]
        )
    return Section(
        "Approximate distances",
        f"One source (vertex 0) to all vertices, one thread, medians of {runs} by turns in one "
        f"process (fewer where they take more than {PATIENCE_S:g} s). Cold is from arrays to "
        f"distances: our topology and solve at ε = {ERROR:.1%}; construction and query of "
        f"potpourri3d's heat method (which factorises) and of its fast marching. Errors are means "
        f"against our exact distances. The last columns: our solve at ε = {COARSE:.0%} on a "
        f"prepared mesh against heat's query alone, its factorisation at hand.",
        [
            "mesh",
            "faces",
            "cold, s",
            "heat, s",
            "times faster",
            "marching, s",
            "times faster",
            "error, %",
            "heat's, %",
            "marching's, %",
            "times smaller than the lesser",
            f"solve at {COARSE:.0%}, s",
            "heat's query, s",
            "of its time",
        ],
        rows,
    )


def run_merging(inputs: Inputs, runs: int) -> Section:
    """Compare merging sweeps with our own exact ones: times, windows, errors and memory."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(MERGING):
        mesh = gc.TriangleMesh(vertices, faces)
        solve = partial(gc.approximate_distance, mesh, 0, ERROR)
        calls: list[Callable[[], Any]] = [
            partial(gc.exact_distance, mesh, 0),
            solve,
            partial(solve, retain="paths"),
        ]
        (exact_s, exact), (seconds, field), (_, with_paths) = by_turns(calls, runs, PATIENCE_S)
        errors = 100 * _errors(field.distances, exact.distances)
        asked = MERGING[name]
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{exact_s:.4f}",
                f"{seconds:.4f}",
                rated(exact_s / seconds, asked.faster, at_least=True),
                rated(field.stats.windows_per_edge_kept, asked.kept, at_least=False),
                f"{field.stats.windows_per_edge_created:.2f}",
                rated(errors.mean(), MEAN_ERROR, at_least=False, digits=4),
                f"{errors.max():.3f}",
                f"{field.stats.peak_bytes / mesh.nbytes:.2f}",
                rated(with_paths.stats.peak_bytes / mesh.nbytes, PATHS_MEMORY, at_least=False),
            ]
        )
    return Section(
        "Approximate against exact distances",
        f"The same source, ε = {ERROR:.1%}, solves on a prepared mesh, medians of {runs} by turns. "
        f"Windows are per edge, both directions together: kept is after trimming and merging. "
        f"Memory is a solve's peak as a share of the mesh's own arrays, without and with what "
        "paths need (`retain`).",
        [
            "mesh",
            "faces",
            "exact, s",
            "approximate, s",
            "times faster",
            "windows kept",
            "created",
            "mean error, %",
            "largest, %",
            "memory / mesh",
            "with paths",
        ],
        rows,
    )


def run_growth(inputs: Inputs, runs: int) -> Section:
    """Solve on finer and finer spheres; fit the exponent of time over faces."""
    gc.warm_up()
    rows: list[list[str]] = []
    sizes: list[int] = []
    times: list[float] = []
    for name, vertices, faces in inputs.arrays(f"icosphere {level}" for level in LEVELS):
        mesh = gc.TriangleMesh(vertices, faces)
        solve = partial(gc.approximate_distance, mesh, 0, ERROR)
        ((seconds, field),) = by_turns([solve], runs)
        sizes.append(len(faces))
        times.append(seconds)
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{seconds:.4f}",
                f"{1e9 * seconds / len(faces):.0f}",
                f"{field.stats.windows_per_edge_kept:.2f}",
                f"{_exponent(sizes[-2:], times[-2:]):.2f}" if len(sizes) > 1 else "",
            ]
        )
    fitted = rated(_exponent(sizes, times), EXPONENT, at_least=False)
    rows.append(["all, fitted", "", "", "", "", fitted])
    return Section(
        "Growth of approximate distances",
        f"One source (vertex 0), ε = {ERROR:.1%}, solves on a prepared mesh, medians of {runs}. "
        f"The exponent p is that of seconds ~ faces^p from the row before, and at last the least "
        f"squares fit through all rows.",
        ["mesh", "faces", "seconds", "ns a face", "windows kept per edge", "exponent"],
        rows,
    )


def _cold(vertices: Floats, faces: Ints) -> tuple[gc.TriangleMesh, gc.DistanceField]:
    mesh = gc.TriangleMesh(vertices, faces)
    return mesh, gc.approximate_distance(mesh, 0, ERROR)


def _cold_heat(vertices: Floats, faces: Ints) -> tuple[Any, Floats]:
    solver = peer.MeshHeatMethodDistanceSolver(vertices, faces)
    return solver, solver.compute_distance(0)


def _cold_marching(vertices: Floats, faces: Ints) -> Floats:
    solver = peer.MeshFastMarchingDistanceSolver(vertices, faces)
    distances: Floats = solver.compute_distance([[(0, [])]])  # one curve, of one vertex
    return distances


def _errors(distances: Floats, exact: Floats) -> Floats:
    """Return the relative errors where the exact distance is finite and not 0."""
    reached = np.isfinite(exact) & (exact > 0)
    errors: Floats = np.abs(distances[reached] - exact[reached]) / exact[reached]
    return errors


def _exponent(sizes: list[int], times: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
