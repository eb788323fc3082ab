"""The windows of one half-edge sent on to the two other edges of its face (section 3.2)."""

from typing import NamedTuple

from geodesic_core.kernels.front.counters import CREATED
from geodesic_core.kernels.front.directions import turned_by, turns_to_sides
from geodesic_core.kernels.front.pool import put_window
from geodesic_core.kernels.front.sides import Side, left_of, right_of
from geodesic_core.kernels.front.state import FIRST, LAST, LIST, SIZE, View, merging
from geodesic_core.kernels.front.window import (
    INTS,
    NEXT,
    Window,
    at_sigma,
    is_beyond,
    load_window,
    seen_over,
)
from geodesic_core.kernels.front.window_lists import queue_if_due
from geodesic_core.kernels.jit import as_ints, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    HEAD,
    IRREGULAR,
    NO_FACE,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    TAIL,
    faces_beyond,
    following,
    previous,
)
from geodesic_core.kernels.planar import hit_left
from geodesic_core.kernels.sweep.delivery import send_across
from geodesic_core.kernels.sweep.reach import bent_distance, ray_to
from geodesic_core.tolerances import OVERLAP


class Chain(NamedTuple):
    """New windows in their order along an edge, linked one to the next."""

    first: int
    last: int
    size: int


NO_CHAIN = Chain(-1, -1, 0)


@inlined
def spread(wave: View, h: int, count: int, nearest: int, crossing: float, least: float) -> None:
    """Send the windows of scratch on to the two other edges of the face.

    Shortest paths do not cross: what lies left of the path to the apex goes left, what lies right
    of it goes right, and only the window nearest to the apex goes both ways. ``nearest`` to
    ``least`` are as `reach_apex` returns them. Modifies the two lists, and queues them.
    """
    left, right = left_of(wave, h), right_of(wave, h)
    ax, ay = left.cosine * left.length, left.sine * left.length
    overlap = OVERLAP * right.start
    turns = turns_to_sides(wave, h, count)
    to_left, to_right = NO_CHAIN, NO_CHAIN
    for i in range(count):
        window = load_window(wave, wave.pool.scratch, i)
        x, rise = ray_to(window, ax, ay)
        goes_left, goes_right = x > window.b0 * rise, x < window.b1 * rise
        covers = goes_left and goes_right
        if i != nearest and covers:
            # Two windows that meet on the ray to the apex both cover it: each keeps its side.
            # Where one lies within the other, the other may have both.
            goes_right = x >= (crossing - overlap) * rise
            goes_left = x <= (crossing + overlap) * rise
            if not goes_right and window.b1 > crossing:
                goes_right = not is_beaten(wave, window, nearest, crossing, window.b1)
            if not goes_left and window.b0 < crossing:
                goes_left = not is_beaten(wave, window, nearest, crossing, window.b0)
        elif i != nearest:
            is_aside = window.b0 >= crossing if goes_left else window.b1 <= crossing
            if is_aside and bent_distance(window, ax, ay)[0] >= least:
                continue
        if goes_left:
            to_left = send_over_edge(wave, to_left, left, turned_by(window, turns[0]), covers)
        if goes_right:
            window = turned_by(seen_from(window, ax, ay), turns[1])
            to_right = send_over_edge(wave, to_right, right, window, covers)
    wave.counters[CREATED] += to_left.size + to_right.size
    deliver_left(wave, h, to_left)
    deliver_right(wave, h, to_right)


@inlined
def seen_from(window: Window, x: float, y: float) -> Window:
    """Return the window with σ as a frame that begins at (x, y) has it: another if parallel."""
    if window.weight == 0.0:
        return at_sigma(window, window.sigma - (window.sx * x + window.sy * y))
    return window


@inlined
def send_over_edge(wave: View, chain: Chain, side: Side, window: Window, covers: bool) -> Chain:
    """Send what a window lights of an edge over it; return the chain, which it may lengthen.

    The right edge is seen in the mirror, from where the half-edge ends. ``covers`` says that the
    window lights the apex. Modifies the pool.
    """
    if side.out == NO_FACE:
        return chain
    near, far, offset = window.b0, window.b1, window.sx
    if side.is_right:
        near, far = side.start - window.b1, side.start - window.b0
        offset = side.start * window.weight - window.sx
    sy, weight = window.sy, window.weight
    depth = sy * side.cosine - offset * side.sine
    u0, u1 = hit_left(near, sy, depth, side.sine, side.length, weight), side.length
    if not covers:
        u1 = hit_left(far, sy, depth, side.sine, side.length, weight)
    if u1 <= u0:
        return chain
    along = offset * side.cosine + sy * side.sine
    if side.is_right:  # from the apex on; in this order, which fixes how it rounds
        along = side.length * weight - offset * side.cosine - sy * side.sine
        u0, u1 = side.length - u1, side.length - u0
    onward = seen_over(window, u0, u1, along, depth)
    if is_beyond(wave, onward):
        return chain
    slot = put_window(wave, onward)
    if chain.size == 0:
        return Chain(slot, slot, 1)
    as_ints(wave.pool.windows)[INTS * chain.last + NEXT] = slot
    return Chain(chain.first, slot, chain.size + 1)


@inlined
def deliver_left(wave: View, h: int, chain: Chain) -> None:
    """Put a chain before the list across the left edge, for it comes in at the tail; queue that.

    Modifies the list.
    """
    links, lists = wave.mesh.links, wave.pool.lists
    out = links[ROW * h + OUT_LEFT]
    if out == IRREGULAR:
        send_chain(wave, previous(h), chain)
    elif chain.size > 0:
        row = LIST * out
        if lists[row + SIZE] > 0:
            as_ints(wave.pool.windows)[INTS * chain.last + NEXT] = lists[row + FIRST]
        else:
            lists[row + LAST] = chain.last
        lists[row + FIRST] = chain.first
        lists[row + SIZE] += chain.size
        queue_if_due(wave, out, links[ROW * h + TAIL], links[ROW * h + APEX])


@inlined
def deliver_right(wave: View, h: int, chain: Chain) -> None:
    """Put a chain after the list across the right edge, for it comes in at the head; queue that.

    Modifies the list.
    """
    links, lists = wave.mesh.links, wave.pool.lists
    out = links[ROW * h + OUT_RIGHT]
    if out == IRREGULAR:
        send_chain(wave, following(h), chain)
    elif chain.size > 0:
        row = LIST * out
        if lists[row + SIZE] > 0:
            as_ints(wave.pool.windows)[INTS * lists[row + LAST] + NEXT] = chain.first
        else:
            lists[row + FIRST] = chain.first
        lists[row + LAST] = chain.last
        lists[row + SIZE] += chain.size
        queue_if_due(wave, out, links[ROW * h + APEX], links[ROW * h + HEAD])


@kernel
def is_beaten(wave: View, window: Window, nearest: int, crossing: float, b: float) -> bool:
    """Whether a window is nowhere nearest between the nearest path to the apex and b.

    That path, of the window ``nearest``, crosses the edge at ``crossing``; ``window`` covers it,
    and all up to b. Back from the edge both run through the same faces, until the path meets the
    ray of ``window`` to b, or begins between its rays. Where they meet the ray is no nearer, or
    else ``window`` would be nearest to the apex, too. Beyond an edge of several faces, though, they
    may have come by different ones.
    """
    if merging(wave) or wave.sizes.crossings > 0:
        return False
    best = load_window(wave, wave.pool.scratch, nearest)
    if window.weight * best.weight == 0.0:
        return False
    dx, dy = window.sx - b, window.sy
    nx, ny = best.sx - crossing, best.sy
    ray, path = (crossing - b) * ny, (crossing - b) * dy
    slant = dx * ny - dy * nx  # they meet at these shares of it
    if slant < 0.0:
        ray, path, slant = -ray, -path, -slant
    return 0.0 < ray <= slant and 0.0 < path <= slant


@kernel
def send_chain(wave: View, g: int, chain: Chain) -> None:
    """Move the windows of a chain over the irregular edge of g."""
    slot = chain.first
    for _ in range(chain.size):
        after = as_ints(wave.pool.windows)[INTS * slot + NEXT]
        send_across(wave, g, slot)
        slot = after


@kernel
def room_to_spread(wave: View, h: int, size: int) -> int:
    """Return how many windows may be made of ``size`` that cross the face of h, at most."""
    links = wave.mesh.links
    room = 2 * size
    if links[ROW * h + OUT_LEFT] == IRREGULAR:
        room += size * faces_beyond(wave.mesh.links, previous(h))
    if links[ROW * h + OUT_RIGHT] == IRREGULAR:
        room += size * faces_beyond(wave.mesh.links, following(h))
    return room
