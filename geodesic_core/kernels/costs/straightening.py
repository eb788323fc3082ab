"""Paths straightened: their crossings moved along their edges to where the path is cheapest.

The cost is a convex function of the places of the crossings, and each step depends on two of them:
Newton's method with a tridiagonal matrix, places held within their edges. Where crossings meet at a
vertex the cost has a kink, and so it has where a cost by slope has one. So it is smoothed first, by
a length that each step has besides its own, and by an average over slopes; both shrink.
"""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Flags, Floats
from geodesic_core.kernels.costs.rule import Rule, softened
from geodesic_core.kernels.jit import inlined, kernel, pointers

# Columns of steps, a row for each: both ends in the frame of its face, at place 0 of their edges,
# and what they move by until place 1
X0, Y0, Z0 = 0, 1, 2
DX0, DY0, DZ0 = 3, 4, 5
X1, Y1, Z1 = 6, 7, 8
DX1, DY1, DZ1 = 9, 10, 11
FACTOR = 12
STEP = 13

_STAGES = 5
_SHRINKS = 0.03
"""Each stage smooths by so many times the length of the one before, the first by so many times the
length of a mean step."""
_SOFTEST = 0.1
"""Slope by which the kinks of the rule are softened in the first stage"""
_HARDENS = 0.15
"""The same in each stage, times that of the one before"""
_ROUNDS = 20
"""Steps of Newton's method in a stage, at most"""
_HALVINGS = 12
_ENOUGH = 1e-11
"""Share of the cost by which a step must lower it to be followed by another"""
_AT_END = 1e-13
"""Share of an edge from its end where a crossing is held that pulls beyond it"""
_STIFFNESS = 1e-9
"""Share by which each curvature is raised, so that places on which nothing depends stay"""


@kernel
def straighten(rule_: Rule, steps_: Floats, places: Floats, is_free: Flags) -> float:
    """Move the free places to where the path is cheapest, and return its cost.

    ``steps_`` is (S, STEP), ``places`` (S + 1,). Modifies the places.
    """
    rule, steps, count = pointers(rule_), steps_.reshape(-1), len(places)
    moved, best = places.copy(), places.copy()
    first, second = np.empty(count), np.empty(count)
    mixed, ratio = np.empty(count), np.empty(count)
    least = cost_of_path(rule, steps, places, 0.0, 0.0)
    smooth = _SHRINKS * mean_length(steps, places)
    soft = _SOFTEST
    for _ in range(_STAGES):
        cost = cost_of_path(rule, steps, moved, smooth, soft)
        for _ in range(_ROUNDS):
            derive(rule, steps, moved, smooth, soft, first, second, mixed)
            solve(moved, is_free, first, second, mixed, ratio)
            lower = search_line(rule, steps, moved, first, ratio, smooth, soft, cost)
            is_enough = cost - lower <= _ENOUGH * cost
            cost = lower
            if is_enough:
                break
        exact = cost_of_path(rule, steps, moved, 0.0, 0.0)
        if exact < least:
            least = exact
            for i in range(count):
                best[i] = moved[i]
        smooth, soft = smooth * _SHRINKS, soft * _HARDENS
    for i in range(count):
        places[i] = best[i]
    return least


@kernel
def mean_length(steps: Floats, places: Floats) -> float:
    """Return the mean length of a path's steps."""
    total, count = 0.0, len(places) - 1
    for i in range(count):
        dx, dy, _ = difference(steps, places, i)
        total += math.sqrt(dx * dx + dy * dy)
    return total / max(count, 1)


@inlined
def difference(steps: Floats, places: Floats, i: int) -> tuple[float, float, float]:
    """Return how far a step goes, in the frame of its face and up."""
    r, s, t = STEP * i, places[i], places[i + 1]
    return (
        steps[r + X1] + t * steps[r + DX1] - steps[r + X0] - s * steps[r + DX0],
        steps[r + Y1] + t * steps[r + DY1] - steps[r + Y0] - s * steps[r + DY0],
        steps[r + Z1] + t * steps[r + DZ1] - steps[r + Z0] - s * steps[r + DZ0],
    )


@kernel
def cost_of_path(rule: Any, steps: Floats, places: Floats, smooth: float, soft: float) -> float:
    """Return the cost of a path whose steps are longer by a little, squared, and softened."""
    total = 0.0
    for i in range(len(places) - 1):
        dx, dy, dz = difference(steps, places, i)
        run = math.sqrt(max(dx * dx + dy * dy - dz * dz, 0.0) + smooth * smooth)
        total += steps[STEP * i + FACTOR] * softened(rule, run, dz, soft)[0]
    return total


@kernel
def derive(
    rule: Any, steps: Floats, places: Floats, smooth: float, soft: float, first: Floats,
    second: Floats, mixed: Floats,
) -> None:  # fmt: skip
    """Fill the derivatives of the cost by the places; ``mixed`` is by each and the next.

    Heights are 0 where there is no rule: then a run is a length.
    """
    for i in range(len(places)):
        first[i], second[i], mixed[i] = 0.0, 0.0, 0.0
    for i in range(len(places) - 1):
        r = STEP * i
        dx, dy, dz = difference(steps, places, i)
        run = math.sqrt(max(dx * dx + dy * dy - dz * dz, 0.0) + smooth * smooth)
        if run == 0.0:
            continue
        _, level, tilt, bend = softened(rule, run, dz, soft)
        ax, ay, az = -steps[r + DX0], -steps[r + DY0], -steps[r + DZ0]
        bx, by, bz = steps[r + DX1], steps[r + DY1], steps[r + DZ1]
        factor = steps[r + FACTOR]
        a = (dx * ax + dy * ay - dz * az) / run
        b = (dx * bx + dy * by - dz * bz) / run
        first[i] += factor * (level * a + tilt * az)
        first[i + 1] += factor * (level * b + tilt * bz)
        slope = dz / run
        c, d = az - slope * a, bz - slope * b
        scale = factor / run
        second[i] += scale * (level * (ax * ax + ay * ay - az * az - a * a) + bend * c * c)
        second[i + 1] += scale * (level * (bx * bx + by * by - bz * bz - b * b) + bend * d * d)
        mixed[i] += scale * (level * (ax * bx + ay * by - az * bz - a * b) + bend * c * d)


@kernel
def solve(
    places: Floats, is_free: Flags, first: Floats, second: Floats, mixed: Floats, ratio: Floats
) -> None:
    """Replace ``first`` by the step of Newton's method; 0 where a place is held."""
    count, held = len(places), True
    stiff = 0.0
    for i in range(count):
        stiff = max(stiff, second[i])
    for i in range(count):
        was_held = held
        held = is_free[i] == 0
        held |= places[i] <= _AT_END and first[i] >= 0.0
        held |= places[i] >= 1.0 - _AT_END and first[i] <= 0.0
        if held or stiff == 0.0:
            first[i], ratio[i] = 0.0, 0.0
            continue
        curvature = second[i] * (1.0 + _STIFFNESS) + _STIFFNESS * stiff
        below = 0.0 if was_held or i == 0 else mixed[i - 1]
        before, known = (ratio[i - 1], first[i - 1]) if i > 0 else (0.0, 0.0)
        pivot = curvature - below * before
        if pivot <= _STIFFNESS * curvature:
            pivot = curvature
        ratio[i] = mixed[i] / pivot
        first[i] = (-first[i] - below * known) / pivot
    for i in range(count - 2, -1, -1):
        first[i] -= ratio[i] * first[i + 1]


@kernel
def search_line(
    rule: Any, steps: Floats, places: Floats, move: Floats, tried: Floats, smooth: float,
    soft: float, cost: float,
) -> float:  # fmt: skip
    """Move the places by a step, or by part of it, that lowers the cost; return the cost then."""
    share = 1.0
    for _ in range(_HALVINGS):
        for i in range(len(places)):
            tried[i] = min(max(places[i] + share * move[i], 0.0), 1.0)
        lower = cost_of_path(rule, steps, tried, smooth, soft)
        if lower < cost:
            for i in range(len(places)):
                places[i] = tried[i]
            return lower
        share *= 0.5
    return cost
