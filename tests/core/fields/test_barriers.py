"""Blocked faces: holes in the surface, while everything keeps its number."""

import itertools
import math
import warnings

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo

pytestmark = pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource")


def some_barriers(case: zoo.Case, share: float, seed: int = 0) -> np.ndarray:
    """Random faces of a mesh, one at least, and not all."""
    count = min(max(1, round(share * len(case.faces))), len(case.faces) - 1)
    return np.random.default_rng(seed).choice(len(case.faces), count, replace=False)


def free_faces(case: zoo.Case, barriers) -> np.ndarray:
    return np.setdiff1d(np.arange(len(case.faces)), barriers)


def pair_of_meshes(case: zoo.Case, barriers):
    """The mesh with barriers, the mesh of the free faces alone, and the ids of these."""
    kept = free_faces(case, barriers)
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    return mesh.with_barriers(barriers), gc.TriangleMesh(case.vertices, case.faces[kept]), kept


BLOCKABLE = {
    name: case for name, case in (zoo.SMALL | zoo.IRREGULAR).items() if len(case.faces) > 1
}


# What distances are ------------------------------------------------------------------------------


@pytest.mark.jit
@pytest.mark.slice(4)
@zoo.each(BLOCKABLE)
def test_all_is_as_on_a_mesh_of_the_free_faces(case):
    """To the bit, but for the numbers of the faces."""
    barriers = some_barriers(case, 0.25, seed=2)
    mesh, alone, kept = pair_of_meshes(case, barriers)
    np.testing.assert_array_equal(mesh.barriers, np.sort(barriers))
    for name, array in mesh.topology._asdict().items():
        other = getattr(alone.topology, name)
        np.testing.assert_array_equal(array, kept[other] if name == "outer_face" else other)
    source, *targets = np.unique(alone.faces)[:: 1 + len(case.vertices) // 4].tolist()
    targets.append(gc.SurfacePoint.face(int(kept[-1]), (0.5, 0.3, 0.2)))
    others = [*targets[:-1], gc.SurfacePoint.face(len(kept) - 1, (0.5, 0.3, 0.2))]
    solver, other_solver = gc.Solver(mesh), gc.Solver(alone)
    for solve in (gc.exact_distance, gc.approximate_distance):
        field, known = solve(mesh, source), solve(alone, source)
        np.testing.assert_array_equal(field.distances, known.distances)
        np.testing.assert_array_equal(field.nearest_source, known.nearest_source)
        for target, other in zip(targets, others, strict=True):
            assert field.distance_at(target) == known.distance_at(other)
            if math.isfinite(known.distance_at(other)):
                same_path(field.path_to(target), known.path_to(other), kept)
                path = solver.shortest_path(source, target)
                same_path(path, other_solver.shortest_path(source, other), kept)
    for ask in (
        lambda solver, ends: solver.distance_matrix([source, *ends], ends),
        lambda solver, ends: solver.nearest(source, ends, 2).indices,
        lambda solver, ends: solver.nearest(source, ends, 2).distances,
    ):
        np.testing.assert_array_equal(ask(solver, targets), ask(other_solver, others))


def same_path(path: gc.GeodesicPath, other: gc.GeodesicPath, kept: np.ndarray) -> None:
    assert path.length == other.length
    np.testing.assert_array_equal(path.points, other.points)
    np.testing.assert_array_equal(path.faces, kept[other.faces])
    for here, there in zip(path.locations, other.locations, strict=True):
        assert here.face_index == kept[there.face_index]
        assert (here.barycentric, here.vertex_index) == (there.barycentric, there.vertex_index)


def test_a_wall_separates():
    points, faces = zoo.grid(5, 3)
    wall = [2 * (5 * row + 2) + half for row in range(3) for half in (0, 1)]
    mesh = gc.TriangleMesh(points, faces)
    field = gc.exact_distance(mesh, 0, barriers=wall)
    beyond = points[:, 0] > 2
    np.testing.assert_array_equal(np.isinf(field.distances), beyond)
    np.testing.assert_array_equal(field.nearest_source, np.where(beyond, -1, 0))
    assert field.mesh.report.components == 2
    across = int(np.flatnonzero(beyond)[0])
    for ask in (
        lambda: field.path_to(across),
        lambda: field.path_to(gc.SurfacePoint.face(8, (0.2, 0.3, 0.5))),
        lambda: gc.shortest_path(field.mesh, 0, across),
    ):
        with pytest.raises(gc.errors.NoPath, match="among 6 blocked faces") as caught:
            ask()
        assert caught.value.reason == "disconnected"
    assert math.isfinite(gc.exact_distance(mesh, 0, barriers=wall[:-2]).distances[across])


def test_a_path_bends_at_the_corners_of_a_blocked_face():
    """Around a square hole, from the middle of a cell to the middle of that across."""
    points, faces = zoo.grid(3, 3)
    mesh = gc.TriangleMesh(points, faces).with_barriers([8, 9])
    path = gc.shortest_path(mesh, mesh.locate((0.5, 1.5, 0)), mesh.locate((2.5, 1.5, 0)))
    assert path.length == pytest.approx(1 + 2 * math.sqrt(0.5), rel=1e-15)
    bends = [p.vertex_index for p in path.locations if p.vertex_index is not None]
    assert bends in ([5, 6], [9, 10])


# Points ------------------------------------------------------------------------------------------


@pytest.fixture
def fan():
    """A hexagon around vertex 0 of which the faces 0, 1 and 2 of six are blocked."""
    angles = np.arange(6) * math.pi / 3
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    faces = [(0, 1 + i, 1 + (i + 1) % 6) for i in range(6)]
    return gc.TriangleMesh([(0, 0, 0), *rim.tolist()], faces).with_barriers([2, 0, 1])


INSIDE = [
    gc.SurfacePoint.face(1, (0.2, 0.3, 0.5)),
    gc.SurfacePoint.face(1, (1e-6, 0.4, 0.6 - 1e-6)),
    gc.SurfacePoint.edge(1, 1, 0.5),  # on the rim
    gc.SurfacePoint.edge(1, 0, 0.5),  # between two blocked faces
    gc.SurfacePoint.edge(0, 2, 0.25),
]


@pytest.mark.parametrize("point", INSIDE)
def test_points_of_blocked_faces_alone_are_refused(fan, point):
    field = gc.exact_distance(fan, 0)
    face = point.face_index
    for ask, name in (
        (lambda: fan.point(point), "point"),
        (lambda: gc.exact_distance(fan, [0, point]), "source 1"),
        (lambda: gc.approximate_distance(fan, 0, targets=[point]), "target 0"),
        (lambda: gc.shortest_path(fan, 0, point), "target"),
        (lambda: gc.shortest_path(fan, 0, 5, [point]), "waypoint 0"),
        (lambda: gc.distance_matrix(fan, [0], [0, point]), "target 1"),
        (lambda: gc.nearest(fan, 0, [point]), "candidate 0"),
        (lambda: field.distance_at(point), "point"),
        (lambda: field.path_to(point), "target"),
    ):
        with pytest.raises(gc.errors.InvalidPoint, match=f"the {name} lies in face {face}, which"):
            ask()


@pytest.mark.parametrize("barriers", [[4], range(4, 8)])
def test_points_given_with_barriers_are_checked_against_them(barriers):
    mesh = gc.TriangleMesh(*zoo.octahedron())
    inside = gc.SurfacePoint.face(4, (0.2, 0.3, 0.5))
    assert gc.exact_distance(mesh, inside).distance_at(inside) == 0
    for solve in (gc.exact_distance, gc.approximate_distance):
        with pytest.raises(gc.errors.InvalidPoint, match="source 0 lies in face 4, which is block"):
            solve(mesh, inside, barriers=barriers)


@pytest.mark.parametrize(
    ("t", "lowest"), [(0.3, 5), (1 / 3, 5), (1e-11, 5), (0.0, 3), (1e-13, 3), (1.0, 5)]
)
def test_points_of_an_edge_beside_a_free_face_are_one_in_all_spellings(fan, t, lowest):
    """From vertex 0, in the middle, to 1: between face 0, which is blocked, and face 5."""
    spellings = [
        fan.point(gc.SurfacePoint.edge(0, 0, t)),
        fan.point(gc.SurfacePoint.edge(5, 2, 1 - t)),
        fan.point(gc.SurfacePoint.face(0, (1 - t, t, -5e-17))),
        fan.point_on_edge(0, 1, t),
        fan.point_on_edge(1, 0, 1 - t),
        fan.locate((1 - t) * fan.vertices[0] + t * fan.vertices[1]),
    ]
    assert set(spellings) == {spellings[0]}
    assert spellings[0].face_index == lowest
    assert fan.point(spellings[0]) == spellings[0]


def test_points_of_free_faces_are_where_they_were(fan):
    whole = gc.TriangleMesh(fan.vertices, fan.faces)
    for face, corner, t in itertools.product((3, 4, 5), range(3), (0.0, 0.1, 0.7)):
        point = whole.point(gc.SurfacePoint.edge(face, corner, t))
        np.testing.assert_array_equal(fan.position(point), whole.position(point))
        if point.face_index not in fan.barriers:
            assert fan.point(point) == point


def test_edges_of_blocked_faces_alone_are_none(fan):
    with pytest.raises(gc.errors.InvalidPoint, match="no edge of a free face joins the vertices 2"):
        fan.point_on_edge(2, 3, 0.5)


def test_locating_finds_free_faces_only(fan):
    found = fan.locate((0.1, 0.5, 0))
    np.testing.assert_allclose(fan.position(found), (0.1, 0, 0), atol=1e-15)
    assert found.face_index == 5
    with pytest.raises(gc.errors.InvalidPoint, match=r"0\.5 away"):
        fan.locate((0.1, 0.5, 0), 0.4)


def test_vertices_of_no_free_face_are_isolated(fan):
    """Vertices 2 and 3 lie on blocked faces alone."""
    assert fan.report.isolated_vertices.ids == (2, 3)
    assert fan.point(gc.SurfacePoint.edge(1, 1, 0.0)) == fan.point(2) == gc.SurfacePoint.vertex(2)
    field = gc.exact_distance(fan, 0)
    assert field.distances[2] == field.distance_at(3) == math.inf
    lonely = gc.exact_distance(fan, 2)
    np.testing.assert_array_equal(np.isfinite(lonely.distances), np.arange(7) == 2)
    assert gc.distance_matrix(fan, [2, 0], [2, 3]).tolist() == [[0, math.inf], [math.inf] * 2]
    assert len(gc.nearest(fan, 2, [0, 3]).indices) == 0
    for ask in (
        lambda: field.path_to(2),
        lambda: lonely.path_to(0),
        lambda: gc.shortest_path(fan, 0, 2),
        lambda: gc.shortest_path(fan, 2, 0),
    ):
        with pytest.raises(gc.errors.NoPath, match="vertex 2 belongs to no free face") as caught:
            ask()
        assert caught.value.reason == "disconnected"


# The mesh ----------------------------------------------------------------------------------------


def test_the_report_tells_of_the_free_faces(fan):
    report = fan.report
    assert (report.vertices, report.faces, report.edges) == (7, 6, 7)
    assert (report.components, report.boundary_loops, report.euler_characteristic) == (1, 1, 1)
    assert report.boundary_vertices == 5
    assert report.repeated_vertex_faces.count == 0
    assert repr(fan) == "TriangleMesh(7 vertices, 6 faces, 3 of them blocked)"


def test_faces_that_repeat_a_vertex_are_no_barriers():
    points, faces = zoo.octahedron()
    mesh = gc.TriangleMesh(points, [(0, 0, 1), *faces.tolist()])
    assert mesh.with_barriers([0]) is mesh
    blocked = mesh.with_barriers([0, 3])
    assert blocked.barriers.tolist() == [3]
    assert blocked.report.repeated_vertex_faces.ids == (0,)
    with pytest.raises(gc.errors.InvalidPoint, match="face 0, which repeats a vertex"):
        blocked.point(gc.SurfacePoint.face(0, (0.0, 0.0, 1.0)))


def test_barriers_add_up():
    mesh = gc.TriangleMesh(*zoo.icosahedron())
    assert len(mesh.barriers) == 0
    assert mesh.with_barriers([]) is mesh
    twice = mesh.with_barriers([3, 7, 3]).with_barriers(iter([7, 1]))
    assert twice.barriers.tolist() == [1, 3, 7]
    assert twice.with_barriers((3,)) is twice
    assert len(mesh.barriers) == 0
    np.testing.assert_array_equal(
        gc.exact_distance(mesh.with_barriers([3]), 0, barriers={1, 7}).distances,
        gc.exact_distance(twice, 0).distances,
    )


def test_the_field_of_barriers_is_of_the_mesh_with_them():
    mesh = gc.TriangleMesh(*zoo.icosahedron())
    field = gc.exact_distance(mesh, 0, barriers=np.array([2, 5], np.uint8))
    assert field.mesh.barriers.tolist() == [2, 5]
    assert gc.Solver(mesh).approximate_distance(0, barriers=[4]).mesh.barriers.tolist() == [4]


def test_maps_and_arrays_are_shared_and_kept():
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 0), (0, 2, 0), (1, 2, 0)])
    mesh = gc.TriangleMesh.from_polygons(
        points, [0, 1, 2, 3, 4, 2, 6, 5], [4, 4], merge="exact", notes=["from a file"]
    )
    blocked = mesh.with_barriers([1])
    assert np.shares_memory(blocked.vertices, mesh.vertices)
    assert np.shares_memory(blocked.faces, mesh.faces)
    np.testing.assert_array_equal(blocked.face_map, [0, 0, 1, 1])
    np.testing.assert_array_equal(blocked.vertex_map, mesh.vertex_map)
    assert blocked.warnings[0] == "from a file"
    again = gc.TriangleMesh.from_arrays(blocked.arrays())
    assert again.barriers.tolist() == [1]
    assert again.with_barriers([0]).barriers.tolist() == [0, 1]
    np.testing.assert_array_equal(
        gc.exact_distance(again, 0).distances, gc.exact_distance(blocked, 0).distances
    )


def test_blocking_a_sheet_of_an_irregular_edge_leaves_a_plain_one():
    case = zoo.IRREGULAR["three_faces_at_an_edge"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    edge = set(mesh.report.non_manifold_edges.ids[0])
    sheet = next(f for f, corners in enumerate(case.faces.tolist()) if edge <= set(corners))
    assert mesh.with_barriers([sheet]).report.non_manifold_edges.count == 0


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("barriers", "message"),
    [
        ([0, -1], r"barrier 1 is face -1, but faces are numbered 0 to 7"),
        ([8], r"barrier 0 is face 8"),
        ([2**70], r"barrier 0 is face 1180591620717411303424"),
        (np.array([1, 2**63], np.uint64), r"barrier 1 is face 9223372036854775808"),
        ([1.0], r"barrier 0 is 1\.0"),
        (np.array([1.0]), r"barrier 0 is .*1\.0"),
        ([0, "1"], r"barrier 1 is '1'"),
        ([0, None], r"barrier 1 is None"),
        ([[0, 1], [2]], r"barrier 0 is \[0, 1\]"),
        (np.zeros((2, 2), int), r"barrier 0 is array\(\[0, 0\]\)"),
        ([2, True], r"barrier 1 is True.*numpy\.flatnonzero"),
        (np.arange(8) < 2, r"barrier 0 is .*True.*numpy\.flatnonzero"),
        ("12", r"barriers is '12'; it must be a sequence of face ids"),
        (3, r"barriers is 3"),
        (None, r"barriers is None"),
        (range(8), r"block every face"),
    ],
)
def test_barriers_that_are_none(barriers, message):
    mesh = gc.TriangleMesh(*zoo.octahedron())
    for ask in (
        lambda: mesh.with_barriers(barriers),
        lambda: gc.exact_distance(mesh, 0, barriers=barriers),
        lambda: gc.approximate_distance(mesh, 0, barriers=barriers),
    ):
        with pytest.raises(gc.errors.InvalidArgument, match=message):
            ask()


def test_memory_for_the_mesh_with_barriers_counts():
    mesh = gc.TriangleMesh(*zoo.icosphere(2))
    peak = gc.exact_distance(mesh, 0).stats.peak_bytes
    gc.exact_distance(mesh, 0, memory_limit=peak)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.exact_distance(mesh, 0, barriers=[5], memory_limit=peak)
    gc.exact_distance(mesh, 0, barriers=[5], memory_limit=2 * peak + mesh.nbytes)


def test_what_may_not_take_the_memory_does_not(monkeypatch):
    mesh = gc.TriangleMesh(*zoo.icosphere(2))
    monkeypatch.setattr(
        gc.TriangleMesh, "with_barriers", lambda *_: pytest.fail("made all the same")
    )
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.exact_distance(mesh, 0, barriers=[5], memory_limit=1000)


# Calls that take barriers -----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.jit
@zoo.each({name: BLOCKABLE[name] for name in ("crags", "crumpled_torus", "octahedron")})
def test_every_call_takes_barriers_as_the_mesh_does(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    blocked = some_barriers(case, 0.2)
    holed = mesh.with_barriers(blocked)
    free = np.unique(holed.faces[np.setdiff1d(np.arange(len(mesh.faces)), blocked)])
    solver, other = gc.Solver(mesh), gc.Solver(holed)
    component = holed.components[free]
    start, *ends = free[component == np.bincount(component).argmax()].tolist()
    unblocked = solver.shortest_path(start, ends[-1]).length
    for caller, same in (((gc, mesh), (gc, holed)), ((solver,), (other,))):
        (call, *given), (twin, *taken) = caller, same
        path = call.shortest_path(
            *given, start, ends[-1], [ends[0]], barriers=blocked, explain=True
        )
        expected = twin.shortest_path(*taken, start, ends[-1], [ends[0]], explain=True)
        np.testing.assert_array_equal(path.points, expected.points)
        assert path.mesh.barriers.tolist() == sorted(blocked.tolist())
        for layout in ("dense", "pairs"):
            for method in ("exact", "fast"):
                options = {"layout": layout, "method": method}
                np.testing.assert_array_equal(
                    call.distance_matrix(*given, ends, ends, barriers=blocked, **options),
                    twin.distance_matrix(*taken, ends, ends, **options),
                )
        near = call.nearest(*given, start, ends, 2, barriers=blocked)
        np.testing.assert_array_equal(
            near.distances, twin.nearest(*taken, start, ends, 2).distances
        )
    assert solver.shortest_path(start, ends[-1]).length == unblocked  # they were of one call


@pytest.mark.jit
def test_barriers_of_a_call_count_as_its_memory():
    mesh = gc.samples.plane(800)
    needed = sum(array.nbytes for array in (*mesh.topology, mesh.positions))
    calls = (
        lambda **limits: gc.shortest_path(mesh, 10, 20, **limits),
        lambda **limits: gc.distance_matrix(mesh, 10, 20, **limits),
        lambda **limits: gc.nearest(mesh, 10, 20, **limits),
    )
    for call in calls:
        with pytest.raises(gc.errors.MemoryLimitExceeded) as caught:
            call(memory_limit=1, barriers=[0])
        assert caught.value.needed == needed
        with pytest.raises(gc.errors.InvalidArgument, match="barrier 0 is face 800"):
            call(barriers=[800])


# What is told ------------------------------------------------------------------------------------


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance, gc.fast_distance])
def test_sources_in_blocked_faces_only_are_told(solve):
    mesh = gc.samples.plane(32)
    wall = np.flatnonzero((mesh.vertices[:, 0] > 0.6)[mesh.faces].all(axis=1))
    inside = np.setdiff1d(mesh.faces[wall], np.delete(mesh.faces, wall, axis=0)).tolist()
    with pytest.warns(gc.errors.BlockedSource, match=f"^source 1, vertex {inside[0]}, lies in bl"):
        field = solve(mesh, [0, inside[0]], barriers=wall)
    assert np.isfinite(field.distances).sum() == len(mesh.vertices) - len(inside) + 1
    twelve = [inside[i % len(inside)] for i in range(12)]
    with pytest.warns(gc.errors.BlockedSource, match="; 2 more, lie in blocked faces only") as told:
        solve(mesh.with_barriers(wall), twelve)
    assert len(told) == 1
    with warnings.catch_warnings(action="error"):  # free faces have it, too
        solve(mesh, [0, int(mesh.faces[wall[0], 0])], barriers=wall[:1])


def test_a_vertex_in_no_face_is_not_in_a_blocked_one():
    mesh = gc.TriangleMesh([*np.eye(3), [1.0, 1.0, 0.0], [5.0, 5.0, 5.0]], [[0, 1, 2], [0, 1, 3]])
    with warnings.catch_warnings(action="error"):
        assert np.isfinite(gc.exact_distance(mesh, 4, barriers=[0]).distances).sum() == 1


def test_a_blocked_face_stays_blocked_though_its_corners_are_at_one_place():
    """Two of them are one vertex of the surface, by a free face; the third is not joined to it."""
    vertices = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    mesh = gc.TriangleMesh(vertices, [[0, 1, 2], [0, 1, 3], [1, 3, 4], [2, 4, 5]])
    blocked = mesh.with_barriers([0])
    assert blocked.barriers.tolist() == [0]
    assert gc.exact_distance(blocked, 3).distance_at(2) == pytest.approx(1 + 2**0.5)
    twice = blocked.with_barriers([3])
    assert twice.barriers.tolist() == [0, 3]
    assert twice.topology.inner_vertex[2] != twice.topology.inner_vertex[1]
