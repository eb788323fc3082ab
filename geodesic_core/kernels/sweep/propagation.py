"""The windows of one half-edge propagated across its face (section 3.2)."""

from geodesic_core.kernels.front.counters import (
    FREE_SIZE,
    FRESH,
    MERGES,
    PEAK,
    PROPAGATED,
    RETAINED_ROWS,
    WORK,
)
from geodesic_core.kernels.front.pool import free_windows
from geodesic_core.kernels.front.pruning import touch
from geodesic_core.kernels.front.state import (
    FAR,
    LIST,
    MARKS,
    RETAINED,
    SITE_SHIFT,
    SIZE,
    WIDTH,
    View,
    merging,
)
from geodesic_core.kernels.front.window import INTS, NEXT
from geodesic_core.kernels.front.window_lists import release_list
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH_LEFT,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
)
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep.reach import reach_apex
from geodesic_core.kernels.sweep.site_targets import reach_sites
from geodesic_core.kernels.sweep.spread import room_to_spread, spread
from geodesic_core.kernels.sweep.trim_list import trim_list
from geodesic_core.tolerances import MOST_RUNS, RUNS

# Units of work, of about 10 ns
WORK_OF_LIST = 20
WORK_OF_WINDOW = 4


@kernel
def propagate_list(wave: View, h: int) -> Outcome:
    """Propagate the windows of h across its face: trim, reach the apex, spread (section 3.2).

    Return an outcome; unless it is FINISHED nothing has changed, and the caller may call again.
    Modifies the lists of the face, its apex and its sites.
    """
    mesh, counters = wave.mesh, wave.counters
    size = wave.pool.lists[LIST * h + SIZE]
    marks = wave.pool.lists[LIST * h + MARKS]
    prefetch(wave.pool.lists, LIST * mesh.links[ROW * h + OUT_LEFT])
    prefetch(wave.pool.lists, LIST * mesh.links[ROW * h + OUT_RIGHT])
    prefetch(wave.vertices.distance, mesh.links[ROW * h + APEX])
    outcome = room_to_propagate(wave, h, size)
    if outcome != Outcome.FINISHED:
        return outcome
    if wave.pool.runs[h] >= (RUNS if merging(wave) else MOST_RUNS):
        return Outcome.RUNAWAY
    wave.pool.runs[h] += 1
    count = trim_list(wave, h)
    release_list(wave, h)
    if marks & RETAINED:
        retain_windows(wave, h, count)
    counters[PROPAGATED] += count
    counters[WORK] += WORK_OF_WINDOW * size + WORK_OF_LIST
    if count > 0:
        row, apex = ROW * h, mesh.links[ROW * h + APEX]
        if wave.vertices.status[apex] == FAR:  # windows may pass it that do not improve it
            touch(wave, apex)
        ax = mesh.geometry[row + COS_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        ay = mesh.geometry[row + SIN_LEFT] * mesh.geometry[row + LENGTH_LEFT]
        nearest, crossing, least = reach_apex(wave, h, count, ax, ay)
        if marks >> SITE_SHIFT:
            reach_sites(wave, h, count)
        spread(wave, h, count, nearest, crossing, least)
        counters[PEAK] = max(counters[PEAK], counters[FRESH] - counters[FREE_SIZE])
    return Outcome.FINISHED


@inlined
def room_to_propagate(wave: View, h: int, size: int) -> Outcome:
    """Return FINISHED if there is room to propagate ``size`` windows of h, else what is full."""
    if room_to_spread(wave, h, size) > free_windows(wave):
        return Outcome.POOL_FULL
    if size > wave.sizes.scratch:
        return Outcome.SCRATCH_FULL
    # Looked up per list, while the sweep runs: free, where a compiled switch would double the
    # kernels.
    is_retained = wave.pool.lists[LIST * h + MARKS] & RETAINED
    if is_retained and wave.counters[RETAINED_ROWS] + size > wave.sizes.retained:
        return Outcome.RETAINED_FULL
    is_recorded = merging(wave) and wave.sizes.merges > 0
    if is_recorded and wave.counters[MERGES] + size > wave.sizes.merges:
        return Outcome.MERGES_FULL
    return Outcome.FINISHED


@kernel
def retain_windows(wave: View, h: int, count: int) -> None:
    """Retain the windows of scratch, which are those that cross the face of h.

    Modifies the retained windows.
    """
    pool = wave.pool
    first = wave.counters[RETAINED_ROWS]
    for i in range(WIDTH * count):
        pool.retained[WIDTH * first + i] = pool.scratch[i]
    for i in range(first, first + count):
        as_ints(pool.retained)[INTS * i + NEXT] = h
    wave.counters[RETAINED_ROWS] = first + count
