"""Sites as targets of a sweep: reached as the apex of a face is, by the windows that cross it."""

from geodesic_core.arrays import Ints
from geodesic_core.kernels.front.relaxation import relax_node
from geodesic_core.kernels.front.sites import way_through
from geodesic_core.kernels.front.state import (
    FACE,
    LIST,
    MARKS,
    NEXT_SITE,
    NODE,
    SITE,
    SITE_SHIFT,
    View,
)
from geodesic_core.kernels.front.window import load_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, ROW, weights_in_frame
from geodesic_core.tolerances import GAP


@kernel
def watch_sites(sites: Ints, lists: Ints, first: int) -> None:
    """Have the sites from row ``first`` on reached by the windows that cross their faces.

    ``sites`` (S, 3) and ``lists`` (3F, 4) are those of `Sites` and `Pool`; modifies NEXT_SITE of
    the first and MARKS of the second.
    """
    for k in range(first, len(sites)):
        face = sites[k, FACE]
        sites[k, NEXT_SITE] = (lists[3 * face, MARKS] >> SITE_SHIFT) - 1
        for h in range(3 * face, 3 * face + 3):
            others = lists[h, MARKS] & ((1 << SITE_SHIFT) - 1)
            lists[h, MARKS] = others | (k + 1) << SITE_SHIFT


@kernel
def reach_sites(wave: View, h: int, count: int) -> None:
    """Offer the sites in the face of h the windows of scratch."""
    k = (wave.pool.lists[LIST * h + MARKS] >> SITE_SHIFT) - 1
    while k >= 0:
        reach_site(wave, h, count, k)
        k = wave.sites.ints[SITE * k + NEXT_SITE]


@kernel
def reach_site(wave: View, h: int, count: int, k: int) -> None:
    """Offer the site of row k the nearest of the windows of scratch. Modifies its node.

    Unlike an apex it tries them all: it has no neighbours that would make up for a gap.
    """
    mesh, sites = wave.mesh, wave.sites
    node = sites.ints[SITE * k + NODE]
    x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
    gap = GAP * mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        window = load_window(wave, wave.pool.scratch, i)
        there = way_through(window, x, y, gap)
        relax_node(wave, node, there, h, window)
