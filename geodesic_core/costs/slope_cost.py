"""Costs by slope: a function or a table, made convex by zig-zag, as pieces that kernels read."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Ints
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels.costs.rule import Rule
from geodesic_core.tolerances import CONVEX, SLOPE_SAMPLING
from geodesic_core.validation import check_choice, is_number

KnownRule = Literal["tobler", "naismith"]
Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"]

_STEEPEST = 10.0
"""Slope up to which a function is asked, 84 degrees: beyond it paths zig-zag at this slope."""
_FIRST = 512
"""Intervals on each side of 0 in which a function is sampled at first"""
_MOST_KNOTS = 20_000
_NARROWEST = 1e-9
"""Slope; what is left of an interval around a kink"""
_UNLIMITED = 1e6
"""Slope up to which Naismith's rule is written down, as good as vertical"""
_BUCKETS = 4
"""Buckets for each piece: a slope is found in one or two steps"""

_EMPTY = np.empty(0)
NO_RULE = Rule(0, 0.0, 0.0, 0.0, _EMPTY, _EMPTY, _EMPTY, _EMPTY, _EMPTY, np.empty(0, np.int32))
"""Each step costs its length."""


def _tobler(slope: float) -> float:
    return 0.6 * math.exp(3.5 * abs(slope + 0.05))


_NAISMITH = [(-_UNLIMITED, 0.72), (0.0, 0.72), (_UNLIMITED, 0.72 + 6.0 * _UNLIMITED)]
"""5 km in an hour, and an hour more for 600 m up; nothing is gained on the way down."""


class SlopeCost:
    """A cost by slope in the direction of travel, so that the way up costs other than the way down.

    A step costs its length on the map times the cost of its slope, which is what it rises by that
    length: 0.1 where it rises a metre on ten, negative on the way down.

    Where a slope is so steep that it is cheaper to climb in zig-zag, it costs what the zig-zag
    does: the least over gentler slopes s' of ``cost(s') * s / s'``. So costs depend neither on the
    size of faces nor on the points at which paths may turn. With Tobler's rule this begins at a
    slope of 2/7, 16 degrees.

    Parameters
    ----------
    rule
        ``"tobler"``, for walking: 0.6 exp(3.5 ``|slope + 0.05|``), the seconds for each metre of a
        map in metres, 5 km in an hour on level ground. ``"naismith"``: 5 km in an hour, and an hour
        more for each 600 m up. A function from a slope to a cost above 0, which may be infinite
        beyond a slope, up or down. Or a table of slopes, ascending, and costs, (N, 2): linear
        between them, and infinite beyond them.
    up
        The axis along which height is measured, and its direction.
    zigzag
        Whether slopes of infinite cost are climbed in zig-zag. If not, faces on which one direction
        has such a slope are closed, as barriers are.

    Raises
    ------
    InvalidArgument
        A cost is 0, negative or not a number; level ground, or all that rises or falls, has an
        infinite cost; or the rule is not convex: then mixtures of two slopes would be cheaper than
        the slope between them, and costs would depend on the mesh.

    Notes
    -----
    A function is sampled at 1,000 to 20,000 slopes, and replaced by lines between them that differ
    by a millionth at most.

    Examples
    --------
    >>> pace = gc.SlopeCost("tobler")
    >>> round(float(pace.at(0.0)), 3), round(float(pace.at(0.2)), 3)  # seconds for a metre
    (0.715, 1.439)
    >>> rover = gc.SlopeCost([(-0.36, 1.0), (0.0, 1.0), (0.36, 2.0)], zigzag=False)
    >>> rover
    SlopeCost(3 slopes from -0.36 to 0.36, up='+z', zigzag=False)
    """

    def __init__(
        self,
        rule: KnownRule | Callable[[float], float] | ArrayLike,
        up: Up = "+z",
        *,
        zigzag: bool = True,
    ) -> None:
        check_choice("up", up, get_args(Up))
        if not isinstance(zigzag, bool):
            raise InvalidArgument(f"zigzag is {zigzag!r}; it must be True or False")
        self.up: Up = up
        self.zigzag = zigzag
        slopes, costs, (self._low, self._high) = _knots_of(rule)
        self._slopes, self._costs = _convex(*_from_gentlest(slopes, costs))
        self._rule = _pieces(self._slopes, self._costs)

    def __repr__(self) -> str:
        slopes = self._slopes
        ends = f"{len(slopes)} slopes from {slopes[0]:.6g} to {slopes[-1]:.6g}"
        return f"SlopeCost({ends}, up={self.up!r}, zigzag={self.zigzag})"

    def at(self, slope: ArrayLike) -> Any:
        """Return the cost of slopes, for each unit of length on the map, zig-zag included.

        Parameters
        ----------
        slope
            Rise by length on the map; one number or several.

        Returns
        -------
        numpy.ndarray
            float64, in the shape of the slopes.

        Examples
        --------
        >>> gc.SlopeCost("naismith").at([0.0, 0.1]).round(2).tolist()
        [0.72, 1.32]
        """
        given = np.asarray(slope, np.float64)
        return step_costs(self._rule, 1.0 + given * given, given)

    @property
    def rule(self) -> Rule:
        """The pieces, as kernels read them."""
        return self._rule

    @property
    def least_by_length(self) -> float:
        """The least that any unit of length on the surface costs."""
        by_length = self._costs / np.hypot(1.0, self._slopes)
        steep = abs(self._rule.tilts[0]), abs(self._rule.tilts[-1])
        return float(min(by_length.min(), *steep))

    @property
    def direction(self) -> Floats:
        """The direction up, (3,)."""
        upward = np.zeros(3)
        upward["xyz".index(self.up[1])] = 1.0 if self.up[0] == "+" else -1.0
        return upward

    @property
    def limits(self) -> tuple[float, float]:
        """The slopes below and above which costs are infinite, but for zig-zag."""
        return self._low, self._high


def step_costs(rule: Rule, square: Floats, rise: Floats) -> Floats:
    """Return what steps cost by their squared lengths and rises, for a factor of 1, as kernels do.

    Without a rule, their lengths.
    """
    if rule.pieces == 0:
        lengths: Floats = np.sqrt(square)
        return lengths
    run = np.sqrt(np.maximum(square - rise * rise, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(run > 0.0, rise / run, np.copysign(np.inf, rise))
    piece = np.clip(np.searchsorted(rule.starts, slope, "right") - 1, 0, rule.pieces - 1)
    costs: Floats = rule.levels[piece] * run + rule.tilts[piece] * rise
    return costs


def _knots_of(rule: Any) -> tuple[Floats, Floats, tuple[float, float]]:
    """Return slopes, ascending, their costs, all finite, and the slopes beyond which none is."""
    if isinstance(rule, str):
        check_choice("rule", rule, get_args(KnownRule))
        if rule == "naismith":
            slopes, costs = np.array(_NAISMITH).T
            return slopes, costs, (-np.inf, np.inf)
        return _sampled(_tobler)
    return _sampled(rule) if callable(rule) else _tabulated(rule)


def _tabulated(table: Any) -> tuple[Floats, Floats, tuple[float, float]]:
    try:
        given = np.array(table, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"the rule is no table of numbers: {error}") from error
    if given.ndim != 2 or given.shape[1] != 2:
        raise InvalidArgument(
            f"the rule has shape {given.shape}; it must be (N, 2), rows of a slope and its cost, "
            "or a function, or a name"
        )
    slopes, costs = given.T.copy()
    if not np.isfinite(slopes).all() or (np.diff(slopes) <= 0.0).any():
        raise InvalidArgument("the slopes of the rule must be finite numbers, ascending")
    for slope, cost in zip(slopes.tolist(), costs.tolist(), strict=True):
        _check_cost(slope, cost)
    finite = np.isfinite(costs)
    slopes, costs = slopes[finite], costs[finite]
    if not len(slopes) or not slopes[0] < 0.0 < slopes[-1]:
        raise InvalidArgument("the rule must have finite costs below slope 0, at it and above")
    inside = np.flatnonzero(finite)
    if len(inside) != inside[-1] - inside[0] + 1:
        raise InvalidArgument("the rule has an infinite cost between finite ones")
    if 0.0 not in slopes:
        k = int(np.searchsorted(slopes, 0.0))
        costs = np.insert(costs, k, np.interp(0.0, slopes, costs))
        slopes = np.insert(slopes, k, 0.0)
    return slopes, costs, (float(slopes[0]), float(slopes[-1]))


def _check_cost(slope: float, cost: Any) -> float:
    if not is_number(cost) or not cost > 0.0:
        raise InvalidArgument(f"the cost at slope {slope:g} is {cost!r}; it must be above 0")
    return float(cost)


def _sampled(function: Callable[[float], Any]) -> tuple[Floats, Floats, tuple[float, float]]:
    """Return the knots of a function, up to where zig-zag begins, and where it becomes infinite."""

    def ask(slope: float) -> float:
        return _check_cost(slope, function(slope))

    if not math.isfinite(ask(0.0)):
        raise InvalidArgument("the cost of level ground, slope 0, is infinite")
    down, low = _one_side(ask, -1.0)
    up, high = _one_side(ask, 1.0)
    knots = {0.0: ask(0.0)} | down | up
    slopes = np.array(sorted(knots))
    return slopes, np.array([knots[slope] for slope in slopes.tolist()]), (-low, high)


def _one_side(ask: Callable[[float], float], sign: float) -> tuple[dict[float, float], float]:
    """Return the knots on one side of 0, and the slope beyond which costs are infinite."""
    tried = sign * np.tan(np.linspace(0.0, math.atan(_STEEPEST), _FIRST + 1))
    knots, limit = {0.0: ask(0.0)}, math.inf
    slopes = [0.0]
    for slope in tried[1:].tolist():
        cost = ask(slope)
        if not math.isfinite(cost):
            inside = _last_finite(ask, slopes[-1], slope)
            if inside != slopes[-1]:
                slopes.append(inside)
                knots[inside] = ask(inside)
            limit = abs(inside)
            break
        slopes.append(slope)
        knots[slope] = cost
    if len(slopes) == 1:
        raise InvalidArgument(
            f"the cost is infinite on all that {'rises' if sign > 0 else 'falls'}"
        )
    gentlest = 1 + int(np.argmin([knots[slope] / abs(slope) for slope in slopes[1:]]))
    used = slopes[: gentlest + 2]  # zig-zag may begin before the next one
    found = {slope: knots[slope] for slope in used}
    waiting = list(pairwise(used))
    while waiting and len(found) < _MOST_KNOTS:
        a, b = waiting.pop()
        middle = 0.5 * (a + b)
        cost = ask(middle)
        off = abs(0.5 * (found[a] + found[b]) - cost)
        if off > SLOPE_SAMPLING * cost and abs(b - a) > _NARROWEST:
            found[middle] = cost
            waiting += [(a, middle), (middle, b)]
    return found, limit


def _last_finite(ask: Callable[[float], float], inside: float, outside: float) -> float:
    """Return the slope between two up to which costs are finite."""
    while abs(outside - inside) > _NARROWEST:
        middle = 0.5 * (inside + outside)
        if math.isfinite(ask(middle)):
            inside = middle
        else:
            outside = middle
    return inside


def _from_gentlest(slopes: Floats, costs: Floats) -> tuple[Floats, Floats]:
    """Return the knots without those that are steeper than where zig-zag begins, on each side."""
    with np.errstate(divide="ignore"):
        by_rise = costs / np.abs(slopes)
    level = int(np.flatnonzero(slopes == 0.0)[0])
    first = level - 1 - int(np.argmin(by_rise[:level][::-1]))
    last = level + 1 + int(np.argmin(by_rise[level + 1 :]))
    return slopes[first : last + 1], costs[first : last + 1]


def _convex(slopes: Floats, costs: Floats) -> tuple[Floats, Floats]:
    """Return the lower hull of the knots, which they must be but for rounding."""
    hull: list[int] = []
    for i in range(len(slopes)):
        while len(hull) > 1:
            a, b = hull[-2:]
            left = (costs[b] - costs[a]) * (slopes[i] - slopes[b])
            if left < (costs[i] - costs[b]) * (slopes[b] - slopes[a]):
                break
            hull.pop()
        hull.append(i)
    lower = np.interp(slopes, slopes[hull], costs[hull])
    worst = int(np.argmax(costs / lower))
    if costs[worst] > (1.0 + CONVEX) * lower[worst]:
        after = hull[int(np.searchsorted(hull, worst))]
        before = hull[int(np.searchsorted(hull, worst)) - 1]
        raise InvalidArgument(
            f"the rule is not convex: slope {slopes[worst]:.6g} costs {costs[worst]:.6g}, and "
            f"{lower[worst]:.6g} as a mixture of the slopes {slopes[before]:.6g} and "
            f"{slopes[after]:.6g}; give its convex hull"
        )
    return slopes[hull], costs[hull]


def _pieces(slopes: Floats, costs: Floats) -> Rule:
    """Return the pieces between knots, with one for zig-zag at each end."""
    tilts = np.diff(costs) / np.diff(slopes)
    levels = np.maximum(costs[:-1] - tilts * slopes[:-1], 0.0)
    tilts = np.concatenate([[costs[0] / slopes[0]], tilts, [costs[-1] / slopes[-1]]])
    levels = np.concatenate([[0.0], levels, [0.0]])
    low, high = float(slopes[0]), float(slopes[-1])
    count = _BUCKETS * len(tilts)
    starts = np.concatenate([[-np.inf], slopes, [np.inf]])
    begins = low + (high - low) * np.arange(count + 1) / count
    buckets: Ints = np.clip(np.searchsorted(starts, begins, "right") - 2, 1, None).astype(np.int32)
    return Rule(
        pieces=len(tilts),
        lowest=low,
        highest=high,
        buckets_per_slope=count / (high - low),
        starts=starts,
        levels=levels,
        tilts=tilts,
        bends=_bends(slopes, tilts),
        integrals=_integrals(slopes, costs),
        buckets=buckets,
    )


def _bends(slopes: Floats, tilts: Floats) -> Floats:
    """Return how fast tilts grow on each piece, by half of their steps at both ends."""
    steps = np.diff(tilts)
    bends = np.zeros(len(tilts))
    bends[1:-1] = 0.5 * (steps[:-1] + steps[1:]) / np.diff(slopes)
    return bends


def _integrals(slopes: Floats, costs: Floats) -> Floats:
    """Return the integral of the costs from 0 to the beginning of each piece, see `Rule`."""
    parts = np.concatenate([[0.0], np.cumsum(0.5 * (costs[1:] + costs[:-1]) * np.diff(slopes))])
    k = int(np.searchsorted(slopes, 0.0, "right")) - 1
    at_zero = np.interp(0.0, slopes, costs)
    # From 0, not from an end: then what two of them differ by is not lost in rounding.
    parts -= parts[k] - 0.5 * (costs[k] + at_zero) * slopes[k]
    integrals: Floats = np.concatenate([parts[:1], parts])
    return integrals
