"""Two windows that overlap on one edge: who keeps what (sections 3.3 and 3.4)."""

from geodesic_core.kernels.jit import inlined
from geodesic_core.kernels.planar import bisector, bracketed
from geodesic_core.kernels.sweep.window import distance_at


@inlined
def wins_throughout(
    lo: float,
    hi: float,
    wx: float,
    wy: float,
    w_sigma: float,
    lx: float,
    ly: float,
    l_sigma: float,
    ww: float = 1.0,
    lw: float = 1.0,
) -> bool:
    """Whether a window that wins at both ends of [lo, hi] wins between them too.

    The loser's lead is stationary only where the point and both sources are collinear. There is one
    such point; if it lies outside, or the winner leads there as well, the winner leads throughout.
    Between a strip and another window there is one, too; distances of a strip are linear, the
    others' convex, so that only the latter can win between two ends that they lost.
    """
    if ww * lw == 0.0:
        if lw == 0.0:
            return True
        x = lx - wx * abs(ly / wy)  # where the ray from the loser runs along the strip's
        if x <= lo or x >= hi:
            return True
        return w_sigma - wx * x <= distance_at(x, lx, ly, l_sigma)
    if w_sigma >= l_sigma or wy == ly:
        return True
    x = (wx * ly - lx * wy) / (ly - wy)
    if x <= lo or x >= hi:
        return True
    return distance_at(x, wx, wy, w_sigma) <= distance_at(x, lx, ly, l_sigma)


@inlined
def without(b0: float, b1: float, lo: float, hi: float) -> tuple[float, float]:
    """Return the interval [b0, b1] less [lo, hi]; as it was where two pieces would remain."""
    if b0 >= lo:
        return min(hi, b1), b1
    if b1 <= hi:
        return b0, lo
    return b0, b1


@inlined
def trim(
    p0: float,
    p1: float,
    px: float,
    py: float,
    p_sigma: float,
    c0: float,
    c1: float,
    cx: float,
    cy: float,
    c_sigma: float,
    least: float,
    least_uneven: float,
    pw: float = 1.0,
    cw: float = 1.0,
) -> tuple[float, float, float, float]:
    """Trim the windows p and c of one edge to where each is nearest; return p0, p1, c0, c1.

    A window that loses everything comes back empty (its ends equal). Overlaps of at most ``least``
    stay; of windows of different σ, of at most ``least_uneven``. Equal windows: p wins.
    """
    # Half of the sweep is spent here, on branches that no predictor foresees. Tried: one root per
    # end instead of two, from squared distances (no gain); the quadratic first, the ends only where
    # it has no root (7 % slower on horse97k); lo by a branch, which does not wait for the trim
    # before as max() does (16 % faster on icosphere 6, 2 to 4 % slower on scans).
    lo, hi = max(p0, c0), min(p1, c1)
    if hi - lo <= (least if p_sigma == c_sigma else least_uneven):
        return p0, p1, c0, c1
    if p_sigma == c_sigma and pw * cw == 1.0:
        # Mostly two images of one pseudosource: their bisector is a straight line, and squares of
        # distances compare as well. Saves four roots and a division, 15 % of the sweep.
        x0, x1 = px - lo, cx - lo
        lead = (x1 - x0) * (x1 + x0) + (cy - py) * (cy + py)  # of p at lo; linear in x
        slope = 2.0 * (x0 - x1)
        end = lead + slope * (hi - lo)
        if lead >= 0.0 and end >= 0.0:
            c0, c1 = without(c0, c1, lo, hi)
        elif lead <= 0.0 and end <= 0.0:
            p0, p1 = without(p0, p1, lo, hi)
        elif lead > 0.0:
            x = min(max(lo - lead / slope, lo), hi)
            c0, c1 = without(c0, c1, lo, x)
            p0, p1 = without(p0, p1, x, hi)
        else:
            x = min(max(lo - lead / slope, lo), hi)
            c0, c1 = without(c0, c1, x, hi)
            p0, p1 = without(p0, p1, lo, x)
        return p0, p1, c0, c1
    lead_lo = distance_at(lo, cx, cy, c_sigma, cw) - distance_at(lo, px, py, p_sigma, pw)
    lead_hi = distance_at(hi, cx, cy, c_sigma, cw) - distance_at(hi, px, py, p_sigma, pw)
    if lead_lo >= 0.0 and lead_hi >= 0.0:
        if wins_throughout(lo, hi, px, py, p_sigma, cx, cy, c_sigma, pw, cw):
            c0, c1 = without(c0, c1, lo, hi)
    elif lead_lo <= 0.0 and lead_hi <= 0.0:
        if wins_throughout(lo, hi, cx, cy, c_sigma, px, py, p_sigma, cw, pw):
            p0, p1 = without(p0, p1, lo, hi)
    else:
        if pw * cw == 0.0:
            x = bracketed(lo, hi, px, py, cx, cy, c_sigma - p_sigma, pw, cw)
        else:
            x = bisector(lo, hi, px, py, p_sigma, cx, cy, c_sigma)
        if lead_lo > 0.0:  # p wins below x
            c0, c1 = without(c0, c1, lo, x)
            p0, p1 = without(p0, p1, x, hi)
        else:
            c0, c1 = without(c0, c1, x, hi)
            p0, p1 = without(p0, p1, lo, x)
    return p0, p1, c0, c1


@inlined
def leaves_gap(
    p0: float,
    p1: float,
    px: float,
    py: float,
    p_upper: float,
    c0: float,
    c1: float,
    cx: float,
    cy: float,
    c_upper: float,
    p_sigma: float,
    c_sigma: float,
    pw: float = 1.0,
    cw: float = 1.0,
) -> bool:
    """Whether trimming left a shadow between two windows that a shortest path may run into.

    ``p_upper`` is σ + ξ of p, ``c_upper`` that of c. Where the rays of two windows that meet
    diverge, nothing covers the wedge between them. For exact windows a pseudosource does, or no
    shortest path enters it. Where distances may fall short, that is certain only if one window is
    nearer by more than it may fall short by.
    """
    if p1 <= p0 or c1 <= c0:
        return False
    if p1 == c0:
        # > 0: p's ray leans less to the right
        x, ahead = p1, (p1 * pw - px) * cy - (p1 * cw - cx) * py
    elif c1 == p0:
        x, ahead = p0, (p0 * cw - cx) * py - (p0 * pw - px) * cy
    else:
        return False
    if ahead <= 1e-12 * (py * cy):
        return False
    p_least, c_least = distance_at(x, px, py, 0.0, pw), distance_at(x, cx, cy, 0.0, cw)
    return p_least + p_upper >= c_least + c_sigma and c_least + c_upper >= p_least + p_sigma
