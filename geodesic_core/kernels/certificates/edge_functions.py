"""The function on the edges of a certificate: the lower envelope of the cones over each of them.

A cone is σ + √((x - a)² + h²), x mesh units from the edge's lower vertex. Each window on the edge,
from any of its faces, is a cone between its ends. So is the way along the edge from either end of
it, or from a source on it, over its whole length.
"""

import math
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.borders.bisectors import Regions
from geodesic_core.kernels.borders.envelopes import REGION, START, envelope_along
from geodesic_core.kernels.certificates.faces import Faces, Numbers
from geodesic_core.kernels.curves.regions import SIDES_END, put_disc, put_side
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.front.window import B0, B1, SX, SY
from geodesic_core.kernels.front.window import SIGMA as OF_WINDOW
from geodesic_core.kernels.jit import borrowed, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL, Topology
from geodesic_core.kernels.planar import distance
from geodesic_core.kernels.retained.face_windows import FaceWindows
from geodesic_core.tolerances import HALF_ULP, NARROW

# Columns of a cone
FOOT = 0  # a
HEIGHT = 1  # h, 0 or more
SIGMA = 2
LOW = 3  # where it begins
HIGH = 4  # and ends
CONE = 5

_CORRECTIONS = 4
"""Newton steps by which the place where two cones cross is corrected"""
_UP = 1.0 + 4.0 * HALF_ULP
"""By rounding, a window may be above the cone of a vertex that it reaches"""


class Sides(NamedTuple):
    """The half-edges that lie on each edge."""

    first: Longs
    """(E + 1,): the first one of each edge; those of the next one follow"""
    half_edges: Longs
    """(K,)"""
    is_turned: Flags
    """(3F,): whether a half-edge runs from its edge's upper vertex to the lower one"""


class OnEdges(NamedTuple):
    """Sources on edges, but for their ends."""

    first: Longs
    """(E + 1,): the first one on each edge; those on the next one follow"""
    foot: Floats
    """(S,): mesh units from the lower vertex"""
    sigma: Floats
    """(S,): start distance"""


class EdgeFunction(NamedTuple):
    """Pieces along edges, those of an edge one after the other."""

    pieces: Ints
    """(E,): pieces of each edge"""
    a: Floats
    """(N,): foot of each piece"""
    h: Floats
    sigma: Floats
    t: Floats
    """(N,): where it ends, as a share of the edge"""


@kernel
def sides_of(topology: Topology, faces: Faces, numbers: Numbers) -> Sides:
    """Return the half-edges on each edge; O(faces)."""
    topology, faces, numbers = borrowed(topology), borrowed(faces), borrowed(numbers)
    first, count = np.zeros(len(faces.edges) + 2, np.int64), 0
    edge, is_turned = np.full(len(topology.links), -1), np.zeros(len(topology.links), np.uint8)
    for h in range(len(edge)):
        face = numbers.faces[h // 3]
        tail = numbers.vertices[topology.links[h, TAIL]]
        head = numbers.vertices[topology.links[h, HEAD]]
        is_turned[h] = 1 if tail > head else 0
        for k in range(3 if face >= 0 else 0):
            e = faces.of_face[face, k]
            if faces.edges[e, 0] == min(tail, head) and faces.edges[e, 1] == max(tail, head):
                edge[h], count = e, count + 1
                first[e + 2] += 1
    for e in range(len(faces.edges)):
        first[e + 2] += first[e + 1]
    half_edges = np.empty(count, np.int64)
    for h in range(len(edge)):
        if edge[h] >= 0:
            half_edges[first[edge[h] + 1]] = h
            first[edge[h] + 1] += 1
    return Sides(first[:-1], half_edges, is_turned)


@kernel
def edge_function(
    faces: Faces,
    sides: Sides,
    windows: FaceWindows,
    values: Floats,
    sources: OnEdges,
    first: int,
    last: int,
) -> EdgeFunction:
    """Return the function on the edges ``first`` to ``last``; O(windows²) an edge.

    Edges of one face have no pieces. ``values`` (V,) are those of the vertices.
    """
    faces, sides, windows = borrowed(faces), borrowed(sides), borrowed(windows)
    cones, out = np.empty((64, CONE)), np.empty((1024, CONE))
    pieces, total = np.zeros(last - first, np.int32), 0
    for e in range(first, last):
        if faces.is_rim[e]:
            continue
        length, before = faces.length[e], total
        cones, count = cones_over(faces, sides, windows, sources, e, cones)
        cones[0, SIGMA], cones[1, SIGMA] = values[faces.edges[e, 0]], values[faces.edges[e, 1]]
        out, total = with_pieces(cones[:count], length, out, total)
        pieces[e - first] = total - before
    columns = np.empty((4, total))
    for i in range(total):
        columns[0, i], columns[1, i] = out[i, FOOT], out[i, HEIGHT]
        columns[2, i], columns[3, i] = out[i, SIGMA], out[i, HIGH]
    return EdgeFunction(pieces, columns[0], columns[1], columns[2], columns[3])


@kernel
def cones_over(
    faces: Faces, sides: Sides, windows: FaceWindows, sources: OnEdges, e: int, rows: Floats
) -> tuple[Floats, int]:
    """Fill ``rows``, or a larger array, with the cones over an edge; return it, and their number.

    The first two are those of its ends, without σ.
    """
    length, count = faces.length[e], 2
    needed = 2 + sources.first[e + 1] - sources.first[e]
    for i in range(sides.first[e], sides.first[e + 1]):
        h = sides.half_edges[i]
        needed += windows.first[h + 1] - windows.first[h]
    rows = with_room(rows, needed)
    put_row(rows[0], 0.0, 0.0, 0.0, 0.0, length)
    put_row(rows[1], length, 0.0, 0.0, 0.0, length)
    for i in range(sources.first[e], sources.first[e + 1]):
        put_row(rows[count], sources.foot[i], 0.0, sources.sigma[i], 0.0, length)
        count += 1
    for i in range(sides.first[e], sides.first[e + 1]):
        h = sides.half_edges[i]
        for w in range(windows.first[h], windows.first[h + 1]):
            put_window(rows[count], windows.windows[w], length, sides.is_turned[h] > 0)
            count += 1
    return rows, count


@inlined
def put_row(row: Floats, foot: float, height: float, sigma: float, low: float, high: float) -> None:
    """Fill a row with a cone."""
    row[FOOT], row[HEIGHT], row[SIGMA], row[LOW], row[HIGH] = foot, height, sigma, low, high


@inlined
def put_window(row: Floats, window: Floats, length: float, is_turned: bool) -> None:
    """Fill a row with the cone of a window on an edge, which may run the other way."""
    foot, low, high = window[SX], window[B0], window[B1]
    if is_turned:
        foot, low, high = length - foot, length - high, length - low
    put_row(row, foot, abs(window[SY]), window[OF_WINDOW], low, high)


@kernel
def with_pieces(cones: Floats, length: float, out: Floats, total: int) -> tuple[Floats, int]:
    """Append the lower envelope of cones that cover an edge to the rows of ``out``.

    They begin and end at shares of the edge. Returns the array, which may be a larger one, and how
    many rows it has.
    """
    stretches = envelope_of_windows(cones, length)
    if len(stretches) == 0:
        stretches = envelope_of(cones, length)
    stretches = without_gaps(stretches, cones, length)
    out, start, before = with_room(out, total + len(stretches)), 0.0, -1
    for k in range(len(stretches)):
        cone = int(stretches[k, REGION])
        if k > 0:
            place = crossing_near(cones, before, cone, stretches[k, START], NARROW * length)
            place = min(max(place / length, start), 1.0)
            out[total - 1, HIGH] = start = place
        put_row(out[total], cones[cone, FOOT], cones[cone, HEIGHT], cones[cone, SIGMA], start, 1.0)
        total, before = total + 1, cone
    return out, total


@kernel
def envelope_of_windows(cones: Floats, length: float) -> Floats:
    """Return the lower envelope of the windows, or none where the cone of an end is below it.

    No cone rises faster along the edge than those of the ends. So these are above all of a stretch
    if that from the lower end is above its start, and that from the upper end above its end.
    """
    stretches, count, near = envelope_of(cones[2:], length), 0, NARROW * length
    for k in range(len(stretches)):
        start, cone = stretches[k, START], int(stretches[k, REGION]) + 2
        end = stretches[k + 1, START] if k + 1 < len(stretches) else length
        if cone < 2:  # none, as in gaps by rounding
            if end - start > near:
                return stretches[:0]
            continue
        if cone_at(cones, cone, start) > (cones[0, SIGMA] + start) * _UP:
            return stretches[:0]
        if cone_at(cones, cone, end) > (cones[1, SIGMA] + length - end) * _UP:
            return stretches[:0]
        if count == 0 or stretches[count - 1, REGION] != cone:
            stretches[count, START] = start if count > 0 else 0.0
            stretches[count, REGION] = cone
            count += 1
    return stretches[:count]


@kernel
def envelope_of(cones: Floats, length: float) -> Floats:
    """Return the lower envelope of cones, the region -1 where there is none; O(cones²)."""
    number = len(cones)
    regions, labels = np.zeros((number, SIDES_END)), np.zeros(number, np.int32)
    for k in range(number):
        put_cone(regions[k], cones[k])
    return envelope_along(Regions(regions, labels, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), length)


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
        before, region = int(stretches[count - 1, REGION]), int(stretches[long, REGION])
        if k < long:
            start, end = stretches[k, START], stretches[long, START]
            jumps, last = 0.0, before
            for n in range(k, long + 1):
                jumps += jump_at(cones, last, int(stretches[n, REGION]), stretches[n, START])
                last = int(stretches[n, REGION])
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
    best, least, lo, hi = place, math.inf, place - near, place + near
    for _ in range(_CORRECTIONS + 1):
        if not lo <= place <= hi:
            break
        away = distance(place, cones[i, FOOT], cones[i, HEIGHT])
        other = distance(place, cones[j, FOOT], cones[j, HEIGHT])
        apart = cones[i, SIGMA] + away - (cones[j, SIGMA] + other)
        if not abs(apart) < least:
            break
        best, least = place, abs(apart)
        rate = slope(place - cones[i, FOOT], away) - slope(place - cones[j, FOOT], other)
        if least == 0.0 or rate == 0.0:
            break
        place -= apart / rate
    return best


@inlined
def slope(along: float, away: float) -> float:
    """Return the derivative of a cone, ``along`` from its foot; 0 at its apex."""
    return along / away if away > 0.0 else 0.0


@inlined
def cone_at(cones: Floats, i: int, place: float) -> float:
    """Return the value of a cone."""
    return cones[i, SIGMA] + distance(place, cones[i, FOOT], cones[i, HEIGHT])
