"""What went over an irregular edge, which a window that comes there later must be nearer than.

Elsewhere the windows of a list are forgotten once they are propagated: one that comes too late to
be trimmed against them goes on in vain until a filter finds it. Over an irregular edge it would go
into several faces and from each of them back again: windows that wind about a sharp tip, from sheet
to sheet, would double at every edge. So here what passes is kept, whichever face it came from, and
a newcomer passes only where it is nearer than all of it and than the paths along the edge.

Elsewhere no shortest path goes with it, into any face. Let p, which passed before, be as near at x.
Into the faces beyond, p goes as well; into the face that it came from leads a straighter way than
over x; and what bends at an end of the edge that end emits, for it emits all around.

What passed is kept in the frame that runs from the lower vertex of the edge to the higher.
"""

from typing import Any

from geodesic_core.kernels.jit import as_ints, kernel
from geodesic_core.kernels.mesh.half_edges import AROUND, HEAD, LENGTH, ROW, TAIL
from geodesic_core.kernels.sweep.state import merging, source_weight
from geodesic_core.kernels.sweep.trimming import trim, wins_throughout, without
from geodesic_core.kernels.sweep.window import (
    B0,
    B1,
    INTS,
    NEXT,
    ROOT,
    SIGMA,
    SX,
    SY,
    WIDTH,
    XI,
    distance_at,
)
from geodesic_core.tolerances import GAP, SLACK


@kernel
def trim_against_crossings(wave: Any, g: int, slot: int) -> bool:
    """Trim a window that is to go over the irregular edge of g to where it is nearest so far.

    Return whether anything is left. O(windows that passed), mostly.
    """
    mesh, pool, vertices = wave.mesh, wave.pool, wave.vertices
    w, length = WIDTH * slot, mesh.geometry[ROW * g + LENGTH]
    tail, head = mesh.links[ROW * g + TAIL], mesh.links[ROW * g + HEAD]
    name, flip = lowest_half_edge(wave, g), tail < head
    from_tail, from_head = vertices.distance[tail], vertices.distance[head]
    if merging(wave):  # only what is surely too long may go
        from_tail, from_head = vertices.upper[tail], vertices.upper[head]
    before = 2.0 * length
    b0, b1 = pool.windows[w + B0], pool.windows[w + B1]
    while b1 > b0 and b1 - b0 < before - GAP * length:  # what one cannot end, another may
        before = b1 - b0
        cut_by(wave, slot, 0.0, length, 0.0, 0.0, from_head, head)
        cut_by(wave, slot, 0.0, length, length, 0.0, from_tail, tail)
        other = pool.crossings[name]
        while other >= 0:
            p = WIDTH * other
            p0, p1, px = (
                pool.windows[p + B0],
                pool.windows[p + B1],
                pool.windows[p + SX],
            )
            py, sigma = pool.windows[p + SY], pool.windows[p + SIGMA]
            root = as_ints(pool.windows)[INTS * other + ROOT]
            if flip:
                p0, p1 = length - p1, length - p0
                px, sigma = mirrored(px, source_weight(wave, root), sigma, length)
            if merging(wave):
                sigma += pool.windows[p + XI]
            cut_by(wave, slot, p0, p1, px, py, sigma, root)
            other = as_ints(pool.windows)[INTS * other + NEXT]
        c0, c1 = pool.windows[w + B0], pool.windows[w + B1]
        if c1 - c0 < b1 - b0 and c1 - c0 <= GAP * length:
            return False
        b0, b1 = c0, c1
    return True


@kernel
def record_crossing(wave: Any, g: int, slot: int) -> None:
    """Keep a window that went over the irregular edge of g."""
    mesh, pool = wave.mesh, wave.pool
    name = lowest_half_edge(wave, g)
    if mesh.links[ROW * g + TAIL] < mesh.links[ROW * g + HEAD]:
        mirror(wave, slot, mesh.geometry[ROW * g + LENGTH])
    as_ints(pool.windows)[INTS * slot + NEXT] = pool.crossings[name]
    pool.crossings[name] = slot


@kernel
def mirror(wave: Any, slot: int, length: float) -> None:
    """Turn a window into the frame that runs along its edge the other way."""
    pool = wave.pool
    w = WIDTH * slot
    b0, b1 = pool.windows[w + B0], pool.windows[w + B1]
    pool.windows[w + B0], pool.windows[w + B1] = length - b1, length - b0
    sw = source_weight(wave, as_ints(pool.windows)[INTS * slot + ROOT])
    sx, sigma = mirrored(pool.windows[w + SX], sw, pool.windows[w + SIGMA], length)
    pool.windows[w + SX], pool.windows[w + SIGMA] = sx, sigma


@kernel
def mirrored(sx: float, sw: float, sigma: float, length: float) -> tuple[float, float]:
    """Return sx and σ of a pseudosource in the frame that runs along the edge the other way."""
    return length * sw - sx, sigma if sw == 1.0 else sigma - sx * length


@kernel
def cut_by(
    wave: Any, slot: int, p0: float, p1: float, px: float, py: float, p_sigma: float, root: int
) -> None:
    """Leave of a window what it wins against p, which came before: ties as between sources."""
    pool, vertices = wave.pool, wave.vertices
    w = WIDTH * slot
    b0, b1 = pool.windows[w + B0], pool.windows[w + B1]
    sx, sy, sigma = (
        pool.windows[w + SX],
        pool.windows[w + SY],
        pool.windows[w + SIGMA],
    )
    own_root = as_ints(pool.windows)[INTS * slot + ROOT]
    pw, sw = source_weight(wave, root), source_weight(wave, own_root)
    slack = -SLACK if vertices.source_index[own_root] < vertices.source_index[root] else SLACK
    lo, hi = max(p0, b0), min(p1, b1)
    if lo < hi and is_no_nearer(lo, hi, sx, sy, sigma, sw, px, py, p_sigma, pw, slack):
        b0, b1 = without(b0, b1, lo, hi)
    else:
        p_sigma -= slack * distance_at(b0, sx, sy, sigma, sw)
        p0, p1, b0, b1 = trim(p0, p1, px, py, p_sigma, b0, b1, sx, sy, sigma, 0.0, 0.0, pw, sw)
    pool.windows[w + B0], pool.windows[w + B1] = b0, b1


@kernel
def is_no_nearer(
    lo: float,
    hi: float,
    sx: float,
    sy: float,
    sigma: float,
    sw: float,
    px: float,
    py: float,
    p_sigma: float,
    pw: float,
    slack: float,
) -> bool:
    """Whether a window is nowhere in [lo, hi] nearer than p, by a share of its own distance there.

    By what rounding adds from turn to turn, a window that lies along the edge seems nearer at its
    far end than before; seen from the near end, where the source may be, that is not little.
    """
    x = 0.5 * (lo + hi)
    if pw * sw == 1.0 and py != sy:  # where the lead is stationary: see `wins_throughout`
        x = min(max((px * sy - sx * py) / (sy - py), lo), hi)
    for place in (lo, x, hi):
        own = distance_at(place, sx, sy, sigma, sw)
        if distance_at(place, px, py, p_sigma, pw) > own + slack * own:
            return False
    return pw * sw == 1.0 or wins_throughout(lo, hi, px, py, p_sigma, sx, sy, sigma, pw, sw)


@kernel
def lowest_half_edge(wave: Any, g: int) -> int:
    """Return the half-edge by which the irregular edge of g is known."""
    mesh = wave.mesh
    lowest, h = g, mesh.links[ROW * g + AROUND] >> 1
    while h != g:
        lowest, h = min(lowest, h), mesh.links[ROW * h + AROUND] >> 1
    return lowest
