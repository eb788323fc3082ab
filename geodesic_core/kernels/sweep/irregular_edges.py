"""The crossing history of irregular edges, against which windows that come later are trimmed.

Elsewhere the windows of a list are forgotten once they are propagated: one that comes too late to
be trimmed against them goes on in vain until a filter finds it. Over an irregular edge it would go
into several faces and from each of them back again: windows that wind about a sharp tip, from sheet
to sheet, would double at every edge. So here each window that crosses is recorded, from whichever
face it came. A later one crosses only where it is nearer than all of them and than the paths along
the edge.

Elsewhere no shortest path goes with it, into any face. Let p, an earlier one, be as near at x. Into
the faces beyond, p goes as well; into the face that it came from leads a straighter way than over
x; and what bends at an end of the edge that end emits, for it emits all around.

No shortest path crosses an edge twice: along the edge it would be shorter. So a window does not
cross one that it has crossed since its pseudosource (`has_crossed`). Rounding alone cannot tell:
about the tip of a needle, windows crossed an edge in a new stretch at each turn, nearer to the tip,
where nothing overlapped them and all ways were as long as far as numbers show. In an exact sweep a
window refers to its last crossing, and a crossing to the one before. In a merging sweep windows of
several crossings are one; there `RUNS` is the bound.

In a merging sweep distances fall short, by up to ξ. A window is dropped where earlier ones are as
near at each of its points: a path that it follows goes on with one of them. Of any other window all
is kept but what is surely longer, for between windows that share an edge there may be a wedge that
neither lights (`trimming.leaves_gap`). With the second rule alone windows wound about a tip until
they were longer by ξ, and doubled at every edge.

A recorded window is in the frame that runs from the lower vertex of the edge to the higher.
"""

from geodesic_core.kernels.front.state import View, merging
from geodesic_core.kernels.front.window import (
    DEPTH,
    INTS,
    NEXT,
    REFERENCE,
    Window,
    at_sigma,
    between,
    distance_at,
    emitted_window,
    load_window,
    reversed_window,
    store_window,
)
from geodesic_core.kernels.jit import as_ints, kernel
from geodesic_core.kernels.mesh.half_edges import AROUND, HEAD, LENGTH, ROW, TAIL
from geodesic_core.kernels.sweep.trimming import trim, wins_throughout, without
from geodesic_core.tolerances import GAP, SLACK


@kernel
def trim_against_crossings(wave: View, g: int, window: Window) -> tuple[bool, Window]:
    """Trim a window that is to go over the irregular edge of g to where it is nearest so far.

    Return whether anything is left, and it. O(windows in the crossing history), mostly.
    """
    passes, rest = nearest_part(wave, g, window, False)
    if merging(wave) and passes:
        passes, rest = nearest_part(wave, g, window, True)
    return passes, rest


@kernel
def nearest_part(wave: View, g: int, window: Window, surely: bool) -> tuple[bool, Window]:
    """Return whether a window is nearest so far anywhere on the irregular edge of g, and that part.

    With ``surely``, earlier windows count with the most that they may fall short by.
    """
    mesh, vertices, pool = wave.mesh, wave.vertices, wave.pool
    length = mesh.geometry[ROW * g + LENGTH]
    tail, head = mesh.links[ROW * g + TAIL], mesh.links[ROW * g + HEAD]
    from_tail, from_head = vertices.distance[tail], vertices.distance[head]
    if merging(wave):  # drop only windows that are surely too long
        from_tail, from_head = vertices.upper[tail], vertices.upper[head]
    at_head = emitted_window(wave, 0.0, length, 0.0, 0.0, from_head, head, 0.0)
    at_tail = emitted_window(wave, 0.0, length, length, 0.0, from_tail, tail, 0.0)
    name = lowest_half_edge(wave, g)
    width, before = window.b1 - window.b0, 2.0 * length
    while width > 0.0 and width < before - GAP * length:  # an end that one cannot cut, another may
        before = width
        window = cut_by(wave, cut_by(wave, window, at_head), at_tail)
        other = pool.crossings[name]
        while other >= 0:
            if not merging(wave) and has_crossed(wave, window, other):
                return False, window
            earlier = load_window(wave, pool.windows, other)
            if tail < head:
                earlier = reversed_window(earlier, length)
            if merging(wave) and surely:
                earlier = at_sigma(earlier, earlier.sigma + earlier.xi)
            window = cut_by(wave, window, earlier)
            other = as_ints(pool.windows)[INTS * other + NEXT]
        width = window.b1 - window.b0
        if width < before and width <= GAP * length:
            return False, window
    return True, window


@kernel
def record_crossing(wave: View, g: int, slot: int, window: Window) -> None:
    """Put a window, which takes the slot, in the crossing history of the irregular edge of g."""
    mesh, pool = wave.mesh, wave.pool
    name = lowest_half_edge(wave, g)
    if mesh.links[ROW * g + TAIL] < mesh.links[ROW * g + HEAD]:
        window = reversed_window(window, mesh.geometry[ROW * g + LENGTH])
    store_window(wave, pool.windows, slot, window)
    if not merging(wave):
        as_ints(pool.windows)[INTS * slot + DEPTH] = depth_of(wave, window.reference) + 1
    as_ints(pool.windows)[INTS * slot + NEXT] = pool.crossings[name]
    pool.crossings[name] = slot


@kernel
def has_crossed(wave: View, window: Window, crossing: int) -> bool:
    """Whether a crossing is one of those that led to a window. O(crossings between them)."""
    rows, depth = as_ints(wave.pool.windows), depth_of(wave, crossing)
    last = window.reference
    while depth_of(wave, last) > depth:
        last = rows[INTS * last + REFERENCE]
    return last == crossing


@kernel
def depth_of(wave: View, crossing: int) -> int:
    """Return how many crossings since the pseudosource led to one, itself included; 0 of none."""
    return int(as_ints(wave.pool.windows)[INTS * crossing + DEPTH]) if crossing >= 0 else 0


@kernel
def cut_by(wave: View, window: Window, earlier: Window) -> Window:
    """Return the part of a window that wins against an earlier one: ties as between sources."""
    source_index = wave.vertices.source_index
    slack = -SLACK if source_index[window.root] < source_index[earlier.root] else SLACK
    lo, hi = max(earlier.b0, window.b0), min(earlier.b1, window.b1)
    if lo < hi and is_no_nearer(lo, hi, window, earlier, slack):
        b0, b1 = without(window.b0, window.b1, lo, hi)
        return between(window, b0, b1)
    lead = slack * distance_at(window, window.b0)
    return trim(at_sigma(earlier, earlier.sigma - lead), window, 0.0, 0.0)[1]


@kernel
def is_no_nearer(lo: float, hi: float, window: Window, earlier: Window, slack: float) -> bool:
    """Whether a window is nowhere in [lo, hi] nearer than another, by a share of its own distance.

    By what rounding adds from turn to turn, a window that lies along the edge seems nearer at its
    far end than before; seen from the near end, where the source may be, that is not little.
    """
    x, straight = 0.5 * (lo + hi), earlier.weight * window.weight == 1.0
    if straight and earlier.sy != window.sy:  # where the lead is stationary: `wins_throughout`
        x = (earlier.sx * window.sy - window.sx * earlier.sy) / (window.sy - earlier.sy)
        x = min(max(x, lo), hi)
    for place in (lo, x, hi):
        own = distance_at(window, place)
        if distance_at(earlier, place) > own + slack * own:
            return False
    return straight or wins_throughout(lo, hi, earlier, window)


@kernel
def lowest_half_edge(wave: View, g: int) -> int:
    """Return the half-edge by which the irregular edge of g is known."""
    mesh = wave.mesh
    lowest, h = g, mesh.links[ROW * g + AROUND] >> 1
    while h != g:
        lowest, h = min(lowest, h), mesh.links[ROW * h + AROUND] >> 1
    return lowest
