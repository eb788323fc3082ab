"""Mean points: closed forms in the plane and on a sphere, and least among many elsewhere."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import Cancelled, InvalidArgument, NoPath, NoTangentPlane
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points


def variance_at(mesh, place, points, weights):
    distances = [gc.shortest_path(mesh, place, point).length for point in points]
    return float(np.average(np.square(distances), weights=weights))


@pytest.mark.parametrize("seed", range(4))
def test_in_the_plane_it_is_the_weighted_mean(seed):
    vertices, faces = zoo.grid(8, 8, seed=seed, jitter=0.2)
    mesh = gc.TriangleMesh(vertices @ zoo.rotation(seed).T, faces)
    points = random_points(mesh, 6, seed)
    weights = np.random.default_rng(seed).uniform(0.0, 1.0, 6)
    mean = gc.mean_point(mesh, points, weights)
    places = np.array([mesh.position(point) for point in points])
    expected = np.average(places, axis=0, weights=weights)
    assert mean.converged
    np.testing.assert_allclose(mesh.position(mean.point), expected, atol=1e-8)
    spread = np.average(((places - expected) ** 2).sum(axis=1), weights=weights)
    np.testing.assert_allclose(mean.variance, spread, rtol=1e-12)


@pytest.mark.jit
def test_on_a_sphere_it_is_the_mean_of_the_sphere():
    """Up to what the faces differ from a sphere: less and less, the finer they are."""
    away = []
    for count in (1300, 20_000):
        mesh = gc.samples.sphere(count)
        north = np.flatnonzero(mesh.vertices[:, 2] > 0.6 * mesh.vertices[:, 2].max())
        points = [int(north[i * len(north) // 7]) for i in range(7)]
        unit = mesh.vertices[points] / np.linalg.norm(mesh.vertices[points], axis=1)[:, None]
        expected = unit.sum(axis=0) / np.linalg.norm(unit.sum(axis=0))
        for _ in range(100):
            cosines = unit @ expected
            turns = np.arccos(cosines)
            toward = unit - cosines[:, None] * expected
            toward *= (turns / np.linalg.norm(toward, axis=1))[:, None]
            step = toward.mean(axis=0)
            size = np.linalg.norm(step)
            if size > 1e-14:
                expected = np.cos(size) * expected + np.sin(size) * step / size
        mean = gc.mean_point(mesh, points)
        assert mean.converged
        place = mesh.position(mean.point)
        away.append(np.linalg.norm(place / np.linalg.norm(place) - expected))
    assert away[0] < 5e-3
    assert away[1] < 1e-3


@pytest.mark.jit
@pytest.mark.parametrize("sample", ["knot", "terrain", "obstacles"])
def test_nothing_near_it_is_better(sample):
    mesh = getattr(gc.samples, sample)(1500)
    points = random_points(mesh, 4, seed=5)
    weights = [1.0, 2.0, 0.0, 3.0]
    mean = gc.mean_point(mesh, points, weights)
    assert mean.converged
    np.testing.assert_allclose(
        mean.variance, variance_at(mesh, mean.point, points, weights), rtol=1e-12
    )
    fields = [gc.exact_distance(mesh, point).distances for point in points]
    everywhere = np.average(np.square(fields), axis=0, weights=weights)
    assert mean.variance <= everywhere.min()
    for reach in (1e-1, 1e-3, 1e-5):
        lines = [
            gc.trace(mesh, mean.point, turn, reach * mesh.diagonal)
            for turn in np.linspace(0.0, 6.0, 7)
        ]
        for line in lines:
            there = variance_at(mesh, line.locations[-1], points, weights)
            assert there >= mean.variance * (1.0 - 1e-12)


@zoo.each({name: case for name, case in zoo.SMALL.items() if name != "isolated_vertices"})
def test_it_is_no_worse_than_any_vertex(case):
    mesh = mesh_of(case)
    component = np.flatnonzero(mesh.components == mesh.components[mesh.faces[0, 0]])
    points = [int(component[i]) for i in (0, len(component) // 2, -1)]
    fields = np.square([gc.exact_distance(mesh, point).distances for point in points])
    if case.name.startswith("bow_tie"):  # the best vertex is where the fans meet
        with pytest.raises(NoTangentPlane, match="several fans"):
            gc.mean_point(mesh, points)
        return
    mean = gc.mean_point(mesh, points)
    assert mean.variance <= fields.mean(axis=0).min() * (1.0 + 1e-12)


@pytest.mark.jit
def test_the_mean_of_one_point_is_itself():
    mesh = gc.samples.knot(800)
    for point in random_points(mesh, 3):
        mean = gc.mean_point(mesh, point)
        assert mean.converged
        assert gc.shortest_path(mesh, mean.point, point).length < 1e-8 * mesh.diagonal


def test_points_of_two_parts_have_none():
    vertices, faces = zoo.joined(zoo.grid(2, 2), zoo.grid(2, 2))
    with pytest.raises(NoPath):
        gc.mean_point(gc.TriangleMesh(vertices, faces), [0, 10])


def test_it_can_be_stopped():
    with pytest.raises(Cancelled):
        gc.mean_point(gc.samples.sphere(320), [0, 1], cancel=lambda: True)


@pytest.mark.parametrize(
    ("weights", "named"),
    [([1.0], "weights has shape"), ([0.0, 0.0], "all 0"), ([1.0, np.inf], r"weights\[1\] is inf")],
)
def test_bad_weights_are_named(weights, named):
    with pytest.raises(InvalidArgument, match=named):
        gc.mean_point(gc.samples.plane(2), [0, 1], weights)
