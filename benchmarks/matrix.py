"""A matrix of distances: all cores against one, and against single sweeps."""

from functools import partial

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import by_turns
from geodesic_core.matrices.threads import available_cores

SEED = 5
POINTS = 100
"""Number of sources, and of targets."""

MESHES = {"horse97k.ply": 1.8, "dragon100k.ply": None}
"""Speed of two cores, as a multiple of one, at least."""


def run(inputs: Inputs, runs: int) -> Section:
    """Time a matrix in one thread and in one per core, by turns with single sweeps."""
    gc.warm_up()
    cores = available_cores()
    rows = []
    for name, vertices, faces in inputs.arrays(MESHES):
        mesh = gc.TriangleMesh(vertices, faces)
        rng = np.random.default_rng(SEED)
        sources, targets = rng.choice(len(vertices), (2, POINTS), replace=False)
        calls = [partial(gc.distance_matrix, mesh, sources, targets, threads=n) for n in (1, cores)]
        fields = partial(_fields, mesh, sources)
        (one_s, one), (all_s, more), (fields_s, _) = by_turns([*calls, fields], runs)
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{fields_s:.2f}",
                f"{one_s:.2f}",
                f"{all_s:.2f}",
                rated(one_s / all_s, MESHES[name], at_least=True),
                "yes" if np.array_equal(one, more) else "**no**",
            ]
        )
    return Section(
        "Matrices",
        f"`distance_matrix` from {POINTS} random vertices to {POINTS} others on a prepared mesh, "
        f"seconds, medians of {runs} by turns: in one thread, and in {cores}, one per core; "
        f"beside it as many calls of `exact_distance`, which does not stop at the last target.",
        [
            "mesh",
            "faces",
            "single sweeps",
            "one thread",
            f"{cores} threads",
            "times faster",
            "equal to the bit",
        ],
        rows,
    )


def _fields(mesh: gc.TriangleMesh, sources: np.ndarray) -> None:
    for source in sources:
        gc.exact_distance(mesh, source)
