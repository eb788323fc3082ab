"""Delivery of windows and nodes: what an exact or merging sweep does with what it is offered."""

from geodesic_core.kernels.front.counters import CREATED
from geodesic_core.kernels.front.directions import seen_in_mirror
from geodesic_core.kernels.front.pool import free_window, put_window
from geodesic_core.kernels.front.relaxation import bound_vertex, illuminate_vertex, relax_node
from geodesic_core.kernels.front.sites import Delivery
from geodesic_core.kernels.front.state import View, merging, source_weight
from geodesic_core.kernels.front.window import (
    Window,
    is_beyond,
    load_window,
    ray_from,
    referring_to,
    reversed_window,
)
from geodesic_core.kernels.front.window_lists import insert_sorted, queue_if_due
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    AROUND,
    HEAD,
    IRREGULAR,
    LENGTH,
    NO_FACE,
    OUT_LEFT,
    ROW,
    TAIL,
    following,
)
from geodesic_core.kernels.sweep.irregular_edges import record_crossing, trim_against_crossings


@kernel
def start_at(wave: View, v: int, start: float) -> None:
    """Reach a vertex as a source, whose index it has already. Modifies the vertex and the heap."""
    if merging(wave):
        bound_vertex(wave, v, start)
    relax_node(wave, v, start, -1, ray_from(wave, 0.0, 0.0, v))


@kernel
def reach_straight(
    wave: View, node: int, reach: float, via: int, sx: float, sy: float, root: int
) -> None:
    """Offer a node the straight way of this length from ``root``, at (sx, sy) in the frame of via.

    Modifies the node and the heap.
    """
    vertices = wave.vertices
    distance = vertices.distance[root] + reach
    if merging(wave) and node < wave.sizes.vertices:
        upper = vertices.upper[root] if root < wave.sizes.vertices else vertices.distance[root]
        bound_vertex(wave, node, upper + reach)
        if wave.mesh.flags[node]:
            illuminate_vertex(wave, node, distance, via, sx, sy, source_weight(wave, root))
    relax_node(wave, node, distance, via, ray_from(wave, sx, sy, root))


@inlined
def send_out(wave: View, out: int, g: int, window: Window) -> None:
    """Send a window that leaves a face by its half-edge g to ``out``, across that edge.

    Modifies the lists beyond it.
    """
    if out == NO_FACE or is_beyond(wave, window):
        return
    mesh = wave.mesh
    wave.counters[CREATED] += 1
    slot = put_window(wave, window)
    if mesh.links[ROW * following(g) + OUT_LEFT] == IRREGULAR:
        send_across(wave, g, slot)
        return
    insert_sorted(wave, out, slot)
    queue_if_due(wave, out, mesh.links[ROW * g + TAIL], mesh.links[ROW * g + HEAD])


@kernel
def send_across(wave: View, g: int, slot: int) -> None:
    """Move a window over the irregular edge of g, which it leaves, into each other of its faces.

    It comes in the frame of a half-edge that runs the other way than g; where one runs the same
    way, its face is seen in the mirror. Modifies the lists and the crossing history.
    """
    mesh, rows = wave.mesh, wave.pool.windows
    wave.counters[CREATED] -= 1
    passes, window = trim_against_crossings(wave, g, load_window(wave, rows, slot))
    if not passes:
        free_window(wave, slot)
        return
    onward = window if merging(wave) else referring_to(window, slot)
    h = mesh.links[ROW * g + AROUND] >> 1
    while h != g:
        copy = onward
        if mesh.links[ROW * h + TAIL] == mesh.links[ROW * g + TAIL]:
            copy = reversed_window(onward, mesh.geometry[ROW * g + LENGTH])
            copy = seen_in_mirror(wave, copy)
        insert_sorted(wave, h, put_window(wave, copy))
        wave.counters[CREATED] += 1
        queue_if_due(wave, h, mesh.links[ROW * h + TAIL], mesh.links[ROW * h + HEAD])
        h = mesh.links[ROW * h + AROUND] >> 1
    record_crossing(wave, g, slot, window)


DELIVERY = Delivery(start_at, reach_straight, send_out)
