"""The list of one half-edge trimmed, filtered and, in a merging sweep, merged (3.3, 3.4, 4.1)."""

from typing import NamedTuple

from geodesic_core.kernels.front.counters import MERGES
from geodesic_core.kernels.front.state import (
    FIRST,
    LEFT,
    LEFT_REFERENCE,
    LIST,
    MERGE,
    MERGE_INTS,
    MERGED_ON,
    RIGHT,
    RIGHT_REFERENCE,
    SIZE,
    SPLIT,
    WIDTH,
    View,
    is_pruned,
    merging,
)
from geodesic_core.kernels.front.window import (
    B0,
    B1,
    INTS,
    NEXT,
    NO_WINDOW,
    Window,
    between,
    is_beyond,
    is_within,
    load_window,
    referring_to,
    store_window,
)
from geodesic_core.kernels.jit import as_ints, inlined, kernel
from geodesic_core.kernels.mesh.half_edges import HEAD, LENGTH, ROW, TAIL
from geodesic_core.kernels.sweep.merging import merged
from geodesic_core.kernels.sweep.trimming import leaves_gap, trim
from geodesic_core.tolerances import GAP, LOOSE_OVERLAP, OVERLAP, SLACK


class EdgeLimits(NamedTuple):
    """The measures by which the windows of one half-edge are trimmed; mesh units."""

    from_tail: float
    """A window whose distance at x exceeds this + x is farther than the path over the tail"""
    from_head: float
    """The same for the head, and this - x"""
    gap: float
    """Gaps up to this are closed"""
    overlap: float
    """Overlaps up to this are left alone"""
    uneven_overlap: float
    """The same between windows of different σ"""


@inlined
def limits_of(wave: View, h: int) -> EdgeLimits:
    """Return the measures for the half-edge h.

    The filters of Xin and Wang (2009) drop windows that a path along the edge beats, or that no
    path of allowed length may pass.
    """
    mesh, vertices = wave.mesh, wave.vertices
    length = mesh.geometry[ROW * h + LENGTH]
    tail, head = mesh.links[ROW * h + TAIL], mesh.links[ROW * h + HEAD]
    if merging(wave):  # drop only windows that are surely too long
        from_tail, from_head = vertices.upper[tail], vertices.upper[head]
    else:
        from_tail, from_head = vertices.distance[tail], vertices.distance[head]
    from_tail, from_head = from_tail * (1.0 + SLACK), from_head * (1.0 + SLACK)
    if is_pruned(wave):
        limit = wave.bounds.pruning.limit
        from_tail = min(from_tail, limit - vertices.heuristic[tail])
        from_head = min(from_head, limit - vertices.heuristic[head])
    # Merging makes few windows of many: there, none is too many to be trimmed.
    uneven_overlap = OVERLAP if merging(wave) else LOOSE_OVERLAP
    return EdgeLimits(
        from_tail, from_head + length, GAP * length, OVERLAP * length, uneven_overlap * length
    )


@inlined
def trim_list(wave: View, h: int) -> int:
    """Copy the list of h to scratch, trimmed against each other; return how many are left.

    Filters apply at both ends of the list only, where nearly all that they find lies. Modifies
    scratch, and the record of merges.
    """
    pool, limits = wave.pool, limits_of(wave, h)
    last, count = NO_WINDOW, 0  # the window last stored in scratch, and how many are there
    slot = pool.lists[LIST * h + FIRST]
    for _ in range(pool.lists[LIST * h + SIZE]):
        new = load_window(wave, pool.windows, slot)
        slot = as_ints(pool.windows)[INTS * slot + NEXT]
        if is_beyond(wave, new):  # by a limit that has become narrower
            continue
        last, new, count = trim_against_earlier(wave, limits, last, new, count)
        if new.b1 <= new.b0:
            continue
        if count == 0:
            if not is_within(new, new.b1, limits.from_tail + new.b1):
                continue
        elif new.b0 > last.b1 and new.b0 - last.b1 <= limits.gap:
            new = between(new, last.b1, new.b1)
        if merging(wave) and count > 0:
            is_merged, last = merge_into(wave, h, last, new)
            if is_merged:
                store_window(wave, pool.scratch, count - 1, last)
                continue
        last = new
        store_window(wave, pool.scratch, count, new)
        count += 1
    return without_covered_tail(wave, limits.from_head, count)


@inlined
def trim_against_earlier(
    wave: View, limits: EdgeLimits, last: Window, new: Window, count: int
) -> tuple[Window, Window, int]:
    """Trim a window and those in scratch that overlap it, from the last one on.

    Return the last one that is left, the new one, and the number left. Modifies scratch.
    """
    scratch = wave.pool.scratch
    while count > 0 and last.b1 >= new.b0:
        earlier, later = trim(last, new, limits.overlap, limits.uneven_overlap)
        if merging(wave) and leaves_gap(earlier, later):
            break
        last, new = earlier, later
        if last.b1 > last.b0:
            w = WIDTH * (count - 1)
            scratch[w + B0], scratch[w + B1] = last.b0, last.b1
            break
        count -= 1
        if count > 0:
            last = load_window(wave, scratch, count - 1)
    return last, new, count


@inlined
def without_covered_tail(wave: View, from_head: float, count: int) -> int:
    """Return how many windows of scratch are left, less those at its end beyond ``from_head``."""
    while count > 0:
        window = load_window(wave, wave.pool.scratch, count - 1)
        if is_within(window, window.b0, from_head - window.b0):
            break
        count -= 1
    return count


@inlined
def merge_into(wave: View, h: int, last: Window, new: Window) -> tuple[bool, Window]:
    """Merge the window ``new`` into the last one of h, if both are of one source and it is allowed.

    Return whether they are merged, and what the last one is then. Modifies the record of merges.
    """
    source_index = wave.vertices.source_index
    if not last.b0 <= new.b0 <= last.b1 <= new.b1:
        return False, last
    if source_index[last.root] != source_index[new.root] or last.weight * new.weight != 1.0:
        return False, last
    is_merged, whole = merged(wave, last, new)
    if not is_merged:
        return False, last
    return True, referring_to(whole, record_merge(wave, h, last, new))


@kernel
def record_merge(wave: View, h: int, last: Window, new: Window) -> int:
    """Record that ``new`` is merged into ``last``, if paths are wanted (4.3); return the reference.

    Modifies the record of merges.
    """
    floats, ints = wave.merges
    if wave.sizes.merges == 0:
        return last.reference
    record = wave.counters[MERGES]
    wave.counters[MERGES] = record + 1
    m, i = MERGE * record, MERGE_INTS * record
    floats[m + SPLIT] = last.b1
    floats[m + LEFT], floats[m + LEFT + 1], floats[m + LEFT + 2] = last.sx, last.sy, last.sigma
    floats[m + RIGHT], floats[m + RIGHT + 1], floats[m + RIGHT + 2] = new.sx, new.sy, new.sigma
    ints[i + MERGED_ON] = h
    ints[i + LEFT_REFERENCE], ints[i + RIGHT_REFERENCE] = last.reference, new.reference
    return record
