"""Windows offered to a half-edge, and nodes offered a distance: what is nearer goes on."""

import math
from typing import Any

from geodesic_core.kernels.fast.buckets import push
from geodesic_core.kernels.fast.state import REACHED
from geodesic_core.kernels.front.relaxation import precedence
from geodesic_core.kernels.front.state import ENTRY_EDGE, PREDECESSOR, WINNER
from geodesic_core.kernels.front.window import (
    Window,
    distance_at,
    emitted_window,
    reversed_window,
)
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    AROUND,
    FANS,
    HEAD,
    IRREGULAR,
    LENGTH,
    PINCHED,
    ROW,
    SEAM,
    TAIL,
)
from geodesic_core.tolerances import FAR_NEARER, MOST_AT_LARGE, TIE

AT_LARGE = 1 << 8  # bit of WON: the window is far nearer somewhere between the places


@inlined
def distance_along(window: Window, x: float) -> float:
    """Distance at (x, 0): beyond the window's ends, over the nearer of them and along the edge."""
    end = min(max(x, window.b0), window.b1)
    return distance_at(window, end) + abs(x - end)


@inlined
def least_known(wave: Any, h: int, twin: int, k: int) -> float:
    """Return the distance that a window offered to h must be below to win its place of number k.

    ``twin`` is the half-edge of the same edge that the window leaves by, or -1: one that is no
    nearer than another that went the other way there goes back.
    """
    values, places = wave.front.values, wave.bounds.places
    least = values[places * h + k] * (1.0 - TIE)
    if twin >= 0:
        least = min(least, values[places * twin + places - 1 - k])
    return float(least)


@kernel
def offer(wave: Any, h: int, twin: int, length: float, window: Window) -> None:
    """Offer a window to h, of this length; it waits if it is the nearest at any place.

    ``twin`` as in `least_known`. Modifies values, pool and buckets.
    """
    won, key = 0, math.inf
    step = length / wave.bounds.places
    for k in range(wave.bounds.places):
        distance = distance_along(window, step * (k + 0.5))
        if distance < least_known(wave, h, twin, k):
            wave.front.values[wave.bounds.places * h + k] = distance
            won |= 1 << k
            key = min(key, distance)
    if won == 0 and is_far_nearer(wave, h, length, window):
        won, key = AT_LARGE, distance_at(window, 0.5 * (window.b0 + window.b1))
        wave.front.at_large[h] += 1
    if won and key <= wave.bounds.max_distance:
        push(wave, h, window, won, key)


@inlined
def is_far_nearer(wave: Any, h: int, length: float, window: Window) -> bool:
    """Whether a window is far nearer, at its middle, than all that is known of the edge of h.

    Beside a source, and on slivers, distances along an edge differ by far more than between edges
    elsewhere: a few windows may go on without a place there.
    """
    front, links, row = wave.front, wave.mesh.links, ROW * h
    x = 0.5 * (window.b0 + window.b1)
    most = distance_at(window, x) * FAR_NEARER
    if most >= front.distance[links[row + TAIL]] + x:
        return False
    if most >= front.distance[links[row + HEAD]] + length - x:
        return False
    places = wave.bounds.places
    for k in range(places):
        if most >= front.values[places * h + k] + abs(x - length / places * (k + 0.5)):
            return False
    return bool(front.at_large[h] < MOST_AT_LARGE)


@inlined
def offer_end(wave: Any, h: int, twin: int, length: float, root: int, is_tail: bool) -> None:
    """Offer h its own tail, or its head, as a pseudosource; as `offer` does."""
    sigma, end = wave.front.distance[root], 0.0 if is_tail else length
    won, key = 0, math.inf
    step = length / wave.bounds.places
    for k in range(wave.bounds.places):
        distance = sigma + abs(step * (k + 0.5) - end)
        if distance < least_known(wave, h, twin, k):
            wave.front.values[wave.bounds.places * h + k] = distance
            won |= 1 << k
            key = min(key, distance)
    if won and key <= wave.bounds.max_distance:
        push(wave, h, emitted_window(wave, 0.0, length, end, 0.0, sigma, root, 0.0), won, key)


@kernel
def offer_around(wave: Any, g: int, window: Window) -> None:
    """Offer a window that leaves a face by g to each other half-edge of that irregular edge.

    It is in the frame of a half-edge that runs the other way than g.
    """
    mesh = wave.mesh
    length = mesh.geometry[ROW * g + LENGTH]
    h = int(mesh.links[ROW * g + AROUND] >> 1)
    while h != g:
        seen = window
        if mesh.links[ROW * h + TAIL] == mesh.links[ROW * g + TAIL]:
            seen = reversed_window(window, length)
        offer(wave, h, -1, length, seen)
        h = int(mesh.links[ROW * h + AROUND] >> 1)


@inlined
def offer_over(wave: Any, out: int, g: int, length: float, window: Window) -> None:
    """Offer a window that leaves a face by its half-edge g to ``out``, across that edge.

    The frame is as in `offer_around`; ``out`` may be NO_FACE, or IRREGULAR.
    """
    if out >= 0:
        offer(wave, out, g, length, window)
    elif out == IRREGULAR:
        offer_around(wave, g, window)


@inlined
def relax(
    wave: Any, node: int, distance: float, via: int, sx: float, sy: float, root: int, x: float
) -> None:
    """Offer a node a distance, over (x, 0) on ``via`` from the pseudosource ``root`` at (sx, sy).

    Ties go to the lower source. A vertex where several fans meet is to emit all around: windows
    that turn about it stay in their fan. Modifies the node, pool and buckets.
    """
    front = wave.front
    known = front.distance[node]
    if distance > known * (1.0 + TIE):
        return
    own, others = front.source_index[root], front.source_index[node]
    if not precedence(distance, own, known, others):
        return
    front.winner[2 * node], front.winner[2 * node + 1] = sx, sy
    front.winner_ints[WINNER * node + ENTRY_EDGE] = via
    front.winner_ints[WINNER * node + PREDECESSOR] = root
    front.crossing[node] = x
    front.source_index[node] = own
    if distance < known:
        front.distance[node] = distance
        if node < wave.sizes.vertices:
            if known == math.inf:
                front.counters[REACHED] += 1
            if wave.mesh.flags[node] & (FANS | SEAM | PINCHED):
                push_vertex(wave, node)


@kernel
def push_vertex(wave: Any, v: int) -> None:
    """Have a vertex wait to emit windows all around. Modifies pool and buckets."""
    distance = wave.front.distance[v]
    if distance <= wave.bounds.max_distance:
        push(wave, -1 - v, emitted_window(wave, 0.0, 0.0, 0.0, 0.0, distance, v, 0.0), 0, distance)
