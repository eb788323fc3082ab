"""Push the windows of one half-edge across its face (section 3.2), merged where that is asked."""

from typing import Any

from geodesic_core.kernels.jit import as_ints, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH_LEFT,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
)
from geodesic_core.kernels.sweep.reach import reach_apex
from geodesic_core.kernels.sweep.spread import room_to_spread, spread
from geodesic_core.kernels.sweep.state import (
    FREE_SIZE,
    FRESH,
    KEPT,
    LIST,
    MARKS,
    MERGES,
    PEAK,
    RETAINED,
    RETAINED_ROWS,
    SITE_SHIFT,
    SIZE,
    WORK,
    merging,
)
from geodesic_core.kernels.sweep.surface_points import reach_sites
from geodesic_core.kernels.sweep.trim_list import trim_list
from geodesic_core.kernels.sweep.window import (
    INTS,
    NEXT,
    WIDTH,
)
from geodesic_core.kernels.sweep.window_lists import (
    free_windows,
    release_list,
)
from geodesic_core.tolerances import RUNS

# Outcomes of propagating a list
PROPAGATED = 0
POOL_FULL = 1
SCRATCH_FULL = 2
MERGES_FULL = 5
RUNAWAY = 6  # a list came up again and again
RETAINED_FULL = 7


@kernel
def retain_windows(wave: Any, h: int, count: int) -> None:
    """Keep the windows of scratch, which are those that cross the face of h."""
    pool = wave.pool
    first = wave.counters[RETAINED_ROWS]
    for i in range(WIDTH * count):
        pool.retained[WIDTH * first + i] = pool.scratch[i]
    for i in range(first, first + count):
        as_ints(pool.retained)[INTS * i + NEXT] = h
    wave.counters[RETAINED_ROWS] = first + count


@kernel
def propagate_list(wave: Any, h: int) -> int:
    """Propagate the windows of h across its face (section 3.2)."""
    mesh, pool = wave.mesh, wave.pool
    size = pool.lists[LIST * h + SIZE]
    prefetch(pool.lists, LIST * mesh.links[ROW * h + OUT_LEFT])
    prefetch(pool.lists, LIST * mesh.links[ROW * h + OUT_RIGHT])
    prefetch(wave.vertices.distance, mesh.links[ROW * h + APEX])
    if room_to_spread(wave, h, size) > free_windows(wave):
        return POOL_FULL
    if size > wave.sizes.scratch:
        return SCRATCH_FULL
    # Asked per list, while the sweep runs: free, where a compiled switch would double the kernels.
    keeps = pool.lists[LIST * h + MARKS] & RETAINED
    if keeps and wave.counters[RETAINED_ROWS] + size > wave.sizes.retained:
        return RETAINED_FULL
    if merging(wave):
        if wave.sizes.merges > 0 and wave.counters[MERGES] + size > wave.sizes.merges:
            return MERGES_FULL
        if pool.runs[h] >= RUNS:
            return RUNAWAY
        pool.runs[h] += 1
    count = trim_list(wave, h)
    release_list(wave, h)
    if keeps:
        retain_windows(wave, h, count)
    wave.counters[KEPT] += count
    wave.counters[WORK] += 4 * size + 20
    if count > 0:
        row = ROW * h
        ax = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        ay = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        nearest, crossing, least = reach_apex(wave, h, count, ax, ay)
        if pool.lists[LIST * h + MARKS] >> SITE_SHIFT:
            reach_sites(wave, h, count)
        spread(wave, h, count, nearest, crossing, least)
        alive = wave.counters[FRESH] - wave.counters[FREE_SIZE]
        wave.counters[PEAK] = max(wave.counters[PEAK], alive)
    return PROPAGATED
