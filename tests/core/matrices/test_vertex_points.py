"""All vertices on a side of a matrix: as arrays, and with the results of points one by one."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.mesh.triangle_mesh import TriangleMesh

MESH = gc.samples.knot(600)
COUNT = len(MESH.vertices)
POINTS = [MESH.point(vertex) for vertex in range(COUNT)]
SPELLINGS: list[Callable[[], Any]] = [
    lambda: range(COUNT),
    lambda: np.arange(COUNT),
    lambda: np.arange(COUNT, dtype=np.uint16),
    lambda: list(range(COUNT)),
    lambda: tuple(range(COUNT)),
]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The points that a call makes."""
    calls: list[Any] = []
    point = TriangleMesh.point

    def counted(self: TriangleMesh, *given: Any) -> gc.SurfacePoint:
        calls.append(given)
        return point(self, *given)

    monkeypatch.setattr(TriangleMesh, "point", counted)
    return calls


@pytest.mark.parametrize("method", ["exact", "approximate", "fast"])
@pytest.mark.parametrize("spelled", SPELLINGS)
def test_no_point_is_made_for_each_vertex(
    made: list[Any], spelled: Callable[[], Any], method: Any
) -> None:
    found = gc.distance_matrix(MESH, [5, 70], spelled(), method=method)
    assert len(made) < 20
    np.testing.assert_array_equal(
        found, gc.distance_matrix(MESH, POINTS[5:6] + POINTS[70:71], POINTS, method=method)
    )


@pytest.mark.jit
@pytest.mark.parametrize("layout", ["dense", "sparse"])
@pytest.mark.parametrize("other", [None, POINTS[:60], list(range(60))])
def test_a_table_of_vertices_is_symmetric_however_both_sides_are_written(
    layout: Any, other: Any
) -> None:
    found = gc.distance_matrix(MESH, range(60), other, layout=layout)
    expected = gc.distance_matrix(MESH, POINTS[:60], layout=layout)
    if layout == "sparse":
        found, expected = found.toarray(), expected.toarray()
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(found, found.T)


@pytest.mark.parametrize(
    ("targets", "number"),
    [
        ([3, COUNT], 1),
        ([-1, 3], 0),
        (np.array([3, -7]), 1),
        ([3, 2**70], 1),
        ([3, True], 1),
        ([3, 1.0], 1),
        (np.array([3.0]), 0),
    ],
)
def test_what_is_no_vertex_is_named(targets: Any, number: int) -> None:
    with pytest.raises(gc.errors.InvalidPoint, match=f"target {number}"):
        gc.distance_matrix(MESH, [0], targets)


def test_there_must_be_some() -> None:
    for none in ([], range(0), np.empty(0, int)):
        with pytest.raises(gc.errors.InvalidArgument, match="there are no targets"):
            gc.distance_matrix(MESH, [0], none)
