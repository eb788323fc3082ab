"""Curves on planes, where all is known, however thin the triangles: windows cross and overlap."""

import numpy as np
from hypothesis import given

import geodesic_core as gc
from tests.core.fields.test_curves import random_curve
from tests.core.properties.test_approximate import errors
from tests.core.properties.test_exact import seeds
from tests.support.known import thin_plane
from tests.support.meshes import mesh_of

EXACT = 1e-9
ROUNDING = 1e-12
"""Absolute error allowed, as a share of the size of the mesh."""


def random_points(mesh, rng, count) -> list[gc.SurfacePoint]:
    faces = rng.integers(len(mesh.faces), size=count).tolist()
    weights = rng.dirichlet(np.ones(3), count).tolist()
    return [gc.SurfacePoint.face(f, tuple(w)) for f, w in zip(faces, weights, strict=True)]


def positions(mesh, points) -> np.ndarray:
    return np.array([mesh.position(point) for point in points])


def to_curve(points, mesh, curve) -> np.ndarray:
    line = positions(mesh, curve.points)
    steps, away = np.diff(line, axis=0), points[:, None] - line[:-1]
    share = np.clip((away * steps).sum(axis=-1) / (steps**2).sum(axis=-1), 0, 1)
    return np.linalg.norm(away - share[..., None] * steps, axis=-1).min(axis=1)


def check(mesh, found, expected, error=0.0) -> None:
    """A lower bound, short by no more than is granted."""
    least = expected * (1 - max(error, EXACT))
    rounding = ROUNDING * np.ptp(mesh.vertices, axis=0).max()
    assert (found >= least - rounding).all()
    assert (found <= expected * (1 + EXACT) + rounding).all()


def check_targets(mesh, field, expected, starts, targets, error=0.0) -> None:
    """Distances of points and the lengths of their paths."""
    check(mesh, np.array([field.distance_at(target) for target in targets]), expected, error)
    ways = [
        field.path_to(target).length + starts[field.nearest_source_at(target)] for target in targets
    ]
    check(mesh, expected, np.array(ways), error)


@given(seeds)
def test_from_a_curve(seed):
    rng = np.random.default_rng(seed)
    mesh = mesh_of(thin_plane(rng))
    curve, targets = random_curve(mesh, rng), random_points(mesh, rng, 3)

    field = gc.exact_distance(mesh, curve)

    check(mesh, field.distances, to_curve(mesh.vertices, mesh, curve))
    expected = to_curve(positions(mesh, targets), mesh, curve)
    check_targets(mesh, field, expected, [0.0], targets)


@given(seeds, errors)
def test_within_an_error_from_a_curve(seed, error):
    rng = np.random.default_rng(seed)
    mesh = mesh_of(thin_plane(rng))
    curve = random_curve(mesh, rng)

    field = gc.approximate_distance(mesh, curve, error)

    check(mesh, field.distances, to_curve(mesh.vertices, mesh, curve), error)
