"""Costs of steps inside a face, by their lengths and their rises.

Where slopes cost, a step that goes ``run`` along the map and ``rise`` up costs ``run * c(slope)``,
with ``slope = rise / run``. The rule c is convex and linear between its knots: on one piece the
step costs ``level * run + tilt * rise``. So it costs a finite amount on a vertical face as well,
where the first and the last piece have level 0.
"""

import math
from typing import Any, NamedTuple

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.jit import inlined, kernel


class Rule(NamedTuple):
    """A cost by slope; without pieces, each step costs its length."""

    pieces: int
    """Number of pieces; 0 for no rule"""
    lowest: float
    """The slope at which the second piece begins: the first reaches down to -∞"""
    highest: float
    """The slope at which the last piece begins"""
    buckets_per_slope: float
    starts: Floats
    """(pieces + 1,): slope at which each begins; the last is ∞"""
    levels: Floats
    """(pieces,): cost by run"""
    tilts: Floats
    """(pieces,): cost by rise"""
    bends: Floats
    """(pieces,): how fast the cost by rise grows with the slope, on average"""
    integrals: Floats
    """(pieces,): of c, from 0 to the slope at which each begins; of the first, to where it ends"""
    buckets: Ints
    """Piece at the beginning of each of the buckets, evenly spaced from the lowest slope"""


@kernel
def piece_of(rule: Any, run: float, rise: float) -> int:
    """Return the piece of a slope, by a rule's pointers."""
    if rise <= rule.lowest * run:
        return 0
    if rise >= rule.highest * run:
        return rule.pieces - 1
    slope = rise / run
    piece = rule.buckets[int((slope - rule.lowest) * rule.buckets_per_slope)]
    while rule.starts[piece + 1] <= slope:
        piece += 1
    return piece


@inlined
def cost_of(rule: Any, square: float, rise: float) -> float:
    """Return what a step of a face costs by its squared length and its rise, for a factor of 1."""
    if rule.pieces == 0:
        return math.sqrt(square)
    run = math.sqrt(max(square - rise * rise, 0.0))
    piece = piece_of(rule, run, rise)
    return rule.levels[piece] * run + rule.tilts[piece] * rise


@kernel
def softened(rule: Any, run: float, rise: float, soft: float) -> tuple[float, float, float, float]:
    """Return what a step costs on average over slopes that are off by up to ``soft``.

    With it its derivatives: by run, by rise, and the second by slope. Convex as the cost is, but
    without its kinks. Without a rule it is the run.
    """
    if rule.pieces == 0:
        return run, 1.0, 0.0, 0.0
    low = piece_of(rule, run, rise - soft * run)
    high = piece_of(rule, run, rise + soft * run)
    if low == high:
        level, tilt = rule.levels[low], rule.tilts[low]
        return level * run + tilt * rise, level, tilt, 0.0 if soft > 0.0 else rule.bends[low]
    slope, width = rise / run, 2.0 * soft
    u, v = slope - soft, slope + soft
    mean = (integral(rule, high, v) - integral(rule, low, u)) / width
    at_u = rule.levels[low] + rule.tilts[low] * u
    tilt = (rule.levels[high] + rule.tilts[high] * v - at_u) / width
    bend = (rule.tilts[high] - rule.tilts[low]) / width
    return run * mean, mean - slope * tilt, tilt, bend


@inlined
def integral(rule: Any, piece: int, slope: float) -> float:
    """Return the integral of c from 0 to a slope of a piece."""
    start = rule.lowest if piece == 0 else rule.starts[piece]
    middle = 0.5 * (start + slope)
    return rule.integrals[piece] + (slope - start) * (
        rule.levels[piece] + rule.tilts[piece] * middle
    )
