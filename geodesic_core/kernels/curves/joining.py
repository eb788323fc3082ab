"""Lines in one face: where pieces of them end, joined to where other pieces start.

A line enters the face at a crossing, which counts as an end of what came before, and leaves it at a
crossing that counts as a start. So there are as many ends as starts, and each end has its start,
however the places are rounded. Where lines are straight in the face, they have no pieces: crossings
are joined to each other.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import inlined, kernel


class LooseEnds(NamedTuple):
    """Ends that are to be joined to starts, or these starts."""

    places: Floats
    """(n, 2): in the frame of the face's first half-edge"""
    ids: Ints
    """(n,): what each is the end, or the start, of"""


@inlined
def room_for_ends(count: int) -> LooseEnds:
    """Return room for some ends."""
    return LooseEnds(np.empty((count, 2)), np.empty(count, np.int32))


@inlined
def put_end(ends: Any, count: int, x: float, y: float, number: int) -> int:
    """Write an end at (x, y), with its number, to row ``count``; return the next row."""
    ends.places[count, 0], ends.places[count, 1], ends.ids[count] = x, y, number
    return count + 1


@kernel
def put_crossings(crossings: Any, is_nearer: bool, ends: Any, starts: Any, count: int) -> int:
    """Append the crossings around a face to ends and starts, by turns; return how many ends.

    A line has the lower values on its left. So it enters the face at a crossing from which the
    boundary, counter-clockwise, has higher values. ``is_nearer`` tells whether the boundary has
    lower values before the first crossing, and ``count`` how many ends, and starts, there are.
    """
    start_count = count
    for c in range(len(crossings.ids)):
        x, y = crossings.places[c, 0], crossings.places[c, 1]
        if is_nearer:
            count = put_end(ends, count, x, y, crossings.ids[c])
        else:
            start_count = put_end(starts, start_count, x, y, crossings.ids[c])
        is_nearer = not is_nearer
    return count


@kernel
def join(ends: Floats, starts: Floats) -> Ints:
    """Return for each end the start that it is joined to: the nearest pair first, and so on.

    Each round joins all pairs that are each other's nearest, of which there is at least one. Mostly
    one round of O(n²).
    """
    count = len(ends)
    joined, taken = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    nearest_start, nearest_end = np.empty(count, np.int32), np.empty(count, np.int32)
    left = count
    while left > 0:
        reach_end, reach_start = np.full(count, np.inf), np.full(count, np.inf)
        for i in range(count):
            if joined[i] >= 0:
                continue
            for j in range(count):
                if taken[j] >= 0:
                    continue
                d = math.hypot(ends[i, 0] - starts[j, 0], ends[i, 1] - starts[j, 1])
                if d < reach_end[i]:
                    reach_end[i], nearest_start[i] = d, j
                if d < reach_start[j]:
                    reach_start[j], nearest_end[j] = d, i
        for i in range(count):
            if joined[i] < 0 and nearest_end[nearest_start[i]] == i:
                joined[i], taken[nearest_start[i]] = nearest_start[i], i
                left -= 1
    return joined
