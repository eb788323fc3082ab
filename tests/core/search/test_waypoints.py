"""Paths through given points in order."""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.searches import answer, check_search, landmark_count, random_pairs, solver_of


def lengths_of_legs(mesh, stops):
    return [
        gc.exact_distance(mesh, here).distances[there] for here, there in itertools.pairwise(stops)
    ]


@pytest.mark.parametrize("name", ["crags_with_holes", "crumpled_torus", "bow_tie_of_fans"])
@pytest.mark.parametrize("waypoints", [[5], [9, 2], [4, 4, 7], [1, 1], [10], [10, 1, 10, 1]])
def test_the_length_is_the_sum_of_the_legs(name, waypoints):
    """From 1 to 10, some of the stops repeated."""
    solver = solver_of(zoo.SMALL[name])
    stops = [1, *waypoints, 10]
    total = sum(lengths_of_legs(solver.mesh, stops))
    for find in (solver.shortest_path, lambda *stops: gc.shortest_path(solver.mesh, *stops)):
        check_search(solver.mesh, find(1, 10, waypoints), 1, 10, total)


@pytest.mark.jit
def test_the_path_is_that_of_its_legs():
    solver = solver_of(zoo.SMALL["crags"])
    stops = [3, 30, 30, 8, 50]
    path = solver.shortest_path(3, 50, stops[1:-1])
    legs = [gc.shortest_path(solver.mesh, *ends) for ends in itertools.pairwise(stops)]
    points = [legs[0].points, *(leg.points[1:] for leg in legs[1:])]
    np.testing.assert_array_equal(path.points, np.concatenate(points))
    np.testing.assert_array_equal(path.faces, np.concatenate([leg.faces for leg in legs]))
    places = [*legs[0].locations, *(place for leg in legs[1:] for place in leg.locations[1:])]
    assert list(path.locations) == places
    visited = [place.vertex_index for place in path.locations]
    assert [visited.index(stop) for stop in (3, 30, 8, 50)] == sorted(
        visited.index(stop) for stop in (3, 30, 8, 50)
    )


@pytest.mark.jit
def test_a_closed_tour():
    solver = solver_of(zoo.SMALL["sphere"])
    path = solver.shortest_path(0, 0, [20, 31])
    there, between, back = lengths_of_legs(solver.mesh, [0, 20, 31, 0])
    assert path.length == pytest.approx(there + between + back, rel=1e-12)
    np.testing.assert_array_equal(path.points[0], path.points[-1])


def test_standing_still():
    solver = solver_of(zoo.SMALL["sphere"])
    check_search(solver.mesh, solver.shortest_path(7, 7, [7, 7]), 7, 7, 0.0)


@pytest.mark.jit
def test_repeated_stops_add_nothing():
    solver = solver_of(zoo.SMALL["crags"])
    direct = answer(solver.shortest_path(3, 50))
    assert answer(solver.shortest_path(3, 50, [3, 3])) == direct
    assert answer(solver.shortest_path(3, 50, (50,))) == direct


@pytest.mark.parametrize("waypoints", [[0, 15], [15, 0], [15]])
def test_a_waypoint_in_another_component(waypoints):
    """Nothing is searched for, and what is asked next is answered."""
    solver = solver_of(zoo.SMALL["two_components"])
    assert solver.mesh.components[15] != solver.mesh.components[0]
    with pytest.raises(gc.errors.NoPath, match="15") as caught:
        solver.shortest_path(1, 2, waypoints)
    assert caught.value.reason == "disconnected"
    assert solver.nbytes == 0
    assert solver.shortest_path(1, 2).length == pytest.approx(1.0)


@pytest.mark.parametrize(
    "bad", [-1, 10**6, 2.0, None, False, "3", gc.SurfacePoint(0, (0.2, 0.3, 0.6))]
)
def test_a_bad_waypoint_is_named(bad):
    solver = solver_of(zoo.SMALL["crags"])
    with pytest.raises(gc.errors.InvalidPoint, match="waypoint 2"):
        solver.shortest_path(0, 1, [3, 4, bad, 5])


@pytest.mark.jit
def test_progress_goes_on_from_leg_to_leg():
    solver = solver_of(zoo.SMALL["crags"])
    seen = []
    solver.shortest_path(0, 55, [20, 20, 40], progress=seen.append)
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    for leg in range(4):
        inside = [share for share in seen if leg / 4 <= share < (leg + 1) / 4]
        assert len(inside) >= 2, "each leg tells of its start and of more"


@pytest.mark.jit
def test_legs_share_what_a_solver_keeps():
    """A tour gives its later legs landmarks."""
    solver = solver_of(zoo.SMALL["crags"])
    tour = [pair[0] for pair in random_pairs(solver.mesh, 12)]
    solver.shortest_path(tour[0], tour[-1], tour[1:-1])
    assert landmark_count(solver) > 0
