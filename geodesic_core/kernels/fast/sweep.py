"""The loop of a fast sweep: bucket after bucket, until no window waits. Resumable in slices."""

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.fast.buckets import first_waiting, pop
from geodesic_core.kernels.fast.crossing import cross, room_to_cross
from geodesic_core.kernels.fast.emission import DELIVERY, emit_around, room_around
from geodesic_core.kernels.fast.state import BUCKET_ENDS, BUCKETS, FIRST
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import CURRENT, WORK
from geodesic_core.kernels.front.pool import free_window, free_windows
from geodesic_core.kernels.front.sites import reach_inside, start_from
from geodesic_core.kernels.front.state import WIDTH, View, Wavefront, view_of
from geodesic_core.kernels.front.window import HALF_EDGE, INTS, SIGMA
from geodesic_core.kernels.jit import as_ints, inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import APEX, OUT_LEFT, OUT_RIGHT, ROW, Topology
from geodesic_core.kernels.outcome import Outcome


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

    Arguments as in `start_from`. Modifies the wavefront, which must have room for a window for each
    source and for those of its sites.
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
    """Cross edges with ``budget`` windows, or with all that wait; return the outcome.

    A slice that ends for want of room has changed nothing since its last whole step. Modifies the
    wavefront.
    """
    rows, counters = wave.pool.windows, wave.counters
    counters[WORK] = 0
    slot = first_waiting(wave)
    while slot >= 0:
        if counters[WORK] >= budget:
            return Outcome.RUNNING
        counters[WORK] += 1
        h = int(as_ints(rows)[INTS * slot + HALF_EDGE])
        if h >= 0:
            if room_to_cross(wave, h) > free_windows(wave):
                return Outcome.POOL_FULL
            pop(wave, slot)
            prefetch_next(wave)
            cross(wave, h, slot)
        else:
            v = -1 - h
            if room_around(wave, v) > free_windows(wave):
                return Outcome.POOL_FULL
            pop(wave, slot)
            if rows[WIDTH * slot + SIGMA] == wave.vertices.distance[v]:
                emit_around(wave, v)
        free_window(wave, slot)
        slot = first_waiting(wave)
    return Outcome.FINISHED


@inlined
def prefetch_next(wave: View) -> None:
    """Prefetch what the window that is probably next will be compared with."""
    mesh, places, count = wave.mesh, wave.places, wave.places.per_edge
    slot = places.buckets[BUCKET_ENDS * (wave.counters[CURRENT] & (BUCKETS - 1)) + FIRST]
    h = -1
    if slot >= 0:
        h = int(as_ints(wave.pool.windows)[INTS * slot + HALF_EDGE])
    if h >= 0:
        links = ROW * h
        prefetch(places.values, count * h)
        prefetch(places.values, count * max(mesh.links[links + OUT_LEFT], 0))
        prefetch(places.values, count * max(mesh.links[links + OUT_RIGHT], 0))
        prefetch(wave.vertices.distance, int(mesh.links[links + APEX]))
