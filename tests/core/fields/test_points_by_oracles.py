"""Points anywhere, by visibility graphs of planar domains and by closed forms."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.core.fields.test_points import EXACT, random_points
from tests.support import zoo
from tests.support.approximation import check_within
from tests.support.oracles import closed_forms, visibility

PARTS = 12
"""Into how many parts the sides of faces are divided: points between have integer coordinates."""


def check_table(mesh: gc.TriangleMesh, points, table) -> None:
    """Distances between points: by each solver, there and back."""
    table, close = np.asarray(table), {"rtol": EXACT, "atol": 1e-13 * mesh.diagonal}
    solver = gc.Solver(mesh)
    np.testing.assert_allclose(solver.distance_matrix(points, points), table, **close)
    for i, source in enumerate(points):
        for field in (gc.exact_distance(mesh, source, targets=points),
                      gc.exact_distance(mesh, source)):  # fmt: skip
            found = [field.distance_at(target) for target in points]
            np.testing.assert_allclose(found, table[i], **close)
        near = gc.approximate_distance(mesh, source, 1e-3, targets=points)
        away = table[i] > close["atol"]
        found = np.array([near.distance_at(target) for target in points])
        check_within(found[away], table[i][away], 1e-3)
        j = (i + 1) % len(points)
        if np.isfinite(table[i, j]):
            length = solver.shortest_path(source, points[j]).length
            np.testing.assert_allclose(length, table[i, j], **close)


def integer_points(mesh, count, seed):
    """Inside faces, on edges and at vertices, of weights in whole parts."""
    rng = np.random.default_rng(seed)
    points = []
    for i, face in enumerate(rng.integers(0, len(mesh.faces), count).tolist()):
        first, second = sorted(rng.integers(1, PARTS, 2).tolist())
        parts = [
            (first, second - first, PARTS - second),
            (first, 0, PARTS - first),
            (0, PARTS, 0),
        ][i % 3]
        points.append(gc.SurfacePoint.face(face, tuple(part / PARTS for part in parts)))
    return points


def domain(seed) -> tuple[np.ndarray, np.ndarray]:
    """A planar domain with polygonal holes, integer coordinates throughout."""
    rng = np.random.default_rng(seed)
    columns, rows = rng.integers(4, 8, 2).tolist()
    points, faces = zoo.grid(columns, rows, seed=seed)
    inner = (points[:, 0] % columns != 0) & (points[:, 1] % rows != 0)
    points = 40 * points
    points[inner, :2] += rng.integers(-9, 10, (int(inner.sum()), 2))
    cells = rng.integers(1, (columns - 1, rows - 1), (int(rng.integers(2, 7)), 2))
    return zoo.drop_unused(points, zoo.without_cells(faces, columns, map(tuple, cells.tolist())))


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("seed", range(12))
def test_planar_domains_with_polygonal_holes(seed):
    vertices, faces = domain(seed)
    mesh = gc.TriangleMesh(vertices * PARTS, faces)
    points = integer_points(mesh, 9, seed)
    places = np.rint([mesh.position(point)[:2] for point in points])
    table = visibility.distance_matrix(np.vstack([mesh.vertices[:, :2], places]), faces)
    count = len(vertices)
    check_table(mesh, points, table[count:, count:])
    for i, source in enumerate(points):
        found = gc.exact_distance(mesh, source).distances
        np.testing.assert_allclose(found, table[count + i, :count], rtol=EXACT, atol=1e-12)


@pytest.mark.jit
@pytest.mark.parametrize(
    "name", ["flat", "slivers_1e-03", "slivers_1e-05", "slivers_tilted", "crowded_lines", "caps"]
)
def test_convex_planar_domains(name):
    case = zoo.KNOWN[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    points = random_points(mesh, 9, seed=11)
    places = [mesh.position(point) for point in points]
    check_table(mesh, points, [closed_forms.plane(places, i) for i in range(len(points))])


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1, 1), (2, 4, 3), (1, 2, 6)])
def test_boxes(size):
    mesh = gc.TriangleMesh(*zoo.box_grid(size))
    points = random_points(mesh, 4 if WITHOUT_JIT else 9, seed=12)
    places = np.array([mesh.position(point) for point in points])
    whole = np.rint(places)
    places = np.where(np.abs(places - whole) < 1e-12, whole, places)  # on a side, to the bit
    table = [closed_forms.box(size, place, places) for place in places]
    check_table(mesh, points, table)


@pytest.mark.parametrize(
    ("sides", "heights"), [(5, np.linspace(0, 9, 4)), (12, [0, 1e-3, 0.5, 0.502, 1.0])]
)
@pytest.mark.jit
def test_prisms(sides, heights):
    vertices, faces, chart, girth = zoo.prism(sides, heights)
    mesh = gc.TriangleMesh(vertices, faces)
    points = random_points(mesh, 9, seed=13)
    places = []
    for point in points:
        corners = chart[mesh.faces[point.face_index]].copy()
        if np.ptp(corners[:, 0]) > girth / 2:  # over the seam of the chart
            corners[corners[:, 0] < girth / 2, 0] += girth
        places.append(np.array(point.barycentric) @ corners)
    check_table(mesh, points, [closed_forms.around(places, i, girth) for i in range(len(points))])


@pytest.mark.jit
@pytest.mark.parametrize(
    "arguments",
    [
        {"sides": 5, "tilt": 1.2, "splits": 2},
        {"sides": 7, "tilt": 0.3, "splits": 2},
        {"sides": 6, "tilt": 0.5, "zigzag": True, "splits": 2},
        {"sides": 12, "tilt": 1.1, "zigzag": True, "splits": 1},
    ],
)
def test_cones(arguments):
    """As far as straight lines stay within the rim: from points near the apex."""
    vertices, faces, polar, total = zoo.cone(**arguments)
    mesh = gc.TriangleMesh(vertices, faces)
    near = [face for face in range(len(faces)) if polar[faces[face], 0].max() < 0.6]
    points = [
        gc.SurfacePoint.face(near[i % len(near)], tuple(point.barycentric))
        for i, point in enumerate(random_points(mesh, 12, seed=14))
    ]
    places = []
    for point in points:
        radius, angle = polar[mesh.faces[point.face_index]].T
        turn = angle - angle[np.argmax(radius)]
        turn -= total * np.round(turn / total)
        place = complex(np.array(point.barycentric) @ (radius * np.exp(1j * turn)))
        places.append((abs(place), angle[np.argmax(radius)] + math.atan2(place.imag, place.real)))
    check_table(mesh, points, [closed_forms.cone(places, i, total) for i in range(len(points))])
