"""Results that hold arrays: each is equal to itself alone, and may be a key."""

import pytest

import geodesic_core as gc

MESH = gc.samples.plane(8)
MAKERS = {
    "field": lambda: gc.exact_distance(MESH, [0, 8]),
    "isoline": lambda: gc.exact_distance(MESH, 0).isolines([0.5])[0][0],
    "border": lambda: gc.exact_distance(MESH, [0, 8]).borders()[0],
    "path": lambda: gc.shortest_path(MESH, 0, 8),
    "step": lambda: gc.shortest_path(MESH, 0, 8, explain=True).steps[0],
    "nearest": lambda: gc.nearest(MESH, 0, [3, 8]),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_results_are_compared_as_objects(make):
    one, other = make(), make()
    assert one == one
    assert one != other
    assert len({one, other, one}) == 2
