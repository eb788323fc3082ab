"""The lists of windows on half-edges: rows from the pool, their order, and when a list is due."""

from typing import Any

from geodesic_core.kernels.jit import kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import (
    AROUND,
    HEAD,
    IRREGULAR,
    LENGTH,
    OPPOSITE,
    OUT_LEFT,
    ROW,
    TAIL,
    following,
)
from geodesic_core.kernels.sweep.irregular_edges import (
    mirror,
    record_crossing,
    trim_against_crossings,
)
from geodesic_core.kernels.sweep.queues import ring_push
from geodesic_core.kernels.sweep.state import (
    CREATED,
    FIRST,
    FREE_FIRST,
    FREE_SIZE,
    FRESH,
    IN_RING,
    LAST,
    LIST,
    MARKS,
    SETTLED,
    SIZE,
    merging,
)
from geodesic_core.kernels.sweep.window import (
    B0,
    B1,
    INTS,
    NEXT,
    REFERENCE,
    ROOT,
    SIGMA,
    SX,
    SY,
    WIDTH,
    XI,
)


@kernel
def free_windows(wave: Any) -> int:
    """Return the number of windows that can be taken before the pool must grow."""
    return wave.counters[FREE_SIZE] + wave.pool - wave.counters[FRESH]


@kernel
def take_window(wave: Any) -> int:
    """Take a slot from the pool; the caller has checked that there is one."""
    slot = wave.counters[FREE_FIRST]
    if slot >= 0:
        wave.counters[FREE_FIRST] = wave.window_ints[INTS * slot + NEXT]
        wave.counters[FREE_SIZE] -= 1
        return slot
    slot = wave.counters[FRESH]
    wave.counters[FRESH] = slot + 1
    return slot


@kernel
def release_list(wave: Any, h: int) -> None:
    """Give all windows of the list of h back to the pool, in O(1)."""
    row = LIST * h
    wave.window_ints[INTS * wave.lists[row + LAST] + NEXT] = wave.counters[FREE_FIRST]
    wave.counters[FREE_FIRST] = wave.lists[row + FIRST]
    wave.counters[FREE_SIZE] += wave.lists[row + SIZE]
    wave.lists[row + SIZE] = 0


@kernel
def put_window(
    wave: Any,
    b0: float,
    b1: float,
    sx: float,
    sy: float,
    sigma: float,
    root: int,
    xi: float,
    reference: int,
) -> int:
    """Take a slot of the pool and fill it."""
    slot = take_window(wave)
    w = WIDTH * slot
    wave.windows[w + B0], wave.windows[w + B1] = b0, b1
    wave.windows[w + SX], wave.windows[w + SY] = sx, sy
    wave.windows[w + SIGMA] = sigma
    wave.window_ints[INTS * slot + ROOT] = root
    if merging(wave):
        wave.windows[w + XI] = xi
        wave.window_ints[INTS * slot + REFERENCE] = reference
    return slot


@kernel
def queue_list(wave: Any, h: int) -> None:
    """Put h into the ring, unless it has no windows or is there already.

    Its rows are asked for ahead of its turn: 7 % of an exact sweep, 18 % of a merging one.
    """
    if wave.lists[LIST * h + SIZE] > 0 and not wave.lists[LIST * h + MARKS] & IN_RING:
        wave.lists[LIST * h + MARKS] |= IN_RING
        prefetch(wave.geometry, ROW * h)
        prefetch(wave.links, ROW * h)
        ring_push(wave, h)


@kernel
def queue_if_due(wave: Any, h: int, u: int, v: int) -> None:
    """Queue the list of h if an end of its edge (u, v) is done; else it waits for more windows."""
    if wave.status[u] == SETTLED or wave.status[v] == SETTLED:
        queue_list(wave, h)


@kernel
def send_out(wave: Any, h: int, slot: int) -> None:
    """Move a window of a source in the face of h over the edge of h, which is no boundary."""
    wave.counters[CREATED] += 1
    if wave.links[ROW * following(h) + OUT_LEFT] == IRREGULAR:
        send_across(wave, h, slot)
    else:
        insert_sorted(wave, wave.links[ROW * h + OPPOSITE], slot)


@kernel
def send_across(wave: Any, g: int, slot: int) -> None:
    """Move a window over the irregular edge of g, which it leaves, into each other of its faces.

    It comes in the frame of a half-edge that runs the other way than g; where one runs the same
    way, its face is seen in the mirror.
    """
    links, w = wave.links, WIDTH * slot
    wave.counters[CREATED] -= 1
    if not trim_against_crossings(wave, g, slot):
        free_window(wave, slot)
        return
    h = links[ROW * g + AROUND] >> 1
    while h != g:
        copy = put_window(
            wave,
            wave.windows[w + B0],
            wave.windows[w + B1],
            wave.windows[w + SX],
            wave.windows[w + SY],
            wave.windows[w + SIGMA],
            wave.window_ints[INTS * slot + ROOT],
            wave.windows[w + XI],
            wave.window_ints[INTS * slot + REFERENCE],
        )
        if links[ROW * h + TAIL] == links[ROW * g + TAIL]:
            mirror(wave, copy, wave.geometry[ROW * g + LENGTH])
        insert_sorted(wave, h, copy)
        wave.counters[CREATED] += 1
        queue_if_due(wave, h, links[ROW * h + TAIL], links[ROW * h + HEAD])
        h = links[ROW * h + AROUND] >> 1
    record_crossing(wave, g, slot)


@kernel
def free_window(wave: Any, slot: int) -> None:
    """Give a window back to the pool."""
    wave.window_ints[INTS * slot + NEXT] = wave.counters[FREE_FIRST]
    wave.counters[FREE_FIRST] = slot
    wave.counters[FREE_SIZE] += 1


@kernel
def faces_beyond(wave: Any, g: int) -> int:
    """Return how many other faces the irregular edge of g has."""
    count, h = 0, wave.links[ROW * g + AROUND] >> 1
    while h != g:
        count += 1
        h = wave.links[ROW * h + AROUND] >> 1
    return count


@kernel
def insert_sorted(wave: Any, h: int, slot: int) -> None:
    """Insert a window into the list of h by its left end."""
    row = LIST * h
    size = wave.lists[row + SIZE]
    before, after, place = -1, wave.lists[row + FIRST], 0
    left_end = wave.windows[WIDTH * slot + B0]
    while place < size and wave.windows[WIDTH * after + B0] < left_end:
        before, after = after, wave.window_ints[INTS * after + NEXT]
        place += 1
    if place > 0:
        wave.window_ints[INTS * before + NEXT] = slot
    else:
        wave.lists[row + FIRST] = slot
    if place < size:
        wave.window_ints[INTS * slot + NEXT] = after
    else:
        wave.lists[row + LAST] = slot
    wave.lists[row + SIZE] = size + 1
