"""From arrays to a mesh that can be queried: validation, half-edges, fans, flat geometry."""

from functools import partial
from statistics import median

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, verdict
from benchmarks.timing import timed

NAMES = ("fandisk.obj", "armadillo86k.ply", "horse97k.ply", "dragon100k.ply", "icosphere 6")
TARGETS = {"horse97k.ply": 0.05}


def run(inputs: Inputs, runs: int) -> Section:
    """Time ``TriangleMesh(vertices, faces)`` with compiled kernels."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(NAMES):
        mesh = gc.TriangleMesh(vertices, faces)
        seconds = median(timed(partial(gc.TriangleMesh, vertices, faces))[0] for _ in range(runs))
        target = TARGETS.get(name)
        rows.append(
            [
                name,
                f"{len(faces):,}",
                f"{seconds:.4f}",
                f"{mesh.nbytes / len(faces):.0f}",
                verdict(seconds, target, at_least=False) if target else "",
            ]
        )
    return Section(
        "Topology",
        f"`TriangleMesh` from arrays, median of {runs}; compile time is not in it.",
        ["mesh", "faces", "seconds", "bytes a face", "target, s"],
        rows,
    )
