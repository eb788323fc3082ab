"""The lists of windows on half-edges: rows of the pool, their order, and queueing of lists."""

from geodesic_core.kernels.front.counters import FREE_FIRST, FREE_SIZE
from geodesic_core.kernels.front.queues import ring_push
from geodesic_core.kernels.front.state import (
    FIRST,
    IN_RING,
    LAST,
    LIST,
    MARKS,
    SETTLED,
    SIZE,
    WIDTH,
    View,
)
from geodesic_core.kernels.front.window import B0, INTS, NEXT
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import ROW


@inlined
def release_list(wave: View, h: int) -> None:
    """Give all windows of the list of h back to the pool, in O(1)."""
    pool = wave.pool
    row = LIST * h
    as_ints(pool.windows)[INTS * pool.lists[row + LAST] + NEXT] = wave.counters[FREE_FIRST]
    wave.counters[FREE_FIRST] = pool.lists[row + FIRST]
    wave.counters[FREE_SIZE] += pool.lists[row + SIZE]
    pool.lists[row + SIZE] = 0


@kernel
def queue_list(wave: View, h: int) -> None:
    """Put h into the ring, unless it has no windows or is there already; prefetch its rows."""
    mesh, pool = wave.mesh, wave.pool
    if pool.lists[LIST * h + SIZE] > 0 and not pool.lists[LIST * h + MARKS] & IN_RING:
        pool.lists[LIST * h + MARKS] |= IN_RING
        prefetch(mesh.geometry, ROW * h)
        prefetch(mesh.links, ROW * h)
        prefetch(pool.runs, h)
        ring_push(wave, h)


@kernel
def queue_if_due(wave: View, h: int, u: int, v: int) -> None:
    """Queue the list of h if an end of its edge (u, v) is settled; else it waits for more."""
    vertices = wave.vertices
    if vertices.status[u] == SETTLED or vertices.status[v] == SETTLED:
        queue_list(wave, h)


@kernel
def insert_sorted(wave: View, h: int, slot: int) -> None:
    """Insert a window into the list of h by its left end. Modifies the list."""
    pool = wave.pool
    row = LIST * h
    size = pool.lists[row + SIZE]
    before, after, place = -1, pool.lists[row + FIRST], 0
    left_end = pool.windows[WIDTH * slot + B0]
    while place < size and pool.windows[WIDTH * after + B0] < left_end:
        before, after = after, as_ints(pool.windows)[INTS * after + NEXT]
        place += 1
    if place > 0:
        as_ints(pool.windows)[INTS * before + NEXT] = slot
    else:
        pool.lists[row + FIRST] = slot
    if place < size:
        as_ints(pool.windows)[INTS * slot + NEXT] = after
    else:
        pool.lists[row + LAST] = slot
    pool.lists[row + SIZE] = size + 1
