"""Meshes on which distances are known, and by which oracle: what answers are measured against."""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

import geodesic_core as gc
from tests.support import expected, zoo
from tests.support.approximation import MERGING, some_sources
from tests.support.meshes import mesh_of, random_points
from tests.support.oracles import closed_forms, unfolding, visibility
from tests.support.splitting import split_at

PARTS = 12
"""Into how many parts the sides of faces are divided: points between have integer coordinates."""


class Known(NamedTuple):
    """Distances (S, T) from some places of a mesh to others."""

    mesh: gc.TriangleMesh
    sources: list
    targets: list
    table: np.ndarray
    rounding: float = 0.0
    """Mesh units by which positions of the places are rounded."""

    def some(self, sources: int, targets: int) -> "Known":
        """Not more of them than so many, evenly spread."""
        rows, columns = (
            np.unique(np.linspace(0, count - 1, min(most, count)).astype(int)).tolist()
            for count, most in zip(self.table.shape, (sources, targets), strict=True)
        )
        return self._replace(
            sources=[self.sources[i] for i in rows],
            targets=[self.targets[j] for j in columns],
            table=self.table[np.ix_(rows, columns)],
        )


def between(mesh: gc.TriangleMesh, places: Iterable, table) -> Known:
    """Between places of every kind, whose positions are rounded."""
    return Known(mesh, list(places), list(places), np.asarray(table), 1e-13 * mesh.diagonal)


def unfolded(case: zoo.Case) -> Known:
    """Between all vertices."""
    vertices = list(range(len(case.vertices)))
    return Known(mesh_of(case), vertices, vertices, expected.matrix(case))


def unfolded_with_points(case: zoo.Case, seed: int = 1) -> Known:
    """From points anywhere, by a mesh that has vertices there: the oracle knows no others."""
    mesh = mesh_of(case)
    points = random_points(mesh, 6, seed)
    vertices, faces, at = split_at(mesh, points)
    at += range(len(mesh.vertices))
    table = unfolding.distance_matrix(vertices, faces)[np.ix_(at, at)]
    known = between(mesh, [*points, *range(len(mesh.vertices))], table)
    return known._replace(sources=points, table=table[: len(points)])


def blocked_at_random(case: zoo.Case, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random faces, up to half of them, one by one or as a patch; and the faces that are free."""
    count = int(rng.integers(1, 1 + len(case.faces) // 2))
    barriers = rng.choice(len(case.faces), count, replace=False)
    if rng.random() < 0.5:
        centroids = case.vertices[case.faces].mean(axis=1)
        away = np.linalg.norm(centroids - centroids[barriers[0]], axis=1)
        barriers = np.argsort(away, kind="stable")[:count]
    return barriers, np.setdiff1d(np.arange(len(case.faces)), barriers)


def unfolded_among_barriers(case: zoo.Case, seed: int = 2) -> Known:
    """Between all vertices of a mesh of which random faces are blocked."""
    barriers, free = blocked_at_random(case, np.random.default_rng(seed))
    table = unfolding.distance_matrix(case.vertices, case.faces[free])
    vertices = list(range(len(case.vertices)))
    return Known(mesh_of(case).with_barriers(barriers), vertices, vertices, table)


def swept(case: zoo.Case) -> Known:
    """By exact sweeps that were told of all points: one way to a distance is the measure of all."""
    mesh = mesh_of(case)
    points = random_points(mesh, 9, seed=2)
    sweeps = [gc.exact_distance(mesh, source, targets=points) for source in points]
    return between(mesh, points, [[sweep.distance_at(p) for p in points] for sweep in sweeps])


def in_closed_form(case: zoo.Case, sources: int = 8) -> Known:
    assert case.distances is not None
    chosen, targets = some_sources(case, sources), list(range(len(case.vertices)))
    return Known(mesh_of(case), chosen, targets, np.array([*map(case.distances, chosen)]))


def after_motion(know: Callable[[], Known], seed: int, scale: float) -> Known:
    """Turned, moved and scaled: coordinates are rounded, and what was flat is only nearly so."""
    known = know()
    turned = known.mesh.vertices @ (scale * zoo.rotation(seed)).T
    mesh = gc.TriangleMesh(turned + scale * np.array((1.0, 2.0, -3.0)), known.mesh.faces)
    return known._replace(mesh=mesh, table=scale * known.table, rounding=1e-14 * scale)


def of_a_regular_solid(name: str) -> Known:
    case = zoo.SMALL[name]
    order = np.argsort(expected.matrix(case)[0], kind="stable").tolist()
    return Known(mesh_of(case), [0], order, np.array([closed_forms.REGULAR[name]]))


def in_the_plane(vertices, faces, barriers=()) -> Known:
    """Between the vertices of a planar mesh, of which some faces may be blocked."""
    mesh = gc.TriangleMesh(vertices, faces).with_barriers(barriers)
    free = np.setdiff1d(np.arange(len(faces)), barriers)
    table = visibility.distance_matrix(vertices[:, :2], faces[free])
    return Known(mesh, list(range(len(table))), list(range(len(table))), table)


def among_blocked_cells(cells: Iterable[tuple[int, int]]) -> Known:
    blocked = [2 * (6 * row + column) + half for column, row in cells for half in (0, 1)]
    return in_the_plane(*zoo.grid(6, 6), blocked)


def among_blocked_faces(seed: int) -> Known:
    vertices, faces = zoo.grid(6, 5, seed=seed)
    blocked = np.random.default_rng(seed).choice(len(faces), 4 + 6 * seed, replace=False)
    return in_the_plane(vertices, faces, blocked)


def among_polygonal_holes(seed: int, stretch: int = 1) -> Known:
    """In a planar domain, from points inside faces, on edges and at vertices: all are integers."""
    rng = np.random.default_rng(seed)
    columns, rows = rng.integers(4, 8, 2).tolist()
    points, faces = zoo.grid(columns, rows, seed=seed)
    inner = (points[:, 0] % columns != 0) & (points[:, 1] % rows != 0)
    points = 40 * points
    points[inner, :2] += rng.integers(-9, 10, (int(inner.sum()), 2))
    cells = rng.integers(1, (columns - 1, rows - 1), (int(rng.integers(2, 7)), 2))
    points, faces = zoo.drop_unused(
        points, zoo.without_cells(faces, columns, map(tuple, cells.tolist()))
    )
    mesh, places = gc.TriangleMesh(points * PARTS * (stretch, 1, 1), faces), []
    for i, face in enumerate(rng.integers(0, len(faces), 9).tolist()):
        first, second = sorted(rng.integers(1, PARTS, 2).tolist())
        parts = (first, second - first, PARTS - second), (first, 0, PARTS - first), (0, PARTS, 0)
        places.append(gc.SurfacePoint.face(face, tuple(part / PARTS for part in parts[i % 3])))
    at = np.rint([mesh.position(place) for place in places])
    table = visibility.distance_matrix(np.vstack([at, mesh.vertices])[:, :2], faces + len(places))
    known = between(mesh, [*places, *range(len(mesh.vertices))], table)
    return known._replace(sources=places, table=table[: len(places)])


def thin_plane(rng: np.random.Generator) -> zoo.Case:
    """A rectangle of random triangles, of an aspect down to some 1e-4."""
    columns, rows, seed = rng.integers((2, 2, 0), (7, 7, 2**31)).tolist()
    points, faces = zoo.grid(columns, rows, seed=seed, jitter=0.24)
    return zoo.Case("thin_plane", points * (1, 10.0 ** -rng.uniform(0, 4), 1), faces)


def points_of_a_plane(case: zoo.Case, seed: int = 11) -> Known:
    mesh = mesh_of(case)
    points = random_points(mesh, 9, seed)
    places = [mesh.position(point) for point in points]
    return between(mesh, points, [closed_forms.plane(places, i) for i in range(9)])


def points_of_a_box(size: tuple[int, int, int]) -> Known:
    mesh = gc.TriangleMesh(*zoo.box_grid(size))
    points = random_points(mesh, 9, seed=12)
    places = np.array([mesh.position(point) for point in points])
    whole = np.rint(places)
    places = np.where(np.abs(places - whole) < 1e-12, whole, places)  # on a side, to the bit
    return between(mesh, points, [closed_forms.box(size, place, places) for place in places])


def points_of_a_prism(sides: int, heights) -> Known:
    vertices, faces, chart, girth = zoo.prism(sides, heights)
    mesh = gc.TriangleMesh(vertices, faces)
    points, places = random_points(mesh, 9, seed=13), []
    for point in points:
        corners = chart[mesh.faces[point.face_index]].copy()
        if np.ptp(corners[:, 0]) > girth / 2:  # over the seam of the chart
            corners[corners[:, 0] < girth / 2, 0] += girth
        places.append(np.array(point.barycentric) @ corners)
    return between(mesh, points, [closed_forms.around(places, i, girth) for i in range(9)])


def points_of_a_cone(**shape) -> Known:
    """As far as straight lines stay within the rim: from points near the apex."""
    vertices, faces, polar, total = zoo.cone(**shape)
    mesh = gc.TriangleMesh(vertices, faces)
    near = [face for face in range(len(faces)) if polar[faces[face], 0].max() < 0.6]
    points, places = [], []
    for i, point in enumerate(random_points(mesh, 12, seed=14)):
        face, weights = near[i % len(near)], point.barycentric
        points.append(gc.SurfacePoint.face(face, weights))
        radius, angle = polar[faces[face]].T
        turn = angle - angle[np.argmax(radius)]
        turn -= total * np.round(turn / total)
        place = complex(np.array(weights) @ (radius * np.exp(1j * turn)))
        places.append((abs(place), angle[np.argmax(radius)] + math.atan2(place.imag, place.real)))
    return between(mesh, points, [closed_forms.cone(places, i, total) for i in range(12)])


PLANES = "flat", "slivers_1e-03", "slivers_1e-05", "slivers_tilted", "crowded_lines", "caps"
MOVED = "flat", "slivers_1e-05", "crowded_lines", "pleats_slivers"
HOLES = "annulus", "obstacles", "comb", "pinched_holes"
# Where many sheets lie near each other the oracle has too many ways to look at.
FEW_SHEETS = "three_faces_at_an_edge", "flipped_face", "moebius", "book_of_3"
CELLS = {
    "hole": [(2, 2)],
    "holes": [(1, 1), (1, 2), (1, 3), (4, 2), (4, 3), (4, 4)],
    "touching": [(1, 1), (2, 2), (3, 3), (4, 2)],
    "wall": [(x, 3) for x in range(6)],
    "corner": [(0, 0), (1, 0), (0, 1), (1, 1)],  # vertices of no free face
}
PRISMS = {"long": (5, np.linspace(0, 9, 4)), "slivers": (12, [0, 1e-3, 0.5, 0.502, 1.0])}
CONES = {
    "sharp": {"sides": 5, "tilt": 1.2, "splits": 2},
    "blunt": {"sides": 7, "tilt": 0.3, "splits": 2},
    "saddle": {"sides": 6, "tilt": 0.5, "zigzag": True, "splits": 2},
    "ruffle": {"sides": 12, "tilt": 1.1, "zigzag": True, "splits": 1},
}


Named = Iterator[tuple[str, Callable[[], Known]]]


def _by_enumeration() -> Named:
    small = zoo.SMALL | zoo.IRREGULAR
    for name, case in (small | MERGING).items():
        yield f"{name}, vertices", partial(unfolded, case)
    for name in (*zoo.SMALL, *FEW_SHEETS):
        yield f"{name}, points", partial(unfolded_with_points, small[name])
    for seed, (name, case) in enumerate(small.items()):
        if len(case.faces) > 1:
            yield f"{name}, barriers", partial(unfolded_among_barriers, case, seed)
    for name, case in (zoo.IRREGULAR | zoo.KNOWN).items():
        yield f"{name}, swept", partial(swept, case)
    for name, case in MERGING.items():
        yield f"{name}, small", partial(after_motion, partial(unfolded, case), 3, 1e-9)
        yield f"{name}, large", partial(after_motion, partial(unfolded, case), 3, 1e9)


def _by_geometry() -> Named:
    for name, case in zoo.KNOWN.items():
        yield f"{name}, form", partial(in_closed_form, case)
    for seed, scale in enumerate((1.0, 1e-9, 1e9)):
        for name in MOVED:
            know = partial(in_closed_form, zoo.KNOWN[name])
            yield f"{name}, moved {seed}", partial(after_motion, know, seed, scale)
    for name in closed_forms.REGULAR:
        yield f"{name}, solid", partial(of_a_regular_solid, name)
    for case in map(zoo.SMALL.get, HOLES):
        yield f"{case.name}, visibility", partial(in_the_plane, case.vertices, case.faces)
    for name, cells in CELLS.items():
        yield f"cells, {name}", partial(among_blocked_cells, cells)
    for seed in range(4):
        yield f"faces, {seed}", partial(among_blocked_faces, seed)
    for seed in range(12):
        yield f"domain, {seed}", partial(among_polygonal_holes, seed)
    for name in PLANES:
        yield f"{name}, plane", partial(points_of_a_plane, zoo.KNOWN[name])
    for size in ((1, 1, 1), (2, 4, 3), (1, 2, 6)):
        yield f"box, {size}", partial(points_of_a_box, size)
    for name, prism in PRISMS.items():
        yield f"prism, {name}", partial(points_of_a_prism, *prism)
    for name, cone in CONES.items():
        yield f"cone, {name}", partial(points_of_a_cone, **cone)


BY_ENUMERATION, BY_GEOMETRY = dict(_by_enumeration()), dict(_by_geometry())
"""What makes each, by its name: by unfolding, on any mesh; by closed forms and visibility"""
