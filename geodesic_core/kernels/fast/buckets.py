"""Buckets: windows in the order of their least distance, to within the width of a bucket.

A ring of `BUCKETS` begins at the current bucket; in each, first come is first served. Windows that
are due later than its end wait in a chain, until the ring is empty or has come to the first of
them. A heap instead would cost as much as all else; the width hardly matters, from a quarter of a
mean edge to two.
"""

import math
from typing import Any

from geodesic_core.kernels.fast.state import (
    BUCKET,
    BUCKET_ENDS,
    BUCKETS,
    CREATED,
    CURRENT,
    FAR_BUCKET,
    FAR_FIRST,
    FIRST,
    FREE_FIRST,
    FREE_SIZE,
    FRESH,
    HALF_EDGE,
    IN_RING,
    LAST,
    PEAK,
    WON,
)
from geodesic_core.kernels.front.window import INTS, NEXT, WIDTH, Window, store_window
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import ROW

_LAST_BUCKET = 1e18  # far below the largest integer


@inlined
def push(wave: Any, h: int, window: Window, won: int, key: float) -> None:
    """Have a window wait to cross h, by its least distance ``key``. Modifies pool and buckets."""
    front = wave.front
    ints, counters = as_ints(front.windows), front.counters
    slot = counters[FREE_FIRST]
    if slot >= 0:
        counters[FREE_FIRST] = ints[INTS * slot + NEXT]
        counters[FREE_SIZE] -= 1
    else:
        slot = counters[FRESH]
        counters[FRESH] = slot + 1
    counters[CREATED] += 1
    counters[PEAK] = max(counters[PEAK], counters[FRESH] - counters[FREE_SIZE])
    store_window(wave, front.windows, slot, window)
    ints[INTS * slot + HALF_EDGE], ints[INTS * slot + WON] = h, won
    if h >= 0:  # it comes up long after: to wait for memory then took a third of the sweep
        prefetch(wave.mesh.links, ROW * h)
        prefetch(wave.mesh.geometry, ROW * h)
    due = math.floor(min(key * wave.bounds.buckets_per_unit, _LAST_BUCKET))
    bucket = max(int(due), counters[CURRENT])
    if bucket < counters[CURRENT] + BUCKETS:
        append(wave, slot, bucket)
        return
    front.windows[WIDTH * slot + BUCKET] = due
    ints[INTS * slot + NEXT] = counters[FAR_FIRST]
    if counters[FAR_FIRST] < 0 or bucket < counters[FAR_BUCKET]:
        counters[FAR_BUCKET] = bucket
    counters[FAR_FIRST] = slot


@inlined
def append(wave: Any, slot: int, bucket: int) -> None:
    """Append a row to a bucket of the ring."""
    ints, buckets = as_ints(wave.front.windows), wave.front.buckets
    row = BUCKET_ENDS * (bucket & (BUCKETS - 1))
    ints[INTS * slot + NEXT] = -1
    last = buckets[row + LAST]
    if last >= 0:
        ints[INTS * last + NEXT] = slot
    else:
        buckets[row + FIRST] = slot
    buckets[row + LAST] = slot
    wave.front.counters[IN_RING] += 1


@inlined
def first_waiting(wave: Any) -> int:
    """Return the row of the window to cross next, -1 if none waits. Moves the ring on."""
    front = wave.front
    counters = front.counters
    while counters[IN_RING] > 0 or counters[FAR_FIRST] >= 0:
        is_due = counters[FAR_FIRST] >= 0 and counters[FAR_BUCKET] <= counters[CURRENT]
        if is_due or counters[IN_RING] == 0:
            take_in_far(wave)
        slot = front.buckets[BUCKET_ENDS * (counters[CURRENT] & (BUCKETS - 1)) + FIRST]
        if slot >= 0:
            return int(slot)
        counters[CURRENT] += 1
    return -1


@kernel
def take_in_far(wave: Any) -> None:
    """Move the windows of the chain that are within the ring now into it. Modifies both."""
    front = wave.front
    ints, counters = as_ints(front.windows), front.counters
    if counters[IN_RING] == 0:
        counters[CURRENT] = max(counters[CURRENT], counters[FAR_BUCKET])
    slot = counters[FAR_FIRST]
    counters[FAR_FIRST] = -1
    while slot >= 0:
        after = int(ints[INTS * slot + NEXT])
        bucket = max(int(front.windows[WIDTH * slot + BUCKET]), counters[CURRENT])
        if bucket < counters[CURRENT] + BUCKETS:
            append(wave, slot, bucket)
        else:
            if counters[FAR_FIRST] < 0 or bucket < counters[FAR_BUCKET]:
                counters[FAR_BUCKET] = bucket
            ints[INTS * slot + NEXT] = counters[FAR_FIRST]
            counters[FAR_FIRST] = slot
        slot = after


@inlined
def pop(wave: Any, slot: int) -> None:
    """Take the first window, of row ``slot``, out of the current bucket; its row stays in use."""
    front = wave.front
    row = BUCKET_ENDS * (front.counters[CURRENT] & (BUCKETS - 1))
    after = as_ints(front.windows)[INTS * slot + NEXT]
    front.buckets[row + FIRST] = after
    if after < 0:
        front.buckets[row + LAST] = -1
    front.counters[IN_RING] -= 1


@inlined
def free(wave: Any, slot: int) -> None:
    """Give a row back to the pool."""
    front = wave.front
    as_ints(front.windows)[INTS * slot + NEXT] = front.counters[FREE_FIRST]
    front.counters[FREE_FIRST] = slot
    front.counters[FREE_SIZE] += 1


@inlined
def room(wave: Any) -> int:
    """Return how many rows of the pool are free."""
    counters = wave.front.counters
    return int(wave.sizes.windows - counters[FRESH] + counters[FREE_SIZE])
