"""The paper's experiments on smooth surfaces, on levels that take little time."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from benchmarks.paper import published, surfaces

pytestmark = pytest.mark.jit


def errors(level: int, relative_error: float | None = None) -> tuple[float, float]:
    """Return the largest absolute and the mean relative error, against the smooth sphere."""
    vertices, faces = surfaces.sphere(level)
    mesh = gc.TriangleMesh(vertices, faces)
    if relative_error is None:
        found = gc.exact_distance(mesh, 0).distances
    else:
        found = gc.approximate_distance(mesh, 0, relative_error).distances
    true = np.arccos(np.clip(vertices @ vertices[0], -1, 1))
    differences = np.abs(found - true)[1:]
    return differences.max(), (differences / true[1:]).mean()


def test_errors_on_a_sphere_are_the_paper_s():
    """Figure 12: the same surfaces but for how the octahedron is laid, so to a few per cent."""
    for level in (1, 2, 3, 4, 5):
        largest, mean = errors(level)
        assert largest == pytest.approx(published.SPHERE_EXACT[level][0], rel=0.06)
        assert mean == pytest.approx(published.SPHERE_EXACT[level][1], rel=0.06)


def test_exact_distances_converge_in_second_order():
    """Figure 12: each level has a quarter of the largest error of the one before."""
    largest = {level: errors(level)[0] for level in (2, 3, 4, 5)}
    for level in (3, 4, 5):
        assert math.log2(largest[level - 1] / largest[level]) >= 1.95


@pytest.mark.parametrize("relative_error", [1e-4, 1e-3, 1e-2])
def test_merging_adds_no_more_than_its_bound_to_the_error(relative_error):
    """Figure 12: distances on the mesh are too short already, and merging never lengthens them."""
    for level in (2, 4):
        exact, merged = errors(level), errors(level, relative_error)
        assert exact[0] - 1e-12 <= merged[0] <= exact[0] + relative_error * math.pi
        assert exact[1] - 1e-12 <= merged[1] <= exact[1] + relative_error


@pytest.mark.parametrize("make", [surfaces.eight, surfaces.convex, surfaces.saddle])
def test_windows_of_subdivided_surfaces_grow_as_the_paper_s(make):
    """Figure 6: the exponent nears 1.5 from below or above."""
    made = [
        gc.exact_distance(gc.TriangleMesh(*make(level)), 0).stats.windows_created
        for level in (3, 4)
    ]
    assert 1.35 <= math.log(made[1] / made[0], 4) <= 1.6


@pytest.mark.parametrize("level", [0, 2])
def test_surfaces_are_what_they_are_named(level):
    """Spheres and disks, and one of two holes, by their Euler characteristics."""
    made = (surfaces.sphere, surfaces.convex, surfaces.saddle, surfaces.eight)
    meshes = [gc.TriangleMesh(*make(level)) for make in made]
    assert [len(mesh.vertices) - mesh.report.edges + len(mesh.faces) for mesh in meshes] == [
        2,
        1,
        1,
        -2,
    ]
    assert np.allclose(np.linalg.norm(meshes[0].vertices, axis=1), 1)
