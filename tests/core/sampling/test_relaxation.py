"""Relaxed points: costs that never rise, and the centroids of their own cells."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import Cancelled, InvalidArgument, NoTangentPlane
from geodesic_core.tolerances import SMALLEST_MOVE
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points


def cost_of(mesh, points, density=1.0):
    """The sum of squared distances, each vertex with a third of the faces around it."""
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    masses = np.zeros(len(mesh.vertices))
    np.add.at(masses, mesh.faces, areas[:, None] / 6.0)
    distances = gc.exact_distance(mesh, list(points)).distances
    reached = np.isfinite(distances)
    return float((masses * density * np.where(reached, distances, 0.0) ** 2).sum())


@pytest.mark.jit
@pytest.mark.parametrize("sample", ["plane", "sphere", "knot", "terrain", "obstacles"])
def test_costs_never_rise_and_are_those_of_the_points(sample):
    mesh = getattr(gc.samples, sample)(1500)
    points = random_points(mesh, 9, seed=3)
    relaxed = gc.relax_points(mesh, points, iterations=8)
    assert len(relaxed.costs) == 9
    assert (np.diff(relaxed.costs) <= 0.0).all()
    np.testing.assert_allclose(relaxed.costs[0], cost_of(mesh, points), rtol=1e-12)
    np.testing.assert_allclose(relaxed.costs[-1], cost_of(mesh, relaxed.points), rtol=1e-12)
    field = gc.exact_distance(mesh, list(relaxed.points))
    np.testing.assert_array_equal(relaxed.distances, field.distances)
    np.testing.assert_array_equal(relaxed.nearest, field.nearest_source)
    assert relaxed.costs[-1] < relaxed.costs[0]


@zoo.each(zoo.SMALL)
def test_they_never_rise_on_any_surface(case):
    mesh = mesh_of(case)
    points = [gc.SurfacePoint.face(face, (0.2, 0.3, 0.5)) for face in (0, len(mesh.faces) - 1)]
    relaxed = gc.relax_points(mesh, points, iterations=4)
    assert (np.diff(relaxed.costs) <= 0.0).all()


@pytest.mark.jit
def test_in_the_plane_they_are_the_centroids_of_what_is_nearest():
    mesh = gc.samples.plane(5000)
    relaxed = gc.relax_points(mesh, [0, 30, 900], iterations=200)
    assert relaxed.converged
    places = np.array([mesh.position(point) for point in relaxed.points])
    nearest = np.linalg.norm(mesh.vertices[:, None] - places, axis=2).argmin(axis=1)
    masses = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3.0, 3))
    for i, place in enumerate(places):
        own = nearest == i
        centroid = (masses[own, None] * mesh.vertices[own]).sum(axis=0) / masses[own].sum()
        np.testing.assert_allclose(place, centroid, atol=1e-6)


def test_smallest_move():
    """Points that would move by less have converged: they stay, and no iteration is added."""
    mesh = gc.samples.plane(2)
    middle = mesh.locate((0.5, 0.5, 0.0))
    assert gc.relax_points(mesh, [middle]).converged
    for share, converged in ((0.5, True), (2.0, False)):
        way = share * SMALLEST_MOVE * mesh.extent
        beside = mesh.locate((0.5 + way, 0.5, 0.0))
        assert math.dist(mesh.position(beside), (0.5 + way, 0.5, 0.0)) < 1e-3 * way
        assert gc.relax_points(mesh, [beside], iterations=1).converged is converged


@pytest.mark.jit
def test_density_draws_points():
    mesh = gc.samples.plane(2000)
    density = np.where(mesh.vertices[:, 0] > 0.5, 100.0, 1.0)
    even, drawn = (gc.relax_points(mesh, [0, 300, 500, 700], 30, d) for d in (None, density))
    on_right = [sum(mesh.position(p)[0] > 0.5 for p in r.points) for r in (even, drawn)]
    assert on_right[0] < on_right[1]
    np.testing.assert_allclose(drawn.costs[-1], cost_of(mesh, drawn.points, density), rtol=1e-12)


def test_nothing_moves_without_mass_or_iterations():
    mesh = gc.samples.sphere(80)
    assert gc.relax_points(mesh, [3, 5], iterations=0).points == (mesh.point(3), mesh.point(5))
    still = gc.relax_points(mesh, [3, 5], density=np.zeros(len(mesh.vertices)))
    assert still.converged
    assert still.points == (mesh.point(3), mesh.point(5))


@pytest.mark.parametrize("name", ["bow_tie", "bow_tie_of_fans"])
def test_where_fans_meet_no_point_can_move(name):
    mesh = mesh_of(zoo.SMALL[name])
    corners = np.bincount(mesh.faces.ravel())
    with pytest.raises(NoTangentPlane):
        gc.relax_points(mesh, [int(corners.argmax())])


def test_it_can_be_stopped():
    with pytest.raises(Cancelled):
        gc.relax_points(gc.samples.sphere(320), [0, 1], cancel=lambda: True)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"iterations": -1}, "iterations is -1"),
        ({"iterations": 1.5}, "iterations is 1.5"),
        ({"density": [1.0, 2.0]}, "density has shape"),
        ({"density": [1.0, -2.0, 1.0, 1.0]}, r"density\[1\] is -2.0"),
        ({"density": "much"}, "density has shape"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InvalidArgument, match=named):
        gc.relax_points(gc.samples.plane(2), [0], **arguments)
