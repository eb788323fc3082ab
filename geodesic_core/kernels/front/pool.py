"""The pool of windows: rows of one array, with a list of those that are free.

The list is last in, first out, so that the rows in use stay within a cache's reach.
"""

from geodesic_core.kernels.front.counters import FREE_FIRST, FREE_SIZE, FRESH
from geodesic_core.kernels.front.state import View
from geodesic_core.kernels.front.window import INTS, NEXT, Window, store_window
from geodesic_core.kernels.jit import as_ints, inlined, kernel


@inlined
def free_windows(wave: View) -> int:
    """Return the number of windows that can be taken before the pool must grow."""
    return wave.counters[FREE_SIZE] + wave.sizes.windows - wave.counters[FRESH]


@inlined
def take_window(wave: View) -> int:
    """Take a slot from the pool; the caller has checked that there is one. Modifies the pool."""
    slot = wave.counters[FREE_FIRST]
    if slot >= 0:
        wave.counters[FREE_FIRST] = as_ints(wave.pool.windows)[INTS * slot + NEXT]
        wave.counters[FREE_SIZE] -= 1
        return slot
    slot = wave.counters[FRESH]
    wave.counters[FRESH] = slot + 1
    return slot


@inlined
def put_window(wave: View, window: Window) -> int:
    """Write a window to a slot from the pool, and return the slot. Modifies the pool."""
    slot = take_window(wave)
    store_window(wave, wave.pool.windows, slot, window)
    return slot


@kernel
def free_window(wave: View, slot: int) -> None:
    """Give a window back to the pool."""
    as_ints(wave.pool.windows)[INTS * slot + NEXT] = wave.counters[FREE_FIRST]
    wave.counters[FREE_FIRST] = slot
    wave.counters[FREE_SIZE] += 1
