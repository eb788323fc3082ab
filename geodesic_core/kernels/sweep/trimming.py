"""Two windows that overlap on one edge: trimmed to where each is nearest (sections 3.3 and 3.4)."""

from geodesic_core.kernels.front.window import Window, between, distance_at
from geodesic_core.kernels.jit import inlined
from geodesic_core.kernels.planar import Source, bisector, bracketed, distance
from geodesic_core.tolerances import DIVERGING


@inlined
def wins_throughout(lo: float, hi: float, winner: Window, loser: Window) -> bool:
    """Whether a window that wins at both ends of [lo, hi] wins between them too.

    The loser's lead is stationary only where the point and both sources are collinear. There is one
    such point; if it lies outside, or the winner leads there as well, the winner leads throughout.
    Between a parallel window and another there is one, too; distances of a parallel one are linear,
    the others' convex, so that only the latter can win between two ends that they lost.
    """
    wx, wy, lx, ly = winner.sx, winner.sy, loser.sx, loser.sy
    if winner.weight * loser.weight == 0.0:
        if loser.weight == 0.0:
            return True
        x = lx - wx * abs(ly / wy)  # where the ray from the loser runs along the parallel ones
    else:
        if winner.sigma >= loser.sigma or wy == ly:
            return True
        x = (wx * ly - lx * wy) / (ly - wy)
    if x <= lo or x >= hi:
        return True
    return distance_at(winner, x) <= distance_at(loser, x)


@inlined
def without(b0: float, b1: float, lo: float, hi: float) -> tuple[float, float]:
    """Return the interval [b0, b1] less [lo, hi]; as it was where two pieces would remain."""
    if b0 >= lo:
        return min(hi, b1), b1
    if b1 <= hi:
        return b0, lo
    return b0, b1


@inlined
def trim(p: Window, c: Window, least: float, least_uneven: float) -> tuple[Window, Window]:
    """Trim the windows p and c of one edge to where each is nearest; return both.

    A window that loses everything comes back empty (its ends equal). Overlaps of at most ``least``
    stay; of windows of different σ, of at most ``least_uneven``. Equal windows: p wins. Half of a
    sweep is spent here; decision 21 tells what was tried.
    """
    p0, p1, c0, c1 = p.b0, p.b1, c.b0, c.b1
    lo, hi = max(p0, c0), min(p1, c1)
    if hi - lo <= (least if p.sigma == c.sigma else least_uneven):
        return p, c
    if p.sigma == c.sigma and p.weight * c.weight == 1.0:
        # Mostly two images of one pseudosource: their bisector is a straight line, and squares of
        # distances compare as well.
        x0, x1 = p.sx - lo, c.sx - lo
        lead_lo = (x1 - x0) * (x1 + x0) + (c.sy - p.sy) * (c.sy + p.sy)  # of p; linear in x
        slope = 2.0 * (x0 - x1)
        lead_hi = lead_lo + slope * (hi - lo)
        if lead_lo >= 0.0 and lead_hi >= 0.0:
            c0, c1 = without(c0, c1, lo, hi)
        elif lead_lo <= 0.0 and lead_hi <= 0.0:
            p0, p1 = without(p0, p1, lo, hi)
        elif lead_lo > 0.0:
            x = min(max(lo - lead_lo / slope, lo), hi)
            c0, c1 = without(c0, c1, lo, x)
            p0, p1 = without(p0, p1, x, hi)
        else:
            x = min(max(lo - lead_lo / slope, lo), hi)
            c0, c1 = without(c0, c1, x, hi)
            p0, p1 = without(p0, p1, lo, x)
    else:
        lead_lo = distance_at(c, lo) - distance_at(p, lo)
        lead_hi = distance_at(c, hi) - distance_at(p, hi)
        if lead_lo >= 0.0 and lead_hi >= 0.0:
            if wins_throughout(lo, hi, p, c):
                c0, c1 = without(c0, c1, lo, hi)
        elif lead_lo <= 0.0 and lead_hi <= 0.0:
            if wins_throughout(lo, hi, c, p):
                p0, p1 = without(p0, p1, lo, hi)
        else:
            x = bisector_of(lo, hi, p, c)
            if lead_lo > 0.0:  # p is nearer below x
                c0, c1 = without(c0, c1, lo, x)
                p0, p1 = without(p0, p1, x, hi)
            else:
                c0, c1 = without(c0, c1, x, hi)
                p0, p1 = without(p0, p1, lo, x)
    return between(p, p0, p1), between(c, c0, c1)


@inlined
def bisector_of(lo: float, hi: float, p: Window, c: Window) -> float:
    """Point of [lo, hi] at which two windows are as near; their order changes once there (3.3)."""
    if p.weight * c.weight == 0.0:
        s0, s1 = Source(p.sx, p.sy, p.weight), Source(c.sx, c.sy, c.weight)
        return bracketed(lo, hi, s0, s1, c.sigma - p.sigma)
    return bisector(lo, hi, p.sx, p.sy, p.sigma, c.sx, c.sy, c.sigma)


@inlined
def leaves_gap(p: Window, c: Window) -> bool:
    """Whether trimming left a shadow between two windows that a shortest path may run into.

    Where the rays of two windows that meet diverge, nothing covers the wedge between them. For
    exact windows a pseudosource does, or no shortest path enters it. Where distances may fall
    short, by up to ξ, that is certain only if one window is nearer by more than it may fall short.
    """
    if p.b1 <= p.b0 or c.b1 <= c.b0:
        return False
    if p.b1 == c.b0:
        # > 0: p's ray leans less to the right
        x = p.b1
        ahead = (x * p.weight - p.sx) * c.sy - (x * c.weight - c.sx) * p.sy
    elif c.b1 == p.b0:
        x = p.b0
        ahead = (x * c.weight - c.sx) * p.sy - (x * p.weight - p.sx) * c.sy
    else:
        return False
    if ahead <= DIVERGING * (p.sy * c.sy):
        return False
    p_reach, c_reach = distance(x, p.sx, p.sy, p.weight), distance(x, c.sx, c.sy, c.weight)
    return (
        p_reach + (p.sigma + p.xi) >= c_reach + c.sigma
        and c_reach + (c.sigma + c.xi) >= p_reach + p.sigma
    )
