"""Cheapest paths against closed forms: refraction, roads, slopes; and what results promise."""

import math
import pickle

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, NoPath
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.oracles.cost_graph import by_length, tobler

BELOW = 1e-9
"""Share by which a cost may be below the least, by rounding"""


def square(cells: int) -> gc.TriangleMesh:
    """A grid of unit cells."""
    return gc.TriangleMesh(*zoo.grid(cells, cells, seed=3))


def across(mesh: gc.TriangleMesh) -> np.ndarray:
    """The y of each face's middle."""
    return mesh.vertices[mesh.faces].mean(axis=1)[:, 1]


def vertex_at(mesh: gc.TriangleMesh, x: float, y: float) -> int:
    return int(np.hypot(*(mesh.vertices[:, :2] - [x, y]).T).argmin())


def refracted(bands: list[tuple[float, float]], width: float) -> float:
    """Cost across bands (height, factor) to a point that is so far aside, by Snell's invariant."""
    low, high = 0.0, min(factor for _, factor in bands)
    for _ in range(200):
        p = 0.5 * (low + high)
        reach = sum(h * p / math.sqrt(w * w - p * p) for h, w in bands if w > p)
        low, high = (p, high) if reach < width else (low, p)
    return sum(h * w * w / math.sqrt(w * w - low * low) for h, w in bands)


def integrated(path: gc.CheapestPath, factors: np.ndarray, step=by_length) -> float:
    return float((factors[path.faces] * step(path.points[:-1], path.points[1:])).sum())


@pytest.mark.parametrize("detail", ["default", "fine"])
@pytest.mark.parametrize("bands", [[(8, 1.0), (8, 2.0)], [(6, 3.0), (4, 1.0), (6, 2.0)]])
def test_paths_are_refracted_as_light_is(bands: list[tuple[float, float]], detail: str) -> None:
    mesh = square(16)
    tops = np.cumsum([height for height, _ in bands])
    cost = np.array([factor for _, factor in bands])[np.searchsorted(tops, across(mesh))]
    path = gc.cheapest_path(
        mesh, vertex_at(mesh, 2, 0), vertex_at(mesh, 15, 16), cost, detail=detail
    )
    least = refracted(bands, 13.0)
    assert -BELOW <= path.cost / least - 1.0 <= 2e-3
    assert path.cost == pytest.approx(integrated(path, cost), rel=1e-12)


def test_paths_run_along_the_border_of_what_is_cheaper() -> None:
    """Critical refraction: down to the border at its angle, along it, and up again."""
    mesh = square(20)
    cost = np.where(across(mesh) < 10, 0.2, 1.0)
    path = gc.cheapest_path(mesh, vertex_at(mesh, 1, 13), vertex_at(mesh, 19, 13), cost)
    least = 18.0 * 0.2 + 2.0 * 3.0 * math.sqrt(1.0 - 0.2**2)
    assert -BELOW <= path.cost / least - 1.0 <= 1e-4
    on_border = np.abs(path.points[:, 1] - 10.0) < 1e-9
    assert np.ptp(path.points[on_border, 0]) > 15.0


def test_a_road_is_used() -> None:
    """Around a ring of cheap faces: at most what it costs to walk along the edges inside it."""
    mesh = square(30)
    middle = mesh.vertices[mesh.faces].mean(axis=1)[:, :2] - 15.0
    on_road = np.abs(np.abs(middle).max(axis=1) - 10.5) < 0.5
    cost = np.where(on_road, 0.1, 1.0)
    path = gc.cheapest_path(mesh, vertex_at(mesh, 5, 5), vertex_at(mesh, 25, 25), cost)
    assert path.cost <= 0.1 * 40.0 < math.hypot(20, 20)
    assert on_road[path.faces].all()


def test_gentle_slopes_cost_what_the_rule_says() -> None:
    """Straight up a plane, and aslant."""
    mesh = square(12)
    vertices = mesh.vertices.copy()
    vertices[:, 2] = 0.2 * vertices[:, 1]
    plane = gc.TriangleMesh(vertices, mesh.faces)
    walk = gc.SlopeCost("tobler")
    for end, run in (((6, 12), 12.0), ((12, 12), math.hypot(6, 12)), ((12, 0), 6.0)):
        path = gc.cheapest_path(plane, vertex_at(plane, 6, 0), vertex_at(plane, *end), walk)
        slope = 0.2 * end[1] / run
        assert -BELOW <= path.cost / (0.6 * run * math.exp(3.5 * (slope + 0.05))) - 1.0 <= 1e-3


def test_steep_slopes_cost_what_the_zigzag_costs() -> None:
    """Straight up at 0.625 a path costs 2/3 of that rule; what it costs depends on height alone."""
    mesh = square(12)
    vertices = mesh.vertices.copy()
    vertices[:, 2] = 0.625 * vertices[:, 1]
    plane = gc.TriangleMesh(vertices, mesh.faces)
    ends = vertex_at(plane, 6, 0), vertex_at(plane, 6, 12)
    up = gc.cheapest_path(plane, *ends, gc.SlopeCost("tobler"))
    down = gc.cheapest_path(plane, *ends[::-1], gc.SlopeCost("tobler"))
    for path, least in ((up, 2.1 * math.exp(1.175) * 7.5), (down, 2.1 * math.exp(0.825) * 7.5)):
        assert -BELOW <= path.cost / least - 1.0 <= 3e-6
    straight = 0.6 * 12.0 * math.exp(3.5 * 0.675)
    assert up.cost / straight == pytest.approx(0.667, abs=5e-4)


@pytest.mark.jit
def test_the_way_back_costs_otherwise() -> None:
    mesh = gc.samples.terrain(2000)
    walk, n = gc.SlopeCost("tobler"), len(mesh.vertices) - 1
    there, back = (gc.cheapest_path(mesh, *ends, walk) for ends in ((3, n - 5), (n - 5, 3)))
    one = np.ones(len(mesh.faces))
    for path in (there, back):
        assert path.cost == pytest.approx(integrated(path, one, tobler), rel=2e-6)
        assert path.lower_bound() <= path.cost
    assert abs(there.cost / back.cost - 1.0) > 1e-3
    with pytest.raises(InvalidArgument, match="the way back costs otherwise"):
        there.reversed()
    alike = gc.cheapest_path(mesh, 3, n - 5, one).reversed()
    assert alike.locations[0].vertex_index == n - 5
    assert alike.cost == pytest.approx(integrated(alike, one), rel=1e-12)


@pytest.mark.jit
def test_both_costs_multiply() -> None:
    mesh = gc.samples.terrain(500)
    factors = np.random.default_rng(2).choice([1.0, 3.0], len(mesh.faces))
    ends = 3, len(mesh.vertices) - 9
    path = gc.cheapest_path(mesh, *ends, (factors, gc.SlopeCost("tobler")))
    assert path.cost == pytest.approx(integrated(path, factors, tobler), rel=2e-6)
    with_one = gc.cheapest_path(mesh, *ends, (2.0, gc.SlopeCost("tobler")))
    assert with_one.cost == pytest.approx(
        2.0 * gc.cheapest_path(mesh, *ends, gc.SlopeCost("tobler")).cost, rel=1e-12
    )


def test_points_inside_faces_and_on_edges_are_ends() -> None:
    """Within one face, in two, and of a point to itself."""
    mesh = square(6)
    cost = np.where(across(mesh) < 3, 1.0, 2.0)
    inside, same = (gc.SurfacePoint.face(0, w) for w in ((0.2, 0.3, 0.5), (0.6, 0.3, 0.1)))
    far = gc.SurfacePoint.face(len(mesh.faces) - 1, (0.3, 0.3, 0.4))
    on_edge = gc.SurfacePoint.edge(0, 1, 0.3)
    for ends in ((inside, same), (inside, far), (on_edge, far), (far, on_edge), (0, same)):
        path = gc.cheapest_path(mesh, *ends, cost)
        assert path.cost == pytest.approx(integrated(path, cost), rel=1e-12, abs=1e-12)
        np.testing.assert_allclose(path.points[0], mesh.position(ends[0]), atol=1e-12)
        np.testing.assert_allclose(path.points[-1], mesh.position(ends[1]), atol=1e-12)
        straight = gc.shortest_path(mesh, *ends).length
        assert straight * (1.0 - BELOW) <= path.cost <= 2.0 * straight * (1.0 + BELOW)
    for point in (inside, on_edge, 5):
        path = gc.cheapest_path(mesh, point, point, cost)
        assert (path.cost, path.length, len(path.points)) == (0.0, 0.0, 1)


@pytest.mark.jit
def test_closed_faces_are_walked_around() -> None:
    """As by an exact search with barriers, within a thousandth."""
    mesh = gc.samples.obstacles(2000)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    closed = np.flatnonzero(np.abs(middle[:, 0] - np.median(middle[:, 0])) < 0.1)[:-6]
    cost = np.ones(len(mesh.faces))
    cost[closed] = np.inf
    ends = int(mesh.vertices[:, 0].argmin()), int(mesh.vertices[:, 0].argmax())
    exact = gc.shortest_path(mesh, *ends, barriers=closed).length
    for path in (
        gc.cheapest_path(mesh, *ends, cost),
        gc.cheapest_path(mesh, *ends, 1.0, barriers=closed),
    ):
        assert -BELOW <= path.cost / exact - 1.0 <= 1e-3
        assert np.isfinite(cost[path.faces]).all()


def test_steep_faces_are_closed_where_zigzag_is_not_allowed() -> None:
    """A ridge: over it in zig-zag, or around it."""
    mesh = square(20)
    vertices = mesh.vertices.copy()
    x, y = vertices[:, 0], vertices[:, 1]
    vertices[:, 2] = np.where(y <= 14, np.maximum(2.0 - np.abs(x - 10.0), 0.0), 0.0)
    ridge = gc.TriangleMesh(vertices, mesh.faces)
    ends = vertex_at(mesh, 5, 3), vertex_at(mesh, 15, 3)
    limit = math.tan(math.radians(20))
    flat_rate = [(-limit, 1.0), (0.0, 1.0), (limit, 1.0)]
    over = gc.cheapest_path(ridge, *ends, gc.SlopeCost(flat_rate))
    around = gc.cheapest_path(ridge, *ends, gc.SlopeCost(flat_rate, zigzag=False))
    assert over.points[:, 2].max() == pytest.approx(2.0)
    assert over.cost == pytest.approx(6.0 + 2.0 * 2.0 / limit, rel=1e-3)
    assert np.ptp(around.points[:, 2]) == pytest.approx(0.0, abs=1e-12)
    top = gc.SurfacePoint.face(*steep_face(ridge))
    with pytest.raises(gc.errors.InvalidPoint, match="no face that a path may enter"):
        gc.cheapest_path(ridge, ends[0], top, gc.SlopeCost(flat_rate, zigzag=False))


def steep_face(mesh: gc.TriangleMesh) -> tuple[int, tuple[float, float, float]]:
    return int(np.ptp(mesh.vertices[mesh.faces][:, :, 2], axis=1).argmax()), (0.2, 0.3, 0.5)


def test_paths_that_cannot_be_are_refused() -> None:
    mesh = square(6)
    cost = np.where(np.abs(across(mesh) - 3.5) < 0.5, np.inf, 1.0)
    with pytest.raises(NoPath, match="faces of infinite cost lie between") as error:
        gc.cheapest_path(mesh, vertex_at(mesh, 3, 0), vertex_at(mesh, 3, 6), cost)
    assert error.value.reason == "disconnected"
    with pytest.raises(NoPath, match="costs more than max_cost = 5") as error:
        gc.cheapest_path(mesh, vertex_at(mesh, 3, 0), vertex_at(mesh, 3, 6), 1.0, max_cost=5.0)
    assert error.value.reason == "beyond_max_cost"
    path = gc.cheapest_path(mesh, vertex_at(mesh, 3, 0), vertex_at(mesh, 3, 6), 1.0, max_cost=6.1)
    assert path.cost == pytest.approx(6.0, rel=1e-9)
    two = gc.TriangleMesh(*zoo.joined(zoo.grid(2, 2), zoo.grid(2, 2)))
    with pytest.raises(NoPath, match="different connected components"):
        gc.cheapest_path(two, 0, len(two.vertices) - 1, 1.0)


def test_a_path_tells_what_it_is() -> None:
    mesh = square(4)
    path = gc.cheapest_path(mesh, 0, 7, np.full(len(mesh.faces), 2.0))
    assert repr(path).startswith("CheapestPath(")
    assert "cost" in repr(path)
    assert "cost" in path._repr_html_()
    assert path.error_bound.kind == "estimated"
    copy = pickle.loads(pickle.dumps(path))  # noqa: S301 - its own
    assert (copy.mesh, copy.cost) == (None, path.cost)
    with pytest.raises(InvalidArgument, match="has no mesh"):
        copy.lower_bound()
    assert path.lower_bound() == pytest.approx(path.cost, rel=1e-9)


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_with_a_cost_of_one_paths_are_nearly_shortest(case: zoo.Case | zoo.Irregular) -> None:
    """On any surface, and never shorter."""
    mesh = mesh_of(case)
    source = int(mesh.faces[0, 0])  # vertex 0 may be in no face
    exact = gc.exact_distance(mesh, source).distances
    reached = np.flatnonzero(np.isfinite(exact) & (exact > 0.0))
    for target in np.random.default_rng(1).choice(reached, min(4, len(reached)), replace=False):
        path = gc.cheapest_path(mesh, source, int(target), 1.0)
        assert path.cost == pytest.approx(path.length, rel=1e-9)
        assert -BELOW <= path.cost / exact[target] - 1.0 <= 2e-2
