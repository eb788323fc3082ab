"""Cost fields: never below exact distances and a plain graph's costs, and hardly above them."""

import math
from functools import cache

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoPath, NotEmbedded
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.oracles.cost_graph import by_length, costs_from, tobler

BELOW = 1e-9
"""Share by which a cost may be below the least, by rounding"""
ORACLE = 1e-3
ORACLE_BY_SLOPE = 1e-2
"""Shares by which the plain graph may be above the least"""
BUMPY = gc.samples.terrain(400)
ONE = np.ones(len(BUMPY.faces))
MIXED = np.random.default_rng(5).choice([1.0, 2.0, 5.0, np.inf], len(ONE), p=[0.4, 0.3, 0.2, 0.1])


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_with_a_cost_of_one_costs_are_nearly_distances(case: zoo.Case | zoo.Irregular) -> None:
    """On any surface; what an exact sweep cannot reach is out of reach."""
    mesh = mesh_of(case)
    source = int(mesh.faces[0, 0])  # vertex 0 may be in no face
    exact = gc.exact_distance(mesh, source).distances
    field = gc.cost_distance(mesh, source, 1.0)
    reached = np.isfinite(exact)
    np.testing.assert_array_equal(np.isfinite(field.costs), reached)
    assert np.all(field.costs[reached] >= exact[reached] * (1.0 - BELOW))
    assert np.all(field.costs[reached] <= exact[reached] * 1.08)
    np.testing.assert_array_equal(field.nearest_source, np.where(reached, 0, -1))


def factors_of(kind: str) -> np.ndarray:
    return ONE if kind in ("one", "slope") else MIXED


@cache
def least_of(kind: str) -> np.ndarray:
    """Costs from vertex 9, by an exact sweep or a plain graph."""
    if kind == "one":
        return gc.exact_distance(BUMPY, 9).distances
    step = tobler if kind in ("slope", "both") else by_length
    return costs_from(BUMPY.vertices, BUMPY.faces, factors_of(kind), 9, step)


@pytest.mark.jit
@pytest.mark.parametrize("detail", ["default", "fine"])
@pytest.mark.parametrize("kind", ["one", "mixed", "slope", "both"])
def test_stated_errors_hold(kind: str, detail: str) -> None:
    """Of 95 % of the costs; and none is below a plain graph's by more than that is above."""
    walk, by_slope = gc.SlopeCost("tobler"), kind in ("slope", "both")
    factors = factors_of(kind)
    field = gc.cost_distance(BUMPY, 9, (factors, walk) if by_slope else factors, detail=detail)
    least = least_of(kind)
    slack = BELOW if kind == "one" else ORACLE_BY_SLOPE if by_slope else ORACLE
    reached = np.isfinite(least)
    np.testing.assert_array_equal(np.isfinite(field.costs), reached)
    error = field.costs[reached & (least > 0)] / least[reached & (least > 0)] - 1.0
    assert error.min() >= -slack
    assert np.quantile(error, 0.95) <= field.error_bound.value
    assert error.mean() <= (0.012 if detail == "default" else 0.005)
    assert field.error_bound.kind == "estimated"


def test_fields_are_those_of_paths() -> None:
    """Which cost no more, and lead from the source; in both directions."""
    cost = (MIXED, gc.SlopeCost("naismith"))
    there = gc.cost_distance(BUMPY, 9, cost)
    back = gc.cost_distance(BUMPY, 9, cost, direction="to")
    targets = np.flatnonzero(np.isfinite(there.costs) & (there.costs > 0.0))[::60]
    for target in targets.tolist():
        out, home = there.path_to(target), back.path_to(target)
        assert (out.locations[0].vertex_index, out.locations[-1].vertex_index) == (9, target)
        assert (home.locations[0].vertex_index, home.locations[-1].vertex_index) == (target, 9)
        for field, path in ((there, out), (back, home)):
            assert path.cost <= field.costs[target] * (1.0 + BELOW)
            rises = np.diff(path.points[:, 2])
            runs = np.hypot(*np.diff(path.points[:, :2], axis=0).T)
            steps = 0.72 * runs + 6.0 * np.maximum(rises, 0.0)
            assert path.cost == pytest.approx((MIXED[path.faces] * steps).sum(), rel=2e-6)
            assert path.lower_bound() <= path.cost * (1.0 + BELOW)
    assert np.abs(there.costs[targets] / back.costs[targets] - 1.0).max() > 0.01


@pytest.mark.jit
def test_sources_anywhere_and_several() -> None:
    """A curve, a point in a face, one that starts later; against an exact sweep."""
    inside = gc.SurfacePoint.face(300, (0.2, 0.3, 0.5))
    line = gc.shortest_path(BUMPY, 3, 40)
    sources = [gc.Source(line, 0.05), gc.Source(inside), 200]
    exact = gc.exact_distance(BUMPY, sources)
    field = gc.cost_distance(BUMPY, sources, 2.0 * ONE, detail="fine")
    least = 2.0 * exact.distances - 0.05 * (exact.nearest_source == 0)
    # A start counts as a cost, not as a length: of two sources another one may be nearest.
    error = field.costs - least
    assert error.min() >= -0.05
    on_line = [p.vertex_index for p in line.locations if p.vertex_index is not None]
    np.testing.assert_allclose(field.costs[on_line], 0.05, rtol=1e-9)
    assert set(field.nearest_source.tolist()) == {0, 1, 2}
    alone = [gc.cost_distance(BUMPY, [each], 2.0 * ONE, detail="fine").costs for each in sources]
    np.testing.assert_allclose(field.costs, np.min(alone, axis=0), rtol=1e-2, atol=1e-12)
    path = field.path_to(int(np.flatnonzero(field.nearest_source == 0)[-1]))
    assert abs(gc.exact_distance(BUMPY, line).distance_at(path.locations[0])) < 1e-6
    curve_alone = gc.exact_distance(BUMPY, line).distances
    one = gc.cost_distance(BUMPY, line, ONE, detail="fine").costs
    assert np.all(one >= curve_alone * (1.0 - BELOW) - 1e-12)
    np.testing.assert_allclose(one, curve_alone, rtol=2e-2, atol=1e-9)


def test_costs_at_any_point() -> None:
    """Within the face of a source straight, elsewhere as a path that is straightened, or above."""
    field = gc.cost_distance(BUMPY, gc.SurfacePoint.face(9, (0.2, 0.3, 0.5)), ONE)
    near = gc.SurfacePoint.face(9, (0.5, 0.3, 0.2))
    apart = BUMPY.position(near) - BUMPY.position(field.sources[0].point)
    assert field.cost_at(near) == pytest.approx(np.linalg.norm(apart), rel=1e-12)
    assert field.path_to(near).cost == pytest.approx(np.linalg.norm(apart), rel=1e-12)
    for face in (30, 200, 350):
        point = gc.SurfacePoint.face(face, (0.1, 0.6, 0.3))
        exact = gc.exact_distance(BUMPY, field.sources[0].point).distance_at(point)
        assert -BELOW <= field.path_to(point).cost / exact - 1.0 <= 1e-2
        assert field.path_to(point).cost <= field.cost_at(point) * (1.0 + BELOW)
    assert field.cost_at(7) == field[7]


def test_infinite_costs_are_barriers() -> None:
    """In the field, at points of closed faces, and for sources in them."""
    cost = ONE.copy()
    closed = np.flatnonzero(np.isinf(MIXED))
    cost[closed] = np.inf
    exact = gc.exact_distance(BUMPY, 9, barriers=closed).distances
    for field in (gc.cost_distance(BUMPY, 9, cost), gc.cost_distance(BUMPY, 9, 1.0, None, closed)):
        np.testing.assert_array_equal(np.isfinite(field.costs), np.isfinite(exact))
        near = np.isfinite(exact) & (exact > 0)
        assert np.all(field.costs[near] >= exact[near] * (1.0 - BELOW))
        assert (field.costs[near] / exact[near]).mean() <= 1.012
    inside = gc.SurfacePoint.face(int(closed[0]), (0.3, 0.3, 0.4))
    assert field.cost_at(inside) == np.inf
    with pytest.raises(NoPath, match="no path joins"):
        field.path_to(inside)
    with pytest.raises(InvalidPoint, match="lies in no face that a path may enter"):
        gc.cost_distance(BUMPY, [9, inside], cost)
    with pytest.raises(InvalidPoint, match="lies in no face that a path may enter"):
        gc.cost_distance(BUMPY, 9, np.full(len(ONE), np.inf))


def test_a_limit_ends_the_sweep() -> None:
    whole = gc.cost_distance(BUMPY, 9, ONE)
    limit = float(np.median(whole.costs))
    field = gc.cost_distance(BUMPY, 9, ONE, max_cost=limit)
    near = field.costs < np.inf
    np.testing.assert_allclose(field.costs[near], whole.costs[near], rtol=0.02)
    assert field.costs[near].max() <= limit
    assert np.all(whole.costs[~near] > limit * 0.99)
    far = int(np.argmax(whole.costs))
    with pytest.raises(NoPath, match="is not reached within max_cost") as error:
        field.path_to(far)
    assert error.value.reason == "beyond_max_cost"


def test_lower_bounds_hold() -> None:
    for cost in (MIXED, (ONE, gc.SlopeCost("tobler"))):
        field = gc.cost_distance(BUMPY, [9, gc.Source(3, 0.4)], cost)
        bounds = field.lower_bounds()
        assert np.all(bounds <= field.costs * (1.0 + BELOW))
        assert np.all(bounds[np.isfinite(field.costs)] < np.inf)
    alike = gc.cost_distance(BUMPY, 9, 2.0 * ONE)
    np.testing.assert_allclose(
        alike.lower_bounds(), 2.0 * gc.exact_distance(BUMPY, 9).distances, rtol=1e-12
    )


def test_paths_go_over_edges_of_three_faces() -> None:
    """From one page of a book to another, past a third that costs more; the spine is a road."""
    corners = [[0, 0, 0], [0, 4, 0], [1, 2, 0], [-1, 2, 0], [0, 2, 1]]
    book = gc.TriangleMesh(corners, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    field = gc.cost_distance(book, 2, [1.0, 2.0, 0.1])
    assert field.costs[3] == pytest.approx(3.0, rel=1e-3)
    # Down to the spine at the angle of refraction, then along it
    critical = math.sqrt(1.0 - 0.1**2)
    assert -BELOW <= field.costs[0] / (critical + 0.2) - 1.0 <= 0.05
    assert field.path_to(0).cost == pytest.approx(critical + 0.2, rel=1e-6)
    assert field.path_to(4).cost == pytest.approx(1.1, rel=1e-9)


def test_lengths_alone_suffice_for_costs_by_face() -> None:
    lengths = np.linalg.norm(
        np.roll(BUMPY.vertices[BUMPY.faces], -1, axis=1) - BUMPY.vertices[BUMPY.faces], axis=2
    )
    flat = gc.TriangleMesh.from_lengths(BUMPY.faces, lengths)
    ours, theirs = (gc.cost_distance(mesh, 9, MIXED, detail="fine") for mesh in (BUMPY, flat))
    np.testing.assert_allclose(theirs.costs, ours.costs, rtol=1e-9)
    path = gc.cheapest_path(flat, 9, 200, ONE)
    assert path.cost == pytest.approx(gc.shortest_path(flat, 9, 200).length, rel=5e-3)
    with pytest.raises(NotEmbedded, match="a cost by slope"):
        gc.cost_distance(flat, 9, gc.SlopeCost("tobler"))


def test_a_solver_answers_alike() -> None:
    solver = gc.Solver(BUMPY)
    np.testing.assert_array_equal(
        solver.cost_distance(9, MIXED).costs, gc.cost_distance(BUMPY, 9, MIXED).costs
    )
    assert solver.cheapest_path(9, 200, ONE).cost == gc.cheapest_path(BUMPY, 9, 200, ONE).cost


def test_a_field_tells_what_it_is() -> None:
    field = gc.cost_distance(BUMPY, [9, 20], MIXED)
    assert "2 sources" in repr(field)
    assert "CostField" in field._repr_html_()
    np.testing.assert_array_equal(np.asarray(field), field.costs)
    assert len(field) == len(BUMPY.vertices)
    assert field.nbytes > field.costs.nbytes
    assert gc.cost_distance(BUMPY, 9, ONE, max_cost=0.0).error_bound.value == 0.0


@pytest.mark.parametrize(
    ("cost", "message"),
    [
        (np.where(np.arange(len(ONE)) == 3, 0.0, 1.0), "the cost of face 3 is 0.0"),
        (np.where(np.arange(len(ONE)) == 3, -2.0, 1.0), "the cost of face 3 is -2.0"),
        (np.where(np.arange(len(ONE)) == 3, math.nan, 1.0), "the cost of face 3 is nan"),
        (ONE[:-1], "the costs have shape"),
        ("cheap", "the costs are not numbers"),
        ((ONE, "tobler"), "the costs are not numbers"),
        (0.0, "the cost of face 0 is 0.0"),
    ],
)
def test_other_costs_are_refused(cost: object, message: str) -> None:
    with pytest.raises(InvalidArgument, match=message):
        gc.cost_distance(BUMPY, 9, cost)


def test_other_arguments_are_refused() -> None:
    for options in (
        {"direction": "up"},
        {"detail": "best"},
        {"max_cost": -1.0},
        {"barriers": [-1]},
    ):
        (name,) = options
        with pytest.raises(InvalidArgument, match=name.rstrip("s")):
            gc.cost_distance(BUMPY, 9, ONE, **options)


@pytest.mark.jit
def test_calls_are_watched_and_stopped() -> None:
    mesh = gc.samples.terrain(20_000)
    cost = np.ones(len(mesh.faces))
    shares: list[float] = []
    gc.cost_distance(mesh, 0, cost, detail="fine", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(gc.errors.Cancelled):
        gc.cost_distance(mesh, 0, cost, cancel=lambda: True)
    with pytest.raises(gc.errors.DeadlineExceeded):
        gc.cheapest_path(mesh, 0, 99, cost, deadline_s=1e-9)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.cost_distance(mesh, 0, cost, memory_limit=1000)
