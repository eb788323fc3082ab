"""Meshes as nobody means them: each gets the right answer or a typed refusal, and never NaN."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.support.oracles import graph, needles, unfolding
from tests.support.random_meshes import cases

EXACT = 1e-9
FLAT = 1e-13
"""Of the diagonal: how far apart vertices may come out that lie upon each other."""
DEADLINE = 600.0
"""Seconds: else a case that hangs has no name. The first one may compile the kernels within it."""
seeds = st.integers(0, 2**31 - 1)


def mess(rng):
    """Random faces over few points of a grid: all defects at once."""
    points = rng.integers(0, int(rng.integers(2, 4)), (int(rng.integers(3, 9)), 3)).astype(float)
    if rng.integers(2):
        points += 0.1 * rng.normal(size=points.shape)
    return points, rng.integers(0, len(points), (int(rng.integers(1, 9)), 3))


def with_defects(rng, vertices, faces):
    """A mesh that keeps its surface, but not its tidiness; and which vertex became which."""
    faces = faces[rng.permutation(len(faces))]
    extra = rng.integers(0, len(vertices), (int(rng.integers(0, 4)), 3))
    extra[:, 2] = extra[:, rng.integers(2)]  # repeat a vertex
    lonely = rng.normal(size=(int(rng.integers(0, 3)), 3))
    order = rng.permutation(len(vertices) + len(lonely))
    moved = np.empty((len(order), 3))
    moved[order] = np.vstack([vertices, lonely])
    mixed = np.vstack([faces, extra])
    return moved, order[mixed[rng.permutation(len(mixed))]], order[: len(vertices)]


def torn(rng, vertices, faces):
    """Some corners of faces get vertices of their own, at the same position."""
    flat = faces.reshape(-1).copy()
    loose = np.flatnonzero(rng.random(len(flat)) < rng.choice([0.05, 0.5, 1]))
    flat[loose] = len(vertices) + np.arange(len(loose))
    return np.vstack([vertices, vertices[faces.reshape(-1)[loose]]]), flat.reshape(-1, 3)


def close_to(mesh):
    return {"rtol": EXACT, "atol": FLAT * mesh.diagonal}


def places_of(vertices, faces):
    """The lowest vertex at each one's place, which edges of no length make of several."""
    place = np.arange(len(vertices))
    edges = [
        [a, b]
        for face in faces.tolist()
        for a, b in itertools.combinations(face, 2)
        if len(set(face)) == 3 and (vertices[a] == vertices[b]).all()
    ]
    for _ in edges:
        for edge in edges:
            place[edge] = place[edge].min()
    return place


def oracle_of(mesh):
    """All distances between vertices, those at one place as one; NaN where they are not known."""
    place = places_of(mesh.vertices, mesh.faces)
    surface = [face for face in place[mesh.faces].tolist() if len(set(face)) == 3]
    assert len(surface) == np.count_nonzero(mesh.inner_face >= 0)
    try:
        return unfolding.distance_matrix(mesh.vertices, surface)[np.ix_(place, place)]
    except unfolding.UnknownError:
        return np.full((len(place), len(place)), np.nan)


def check_distances(mesh, source, distances, expected):
    """They are the oracle's; where it knows none, they are at least between their bounds."""
    assert not np.isnan(distances).any()
    if not np.isnan(expected).any():
        np.testing.assert_allclose(distances, expected, **close_to(mesh))
        return
    np.testing.assert_array_equal(
        np.isfinite(distances), mesh.components == mesh.components[source]
    )
    reached = np.isfinite(distances)
    straight = np.linalg.norm(mesh.vertices - mesh.vertices[source], axis=1)
    along = graph.edge_distances(mesh.vertices, mesh.faces, source)
    slack = close_to(mesh)["atol"]
    assert (distances >= straight * (1 - EXACT) - slack)[reached].all()
    assert (distances <= along * (1 + EXACT) + slack)[reached].all()


def check_answers(mesh, sources):
    """Distances are right, or within their error of it; paths have their lengths."""
    matrix = oracle_of(mesh)
    for source in sources:
        field = gc.exact_distance(mesh, source, deadline_s=DEADLINE)
        check_distances(mesh, source, field.distances, matrix[source])
        near = gc.approximate_distance(mesh, source, 0.01, deadline_s=DEADLINE).distances
        close = close_to(mesh) | {"rtol": 0.01 + EXACT}
        np.testing.assert_allclose(near, field.distances, **close)
        for target in sources:
            if np.isfinite(field.distances[target]):
                for path in (gc.shortest_path(mesh, source, target), field.path_to(target)):
                    np.testing.assert_allclose(
                        path.length, field.distances[target], **close_to(mesh)
                    )
                    assert (mesh.inner_face[path.faces] >= 0).all()


@given(seeds, st.sampled_from(["none", "exact"]))
def test_a_mess_is_solved_or_refused(seed, merge):
    vertices, faces = mess(np.random.default_rng(seed))
    try:
        mesh = gc.TriangleMesh(vertices, faces, merge=merge)
    except gc.errors.InvalidMesh:
        return
    assert mesh.report.faces == len(faces)
    check_answers(mesh, range(len(mesh.vertices)))


@given(cases(), seeds)
def test_defects_beside_a_surface_change_nothing(case, seed):
    rng = np.random.default_rng(seed)
    vertices, faces, number = with_defects(rng, case.vertices, case.faces)
    mesh, clean = gc.TriangleMesh(vertices, faces), gc.TriangleMesh(case.vertices, case.faces)
    source = int(rng.choice(case.faces.reshape(-1)))
    found = gc.exact_distance(mesh, int(number[source])).distances
    expected = gc.exact_distance(clean, source).distances
    np.testing.assert_allclose(found[number], expected, rtol=EXACT, atol=0)
    assert np.isinf(np.delete(found, number)).all()
    repeats = [f for f, face in enumerate(faces.tolist()) if len(set(face)) < 3]
    assert mesh.report.repeated_vertex_faces == gc.Sample(len(repeats), tuple(repeats[:10]))
    assert mesh.report.isolated_vertices.count == len(vertices) - len(np.unique(case.faces))


@given(cases(), seeds)
def test_what_is_torn_is_solved_as_torn_and_as_whole(case, seed):
    rng = np.random.default_rng(seed)
    assume(len(np.unique(case.vertices, axis=0)) == len(case.vertices))
    vertices, faces = torn(rng, case.vertices, case.faces)
    apart = gc.TriangleMesh(vertices, faces)
    source = int(rng.choice(faces.reshape(-1)))
    check_answers(apart, [source, int(rng.choice(faces.reshape(-1)))])
    used = np.unique(faces)
    copies = len(used) - len(np.unique(vertices[used], axis=0))
    assert apart.report.duplicate_vertices.count == copies
    assert any("merge='exact'" in text for text in apart.warnings) == (copies > 0)

    whole = gc.TriangleMesh(vertices, faces, merge="exact")
    clean = gc.TriangleMesh(case.vertices, case.faces)
    np.testing.assert_array_equal(whole.vertices[whole.vertex_map], vertices)
    assert whole.report.duplicate_vertices.count == 0
    start = int(case.faces[0, 0])
    found = gc.exact_distance(whole, int(whole.vertex_map[start])).distances
    expected = gc.exact_distance(clean, start).distances
    np.testing.assert_allclose(
        found[whole.vertex_map[: len(expected)]], expected, rtol=EXACT, atol=0
    )


@given(seeds)
def test_a_mess_of_polygons_is_solved_or_refused(seed):
    rng = np.random.default_rng(seed)
    points, _ = mess(rng)
    sizes = rng.integers(1, 8, int(rng.integers(1, 5)))
    corners = rng.integers(0, len(points), int(sizes.sum()))
    try:
        mesh = gc.TriangleMesh.from_polygons(points, corners, sizes)
    except gc.errors.InvalidMesh:
        return
    owner = np.arange(len(mesh.faces)) if mesh.face_map is None else mesh.face_map
    assert np.unique(owner).tolist() == list(range(len(sizes)))
    ends = np.cumsum(sizes)
    for face, polygon in zip(mesh.faces.tolist(), owner.tolist(), strict=True):
        assert set(face) <= set(corners[ends[polygon] - sizes[polygon] : ends[polygon]].tolist())
    check_answers(mesh, range(len(points)))


def soup_of_needles(seed):
    """Needles along one line with edges in common: positions, width, vertices, faces and a point.

    The point is a face and its barycentric coordinates.
    """
    rng = np.random.default_rng(seed)
    width = 10.0 ** -rng.choice([6, 7, 8, 9, 9, 9, 10, 11, 12, 13])
    corners, count = int(rng.integers(4, 9)), int(rng.integers(3, 8))
    if rng.integers(3):
        corners, count = 7, 6
    along = rng.random(corners)
    sides, kind = int(rng.integers(1, 3)), rng.integers(3)
    if kind == 0:
        across = rng.integers(1, 11, (corners, sides)).astype(float)
    else:
        across = rng.normal(size=(corners, sides))
    if kind == 2:
        across[rng.random(across.shape) < 0.4] = 0
    vertices = np.zeros((corners, 3))
    vertices[:, 0], vertices[:, 1 : 1 + sides] = along, width * across
    if rng.integers(2):
        vertices = vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    every = list(itertools.permutations(range(corners), 3))
    faces = np.array(every)[rng.choice(len(every), min(count, len(every)), replace=False)]
    rng = np.random.default_rng(seed + 10**9)
    face, weights = int(rng.integers(len(faces))), rng.choice([0, 0.25, 0.5, 0.75, 1, 0.3], 3)
    if weights.sum() == 0 or rng.integers(2):
        weights = rng.dirichlet([1, 1, 1])
    return along, width, vertices, faces, (face, weights / weights.sum())


def check_needles(along, width, vertices, faces, point):
    """All methods end, with what is there in the limit of no width."""
    mesh, (face, weights) = gc.TriangleMesh(vertices, faces), point
    at = gc.SurfacePoint.face(face, tuple(weights.tolist()))
    places = [(face, float(weights @ along[faces[face]]))]
    expected = needles.distance_matrix(along, faces.tolist(), places)[:, : len(along)]
    used, close = np.unique(faces), {"rtol": 0, "atol": 100 * len(faces) * width + 1e-12}
    for source, row in [*zip(used.tolist(), expected[used], strict=True), (at, expected[-1])]:
        exact = gc.exact_distance(mesh, source, deadline_s=DEADLINE)
        assert exact.stats.windows_created < 200
        np.testing.assert_allclose(exact.distances[used], row[used], **close)
        near = gc.approximate_distance(mesh, source, 1e-2, deadline_s=DEADLINE).distances
        np.testing.assert_allclose(near, exact.distances, rtol=1e-2 + EXACT, atol=1e-13)
        fast = gc.fast_distance(mesh, source, deadline_s=DEADLINE).distances
        assert (fast >= exact.distances * (1 - EXACT) - 1e-13).all()
        for target in used[np.isfinite(row[used])][:3].tolist():
            path = gc.shortest_path(mesh, source, target, deadline_s=DEADLINE)
            assert abs(path.length - row[target]) <= close["atol"]


@pytest.mark.slice(2)
@pytest.mark.parametrize(
    "seed",
    [1196, 1569, 2448, 3410, 3927, 4583, 4765, 5639, 10968, 11129, 11341, 11791, 12376, 14370],
)
def test_soups_of_needles_that_did_not_end(seed):
    """All of 15,000, before windows crossed an edge only once."""
    check_needles(*soup_of_needles(seed))


@given(seeds)
def test_a_soup_of_needles_ends(seed):
    check_needles(*soup_of_needles(seed))


@pytest.mark.slice(1)
@pytest.mark.parametrize("width", [1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 1e-5, 1e-4])
def test_windows_that_wind_about_a_tip_cross_its_edges_once(width):
    """At each turn they crossed an edge nearer to the tip, where no earlier one had crossed."""
    along = np.array([0.53, 0.47, 0.87, 0.21, 0.32, 0.40, 0.75])
    across = [(3, 7), (1, 10), (6, 6), (2, 4), (5, 1), (3, 9), (1, 7)]
    faces = np.array([(5, 3, 6), (2, 0, 6), (2, 3, 1), (2, 1, 3), (4, 2, 5), (2, 3, 4)])
    vertices = np.column_stack([along, width * np.array(across)])
    check_needles(along, width, vertices, faces, (0, np.array([0.0, 0.25, 0.75])))
