"""Rows of a table by fast sweeps."""

import math

from geodesic_core.kernels.fast.emission import DELIVERY
from geodesic_core.kernels.fast.sweep import run
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import COUNTERS, FAR_FIRST, FREE_FIRST, TOUCHED
from geodesic_core.kernels.front.rows import Kind, Rows, advance
from geodesic_core.kernels.front.state import ENTRY_EDGE, PREDECESSOR, View, Wavefront
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.outcome import Outcome


@kernel
def advance_rows(
    topology: Topology, wavefront: Wavefront, bounds: Bounds, rows: Rows, budget: int
) -> Outcome:
    """Sweep row after row, see `front.rows.advance`. Modifies the wavefront and the rows."""
    return advance(topology, wavefront, bounds, rows, budget, KIND)


@kernel
def first_site(wave: View, face: int) -> int:
    """Return the row of the first site to reach in a face, or -1."""
    return int(wave.places.first_site[face]) if wave.sizes.first_site > 0 else -1


@kernel
def forget(topology: Topology, wavefront: Wavefront) -> None:
    """Reset what a sweep that has finished touched, but for sites. Modifies the wavefront.

    Windows were offered only to half-edges both of whose ends it had reached.
    """
    places, vertices = wavefront.places, wavefront.vertices
    count = wavefront.counters[TOUCHED]
    is_whole = 2 * count > len(topology.total_angle)
    if is_whole:  # in the order of memory
        places.at_large[:] = 0
        places.values[:] = math.inf
    for i in range(count):
        v = vertices.touched[i]
        vertices.distance[v] = math.inf
        vertices.winner_ints[v, ENTRY_EDGE] = vertices.winner_ints[v, PREDECESSOR] = -1
        if is_whole:
            continue
        for c in range(topology.first_corner[v], topology.first_corner[v + 1]):
            h = topology.corners[c]
            places.at_large[h] = 0
            for k in range(places.per_edge):
                places.values[h, k] = math.inf
    for i in range(COUNTERS):
        wavefront.counters[i] = 0
    wavefront.counters[FREE_FIRST] = wavefront.counters[FAR_FIRST] = -1


KIND = Kind(DELIVERY, run, first_site, forget)
