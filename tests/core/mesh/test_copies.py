"""Copies of a mesh are as it is: read-only, with the same answers, and no kernel compiled anew."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.sweep import continuous_dijkstra
from tests.support import zoo
from tests.support.meshes import mesh_of


def pickled(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))  # noqa: S301 - our own


copies = pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
Copied = Callable[[Any], Any]


def meshes() -> list[gc.TriangleMesh]:
    corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0.4, 0], [0, 1, 0], [0, 0, 0]]
    polygon = gc.TriangleMesh.from_polygons(corners, [5, 1, 2, 3, 4], [5], merge="exact")
    return [
        mesh_of(zoo.SMALL["crumpled_torus"]),
        mesh_of(zoo.SMALL["sphere"]).with_barriers([3]),
        polygon,
    ]


@copies
@pytest.mark.parametrize("mesh", meshes())
def test_arrays_are_equal_and_read_only(mesh: gc.TriangleMesh, copied: Copied) -> None:
    mesh.report, mesh.warnings  # noqa: B018 - computed on access, and copied as well
    other = copied(mesh)
    arrays = other.arrays()
    assert list(arrays) == list(mesh.arrays())
    for name, array in mesh.arrays().items():
        np.testing.assert_array_equal(arrays[name], array)
        assert not arrays[name].flags.writeable
    assert other.report == mesh.report
    with pytest.raises(ValueError, match="read-only"):
        other.vertices[0] = 7.0


@pytest.mark.jit
@copies
@pytest.mark.parametrize("mesh", meshes())
def test_copies_answer_alike_and_compile_nothing(mesh: gc.TriangleMesh, copied: Copied) -> None:
    field = gc.exact_distance(mesh, 0)
    versions = len(continuous_dijkstra.advance.overloads)
    other = copied(field)
    np.testing.assert_array_equal(gc.exact_distance(other.mesh, 0).distances, field.distances)
    last = len(mesh.vertices) - 1
    assert other.path_to(last).length == field.path_to(last).length
    assert len(continuous_dijkstra.advance.overloads) == versions


FIELDS: dict[str, Callable[[gc.TriangleMesh], gc.DistanceField]] = {
    "exact": lambda mesh: gc.exact_distance(mesh, 0),
    "approximate": lambda mesh: gc.approximate_distance(mesh, 0),
    "fast": lambda mesh: gc.fast_distance(mesh, 0),
    "windows": lambda mesh: gc.exact_distance(mesh, 0, retain="windows"),
    "curve": lambda mesh: gc.exact_distance(mesh, gc.Curve(mesh.faces[0, :2].tolist())),
}


@pytest.mark.jit
@copies
@pytest.mark.parametrize("field_on", FIELDS.values(), ids=FIELDS)
def test_a_field_that_has_swept_again_is_copied(
    field_on: Callable[[gc.TriangleMesh], gc.DistanceField], copied: Copied
) -> None:
    field, inside = field_on(mesh_of(zoo.SMALL["sphere"])), gc.SurfacePoint.face(5, (0.2, 0.3, 0.5))
    length, distance = field.path_to(9).length, field.distance_at(inside)
    other = copied(field)
    assert other.path_to(9).length == length
    assert other.distance_at(inside) == distance


@copies
def test_a_mesh_that_has_located_points_is_copied(copied: Copied) -> None:
    mesh = mesh_of(zoo.SMALL["sphere"])
    point = mesh.locate([0.1, 0.2, 2.0])
    other = copied(mesh)
    np.testing.assert_array_equal(other.vertices, mesh.vertices)
    assert other.locate([0.1, 0.2, 2.0]) == point
