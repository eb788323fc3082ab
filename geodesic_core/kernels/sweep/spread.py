"""Push the windows of one half-edge across its face (section 3.2), merged where that is asked."""

import math
from typing import Any

from geodesic_core.kernels.jit import inlined, kernel, prefetch
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    COS_RIGHT,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
    previous,
)
from geodesic_core.kernels.planar import distance, hit_left
from geodesic_core.kernels.sweep.merging import merged
from geodesic_core.kernels.sweep.relaxation import (
    bound_vertex,
    illuminate_vertex,
    precedence,
    relax_vertex,
)
from geodesic_core.kernels.sweep.state import (
    CREATED,
    FIRST,
    FREE_SIZE,
    FRESH,
    KEPT,
    LAST,
    LEFT,
    LEFT_REFERENCE,
    LIST,
    MARKS,
    MERGE,
    MERGE_INTS,
    MERGED_ON,
    MERGES,
    PEAK,
    RETAINED,
    RETAINED_ROWS,
    RIGHT,
    RIGHT_REFERENCE,
    SITE_SHIFT,
    SIZE,
    SPLIT,
    WORK,
    merging,
    source_weight,
)
from geodesic_core.kernels.sweep.surface_points import reach_sites
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
    straight_distance,
    within,
)
from geodesic_core.kernels.sweep.window_lists import (
    faces_beyond,
    free_windows,
    put_window,
    queue_if_due,
    release_list,
    send_across,
)
from geodesic_core.tolerances import BEND, GAP, LOOSE_OVERLAP, OVERLAP, RUNS, SLACK

# Outcomes of propagating a list
PROPAGATED = 0
POOL_FULL = 1
SCRATCH_FULL = 2
MERGES_FULL = 5
RUNAWAY = 6  # a list came up again and again
RETAINED_FULL = 7


@inlined
def trim_list(wave: Any, h: int) -> int:
    """Copy the list of h to scratch, trimmed against each other; return how many are left.

    The filters of Xin and Wang (2009) take away what a path along the edge beats, or what no path
    of allowed length may pass: only at both ends of the list, where nearly all of it lies.
    """
    row = ROW * h
    length = wave.geometry[row + LENGTH]
    tail, head = wave.links[row + TAIL], wave.links[row + HEAD]
    if merging(wave):  # only what is surely too long may go
        from_tail, from_head = wave.upper[tail], wave.upper[head]
    else:
        from_tail, from_head = wave.distance[tail], wave.distance[head]
    from_tail, from_head = from_tail * (1.0 + SLACK), from_head * (1.0 + SLACK)
    if wave.pruned:
        from_tail = min(from_tail, wave.limit - wave.heuristic[tail])
        from_head = min(from_head, wave.limit - wave.heuristic[head])
    from_head += length
    gap, overlap = GAP * length, OVERLAP * length
    # Merging makes few windows of many: there, none is too many to be trimmed.
    uneven_overlap = overlap if merging(wave) else LOOSE_OVERLAP * length
    limited = wave.max_distance < math.inf
    count = 0
    # The window last kept, also in scratch
    p0, p1, px, py, pw, p_sigma = 0.0, 0.0, 0.0, 0.0, 1.0, 0.0
    xi, p_xi = 0.0, 0.0
    slot = wave.lists[LIST * h + FIRST]
    for _ in range(wave.lists[LIST * h + SIZE]):
        w = WIDTH * slot
        b0, b1 = wave.windows[w + B0], wave.windows[w + B1]
        sx, sy, sigma = wave.windows[w + SX], wave.windows[w + SY], wave.windows[w + SIGMA]
        root = wave.window_ints[INTS * slot + ROOT]
        sw, reference = source_weight(wave, root), -1
        if merging(wave):
            xi, reference = wave.windows[w + XI], wave.window_ints[INTS * slot + REFERENCE]
        slot = wave.window_ints[INTS * slot + NEXT]
        if limited and not reaches(b0, b1, sx, sy, sigma, wave.max_distance, sw):
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
                wave.scratch[p + B0], wave.scratch[p + B1] = p0, p1
                break
            count -= 1
            if count > 0:
                p -= WIDTH
                p0, p1 = wave.scratch[p + B0], wave.scratch[p + B1]
                px, py = wave.scratch[p + SX], wave.scratch[p + SY]
                p_sigma = wave.scratch[p + SIGMA]
                pw = source_weight(wave, wave.scratch_ints[INTS * (count - 1) + ROOT])
                if merging(wave):
                    p_xi = wave.scratch[p + XI]
        if b1 <= b0:
            continue
        if count == 0:
            if not within(b1, sx, sy, sw, sigma, from_tail + b1):
                continue
        elif b0 > p1 and b0 - p1 <= gap:
            b0 = p1
        if merging(wave) and count > 0 and p0 <= b0 <= p1 <= b1:
            p_root = wave.scratch_ints[INTS * (count - 1) + ROOT]
            if wave.origin[p_root] == wave.origin[root] and pw * sw == 1.0:
                can, nx, ny, n_sigma, n_xi = merged(
                    wave, p0, p1, px, py, p_sigma, p_xi, b0, b1, sx, sy, sigma, xi
                )
                if can:
                    record_merge(wave, h, count - 1, sx, sy, sigma, reference)
                    p1, px, py, p_sigma, p_xi = b1, nx, ny, n_sigma, n_xi
                    put_scratch(wave, count - 1, p0, p1, px, py, p_sigma)
                    wave.scratch[WIDTH * (count - 1) + XI] = p_xi
                    continue
        p0, p1, px, py, pw, p_sigma = b0, b1, sx, sy, sw, sigma
        put_scratch(wave, count, b0, b1, sx, sy, sigma)
        wave.scratch_ints[INTS * count + ROOT] = root
        if merging(wave):
            p_xi = xi
            wave.scratch[WIDTH * count + XI] = xi
            wave.scratch_ints[INTS * count + REFERENCE] = reference
        count += 1
    while count > 0:
        p = WIDTH * (count - 1)
        b0, sx, sy = wave.scratch[p + B0], wave.scratch[p + SX], wave.scratch[p + SY]
        sw = source_weight(wave, wave.scratch_ints[INTS * (count - 1) + ROOT])
        if within(b0, sx, sy, sw, wave.scratch[p + SIGMA], from_head - b0):
            break
        count -= 1
    return count


@inlined
def put_scratch(
    wave: Any, i: int, b0: float, b1: float, sx: float, sy: float, sigma: float
) -> None:
    """Write a window to scratch."""
    w = WIDTH * i
    wave.scratch[w + B0], wave.scratch[w + B1] = b0, b1
    wave.scratch[w + SX], wave.scratch[w + SY] = sx, sy
    wave.scratch[w + SIGMA] = sigma


@kernel
def record_merge(
    wave: Any, h: int, i: int, sx: float, sy: float, sigma: float, reference: int
) -> None:
    """Note that a window is merged into that at i of scratch, if paths are wanted (4.3)."""
    if wave.merge_capacity == 0:
        return
    record = wave.counters[MERGES]
    wave.counters[MERGES] = record + 1
    m, w = MERGE * record, WIDTH * i
    wave.merges[m + SPLIT] = wave.scratch[w + B1]
    wave.merges[m + LEFT], wave.merges[m + LEFT + 1] = wave.scratch[w + SX], wave.scratch[w + SY]
    wave.merges[m + LEFT + 2] = wave.scratch[w + SIGMA]
    wave.merges[m + RIGHT], wave.merges[m + RIGHT + 1] = sx, sy
    wave.merges[m + RIGHT + 2] = sigma
    m = MERGE_INTS * record
    wave.merge_ints[m + MERGED_ON] = h
    wave.merge_ints[m + LEFT_REFERENCE] = wave.scratch_ints[INTS * i + REFERENCE]
    wave.merge_ints[m + RIGHT_REFERENCE] = reference
    wave.scratch_ints[INTS * i + REFERENCE] = record


@kernel
def retain_windows(wave: Any, h: int, count: int) -> None:
    """Keep the windows of scratch, which are those that cross the face of h."""
    first = wave.counters[RETAINED_ROWS]
    for i in range(WIDTH * count):
        wave.kept[WIDTH * first + i] = wave.scratch[i]
    for i in range(first, first + count):
        wave.kept_ints[INTS * i + NEXT] = h
    wave.counters[RETAINED_ROWS] = first + count


@inlined
def reach_apex(wave: Any, h: int, count: int, ax: float, ay: float) -> tuple[int, float, float]:
    """Find the window of scratch nearest to the apex; return its index, crossing and distance.

    The distance is infinite if no window covers the apex: then none beats another for sure.

    The crossing is where the window's shortest path to the apex passes the half-edge. Windows whose
    rays cover the apex are asked first; only where none does, the two beside it, for a path that
    bends at the window's end. (To ask them all costs a tenth of the sweep and finds nothing more.)
    """
    best, best_origin, nearest, crossing = math.inf, 0, -1, 0.0
    last_left, first_right = -1, -1  # beside the apex
    upper = math.inf
    gap = GAP * wave.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
        sw = source_weight(wave, wave.scratch_ints[INTS * i + ROOT])
        rise = ay * sw - sy
        x = sx * ay - ax * sy  # times rise: where the ray to the apex crosses
        if x > (wave.scratch[w + B1] + gap) * rise:
            last_left = i
        elif x < (wave.scratch[w + B0] - gap) * rise:
            if first_right < 0:
                first_right = i
        else:
            d = straight_distance(ax, ay, sx, sy, sw, wave.scratch[w + SIGMA])
            origin = wave.origin[wave.scratch_ints[INTS * i + ROOT]]
            if merging(wave):
                upper = min(upper, d + wave.scratch[w + XI])
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
    w, v, reference = WIDTH * nearest, wave.links[ROW * h + APEX], -1
    if merging(wave):
        reference = wave.scratch_ints[INTS * nearest + REFERENCE]
        bound_vertex(wave, v, min(upper, best + wave.scratch[w + XI]))
        if wave.flags[v]:
            illuminate_apex(wave, h, count, nearest, ax, ay, best)
    relax_vertex(
        wave,
        v,
        best * surcharge,
        h,
        wave.scratch[w + SX],
        wave.scratch[w + SY],
        wave.scratch_ints[INTS * nearest + ROOT],
        reference,
    )
    covered = surcharge == 1.0
    return nearest, crossing, best if covered else math.inf


@kernel
def illuminate_apex(
    wave: Any, h: int, count: int, nearest: int, ax: float, ay: float, best: float
) -> None:
    """Note from where the windows of scratch light the apex: a saddle, or on the boundary."""
    v, gap = wave.links[ROW * h + APEX], GAP * wave.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
        sw = source_weight(wave, wave.scratch_ints[INTS * i + ROOT])
        rise = ay * sw - sy
        x = sx * ay - ax * sy
        covers = (wave.scratch[w + B0] - gap) * rise <= x <= (wave.scratch[w + B1] + gap) * rise
        if covers:
            d = straight_distance(ax, ay, sx, sy, sw, wave.scratch[w + SIGMA])
            illuminate_vertex(wave, v, d, h, sx, sy, sw)
        elif i == nearest:
            illuminate_vertex(wave, v, best, h, sx, sy, sw)


@kernel
def bent_distance(wave: Any, i: int, ax: float, ay: float) -> tuple[float, float]:
    """Distance to the apex through the end of a window that does not cover it, and that end."""
    w, sw = WIDTH * i, source_weight(wave, wave.scratch_ints[INTS * i + ROOT])
    sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
    b = wave.scratch[w + B0]
    if b * (ay * sw - sy) <= sx * ay - ax * sy:
        b = wave.scratch[w + B1]
    there = distance(b, sx, sy, sw)
    onward = math.sqrt((ax - b) * (ax - b) + ay * ay)
    return there + onward + wave.scratch[w + SIGMA], b


@inlined
def spread(wave: Any, h: int, count: int, nearest: int, crossing: float, least: float) -> None:
    """Send the windows of scratch on to the two other edges of the face.

    Shortest paths do not cross: what lies left of the path to the apex goes left, what lies right
    of it goes right, and only the window nearest to the apex goes both ways.
    """
    row = ROW * h
    length = wave.geometry[row + LENGTH]
    cos_left, sin_left = wave.geometry[row + COS_LEFT], wave.geometry[row + SIN_LEFT]
    cos_right, sin_right = wave.geometry[row + COS_RIGHT], wave.geometry[row + SIN_RIGHT]
    length_left = wave.geometry[row + LENGTH_LEFT]
    length_right = wave.geometry[row + LENGTH_RIGHT]
    ax, ay = cos_left * length_left, sin_left * length_left
    left, right = wave.links[row + OUT_LEFT], wave.links[row + OUT_RIGHT]
    tail, head, apex = wave.links[row + TAIL], wave.links[row + HEAD], wave.links[row + APEX]
    overlap = OVERLAP * length
    left_first, left_last, left_size = -1, -1, 0
    right_first, right_last, right_size = -1, -1, 0
    for i in range(count):
        w = WIDTH * i
        b0, b1 = wave.scratch[w + B0], wave.scratch[w + B1]
        sx, sy, sigma = wave.scratch[w + SX], wave.scratch[w + SY], wave.scratch[w + SIGMA]
        xi, reference = 0.0, -1
        if merging(wave):
            xi, reference = wave.scratch[w + XI], wave.scratch_ints[INTS * i + REFERENCE]
        sw = source_weight(wave, wave.scratch_ints[INTS * i + ROOT])
        rise, x = ay * sw - sy, sx * ay - ax * sy
        goes_left = x > b0 * rise
        goes_right = x < b1 * rise
        ends_at_apex = goes_left and goes_right
        if i != nearest:
            if ends_at_apex:
                # Two windows that meet on the ray to the apex both cover it: each keeps its side.
                # Where one lies within the other, the other may have both.
                goes_right = x >= (crossing - overlap) * rise
                goes_left = x <= (crossing + overlap) * rise
                if not goes_right and b1 > crossing:
                    goes_right = not is_beaten(wave, i, nearest, crossing, b1)
                if not goes_left and b0 < crossing:
                    goes_left = not is_beaten(wave, i, nearest, crossing, b0)
            elif goes_left:
                if b0 >= crossing and bent_distance(wave, i, ax, ay)[0] >= least:
                    continue
            elif b1 <= crossing and bent_distance(wave, i, ax, ay)[0] >= least:
                continue
        if goes_left and left != NO_FACE:
            s_left = sy * cos_left - sx * sin_left
            u0 = hit_left(b0, sy, s_left, sin_left, length_left, sw)
            u1 = length_left
            if not ends_at_apex:
                u1 = hit_left(b1, sy, s_left, sin_left, length_left, sw)
            if u1 > u0:
                along = sx * cos_left + sy * sin_left
                root = wave.scratch_ints[INTS * i + ROOT]
                slot = put_window(wave, u0, u1, along, s_left, sigma, root, xi, reference)
                if left_last >= 0:
                    wave.window_ints[INTS * left_last + NEXT] = slot
                else:
                    left_first = slot
                left_last = slot
                left_size += 1
        if goes_right and right != NO_FACE:
            s_right = (sx - length * sw) * sin_right + sy * cos_right
            u0 = hit_left(length - b1, sy, s_right, sin_right, length_right, sw)
            u1 = length_right
            if not ends_at_apex:
                u1 = hit_left(length - b0, sy, s_right, sin_right, length_right, sw)
            if u1 > u0:
                along = length_right * sw + (sx - length * sw) * cos_right - sy * sin_right
                root = wave.scratch_ints[INTS * i + ROOT]
                if sw == 0.0:  # the frame begins at the apex
                    sigma -= sx * ax + sy * ay
                u0, u1 = length_right - u1, length_right - u0
                slot = put_window(wave, u0, u1, along, s_right, sigma, root, xi, reference)
                if right_last >= 0:
                    wave.window_ints[INTS * right_last + NEXT] = slot
                else:
                    right_first = slot
                right_last = slot
                right_size += 1
    wave.counters[CREATED] += left_size + right_size
    if left == IRREGULAR:
        send_chain(wave, previous(h), left_first, left_size)
    elif left_size > 0:  # they come in at the tail: before what is there
        r = LIST * left
        if wave.lists[r + SIZE] > 0:
            wave.window_ints[INTS * left_last + NEXT] = wave.lists[r + FIRST]
        else:
            wave.lists[r + LAST] = left_last
        wave.lists[r + FIRST] = left_first
        wave.lists[r + SIZE] += left_size
        queue_if_due(wave, left, tail, apex)
    if right == IRREGULAR:
        send_chain(wave, following(h), right_first, right_size)
    elif right_size > 0:  # they come in at the head: after what is there
        r = LIST * right
        if wave.lists[r + SIZE] > 0:
            wave.window_ints[INTS * wave.lists[r + LAST] + NEXT] = right_first
        else:
            wave.lists[r + FIRST] = right_first
        wave.lists[r + LAST] = right_last
        wave.lists[r + SIZE] += right_size
        queue_if_due(wave, right, apex, head)


@kernel
def is_beaten(wave: Any, i: int, nearest: int, crossing: float, b: float) -> bool:
    """Whether window i of scratch is nowhere nearest between the nearest path to the apex and b.

    That path crosses the edge at ``crossing``; window i covers it, and all up to b. Back from the
    edge both run through the same faces, until the path meets the ray of window i to b, or begins
    between its rays. Where they meet the ray is no nearer, or else window i would be nearest to the
    apex, too. Beyond an edge of several faces, though, they may have come by different ones.
    """
    w, n = WIDTH * i, WIDTH * nearest
    is_strip = (
        source_weight(wave, wave.scratch_ints[INTS * i + ROOT]) == 0.0
        or source_weight(wave, wave.scratch_ints[INTS * nearest + ROOT]) == 0.0
    )
    if merging(wave) or wave.irregular or is_strip:
        return False
    dx, dy = wave.scratch[w + SX] - b, wave.scratch[w + SY]
    nx, ny = wave.scratch[n + SX] - crossing, wave.scratch[n + SY]
    ray, path = (crossing - b) * ny, (crossing - b) * dy
    slant = dx * ny - dy * nx  # they meet at these shares of it
    if slant < 0.0:
        ray, path, slant = -ray, -path, -slant
    return 0.0 < ray <= slant and 0.0 < path <= slant


@kernel
def send_chain(wave: Any, g: int, slot: int, size: int) -> None:
    """Move windows, linked one to the next, over the irregular edge of g."""
    for _ in range(size):
        after = wave.window_ints[INTS * slot + NEXT]
        send_across(wave, g, slot)
        slot = after


@kernel
def room_to_spread(wave: Any, h: int, size: int) -> int:
    """How many windows may be made of ``size`` that cross the face of h, at most."""
    room = 2 * size
    if wave.links[ROW * h + OUT_LEFT] == IRREGULAR:
        room += size * faces_beyond(wave, previous(h))
    if wave.links[ROW * h + OUT_RIGHT] == IRREGULAR:
        room += size * faces_beyond(wave, following(h))
    return room


@kernel
def propagate_list(wave: Any, h: int) -> int:
    """Propagate the windows of h across its face (section 3.2)."""
    size = wave.lists[LIST * h + SIZE]
    prefetch(wave.lists, LIST * wave.links[ROW * h + OUT_LEFT])
    prefetch(wave.lists, LIST * wave.links[ROW * h + OUT_RIGHT])
    prefetch(wave.distance, wave.links[ROW * h + APEX])
    if room_to_spread(wave, h, size) > free_windows(wave):
        return POOL_FULL
    if size > wave.scratch_size:
        return SCRATCH_FULL
    # Asked per list, while the sweep runs: free, where a compiled switch would double the kernels.
    keeps = wave.lists[LIST * h + MARKS] & RETAINED
    if keeps and wave.counters[RETAINED_ROWS] + size > wave.keep_capacity:
        return RETAINED_FULL
    if merging(wave):
        if wave.merge_capacity > 0 and wave.counters[MERGES] + size > wave.merge_capacity:
            return MERGES_FULL
        if wave.runs[h] >= RUNS:
            return RUNAWAY
        wave.runs[h] += 1
    count = trim_list(wave, h)
    release_list(wave, h)
    if keeps:
        retain_windows(wave, h, count)
    wave.counters[KEPT] += count
    wave.counters[WORK] += 4 * size + 20
    if count > 0:
        row = ROW * h
        ax = wave.geometry[row + COS_LEFT] * wave.geometry[row + LENGTH_LEFT]
        ay = wave.geometry[row + SIN_LEFT] * wave.geometry[row + LENGTH_LEFT]
        nearest, crossing, least = reach_apex(wave, h, count, ax, ay)
        if wave.lists[LIST * h + MARKS] >> SITE_SHIFT:
            reach_sites(wave, h, count)
        spread(wave, h, count, nearest, crossing, least)
        alive = wave.counters[FRESH] - wave.counters[FREE_SIZE]
        wave.counters[PEAK] = max(wave.counters[PEAK], alive)
    return PROPAGATED
