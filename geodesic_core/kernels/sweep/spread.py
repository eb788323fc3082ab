"""Send the windows of one half-edge on to the two other edges of its face (section 3.2)."""

from typing import Any

from geodesic_core.kernels.jit import as_ints, inlined, kernel
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
from geodesic_core.kernels.planar import hit_left
from geodesic_core.kernels.sweep.reach import bent_distance
from geodesic_core.kernels.sweep.state import (
    CREATED,
    FIRST,
    LAST,
    LIST,
    SIZE,
    merging,
    source_weight,
)
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
)
from geodesic_core.kernels.sweep.window_lists import (
    faces_beyond,
    put_window,
    queue_if_due,
    send_across,
)
from geodesic_core.tolerances import OVERLAP


@inlined
def spread(wave: Any, h: int, count: int, nearest: int, crossing: float, least: float) -> None:
    """Send the windows of scratch on to the two other edges of the face.

    Shortest paths do not cross: what lies left of the path to the apex goes left, what lies right
    of it goes right, and only the window nearest to the apex goes both ways.
    """
    mesh, pool = wave.mesh, wave.pool
    row = ROW * h
    length = mesh.geometry[row + LENGTH]
    cos_left, sin_left = mesh.geometry[row + COS_LEFT], mesh.geometry[row + SIN_LEFT]
    cos_right, sin_right = mesh.geometry[row + COS_RIGHT], mesh.geometry[row + SIN_RIGHT]
    length_left = mesh.geometry[row + LENGTH_LEFT]
    length_right = mesh.geometry[row + LENGTH_RIGHT]
    ax, ay = cos_left * length_left, sin_left * length_left
    left, right = mesh.links[row + OUT_LEFT], mesh.links[row + OUT_RIGHT]
    tail, head, apex = (
        mesh.links[row + TAIL],
        mesh.links[row + HEAD],
        mesh.links[row + APEX],
    )
    overlap = OVERLAP * length
    left_first, left_last, left_size = -1, -1, 0
    right_first, right_last, right_size = -1, -1, 0
    for i in range(count):
        w = WIDTH * i
        b0, b1 = pool.scratch[w + B0], pool.scratch[w + B1]
        sx, sy, sigma = (
            pool.scratch[w + SX],
            pool.scratch[w + SY],
            pool.scratch[w + SIGMA],
        )
        xi, reference = 0.0, -1
        if merging(wave):
            xi, reference = (
                pool.scratch[w + XI],
                as_ints(pool.scratch)[INTS * i + REFERENCE],
            )
        sw = source_weight(wave, as_ints(pool.scratch)[INTS * i + ROOT])
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
                root = as_ints(pool.scratch)[INTS * i + ROOT]
                slot = put_window(wave, u0, u1, along, s_left, sigma, root, xi, reference)
                if left_last >= 0:
                    as_ints(pool.windows)[INTS * left_last + NEXT] = slot
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
                root = as_ints(pool.scratch)[INTS * i + ROOT]
                if sw == 0.0:  # the frame begins at the apex
                    sigma -= sx * ax + sy * ay
                u0, u1 = length_right - u1, length_right - u0
                slot = put_window(wave, u0, u1, along, s_right, sigma, root, xi, reference)
                if right_last >= 0:
                    as_ints(pool.windows)[INTS * right_last + NEXT] = slot
                else:
                    right_first = slot
                right_last = slot
                right_size += 1
    wave.counters[CREATED] += left_size + right_size
    if left == IRREGULAR:
        send_chain(wave, previous(h), left_first, left_size)
    elif left_size > 0:  # they come in at the tail: before what is there
        r = LIST * left
        if pool.lists[r + SIZE] > 0:
            as_ints(pool.windows)[INTS * left_last + NEXT] = pool.lists[r + FIRST]
        else:
            pool.lists[r + LAST] = left_last
        pool.lists[r + FIRST] = left_first
        pool.lists[r + SIZE] += left_size
        queue_if_due(wave, left, tail, apex)
    if right == IRREGULAR:
        send_chain(wave, following(h), right_first, right_size)
    elif right_size > 0:  # they come in at the head: after what is there
        r = LIST * right
        if pool.lists[r + SIZE] > 0:
            as_ints(pool.windows)[INTS * pool.lists[r + LAST] + NEXT] = right_first
        else:
            pool.lists[r + FIRST] = right_first
        pool.lists[r + LAST] = right_last
        pool.lists[r + SIZE] += right_size
        queue_if_due(wave, right, apex, head)


@kernel
def is_beaten(wave: Any, i: int, nearest: int, crossing: float, b: float) -> bool:
    """Whether window i of scratch is nowhere nearest between the nearest path to the apex and b.

    That path crosses the edge at ``crossing``; window i covers it, and all up to b. Back from the
    edge both run through the same faces, until the path meets the ray of window i to b, or begins
    between its rays. Where they meet the ray is no nearer, or else window i would be nearest to the
    apex, too. Beyond an edge of several faces, though, they may have come by different ones.
    """
    pool = wave.pool
    w, n = WIDTH * i, WIDTH * nearest
    is_strip = (
        source_weight(wave, as_ints(pool.scratch)[INTS * i + ROOT]) == 0.0
        or source_weight(wave, as_ints(pool.scratch)[INTS * nearest + ROOT]) == 0.0
    )
    if merging(wave) or wave.sizes.crossings > 0 or is_strip:
        return False
    dx, dy = pool.scratch[w + SX] - b, pool.scratch[w + SY]
    nx, ny = pool.scratch[n + SX] - crossing, pool.scratch[n + SY]
    ray, path = (crossing - b) * ny, (crossing - b) * dy
    slant = dx * ny - dy * nx  # they meet at these shares of it
    if slant < 0.0:
        ray, path, slant = -ray, -path, -slant
    return 0.0 < ray <= slant and 0.0 < path <= slant


@kernel
def send_chain(wave: Any, g: int, slot: int, size: int) -> None:
    """Move windows, linked one to the next, over the irregular edge of g."""
    for _ in range(size):
        after = as_ints(wave.pool.windows)[INTS * slot + NEXT]
        send_across(wave, g, slot)
        slot = after


@kernel
def room_to_spread(wave: Any, h: int, size: int) -> int:
    """How many windows may be made of ``size`` that cross the face of h, at most."""
    mesh = wave.mesh
    room = 2 * size
    if mesh.links[ROW * h + OUT_LEFT] == IRREGULAR:
        room += size * faces_beyond(wave, previous(h))
    if mesh.links[ROW * h + OUT_RIGHT] == IRREGULAR:
        room += size * faces_beyond(wave, following(h))
    return room
