"""Sources added one by one to a sweep that has finished.

Distances known so far stay: a window that improves no vertex is soon dropped by the filters of its
list, so that a sweep from a new source covers little more than the part that is nearer to it. Only
vertices that it improves are settled. Between two that it does not improve it may pass to one that
it does: there no end of the edge is settled, and the list waits until all else is done.
"""

from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import (
    ADDED,
    RING_SIZE,
    SETTLED_VERTICES,
    TOUCHED,
)
from geodesic_core.kernels.front.state import FAR, View, Wavefront, view_of
from geodesic_core.kernels.front.window_lists import queue_list
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.sweep.delivery import start_at


@kernel
def add_source(
    topology: Topology, wavefront: Wavefront, bounds: Bounds, vertex: int, source_index: int
) -> None:
    """Reach one more source, a vertex, after a sweep that has finished. Modifies the wavefront."""
    wave = view_of(topology, wavefront, bounds)
    for i in range(wave.counters[TOUCHED]):
        reset_around(wave, wave.vertices.touched[i])
    wave.counters[TOUCHED] = wave.counters[SETTLED_VERTICES] = 0
    wave.counters[ADDED] = 1
    wave.vertices.source_index[vertex] = source_index
    start_at(wave, vertex, 0.0)


@kernel
def reset_around(wave: View, v: int) -> None:
    """Make v a vertex that the sweep has not come near; lists of its faces count their runs anew.

    Modifies the status of v and the runs.
    """
    mesh = wave.mesh
    wave.vertices.status[v] = FAR
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        face = mesh.corners[c] // 3
        for h in range(3 * face, 3 * face + 3):
            wave.pool.runs[h] = 0


@kernel
def queue_waiting(wave: View) -> int:
    """Queue the lists that still wait for an end of their edge; return how many there are.

    Windows lie only in faces of touched vertices. Modifies the ring.
    """
    mesh = wave.mesh
    for i in range(wave.counters[TOUCHED]):
        v = wave.vertices.touched[i]
        for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
            face = mesh.corners[c] // 3
            for h in range(3 * face, 3 * face + 3):
                queue_list(wave, h)
    return int(wave.counters[RING_SIZE])
