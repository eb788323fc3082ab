"""The loop of a fast sweep: bucket after bucket, until no window waits. Resumable in slices."""

import math
from typing import Any

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.fast.buckets import first_waiting, free, pop, room
from geodesic_core.kernels.fast.crossing import cross, room_to_cross
from geodesic_core.kernels.fast.emission import (
    emit_around,
    emit_segment,
    emit_site,
    room_around,
)
from geodesic_core.kernels.fast.places import push_vertex
from geodesic_core.kernels.fast.state import (
    BUCKET_ENDS,
    BUCKETS,
    CURRENT,
    FIRST,
    HALF_EDGE,
    REACHED,
    WORK,
    view_of,
)
from geodesic_core.kernels.front.state import NODE, PREDECESSOR, SEGMENT, SITE, WINNER
from geodesic_core.kernels.front.window import INTS, SIGMA, WIDTH
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import APEX, OUT_LEFT, OUT_RIGHT, ROW
from geodesic_core.kernels.outcome import Outcome


@kernel
def start_sweep(
    topology: Any,
    wavefront: Any,
    sources: Ints,
    source_indices: Ints,
    start_distances: Floats,
    bounds: Any,
) -> None:
    """Reach the nodes of the sources; sites and segments among them emit their windows.

    Arguments as in `continuous_dijkstra.start_sweep`. Modifies the wavefront, which must have room
    for a window for each source and for those of its sites.
    """
    wave = view_of(topology, wavefront, bounds)
    front, sites = wave.front, wave.front.sites
    for i in range(len(sources)):
        node, start = sources[i], start_distances[source_indices[i]]
        if start >= front.distance[node]:
            continue
        if node < wave.sizes.vertices and front.distance[node] == math.inf:
            front.counters[REACHED] += 1
        front.distance[node], front.source_index[node] = start, source_indices[i]
        front.winner_ints[WINNER * node + PREDECESSOR] = node
        if node < wave.sizes.vertices:
            push_vertex(wave, node)
    for k in range(wave.sizes.sites):
        if front.distance[sites.ints[SITE * k + NODE]] < math.inf:
            emit_site(wave, k)
    if len(wave.bounds.parallel) > 0:
        for k in range(wave.sizes.segments):
            if front.distance[sites.segment_ints[SEGMENT * k + NODE]] < math.inf:
                emit_segment(wave, k)


@kernel
def advance(topology: Any, wavefront: Any, bounds: Any, budget: int) -> Outcome:
    """Cross edges with ``budget`` windows, or with all that wait; return the outcome.

    A slice that ends for want of room has changed nothing since its last whole step. Modifies the
    wavefront.
    """
    wave = view_of(topology, wavefront, bounds)
    front = wave.front
    ints, counters = as_ints(front.windows), front.counters
    counters[WORK] = 0
    slot = first_waiting(wave)
    while slot >= 0:
        if counters[WORK] >= budget:
            return Outcome.RUNNING
        counters[WORK] += 1
        h = int(ints[INTS * slot + HALF_EDGE])
        if h >= 0:
            if room_to_cross(wave, h) > room(wave):
                return Outcome.POOL_FULL
            pop(wave, slot)
            prefetch_next(wave)
            cross(wave, h, slot)
        else:
            v = -1 - h
            if room_around(wave, v) > room(wave):
                return Outcome.POOL_FULL
            pop(wave, slot)
            if front.windows[WIDTH * slot + SIGMA] == front.distance[v]:
                emit_around(wave, v)
        free(wave, slot)
        slot = first_waiting(wave)
    return Outcome.FINISHED


@inlined
def prefetch_next(wave: Any) -> None:
    """Prefetch what the window that is probably next will be compared with."""
    front, mesh, places = wave.front, wave.mesh, wave.bounds.places
    slot = front.buckets[BUCKET_ENDS * (front.counters[CURRENT] & (BUCKETS - 1)) + FIRST]
    h = -1
    if slot >= 0:
        h = int(as_ints(front.windows)[INTS * slot + HALF_EDGE])
    if h >= 0:
        links = ROW * h
        prefetch(front.values, places * h)
        prefetch(front.values, places * max(mesh.links[links + OUT_LEFT], 0))
        prefetch(front.values, places * max(mesh.links[links + OUT_RIGHT], 0))
        prefetch(front.distance, int(mesh.links[links + APEX]))
