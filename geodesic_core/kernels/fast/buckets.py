"""Buckets: windows in the order of their least distance, to within the width of a bucket.

A ring of `BUCKETS` begins at the current bucket; in each, first come is first served. Windows that
are due later than its end wait in a chain, until the ring is empty or has come to the first of
them. A heap instead would cost as much as all else; the width hardly matters, from a quarter of a
mean edge to two.
"""

import math

from geodesic_core.kernels.fast.state import BUCKET_ENDS, BUCKETS, FIRST, LAST
from geodesic_core.kernels.front.counters import (
    CREATED,
    CURRENT,
    FAR_BUCKET,
    FAR_FIRST,
    FREE_SIZE,
    FRESH,
    IN_BUCKETS,
    PEAK,
)
from geodesic_core.kernels.front.pool import put_window
from geodesic_core.kernels.front.state import WIDTH, View
from geodesic_core.kernels.front.window import HALF_EDGE, INTS, KEY, NEXT, WON, Window
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import ROW
from geodesic_core.tolerances import LAST_BUCKET


@inlined
def push(wave: View, h: int, window: Window, won: int, key: float) -> None:
    """Have a window wait to cross h, by its least distance ``key``. Modifies pool and buckets."""
    rows, counters = wave.pool.windows, wave.counters
    slot, ints = put_window(wave, window), as_ints(rows)
    counters[CREATED] += 1
    counters[PEAK] = max(counters[PEAK], counters[FRESH] - counters[FREE_SIZE])
    ints[INTS * slot + HALF_EDGE], ints[INTS * slot + WON] = h, won
    if h >= 0:  # it comes up long after: to wait for memory then took a third of the sweep
        prefetch(wave.mesh.links, ROW * h)
        prefetch(wave.mesh.geometry, ROW * h)
    rows[WIDTH * slot + KEY] = key
    enqueue(wave, slot, key)


@inlined
def enqueue(wave: View, slot: int, key: float) -> None:
    """Put a window into its bucket of the ring, or into the chain of those beyond it."""
    counters = wave.counters
    due = math.floor(min(key * wave.places.buckets_per_unit, LAST_BUCKET))
    bucket = max(int(due), counters[CURRENT])
    if bucket < counters[CURRENT] + BUCKETS:
        append(wave, slot, bucket)
        return
    as_ints(wave.pool.windows)[INTS * slot + NEXT] = counters[FAR_FIRST]
    if counters[FAR_FIRST] < 0 or bucket < counters[FAR_BUCKET]:
        counters[FAR_BUCKET] = bucket
    counters[FAR_FIRST] = slot


@inlined
def append(wave: View, slot: int, bucket: int) -> None:
    """Append a row to a bucket of the ring."""
    ints, buckets = as_ints(wave.pool.windows), wave.places.buckets
    row = BUCKET_ENDS * (bucket & (BUCKETS - 1))
    ints[INTS * slot + NEXT] = -1
    last = buckets[row + LAST]
    if last >= 0:
        ints[INTS * last + NEXT] = slot
    else:
        buckets[row + FIRST] = slot
    buckets[row + LAST] = slot
    wave.counters[IN_BUCKETS] += 1


@inlined
def first_waiting(wave: View) -> int:
    """Return the row of the window to cross next, -1 if none waits. Moves the ring on."""
    counters = wave.counters
    while counters[IN_BUCKETS] > 0 or counters[FAR_FIRST] >= 0:
        is_due = counters[FAR_FIRST] >= 0 and counters[FAR_BUCKET] <= counters[CURRENT]
        if is_due or counters[IN_BUCKETS] == 0:
            take_in_far(wave)
        slot = wave.places.buckets[BUCKET_ENDS * (counters[CURRENT] & (BUCKETS - 1)) + FIRST]
        if slot >= 0:
            return int(slot)
        counters[CURRENT] += 1
    return -1


@kernel
def take_in_far(wave: View) -> None:
    """Move the windows of the chain that are within the ring now into it. Modifies both."""
    rows, counters = wave.pool.windows, wave.counters
    if counters[IN_BUCKETS] == 0:
        counters[CURRENT] = max(counters[CURRENT], counters[FAR_BUCKET])
    slot = counters[FAR_FIRST]
    counters[FAR_FIRST] = -1
    while slot >= 0:
        after = int(as_ints(rows)[INTS * slot + NEXT])
        enqueue(wave, slot, rows[WIDTH * slot + KEY])
        slot = after


@inlined
def pop(wave: View, slot: int) -> None:
    """Take the first window, of row ``slot``, out of the current bucket; its row stays in use."""
    row = BUCKET_ENDS * (wave.counters[CURRENT] & (BUCKETS - 1))
    after = as_ints(wave.pool.windows)[INTS * slot + NEXT]
    wave.places.buckets[row + FIRST] = after
    if after < 0:
        wave.places.buckets[row + LAST] = -1
    wave.counters[IN_BUCKETS] -= 1
