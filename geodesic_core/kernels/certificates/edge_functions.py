"""The function on the edges of a certificate: the lower envelope of the cones over each of them.

A cone is σ + √((x - a)² + h²), x mesh units from the edge's lower vertex. Each window on the edge,
from any of its faces, is a cone between its ends. So is the way along the edge from either end of
it, over its whole length.
"""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.borders.bisectors import Regions
from geodesic_core.kernels.borders.envelopes import REGION, START, envelope_along
from geodesic_core.kernels.curves.regions import SIDES_END, put_disc, put_side
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.planar import distance
from geodesic_core.tolerances import NARROW

# Columns of a cone
FOOT = 0  # a
HEIGHT = 1  # h, 0 or more
SIGMA = 2
LOW = 3  # where it begins
HIGH = 4  # and ends
CONE = 5

_CORRECTIONS = 4
"""Newton steps by which the place where two cones cross is corrected"""


class EdgeFunction(NamedTuple):
    """Pieces along edges, those of an edge one after the other."""

    counts: Ints
    """(E,): pieces of each edge"""
    cones: Longs
    """(N,): the cone of each piece"""
    ends: Floats
    """(N,): where it ends, mesh units from the lower vertex"""


@kernel
def edge_function(first: Longs, cones: Floats, lengths: Floats) -> EdgeFunction:
    """Return the lower envelopes of the cones of each edge, which must cover it; O(cones²) an edge.

    Those of edge e are rows ``first[e]`` to ``first[e + 1]``; an edge without cones has no pieces.
    """
    counts = np.zeros(len(lengths), np.int32)
    rows, ends, total = np.empty(2 * len(cones), np.int64), np.empty(2 * len(cones)), 0
    regions, labels = np.zeros((1, SIDES_END)), np.zeros(1, np.int32)
    for e in range(len(lengths)):
        base, number = first[e], first[e + 1] - first[e]
        if number == 0:
            continue
        if number > len(regions):
            regions, labels = np.zeros((2 * number, SIDES_END)), np.zeros(2 * number, np.int32)
        for k in range(number):
            put_cone(regions[k], cones[base + k])
        of_edge = Regions(regions[:number], labels[:number], 0.0, 0.0)
        stretches = envelope_along(of_edge, (0.0, 0.0, 1.0, 0.0), lengths[e])
        stretches = without_gaps(stretches, cones[base : base + number], lengths[e])
        counts[e], needed = len(stretches), total + len(stretches)
        rows, ends = with_room(rows, needed), with_room(ends, needed)
        for k in range(len(stretches)):
            rows[total], ends[total] = base + int(stretches[k, REGION]), lengths[e]
            if k > 0:
                place, near = stretches[k, START], NARROW * lengths[e]
                place = crossing_near(cones, rows[total - 1], rows[total], place, near)
                before = ends[total - 2] if k > 1 else 0.0
                ends[total - 1] = min(max(place, before), lengths[e])
            total += 1
    return EdgeFunction(counts, rows[:total].copy(), ends[:total].copy())


@inlined
def put_cone(region: Floats, cone: Floats) -> None:
    """Make ``region`` the disc around the apex of a cone, between lines at right angles."""
    put_disc(region, cone[FOOT], cone[HEIGHT], -cone[SIGMA])
    put_side(region, 0, 1.0, 0.0, cone[FOOT] - cone[LOW])
    put_side(region, 1, -1.0, 0.0, cone[HIGH] - cone[FOOT])


@kernel
def without_gaps(stretches: Floats, cones: Floats, length: float) -> Floats:
    """Return an envelope without short stretches that it jumps to. Modifies the array.

    Rounding leaves gaps between neighbouring windows, where some farther cone is the nearest.
    """
    total, count, k = len(stretches), min(1, len(stretches)), 1
    while k < total:
        long = k  # the next stretch that is not short, or is the last
        while (
            long + 1 < total and stretches[long + 1, START] - stretches[k, START] < NARROW * length
        ):
            long += 1
        before = int(stretches[count - 1, REGION])
        start, end = stretches[k, START], stretches[long, START]
        jumps, region = 0.0, before
        for n in range(k, long + 1):
            jumps += jump_at(cones, region, int(stretches[n, REGION]), stretches[n, START])
            region = int(stretches[n, REGION])
        if jumps > jump_at(cones, before, region, end) + 2.0 * (end - start):
            k = long
        if region != before or k < long:
            stretches[count, START] = stretches[k, START]
            stretches[count, REGION] = stretches[k, REGION]
            count += 1
        k += 1
    return stretches[:count]


@inlined
def jump_at(cones: Floats, i: int, j: int, place: float) -> float:
    """Return by how much two cones differ."""
    return abs(cone_at(cones, i, place) - cone_at(cones, j, place))


@kernel
def crossing_near(cones: Floats, i: int, j: int, place: float, near: float) -> float:
    """Return the place no farther than ``near`` where two cones are equal, or nearly so."""
    best, least = place, jump_at(cones, i, j, place)
    lo, hi = place - near, place + near
    for _ in range(_CORRECTIONS):
        rate = slope_at(cones, i, place) - slope_at(cones, j, place)
        if rate == 0.0:
            break
        place -= (cone_at(cones, i, place) - cone_at(cones, j, place)) / rate
        if not lo <= place <= hi:
            break
        apart = jump_at(cones, i, j, place)
        if not apart < least:
            break
        best, least = place, apart
    return best


@inlined
def cone_at(cones: Floats, i: int, place: float) -> float:
    """Return the value of a cone."""
    return cones[i, SIGMA] + distance(place, cones[i, FOOT], cones[i, HEIGHT])


@inlined
def slope_at(cones: Floats, i: int, place: float) -> float:
    """Return the derivative of a cone along the edge; 0 at its apex."""
    away = distance(place, cones[i, FOOT], cones[i, HEIGHT])
    return (place - cones[i, FOOT]) / away if away > 0.0 else 0.0
