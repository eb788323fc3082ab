"""The state of a sweep: caller-owned arrays, and the same as raw pointers for the kernels.

Lists of windows: every half-edge has a singly linked list of the windows that wait to cross its
face, ordered along the edge. Rows come from a pool with a last-in-first-out free list, which keeps
the rows in use within a cache's reach.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.jit import kernel, pointer
from geodesic_core.kernels.topology import Topology
from geodesic_core.kernels.window import INTS, NEXT, WIDTH

# Columns of Wavefront.lists, a row per half-edge
SIZE = 0  # number of windows
FIRST = 1  # slot of the first window; without meaning in an empty list
LAST = 2
IN_RING = 3  # whether the half-edge is in the ring
LIST = 4

# Columns of Wavefront.winner_ints, a row per vertex
VIA = 0  # half-edge whose apex the vertex is and whose window reached it; -1 at a source
FROM = 1  # vertex of that window's pseudosource; -1 where unreached, itself at a source
WINNER = 2

# Status of a vertex
FAR = 0
FRONT = 1  # shares a face with a vertex that is done
DONE = 2  # has left the heap

# Counters (after the queues' three)
FREE_FIRST = 3  # free list
FREE_SIZE = 4
FRESH = 5  # rows of the pool from here on were never used
DONE_VERTICES = 6
CREATED = 7  # windows, in all
KEPT = 8  # windows that survived trimming and were propagated
PEAK = 9  # windows alive at once, at most
WORK = 10  # done in this slice, about 10 ns each
COUNTERS = 16


class Wavefront(NamedTuple):
    """All that changes while a sweep runs."""

    distance: Floats
    """(V,): least distance known, infinite where unreached; final when the sweep has finished"""
    winner: Floats
    """(V, 2): unfolded pseudosource of the winning window, in the frame of its VIA"""
    winner_ints: Ints
    """(V, 2): VIA, FROM"""
    status: Flags
    """(V,): FAR, FRONT or DONE"""
    origin: Ints
    """(V,): index of the source that the vertex had its distance from when it was last improved"""
    heap: Ints
    heap_keys: Floats
    heap_place: Ints
    ring: Ints
    lists: Ints
    """(3F, 4): SIZE, FIRST, LAST, IN_RING"""
    windows: Floats
    """(P, 8): the pool, see `window`"""
    scratch: Floats
    """(S, 8): the list that is being propagated"""
    counters: Longs


class View(NamedTuple):
    """A Topology and a Wavefront as raw pointers; plain arrays when the JIT is off."""

    geometry: Any
    links: Any
    first_corner: Any
    total_angle: Any
    flags: Any
    distance: Any
    winner: Any
    winner_ints: Any
    status: Any
    origin: Any
    heap: Any
    heap_keys: Any
    heap_place: Any
    ring: Any
    lists: Any
    windows: Any
    window_ints: Any
    scratch: Any
    scratch_ints: Any
    counters: Any
    ring_capacity: int
    pool: int
    scratch_size: int
    max_distance: float


@kernel
def view_of(topology: Any, wave: Any, max_distance: float) -> Any:
    """Return the View of two tuples of arrays, which the caller must hold meanwhile."""
    return View(
        pointer(topology.geometry),
        pointer(topology.links),
        pointer(topology.first_corner),
        pointer(topology.total_angle),
        pointer(topology.flags),
        pointer(wave.distance),
        pointer(wave.winner),
        pointer(wave.winner_ints),
        pointer(wave.status),
        pointer(wave.origin),
        pointer(wave.heap),
        pointer(wave.heap_keys),
        pointer(wave.heap_place),
        pointer(wave.ring),
        pointer(wave.lists),
        pointer(wave.windows),
        pointer(wave.windows.view(np.int32)),
        pointer(wave.scratch),
        pointer(wave.scratch.view(np.int32)),
        pointer(wave.counters),
        wave.ring.shape[0],
        wave.windows.shape[0],
        wave.scratch.shape[0],
        max_distance,
    )


def new_wavefront(topology: Topology) -> Wavefront:
    """Allocate the state of one sweep: O(V + F), nothing reached yet."""
    vertices, half_edges = len(topology.first_corner), len(topology.links)
    counters = np.zeros(COUNTERS, np.int64)
    counters[FREE_FIRST] = -1
    return Wavefront(
        distance=np.full(vertices, np.inf),
        winner=np.empty((vertices, 2)),
        winner_ints=np.full((vertices, WINNER), -1, np.int32),
        status=np.zeros(vertices, np.uint8),
        origin=np.zeros(vertices, np.int32),
        heap=np.empty(vertices, np.int32),
        heap_keys=np.empty(vertices),
        heap_place=np.full(vertices, -1, np.int32),
        ring=np.empty(half_edges, np.int32),
        lists=np.zeros((half_edges, LIST), np.int32),
        windows=np.empty((1024, WIDTH)),
        scratch=np.empty((256, WIDTH)),
        counters=counters,
    )


def with_larger_pool(wave: Wavefront) -> Wavefront:
    """Return the wavefront with twice the windows."""
    windows = np.empty((2 * len(wave.windows), WIDTH))
    windows[: len(wave.windows)] = wave.windows
    return wave._replace(windows=windows)


def with_larger_scratch(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room for lists twice as long."""
    return wave._replace(scratch=np.empty((2 * len(wave.scratch), WIDTH)))


def bytes_of(wave: Wavefront) -> int:
    """Memory of the state."""
    return sum(array.nbytes for array in wave)


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
