"""Reach the apex of a face over the windows of one half-edge (section 3.2)."""

import math
from typing import Any

from geodesic_core.kernels.jit import as_ints, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    LENGTH,
    ROW,
)
from geodesic_core.kernels.planar import distance
from geodesic_core.kernels.sweep.relaxation import (
    bound_vertex,
    illuminate_vertex,
    precedence,
    relax_vertex,
)
from geodesic_core.kernels.sweep.state import (
    merging,
    source_weight,
)
from geodesic_core.kernels.sweep.window import (
    B0,
    B1,
    INTS,
    REFERENCE,
    ROOT,
    SIGMA,
    SX,
    SY,
    WIDTH,
    XI,
    straight_distance,
)
from geodesic_core.tolerances import BEND, GAP


@inlined
def reach_apex(wave: Any, h: int, count: int, ax: float, ay: float) -> tuple[int, float, float]:
    """Find the window of scratch nearest to the apex; return its index, crossing and distance.

    The distance is infinite if no window covers the apex: then none beats another for sure.

    The crossing is where the window's shortest path to the apex passes the half-edge. Windows whose
    rays cover the apex are asked first; only where none does, the two beside it, for a path that
    bends at the window's end. (To ask them all costs a tenth of the sweep and finds nothing more.)
    """
    mesh, pool = wave.mesh, wave.pool
    best, best_origin, nearest, crossing = math.inf, 0, -1, 0.0
    last_left, first_right = -1, -1  # beside the apex
    upper = math.inf
    gap = GAP * mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = pool.scratch[w + SX], pool.scratch[w + SY]
        sw = source_weight(wave, as_ints(pool.scratch)[INTS * i + ROOT])
        rise = ay * sw - sy
        x = sx * ay - ax * sy  # times rise: where the ray to the apex crosses
        if x > (pool.scratch[w + B1] + gap) * rise:
            last_left = i
        elif x < (pool.scratch[w + B0] - gap) * rise:
            if first_right < 0:
                first_right = i
        else:
            d = straight_distance(ax, ay, sx, sy, sw, pool.scratch[w + SIGMA])
            origin = wave.vertices.source_index[as_ints(pool.scratch)[INTS * i + ROOT]]
            if merging(wave):
                upper = min(upper, d + pool.scratch[w + XI])
            if precedence(d, origin, best, best_origin):
                best, best_origin, nearest = d, origin, i
                crossing = x / rise if rise > 0.0 else sx
    surcharge = 1.0
    if nearest < 0:
        surcharge += BEND
        if last_left >= 0:
            best, crossing = bent_distance(wave, last_left, ax, ay)
            nearest = last_left
        if first_right >= 0:
            d, b = bent_distance(wave, first_right, ax, ay)
            if d < best:
                best, nearest, crossing = d, first_right, b
    w, v, reference = WIDTH * nearest, mesh.links[ROW * h + APEX], -1
    if merging(wave):
        reference = as_ints(pool.scratch)[INTS * nearest + REFERENCE]
        bound_vertex(wave, v, min(upper, best + pool.scratch[w + XI]))
        if mesh.flags[v]:
            illuminate_apex(wave, h, count, nearest, ax, ay, best)
    relax_vertex(
        wave,
        v,
        best * surcharge,
        h,
        pool.scratch[w + SX],
        pool.scratch[w + SY],
        as_ints(pool.scratch)[INTS * nearest + ROOT],
        reference,
    )
    covered = surcharge == 1.0
    return nearest, crossing, best if covered else math.inf


@kernel
def illuminate_apex(
    wave: Any, h: int, count: int, nearest: int, ax: float, ay: float, best: float
) -> None:
    """Note from where the windows of scratch light the apex: a saddle, or on the boundary."""
    mesh, pool = wave.mesh, wave.pool
    v, gap = mesh.links[ROW * h + APEX], GAP * mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = pool.scratch[w + SX], pool.scratch[w + SY]
        sw = source_weight(wave, as_ints(pool.scratch)[INTS * i + ROOT])
        rise = ay * sw - sy
        x = sx * ay - ax * sy
        covers = (pool.scratch[w + B0] - gap) * rise <= x <= (pool.scratch[w + B1] + gap) * rise
        if covers:
            d = straight_distance(ax, ay, sx, sy, sw, pool.scratch[w + SIGMA])
            illuminate_vertex(wave, v, d, h, sx, sy, sw)
        elif i == nearest:
            illuminate_vertex(wave, v, best, h, sx, sy, sw)


@kernel
def bent_distance(wave: Any, i: int, ax: float, ay: float) -> tuple[float, float]:
    """Distance to the apex through the end of a window that does not cover it, and that end."""
    pool = wave.pool
    w, sw = WIDTH * i, source_weight(wave, as_ints(pool.scratch)[INTS * i + ROOT])
    sx, sy = pool.scratch[w + SX], pool.scratch[w + SY]
    b = pool.scratch[w + B0]
    if b * (ay * sw - sy) <= sx * ay - ax * sy:
        b = pool.scratch[w + B1]
    there = distance(b, sx, sy, sw)
    onward = math.sqrt((ax - b) * (ax - b) + ay * ay)
    return there + onward + pool.scratch[w + SIGMA], b
