"""Curves as sources: the distance is that of their nearest point."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import geodesic_core as gc
from geodesic_core.tolerances import ROUNDED_POSITION
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.oracles import closed_forms, visibility
from tests.support.path_checks import LENGTH
from tests.support.random_meshes import KINDS, thin_terrain

EXACT = 1e-9
"""Relative error allowed against an oracle."""


def random_curve(mesh: gc.TriangleMesh, rng, shake=0.5) -> gc.Curve | None:
    """A shortest path between points in faces, some of its crossings moved along their edges."""
    ends = [
        gc.SurfacePoint.face(int(face), tuple(rng.dirichlet(np.ones(3)).tolist()))
        for face in rng.integers(len(mesh.faces), size=2)
    ]
    try:
        path = gc.shortest_path(mesh, *ends)
    except gc.errors.NoPath:
        return None
    points = list(path.locations)
    for i, point in enumerate(points[1:-1], 1):
        weights = np.array(point.barycentric)
        if point.vertex_index is None and rng.random() < shake:
            weights[weights > 0] = rng.dirichlet(np.ones(2))
            points[i] = gc.SurfacePoint.face(point.face_index, tuple(weights.tolist()))
    return gc.Curve(points)


def holders(mesh: gc.TriangleMesh, point) -> dict[int, np.ndarray]:
    """Weights of a point in each face that it belongs to."""
    point = mesh.point(point)
    if min(point.barycentric) > 0:  # two faces may have the same corners
        return {point.face_index: np.array(point.barycentric)}
    corners = mesh.faces[point.face_index].tolist()
    share = {v: w for v, w in zip(corners, point.barycentric, strict=True) if w > 0}
    return {
        number: np.array([share.get(v, 0.0) for v in face])
        for number, face in enumerate(mesh.faces.tolist())
        if share.keys() <= set(face)
    }


def along(mesh: gc.TriangleMesh, curve: gc.Curve):
    """A function from [0, pieces] to the points of the curve, face by face; its end."""
    shared = []
    for start, end in itertools.pairwise(curve.points):
        at_start, at_end = holders(mesh, start), holders(mesh, end)
        both = sorted(at_start.keys() & at_end.keys())
        shared += [(face, at_start[face], at_end[face]) for face in both]

    def point(t: float) -> gc.SurfacePoint:
        face, start, end = shared[min(int(t), len(shared) - 1)]
        t -= min(int(t), len(shared) - 1)
        return gc.SurfacePoint.face(face, tuple(((1 - t) * start + t * end).tolist()))

    return point, len(shared)


def least_along(mesh, curve, distance_from, samples=9) -> float:
    """The least of a distance over a curve, by sampling and minimising around the best."""
    point, end = along(mesh, curve)
    places = np.linspace(0, end, samples * end + 1)
    known = distance_from([point(t) for t in places])
    best, step = known.min(), 1 / samples
    for i in np.argsort(known)[:4]:
        ends = max(places[i] - step, 0.0), min(places[i] + step, end)
        found = minimize_scalar(
            lambda t: distance_from([point(t)])[0], bounds=ends, method="bounded",
            options={"xatol": 1e-9},
        )  # fmt: skip
        best = min(best, found.fun)
    return float(best)


def check_path_from(mesh, path, curve, target, distance):
    """A path over the surface from a point of the curve, of the given length."""
    assert path.locations[-1] == mesh.point(target)
    assert path.length == pytest.approx(distance, rel=LENGTH, abs=1e-15)
    assert path.length == pytest.approx(
        np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum(), rel=1e-12, abs=1e-15
    )
    positions = np.array([mesh.position(point) for point in curve.points])
    steps = np.diff(positions, axis=0)
    squares = np.maximum((steps**2).sum(axis=1), 1e-300)
    share = np.clip(((path.points[0] - positions[:-1]) * steps).sum(axis=1) / squares, 0, 1)
    feet = positions[:-1] + share[:, None] * steps
    size = np.ptp(mesh.vertices, axis=0).max()
    assert np.linalg.norm(feet - path.points[0], axis=1).min() <= 1e-11 * size
    for face, ends in zip(path.faces.tolist(), itertools.pairwise(path.locations), strict=True):
        assert all(face in holders(mesh, end) for end in ends)


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.jit
@pytest.mark.parametrize("seed", range(12))
def test_distances_among_obstacles_are_those_of_the_visibility_graph(seed):
    rng = np.random.default_rng(seed)
    columns, rows = 6, 5
    points, faces = zoo.grid(columns, rows)
    cells = [(int(x), int(y)) for x, y in zip(rng.integers(0, 6, 7), rng.integers(0, 5, 7))]  # noqa: B905
    points, faces = zoo.drop_unused(points, zoo.without_cells(faces, columns, cells))
    planar = np.rint(points[:, :2] * 60 / np.abs(points).max()).astype(int)
    mesh = gc.TriangleMesh(np.insert(planar.astype(float), 2, 0, axis=1), faces)
    for _ in range(4):
        face = mesh.faces[rng.integers(len(mesh.faces))]
        corners = planar[face]
        # Ends at integers: corners, middles of sides (60 is even), and the centroid where it is.
        ends = [corners[0], corners[1], (corners[1] + corners[2]) // 2]
        weights = [(1, 0, 0), (0, 1, 0), (0, 0.5, 0.5)]
        i, j = rng.permutation(3)[:2]
        if ((corners[1] + corners[2]) % 2).any() or (ends[i] == ends[j]).all():
            continue
        number = int(np.flatnonzero((mesh.faces == face).all(axis=1))[0])
        curve = gc.Curve([gc.SurfacePoint.face(number, weights[k]) for k in (i, j)])
        expected = visibility.distances_to_segment(
            planar, mesh.faces, tuple(ends[i].tolist()), tuple(ends[j].tolist())
        )
        field = gc.exact_distance(mesh, curve)
        np.testing.assert_allclose(field.distances, expected, rtol=EXACT, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_distances_on_a_plane_are_those_of_segments(seed):
    rng = np.random.default_rng(seed)
    points, faces = zoo.grid(7, 6, seed=seed, jitter=0.2)
    mesh = gc.TriangleMesh(points, faces)
    curve = random_curve(mesh, rng, shake=1.0)
    targets = [
        gc.SurfacePoint.face(int(face), tuple(rng.dirichlet(np.ones(3)).tolist()))
        for face in rng.integers(len(mesh.faces), size=40)
    ]
    field = gc.exact_distance(mesh, curve, targets=targets)
    ends = np.array([mesh.position(point) for point in curve.points])

    def foot(place):
        start, step = ends[:-1], np.diff(ends, axis=0)
        share = np.clip(((place - start) * step).sum(axis=1) / (step**2).sum(axis=1), 0, 1)
        feet = start + share[:, None] * step
        return feet[np.linalg.norm(feet - place, axis=1).argmin()]

    def distance(place):
        return np.linalg.norm(foot(place) - place)

    expected = [distance(place) for place in mesh.vertices]
    np.testing.assert_allclose(field.distances, expected, rtol=1e-12, atol=1e-13)
    for target in targets:
        expected = distance(mesh.position(target))
        assert field.distance_at(target) == pytest.approx(expected, rel=1e-12, abs=1e-13)
        check_path_from(mesh, field.path_to(target), curve, target, expected)
    # Points that the sweep was not told of, and the direction at vertices
    later = [
        gc.exact_distance(mesh, curve),
        gc.exact_distance(mesh, curve, retain="windows"),
        gc.approximate_distance(mesh, curve, 1e-2),
    ]
    for target, field in itertools.product(targets[:12], later):
        expected = distance(mesh.position(target))
        assert field.distance_at(target) == pytest.approx(expected, rel=1e-12, abs=1e-13)
        assert field.nearest_source_at(target) == 0
        check_path_from(mesh, field.path_to(target), curve, target, expected)
    away = np.array([place - foot(place) for place in mesh.vertices])
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    np.testing.assert_allclose(later[0].gradient, away, atol=1e-9)


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("seed", range(8))
def test_distances_on_a_box_are_least_over_the_curve(seed):
    rng = np.random.default_rng(seed)
    size = 3, 2, 2
    mesh = gc.TriangleMesh(*zoo.voxels(list(itertools.product(*map(range, size)))))
    face = int(rng.integers(len(mesh.faces)))
    ends = [gc.SurfacePoint.face(face, tuple(w)) for w in rng.dirichlet(np.ones(3), 2).tolist()]
    curve = gc.Curve(ends)
    start, end = (mesh.position(point) for point in ends)
    axis = int(np.argmin(np.abs(end - start)))  # that of the face: rounding must not leave it
    start[axis] = end[axis] = mesh.vertices[mesh.faces[face, 0], axis]
    field = gc.exact_distance(mesh, curve)
    for v in rng.integers(len(mesh.vertices), size=6).tolist():

        def distance(t, v=v):
            return closed_forms.box(size, (1 - t) * start + t * end, mesh.vertices[v])

        known = [distance(t) for t in np.linspace(0, 1, 41)]
        best = int(np.argmin(known))
        bounds = max(best - 1, 0) / 40, min(best + 1, 40) / 40
        found = minimize_scalar(
            distance, bounds=bounds, method="bounded", options={"xatol": 1e-10}
        ).fun
        expected = min(found, *known)
        assert field.distances[v] == pytest.approx(expected, rel=EXACT)


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("error", [None, 1e-3])
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
@pytest.mark.jit
def test_distances_are_least_over_the_points_of_the_curve(case, error):
    """On every kind of mesh, non-manifold ones too, at vertices and at points anywhere."""
    mesh, rng = mesh_of(case), np.random.default_rng(7)
    curve = random_curve(mesh, rng)
    if curve is None or len(curve.points) < 2:
        pytest.skip("the random ends are not connected")
    targets = [
        gc.SurfacePoint.face(int(face), tuple(rng.dirichlet(np.ones(3)).tolist()))
        for face in rng.integers(len(mesh.faces), size=1 if WITHOUT_JIT else 3)
    ]
    targets.append(gc.SurfacePoint.vertex(int(rng.integers(len(mesh.vertices)))))
    if error is None:
        field = gc.exact_distance(mesh, curve, targets=targets)
    else:
        field = gc.approximate_distance(mesh, curve, error, targets=targets, retain="paths")
    for target in targets:
        distance = field.distance_at(target)
        if math.isinf(distance):
            continue

        def from_target(points, target=target):
            there = gc.exact_distance(mesh, target, targets=points)
            return np.array([there.distance_at(point) for point in points])

        least = least_along(mesh, curve, from_target)
        assert distance <= least * (1 + EXACT) + 1e-14
        assert distance >= least * (1 - (error or EXACT)) - 1e-14
        path = field.path_to(target)
        if error is None:
            check_path_from(mesh, path, curve, target, distance)
        else:
            assert least * (1 - EXACT) <= path.length <= least * (1 + error) + 1e-14


@pytest.mark.jit
@given(st.sampled_from(KINDS), st.integers(0, 2**31 - 1))
@example(thin_terrain, 56)  # of two windows that were not told apart one went to one side only
def test_a_curve_is_as_good_as_its_pieces_cut_and_turned_round(kind, seed):
    """Metamorphic: cut at points of its own, reversed, in two, or with its points beside it."""
    rng = np.random.default_rng(seed)
    mesh = gc.TriangleMesh(*kind(rng))
    curve = random_curve(mesh, rng)
    if curve is None:
        return
    field = gc.exact_distance(mesh, curve)
    size = np.ptp(mesh.vertices, axis=0).max()

    def same(other):
        np.testing.assert_allclose(other.distances, field.distances, rtol=EXACT, atol=1e-11 * size)

    points = tuple(curve.points)
    same(gc.exact_distance(mesh, gc.Curve(points[::-1])))
    same(gc.exact_distance(mesh, [curve, *points]))
    half = int(rng.integers(len(points)))
    halves = [gc.Curve(part) for part in (points[: half + 1], points[half:])]
    split = gc.exact_distance(mesh, halves)
    same(split)
    alone = [gc.exact_distance(mesh, part).distances for part in halves]
    np.testing.assert_allclose(split.distances, np.minimum(*alone), rtol=EXACT, atol=1e-11 * size)
    reached = np.isfinite(split.distances)
    nearer = alone[0][reached] <= alone[1][reached] * (1 + 1e-12) + 1e-14 * size
    ties = np.abs(alone[0][reached] - alone[1][reached]) <= 1e-9 * size
    assert ((split.nearest_source[reached] == 0) == nearer)[~ties].all()
    if len(points) > 1:
        point, end = along(mesh, curve)
        cuts = np.unique(np.concatenate([np.arange(end + 1), rng.uniform(0, end, 4)]))
        same(gc.exact_distance(mesh, gc.Curve([point(t) for t in cuts])))
        sampled = gc.exact_distance(mesh, [point(t) for t in np.linspace(0, end, 5 * end)])
        assert (field.distances <= sampled.distances * (1 + EXACT) + 1e-12 * size).all()
    delayed = gc.exact_distance(mesh, gc.Source(curve, 0.5 * size))
    np.testing.assert_allclose(
        delayed.distances, field.distances + 0.5 * size, rtol=EXACT, atol=1e-11 * size
    )


def test_a_curve_along_edges_is_all_the_points_of_the_edges():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    loop = mesh.faces[0].tolist()
    field = gc.exact_distance(mesh, gc.Curve([*loop, loop[0]]))
    assert (field.distances[loop] == 0).all()
    edge = float(np.linalg.norm(mesh.vertices[loop[0]] - mesh.vertices[loop[1]]))
    rest = np.setdiff1d(np.arange(6), loop)
    np.testing.assert_allclose(field.distances[rest], edge * math.sqrt(3) / 2, rtol=1e-12)


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_a_curve_reaches_the_vertex_of_a_face_without_area_that_lies_on_it(solve):
    places = np.array([[2.0, 0.0, 0.0], [1.0, 2.0, 2.0], [1.0, 1.0, 1.0], [0.0, 2.0, 2.0]])
    mesh = gc.TriangleMesh(places, [[0, 2, 3], [3, 1, 2]])  # vertex 2 halves the edge of 0 and 3
    field = solve(mesh, gc.Curve([3, 0]))
    np.testing.assert_allclose(field.distances, [0.0, math.sqrt(2 / 3), 0.0, 0.0], rtol=EXACT)
    assert field.path_to(2).length <= 1e-15
    assert field.path_to(1).length == pytest.approx(field.distances[1], rel=EXACT)
    assert np.isnan(field.gradient).all(axis=1).tolist() == [True, False, True, True]


def test_a_curve_of_one_point_is_that_point():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    point = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    curve = gc.exact_distance(mesh, gc.Curve([point]))
    again = gc.exact_distance(mesh, gc.Curve([point, point, point]))
    expected = gc.exact_distance(mesh, point)
    assert curve.distances.tolist() == again.distances.tolist() == expected.distances.tolist()


def test_limits_hold_for_curves():
    points, faces = zoo.grid(9, 9, seed=1, jitter=0.2)
    mesh = gc.TriangleMesh(points, faces)
    curve = random_curve(mesh, np.random.default_rng(5))
    full = gc.exact_distance(mesh, curve)
    limit = float(np.median(full.distances))
    near = gc.exact_distance(mesh, curve, max_distance=limit)
    expected = np.where(full.distances <= limit, full.distances, math.inf)
    np.testing.assert_allclose(near.distances, expected, rtol=1e-12, atol=1e-15)
    assert near.stats.windows_created < full.stats.windows_created
    far = int(full.distances.argmax())
    with pytest.raises(gc.errors.NoPath) as caught:
        near.path_to(far)
    assert caught.value.reason == "beyond_max_distance"


def test_curves_that_are_none_are_refused_by_name():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    a, b = 0, next(
        v for v in range(1, 6) if not any({0, v} <= set(f) for f in mesh.faces.tolist())
    )  # fmt: skip
    with pytest.raises(gc.errors.InvalidPoint, match="points 1 and 2 of source 1"):
        gc.exact_distance(mesh, [0, gc.Curve([a, a, b])])
    with pytest.raises(gc.errors.InvalidArgument, match="source 0 is a curve without points"):
        gc.exact_distance(mesh, gc.Curve([]))
    for points in ("ab", 7, None):
        with pytest.raises(gc.errors.InvalidArgument, match="points of source 0"):
            gc.exact_distance(mesh, gc.Curve(points))
    with pytest.raises(gc.errors.InvalidPoint, match="point 1 of source 0"):
        gc.exact_distance(mesh, gc.Curve([0, 99]))
    with pytest.raises(gc.errors.InvalidPoint, match="point 0 of source 0"):
        gc.exact_distance(mesh, gc.Curve([-1, 0]))


def test_points_that_share_a_face_may_be_spelled_in_any_way():
    mesh = gc.samples.plane(2)
    assert gc.share_a_face(mesh, 0, gc.SurfacePoint.vertex(3))
    assert gc.share_a_face(mesh, 1, gc.SurfacePoint.edge(1, 0, 0.5))
    assert not gc.share_a_face(mesh, 1, 2)
    with pytest.raises(gc.errors.InvalidPoint, match="the end is vertex 4"):
        gc.share_a_face(mesh, 0, 4)


@zoo.each_scale
def test_rounded_position_is_all_that_a_path_from_a_curve_may_be_off(scale):
    places = scale * np.array([[2.0, 0.0, 0.0], [1.0, 2.0, 2.0], [1.0, 1.0, 1.0], [0.0, 2.0, 2.0]])
    mesh = gc.TriangleMesh(places, [[0, 2, 3], [3, 1, 2]])  # vertex 2 lies on the edge of 0 and 3
    field, node = gc.exact_distance(mesh, gc.Curve([3, 0])), mesh.topology.inner_vertex[2]
    assert field.path_to(2).length <= ROUNDED_POSITION * mesh.diagonal
    field._result.distance[node] = 0.5 * ROUNDED_POSITION * mesh.diagonal
    field.path_to(2)
    field._result.distance[node] = 2.0 * ROUNDED_POSITION * mesh.diagonal
    with pytest.raises(gc.errors.InternalError, match="the field says"):
        field.path_to(2)
