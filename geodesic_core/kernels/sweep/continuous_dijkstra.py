"""The continuous-Dijkstra loop (section 3.4), resumable in slices."""

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import (
    ADDED,
    FREE_SIZE,
    FRESH,
    HEAP_SIZE,
    RING_HEAD,
    RING_SIZE,
    SETTLED_VERTICES,
    WORK,
)
from geodesic_core.kernels.front.pool import free_windows
from geodesic_core.kernels.front.pruning import touch
from geodesic_core.kernels.front.queues import pop_nearest, ring_pop
from geodesic_core.kernels.front.sites import reach_inside, start_from
from geodesic_core.kernels.front.state import (
    FAR,
    FRONT,
    IN_RING,
    LIST,
    MARKS,
    SEEN,
    SETTLED,
    SIZE,
    View,
    Wavefront,
    view_of,
)
from geodesic_core.kernels.front.window_lists import queue_list
from geodesic_core.kernels.jit import inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    AROUND,
    HEAD,
    IRREGULAR,
    OUT_LEFT,
    OUT_RIGHT,
    PINCHED,
    ROW,
    SEAM,
    Topology,
    faces_beyond,
    following,
    previous,
)
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep.delivery import DELIVERY
from geodesic_core.kernels.sweep.further_sources import queue_waiting
from geodesic_core.kernels.sweep.propagation import propagate_list
from geodesic_core.kernels.sweep.pseudosources import emit_pseudosource, is_pseudosource

WORK_OF_VERTEX = 30  # units, as in `propagation`


@kernel
def start_sweep(
    topology: Topology,
    wavefront: Wavefront,
    sources: Ints,
    source_indices: Ints,
    start_distances: Floats,
    bounds: Bounds,
) -> None:
    """Reach the nodes of the sources; sites and segments among them emit their windows.

    Arguments as in `start_from`. Modifies the wavefront.
    """
    wave = view_of(topology, wavefront, bounds)
    start_from(wave, sources, source_indices, start_distances, DELIVERY)


@kernel
def reach_sites_inside(
    topology: Topology, wavefront: Wavefront, bounds: Bounds, first: int
) -> None:
    """Offer the sites from row ``first`` on the paths that cross no edge, after the sweep."""
    reach_inside(view_of(topology, wavefront, bounds), first, DELIVERY)


@kernel
def advance(topology: Topology, wavefront: Wavefront, bounds: Bounds, budget: int) -> Outcome:
    """Run the sweep for a slice of work, see `run`. Modifies the wavefront."""
    return run(view_of(topology, wavefront, bounds), budget)


@kernel
def run(wave: View, budget: int) -> Outcome:
    """Run the sweep for a slice of about ``budget`` units of 10 ns; return its outcome (3.4).

    Lists in the ring come first; then, again and again, the nearest vertex is settled and the ring
    drained. A slice that ends for want of room has changed nothing since its last whole step.
    Modifies the wavefront.

    Windows wholly beyond ``max_distance`` are dropped. Vertices beyond it are reached all the same,
    and settled while windows are left, for a list waits for an end of its edge, and windows between
    two far ends may be near; the caller takes their distances away.
    """
    wave.counters[WORK] = 0
    outcome = drain(wave, budget)
    while outcome == Outcome.FINISHED and is_unfinished(wave):
        if wave.counters[WORK] >= budget:
            return Outcome.RUNNING
        if wave.counters[HEAP_SIZE] > 0:
            outcome = settle_nearest(wave)
        if outcome == Outcome.FINISHED:
            outcome = drain(wave, budget)
    return outcome


@inlined
def is_unfinished(wave: View) -> bool:
    """Whether vertices are to be settled, or else lists propagated that still waited."""
    counters = wave.counters
    if counters[HEAP_SIZE] > 0:
        # Neither a window nor a vertex that is left is within the limit.
        is_over = counters[FRESH] == counters[FREE_SIZE] and (
            wave.queues.heap_keys[0] > wave.bounds.max_distance
        )
        return not is_over
    return counters[ADDED] > 0 and queue_waiting(wave) > 0


@kernel
def settle_nearest(wave: View) -> Outcome:
    """Settle the nearest vertex: emit its windows, queue the lists around it.

    Modifies the vertex, its neighbours and their lists.
    """
    mesh, queues, vertices = wave.mesh, wave.queues, wave.vertices
    v = queues.heap[0]
    emits = is_pseudosource(wave, v)
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    if emits and room_to_emit(wave, v) > free_windows(wave):
        return Outcome.POOL_FULL
    pop_nearest(wave.queues, wave.counters)
    if wave.counters[HEAP_SIZE] > 0:
        prefetch_around(wave, queues.heap[0])
    if vertices.status[v] != SETTLED:
        vertices.status[v] = SETTLED
        wave.counters[SETTLED_VERTICES] += 1
    wave.counters[WORK] += WORK_OF_VERTEX
    if emits:
        emit_pseudosource(wave, v)
    for c in range(first, last):
        row = ROW * mesh.corners[c]
        mark_front(wave, mesh.links[row + HEAD])
        if mesh.links[row + OUT_LEFT] < 0:
            mark_front(wave, mesh.links[row + APEX])
        prefetch(wave.pool.lists, LIST * max(mesh.links[row + OUT_RIGHT], 0))
    for c in range(first, last):
        h = mesh.corners[c]
        queue_list(wave, h)
        queue_list(wave, previous(h))
        across = mesh.links[ROW * h + OUT_RIGHT]
        if across >= 0 and wave.pool.lists[LIST * across + SIZE] > 0:
            far = mesh.links[ROW * across + APEX]
            if vertices.status[far] >= FRONT:
                queue_list(wave, across)
        elif across == IRREGULAR:
            queue_lists_beyond(wave, following(h))
    return Outcome.FINISHED


@kernel
def room_to_emit(wave: View, v: int) -> int:
    """Return how many windows v may emit, at most."""
    mesh = wave.mesh
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    room = 6 * (last - first)
    if mesh.flags[v] & (SEAM | PINCHED):
        for c in range(first, last):
            h = mesh.corners[c]
            if mesh.links[ROW * h + OUT_RIGHT] == IRREGULAR:
                room += 2 * faces_beyond(mesh.links, following(h))
    return room


@kernel
def queue_lists_beyond(wave: View, g: int) -> None:
    """Queue the lists beyond the irregular edge of g whose far vertex is in front, or settled."""
    mesh = wave.mesh
    h = mesh.links[ROW * g + AROUND] >> 1
    while h != g:
        if wave.vertices.status[mesh.links[ROW * h + APEX]] >= FRONT:
            queue_list(wave, h)
        h = mesh.links[ROW * h + AROUND] >> 1


@inlined
def prefetch_around(wave: View, v: int) -> None:
    """Prefetch the rows around the vertex that will probably be next."""
    mesh, heap = wave.mesh, wave.queues.heap
    for i in range(1, min(5, wave.counters[HEAP_SIZE])):
        prefetch(mesh.corners, mesh.first_corner[heap[i]])
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h = mesh.corners[c]
        prefetch(mesh.links, ROW * h)
        prefetch(mesh.geometry, ROW * h)
        prefetch(wave.pool.lists, LIST * h)


@kernel
def mark_front(wave: View, v: int) -> None:
    """Mark v as a neighbour of a settled vertex. Modifies its status."""
    vertices = wave.vertices
    if vertices.status[v] == FAR:
        touch(wave, v)
    if vertices.status[v] == SEEN:
        vertices.status[v] = FRONT


@kernel
def drain(wave: View, budget: int) -> Outcome:
    """Propagate the lists in the ring, and those that they queue, until it is empty."""
    while wave.counters[RING_SIZE] > 0:
        if wave.counters[WORK] >= budget:
            return Outcome.RUNNING
        h = wave.queues.ring[wave.counters[RING_HEAD]]
        outcome = propagate_list(wave, h)
        if outcome != Outcome.FINISHED:
            return outcome
        ring_pop(wave)
        wave.pool.lists[LIST * h + MARKS] &= ~IN_RING
    return Outcome.FINISHED
