"""Properties of any mesh with any faces blocked."""

import math

import numpy as np
import pytest
from hypothesis import given

import geodesic_core as gc
from tests.core.properties.test_exact import seeds
from tests.support.known import blocked_at_random
from tests.support.meshes import mesh_of
from tests.support.path_checks import check_path
from tests.support.random_meshes import cases

pytestmark = pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource")


def random_points(mesh, free, rng):
    """Points of free faces, where they may be shared with blocked ones."""
    for face in rng.choice(free, 4).tolist():
        u, v, w = rng.dirichlet(np.ones(3)).tolist()
        yield gc.SurfacePoint.face(face, (u, v, w))
        yield gc.SurfacePoint.edge(face, int(rng.integers(3)), u)
        yield int(mesh.faces[face, 0])


@given(cases(), seeds)
def test_points_are_as_far_as_on_a_mesh_of_the_free_faces(case, seed):
    rng = np.random.default_rng(seed)
    barriers, free = blocked_at_random(case, rng)
    mesh = mesh_of(case).with_barriers(barriers)
    alone = gc.TriangleMesh(case.vertices, case.faces[free])
    points = [mesh.point(point) for point in random_points(mesh, free, rng)]
    others = [
        gc.SurfacePoint.face(int(np.searchsorted(free, point.face_index)), point.barycentric)
        for point in points
    ]
    np.testing.assert_array_equal(
        gc.distance_matrix(mesh, points, points), gc.distance_matrix(alone, others, others)
    )
    for solve in (gc.exact_distance, gc.approximate_distance):
        field, known = solve(mesh, points[0]), solve(alone, others[0])
        np.testing.assert_array_equal(field.distances, known.distances)
        found = [field.distance_at(point) for point in points]
        np.testing.assert_array_equal(found, [known.distance_at(point) for point in others])


@given(cases(), seeds)
def test_paths_keep_to_free_faces(case, seed):
    rng = np.random.default_rng(seed)
    barriers, free = blocked_at_random(case, rng)
    mesh = mesh_of(case).with_barriers(barriers)
    source, *targets = random_points(mesh, free, rng)
    field = gc.exact_distance(mesh, source, targets=targets)
    solver = gc.Solver(mesh)
    for target in targets:
        distance = field.distance_at(target)
        if math.isfinite(distance):
            check_path(mesh, field.path_to(target), source, target, distance)
            check_path(mesh, solver.shortest_path(source, target), source, target, distance)


@given(cases(), seeds)
def test_all_spellings_of_a_point_among_barriers_are_one(case, seed):
    """From each face of the edge, blocked or free, and by its ends."""
    rng = np.random.default_rng(seed)
    barriers, free = blocked_at_random(case, rng)
    mesh = mesh_of(case).with_barriers(barriers)
    for face in rng.choice(free, 5).tolist():
        corner, t = int(rng.integers(3)), float(rng.random())
        start, end = (int(mesh.faces[face, (corner + i) % 3]) for i in (0, 1))
        point = mesh.point(gc.SurfacePoint.edge(face, corner, t))
        assert point.face_index not in barriers
        assert point == mesh.point_on_edge(end, start, 1 - t)
        for other in np.flatnonzero(np.isin(mesh.faces, (start, end)).sum(axis=1) == 2).tolist():
            weights = [{start: 1 - t, end: t}.get(v, 0.0) for v in mesh.faces[other].tolist()]
            assert mesh.point(gc.SurfacePoint.face(other, tuple(weights))) == point
