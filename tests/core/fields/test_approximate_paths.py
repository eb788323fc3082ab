"""Paths of approximate fields, where windows were merged: longer by the error at most."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import (
    MERGING,
    check_approximate_path,
    check_within,
)
from tests.support.meshes import mesh_of


@pytest.mark.parametrize("name", ["dented_ball", "islands", "dented_ring"])
@pytest.mark.jit
def test_kept_or_found_again_the_path_is_the_same(name):
    mesh = mesh_of(MERGING[name])
    kept, found = (
        gc.approximate_distance(mesh, 0, 1e-2, retain=each) for each in ("paths", "distances")
    )
    np.testing.assert_array_equal(kept.distances, found.distances)
    for target in range(1, len(mesh.vertices), 9):
        one, other = kept.path_to(target), found.path_to(target)
        assert one.points.tobytes() == other.points.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()
        assert (one.length, one.error_bound) == (other.length, other.error_bound)
        assert one.locations == other.locations


@pytest.mark.jit
@pytest.mark.parametrize("name", ["dented_ball", "islands"])
def test_some_paths_are_longer_than_the_field_says(name):
    """Else nothing was merged, and the tests above are idle."""
    field = gc.approximate_distance(mesh_of(MERGING[name]), 0, 1e-2, retain="paths")
    bounds = [field.path_to(t).error_bound.value for t in range(1, len(field.distances))]
    assert 1e-5 < max(bounds) < 1e-2


@pytest.mark.jit
def test_paths_under_an_absolute_error():
    mesh = mesh_of(MERGING["dented_ring"])
    exact = gc.exact_distance(mesh, 3).distances
    field = gc.approximate_distance(mesh, 3, None, 1e-3, retain="paths")
    check_within(field.distances, exact, absolute=1e-3)
    for target in range(4, len(exact), 11):
        check_approximate_path(field, target, exact[target], 1e-3 / exact[target])


def test_a_walk_into_another_sheet_than_the_path_came_from_is_given_up():
    """Over edges of four faces, from points on edges, where windows were merged before.

    Three cubes that meet at edges: 36 faces.
    """
    vertices, faces = zoo.voxels([(0, 0, 0), (0, 1, 1), (1, 0, 1)])
    rng = np.random.default_rng(0)
    names = rng.permutation(len(vertices))
    mesh = gc.TriangleMesh(vertices[np.argsort(names)], rng.permutation(names[faces]))
    for face in (5,) if WITHOUT_JIT else range(len(faces)):
        for corner in range(3):
            source = gc.SurfacePoint.edge(face, corner, 0.2)
            exact = gc.exact_distance(mesh, source).distances
            field = gc.approximate_distance(mesh, source, retain="paths")
            for target in range(len(vertices)):
                length = field.path_to(target).length
                assert exact[target] * (1 - 1e-9) <= length <= exact[target] * (1 + 1e-3)
