"""The apex of a face, reached over the windows of one half-edge (section 3.2)."""

import math

from geodesic_core.kernels.front.relaxation import (
    bound_vertex,
    illuminate_vertex,
    precedence,
    relax_node,
)
from geodesic_core.kernels.front.state import View, merging
from geodesic_core.kernels.front.window import Window, load_window, straight_distance
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import APEX, LENGTH, ROW
from geodesic_core.kernels.planar import distance
from geodesic_core.tolerances import BEND, GAP, MISS


@inlined
def ray_to(window: Window, x: float, y: float) -> tuple[float, float]:
    """Return where the ray to (x, y) crosses the half-edge, times its rise; and its rise, >= 0."""
    return window.sx * y - x * window.sy, y * window.weight - window.sy


@inlined
def reach_apex(wave: View, h: int, count: int, ax: float, ay: float) -> tuple[int, float, float]:
    """Reach the apex, at (ax, ay), by the nearest window of scratch; return three values.

    They are the window's index; its crossing, where its shortest path to the apex passes the
    half-edge; and its distance, infinite if no window covers the apex: then none beats another for
    sure. Windows whose rays cover the apex go first; only where none does, the two beside it, for a
    path that bends at the window's end. Windows that miss the apex by rounding are tried in any
    case. (To try all of them costs a tenth of the sweep and finds nothing more.) Modifies the
    vertex, and queues it.
    """
    mesh, scratch = wave.mesh, wave.pool.scratch
    best, best_source, nearest, crossing = math.inf, 0, -1, 0.0
    last_left, first_right, is_missed = -1, -1, False  # beside the apex
    upper = math.inf
    length = mesh.geometry[ROW * h + LENGTH]
    gap, miss = GAP * length, MISS * length
    for i in range(count):
        window = load_window(wave, scratch, i)
        x, rise = ray_to(window, ax, ay)
        if x > (window.b1 + gap) * rise:
            last_left = i
            is_missed |= x <= (window.b1 + miss) * rise
        elif x < (window.b0 - gap) * rise:
            if first_right < 0:
                first_right = i
            is_missed |= x >= (window.b0 - miss) * rise
        else:
            d, source = straight_distance(window, ax, ay), wave.vertices.source_index[window.root]
            if merging(wave):
                upper = min(upper, d + window.xi)
            if precedence(d, source, best, best_source):
                best, best_source, nearest = d, source, i
                crossing = x / rise if rise > 0.0 else window.sx
    is_covered = nearest >= 0
    if not is_covered:
        nearest, best, crossing = nearest_bent(wave, last_left, first_right, ax, ay)
    window, v = load_window(wave, scratch, nearest), mesh.links[ROW * h + APEX]
    if merging(wave):
        bound_vertex(wave, v, min(upper, best + window.xi))
        if mesh.flags[v]:
            illuminate_apex(wave, h, count, nearest, ax, ay, best)
    surcharge = 1.0 if is_covered else 1.0 + BEND
    relax_node(wave, v, best * surcharge, h, window)
    if is_missed:
        reach_past_ends(wave, h, count, ax, ay)
    return nearest, crossing, best if is_covered else math.inf


@inlined
def nearest_bent(
    wave: View, last_left: int, first_right: int, ax: float, ay: float
) -> tuple[int, float, float]:
    """Return the nearer of two windows beside the apex, its distance bent at its end, and that end.

    Either may be missing (-1), not both.
    """
    nearest, best, crossing = last_left, math.inf, 0.0
    if last_left >= 0:
        window = load_window(wave, wave.pool.scratch, last_left)
        best, crossing = bent_distance(window, ax, ay)
    if first_right >= 0:
        window = load_window(wave, wave.pool.scratch, first_right)
        d, b = bent_distance(window, ax, ay)
        if d < best:
            nearest, best, crossing = first_right, d, b
    return nearest, best, crossing


@kernel
def reach_past_ends(wave: View, h: int, count: int, ax: float, ay: float) -> None:
    """Reach the apex by the windows of scratch that just miss it, on paths that bend at their ends.

    Rounding may have left the ray to it to a window that is farther away.
    Modifies the vertex, and queues it.
    """
    v, miss = wave.mesh.links[ROW * h + APEX], MISS * wave.mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        window = load_window(wave, wave.pool.scratch, i)
        x, rise = ray_to(window, ax, ay)
        if 0.0 < max(x - window.b1 * rise, window.b0 * rise - x) <= miss * rise:
            d, _ = bent_distance(window, ax, ay)
            if merging(wave):
                bound_vertex(wave, v, d + window.xi)
                if wave.mesh.flags[v]:
                    illuminate_vertex(wave, v, d, h, window.sx, window.sy, window.weight)
            relax_node(wave, v, d * (1.0 + BEND), h, window)


@kernel
def illuminate_apex(
    wave: View, h: int, count: int, nearest: int, ax: float, ay: float, best: float
) -> None:
    """Note from where the windows of scratch light the apex: a saddle, or on the boundary.

    Modifies the light of the vertex, and may queue it.
    """
    v, gap = wave.mesh.links[ROW * h + APEX], GAP * wave.mesh.geometry[ROW * h + LENGTH]
    for i in range(count):
        window = load_window(wave, wave.pool.scratch, i)
        x, rise = ray_to(window, ax, ay)
        covers = (window.b0 - gap) * rise <= x <= (window.b1 + gap) * rise
        if covers or i == nearest:
            d = straight_distance(window, ax, ay) if covers else best
            illuminate_vertex(wave, v, d, h, window.sx, window.sy, window.weight)


@kernel
def bent_distance(window: Window, ax: float, ay: float) -> tuple[float, float]:
    """Distance to the apex through the end of a window that does not cover it, and that end."""
    x, rise = ray_to(window, ax, ay)
    b = window.b1 if window.b0 * rise <= x else window.b0
    there = distance(b, window.sx, window.sy, window.weight)
    onward = math.sqrt((ax - b) * (ax - b) + ay * ay)
    return there + onward + window.sigma, b
