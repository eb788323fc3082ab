"""Certificates: how close their bounds are, what they cost, and how long the checker takes."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from geodesic_core import verify

MESHES = (
    "fandisk10k.ply",
    "turbine.ply",
    "blade.ply",
    "rockerarm20k.ply",
    "buddha30k.ply",
    "armadillo86k.ply",
    "horse97k.ply",
    "dragon100k.ply",
)
SEED = 7
GAP = 1e-9
"""Of the largest distance, at most"""
SWEEPS, PER_FACE_US, PER_FACE_BYTES = 20.0, 300.0, 1000.0
"""Time of `certify` in sweeps, of the checker, and the size of the file, at most"""
_NAMES = verify.Paths._fields


def run(inputs: Inputs, _: int) -> Section:
    """Certify ten questions on each mesh, and check the proof of one."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(MESHES):
        mesh = gc.TriangleMesh(vertices, faces)
        gaps, sweeps, violations = [], [], []
        for question in _questions(mesh):
            began = time.process_time()
            field = gc.exact_distance(mesh, **question)
            swept = time.process_time()
            certificate = field.certify()
            sweeps.append((time.process_time() - swept) / (swept - began))
            gaps.append(certificate.relative_gap)
            largest = certificate.upper[np.isfinite(certificate.upper)].max()
            violations.append(certificate.worst_violation / largest)
        check_us, size = _checked(mesh, gc.exact_distance(mesh, 0).certify())
        rows.append(
            [
                name,
                f"{len(mesh.faces):,}",
                rated(1e9 * max(gaps), 1e9 * GAP, at_least=False),
                f"{1e12 * max(violations):.2f}",
                rated(float(np.median(sweeps)), SWEEPS, at_least=False),
                rated(check_us, PER_FACE_US, at_least=False),
                rated(size, PER_FACE_BYTES, at_least=False),
            ]
        )
    return Section(
        "Certificates",
        "Exact fields of ten questions on each mesh: from five vertices, a point on an edge and "
        "one in a face, from three at once with start distances, with barriers, and with a limit. "
        "The worst gap between proved bounds and the worst τ of a face, both as shares of the "
        "largest distance; the median time of `certify` in sweeps of the same question; and from "
        "vertex 0 the time of the checker, which is NumPy alone, and the size of the file.",
        [
            "mesh",
            "faces",
            "gap, 1e-9",
            "worst τ, 1e-12",
            "certify, sweeps",
            "checker, µs a face",
            "file, bytes a face",
        ],
        rows,
    )


def _questions(mesh: gc.TriangleMesh) -> Iterator[dict[str, Any]]:
    """Yield what is asked of a mesh, as arguments of `exact_distance`."""
    rng = np.random.default_rng(SEED)
    count = len(mesh.faces)
    yield from ({"sources": int(v)} for v in rng.choice(len(mesh.vertices), 5, replace=False))
    yield {"sources": gc.SurfacePoint.edge(int(rng.integers(count)), 1, 0.3)}
    inside = gc.SurfacePoint.face(int(rng.integers(count)), (0.2, 0.3, 0.5))
    yield {"sources": inside}
    several = [gc.Source(inside, 0.01 * mesh.diagonal), gc.Source(3, 0.0), gc.Source(40, 0.02)]
    yield {"sources": several}
    yield {"sources": 7, "barriers": range(100, 160)}
    yield {"sources": 7, "max_distance": 0.2 * mesh.diagonal}


def _checked(mesh: gc.TriangleMesh, certificate: gc.Certificate) -> tuple[float, float]:
    """Return the microseconds that the checker takes for a face, and the bytes of the file."""
    (start,) = np.flatnonzero(certificate.upper == 0.0).tolist()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "proof.npz")
        certificate.save(path)
        began = time.process_time()
        with np.load(path) as file:
            given = dict(file)
        surface = verify.Surface(mesh.vertices, mesh.faces, None, given["values"], mesh.barriers)
        sources = [verify.Source(start, -1, (0.0, 0.0, 0.0), 0.0)]
        verify.prove(surface, sources, given)
        verify.measure(surface, sources, verify.Paths(*(given[f"path_{name}"] for name in _NAMES)))
        seconds = time.process_time() - began
        return 1e6 * seconds / len(mesh.faces), path.stat().st_size / len(mesh.faces)
