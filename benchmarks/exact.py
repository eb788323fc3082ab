"""Exact distances to all vertices from vertex 0, against pygeodesic (Kirsanov's MMP in C++)."""

from functools import partial
from statistics import median

import numpy as np
import pygeodesic.geodesic as peer

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, verdict
from benchmarks.timing import timed

TARGETS = {
    "fandisk.obj": 10.0,
    "fandisk10k.ply": 10.0,
    "turbine.ply": None,
    "rockerarm20k.ply": None,
    "buddha30k.ply": None,
    "armadillo86k.ply": 12.0,
    "horse97k.ply": 20.0,
    "dragon100k.ply": None,
    "icosphere 6": 20.0,
}
"""Meshes, and the target on each: times faster than the peer."""

MEMORY = 0.6
"""Peak memory of a solve, at most, as a share of the mesh's own arrays."""


def run(inputs: Inputs, runs: int) -> Section:
    """Solve by turns, one thread each, and compare times, memory and answers."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(TARGETS):
        mesh = gc.TriangleMesh(vertices, faces)
        theirs = peer.PyGeodesicAlgorithmExact(vertices, faces)
        solve = partial(gc.exact_distance, mesh, 0)
        solve_theirs = partial(theirs.geodesicDistances, [0])
        pairs = [(timed(solve), timed(solve_theirs)) for _ in range(runs)]
        ours_s = median(ours for (ours, _), _ in pairs)
        theirs_s = median(seconds for _, (seconds, _) in pairs)
        (_, field), (_, (distances, _)) = pairs[0]
        memory = field.stats.peak_bytes / mesh.nbytes
        target = TARGETS[name]
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{ours_s:.4f}",
                f"{theirs_s:.3f}",
                f"{theirs_s / ours_s:.1f}",
                verdict(theirs_s / ours_s, target, at_least=True) if target else "",
                f"{field.stats.windows_created:,}",
                f"{field.stats.windows_per_edge_created:.1f}",
                f"{field.stats.windows_peak:,}",
                f"{memory:.2f} ({verdict(memory, MEMORY, at_least=False)})",
                f"{_largest_difference(field.distances, distances):.1e}",
            ]
        )
    return Section(
        "Exact distances",
        f"One source (vertex 0) to all vertices, one thread, median of {runs}, both by turns in "
        f"one process; the solver with its state's allocation, without the mesh's preparation. "
        f"pygeodesic itself is 1.3e-8 too long at one vertex of horse97k.",
        [
            "mesh",
            "faces",
            "seconds",
            "pygeodesic, s",
            "times faster",
            "target",
            "windows created",
            "per edge",
            "peak live",
            "memory / mesh",
            "largest relative difference",
        ],
        rows,
    )


def _largest_difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    reached = np.isfinite(ours) & (ours > 0)
    return float(np.max(np.abs(ours[reached] - theirs[reached]) / ours[reached]))
