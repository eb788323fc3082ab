"""The windows that a sweep kept: found by half-edge, and asked for distances of points of a face.

All that crosses a half-edge into its face was propagated from its list. So the least distance of a
point of a face is that by a window of one of its three half-edges, from one of its corners, or from
a source inside it, a point or a piece of a curve: paths that reach it over an edge, along one, and
within. A list may have been propagated several times. What later ones improve is then kept as well:
it costs time, no accuracy.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs, aligned_rows
from geodesic_core.kernels.jit import kernel, pointer
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, point_in_frame
from geodesic_core.kernels.sweep.relaxation import precedence
from geodesic_core.kernels.sweep.segments import distance_to_segment, is_segment
from geodesic_core.kernels.sweep.state import FACE, NODE, RETAINED_ROWS, Wavefront
from geodesic_core.kernels.sweep.surface_points import way_through
from geodesic_core.kernels.sweep.window import B0, B1, NEXT, ROOT, SIGMA, SX, SY, WIDTH, Window
from geodesic_core.tolerances import GAP


class FaceWindows(NamedTuple):
    """The windows of a sweep that has finished, sorted by the half-edge that they cross."""

    first: Longs
    """(3F + 1,): row of the first window of each half-edge; those of the next one follow"""
    windows: Floats
    """(K, 8): rows as in the pool, NEXT the half-edge"""


@kernel
def sort_by_half_edge(rows: Floats, first: Longs, windows: Floats) -> None:
    """Sort kept rows stably by half-edge, and fill ``first``; O(K + F)."""
    ints = rows.view(np.int32)
    first[:] = 0
    for i in range(len(rows)):
        first[ints[i, NEXT] + 1] += 1
    for h in range(len(first) - 1):
        first[h + 1] += first[h]
    free = first.copy()
    for i in range(len(rows)):
        h = ints[i, NEXT]
        windows[free[h]] = rows[i]
        free[h] += 1


def face_windows_of(wave: Wavefront) -> FaceWindows:
    """Return the windows that a sweep kept, in memory of their own."""
    rows = wave.pool.retained[: wave.counters[RETAINED_ROWS]]
    kept = FaceWindows(
        first=np.empty(len(wave.pool.lists) + 1, np.int64),
        windows=aligned_rows(len(rows), WIDTH, np.float64),
    )
    sort_by_half_edge(rows, kept.first, kept.windows)
    return kept


def bytes_of(wave: Wavefront) -> int:
    """Memory that `face_windows_of` takes."""
    return 8 * (len(wave.pool.lists) + 1 + WIDTH * int(wave.counters[RETAINED_ROWS]))


class Reach(NamedTuple):
    """How a point of a face is reached: its distance, and from where in the frame of VIA."""

    distance: float
    via: int
    """A half-edge of the face; -1 where the point is not reached"""
    sx: float
    sy: float
    root: int
    """Node of the pseudosource"""


@kernel
def reach_point(
    topology: Any, winners: Any, kept: Any, first_target: int, face: int, weights: Floats
) -> Reach:
    """Return the least way to the point of an inner face with these barycentric weights.

    ``first_target`` is the number of site rows of sources. Of equal distances that of the lower
    source wins. O(windows of the face).
    """
    geometry, nearest = topology.geometry, winners.nearest
    best, best_source, via, root = math.inf, -1, -1, -1
    sx, sy = 0.0, 0.0
    ints = kept.windows.view(np.int32)
    for h in range(3 * face, 3 * face + 3):
        x, y = point_in_frame(geometry, h, weights)
        gap = GAP * geometry[h, LENGTH]
        for i in range(kept.first[h], kept.first[h + 1]):
            w = kept.windows[i]
            sw = 0.0 if is_segment(winners.piece_ints, ints[i, ROOT]) else 1.0
            window = Window(w[B0], w[B1], w[SX], w[SY], w[SIGMA], sw, ints[i, ROOT], 0.0, -1)
            there = way_through(window, x, y, gap)
            source = nearest[ints[i, ROOT]]
            if precedence(there, source, best, best_source):
                best, best_source, via, root = min(best, there), source, h, ints[i, ROOT]
                sx, sy = w[SX], w[SY]
        corner = topology.links[h, TAIL]
        there = winners.distance[corner] + math.hypot(x, y)
        if there < math.inf and precedence(there, nearest[corner], best, best_source):
            best, best_source, via, root = min(best, there), nearest[corner], h, corner
            sx, sy = 0.0, 0.0
        for k in range(first_target if h == 3 * face else 0):
            if winners.site_ints[k, FACE] == face:
                node = winners.site_ints[k, NODE]
                px, py = point_in_frame(geometry, h, winners.site_weights[k])
                there = winners.distance[node] + math.hypot(x - px, y - py)
                if precedence(there, nearest[node], best, best_source):
                    best, best_source, via, root = min(best, there), nearest[node], h, node
                    sx, sy = px, py
        for k in range(len(winners.piece_ints) if h == 3 * face else 0):
            if winners.piece_ints[k, FACE] == face:
                node = winners.piece_ints[k, NODE]
                ends = pointer(winners.piece_ends)
                there = distance_to_segment(pointer(geometry), ends, k, h, x, y)
                there += winners.distance[node]
                if precedence(there, nearest[node], best, best_source):
                    best, best_source, via, root = min(best, there), nearest[node], h, node
                    sx, sy = 0.0, 0.0
    return Reach(best, via, sx, sy, root)
