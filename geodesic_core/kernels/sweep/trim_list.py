"""Trim the windows of one half-edge against each other, and merge them (sections 3.3, 3.4, 4.1)."""

import math
from typing import Any

from geodesic_core.kernels.jit import as_ints, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import (
    HEAD,
    LENGTH,
    ROW,
    TAIL,
)
from geodesic_core.kernels.sweep.merging import merged
from geodesic_core.kernels.sweep.state import (
    FIRST,
    LEFT,
    LEFT_REFERENCE,
    LIST,
    MERGE,
    MERGE_INTS,
    MERGED_ON,
    MERGES,
    RIGHT,
    RIGHT_REFERENCE,
    SIZE,
    SPLIT,
    is_pruned,
    merging,
    source_weight,
)
from geodesic_core.kernels.sweep.trimming import leaves_gap, trim
from geodesic_core.kernels.sweep.window import (
    B0,
    B1,
    INTS,
    NEXT,
    REFERENCE,
    ROOT,
    SIGMA,
    SX,
    SY,
    WIDTH,
    XI,
    reaches,
    within,
)
from geodesic_core.tolerances import GAP, LOOSE_OVERLAP, OVERLAP, SLACK


@inlined
def trim_list(wave: Any, h: int) -> int:
    """Copy the list of h to scratch, trimmed against each other; return how many are left.

    The filters of Xin and Wang (2009) take away what a path along the edge beats, or what no path
    of allowed length may pass: only at both ends of the list, where nearly all of it lies.
    """
    mesh, pool, vertices = wave.mesh, wave.pool, wave.vertices
    row = ROW * h
    length = mesh.geometry[row + LENGTH]
    tail, head = mesh.links[row + TAIL], mesh.links[row + HEAD]
    if merging(wave):  # only what is surely too long may go
        from_tail, from_head = vertices.upper[tail], vertices.upper[head]
    else:
        from_tail, from_head = vertices.distance[tail], vertices.distance[head]
    from_tail, from_head = from_tail * (1.0 + SLACK), from_head * (1.0 + SLACK)
    if is_pruned(wave):
        from_tail = min(from_tail, wave.bounds.pruning.limit - vertices.heuristic[tail])
        from_head = min(from_head, wave.bounds.pruning.limit - vertices.heuristic[head])
    from_head += length
    gap, overlap = GAP * length, OVERLAP * length
    # Merging makes few windows of many: there, none is too many to be trimmed.
    uneven_overlap = overlap if merging(wave) else LOOSE_OVERLAP * length
    limited = wave.bounds.max_distance < math.inf
    count = 0
    # The window last kept, also in scratch
    p0, p1, px, py, pw, p_sigma = 0.0, 0.0, 0.0, 0.0, 1.0, 0.0
    xi, p_xi = 0.0, 0.0
    slot = pool.lists[LIST * h + FIRST]
    for _ in range(pool.lists[LIST * h + SIZE]):
        w = WIDTH * slot
        b0, b1 = pool.windows[w + B0], pool.windows[w + B1]
        sx, sy, sigma = (
            pool.windows[w + SX],
            pool.windows[w + SY],
            pool.windows[w + SIGMA],
        )
        root = as_ints(pool.windows)[INTS * slot + ROOT]
        sw, reference = source_weight(wave, root), -1
        if merging(wave):
            xi, reference = (
                pool.windows[w + XI],
                as_ints(pool.windows)[INTS * slot + REFERENCE],
            )
        slot = as_ints(pool.windows)[INTS * slot + NEXT]
        if limited and not reaches(b0, b1, sx, sy, sigma, wave.bounds.max_distance, sw):
            continue
        while count > 0 and p1 >= b0:
            old_p0, old_p1, old_b0, old_b1 = p0, p1, b0, b1
            p0, p1, b0, b1 = trim(
                p0, p1, px, py, p_sigma, b0, b1, sx, sy, sigma, overlap, uneven_overlap, pw, sw
            )
            if merging(wave) and leaves_gap(
                p0, p1, px, py, p_sigma + p_xi, b0, b1, sx, sy, sigma + xi, p_sigma, sigma, pw, sw
            ):
                p0, p1, b0, b1 = old_p0, old_p1, old_b0, old_b1
                break
            p = WIDTH * (count - 1)
            if p1 > p0:
                pool.scratch[p + B0], pool.scratch[p + B1] = p0, p1
                break
            count -= 1
            if count > 0:
                p -= WIDTH
                p0, p1 = pool.scratch[p + B0], pool.scratch[p + B1]
                px, py = pool.scratch[p + SX], pool.scratch[p + SY]
                p_sigma = pool.scratch[p + SIGMA]
                pw = source_weight(wave, as_ints(pool.scratch)[INTS * (count - 1) + ROOT])
                if merging(wave):
                    p_xi = pool.scratch[p + XI]
        if b1 <= b0:
            continue
        if count == 0:
            if not within(b1, sx, sy, sw, sigma, from_tail + b1):
                continue
        elif b0 > p1 and b0 - p1 <= gap:
            b0 = p1
        if merging(wave) and count > 0 and p0 <= b0 <= p1 <= b1:
            p_root = as_ints(pool.scratch)[INTS * (count - 1) + ROOT]
            if vertices.source_index[p_root] == vertices.source_index[root] and pw * sw == 1.0:
                can, nx, ny, n_sigma, n_xi = merged(
                    wave, p0, p1, px, py, p_sigma, p_xi, b0, b1, sx, sy, sigma, xi
                )
                if can:
                    record_merge(wave, h, count - 1, sx, sy, sigma, reference)
                    p1, px, py, p_sigma, p_xi = b1, nx, ny, n_sigma, n_xi
                    put_scratch(wave, count - 1, p0, p1, px, py, p_sigma)
                    pool.scratch[WIDTH * (count - 1) + XI] = p_xi
                    continue
        p0, p1, px, py, pw, p_sigma = b0, b1, sx, sy, sw, sigma
        put_scratch(wave, count, b0, b1, sx, sy, sigma)
        as_ints(pool.scratch)[INTS * count + ROOT] = root
        if merging(wave):
            p_xi = xi
            pool.scratch[WIDTH * count + XI] = xi
            as_ints(pool.scratch)[INTS * count + REFERENCE] = reference
        count += 1
    while count > 0:
        p = WIDTH * (count - 1)
        b0, sx, sy = pool.scratch[p + B0], pool.scratch[p + SX], pool.scratch[p + SY]
        sw = source_weight(wave, as_ints(pool.scratch)[INTS * (count - 1) + ROOT])
        if within(b0, sx, sy, sw, pool.scratch[p + SIGMA], from_head - b0):
            break
        count -= 1
    return count


@inlined
def put_scratch(
    wave: Any, i: int, b0: float, b1: float, sx: float, sy: float, sigma: float
) -> None:
    """Write a window to scratch."""
    pool = wave.pool
    w = WIDTH * i
    pool.scratch[w + B0], pool.scratch[w + B1] = b0, b1
    pool.scratch[w + SX], pool.scratch[w + SY] = sx, sy
    pool.scratch[w + SIGMA] = sigma


@kernel
def record_merge(
    wave: Any, h: int, i: int, sx: float, sy: float, sigma: float, reference: int
) -> None:
    """Note that a window is merged into that at i of scratch, if paths are wanted (4.3)."""
    pool = wave.pool
    if wave.sizes.merges == 0:
        return
    record = wave.counters[MERGES]
    wave.counters[MERGES] = record + 1
    m, w = MERGE * record, WIDTH * i
    pool.merges[m + SPLIT] = pool.scratch[w + B1]
    pool.merges[m + LEFT], pool.merges[m + LEFT + 1] = (
        pool.scratch[w + SX],
        pool.scratch[w + SY],
    )
    pool.merges[m + LEFT + 2] = pool.scratch[w + SIGMA]
    pool.merges[m + RIGHT], pool.merges[m + RIGHT + 1] = sx, sy
    pool.merges[m + RIGHT + 2] = sigma
    m = MERGE_INTS * record
    pool.merge_ints[m + MERGED_ON] = h
    pool.merge_ints[m + LEFT_REFERENCE] = as_ints(pool.scratch)[INTS * i + REFERENCE]
    pool.merge_ints[m + RIGHT_REFERENCE] = reference
    as_ints(pool.scratch)[INTS * i + REFERENCE] = record
