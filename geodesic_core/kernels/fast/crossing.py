"""A window crosses a face: the apex, the sites inside, and windows for the two other edges (3.2).

What the window lights goes on as it is. Beyond that light paths bend, so that the ends of each
edge are offered to it as pseudosources, from the distances that they have by then; where the ray to
the apex passes by an end of the half-edge that is a vertex, that vertex is, too. All of these are
paths that exist: the best of them wins a place, or several, and the rest is dropped.
"""

import math
from typing import NamedTuple

from geodesic_core.kernels.fast.places import (
    AT_LARGE,
    Offers,
    distance_along,
    offer_all,
    offer_all_around,
    relax,
)
from geodesic_core.kernels.front.counters import PROPAGATED
from geodesic_core.kernels.front.sides import Side, left_of, right_of
from geodesic_core.kernels.front.state import NEXT_SITE, NODE, SITE, WIDTH, View
from geodesic_core.kernels.front.window import (
    INTS,
    KEY,
    WON,
    Window,
    distance_at,
    emitted_window,
    load_window,
    reversed_window,
    seen_over,
    straight_distance,
)
from geodesic_core.kernels.jit import as_ints, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    HEAD,
    IRREGULAR,
    LENGTH,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    TAIL,
    faces_beyond,
    following,
    previous,
    weights_in_frame,
)
from geodesic_core.kernels.planar import hit_left

OFFERS = 4
"""Windows offered to an edge, at most"""
VERTICES = 3
"""Times that the apex may be reached, at most"""


class Corners(NamedTuple):
    """The vertices of a face that a window crosses, as seen from one of the two other sides."""

    near: int
    """Where the side begins, an end of the half-edge"""
    apex: int
    far: int
    """The other end of the half-edge"""


@inlined
def is_live(wave: View, h: int, window: Window, won: int, key: float) -> bool:
    """Whether a window of this key is still the nearest at a place that it won."""
    if won & AT_LARGE:
        return True
    values, places = wave.places.values, wave.places.per_edge
    if places == 1:
        return values[h] == key
    step = wave.mesh.geometry[ROW * h + LENGTH] / places
    for k in range(places):
        if won >> k & 1:
            distance = distance_along(window, step * (k + 0.5))
            if distance == values[places * h + k]:
                return True
    return False


@inlined
def room_to_cross(wave: View, h: int) -> int:
    """Return how many windows a crossing of the face of h may make, at most."""
    links, room = wave.mesh.links, 2 * OFFERS + VERTICES
    if links[ROW * h + OUT_LEFT] == IRREGULAR:
        room += OFFERS * faces_beyond(links, previous(h))
    if links[ROW * h + OUT_RIGHT] == IRREGULAR:
        room += OFFERS * faces_beyond(links, following(h))
    return room


@inlined
def cross(wave: View, h: int, slot: int) -> None:
    """Send the window of a row, if it is live, over the face of h. Modifies the wavefront."""
    mesh, rows, distance = wave.mesh, wave.pool.windows, wave.vertices.distance
    window = load_window(wave, rows, slot)
    if not is_live(wave, h, window, as_ints(rows)[INTS * slot + WON], rows[WIDTH * slot + KEY]):
        return
    wave.counters[PROPAGATED] += 1
    left, right = left_of(wave, h), right_of(wave, h)
    tail, head = int(mesh.links[ROW * h + TAIL]), int(mesh.links[ROW * h + HEAD])
    apex = int(mesh.links[ROW * h + APEX])
    ax, ay = left.cosine * left.length, left.sine * left.length
    x = ray_through(window, ax, ay)
    reach(wave, apex, h, window, ax, ay, x)
    relax(wave, apex, distance[tail] + left.length, h, 0.0, 0.0, tail, 0.0)
    far_end = right.start
    relax(wave, apex, distance[head] + right.length, h, far_end, 0.0, head, far_end)
    if wave.sizes.first_site > 0:
        reach_sites(wave, h, window)
    send_over(wave, window, left, previous(h), x, far_end, Corners(tail, apex, head))
    mirrored, corners = reversed_window(window, far_end), Corners(head, apex, tail)
    send_over(wave, mirrored, right, following(h), far_end - x, far_end, corners)


@inlined
def ray_through(window: Window, ax: float, ay: float) -> float:
    """Place on the edge, or beyond it, of the ray of a window to a point of the face."""
    rise = ay * window.weight - window.sy
    return (window.sx * ay - ax * window.sy) / rise if rise > 0.0 else window.sx


@inlined
def reach(wave: View, node: int, h: int, window: Window, ax: float, ay: float, x: float) -> None:
    """Offer a node at (ax, ay) the path through a window, bent at its end where it must.

    ``x`` is where its ray to that point crosses the edge.
    """
    place = min(max(x, window.b0), window.b1)
    if place == x:
        distance = straight_distance(window, ax, ay)
    else:
        distance = distance_at(window, place) + math.sqrt((ax - place) * (ax - place) + ay * ay)
    relax(wave, node, distance, h, window.sx, window.sy, window.root, place)


@kernel
def reach_sites(wave: View, h: int, window: Window) -> None:
    """Offer the sites in the face of h the path through a window. Modifies their nodes."""
    mesh, sites = wave.mesh, wave.sites
    k = int(wave.places.first_site[h // 3])
    while k >= 0:
        x, y = weights_in_frame(mesh.geometry, sites.weights, 3 * k, h)
        node = int(sites.ints[SITE * k + NODE])
        reach(wave, node, h, window, x, y, ray_through(window, x, y))
        k = int(sites.ints[SITE * k + NEXT_SITE])


@inlined
def send_over(
    wave: View,
    window: Window,
    side: Side,
    g: int,
    x: float,
    length: float,
    corners: Corners,
) -> None:
    """Offer all windows that leave a face over one of its sides to the half-edge across.

    The window is in the frame of the half-edge that it crosses, of this ``length``, as seen from
    its near end, at which the side g begins; its ray to the apex crosses at ``x``.
    """
    if side.out < 0 and side.out != IRREGULAR:
        return
    along = window.sx * side.cosine + window.sy * side.sine
    depth = window.sy * side.cosine - window.sx * side.sine
    u0 = hit_left(window.b0, window.sy, depth, side.sine, side.length, window.weight)
    u1 = side.length
    if x > window.b1:
        u1 = hit_left(window.b1, window.sy, depth, side.sine, side.length, window.weight)
    sx, sy, sigma = length * side.cosine, -length * side.sine, wave.vertices.distance[corners.far]
    far = emitted_window(wave, 0.0, side.length, sx, sy, sigma, corners.far, 0.0)
    offers = Offers(
        seen=as_seen_across(side, seen_over(window, u0, u1, along, depth)),
        is_lit=u1 > u0,
        near=end_of(wave, side, 0.0, corners.near),
        apex=end_of(wave, side, side.length, corners.apex),
        far=as_seen_across(side, far),
        is_bent=x > window.b1 and window.b1 == length,
    )
    if side.out >= 0:
        offer_all(wave, side.out, g, side.length, offers)
    else:
        offer_all_around(wave, g, offers)


@inlined
def end_of(wave: View, side: Side, place: float, v: int) -> Window:
    """Return the window of an end of a side, a pseudosource, as seen across it."""
    sigma = wave.vertices.distance[v]
    return as_seen_across(side, emitted_window(wave, 0.0, side.length, place, 0.0, sigma, v, 0.0))


@inlined
def as_seen_across(side: Side, window: Window) -> Window:
    """Return a window, as seen from where a side begins, in the frame of the half-edge across."""
    if side.is_right:  # it begins at the apex
        return reversed_window(window, side.length)
    return window
