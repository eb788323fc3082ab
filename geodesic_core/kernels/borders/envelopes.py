"""The lower envelope along an edge: which region of a face is the nearest at each of its points.

Along an edge the distance function of a region is σ + √((t - m)² + h²), or linear, within the
interval that its sides leave. Two of them cross at most twice. The envelope is built region by
region. Of regions that are equally near, the one that came first stays.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.borders.bisectors import Regions, distance_to, linear
from geodesic_core.kernels.curves.conics import CX, CY, is_line
from geodesic_core.kernels.curves.regions import RADIUS, span_between_sides
from geodesic_core.kernels.curves.rows import ROWS, with_room
from geodesic_core.kernels.jit import borrowed, inlined, kernel

# Columns of a stretch of the envelope
START = 0  # distance from the tail of the edge
REGION = 1  # the nearest region; -1 where none reaches
STRETCH = 2


@kernel
def along_edge(region: Floats, level: float, edge: Any) -> tuple[float, float, float, float, float]:
    """Return weight, m, h², and the linear part, start and rate, of the distance along an edge."""
    ox, oy, ux, uy = edge
    if is_line(region):
        m, nx, ny = linear(region, level)
        return 0.0, 0.0, 0.0, m + nx * ox + ny * oy, nx * ux + ny * uy
    dx, dy = region[CX] - ox, region[CY] - oy
    height = ux * dy - uy * dx
    return 1.0, ux * dx + uy * dy, height * height, level - region[RADIUS], 0.0


@kernel
def crossings_of(region: Floats, other: Floats, level: float, edge: Any) -> tuple[float, float]:
    """Return the places along an edge at which two regions may be equally near; NaN for none.

    They solve the squared equation: at some of them, one distance may be minus the other.
    """
    weight, m, square, start, rate = along_edge(region, level, edge)
    weight1, m1, square1, start1, rate1 = along_edge(other, level, edge)
    # weight √((t - m)² + h²) - weight1 √((t - m1)² + h1²) = c + r t
    c, r = start1 - start, rate1 - rate
    if weight == 0.0 and weight1 == 0.0:
        return (-c / r if r != 0.0 else math.nan), math.nan
    if weight > 0.0 and weight1 > 0.0:  # squared: (at + slope s)² = k² (s² + h1²), s = t - m1
        slope, k, shift = 2.0 * (m1 - m), 2.0 * c, m1
        at = (m1 - m - c) * (m1 - m + c) + (square - square1)  # precise where the squares are 0
        square = square1
    else:
        shift = m if weight > 0.0 else m1
        square, slope, k, at = max(square, square1), r, 1.0, c + r * shift
    p, half = (slope - k) * (slope + k), slope * at
    if p == 0.0:
        last = at * at - k * k * square
        return (shift - 0.5 * last / half if half != 0.0 else math.nan), math.nan
    root = -(half + math.copysign(abs(k) * math.sqrt(max(at * at + square * p, 0.0)), half))
    first = shift + root / p
    second = shift + (at * at - k * k * square) / root if root != 0.0 else first
    return min(first, second), max(first, second)


@kernel
def envelope_along(regions: Regions, edge: Any, length: float) -> Floats:
    """Return the envelope of the regions of a face along one of its edges, by its stretches.

    A region of another source must be nearer by the slack to replace what is there.
    """
    regions = borrowed(regions)
    stretches, count = np.empty((ROWS, STRETCH)), 1
    stretches[0, START], stretches[0, REGION] = 0.0, -1
    other = np.empty((ROWS, STRETCH))
    for c in range(len(regions.rows)):
        ox, oy, ux, uy = edge
        lo, hi = span_between_sides(regions.rows[c], ox, oy, ux, uy, 0.0, length)
        if not lo < hi:
            continue
        first = count - 1  # the stretches before it stay as they are
        while first > 0 and stretches[first, START] >= lo:
            first -= 1
        other = with_room(other, 4 * (count - first) + 8)
        rest = stretches[first:count]
        size = insert_region(rest, regions, c, (lo, hi), edge, length, other)
        count = first + size
        stretches = with_room(stretches, count)
        for k in range(size):
            stretches[first + k, START] = other[k, START]
            stretches[first + k, REGION] = other[k, REGION]
    return stretches[:count]


@kernel
def insert_region(
    stretches: Floats, regions: Regions, c: int, span: Any, edge: Any, length: float, out: Floats
) -> int:
    """Write the envelope with region c, within ``span``, to ``out``; return its stretches."""
    rows, labels, level = regions.rows, regions.labels, regions.level
    ox, oy, ux, uy = edge
    lo, hi = span
    size = 0
    for k in range(len(stretches)):
        start, i = stretches[k, START], int(stretches[k, REGION])
        end = stretches[k + 1, START] if k + 1 < len(stretches) else length
        if hi <= start or lo >= end:
            size = append_stretch(out, size, start, i)
            continue
        a, b = max(lo, start), min(hi, end)
        if a > start:
            size = append_stretch(out, size, start, i)
        first, second = a, a
        if i >= 0:
            first, second = crossings_of(rows[c], rows[i], level, edge)
            first = first if a < first < b else a
            second = second if first < second < b else first
        cuts = (a, first, second, b)
        for n in range(3):
            if not cuts[n] < cuts[n + 1]:
                continue
            t = 0.5 * (cuts[n] + cuts[n + 1])
            winner = c
            if i >= 0:
                x, y = ox + t * ux, oy + t * uy
                margin = regions.slack if labels[i] != labels[c] else 0.0
                most = distance_to(rows[i], level, x, y) - margin
                if not distance_to(rows[c], level, x, y) < most:
                    winner = i
            size = append_stretch(out, size, cuts[n], winner)
        if b < end:
            size = append_stretch(out, size, b, i)
    return size


@inlined
def append_stretch(out: Floats, size: int, start: float, region: int) -> int:
    """Append a stretch, or prolong the last one of the same region; return the new number."""
    if size > 0 and out[size - 1, REGION] == region:
        return size
    out[size, START], out[size, REGION] = start, region
    return size + 1


@kernel
def label_runs(stretches: Floats, labels: Any, ends: Any, length: float, gap: float) -> Floats:
    """Return where the nearest source changes along an edge: rows of its place and the new source.

    The first row is at the tail, 0. ``ends`` are the sources of the tail and of the head, which the
    runs begin and end with. Runs shorter than ``gap``, and stretches that nothing reaches, are left
    out; places keep as far from the ends.
    """
    runs, count = np.empty((len(stretches) + 2, 2)), 1
    runs[0, 0], runs[0, 1] = 0.0, ends[0]
    for k in range(len(stretches)):
        region = int(stretches[k, REGION])
        end = stretches[k + 1, START] if k + 1 < len(stretches) else length
        start = min(max(stretches[k, START], gap), length - gap)
        if region < 0 or end - start <= gap or labels[region] == runs[count - 1, 1]:
            continue
        runs[count, 0], runs[count, 1] = start, labels[region]
        count += 1
    if runs[count - 1, 1] != ends[1]:
        runs[count, 0], runs[count, 1] = length - gap, ends[1]
        count += 1
    return runs[:count]
