"""Table 1: exact, within 0.1 %, and fast marching, on real meshes."""

from functools import partial

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.paper import published
from benchmarks.paper.methods import errors_of, marching
from benchmarks.paper.report import Report, beside
from benchmarks.timing import by_turns
from geodesic_core.arrays import Floats, Ints

MODELS = {
    "rockerarm20k.ply": "Rockerarm",
    "horse97k.ply": "Horse",
    "dragon100k.ply": "Dragon",
    "buddha30k.ply": "Buddha S",
    "fandisk10k.ply": "Fandisk U",
    "armadillo86k.ply": None,
    "icosphere 6": None,
}
"""Meshes of the benchmarks, and the paper's model of the same name"""
ERROR = 1e-3


def run(inputs: Inputs, runs: int) -> Report:
    """Compare the methods, by turns; without the real meshes on a sphere alone."""
    gc.warm_up()
    rows = [
        _row(name, vertices, faces, MODELS[name], runs)
        for name, vertices, faces in inputs.arrays(MODELS)
    ]
    return Report(
        "table1",
        "Table 1: exact, approximate and fast marching",
        f"From vertex 0 to all vertices, one thread, medians of {runs} by turns; the paper's "
        f"numbers in parentheses, of the model that is named, which may have another size, source "
        f"and triangulation. Exact and approximate (0.1 % relative) on a prepared mesh; fast "
        f"marching is potpourri3d's, its solver made anew each time. WPE: windows per edge, "
        f"created, and kept by the approximate sweep, which is exact on rough meshes "
        f"(docs/accuracy.md). Largest errors are shares of the bounding box's diagonal, mean ones "
        f"of each distance.",
        [
            "mesh",
            "model",
            "faces",
            "exact, s",
            "WPE",
            "approximate, s",
            "WPE",
            "largest, %",
            "mean, %",
            "marching, s",
            "largest, %",
            "mean, %",
        ],
        rows,
    )


def _row(name: str, vertices: Floats, faces: Ints, model: str | None, runs: int) -> list[str]:
    mesh = gc.TriangleMesh(vertices, faces)
    calls = (
        partial(gc.exact_distance, mesh, 0),
        partial(gc.approximate_distance, mesh, 0, ERROR),
        partial(marching, mesh.vertices, mesh.faces, 0),
    )
    (exact_s, exact), (near_s, near), (marching_s, marched) = by_turns(calls, runs)
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    ours, theirs = (errors_of(found, exact.distances) for found in (near.distances, marched))
    paper = None if model is None else published.TABLE_1[model]
    get = partial(getattr, paper) if paper is not None else lambda _name: None
    return [
        name,
        model or "",
        f"{len(faces):,}" + (f" ({paper.faces:,})" if paper is not None else ""),
        beside(exact_s, get("exact_s"), 3),
        beside(exact.stats.windows_per_edge_created, get("exact_wpe"), 2),
        beside(near_s, get("approximate_s"), 3),
        beside(near.stats.windows_per_edge_kept, get("approximate_wpe"), 2),
        beside(100 * ours.largest / diagonal, get("approximate_max"), 3),
        beside(100 * ours.mean, get("approximate_mean"), 3),
        beside(marching_s, get("marching_s"), 3),
        beside(100 * theirs.largest / diagonal, get("marching_max"), 2),
        beside(100 * theirs.mean, get("marching_mean"), 2),
    ]
