"""Costs by slope: known rules, functions, tables, zig-zag, and what is refused."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.costs.slope_cost import SlopeCost, step_costs
from geodesic_core.errors import InvalidArgument
from geodesic_core.tolerances import CONVEX, SLOPE_SAMPLING

SLOPES = np.concatenate([-np.geomspace(3.0, 1e-3, 200), [0.0], np.geomspace(1e-3, 3.0, 200)])


def tobler(slope: float) -> float:
    return 0.6 * math.exp(3.5 * abs(slope + 0.05))


def langmuir(slope: float) -> float:
    """Like r.walk of GRASS: gentle ways down gain time, steep ones lose it, by a jump."""
    if slope >= 0.0:
        return 0.72 + 6.0 * slope
    return 0.72 + 1.9998 * slope if slope >= -0.2125 else 0.72 - 1.9998 * slope


def zigzag(cost: object, slope: float) -> float:
    """The least over gentler slopes, by trying many."""
    if slope == 0.0:
        return cost(0.0)
    gentler = slope * np.arange(1, 20_001) / 20_000
    return min(cost(float(s)) * (slope / s) for s in gentler)


@pytest.mark.parametrize("cost", [tobler, langmuir], ids=["tobler", "langmuir"])
def test_slopes_cost_the_least_over_gentler_ones(cost: object) -> None:
    rule = gc.SlopeCost(cost)
    for slope in SLOPES[::25].tolist():
        assert -2e-3 <= float(rule.at(slope)) / zigzag(cost, slope) - 1.0 <= 2.0 * SLOPE_SAMPLING


def test_slope_sampling_of_toblers_rule() -> None:
    """In closed form: gentle slopes as the rule has them, steep ones by their rise."""
    rule = gc.SlopeCost("tobler")
    steep = np.where(SLOPES > 0.0, 2.1 * math.exp(1.175), 2.1 * math.exp(0.825)) * np.abs(SLOPES)
    gentle = 0.6 * np.exp(3.5 * np.abs(SLOPES + 0.05))
    exact = np.where(np.abs(SLOPES) > 2.0 / 7.0, steep, gentle)
    off = rule.at(SLOPES) / exact - 1.0
    assert off.min() >= -1e-12
    assert off.max() <= 2.0 * SLOPE_SAMPLING


def test_naismiths_rule_has_no_zigzag() -> None:
    up = np.maximum(SLOPES, 0.0)
    np.testing.assert_allclose(gc.SlopeCost("naismith").at(SLOPES), 0.72 + 6.0 * up, rtol=1e-5)


def test_tables_are_linear_between_their_slopes() -> None:
    rule = gc.SlopeCost([(-0.5, 2.0), (-0.1, 0.8), (0.3, 1.6), (0.6, 3.0)])
    np.testing.assert_allclose(rule.at([-0.3, 0.0, 0.2, 0.45]), [1.4, 1.0, 1.4, 2.3], rtol=1e-12)
    np.testing.assert_allclose(rule.at([1.2, -1.0]), [6.0, 4.0], rtol=1e-12)  # in zig-zag
    assert rule.at(0.1).shape == ()
    assert rule.at(SLOPES).shape == SLOPES.shape


def test_a_limit_of_slope_is_found() -> None:
    limit = math.tan(math.radians(20))
    rule = gc.SlopeCost(lambda slope: 1.0 if abs(slope) <= limit else math.inf)
    assert float(rule.at(limit)) == pytest.approx(1.0, rel=1e-6)
    assert float(rule.at(2.0 * limit)) == pytest.approx(2.0, rel=1e-6)
    assert rule.limits == pytest.approx((-limit, limit), rel=1e-8)
    assert gc.SlopeCost("tobler").limits == (-math.inf, math.inf)


def test_up_is_any_axis() -> None:
    mesh = gc.samples.terrain(200)
    turned = gc.TriangleMesh(mesh.vertices[:, [2, 0, 1]] * [-1.0, 1.0, 1.0], mesh.faces)
    plain = gc.cost_distance(mesh, 3, gc.SlopeCost("tobler")).costs
    np.testing.assert_allclose(
        gc.cost_distance(turned, 3, gc.SlopeCost("tobler", up="-x")).costs, plain, rtol=1e-9
    )


def test_vertical_faces_cost_their_rise() -> None:
    wall = gc.TriangleMesh([[0, 0, 0], [4, 0, 0], [0, 0, 3], [4, 0, 3]], [[0, 1, 3], [0, 3, 2]])
    path = gc.cheapest_path(wall, 0, 2, gc.SlopeCost("tobler"))
    assert path.cost == pytest.approx(3.0 * 2.1 * math.exp(1.175), rel=2e-6)


def test_convex_is_what_rules_must_be() -> None:
    """But for what sampling leaves; the message names the slopes that mix."""
    at = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])
    costs = 1.0 + at * at
    bumpy = costs.copy()
    bumpy[3] = 0.5 * (costs[2] + costs[4]) * (1.0 + 0.4 * CONVEX)
    gc.SlopeCost(np.stack([at, bumpy], axis=1))
    bumpy[3] = 0.5 * (costs[2] + costs[4]) * (1.0 + 3.0 * CONVEX)
    with pytest.raises(InvalidArgument, match=r"not convex: slope 0.2 .* slopes 0 and 0.4"):
        gc.SlopeCost(np.stack([at, bumpy], axis=1))


def test_least_by_length() -> None:
    """No slope costs less by its length on the surface, and one costs as much."""
    for rule in (gc.SlopeCost("tobler"), gc.SlopeCost("naismith"), gc.SlopeCost(langmuir)):
        slopes = np.concatenate([np.linspace(-3.0, 3.0, 100_001), [-1e7, 1e7]])
        by_length = step_costs(rule.rule, 1.0 + slopes * slopes, slopes) / np.hypot(1.0, slopes)
        assert by_length.min() >= rule.least_by_length * (1.0 - 1e-12)
        assert by_length.min() <= rule.least_by_length * (1.0 + 1e-4)


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        (lambda _: 0.0, "the cost at slope 0 is 0.0"),
        (lambda _: math.nan, "the cost at slope 0 is nan"),
        (lambda slope: 1.0 - slope, "it must be above 0"),
        (lambda _: "fast", "it must be above 0"),
        (lambda slope: math.inf if slope > 0.0 else 1.0, "infinite on all that rises"),
        (lambda slope: math.inf if slope < 0.0 else 1.0, "infinite on all that falls"),
        (lambda slope: math.inf if slope == 0.0 else 1.0, "level ground, slope 0, is infinite"),
        (lambda slope: 1.0 + math.sin(9.0 * slope) ** 2, "not convex"),
        ([(0.0, 1.0)], "finite costs below slope 0"),
        ([(-1.0, 1.0), (0.0, -1.0), (1.0, 1.0)], "the cost at slope 0 is -1.0"),
        ([(-1.0, 1.0), (1.0, 1.0), (0.0, 1.0)], "ascending"),
        ([(-1.0, 1.0), (0.0, math.inf), (1.0, 1.0)], "infinite cost between finite ones"),
        ([1.0, 2.0], r"has shape \(2,\)"),
        (object(), "no table of numbers"),
        ("bolt", "rule is 'bolt'"),
    ],
)
def test_other_rules_are_refused(rule: object, message: str) -> None:
    with pytest.raises(InvalidArgument, match=message):
        SlopeCost(rule)


def test_other_options_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="up is 'z'"):
        gc.SlopeCost("tobler", up="z")
    with pytest.raises(InvalidArgument, match="zigzag is 1"):
        gc.SlopeCost("tobler", zigzag=1)
