"""The continuous-Dijkstra loop (section 3.4), resumable in slices."""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
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
    following,
    previous,
)
from geodesic_core.kernels.sweep.propagation import POOL_FULL, PROPAGATED, propagate_list
from geodesic_core.kernels.sweep.pruning import touch
from geodesic_core.kernels.sweep.pseudosources import emit_pseudosource, is_pseudosource
from geodesic_core.kernels.sweep.queues import (
    HEAP_SIZE,
    RING_HEAD,
    RING_SIZE,
    pop_nearest,
    ring_pop,
)
from geodesic_core.kernels.sweep.relaxation import bound_vertex, relax_vertex
from geodesic_core.kernels.sweep.segments import emit_segment
from geodesic_core.kernels.sweep.state import (
    ENTRY_EDGE,
    FAR,
    FRONT,
    IN_RING,
    LIST,
    MARKS,
    NODE,
    PREDECESSOR,
    SEGMENT,
    SETTLED,
    SETTLED_VERTICES,
    SITE,
    SIZE,
    WINNER,
    WORK,
    merging,
    view_of,
)
from geodesic_core.kernels.sweep.surface_points import emit_site
from geodesic_core.kernels.sweep.window_lists import faces_beyond, free_windows, queue_list

# Outcomes of a slice; those of `propagate` are the others
FINISHED = 3
RUNNING = 4


@kernel
def start_sweep(
    topology: Any,
    wavefront: Any,
    sources: Ints,
    origins: Ints,
    start_distances: Floats,
    bounds: Any,
) -> None:
    """Reach the nodes of the sources; sites and pieces among them emit their windows.

    ``origins`` are the sources that the nodes belong to, of which each has a start distance.
    """
    wave = view_of(topology, wavefront, bounds)
    vertices, sites = wave.vertices, wave.sites
    for i in range(len(sources)):
        v, start = sources[i], start_distances[origins[i]]
        if start >= vertices.distance[v]:
            continue
        vertices.source_index[v] = origins[i]
        if v < wave.sizes.vertices:
            if merging(wave):
                bound_vertex(wave, v, start)
            relax_vertex(wave, v, start, -1, 0.0, 0.0, v, -1 - v)
        else:
            vertices.distance[v], vertices.winner_ints[WINNER * v + PREDECESSOR] = (
                start,
                v,
            )
    for k in range(wave.sizes.sites):
        if vertices.distance[sites.ints[SITE * k + NODE]] < math.inf:
            emit_site(wave, k)
    if len(wave.bounds.parallel) > 0:
        for k in range(wave.sizes.segments):
            if vertices.distance[sites.segment_ints[SEGMENT * k + NODE]] < math.inf:
                emit_segment(wave, k)


@kernel
def advance(topology: Any, wavefront: Any, bounds: Any, budget: int) -> int:
    """Run the sweep for a slice of about ``budget`` units of 10 ns; return its outcome.

    Windows wholly beyond ``max_distance`` are dropped. Vertices beyond it are reached and settled
    all the same, for a list waits for an end of its edge, and windows between two far ends may be
    near; the caller takes their distances away.
    """
    wave = view_of(topology, wavefront, bounds)
    wave.counters[WORK] = 0
    outcome = drain(wave, budget)
    while outcome == FINISHED and wave.counters[HEAP_SIZE] > 0:
        if wave.counters[WORK] >= budget:
            return RUNNING
        outcome = settle_nearest(wave)
        if outcome == FINISHED:
            outcome = drain(wave, budget)
    return outcome


@kernel
def settle_nearest(wave: Any) -> int:
    """Take the nearest vertex: emit its windows, wake the lists around it."""
    mesh, queues, vertices = wave.mesh, wave.queues, wave.vertices
    v = queues.heap[0]
    emits = is_pseudosource(wave, v)
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    if emits and room_to_emit(wave, v) > free_windows(wave):
        return POOL_FULL
    pop_nearest(wave)
    if wave.counters[HEAP_SIZE] > 0:
        ask_ahead(wave, queues.heap[0])
    if vertices.status[v] != SETTLED:
        vertices.status[v] = SETTLED
        wave.counters[SETTLED_VERTICES] += 1
    wave.counters[WORK] += 30
    if emits:
        emit_pseudosource(wave, v)
    for c in range(first, last):
        row = ROW * mesh.corners[c]
        mark_front(wave, mesh.links[row + HEAD])
        if mesh.links[row + OUT_LEFT] < 0:
            mark_front(wave, mesh.links[row + APEX])
    for c in range(first, last):
        h = mesh.corners[c]
        queue_list(wave, h)
        queue_list(wave, previous(h))
        across = mesh.links[ROW * h + OUT_RIGHT]
        if across >= 0 and wave.pool.lists[LIST * across + SIZE] > 0:
            far = mesh.links[ROW * across + APEX]
            if vertices.status[far] != FAR:
                queue_list(wave, across)
        elif across == IRREGULAR:
            queue_lists_beyond(wave, following(h))
    return FINISHED


@kernel
def room_to_emit(wave: Any, v: int) -> int:
    """How many windows v may emit, at most."""
    mesh = wave.mesh
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    room = 6 * (last - first)
    if mesh.flags[v] & (SEAM | PINCHED):
        for c in range(first, last):
            h = mesh.corners[c]
            if mesh.links[ROW * h + OUT_RIGHT] == IRREGULAR:
                room += 2 * faces_beyond(wave, following(h))
    return room


@kernel
def queue_lists_beyond(wave: Any, g: int) -> None:
    """Queue the lists beyond the irregular edge of g whose far vertex is in front, or done."""
    mesh = wave.mesh
    h = mesh.links[ROW * g + AROUND] >> 1
    while h != g:
        if wave.vertices.status[mesh.links[ROW * h + APEX]] != FAR:
            queue_list(wave, h)
        h = mesh.links[ROW * h + AROUND] >> 1


@inlined
def ask_ahead(wave: Any, v: int) -> None:
    """Ask for the rows around the vertex that will probably be next: 3 to 6 % of a sweep."""
    mesh = wave.mesh
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h = mesh.corners[c]
        prefetch(mesh.links, ROW * h)
        prefetch(mesh.geometry, ROW * h)
        prefetch(wave.pool.lists, LIST * h)


@kernel
def mark_front(wave: Any, v: int) -> None:
    """Mark a neighbour of a vertex that is done."""
    vertices = wave.vertices
    if vertices.status[v] == FAR:
        if vertices.distance[v] == math.inf:
            touch(wave, v)
        vertices.status[v] = FRONT


@kernel
def drain(wave: Any, budget: int) -> int:
    """Propagate the lists in the ring, and what they wake, until it is empty."""
    while wave.counters[RING_SIZE] > 0:
        if wave.counters[WORK] >= budget:
            return RUNNING
        h = wave.queues.ring[wave.counters[RING_HEAD]]
        outcome = propagate_list(wave, h)
        if outcome != PROPAGATED:
            return outcome
        ring_pop(wave)
        wave.pool.lists[LIST * h + MARKS] &= ~IN_RING
    return FINISHED


@kernel
def nearest_sources(distance: Floats, winner_ints: Ints, origin: Ints) -> Ints:
    """Return for each vertex at a finite distance the index of its pseudosource's source.

    Asked at the end: a pseudosource may have changed its own source after it emitted.
    """
    result = np.full(len(distance), -1, np.int32)
    for start in range(len(distance)):
        if distance[start] == math.inf:
            continue
        v = start
        while result[v] < 0 and winner_ints[v, ENTRY_EDGE] >= 0:
            v = winner_ints[v, PREDECESSOR]
        found = result[v] if result[v] >= 0 else origin[v]
        v = start
        while result[v] < 0:
            result[v] = found
            v = winner_ints[v, PREDECESSOR]
    return result
