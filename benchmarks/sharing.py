"""Sharing between sweeps of one mesh: memory, and the neighbourhood of their sources."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import numpy as np

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.large_matrix import VERTICES, cortex
from benchmarks.tables import Section
from geodesic_core.control import Control
from geodesic_core.fields.sources import as_points
from geodesic_core.matrices.plan import Plan
from geodesic_core.search.target_sweep import TargetSweep

SWEEPS = {2.0: 400, 20.0: 60, math.inf: 8}
"""How many, by the radius in millimetres"""


def run(_inputs: Inputs, runs: int) -> Section:
    """Sweep from neighbours and from points anywhere, in memory that is reused and in new one."""
    mesh = cortex()
    points = as_points(mesh, range(len(mesh.vertices)), "source", Control())
    ends = Plan.of(mesh, points, None, Control(), in_order=True).ends
    columns = np.zeros(1, np.int32), np.full(1, len(points), np.int32)
    rng = np.random.default_rng(1)
    field = gc.exact_distance(mesh, int(rng.integers(len(points))))
    kept = field.stats.windows_kept / field.stats.windows_created

    def sweep(sources: Sequence[int], limit: float, *, is_reused: bool) -> None:
        memory = TargetSweep(mesh)
        for source in sources:
            memory = memory if is_reused else TargetSweep(mesh)
            for _ in memory.rows(ends, limit, np.array([source]), columns, Control()):
                pass

    rows = []
    for limit, count in SWEEPS.items():
        near = np.argsort(field.distances)[:count].tolist()
        mixed = rng.permutation(near).tolist()
        usual_s, new_s, mixed_s = _by_turns(
            [
                partial(sweep, near, limit, is_reused=True),
                partial(sweep, near, limit, is_reused=False),
                partial(sweep, mixed, limit, is_reused=True),
            ],
            runs,
        )
        name = "the whole surface" if math.isinf(limit) else f"within {limit:g} mm"
        ratios = [f"{other / usual_s:.2f}" for other in (new_s, mixed_s)]
        rows.append([name, str(count), f"{1e3 * usual_s / count:.2f}", *ratios])
    return Section(
        "What sweeps share",
        f"Exact sweeps from neighbouring vertices of the cortex ({VERTICES:,} vertices), one after "
        f"the other; processor seconds, medians of {runs} runs by turns. A whole sweep keeps "
        f"{kept:.1%} of the windows that it creates: bounds that it had from a neighbour's "
        "distances could spare it the others, no more.",
        ["sweeps", "of them", "ms each", "new memory for each, ×", "in random order, ×"],
        rows,
    )


def _by_turns(calls: Sequence[Callable[[], None]], runs: int) -> list[float]:
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(runs):
        for call, its in zip(calls, times, strict=True):
            start = time.thread_time()
            call()
            its.append(time.thread_time() - start)
    return [median(its) for its in times]
