"""Windows offered to a half-edge, and nodes offered a distance: what is nearer goes on."""

import math
from typing import NamedTuple

from geodesic_core.kernels.fast.buckets import push
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.pruning import lower_bound_to_target, may_pass
from geodesic_core.kernels.front.relaxation import precedence, record_winner
from geodesic_core.kernels.front.state import View, is_pruned
from geodesic_core.kernels.front.window import Window, distance_at, emitted_window, reversed_window
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
def least_known(wave: View, h: int, twin: int, k: int) -> float:
    """Return the distance that a window offered to h must be below to win its place of number k.

    ``twin`` is the half-edge of the same edge that the window leaves by, or -1: one that is no
    nearer than another that went the other way there goes back.
    """
    values, places = wave.places.values, wave.places.per_edge
    least = values[places * h + k] * (1.0 - TIE)
    if twin >= 0:
        least = min(least, values[places * twin + places - 1 - k])
    return float(least)


class Bid(NamedTuple):
    """What a window has won of a half-edge."""

    won: int
    """As in WON; 0 for nothing"""
    key: float
    """Its least distance there, mesh units"""


NO_BID = Bid(0, math.inf)


class Offers(NamedTuple):
    """The windows that leave a face over a side, in the frame of the half-edge across."""

    seen: Window
    """What the window that crosses the face lights"""
    is_lit: bool
    """Whether it lights anything"""
    near: Window
    """The end of the side where the half-edge that was crossed is, as a pseudosource"""
    apex: Window
    """The other end of the side"""
    far: Window
    """The other end of the half-edge that was crossed"""
    is_bent: bool
    """Whether the window's ray to the apex passes by that end"""


@inlined
def offer_all(wave: View, h: int, twin: int, length: float, offers: Offers) -> None:
    """Offer windows to h; those wait that hold a place once all have been offered.

    Arguments and effects as in `offer`.
    """
    seen, is_lit, near, apex, far, is_bent = offers
    by_window = bid(wave, h, twin, length, seen) if is_lit else NO_BID
    by_near = bid_of_end(wave, h, twin, length, near)
    by_apex = bid_of_end(wave, h, twin, length, apex)
    by_far = bid(wave, h, twin, length, far) if is_bent else NO_BID
    lost_to_far = by_far.won
    lost_to_apex = lost_to_far | by_apex.won
    wait(wave, h, length, seen, by_window, lost_to_apex | by_near.won)
    wait(wave, h, length, near, by_near, lost_to_apex)
    wait(wave, h, length, apex, by_apex, lost_to_far)
    wait(wave, h, length, far, by_far, 0)


@kernel
def offer(wave: View, h: int, twin: int, length: float, window: Window) -> None:
    """Offer a window to h, of this length; it waits if it is the nearest at any place.

    ``twin`` as in `least_known`. Modifies values, pool and buckets.
    """
    wait(wave, h, length, window, bid(wave, h, twin, length, window), 0)


@inlined
def wait(wave: View, h: int, length: float, window: Window, made: Bid, lost: int) -> None:
    """Have a window wait to cross h, if it has not ``lost`` all that its bid had won.

    Modifies pool and buckets.
    """
    won = made.won & (AT_LARGE | ~lost)
    if won and may_go_on(wave, h, length, made.key):
        push(wave, h, window, won, made.key)


@inlined
def bid(wave: View, h: int, twin: int, length: float, window: Window) -> Bid:
    """Offer a window to the places of h, as `offer` does; return what it wins. Modifies values."""
    won, key = 0, math.inf
    step = length / wave.places.per_edge
    for k in range(wave.places.per_edge):
        distance = distance_along(window, step * (k + 0.5))
        if distance < least_known(wave, h, twin, k):
            wave.places.values[wave.places.per_edge * h + k] = distance
            won |= 1 << k
            key = min(key, distance)
    if won == 0 and is_far_nearer(wave, h, length, window):
        won, key = AT_LARGE, distance_at(window, 0.5 * (window.b0 + window.b1))
        wave.places.at_large[h] += 1
    return Bid(won, key)


@inlined
def may_go_on(wave: View, h: int, length: float, key: float) -> bool:
    """Whether a window is within the limit and, where the sweep is pruned, may be on the way."""
    if not is_pruned(wave):
        return key <= wave.bounds.max_distance
    heuristic, row = wave.vertices.heuristic, ROW * h
    tail, head = wave.mesh.links[row + TAIL], wave.mesh.links[row + HEAD]
    rest = max(heuristic[tail], heuristic[head]) - length
    return key + rest <= wave.bounds.pruning.limit


@inlined
def is_far_nearer(wave: View, h: int, length: float, window: Window) -> bool:
    """Whether a window is far nearer, at its middle, than all that is known of the edge of h.

    Beside a source, and on slivers, distances along an edge differ by far more than between edges
    elsewhere: a few windows may go on without a place there.
    """
    distance, links, row = wave.vertices.distance, wave.mesh.links, ROW * h
    x = 0.5 * (window.b0 + window.b1)
    most = distance_at(window, x) * FAR_NEARER
    if most >= distance[links[row + TAIL]] + x:
        return False
    if most >= distance[links[row + HEAD]] + length - x:
        return False
    places = wave.places.per_edge
    for k in range(places):
        if most >= wave.places.values[places * h + k] + abs(x - length / places * (k + 0.5)):
            return False
    return bool(wave.places.at_large[h] < MOST_AT_LARGE)


@inlined
def bid_of_end(wave: View, h: int, twin: int, length: float, window: Window) -> Bid:
    """Offer the places of h the window of one of its ends, as `bid` does."""
    won, key = 0, math.inf
    step = length / wave.places.per_edge
    for k in range(wave.places.per_edge):
        distance = window.sigma + abs(step * (k + 0.5) - window.sx)
        if distance < least_known(wave, h, twin, k):
            wave.places.values[wave.places.per_edge * h + k] = distance
            won |= 1 << k
            key = min(key, distance)
    return Bid(won, key)


@kernel
def offer_around(wave: View, g: int, window: Window) -> None:
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
def offer_all_around(wave: View, g: int, offers: Offers) -> None:
    """Offer windows that leave a face by its half-edge g to the others, as `offer_around` does."""
    if offers.is_lit:
        offer_around(wave, g, offers.seen)
    offer_around(wave, g, offers.near)
    offer_around(wave, g, offers.apex)
    if offers.is_bent:
        offer_around(wave, g, offers.far)


@inlined
def offer_over(wave: View, out: int, g: int, length: float, window: Window) -> None:
    """Offer a window that leaves a face by its half-edge g to ``out``, across that edge.

    The frame is as in `offer_around`; ``out`` may be NO_FACE, or IRREGULAR.
    """
    if out >= 0:
        offer(wave, out, g, length, window)
    elif out == IRREGULAR:
        offer_around(wave, g, window)


@inlined
def relax(
    wave: View, node: int, distance: float, via: int, sx: float, sy: float, root: int, x: float
) -> None:
    """Offer a node a distance, over (x, 0) on ``via`` from the pseudosource ``root`` at (sx, sy).

    Ties go to the lower source. A vertex where several fans meet is to emit all around: windows
    that turn about it stay in their fan. Modifies the node, pool and buckets.
    """
    vertices = wave.vertices
    known = vertices.distance[node]
    if distance > known * (1.0 + TIE):
        return
    if not precedence(distance, vertices.source_index[root], known, vertices.source_index[node]):
        return
    record_winner(wave, node, via, sx, sy, root)
    vertices.crossing[node] = x
    if distance < known:
        vertices.distance[node] = distance
        if node < wave.sizes.vertices:
            if known == math.inf:
                note_reached(wave, node)
            if wave.mesh.flags[node] & (FANS | SEAM | PINCHED):
                push_vertex(wave, node)


@inlined
def note_reached(wave: View, v: int) -> None:
    """Put a vertex that had no distance among the touched ones, and bound the rest of a path."""
    wave.vertices.touched[wave.counters[TOUCHED]] = v
    wave.counters[TOUCHED] += 1
    if is_pruned(wave):
        wave.vertices.heuristic[v] = lower_bound_to_target(wave, v)


@kernel
def push_vertex(wave: View, v: int) -> None:
    """Have a vertex wait to emit windows all around. Modifies pool and buckets."""
    distance = wave.vertices.distance[v]
    if distance <= wave.bounds.max_distance and may_pass(wave, v):
        push(wave, -1 - v, emitted_window(wave, 0.0, 0.0, 0.0, 0.0, distance, v, 0.0), 0, distance)
