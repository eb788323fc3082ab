"""On planes all is known, however thin the triangles: windows cross, overlap and nest."""

import numpy as np
from hypothesis import given

import geodesic_core as gc
from tests.core.fields.test_curves import random_curve
from tests.core.properties.test_approximate import errors
from tests.core.properties.test_exact import seeds
from tests.support import zoo
from tests.support.oracles import visibility

EXACT = 1e-9
ROUNDING = 1e-12
"""Absolute error allowed, as a share of the size of the mesh."""


def thin_plane(rng) -> gc.TriangleMesh:
    """A rectangle of random triangles, of an aspect down to some 1e-4."""
    columns, rows, seed = rng.integers((2, 2, 0), (7, 7, 2**31)).tolist()
    points, faces = zoo.grid(columns, rows, seed=seed, jitter=0.24)
    return gc.TriangleMesh(points * (1, 10.0 ** -rng.uniform(0, 4), 1), faces)


def random_points(mesh, rng, count) -> list[gc.SurfacePoint]:
    faces = rng.integers(len(mesh.faces), size=count).tolist()
    weights = rng.dirichlet(np.ones(3), count).tolist()
    return [gc.SurfacePoint.face(f, tuple(w)) for f, w in zip(faces, weights, strict=True)]


def random_sources(mesh, rng) -> list[gc.Source]:
    """Points, some of which start later than others."""
    points = random_points(mesh, rng, int(rng.integers(1, 8)))
    starts = rng.choice([0, 1], len(points)) * rng.uniform(0, 0.3, len(points))
    size = np.ptp(mesh.vertices, axis=0).max()
    return [gc.Source(p, float(s * size)) for p, s in zip(points, starts, strict=True)]


def positions(mesh, points) -> np.ndarray:
    return np.array([mesh.position(point) for point in points])


def to_nearest(points, mesh, sources) -> np.ndarray:
    places = positions(mesh, [source.point for source in sources])
    ways = np.linalg.norm(points[:, None] - places, axis=-1)
    return (ways + [source.start_distance for source in sources]).min(axis=1)


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
def test_from_points(seed):
    rng = np.random.default_rng(seed)
    mesh = thin_plane(rng)
    sources, targets = random_sources(mesh, rng), random_points(mesh, rng, 3)
    starts = [source.start_distance for source in sources]

    field = gc.exact_distance(mesh, sources)

    check(mesh, field.distances, to_nearest(mesh.vertices, mesh, sources))
    expected = to_nearest(positions(mesh, targets), mesh, sources)
    check_targets(mesh, field, expected, starts, targets)


@given(seeds)
def test_from_a_curve(seed):
    rng = np.random.default_rng(seed)
    mesh = thin_plane(rng)
    curve, targets = random_curve(mesh, rng), random_points(mesh, rng, 3)

    field = gc.exact_distance(mesh, curve)

    check(mesh, field.distances, to_curve(mesh.vertices, mesh, curve))
    expected = to_curve(positions(mesh, targets), mesh, curve)
    check_targets(mesh, field, expected, [0.0], targets)


@given(seeds)
def test_between_two_points(seed):
    rng = np.random.default_rng(seed)
    mesh = thin_plane(rng)
    ends = random_points(mesh, rng, 2)

    path = gc.shortest_path(mesh, *ends)

    start, end = positions(mesh, ends)
    check(mesh, np.array([path.length]), np.array([np.linalg.norm(end - start)]))


@given(seeds, errors)
def test_within_an_error_from_points(seed, error):
    rng = np.random.default_rng(seed)
    mesh = thin_plane(rng)
    sources, targets = random_sources(mesh, rng), random_points(mesh, rng, 3)
    starts = [source.start_distance for source in sources]

    field = gc.approximate_distance(mesh, sources, error)

    check(mesh, field.distances, to_nearest(mesh.vertices, mesh, sources), error)
    expected = to_nearest(positions(mesh, targets), mesh, sources)
    check_targets(mesh, field, expected, starts, targets, error)


@given(seeds, errors)
def test_within_an_error_from_a_curve(seed, error):
    rng = np.random.default_rng(seed)
    mesh = thin_plane(rng)
    curve = random_curve(mesh, rng)

    field = gc.approximate_distance(mesh, curve, error)

    check(mesh, field.distances, to_curve(mesh.vertices, mesh, curve), error)


@given(seeds, errors)
def test_among_obstacles(seed, error):
    """With corners that are pseudosources; positions are integers, so that the oracle is exact."""
    rng = np.random.default_rng(seed)
    columns, rows, holes = rng.integers((3, 3, 1), (6, 5, 4)).tolist()
    points, faces = zoo.grid(columns, rows, seed=seed, jitter=0.22)
    cells = [tuple(rng.integers((columns, rows)).tolist()) for _ in range(holes)]
    points, faces = zoo.drop_unused(points, zoo.without_cells(faces, columns, cells))
    planar = np.rint(points[:, :2] * (1e6, 10.0 ** rng.uniform(2.5, 6))).astype(int)
    mesh = gc.TriangleMesh(np.insert(planar.astype(float), 2, 0, axis=1), faces)
    places, sources = [], []
    for face in rng.integers(len(faces), size=int(rng.integers(1, 5))).tolist():
        corners = planar[faces[face]]
        place = np.rint(rng.dirichlet(np.ones(3)) @ corners).astype(int)
        (ax, ay), (bx, by) = (np.roll(corners, -k, axis=0).T - place[:, None] for k in (1, 2))
        areas = ax * by - ay * bx
        if areas.min() > 0:
            places.append(place)
            sources.append(gc.SurfacePoint.face(face, tuple((areas / areas.sum()).tolist())))
    if not sources:
        return
    table = visibility.distance_matrix(np.vstack([planar, places]), faces)[len(planar) :]
    expected = table[:, : len(planar)].min(axis=0)
    reached = np.flatnonzero(np.isfinite(expected))

    field = gc.exact_distance(mesh, sources)

    assert (np.isfinite(field.distances) == np.isfinite(expected)).all()
    check(mesh, field.distances[reached], expected[reached])
    rough = gc.approximate_distance(mesh, sources, error)
    check(mesh, rough.distances[reached], expected[reached], error)
    for target in rng.choice(reached, 2).tolist():
        length = field.path_to(target).length
        check(mesh, np.array([length]), expected[[target]])
        if np.isfinite(table[0, target]):
            length = gc.shortest_path(mesh, sources[0], target).length
            check(mesh, np.array([length]), table[[0], target])
