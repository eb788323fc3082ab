"""The windows that a sweep retained, sorted by half-edge; distances of points of a face by them.

All windows that cross a half-edge into its face were propagated from its list. So a point of a face
is reached by a window of one of the three half-edges, from one of the corners, or from a source
inside the face: a point or a segment of a curve. Its distance is the least of these. A list may
have been propagated several times. Windows that a later run improves are then retained as well:
they cost time, not accuracy.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs, aligned_rows
from geodesic_core.kernels.front.counters import RETAINED_ROWS
from geodesic_core.kernels.front.relaxation import precedence
from geodesic_core.kernels.front.segments import distance_to_segment, is_segment
from geodesic_core.kernels.front.sites import way_through
from geodesic_core.kernels.front.state import FACE, NODE, WIDTH, Wavefront
from geodesic_core.kernels.front.window import (
    B0,
    B1,
    DEPTH,
    NEXT,
    REFERENCE,
    ROOT,
    SIGMA,
    SX,
    SY,
    XI,
    Window,
)
from geodesic_core.kernels.jit import inlined, kernel, pointer
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, point_in_frame
from geodesic_core.tolerances import GAP


class FaceWindows(NamedTuple):
    """The windows of a sweep that has finished, sorted by the half-edge that they cross."""

    first: Longs
    """(3F + 1,): row of the first window of each half-edge; those of the next one follow"""
    windows: Floats
    """(K, 8): rows as in the pool, NEXT the half-edge"""


class RetainedSweep(NamedTuple):
    """All results of a sweep from which distances in faces follow."""

    face_windows: FaceWindows
    distance: Floats
    """(N,) by node"""
    site_ints: Ints
    """Those of sources only, by face"""
    site_weights: Floats
    segment_ints: Ints
    """By face"""
    segment_ends: Floats
    first_segment: int
    """The least node of a segment"""


@kernel
def sort_by_half_edge(rows: Floats, first: Longs, windows: Floats) -> None:
    """Sort ``rows`` stably by half-edge into ``windows``, and fill ``first``; O(K + F)."""
    ints = rows.view(np.int32)
    for h in range(len(first)):
        first[h] = 0
    for i in range(len(rows)):
        first[ints[i, NEXT] + 1] += 1
    for h in range(len(first) - 1):
        first[h + 1] += first[h]
    free = first.copy()
    for i in range(len(rows)):
        h = ints[i, NEXT]
        for column in range(WIDTH):
            windows[free[h], column] = rows[i, column]
        free[h] += 1


def face_windows_of(wave: Wavefront) -> FaceWindows:
    """Return the windows that a sweep retained, in memory of their own."""
    rows = wave.pool.retained[: wave.counters[RETAINED_ROWS]]
    face_windows = FaceWindows(
        first=np.empty(len(wave.pool.lists) + 1, np.int64),
        windows=aligned_rows(len(rows), WIDTH, np.float64),
    )
    sort_by_half_edge(rows, face_windows.first, face_windows.windows)
    # What only a running sweep needs may be memory that it has never written.
    face_windows.windows[:, XI] = 0.0
    face_windows.windows.view(np.int32)[:, REFERENCE : DEPTH + 1] = 0
    return face_windows


def bytes_of(wave: Wavefront) -> int:
    """Memory that `face_windows_of` takes."""
    return 8 * (len(wave.pool.lists) + 1 + WIDTH * int(wave.counters[RETAINED_ROWS]))


@inlined
def retained_window(row: Floats, root: int, weight: float) -> Window:
    """Return the window of a row of `FaceWindows`, without what was merged into it."""
    b0, b1, sx, sy, sigma = row[B0], row[B1], row[SX], row[SY], row[SIGMA]
    return Window(b0, b1, sx, sy, sigma, weight, root + 0, 0.0, -1, math.nan, 0)


class Reach(NamedTuple):
    """A way to a point of a face."""

    distance: float
    """Mesh units; infinite where the point is not reached"""
    entry_edge: int
    """A half-edge of the face; -1 where the point is not reached"""
    sx: float
    sy: float
    """The pseudosource in the frame of that half-edge"""
    predecessor: int
    """Node of the pseudosource"""


@kernel
def reach_point(
    topology: Any, winners: Any, face_windows: Any, first_target: int, face: int, weights: Floats
) -> Reach:
    """Return the least way to the point of an inner face with these barycentric weights.

    ``first_target`` is the number of site rows of sources. Of equal distances that of the lower
    source wins. O(windows of the face).
    """
    best = Reach(math.inf, -1, 0.0, 0.0, -1)
    for h in range(3 * face, 3 * face + 3):
        x, y = point_in_frame(topology.geometry, h, weights)
        best = reach_by_windows(topology, winners, face_windows, h, x, y, best)
        corner = topology.links[h, TAIL]
        distance = winners.vertices.distance[corner] + math.hypot(x, y)
        if distance < math.inf:
            best = nearer_way(winners.nearest, best, Reach(distance, h, 0.0, 0.0, corner + 0))
        if h == 3 * face:
            best = reach_by_sites(topology, winners, first_target, h, x, y, best)
            best = reach_by_segments(topology, winners, h, x, y, best)
    return best


@inlined
def nearer_way(nearest: Ints, best: Reach, other: Reach) -> Reach:
    """Return that of two ways which takes precedence; ``nearest`` is that of `Winners`."""
    best_source = nearest[best.predecessor] if best.predecessor >= 0 else -1
    if not precedence(other.distance, nearest[other.predecessor], best.distance, best_source):
        return best
    distance = min(best.distance, other.distance)
    return Reach(distance, other.entry_edge, other.sx, other.sy, other.predecessor)


@inlined
def reach_by_windows(
    topology: Any, winners: Any, face_windows: Any, h: int, x: float, y: float, best: Reach
) -> Reach:
    """Return the best way to (x, y) in the frame of h: a known one, or by a window over h."""
    windows, segment_ints, nearest = (
        face_windows.windows,
        winners.sites.segment_ints,
        winners.nearest,
    )
    ints, gap = windows.view(np.int32), GAP * topology.geometry[h, LENGTH]
    for i in range(face_windows.first[h], face_windows.first[h + 1]):
        weight = 0.0 if is_segment(segment_ints, ints[i, ROOT]) else 1.0
        window = retained_window(windows[i], ints[i, ROOT], weight)
        distance = way_through(window, x, y, gap)
        best = nearer_way(nearest, best, Reach(distance, h, window.sx, window.sy, window.root))
    return best


@inlined
def reach_by_sites(
    topology: Any, winners: Any, first_target: int, h: int, x: float, y: float, best: Reach
) -> Reach:
    """Return the best way to (x, y) in the frame of h: a known one, or from a point in the face."""
    for k in range(first_target):
        if winners.sites.ints[k, FACE] == h // 3:
            node = winners.sites.ints[k, NODE] + 0
            sx, sy = point_in_frame(topology.geometry, h, winners.sites.weights[k])
            distance = winners.vertices.distance[node] + math.hypot(x - sx, y - sy)
            best = nearer_way(winners.nearest, best, Reach(distance, h, sx, sy, node))
    return best


@inlined
def reach_by_segments(
    topology: Any, winners: Any, h: int, x: float, y: float, best: Reach
) -> Reach:
    """Return the best way to (x, y) in the frame of h: a known one, or from a segment inside."""
    geometry, ends = pointer(topology.geometry), pointer(winners.sites.segment_ends)
    for k in range(len(winners.sites.segment_ints)):
        if winners.sites.segment_ints[k, FACE] == h // 3:
            node = winners.sites.segment_ints[k, NODE] + 0
            distance = distance_to_segment(geometry, ends, k, h, x, y)
            distance += winners.vertices.distance[node]
            best = nearer_way(winners.nearest, best, Reach(distance, h, 0.0, 0.0, node))
    return best
