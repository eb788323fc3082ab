"""Farthest points: the same as a plain loop over fields of many sources, to the bit."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import Cancelled, DeadlineExceeded, InvalidArgument, InvalidPoint
from tests.support import zoo
from tests.support.meshes import mesh_of, rough_scan

SURFACES = {
    "flat": lambda: gc.samples.plane(800),  # full of equal distances
    "sphere": lambda: gc.samples.sphere(1300),
    "knot": lambda: gc.samples.knot(2000),
    "terrain": lambda: gc.samples.terrain(1000),
    "holes": lambda: gc.samples.obstacles(1300),
    "scan": lambda: gc.TriangleMesh(*rough_scan()),
}


def by_a_loop(mesh, count, start):
    """The points, the covering radius after each, and the last field."""
    points, radii = list(start), []
    while True:
        field = gc.exact_distance(mesh, points)
        on_surface = np.isin(np.arange(len(mesh.vertices)), mesh.faces[mesh.inner_face >= 0])
        distances = np.where(on_surface, field.distances, -1.0)
        radii.append(distances.max())
        if len(points) >= count or radii[-1] == 0.0:
            return points, radii, field
        points.append(int(distances.argmax()))


def check_same(found, expected):
    points, radii, field = expected
    assert found.vertices.tolist() == [point if type(point) is int else -1 for point in points]
    assert found.radius.tolist() == radii
    np.testing.assert_array_equal(found.distances, field.distances)
    np.testing.assert_array_equal(found.nearest, field.nearest_source)


@pytest.mark.jit
@pytest.mark.parametrize("make", SURFACES.values(), ids=SURFACES)
def test_they_are_those_of_a_plain_loop(make):
    mesh = make()
    check_same(gc.farthest_points(mesh, 40, start=7), by_a_loop(mesh, 40, [7]))


@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_they_are_on_any_surface(case):
    mesh = mesh_of(case)
    start = int(mesh.faces[0, 0])
    points, radii, field = by_a_loop(mesh, 6, [start])
    found = gc.farthest_points(mesh, len(points), start=start)
    check_same(found, (points, radii, field))


@pytest.mark.jit
def test_any_points_can_be_the_first():
    mesh = gc.samples.terrain(1000)
    start = [gc.SurfacePoint.face(5, (0.2, 0.3, 0.5)), gc.SurfacePoint.edge(90, 1, 0.25), 44]
    found = gc.farthest_points(mesh, 30, start=start)
    points, radii, field = by_a_loop(mesh, 30, [mesh.point(point) for point in start])
    np.testing.assert_array_equal(found.distances, field.distances)
    np.testing.assert_array_equal(found.nearest, field.nearest_source)
    assert found.radius.tolist() == radii
    assert found.points[:3] == tuple(points[:3])
    assert found.vertices[:3].tolist() == [-1, -1, 44]
    assert len(found) == len(found.radius) + 2 == 30


@pytest.mark.jit
def test_no_two_are_nearer_than_the_covering_radius():
    mesh = gc.samples.knot(2000)
    found = gc.farthest_points(mesh, 25)
    between = gc.distance_matrix(mesh, found.points, found.points)
    assert between[~np.eye(25, dtype=bool)].min() >= found.radius[-2] * (1.0 - 1e-12)
    assert (np.diff(found.radius) <= 0.0).all()
    assert found.distances.max() == found.radius[-1]


@pytest.mark.jit
def test_a_radius_ends_it_as_soon_as_it_is_reached():
    mesh = gc.samples.sphere(1300)
    found = gc.farthest_points(mesh, radius=0.5)
    assert found.radius[-1] <= 0.5 < found.radius[-2]
    assert len(gc.farthest_points(mesh, count=5, radius=0.5)) == 5
    assert len(gc.farthest_points(mesh, count=500, radius=0.5)) == len(found)


def test_each_part_gets_a_point_and_stray_vertices_none():
    vertices, faces = zoo.joined(zoo.grid(3, 3), zoo.grid(2, 2), zoo.grid(4, 1))
    vertices = np.concatenate([vertices, [(50.0, 50.0, 0.0)]])  # in no face
    found = gc.farthest_points(gc.TriangleMesh(vertices, faces), 3)
    assert np.isinf(found.radius[:2]).all()
    assert np.isfinite(found.radius[2])
    assert np.isinf(found.distances[-1])
    assert found.nearest[-1] == -1


@pytest.mark.jit
def test_barriers_are_holes():
    mesh = gc.samples.plane(800)
    wall = [
        i for i, face in enumerate(mesh.faces) if abs(mesh.vertices[face, 0].mean() - 0.5) < 0.1
    ]
    found = gc.farthest_points(mesh, 12, barriers=wall)
    check_same(found, by_a_loop(mesh.with_barriers(wall), 12, [0]))


def test_progress_never_falls_and_ends_at_one():
    shares = []
    gc.farthest_points(gc.samples.sphere(320), 30, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(Cancelled):
        gc.farthest_points(gc.samples.sphere(320), 30, cancel=lambda: len(shares) > 0)
    with pytest.raises(DeadlineExceeded):
        gc.farthest_points(gc.samples.sphere(320), 30, deadline_s=1e-9)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({}, "neither count nor radius"),
        ({"count": 0}, "count is 0"),
        ({"count": 2.0}, "count is 2.0"),
        ({"count": True}, "count is True"),
        ({"radius": -1.0}, "radius is -1.0"),
        ({"radius": float("nan")}, "radius is nan"),
        ({"count": 5}, "only 4 points"),
        ({"count": 2, "start": []}, "no starts"),
    ],
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(InvalidArgument, match=named):
        gc.farthest_points(gc.samples.plane(2), **arguments)


def test_a_start_off_the_mesh_is_refused():
    with pytest.raises(InvalidPoint, match="start 1"):
        gc.farthest_points(gc.samples.plane(2), 3, start=[0, 9])
