"""Fast distances, against approximate ones and potpourri3d's factorised heat query."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import potpourri3d as peer

import geodesic_core as gc
from benchmarks.approximate import ERROR, PATIENCE_S
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated
from benchmarks.timing import by_turns

EFFORTS: tuple[Any, ...] = (1, 2, 4, 8)


class Asked(NamedTuple):
    """Targets of an effort."""

    mean: float | None = None
    """Percent, at most"""
    within: float | None = None
    """Error of all vertices but one in a thousand, percent, at most"""
    heat: float | None = None
    """Mean error of the heat method as a multiple of ours, at least"""


ASKED = {1: Asked(0.5, 3.0, 1.0), 2: Asked(0.2, 1.2, 4.0), 4: Asked(), 8: Asked()}
FASTER: dict[str, dict[int, float]] = {
    "turbine.ply": {},
    "horse97k.ply": {1: 3.0, 2: 2.0},
    "dragon100k.ply": {1: 3.0, 2: 2.0},
    "armadillo86k.ply": {1: 3.0, 2: 2.0},
    "icosphere 7": {1: 2.0},
}
"""Times faster than `approximate_distance`, at least, by mesh and effort"""
AS_FAST_AS_HEAT = ("horse97k.ply", "icosphere 7")
"""At effort 1"""
LOOSER = {"turbine.ply": 15.0}
"""Errors of all vertices but one in a thousand, percent, where faces are slivers"""


def run(inputs: Inputs, runs: int) -> Section:
    """Compare efforts: times, errors and how much longer than needed the distances are."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(FASTER):
        mesh = gc.TriangleMesh(vertices, faces)
        heat = peer.MeshHeatMethodDistanceSolver(vertices, faces)
        calls: list[Callable[[], Any]] = [partial(gc.fast_distance, mesh, 0, k) for k in EFFORTS]
        calls += [partial(gc.approximate_distance, mesh, 0, ERROR)]
        calls += [partial(heat.compute_distance, 0)]
        *fast, (approximate_s, _), (heat_s, heated) = by_turns(calls, runs, PATIENCE_S)
        exact = gc.exact_distance(mesh, 0).distances
        reached = np.isfinite(exact) & (exact > 0)
        by_heat = 100 * np.abs(heated[reached] / exact[reached] - 1).mean()
        for effort, (seconds, field) in zip(EFFORTS, fast, strict=True):
            errors = 100 * (field.distances[reached] / exact[reached] - 1)
            asked, mean = ASKED[effort], errors.mean()
            within = LOOSER.get(name, asked.within) if asked.within else None
            of_heat = 1.0 if effort == 1 and name in AS_FAST_AS_HEAT else None
            rows.append(
                [
                    name,
                    str(effort),
                    f"{seconds:.4f}",
                    rated(approximate_s / seconds, FASTER[name].get(effort), at_least=True),
                    rated(seconds / heat_s, of_heat, at_least=False),
                    rated(mean, asked.mean, at_least=False, digits=4),
                    rated(np.quantile(errors, 0.999), within, at_least=False),
                    f"{errors.max():.2f}",
                    f"{errors.min() / 100:.0e}",
                    rated(by_heat / mean, asked.heat, at_least=True),
                ]
            )
    return Section(
        "Fast distances",
        f"One source (vertex 0) to all vertices of a prepared mesh, one thread, medians of {runs} "
        f"by turns in one process: `fast_distance` by effort, `approximate_distance` at ε = "
        f"{ERROR:.1%}, and the query of potpourri3d's heat method, its factorisation at hand. "
        f"Errors are against our exact distances; the least one, as a share, shows that none falls "
        f"short.",
        [
            "mesh",
            "effort",
            "seconds",
            "times faster than approximate",
            "of heat's time",
            "mean error, %",
            "99.9 % of vertices, %",
            "largest, %",
            "least",
            "heat's mean error, times larger",
        ],
        rows,
    )
