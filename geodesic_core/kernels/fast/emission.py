"""Windows that vertices emit, and what becomes of those that sources emit."""

import math

from geodesic_core.kernels.fast.places import note_reached, offer_over, push_vertex, relax
from geodesic_core.kernels.front.sites import Delivery
from geodesic_core.kernels.front.state import PREDECESSOR, WINNER, View
from geodesic_core.kernels.front.window import Window, emitted_window
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_RIGHT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_RIGHT,
    faces_beyond,
    following,
    previous,
)
from geodesic_core.tolerances import FLAT


@kernel
def room_around(wave: View, v: int) -> int:
    """Return how many windows v may emit, with those of the vertices that it reaches, at most."""
    mesh = wave.mesh
    first, last = mesh.first_corner[v], mesh.first_corner[v + 1]
    room = 3 * (last - first)
    for c in range(first, last):
        if mesh.links[ROW * mesh.corners[c] + OUT_RIGHT] == IRREGULAR:
            room += faces_beyond(mesh.links, following(mesh.corners[c]))
    return room


@kernel
def emit_around(wave: View, v: int) -> None:
    """Emit into every face at v, and along its edges. Modifies the wavefront."""
    mesh, sigma = wave.mesh, wave.vertices.distance[v]
    for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
        h = mesh.corners[c]
        row, before = ROW * h, previous(h)  # whose apex is the head of h
        length, reach = mesh.geometry[row + LENGTH], mesh.geometry[row + LENGTH_RIGHT]
        place = mesh.geometry[ROW * before + LENGTH]
        reach_straight(wave, mesh.links[row + HEAD], length, before, place, 0.0, v)
        if mesh.links[row + OUT_LEFT] < 0:
            last = mesh.geometry[row + LENGTH_LEFT]
            reach_straight(wave, mesh.links[row + APEX], last, h, 0.0, 0.0, v)
        sx = reach - mesh.geometry[row + COS_RIGHT] * length
        # In a face of no area v lies on the edge across, from where no ray would leave.
        sy = min(-mesh.geometry[row + SIN_RIGHT] * length, -FLAT * reach)
        window = emitted_window(wave, 0.0, reach, sx, sy, sigma, v, 0.0)
        send_out(wave, mesh.links[row + OUT_RIGHT], following(h), window)


@kernel
def start_at(wave: View, v: int, start: float) -> None:
    """Reach a vertex as a source, whose index it has already. Modifies the vertex and the pool."""
    vertices = wave.vertices
    if vertices.distance[v] == math.inf:
        note_reached(wave, v)
    vertices.distance[v] = start
    vertices.winner_ints[WINNER * v + PREDECESSOR] = v
    push_vertex(wave, v)


@kernel
def reach_straight(
    wave: View, node: int, reach: float, via: int, sx: float, sy: float, root: int
) -> None:
    """Offer a node the straight way from a root at (sx, sy): a vertex of its face, or inside.

    Modifies the wavefront.
    """
    x = sx if root < wave.sizes.vertices else math.nan
    relax(wave, node, wave.vertices.distance[root] + reach, via, sx, sy, root, x)


@kernel
def send_out(wave: View, out: int, g: int, window: Window) -> None:
    """Offer a window that leaves a face by its half-edge g to ``out``, across that edge."""
    offer_over(wave, out, g, wave.mesh.geometry[ROW * g + LENGTH], window)


DELIVERY = Delivery(start_at, reach_straight, send_out)
