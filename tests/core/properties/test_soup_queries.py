"""Every question asked of meshes as nobody means them: the answers agree, and with the oracle."""

import numpy as np
import pytest
from hypothesis import example, given

import geodesic_core as gc
from tests.core.properties.test_soups import (
    DEADLINE,
    check_distances,
    close_to,
    mess,
    oracle_of,
    seeds,
)
from tests.support.isoline_checks import check_pieces, check_points

PIECES = 8
"""Into which a curve is divided by its samples."""


def soup(seed):
    """A mesh of a mess, or None where it has no surface; and the numbers that made it."""
    rng = np.random.default_rng(seed)
    try:
        return gc.TriangleMesh(*mess(rng)), rng
    except gc.errors.InvalidMesh:
        return None, rng


def points_on(mesh, rng, count=6):
    """Points inside faces, on edges and at vertices, by turns, of what is part of the surface."""
    faces = np.flatnonzero(mesh.inner_face >= 0)
    weights = rng.dirichlet(np.ones(3), count)
    weights[1::3, 1], weights[2::3, :2] = 0.0, 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    chosen = zip(rng.choice(faces, count).tolist(), rng.permuted(weights, axis=1), strict=True)
    return [mesh.point(gc.SurfacePoint.face(face, tuple(each))) for face, each in chosen]


def check_between(mesh, points, distances):
    """Distances between points: a metric, no shorter than straight lines, within components."""
    close = close_to(mesh)
    slack = 4.0 * close["atol"]
    np.testing.assert_allclose(distances, distances.T, **close)
    assert (np.diag(distances) == 0.0).all()
    places = np.array([mesh.position(point) for point in points])
    straight = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert (distances >= straight * (1 - 1e-9) - slack).all()
    component = [mesh.components[mesh.faces[point.face_index, 0]] for point in points]
    np.testing.assert_array_equal(np.isfinite(distances), np.equal.outer(component, component))
    for row in np.where(np.isfinite(distances), distances, 1e300):
        through = row[:, None] + distances
        assert (row[None] <= through * (1 + 1e-9) + slack).all()


@given(seeds)
def test_kept_windows_agree_with_the_search(seed):
    mesh, rng = soup(seed)
    points = points_on(mesh, rng) if mesh else []
    distances, solver = np.empty((len(points), len(points))), gc.Solver(mesh) if mesh else None
    for i, source in enumerate(points):
        kept = gc.exact_distance(mesh, source, retain="windows", deadline_s=DEADLINE)
        told = gc.exact_distance(mesh, source, targets=points, deadline_s=DEADLINE)
        searched = gc.exact_distance(mesh, source, deadline_s=DEADLINE)
        distances[i] = [kept.distance_at(point, deadline_s=DEADLINE) for point in points]
        for field in (told, searched):
            found = [field.distance_at(point, deadline_s=DEADLINE) for point in points]
            np.testing.assert_allclose(found, distances[i], **close_to(mesh))
        for j in np.flatnonzero(np.isfinite(distances[i])).tolist():
            paths = [field.path_to(points[j]) for field in (kept, told, searched)]
            paths.append(solver.shortest_path(source, points[j], deadline_s=DEADLINE))
            lengths = [path.length for path in paths]
            np.testing.assert_allclose(lengths, distances[i, j], **close_to(mesh))
    if points:
        check_between(mesh, points, distances)


@pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource")
@given(seeds)
def test_barriers_are_as_if_their_faces_were_not_there(seed):
    mesh, rng = soup(seed)
    if mesh is None or (mesh.inner_face >= 0).sum() < 2:
        return
    barriers = rng.choice(len(mesh.faces), int(rng.integers(1, len(mesh.faces))), replace=False)
    free = np.setdiff1d(np.flatnonzero(mesh.inner_face >= 0), barriers)
    if len(free) == 0:
        return
    blocked, alone = mesh.with_barriers(barriers), gc.TriangleMesh(mesh.vertices, mesh.faces[free])
    if (places_joined(mesh) != places_joined(alone)).any():
        return  # an edge of no length joins its ends also where its faces are blocked
    matrix = oracle_of(alone)
    for source in range(len(mesh.vertices)):
        field = gc.exact_distance(mesh, source, barriers=barriers, deadline_s=DEADLINE)
        check_distances(alone, source, field.distances, matrix[source])
        for target in np.flatnonzero(np.isfinite(field.distances)).tolist():
            path = field.path_to(target)
            np.testing.assert_allclose(path.length, field.distances[target], **close_to(mesh))
            assert not set(path.faces.tolist()) & set(barriers.tolist())
            path = gc.shortest_path(blocked, source, target, deadline_s=DEADLINE)
            np.testing.assert_allclose(path.length, field.distances[target], **close_to(mesh))


def places_joined(mesh):
    return mesh.topology.inner_vertex


@given(seeds)
def test_curves_are_as_near_as_the_nearest_of_their_points(seed):
    mesh, rng = soup(seed)
    for point in points_on(mesh, rng, 3) if mesh else []:
        corners = mesh.faces[point.face_index].tolist()
        ends = np.array([mesh.position(p) for p in (point, corners[0])])
        shares = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
        weights = (1 - shares) * np.array(point.barycentric) + shares * np.array([1.0, 0.0, 0.0])
        samples = [gc.SurfacePoint.face(point.face_index, tuple(each)) for each in weights]
        curve = gc.Curve([point, corners[0]])
        field = gc.exact_distance(mesh, curve, deadline_s=DEADLINE)
        nearest = gc.exact_distance(mesh, samples, deadline_s=DEADLINE).distances
        spacing = float(np.linalg.norm(ends[1] - ends[0])) / PIECES
        slack = close_to(mesh)["atol"] + 1e-9 * np.where(np.isfinite(nearest), nearest, 0.0)
        np.testing.assert_array_equal(np.isfinite(field.distances), np.isfinite(nearest))
        reached = np.isfinite(nearest)
        assert (field.distances <= nearest + slack)[reached].all()
        assert (field.distances >= nearest - spacing / 2.0 - slack)[reached].all()
        for target in np.flatnonzero(reached).tolist():
            length = field.path_to(target).length
            np.testing.assert_allclose(length, field.distances[target], **close_to(mesh))


@given(seeds)
def test_curves_are_approximated_within_the_error(seed):
    mesh, rng = soup(seed)
    for point in points_on(mesh, rng, 2) if mesh else []:
        curve = gc.Curve([point, int(rng.choice(mesh.faces[point.face_index]))])
        exact = gc.exact_distance(mesh, curve, deadline_s=DEADLINE)
        near = gc.approximate_distance(mesh, curve, 0.01, deadline_s=DEADLINE)
        reached, slack = np.isfinite(exact.distances), close_to(mesh)["atol"]
        np.testing.assert_array_equal(np.isfinite(near.distances), reached)
        most = exact.distances[reached] * (1 + 1e-9) + slack
        assert (near.distances[reached] <= most).all()
        assert (near.distances[reached] >= 0.99 * exact.distances[reached] - slack).all()
        for target in np.flatnonzero(reached).tolist():
            assert near.path_to(target).length <= 1.01 * exact.distances[target] + slack
        for place in points_on(mesh, rng, 3):
            ends = [field.distance_at(place, deadline_s=DEADLINE) for field in (exact, near)]
            np.testing.assert_allclose(*ends, **close_to(mesh))
        length = np.linalg.norm(exact.gradient, axis=1)
        np.testing.assert_allclose(length[~np.isnan(length)], 1.0, rtol=1e-9)
        assert np.isnan(length[~reached]).all()


@given(seeds)
def test_matrices_and_the_nearest_are_those_of_the_fields(seed):
    mesh, rng = soup(seed)
    points = points_on(mesh, rng) if mesh else []
    if not points:
        return
    close, solver = close_to(mesh), gc.Solver(mesh)
    expected = np.array(
        [
            [field.distance_at(target) for target in points]
            for field in (gc.exact_distance(mesh, source, targets=points) for source in points)
        ]
    )
    limit = float(rng.choice(expected[np.isfinite(expected)])) * 1.01 + close["atol"]
    within = np.where(expected <= limit, expected, np.inf)
    for distances, most in ((expected, None), (within, limit)):
        dense = gc.distance_matrix(mesh, points, points, most, deadline_s=DEADLINE)
        np.testing.assert_allclose(dense, distances, **close)
        sparse = solver.distance_matrix(points, points, most, "sparse", deadline_s=DEADLINE)
        rows, columns = sparse.coords if hasattr(sparse, "coords") else sparse.nonzero()
        assert sparse.nnz == np.isfinite(distances).sum()
        np.testing.assert_allclose(
            sparse.toarray()[rows, columns], distances[rows, columns], **close
        )
        pairs = solver.distance_matrix(points, points[::-1], most, "pairs", deadline_s=DEADLINE)
        np.testing.assert_allclose(pairs, np.fliplr(distances).diagonal(), **close)
        for source, row in zip(points, distances, strict=True):
            k = int(rng.integers(1, len(points) + 1))
            near = solver.nearest(source, points, k, most, deadline_s=DEADLINE)
            least = np.sort(row)[:k]
            np.testing.assert_allclose(near.distances, least[np.isfinite(least)], **close)
            np.testing.assert_allclose(row[near.indices], near.distances, **close)


@given(seeds)
@example(4109)  # a face without width, which lines cross at a point
@example(8219)  # an edge of no length, whose faces name its ends apart
def test_isolines_are_at_their_level(seed):
    mesh, rng = soup(seed)
    for source in points_on(mesh, rng, 2) if mesh else []:
        kept = gc.exact_distance(mesh, source, retain="windows", deadline_s=DEADLINE)
        reached = kept.distances[np.isfinite(kept.distances)]
        if reached.max() == 0.0:
            continue
        levels = (rng.uniform(0.05, 1.05, 2) * reached.max()).tolist()
        for level, lines in zip(levels, kept.isolines(levels, deadline_s=DEADLINE), strict=True):
            for line in lines:
                assert np.isfinite(line.points).all()
                check_pieces(mesh, line)
            if lines:
                check_points(mesh, source, level, lines, most=12)
