"""Farthest points, relaxed points and means, as multiples of one exact sweep.

All is of one thread, and counts the processor's seconds, which others on the machine disturb less
than those on the clock.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import geodesic_core as gc
from benchmarks import timing
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated

SURFACES = ("horse97k.ply", "dragon100k.ply", "icosphere 6")
FARTHEST, RELAXED, ITERATIONS = 1000, 100, 20
FARTHEST_SWEEPS, RELAXED_SWEEPS = 8.0, 30.0
"""Time of farthest points, and of relaxing, as multiples of a sweep's, at most"""
MEAN_OF = 10

by_turns = partial(timing.by_turns, clock=time.process_time)


def run(inputs: Inputs, runs: int) -> Iterator[Section]:
    """Measure points that are spread, relaxed and averaged."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(SURFACES):
        mesh = gc.TriangleMesh(vertices, faces)
        few = gc.farthest_points(mesh, RELAXED)
        calls: list[Callable[[], Any]] = [
            partial(gc.exact_distance, mesh, 0),
            partial(gc.farthest_points, mesh, FARTHEST),
            partial(gc.relax_points, mesh, few.points, ITERATIONS),
            partial(gc.mean_point, mesh, few.points[:MEAN_OF]),
        ]
        (sweep_s, _), (spread_s, _), (relaxed_s, relaxed), (mean_s, mean) = by_turns(calls, runs)
        rows.append(
            [
                name,
                f"{1e3 * sweep_s:.0f}",
                rated(spread_s / sweep_s, FARTHEST_SWEEPS, at_least=False, digits=1),
                rated(relaxed_s / sweep_s, RELAXED_SWEEPS, at_least=False, digits=1),
                f"{relaxed.costs[-1] / relaxed.costs[0]:.3f}",
                f"{mean_s / sweep_s:.1f}",
                f"{mean.moves}",
            ]
        )
    yield Section(
        "Samples",
        f"Processor time in exact sweeps from vertex 0 of the same prepared mesh, medians of {runs}"
        f" runs by turns: {FARTHEST:,} farthest points; {ITERATIONS} iterations of Lloyd's method "
        f"with {RELAXED}, and what they leave of the cost; the mean of {MEAN_OF}, and how often it "
        f"moved.",
        ["mesh", "sweep, ms", "farthest", "relaxed", "cost left", "mean", "moves"],
        rows,
    )
