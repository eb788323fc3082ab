"""All distances between the vertices of a cortex-like surface, from a sample of their sweeps."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from geodesic_core.arrays import Longs
from geodesic_core.control import Control
from geodesic_core.fields.methods import Method, sweep_of
from geodesic_core.fields.sources import as_points
from geodesic_core.matrices.plan import Plan
from geodesic_core.matrices.threads import available_cores, share_out
from geodesic_core.search.target_sweep import TargetSweep

VERTICES = 32_492
"""As many as surfaces of a brain hemisphere often have"""
FACES = 2 * VERTICES - 4
BLOCKED = 0.09
"""Share of the faces that are blocked in one region, as the medial wall is"""
EVERY = 50
CORES, AT_MOST_S = 16, 90.0


def cortex() -> gc.TriangleMesh:
    """Return a sphere in folds about as deep as they are wide, one region of it blocked."""
    ball = gc.samples.sphere(FACES)
    vertices, faces = ball.vertices, ball.faces
    rng = np.random.default_rng(7)
    waves = rng.normal(size=(40, 3))
    waves *= (rng.uniform(8, 16, 40) / np.linalg.norm(waves, axis=1))[:, None]
    folds = np.tanh(np.sin(vertices @ waves.T + rng.uniform(0, 2 * math.pi, 40)).sum(axis=1) / 3)
    sides = vertices[faces].mean(axis=1)[:, 0]
    blocked = np.argsort(sides)[: int(BLOCKED * len(faces))]
    # Millimetres: half of a human brain
    folded = vertices * (1 + 0.12 * folds)[:, None] * (35, 80, 55)
    return gc.TriangleMesh(folded, faces).with_barriers(blocked)


def run(_inputs: Inputs, _runs: int) -> Section:
    """Time every fiftieth sweep in one thread and in one per core, each thread by turns."""
    mesh, cores = cortex(), available_cores()
    points = as_points(mesh, range(len(mesh.vertices)), "source", Control())
    plan = Plan.of(mesh, points, None, Control(), in_order=False)
    sweeps = np.arange(0, plan.sweeps, EVERY)

    rows = []
    for name in get_args(Method):
        sweep = sweep_of(mesh, name, relative_error=1e-3)
        make = partial(TargetSweep, mesh, sweep)
        one_s, all_s = (_seconds(plan, sweeps, make, n) for n in (1, cores))
        whole = plan.sweeps / len(sweeps) * one_s
        limit = AT_MOST_S if name == "exact" else None
        rows.append(
            [
                name,
                f"{len(sweeps)}",
                f"{1e3 * one_s / len(sweeps):.1f}",
                f"{whole:.0f}",
                rated(one_s / all_s, 1.9 if name == "exact" else None, at_least=True),
                rated(whole / CORES, limit, at_least=False, digits=0),
            ]
        )
    return Section(
        "All distances of a cortex",
        f"{VERTICES:,} × {VERTICES:,} distances on a folded sphere of {FACES:,} faces, "
        f"{BLOCKED:.0%} of them blocked, extrapolated from every {EVERY}th sweep in the order of "
        f"`write_matrix`, which asks each pair once; the last column is the first of seconds "
        f"divided by {CORES}.",
        [
            "method",
            "sweeps",
            "ms a sweep",
            "all, one core, s",
            f"times faster on {cores}",
            f"all, {CORES} cores, s",
        ],
        rows,
    )


def _seconds(plan: Plan, sweeps: Longs, make: Callable[[], TargetSweep], threads: int) -> float:
    def work(memory: TargetSweep, part: int, control: Control) -> None:
        sweep = sweeps[part : part + 1]
        for _ in memory.rows(plan.ends, math.inf, sweep, plan.columns_of(sweep), control):
            pass

    workers = [partial(work, make()) for _ in range(threads)]
    start = time.perf_counter()
    share_out(len(sweeps), workers, Control())
    return time.perf_counter() - start
