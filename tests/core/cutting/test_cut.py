"""Cuts of known shapes, against closed forms and other libraries."""

import re

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.cutting import retriangulation
from geodesic_core.cutting.cut import cut_along
from geodesic_core.cutting.lines import Line
from geodesic_core.errors import InternalError, InvalidArgument, InvalidMesh, InvalidPoint
from geodesic_core.kernels.cutting.predicates import STEPS, twice_area
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.tolerances import MERGE
from tests.support.cuts import (
    KINDS,
    check_cut,
    check_tiling,
    fins,
    flat_grid,
    random_curves,
    random_mesh,
)


def mesh_of_torus(around: int = 12, across: int = 8) -> gc.TriangleMesh:
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u.ravel() / around, 2 * np.pi * v.ravel() / across
    radius = 3.0 + np.cos(b)
    vertices = np.stack([radius * np.cos(a), radius * np.sin(a), np.sin(b)], axis=1)

    def at(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return (i % around * across + j % across).ravel()

    corners = at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)
    faces = np.concatenate(
        [np.stack([corners[i] for i in row], 1) for row in ((0, 1, 2), (0, 2, 3))]
    )
    return gc.TriangleMesh(vertices, faces)


def sphere_loop(mesh: gc.TriangleMesh, axis: int, height: float) -> gc.Curve:
    """The section of a closed convex mesh by a plane, as a curve from crossing to crossing."""
    values = mesh.vertices[:, axis] - height
    assert (values != 0.0).all()
    face = start = int(np.flatnonzero(np.ptp(np.sign(values[mesh.faces]), axis=1))[0])
    neighbours = {
        tuple(edge): f
        for f, corners in enumerate(mesh.faces.tolist())
        for edge in (corners[:2], corners[1:], corners[2:] + corners[:1])
    }
    points = []
    while True:
        corners = mesh.faces[face].tolist()
        i = next(i for i in range(3) if values[corners[i]] < 0.0 < values[corners[(i + 1) % 3]])
        u, v = corners[i], corners[(i + 1) % 3]
        points.append(mesh.point_on_edge(u, v, values[u] / (values[u] - values[v])))
        face = neighbours[v, u]
        if face == start:
            return gc.Curve([*points, points[0]])


def border_loops(faces: np.ndarray) -> int:
    """Number of closed lines of edges of one face, each vertex of which has two of them."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    each, count = np.unique(ends, axis=0, return_counts=True)
    border = each[count == 1]
    assert (np.unique(border, return_counts=True)[1] == 2).all()
    return components(border)


def components(pairs: np.ndarray) -> int:
    root = {int(v): int(v) for v in pairs.ravel()}

    def find(v: int) -> int:
        while root[v] != v:
            v = root[v]
        return v

    for u, v in pairs.tolist():
        root[find(u)] = find(v)
    return sum(v == find(v) for v in root)


def shape_of(cut: gc.CutMesh) -> tuple[int, int, int]:
    """Parts, border loops and Euler number of a cut mesh; parts are those of its vertices, too."""
    faces = cut.faces
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, parts = np.unique(ends, axis=0), int(cut.parts.max()) + 1
    assert parts == components(edges) == len(np.unique(cut.mesh.components[faces]))
    return parts, border_loops(faces), len(np.unique(faces)) - len(edges) + len(faces)


SPHERE = gc.samples.sphere(320)
LOOPS = [sphere_loop(SPHERE, axis, 0.1234) for axis in range(3)]
FIRST, LAST = 0, int(np.argmin(SPHERE.vertices @ SPHERE.vertices[0]))


@pytest.mark.parametrize(
    ("curves", "shape"),
    [
        (LOOPS[:1], (2, 2, 2)),
        (LOOPS[:2], (4, 4, 4)),
        (LOOPS, (8, 8, 8)),
        ([gc.shortest_path(SPHERE, FIRST, LAST)], (1, 1, 1)),
        ([sphere_loop(SPHERE, 0, 0.6), sphere_loop(SPHERE, 0, -0.6)], (3, 4, 2)),
    ],
    ids=["a loop", "two that cross", "three", "a path", "two apart"],
)
def test_a_sphere_comes_apart(curves, shape):
    assert shape_of(gc.cut(SPHERE, curves)) == shape
    assert shape_of(gc.cut(SPHERE, [*curves, *curves])) == shape


@pytest.mark.parametrize(
    ("curves", "shape"),
    [
        ([list(range(8))], (1, 2, 0)),
        ([list(range(0, 96, 8))], (1, 2, 0)),
        ([list(range(8)), list(range(0, 96, 8))], (1, 1, 1)),
    ],
    ids=["meridian", "longitude", "both"],
)
def test_a_torus_is_cut_open(curves, shape):
    torus = mesh_of_torus()
    assert shape_of(gc.cut(torus, [gc.Curve([*each, each[0]]) for each in curves])) == shape


def sides_of(polygon: np.ndarray, start: np.ndarray, end: np.ndarray) -> list[np.ndarray]:
    """What of a convex polygon is left and right of a line, where that has an area."""
    across = np.array([start[1] - end[1], end[0] - start[0]])
    heights = (polygon - start) @ across
    sides = []
    for sign in (1.0, -1.0):
        corners = []
        for i in range(len(polygon)):
            a, b = sign * heights[i - 1], sign * heights[i]
            if a * b < 0.0:
                corners.append(polygon[i - 1] + a / (a - b) * (polygon[i] - polygon[i - 1]))
            if b >= 0.0:
                corners.append(polygon[i])
        if len(corners) > 2 and area_of(np.array(corners)) > 1e-9:
            sides.append(np.array(corners))
    return sides


def area_of(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_areas_of_a_cut_square_are_those_of_its_polygons():
    mesh = gc.TriangleMesh(*flat_grid(7))
    random = np.random.default_rng(5)
    ends = random.integers(0, 8, (12, 2))
    pairs = [(int(8 * a), int(8 * b + 7)) for a, b in ends]  # from the left side to the right one
    curves = [gc.shortest_path(mesh, *pair) for pair in pairs]
    cut = gc.cut(mesh, curves)
    corners = cut.vertices[cut.faces]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    polygons = [np.array([[0.0, 0.0], [7.0, 0.0], [7.0, 7.0], [0.0, 7.0]])]
    for pair in pairs:
        start, end = mesh.vertices[list(pair), :2]
        polygons = [side for polygon in polygons for side in sides_of(polygon, start, end)]
    expected = sorted(map(area_of, polygons))
    assert np.allclose(sorted(np.bincount(cut.parts, areas)), expected, rtol=0.0, atol=1e-8)


def test_sheets_that_share_a_line_come_apart_along_it():
    sheets = gc.TriangleMesh(*fins(np.random.default_rng(0), 3))
    cut = gc.cut(sheets, gc.Curve([0, 1, 2]))
    assert shape_of(cut) == (3, 3, 3)
    check_tiling(cut)
    crossed = gc.Curve([3, sheets.point_on_edge(0, 1, 0.5), 6])
    assert gc.cut(sheets, crossed).parts.max() == 0, "the third sheet holds them"


def test_a_curve_of_one_edge_opens_in_its_middle():
    mesh = gc.samples.plane(32)
    inner = next(v for v in range(len(mesh.vertices)) if (mesh.faces == v).sum() == 6)
    face = int(np.flatnonzero((mesh.faces == inner).any(axis=1))[0])
    curve = gc.Curve(
        [gc.SurfacePoint.face(face, w) for w in ((0.5, 0.25, 0.25), (0.25, 0.5, 0.25))]
    )
    cut = gc.cut(mesh, curve)
    assert len(cut.curve_edges) == 2
    assert border_loops(cut.faces) == border_loops(mesh.faces) + 1
    check_cut(mesh, [curve])


def test_a_curve_of_one_point_makes_it_a_vertex():
    mesh = gc.samples.plane(2)
    cut = gc.cut(mesh, gc.Curve([gc.SurfacePoint.face(0, (0.25, 0.25, 0.5))]))
    assert len(cut.vertices) == 5
    assert cut.location_of[4].barycentric == (0.25, 0.25, 0.5)
    assert len(cut.curve_edges) == 0


def test_owners_of_edges_are_all_curves_that_have_them():
    mesh = gc.TriangleMesh(*flat_grid(3))
    curves = [gc.Curve([0, 1, 2]), gc.Curve([1, 2, 3]), gc.Curve([2, 1])]
    cut = gc.cut(mesh, curves, separate=False)
    owners = {
        tuple(edge): set(cut.edge_curves[cut.edge_curves[:, 0] == i, 1].tolist())
        for i, edge in enumerate(cut.curve_edges.tolist())
    }
    assert owners == {(0, 1): {0}, (1, 2): {0, 1, 2}, (2, 3): {1}}
    assert len(cut.vertices) == len(mesh.vertices)
    assert np.array_equal(cut.faces, mesh.faces)


def test_points_go_there_and_back():
    mesh = gc.samples.sphere(320)
    field = gc.exact_distance(mesh, 0)
    cut = gc.cut(mesh, [field.path_to(v) for v in (7, 30, 100)], separate=False)
    random = np.random.default_rng(1)
    for face in random.integers(len(mesh.faces), size=50).tolist():
        given = mesh.point(gc.SurfacePoint.face(face, tuple(random.dirichlet([1, 1, 1]).tolist())))
        new = cut.to_new(given)
        old = cut.to_old(new)
        assert np.abs(cut.mesh.position(new) - mesh.position(given)).max() <= 1e-14
        assert np.abs(mesh.position(old) - mesh.position(given)).max() <= 1e-14
    for vertex in range(len(cut.vertices)):
        old = cut.to_old(vertex)
        assert old == cut.location_of[vertex]
        assert np.abs(mesh.position(old) - cut.vertices[vertex]).max() <= 1e-15
    every = range(len(mesh.vertices))
    assert [point.vertex_index for point in cut.to_new(every)] == list(every)


def test_values_are_carried_over():
    mesh = gc.samples.sphere(320)
    loop = sphere_loop(mesh, 2, 0.1234)
    cut = gc.cut(mesh, loop)
    assert np.abs(cut.carry(mesh.vertices) - cut.vertices).max() <= 1e-15
    assert np.array_equal(cut.carry(np.arange(len(mesh.faces))), cut.face_of)
    beyond = np.where(mesh.vertices[:, 2] > 0.1234, np.nan, 1.0)
    met = np.isnan(cut.carry(beyond))
    assert met[len(mesh.vertices) :].all(), "each new vertex is on an edge that has an end there"
    flat = gc.samples.plane(2)
    one = gc.cut(flat, gc.Curve([0, 1]), separate=False)
    below = [1.0, np.nan, np.nan, np.nan]
    assert np.array_equal(one.carry(below), below, equal_nan=True)
    for values in (np.zeros(3), ["a"] * 4, 1.0):
        with pytest.raises(InvalidArgument, match="values have shape"):
            one.carry(values)
    tetrahedron = gc.TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    )
    both = gc.cut(tetrahedron, gc.Curve([0, 1]), separate=False)
    assert both.carry(range(4), of="faces").tolist() == [0, 1, 2, 3]
    with pytest.raises(InvalidArgument, match="name which"):
        both.carry(range(4))


def test_barriers_stay_blocked_and_are_split_with_their_neighbours():
    mesh = gc.TriangleMesh(*flat_grid(4)).with_barriers([9, 10])
    path = gc.shortest_path(mesh, 0, 24)
    cross = gc.Curve([mesh.point_on_edge(1, 6, 0.5), mesh.point_on_edge(1, 7, 0.25)])
    cut = gc.cut(mesh, [path, cross], separate=False)
    assert np.array_equal(np.unique(cut.face_of[cut.mesh.barriers]), [9, 10])
    before, after = (gc.exact_distance(m, 0).distances for m in (mesh, cut.mesh))
    assert np.abs(after[: len(before)] - before).max() <= 1e-12
    check_cut(mesh, [path, cross])


def test_a_surface_by_lengths_is_cut_like_the_one_in_space():
    space = gc.samples.sphere(320)
    corners = space.vertices[space.faces]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    mesh = gc.TriangleMesh.from_lengths(space.faces, lengths)
    targets = (7, 30, 100, 140)
    paths = [gc.exact_distance(mesh, 3).path_to(v) for v in targets]
    cut = gc.cut(mesh, paths, separate=False)
    before, after = (gc.exact_distance(m, 3).distances for m in (mesh, cut.mesh))
    assert np.abs(after[: len(before)] - before).max() <= 1e-10
    check_tiling(cut)
    placed = gc.cut(space.with_lengths(lengths), paths)
    ends = placed.vertices[placed.faces]
    expected = np.linalg.norm(np.roll(ends, -1, axis=1) - ends, axis=2)
    assert placed.mesh.lengths is not None
    assert np.abs(placed.mesh.lengths - expected).max() <= 1e-14


def test_points_that_snap_are_told():
    mesh = gc.samples.plane(8)
    near, off = MERGE / 2, 2 * MERGE
    weights = [(1 - 2 * w, w, w) for w in (near, off)]
    weights += [(0.5 - w, 0.5, w) for w in (near, off, 0.0)]
    line = gc.Curve([gc.SurfacePoint.face(0, each) for each in weights])
    cut = gc.cut(mesh, [gc.Curve([0, 1]), line])
    assert cut.snapped.tolist() == [[1, 0], [1, 2]]


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_merge_makes_points_one_that_are_nearer(share):
    mesh = gc.samples.plane(2)
    near = share * MERGE
    at_edge = [mesh.point_on_edge(0, 3, t) for t in (0.5, 0.5 + near, near)]
    curves = [gc.Curve([1, point]) for point in at_edge]
    assert len(gc.cut(mesh, curves, separate=False).vertices) == (5 if share < 1.0 else 7)
    inside = gc.Curve([gc.SurfacePoint.face(0, (0.5, 0.5 - near, near)), 1])
    (found,) = gc.cut(mesh, inside, separate=False).location_of[4:]
    assert (found.barycentric[2] == 0.0) == (share < 1.0)


def test_signs_of_areas_are_exact():
    random = np.random.default_rng(3)
    for _ in range(300):
        start = random.integers(0, STEPS // 2, 2)
        step = random.integers(0, 2 ** int(random.integers(2, 39)), 2)
        places = np.array([start, start + step, start + step // 2 + random.integers(-1, 2, 2)])
        (ax, ay), (bx, by), (cx, cy) = places.tolist()
        exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        found = twice_area(places.astype(np.int64), 0, 1, 2)
        assert np.sign(found) == np.sign(exact)
        products = abs((bx - ax) * (cy - ay)) + abs((by - ay) * (cx - ax))
        assert abs(found - exact) <= 1e-15 * products


@pytest.mark.jit
def test_many_chords_of_one_face():
    mesh = gc.samples.plane(2)
    t = np.linspace(0.01, 0.99, 60)
    sides = [[gc.SurfacePoint.edge(0, side, float(s)) for s in t] for side in range(3)]
    curves = [gc.Curve([a, b]) for a, b in zip(sides[0], sides[1][::-1] + sides[2], strict=False)]
    curves += [gc.Curve([a, b]) for a, b in zip(sides[1], sides[2], strict=True)]
    check_cut(mesh, curves)


def test_a_crossing_beside_an_edge_is_a_point_of_it_in_all_its_faces():
    mesh = gc.samples.plane(2)
    curves = [
        gc.Curve(
            [gc.SurfacePoint.face(0, (weight, 0.06, 0.94 - weight)), mesh.point_on_edge(0, 3, t)]
        )
        for weight, t in ((0.1, 0.5), (0.9, 0.5 + 10.0 * MERGE))
    ]
    cut = gc.cut(mesh, curves, separate=False)
    at = np.array([point.barycentric for point in cut.location_of[4:]])
    crossing = at[(at[:, 1] == 0.0) & (np.abs(at[:, 2] - 0.5 - 5.0 * MERGE) < MERGE)]
    assert len(crossing) == 1
    check_cut(mesh, curves)


def test_points_whose_faces_meet_elsewhere_are_joined_there_or_refused():
    mesh = gc.samples.plane(2)
    inside, on_edge = (0.2, 0.3, 0.5), (0.5, 0.0, 0.5)

    def cut_in(
        faces: list[int], weights: list[tuple[float, float, float]], face: int
    ) -> gc.CutMesh:
        line = Line(np.array(faces), np.array(weights), np.array([face]), closed=False)
        return cut_along(mesh, [line], gc.Control(), separate=False)

    assert np.array_equal(
        cut_in([0, 0], [inside, on_edge], 1).faces, cut_in([0, 0], [inside, on_edge], 0).faces
    )
    with pytest.raises(InvalidPoint, match="the points 0 and 1 of curve 0 have no face in common"):
        cut_in([0, 1], [inside, inside], 0)


def test_a_closed_line_ends_where_it_begins():
    mesh = gc.samples.plane(2)
    weights = np.array([(0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6)])
    line = Line(np.zeros(3, int), weights, np.zeros(3, int), closed=True)
    cut = cut_along(mesh, [line], gc.Control(), separate=True)
    assert len(cut.curve_edges) == 3
    assert cut.parts.max() == 1
    assert "edges of curves" in cut._repr_html_()


def test_what_is_no_curve_is_refused():
    mesh = gc.samples.plane(8)
    with pytest.raises(InvalidArgument, match="there are no curves"):
        gc.cut(mesh, [])
    with pytest.raises(InvalidArgument, match=re.escape("curve 1 is 3; it must be a Curve")):
        gc.cut(mesh, [gc.Curve([0]), 3])
    path = gc.shortest_path(gc.samples.sphere(80), 0, 9)
    with pytest.raises(InvalidArgument, match="curve 0 is a curve on another mesh"):
        gc.cut(mesh, path)
    with pytest.raises(InvalidPoint, match="the points 0 and 1 of curve 0"):
        gc.cut(mesh, gc.Curve([0, len(mesh.vertices) - 1]))
    isolated = gc.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
    with pytest.raises(InvalidPoint, match="point 0 of curve 0 is in no face"):
        gc.cut(isolated, gc.Curve([3]))


def test_edges_of_no_length_are_refused_where_curves_meet_them():
    vertices, faces = flat_grid(3)
    vertices[6] = vertices[5]
    mesh = gc.TriangleMesh(vertices, faces)
    with pytest.raises(InvalidMesh, match=r"zero length.*merge=\"exact\"") as refused:
        gc.cut(mesh, gc.Curve([1, 5]))
    assert set(refused.value.elements) <= {5, 6}
    check_tiling(gc.cut(mesh, gc.Curve([11, 15])))
    merged = gc.TriangleMesh(vertices, faces, merge="exact")  # with faces that repeat a vertex
    assert gc.cut(merged, gc.Curve([1, 5])).curve_edges.tolist() == [[1, 5]]


def test_a_defect_names_the_face(monkeypatch):
    def lost(*arguments):
        return (*arguments[2:4], Outcome.LOST)

    monkeypatch.setattr(retriangulation, "cut_faces", lost)
    with pytest.raises(InternalError, match="face 0 cannot be cut"):
        gc.cut(gc.samples.plane(2), gc.Curve([0, 1]))


@pytest.mark.jit
@pytest.mark.parametrize("seed", [1300, 1960, 2246])
def test_short_pieces_are_not_led_round_in_circles(seed):
    random = np.random.default_rng(seed)
    mesh = random_mesh(KINDS[seed % len(KINDS)], random)
    check_cut(mesh, random_curves(mesh, random))
