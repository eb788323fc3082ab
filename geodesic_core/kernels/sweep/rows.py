"""Rows of a table by exact or merging sweeps."""

from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.pruning import forget_vertices
from geodesic_core.kernels.front.rows import Kind, Rows, advance
from geodesic_core.kernels.front.state import LIST, MARKS, SITE_SHIFT, View, Wavefront
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep.continuous_dijkstra import run
from geodesic_core.kernels.sweep.delivery import DELIVERY


@kernel
def advance_rows(
    topology: Topology, wavefront: Wavefront, bounds: Bounds, rows: Rows, budget: int
) -> Outcome:
    """Sweep row after row, see `front.rows.advance`. Modifies the wavefront and the rows."""
    return advance(topology, wavefront, bounds, rows, budget, KIND)


@kernel
def first_site(wave: View, face: int) -> int:
    """Return the row of the first site to reach in a face, or -1."""
    return int(wave.pool.lists[LIST * 3 * face + MARKS] >> SITE_SHIFT) - 1


KIND = Kind(DELIVERY, run, first_site, forget_vertices)
