"""The borders in one face, and where they cross its edges.

The nearest region of each point of a face lies around its centre like a star: what is nearest at a
point is so on the whole ray to there. So a window that is nearest anywhere in the face is nearest
somewhere on the half-edge that it crosses, and the envelopes along the three edges tell which
regions count.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.kernels.borders import envelopes
from geodesic_core.kernels.borders.bisectors import BISECTOR, Regions, bisectors_within
from geodesic_core.kernels.curves.conics import CX, CY, is_line
from geodesic_core.kernels.curves.crossings import add_faces_across
from geodesic_core.kernels.curves.regions import RADIUS, put_side
from geodesic_core.kernels.curves.rows import ROWS, copy_rows, with_room
from geodesic_core.kernels.front.state import FACE, NODE
from geodesic_core.kernels.front.window import ROOT
from geodesic_core.kernels.jit import borrowed, kernel
from geodesic_core.kernels.mesh.half_edges import (
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    TAIL,
    half_edge_in_face,
)
from geodesic_core.kernels.retained.reached import (
    ORIGIN,
    OVER,
    REGION,
    regions_of_face,
    rows_in_face,
)
from geodesic_core.tolerances import CROSSING, GAP, LEVEL, PIECE


class Territories(NamedTuple):
    """The faces that borders may pass, with the borders there and the sources along their edges."""

    faces: Ints
    """(n,)"""
    runs: Floats
    """(R, 2): runs of one nearest source along half-edges: where each begins, and the source"""
    first_run: Ints
    """(3n + 1,): of each half-edge of the faces"""
    bisectors: Floats
    """(B, BISECTOR)"""
    first_bisector: Ints
    """(n + 1,): of each face"""


@kernel
def label_at(swept: Any, nearest: Ints, node: int, limit: float) -> int:
    """Return the source of a node; -1 where it is farther away than ``limit``."""
    return nearest[node] if swept.distance[node] <= limit else -1


@kernel
def mixed_faces(
    topology: Any, swept: Any, nearest: Ints, limit: float, first: int, last: int, mixed: Flags
) -> None:
    """Flag the faces from ``first`` up to ``last`` that windows, or points, of two sources reach.

    Writes to ``mixed`` (F,). O(windows of the faces).
    """
    windows = swept.face_windows
    ints = windows.windows.view(np.int32)
    for face in range(first, last):
        label = label_at(swept, nearest, topology.links[3 * face, TAIL], limit)
        for h in range(3 * face, 3 * face + 3):
            node = topology.links[h, TAIL]
            if label_at(swept, nearest, node, limit) != label:
                mixed[face] = True
            for i in range(windows.first[h], windows.first[h + 1]):
                if nearest[ints[i, ROOT]] != label:
                    mixed[face] = True
    for rows in (swept.site_ints, swept.segment_ints):
        begin, end = rows_in_face(rows, first)[0], rows_in_face(rows, last)[0]
        for k in range(begin, end):
            face = rows[k, FACE]
            label = label_at(swept, nearest, topology.links[3 * face, TAIL], limit)
            if nearest[rows[k, NODE]] != label:
                mixed[face] = True


@kernel
def level_of_face(topology: Any, swept: Any, face: int, limit: float) -> float:
    """Return a distance that no point of a face exceeds, or ``limit``."""
    level = limit
    for h in range(3 * face, 3 * face + 3):
        farthest = max(topology.geometry[h, LENGTH], topology.geometry[h, LENGTH_LEFT])
        level = min(level, swept.distance[topology.links[h, TAIL]] + farthest)
    return level


@kernel
def labelled_regions(topology: Any, swept: Any, nearest: Ints, face: int, limit: float) -> Regions:
    """Return the regions of a face with their sources.

    Where the face is not all within ``limit``, the last region stands for no source, -1. It is at
    that distance everywhere.
    """
    level = level_of_face(topology, swept, face, limit)
    regions, slack = regions_of_face(topology, swept, face, level), LEVEL * level
    count = len(regions)
    labels = np.full(count + 1, -1, np.int32)
    for i in range(count):
        labels[i] = nearest[int(regions[i, ORIGIN])]
    if level < limit:
        return Regions(regions, labels[:count], level, slack)
    beyond = np.zeros((count + 1, REGION))
    copy_rows(regions, beyond, 0)
    beyond[count, RADIUS], beyond[count, OVER] = np.inf, -1
    return Regions(beyond, labels, level, slack)


@kernel
def divide_faces(
    topology: Any, swept: Any, nearest: Ints, limit: float, faces: Ints, known: int, row_of: Ints
) -> tuple[Floats, Ints, Floats, Ints, Ints]:
    """Find the borders in some of the faces that they may pass; ``faces`` (n,) are their numbers.

    Returns the runs and their number for each half-edge, then the bisectors and their number for
    each face; runs and bisectors are as in `Territories`. Last come neighbours that borders lead
    to. ``row_of`` (F,) is the row of each face among all that are to be divided, -1 for none.
    ``known`` faces have rows. The call gives the neighbours the rows that follow.
    """
    topology, swept = borrowed(topology), borrowed(swept)
    links, geometry = topology.links, topology.geometry
    runs, run_count = np.empty((ROWS, 2)), 0
    curves, curve_count = np.empty((ROWS, BISECTOR)), 0
    runs_of, curves_of = np.empty(3 * len(faces), np.int32), np.empty(len(faces), np.int32)
    found, count = np.empty(ROWS, np.int32), 0
    for k in range(len(faces)):
        face, first_run = faces[k], run_count
        regions = labelled_regions(topology, swept, nearest, face, limit)
        seen = nothing_seen(len(regions.rows))
        for i in range(3):
            h = 3 * face + i
            edge, length = half_edge_in_face(geometry, h), geometry[h, LENGTH]
            stretches = envelopes.envelope_along(regions, edge, length)
            see_over(regions.rows, i, stretches, length, seen)
            ends = (
                label_at(swept, nearest, links[h, TAIL], limit),
                label_at(swept, nearest, links[h, HEAD], limit),
            )
            own = envelopes.label_runs(stretches, regions.labels, ends, length, CROSSING * length)
            runs = with_room(runs, run_count + len(own))
            copy_rows(own, runs, run_count)
            run_count += len(own)
            runs_of[3 * k + i] = len(own)
            if leads_on(own):
                found, count = add_faces_across(links, h, known, row_of, found, count)
        regions = regions_seen(geometry, face, regions, seen)
        curves_of[k] = 0
        if is_divided(runs[first_run:run_count], regions.labels):
            own_curves = bisectors_within(topology, face, regions, PIECE * regions.level)
            curves = with_room(curves, curve_count + len(own_curves))
            copy_rows(own_curves, curves, curve_count)
            curve_count += len(own_curves)
            curves_of[k] = len(own_curves)
    return runs[:run_count], runs_of, curves[:curve_count], curves_of, found[:count]


@kernel
def nothing_seen(count: int) -> Floats:
    """Return empty stretches, (n, 2), for `see_over` to widen."""
    seen = np.empty((count, 2))
    for i in range(count):
        seen[i, 0], seen[i, 1] = np.inf, -np.inf
    return seen


@kernel
def see_over(regions: Floats, i: int, stretches: Floats, length: float, seen: Floats) -> None:
    """Widen the stretches in ``seen`` to where regions of windows over the i-th edge are nearest.

    ``stretches`` are those of the envelope along the edge. A region has one row in ``seen``, which
    may also hold stretches of other regions.
    """
    for k in range(len(stretches)):
        region = int(stretches[k, envelopes.REGION])
        if region >= 0 and regions[region, OVER] == i:
            end = stretches[k + 1, envelopes.START] if k + 1 < len(stretches) else length
            seen[region, 0] = min(seen[region, 0], stretches[k, envelopes.START])
            seen[region, 1] = max(seen[region, 1], end)


@kernel
def regions_seen(geometry: Floats, face: int, regions: Regions, seen: Floats) -> Regions:
    """Return the regions that may be nearest in a face, without windows of which nothing is seen.

    Windows are narrowed to what is ``seen`` of each, a stretch of its edge. Modifies ``regions``.
    """
    rows, labels = borrowed(regions.rows), borrowed(regions.labels)
    chosen, chosen_labels, count = np.empty(rows.shape), np.empty(len(labels), np.int32), 0
    for i in range(len(rows)):
        over = int(rows[i, OVER])
        if over >= 0 and not seen[i, 0] < seen[i, 1]:
            continue
        if over >= 0:
            narrow(geometry, 3 * face + over, rows[i], seen[i])
        copy_rows(rows[i : i + 1], chosen, count)
        chosen_labels[count] = labels[i]
        count += 1
    return Regions(chosen[:count], chosen_labels[:count], regions.level, regions.slack)


@kernel
def is_divided(runs: Floats, labels: Ints) -> bool:
    """Whether several sources are nearest in a face, by the runs around it and its regions."""
    source = runs[0, 1]
    for i in range(1, len(runs)):
        if runs[i, 1] != source:
            return True
    for i in range(len(labels)):  # noqa: SIM110 - numba has no generators in any()
        if labels[i] != source:
            return True
    return False


@kernel
def narrow(geometry: Floats, h: int, region: Floats, seen: Floats) -> None:
    """Narrow the disc of a window over h to the rays through a stretch of h, widened by `GAP`."""
    if is_line(region):
        return
    ox, oy, ux, uy = half_edge_in_face(geometry, h)
    gap = GAP * geometry[h, LENGTH]
    for end in range(2):
        t = seen[0] - gap if end == 0 else seen[1] + gap
        dx, dy = ox + t * ux - region[CX], oy + t * uy - region[CY]
        length = math.hypot(dx, dy)
        if length > 0.0:
            turn = 1.0 if (ux * -dy + uy * dx > 0.0) == (end == 0) else -1.0
            put_side(region, end, -turn * dy / length, turn * dx / length, 0.0)


@kernel
def leads_on(runs: Floats) -> bool:
    """Whether a border of two sources crosses the edge with these runs."""
    for i in range(1, len(runs)):  # noqa: SIM110 - numba has no generators in any()
        if runs[i - 1, 1] >= 0 and runs[i, 1] >= 0:
            return True
    return False
