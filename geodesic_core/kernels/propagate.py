"""Push the windows of one half-edge across its face; spawn windows at pseudosources (3.2)."""

import math
from typing import Any

from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.overlap import trim
from geodesic_core.kernels.planar import hit_left
from geodesic_core.kernels.queue import push_or_raise, ring_push
from geodesic_core.kernels.topology import (
    APEX,
    BOUNDARY,
    COS_LEFT,
    COS_RIGHT,
    FAN_ANGLE,
    FANS,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NEXT_CORNER,
    OPPOSITE,
    OUT_LEFT,
    OUT_RIGHT,
    ROW,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    following,
    previous,
)
from geodesic_core.kernels.wavefront import (
    CREATED,
    DONE,
    FIRST,
    FREE_SIZE,
    FRESH,
    FROM,
    IN_RING,
    KEPT,
    LAST,
    LIST,
    PEAK,
    SIZE,
    VIA,
    WINNER,
    WORK,
    free_windows,
    release_list,
    take_window,
)
from geodesic_core.kernels.window import B0, B1, INTS, NEXT, ROOT, SIGMA, SX, SY, WIDTH, reaches
from geodesic_core.tolerances import BEND, GAP, OVERLAP, SECTOR_MARGIN, SLACK, TIE

# Outcomes of propagating a list
PROPAGATED = 0
POOL_FULL = 1
SCRATCH_FULL = 2


@inlined
def collect(wave: Any, h: int) -> int:
    """Copy the list of h to scratch, trimmed against each other; return how many are left.

    The filters of Xin and Wang (2009) take away what a path along the edge beats: only at both
    ends of the list, where nearly all of what they would find lies.
    """
    row = ROW * h
    length = wave.geometry[row + LENGTH]
    from_tail = wave.distance[wave.links[row + TAIL]] * (1.0 + SLACK)
    from_head = wave.distance[wave.links[row + HEAD]] * (1.0 + SLACK) + length
    gap = GAP * length
    limited = wave.max_distance < math.inf
    count = 0
    p0, p1, px, py, p_sigma = 0.0, 0.0, 0.0, 0.0, 0.0  # the window last kept, also in scratch
    slot = wave.lists[LIST * h + FIRST]
    for _ in range(wave.lists[LIST * h + SIZE]):
        w = WIDTH * slot
        b0, b1 = wave.windows[w + B0], wave.windows[w + B1]
        sx, sy, sigma = wave.windows[w + SX], wave.windows[w + SY], wave.windows[w + SIGMA]
        root = wave.window_ints[INTS * slot + ROOT]
        slot = wave.window_ints[INTS * slot + NEXT]
        if limited and not reaches(b0, b1, sx, sy, sigma, wave.max_distance):
            continue
        while count > 0 and p1 >= b0:
            p0, p1, b0, b1 = trim(p0, p1, px, py, p_sigma, b0, b1, sx, sy, sigma, length)
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
        if b1 <= b0:
            continue
        if count == 0:
            room = from_tail + b1 - sigma
            if room <= 0.0 or room * room < (sx - b1) * (sx - b1) + sy * sy:
                continue
        elif b0 > p1 and b0 - p1 <= gap:
            b0 = p1
        p0, p1, px, py, p_sigma = b0, b1, sx, sy, sigma
        p = WIDTH * count
        wave.scratch[p + B0], wave.scratch[p + B1] = b0, b1
        wave.scratch[p + SX], wave.scratch[p + SY] = sx, sy
        wave.scratch[p + SIGMA] = sigma
        wave.scratch_ints[INTS * count + ROOT] = root
        count += 1
    while count > 0:
        p = WIDTH * (count - 1)
        b0, sx, sy = wave.scratch[p + B0], wave.scratch[p + SX], wave.scratch[p + SY]
        room = from_head - b0 - wave.scratch[p + SIGMA]
        if room > 0.0 and room * room >= (sx - b0) * (sx - b0) + sy * sy:
            break
        count -= 1
    return count


@inlined
def precedence(distance: float, origin: int, known: float, known_origin: int) -> bool:
    """Whether a distance from one source goes before that from another: ties to the lower."""
    if origin == known_origin or known == math.inf or abs(distance - known) > TIE * known:
        return distance < known
    return origin < known_origin


@kernel
def improve_vertex(
    wave: Any, v: int, distance: float, via: int, sx: float, sy: float, root: int
) -> None:
    """Offer v a distance and the window that gives it; queue v if it is the least so far.

    Of equal distances that of the lower source wins.
    """
    known = wave.distance[v]
    if not precedence(distance, wave.origin[root], known, wave.origin[v]):
        return
    wave.winner[2 * v] = sx
    wave.winner[2 * v + 1] = sy
    wave.winner_ints[WINNER * v + VIA] = via
    wave.winner_ints[WINNER * v + FROM] = root
    wave.origin[v] = wave.origin[root]
    if distance < known:
        wave.distance[v] = distance
        push_or_raise(wave, v)


@inlined
def reach_apex(wave: Any, h: int, count: int, ax: float, ay: float) -> tuple[int, float, float]:
    """Find the window of scratch nearest to the apex; return its index, crossing and distance.

    The crossing is where the window's shortest path to the apex passes the half-edge. Windows whose
    rays cover the apex are asked first; only where none does, the two beside it, for a path that
    bends at the window's end. (To ask them all costs a tenth of the sweep and finds nothing more.)
    """
    best, best_origin, nearest, crossing = math.inf, 0, -1, 0.0
    last_left, first_right = -1, -1  # beside the apex
    gap = GAP * wave.geometry[ROW * h + LENGTH]
    for i in range(count):
        w = WIDTH * i
        sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
        rise = ay - sy
        x = sx * ay - ax * sy  # times rise: where the ray to the apex crosses
        if x > (wave.scratch[w + B1] + gap) * rise:
            last_left = i
        elif x < (wave.scratch[w + B0] - gap) * rise:
            if first_right < 0:
                first_right = i
        else:
            d = math.sqrt((ax - sx) * (ax - sx) + rise * rise) + wave.scratch[w + SIGMA]
            origin = wave.origin[wave.scratch_ints[INTS * i + ROOT]]
            if precedence(d, origin, best, best_origin):
                best, best_origin, nearest = d, origin, i
                crossing = x / rise if rise > 0.0 else sx
    surcharge = 1.0
    if nearest < 0:
        surcharge += BEND
        if last_left >= 0:
            best, crossing = bent_distance(wave, WIDTH * last_left, ax, ay)
            nearest = last_left
        if first_right >= 0:
            d, b = bent_distance(wave, WIDTH * first_right, ax, ay)
            if d < best:
                best, nearest, crossing = d, first_right, b
    w = WIDTH * nearest
    improve_vertex(
        wave,
        wave.links[ROW * h + APEX],
        best * surcharge,
        h,
        wave.scratch[w + SX],
        wave.scratch[w + SY],
        wave.scratch_ints[INTS * nearest + ROOT],
    )
    return nearest, crossing, best


@kernel
def bent_distance(wave: Any, w: int, ax: float, ay: float) -> tuple[float, float]:
    """Distance to the apex through the end of a window that does not cover it, and that end."""
    sx, sy = wave.scratch[w + SX], wave.scratch[w + SY]
    b = wave.scratch[w + B0]
    if b * (ay - sy) <= sx * ay - ax * sy:
        b = wave.scratch[w + B1]
    there = math.sqrt((sx - b) * (sx - b) + sy * sy)
    onward = math.sqrt((ax - b) * (ax - b) + ay * ay)
    return there + onward + wave.scratch[w + SIGMA], b


@kernel
def put_window(
    wave: Any, b0: float, b1: float, sx: float, sy: float, sigma: float, root: int
) -> int:
    """Take a slot of the pool and fill it."""
    slot = take_window(wave)
    w = WIDTH * slot
    wave.windows[w + B0], wave.windows[w + B1] = b0, b1
    wave.windows[w + SX], wave.windows[w + SY] = sx, sy
    wave.windows[w + SIGMA] = sigma
    wave.window_ints[INTS * slot + ROOT] = root
    return slot


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
        rise, x = ay - sy, sx * ay - ax * sy
        goes_left = x > b0 * rise
        goes_right = x < b1 * rise
        ends_at_apex = goes_left and goes_right
        if i != nearest:
            if ends_at_apex:
                # Two windows that meet on the ray to the apex both cover it: each keeps its side.
                goes_right = x >= (crossing - overlap) * rise
                goes_left = x <= (crossing + overlap) * rise
            elif goes_left:
                if b0 >= crossing and bent_distance(wave, w, ax, ay)[0] >= least:
                    continue
            elif b1 <= crossing and bent_distance(wave, w, ax, ay)[0] >= least:
                continue
        if goes_left and left >= 0:
            s_left = sy * cos_left - sx * sin_left
            u0 = hit_left(b0, sy, s_left, sin_left, length_left)
            u1 = length_left
            if not ends_at_apex:
                u1 = hit_left(b1, sy, s_left, sin_left, length_left)
            if u1 > u0:
                along = sx * cos_left + sy * sin_left
                root = wave.scratch_ints[INTS * i + ROOT]
                slot = put_window(wave, u0, u1, along, s_left, sigma, root)
                if left_last >= 0:
                    wave.window_ints[INTS * left_last + NEXT] = slot
                else:
                    left_first = slot
                left_last = slot
                left_size += 1
        if goes_right and right >= 0:
            s_right = (sx - length) * sin_right + sy * cos_right
            u0 = hit_left(length - b1, sy, s_right, sin_right, length_right)
            u1 = length_right
            if not ends_at_apex:
                u1 = hit_left(length - b0, sy, s_right, sin_right, length_right)
            if u1 > u0:
                along = length_right + (sx - length) * cos_right - sy * sin_right
                root = wave.scratch_ints[INTS * i + ROOT]
                slot = put_window(
                    wave, length_right - u1, length_right - u0, along, s_right, sigma, root
                )
                if right_last >= 0:
                    wave.window_ints[INTS * right_last + NEXT] = slot
                else:
                    right_first = slot
                right_last = slot
                right_size += 1
    wave.counters[CREATED] += left_size + right_size
    if left_size > 0:  # they come in at the tail: before what is there
        r = LIST * left
        if wave.lists[r + SIZE] > 0:
            wave.window_ints[INTS * left_last + NEXT] = wave.lists[r + FIRST]
        else:
            wave.lists[r + LAST] = left_last
        wave.lists[r + FIRST] = left_first
        wave.lists[r + SIZE] += left_size
        queue_if_due(wave, left, tail, apex)
    if right_size > 0:  # they come in at the head: after what is there
        r = LIST * right
        if wave.lists[r + SIZE] > 0:
            wave.window_ints[INTS * wave.lists[r + LAST] + NEXT] = right_first
        else:
            wave.lists[r + FIRST] = right_first
        wave.lists[r + LAST] = right_last
        wave.lists[r + SIZE] += right_size
        queue_if_due(wave, right, apex, head)


@kernel
def queue_list(wave: Any, h: int) -> None:
    """Put h into the ring, unless it has no windows or is there already."""
    if wave.lists[LIST * h + SIZE] > 0 and not wave.lists[LIST * h + IN_RING]:
        wave.lists[LIST * h + IN_RING] = 1
        ring_push(wave, h)


@kernel
def queue_if_due(wave: Any, h: int, u: int, v: int) -> None:
    """Queue the list of h if an end of its edge (u, v) is done; else it waits for more windows."""
    if wave.status[u] == DONE or wave.status[v] == DONE:
        queue_list(wave, h)


@kernel
def propagate_list(wave: Any, h: int) -> int:
    """Propagate the windows of h across its face (section 3.2)."""
    size = wave.lists[LIST * h + SIZE]
    if 2 * size > free_windows(wave):
        return POOL_FULL
    if size > wave.scratch_size:
        return SCRATCH_FULL
    count = collect(wave, h)
    release_list(wave, h)
    wave.counters[KEPT] += count
    wave.counters[WORK] += 4 * size + 20
    if count > 0:
        row = ROW * h
        ax = wave.geometry[row + COS_LEFT] * wave.geometry[row + LENGTH_LEFT]
        ay = wave.geometry[row + SIN_LEFT] * wave.geometry[row + LENGTH_LEFT]
        nearest, crossing, least = reach_apex(wave, h, count, ax, ay)
        spread(wave, h, count, nearest, crossing, least)
        alive = wave.counters[FRESH] - wave.counters[FREE_SIZE]
        wave.counters[PEAK] = max(wave.counters[PEAK], alive)
    return PROPAGATED


@kernel
def insert_sorted(wave: Any, h: int, slot: int) -> None:
    """Insert a window into the list of h by its left end."""
    row = LIST * h
    size = wave.lists[row + SIZE]
    before, after, place = -1, wave.lists[row + FIRST], 0
    left_end = wave.windows[WIDTH * slot + B0]
    while place < size and wave.windows[WIDTH * after + B0] < left_end:
        before, after = after, wave.window_ints[INTS * after + NEXT]
        place += 1
    if place > 0:
        wave.window_ints[INTS * before + NEXT] = slot
    else:
        wave.lists[row + FIRST] = slot
    if place < size:
        wave.window_ints[INTS * slot + NEXT] = after
    else:
        wave.lists[row + LAST] = slot
    wave.lists[row + SIZE] = size + 1


@kernel
def is_pseudosource(wave: Any, v: int) -> bool:
    """Whether shortest paths may bend at v (or start there), within the limit."""
    bends = wave.flags[v] != 0 or wave.winner_ints[WINNER * v + VIA] < 0
    return bends and wave.distance[v] <= wave.max_distance


@kernel
def incoming_angle(wave: Any, v: int) -> float:
    """Angle, in the unfolded fan of v, at which v sees the pseudosource it was reached from."""
    via = wave.winner_ints[WINNER * v + VIA]
    row = ROW * via
    # From the apex: toward the tail, and toward the pseudosource
    ex = -wave.geometry[row + COS_LEFT] * wave.geometry[row + LENGTH_LEFT]
    ey = -wave.geometry[row + SIN_LEFT] * wave.geometry[row + LENGTH_LEFT]
    dx, dy = wave.winner[2 * v] + ex, wave.winner[2 * v + 1] + ey
    turn: float = math.atan2(ex * dy - ey * dx, ex * dx + ey * dy)
    corner = previous(via)
    start: float = wave.geometry[ROW * corner + FAN_ANGLE]
    return start + min(max(turn, 0.0), corner_width(wave, v, corner))


@kernel
def corner_width(wave: Any, v: int, h: int) -> float:
    """Angle at v between the half-edge h that leaves it and the next in its fan."""
    row = ROW * h
    after = wave.links[row + NEXT_CORNER]
    end: float = wave.geometry[ROW * after + FAN_ANGLE] if after >= 0 else wave.total_angle[v]
    return end - wave.geometry[row + FAN_ANGLE]


@kernel
def emit_pseudosource(wave: Any, v: int) -> None:
    """Emit windows from v (section 3.2): all around a source, else into the shadow behind v.

    At a saddle the shadow is what no straight path through a neighbourhood of v reaches: directions
    that make an angle of π or more with the incoming one on both sides. At a boundary either side
    will do. Where several fans meet, v emits all around.
    """
    everywhere = wave.winner_ints[WINNER * v + VIA] < 0 or (wave.flags[v] & FANS) != 0
    boundary = (wave.flags[v] & BOUNDARY) != 0
    total = wave.total_angle[v]
    lo0, hi0, lo1, hi1 = 0.0, total, 1.0, 0.0  # two sectors; the second is empty
    if not everywhere:
        incoming = incoming_angle(wave, v)
        lo0, hi0 = incoming + math.pi - SECTOR_MARGIN, incoming - math.pi + total + SECTOR_MARGIN
        lo1, hi1 = lo0 - total, hi0 - total
        if boundary:
            hi0, lo1 = total, 0.0
    h = wave.first_corner[v]
    while h >= 0:
        row = ROW * h
        start = wave.geometry[row + FAN_ANGLE]
        widest = corner_width(wave, v, h)
        if everywhere:
            emit_sector(wave, v, h, 0.0, widest, widest)
        else:
            emit_sector(wave, v, h, lo0 - start, hi0 - start, widest)
            emit_sector(wave, v, h, lo1 - start, hi1 - start, widest)
        # The edges at v are paths too, straight ones. To the head of h: seen as the apex of the
        # half-edge before h, which ends at v.
        before = previous(h)
        distance = wave.distance[v] + wave.geometry[row + LENGTH]
        place = wave.geometry[ROW * before + LENGTH]
        improve_vertex(wave, wave.links[row + HEAD], distance, before, place, 0.0, v)
        if wave.links[row + OUT_LEFT] < 0:  # the last edge of an open fan: from the tail of h
            distance = wave.distance[v] + wave.geometry[row + LENGTH_LEFT]
            improve_vertex(wave, wave.links[row + APEX], distance, h, 0.0, 0.0, v)
        h = wave.links[row + NEXT_CORNER]


@kernel
def emit_sector(wave: Any, v: int, h: int, lo: float, hi: float, widest: float) -> None:
    """Emit the window of v that crosses the face of h, its corner at v, between two angles.

    The angles are measured from h; what lies outside of the corner is cut off.
    """
    if hi <= 0.0 or lo >= widest or hi <= lo:
        return
    link = following(h)  # from the head of h to its apex; v is its own apex
    across = wave.links[ROW * link + OPPOSITE]
    if across < 0:
        return
    across >>= 1
    row = ROW * link
    length = wave.geometry[row + LENGTH]
    b0, b1 = 0.0, length
    # The frame of the opposite half-edge starts at the apex: distances count from its far end.
    if lo > 0.0:
        b1 = length - along_link(wave, h, lo)
    if hi < widest:
        b0 = length - along_link(wave, h, hi)
    if b1 <= b0:
        return
    sx = length - wave.geometry[row + COS_LEFT] * wave.geometry[row + LENGTH_LEFT]
    sy = -wave.geometry[row + SIN_LEFT] * wave.geometry[row + LENGTH_LEFT]
    insert_sorted(wave, across, put_window(wave, b0, b1, sx, sy, wave.distance[v], v))
    wave.counters[CREATED] += 1
    queue_if_due(wave, across, wave.links[row + TAIL], wave.links[row + HEAD])


@kernel
def along_link(wave: Any, h: int, angle: float) -> float:
    """Where the ray from the tail of h at ``angle`` meets the far edge, from the head of h."""
    row = ROW * h
    sine, cosine = math.sin(angle), math.cos(angle)
    far = sine * wave.geometry[row + COS_RIGHT] + cosine * wave.geometry[row + SIN_RIGHT]
    reach: float = wave.geometry[ROW * following(h) + LENGTH]
    if far <= 0.0:
        return reach
    place: float = wave.geometry[row + LENGTH] * sine / far
    return min(place, reach)
