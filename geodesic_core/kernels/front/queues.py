"""The two queues of the sweep: a heap of vertices by distance, a ring of half-edges to propagate.

Both live in arrays of the caller. The heap is 4-ary and indexed: ``heap_place[v]`` is the place of
vertex v, or -1; keys lie beside the vertices, where a comparison finds them in cache. Ties go to
the lower vertex, so that the order never depends on history.
"""

from geodesic_core.arrays import Longs
from geodesic_core.kernels.front.counters import HEAP_SIZE, RING_HEAD, RING_SIZE
from geodesic_core.kernels.front.state import Queues, View
from geodesic_core.kernels.jit import kernel

_ARITY = 4


@kernel
def precedes(key: float, v: int, other_key: float, u: int) -> bool:
    """Whether vertex v leaves the heap before vertex u."""
    return key < other_key or (key == other_key and v < u)


@kernel
def push_or_raise(queues: Queues, counters: Longs, v: int, key: float) -> None:
    """Put v into the heap, or move it up after its key has decreased. Modifies the heap.

    It takes no more of the view than it needs: a search along edges took twice as long when all of
    it was passed.
    """
    i = queues.heap_place[v]
    if i < 0:
        i = counters[HEAP_SIZE]
        counters[HEAP_SIZE] = i + 1
    while i > 0:
        parent = (i - 1) // _ARITY
        u, parent_key = queues.heap[parent], queues.heap_keys[parent]
        if not precedes(key, v, parent_key, u):
            break
        queues.heap[i], queues.heap_keys[i] = u, parent_key
        queues.heap_place[u] = i
        i = parent
    queues.heap[i], queues.heap_keys[i] = v, key
    queues.heap_place[v] = i


@kernel
def pop_nearest(queues: Queues, counters: Longs) -> int:
    """Remove and return the nearest vertex; the heap must not be empty. Modifies the heap."""
    nearest = queues.heap[0]
    queues.heap_place[nearest] = -1
    size = counters[HEAP_SIZE] - 1
    counters[HEAP_SIZE] = size
    if size > 0:
        v, key = queues.heap[size], queues.heap_keys[size]
        i = 0
        while True:
            first = _ARITY * i + 1
            if first >= size:
                break
            child = first
            for c in range(first + 1, min(first + _ARITY, size)):
                if precedes(
                    queues.heap_keys[c],
                    queues.heap[c],
                    queues.heap_keys[child],
                    queues.heap[child],
                ):
                    child = c
            u, child_key = queues.heap[child], queues.heap_keys[child]
            if not precedes(child_key, u, key, v):
                break
            queues.heap[i], queues.heap_keys[i] = u, child_key
            queues.heap_place[u] = i
            i = child
        queues.heap[i], queues.heap_keys[i] = v, key
        queues.heap_place[v] = i
    return nearest


@kernel
def ring_push(wave: View, h: int) -> None:
    """Append half-edge h; the ring has room for every half-edge once. Modifies the ring."""
    i = wave.counters[RING_HEAD] + wave.counters[RING_SIZE]
    if i >= wave.sizes.ring:
        i -= wave.sizes.ring
    wave.queues.ring[i] = h
    wave.counters[RING_SIZE] += 1


@kernel
def ring_pop(wave: View) -> int:
    """Remove and return the oldest half-edge; the ring must not be empty. Modifies the ring."""
    head = wave.counters[RING_HEAD]
    h = wave.queues.ring[head]
    head += 1
    wave.counters[RING_HEAD] = head if head < wave.sizes.ring else 0
    wave.counters[RING_SIZE] -= 1
    return h
