"""The meshes every test is run on: small, named, made here, each one awkward in its own way.

``SMALL``     at most 150 faces, of every kind: the oracles solve them whole, from every vertex
``KNOWN``     up to a few thousand faces, slivers among them, whose distances are closed forms
``IRREGULAR`` with edges of three faces or more, or wound the same way by both their faces
"""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.support.oracles import closed_forms

Distances = Callable[[int], np.ndarray]


@dataclass(frozen=True, eq=False)
class Case:
    """A mesh; ``distances(source)`` is its closed form, where it has one."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    distances: Distances | None = None

    def moved(self, matrix, shift=(0.0, 0.0, 0.0)) -> "Case":
        """The same mesh after a rigid motion: the distances stay."""
        return replace(self, vertices=self.vertices @ np.asarray(matrix).T + shift)


def each(cases: Mapping[str, object]) -> pytest.MarkDecorator:
    """Run a test with each of the cases as its argument ``case``."""
    return pytest.mark.parametrize("case", list(cases.values()), ids=list(cases))


each_scale = pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
"""Run a test on meshes of very different sizes."""


def rotation(seed: int) -> np.ndarray:
    """A random rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


# Generators: arrays of vertices and faces -------------------------------------------------------


def grid(columns, rows, *, seed=None, jitter=0.0):
    """Flat grid of the given counts of cells, unit spacing; the rim stays straight.

    No face turns over while the jitter stays below a quarter.
    """
    rng = np.random.default_rng(seed)
    points = np.array([(x, y, 0.0) for y in range(rows + 1) for x in range(columns + 1)])
    inner = (
        (points[:, 0] % columns != 0) & (points[:, 1] % rows != 0) if min(columns, rows) > 1 else []
    )
    points[inner, :2] += rng.uniform(-jitter, jitter, (int(np.sum(inner)), 2))
    faces = []
    for row, column in itertools.product(range(rows), range(columns)):
        a = row * (columns + 1) + column
        b, c, d = a + 1, a + columns + 1, a + columns + 2
        rising = seed is None or rng.random() < 0.5
        faces += [(a, b, d), (a, d, c)] if rising else [(a, b, c), (b, d, c)]
    return points, np.array(faces)


def without_cells(faces, columns, cells):
    """The faces of a grid without those of some cells (column, row)."""
    gone = {row * columns + column for column, row in cells}
    return np.array([face for i, face in enumerate(faces.tolist()) if i // 2 not in gone])


def drop_unused(vertices, faces):
    """Renumber so that every vertex is used."""
    used, compact = np.unique(faces, return_inverse=True)
    return vertices[used], compact.reshape(faces.shape)


def tetrahedron():
    vertices = np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]) / math.sqrt(8)
    return vertices, np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def octahedron():
    vertices = np.array([(1.0, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
    upper = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)]
    return vertices / math.sqrt(2), np.array(upper + [(b, a, 5) for a, b, _ in upper])


def icosahedron():
    """Edge length 1."""
    height, radius = math.sqrt(0.2), 2 * math.sqrt(0.2)
    turns = [2 * math.pi * k / 10 for k in range(10)]
    ring = [
        (radius * math.cos(t), radius * math.sin(t), -height if k % 2 else height)
        for k, t in enumerate(turns)
    ]
    faces = []
    for k in range(0, 10, 2):
        a, b, c, d = k, (k + 1) % 10, (k + 2) % 10, (k + 3) % 10
        faces += [(10, a, c), (a, b, c), (b, d, c), (11, d, b)]
    vertices = np.array([*ring, (0, 0, 1), (0, 0, -1)])
    return vertices / np.linalg.norm(vertices[10] - vertices[0]), np.array(faces)


def subdivide(vertices, faces):
    """Split each face into four at the middles of its edges, numbered as the faces meet them."""
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    low, high = np.sort([faces, np.roll(faces, -1, axis=1)], axis=0).reshape(2, -1)
    edges, met, edge = np.unique(low * len(vertices) + high, return_index=True, return_inverse=True)
    order = np.argsort(met)
    number = np.empty(len(edges), dtype=int)
    number[order] = len(vertices) + np.arange(len(edges))
    middles = (vertices[low[met]] + vertices[high[met]])[order] / 2
    (a, b, c), (ab, bc, ca) = faces.T, number[edge].reshape(-1, 3).T
    split = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return np.vstack([vertices, middles]), split


def split_at_centroids(vertices, faces):
    """Split each face into three at its centroid."""
    split = []
    for number, (a, b, c) in enumerate(np.asarray(faces).tolist()):
        m = len(vertices) + number
        split += [(a, b, m), (b, c, m), (c, a, m)]
    return np.vstack([vertices, np.asarray(vertices)[faces].mean(axis=1)]), np.array(split)


def icosphere(level):
    """Icosahedron, subdivided and pushed to the unit sphere."""
    vertices, faces = icosahedron()
    for _ in range(level):
        vertices, faces = subdivide(vertices, faces)
        vertices = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    return vertices / np.linalg.norm(vertices, axis=1)[:, None], faces


def crumpled(vertices, amplitude, seed):
    """Vertices moved in random directions by up to the amplitude."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=np.shape(vertices))
    way /= np.linalg.norm(way, axis=1)[:, None]
    return vertices + way * rng.uniform(0, amplitude, (len(vertices), 1))


def torus(around, across, radius=2.0, thickness=1.0):
    u = 2 * np.pi * np.repeat(np.arange(around), across) / around
    v = 2 * np.pi * np.tile(np.arange(across), around) / across
    out = radius + thickness * np.cos(v)
    vertices = np.stack([out * np.cos(u), out * np.sin(u), thickness * np.sin(v)], axis=1)
    faces = []
    for i, j in itertools.product(range(around), range(across)):
        a, b = i * across + j, (i + 1) % around * across + j
        c, d = i * across + (j + 1) % across, (i + 1) % around * across + (j + 1) % across
        faces += [(a, b, d), (a, d, c)]
    return vertices, np.array(faces)


def voxels(cells: Iterable[tuple[int, int, int]]):
    """Surface of a union of unit cubes, each square cut along a diagonal."""
    cells, numbers, faces = set(cells), {}, []
    for cell in sorted(cells):
        for axis, side in itertools.product(range(3), (0, 1)):
            neighbour = tuple(x + (2 * side - 1) * (k == axis) for k, x in enumerate(cell))
            if neighbour in cells:
                continue
            corner = [x + side * (k == axis) for k, x in enumerate(cell)]
            first, second = (axis + 1) % 3, (axis + 2) % 3
            square = []
            for along, across in ((0, 0), (1, 0), (1, 1), (0, 1)):
                point = list(corner)
                point[first] += along
                point[second] += across
                square.append(numbers.setdefault(tuple(point), len(numbers)))
            a, b, c, d = square if side else square[::-1]
            faces += [(a, b, c), (a, c, d)]
    return np.array(list(numbers), dtype=float), np.array(faces)


def box_grid(size):
    """Surface of a box of whole-numbered size, in unit squares."""
    return voxels(itertools.product(*(range(k) for k in size)))


def prism(sides, heights, radius=1.0):
    """Open regular prism with rings of vertices at the heights; also its chart and girth."""
    side = 2 * radius * math.sin(math.pi / sides)
    turn = 2 * math.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    vertices = np.array([(x, y, z) for z in heights for x, y in ring])
    chart = np.array([(k * side, z) for z in heights for k in range(sides)])
    faces = []
    for level, k in itertools.product(range(len(heights) - 1), range(sides)):
        a, b = level * sides + k, level * sides + (k + 1) % sides
        faces += [(a, b, b + sides), (a, b + sides, a + sides)]
    return vertices, np.array(faces), chart, sides * side


def cone(sides, tilt, *, zigzag=False, splits=0):
    """Isosceles triangles around an apex (vertex 0); also polar coordinates and the total angle.

    The rim lies at the given tilt (radians) below the apex; with ``zigzag`` (an even count of
    sides) by turns above and below it, which makes a saddle.
    """
    turn = 2 * math.pi * np.arange(sides) / sides
    height = np.where(np.arange(sides) % 2 == 1, 1.0, -1.0) if zigzag else np.full(sides, -1.0)
    rim = np.stack(
        [np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), height * np.sin(tilt)], axis=1
    )
    angle = 2 * math.asin(np.linalg.norm(rim[0] - rim[1]) / 2)
    polar = np.vstack([(0.0, 0.0), *((1.0, k * angle) for k in range(sides))])
    vertices = np.vstack([(0.0, 0.0, 0.0), rim])
    faces = np.array([(0, k + 1, (k + 1) % sides + 1) for k in range(sides)])
    for _ in range(splits):
        parents = _middles(faces)
        polar = np.vstack([polar, *(_polar_middle(polar, a, b, angle * sides) for a, b in parents)])
        vertices, faces = subdivide(vertices, faces)
    return vertices, faces, polar, angle * sides


def _middles(faces):
    """The edges in the order in which ``subdivide`` meets them."""
    met = {}
    for a, b, c in faces.tolist():
        for u, v in ((a, b), (b, c), (c, a)):
            met.setdefault((min(u, v), max(u, v)))
    return list(met)


def _polar_middle(polar, a, b, total):
    (r, s), (q, t) = polar[a], polar[b]
    if r == 0 or q == 0:
        return (r + q) / 2, t if r == 0 else s
    t += total * round((s - t) / total)
    x, y = r * math.cos(s) + q * math.cos(t), r * math.sin(s) + q * math.sin(t)
    middle = math.atan2(y, x)
    middle += 2 * math.pi * round(((s + t) / 2 - middle) / (2 * math.pi))
    return math.hypot(x, y) / 2, middle % total


def pleated(points, folds, angle):
    """Fold a flat strip along lines of constant x, by turns up and down: an isometry."""
    bend = np.concatenate([[0.0], np.where(np.arange(len(folds)) % 2 == 0, angle, -angle)])
    heading = np.cumsum(bend) + angle / 3
    starts = np.concatenate([[points[:, 0].min()], folds])
    corner = np.zeros(2)
    corners = [corner]
    for low, high, turn in zip(starts, folds, heading, strict=False):
        corner = corner + (high - low) * np.array([math.cos(turn), math.sin(turn)])
        corners.append(corner)
    piece = np.searchsorted(folds, points[:, 0], side="left")
    along = points[:, 0] - starts[piece]
    base = np.array(corners)[piece]
    x = base[:, 0] + along * np.cos(heading[piece])
    z = base[:, 1] + along * np.sin(heading[piece])
    return np.stack([x, points[:, 1], z], axis=1)


def joined(*meshes):
    """Several meshes as one, side by side in space, sharing nothing."""
    vertices, faces, count = [], [], 0
    for number, (points, triangles) in enumerate(meshes):
        vertices.append(np.asarray(points) + np.array((10.0 * number, 0, 0)))
        faces.append(np.asarray(triangles) + count)
        count += len(points)
    return np.vstack(vertices), np.vstack(faces)


def welded(vertices, faces, keep, drop):
    """One vertex instead of two; the points must coincide."""
    faces = np.where(faces == drop, keep, faces)
    return drop_unused(vertices, faces)


def needled(vertices, faces, seed):
    """The same surface with edges of no length: vertices get copies, which needles join to them.

    Also which vertex each one is a copy of, and the place of each face among the needles.
    """
    rng = np.random.default_rng(seed)
    vertices, flat = np.asarray(vertices), np.array(faces).reshape(-1)
    groups, copy_of = {v: [v] for v in np.unique(flat).tolist()}, list(range(len(vertices)))
    for v in rng.permutation(list(groups))[: max(2, len(groups) // 3)].tolist():
        for _ in range(rng.integers(1, 4)):
            groups[v].append(len(copy_of))
            copy_of.append(v)
    needles = []
    for v, group in groups.items():
        beside = np.setdiff1d(faces[(faces == v).any(axis=1)], v)
        for i, copy in enumerate(group[1:], 1):
            third = groups[rng.choice(beside)] if i == 1 or rng.random() < 0.7 else group[: i - 1]
            needles.append(rng.permutation([copy, group[i - 1], rng.choice(third)]))
    mixed = np.array([rng.choice(groups[v]) for v in flat.tolist()]).reshape(-1, 3)
    at = np.sort(rng.integers(0, len(mixed) + 1, len(needles)))
    place = np.arange(len(mixed)) + np.searchsorted(at, np.arange(len(mixed)), side="right")
    return vertices[copy_of], np.insert(mixed, at, needles, axis=0), np.array(copy_of), place


# The small zoo ----------------------------------------------------------------------------------


def _small() -> Iterable[Case]:
    triangle = np.array([(0.0, 0, 0), (3, 0, 0), (0, 4, 0)]), np.array([(0, 1, 2)])
    yield Case("single_triangle", *triangle)
    yield Case("square", *grid(1, 1))
    yield Case("obtuse_pair", *_obtuse_pair())
    yield Case("strip", *grid(9, 1))
    yield Case("open_fan", *_open_fan())
    yield Case("tetrahedron", *tetrahedron())
    yield Case("octahedron", *octahedron())
    yield Case("icosahedron", *icosahedron())
    yield Case("cube", *box_grid((1, 1, 1)))
    yield Case("cube_in_fours", *box_grid((2, 2, 2)))
    yield Case("box_1x2x3", *box_grid((1, 2, 3)))
    yield Case("thin_plate", *_scaled(box_grid((4, 3, 1)), (1, 1, 1e-3)))
    yield Case("prism", *prism(7, [0.0, 0.4, 1.5])[:2])
    yield Case("cone", *cone(7, 0.9, splits=1)[:2])
    yield Case("flat_cone", *cone(6, 0.0, splits=1)[:2])
    yield Case("saddle_cone", *cone(8, 0.9, zigzag=True, splits=1)[:2])
    yield Case("bipyramid", *_bipyramid(9))
    yield Case("flat_grid", *grid(6, 5))
    yield Case("jittered_grid", *grid(7, 6, seed=3, jitter=0.22))
    yield Case("annulus", *_with_holes(6, 6, [(2, 2), (2, 3), (3, 2), (3, 3)]))
    yield Case("obstacles", *_with_holes(9, 6, [(1, 1), (1, 2), (4, 3), (5, 3), (7, 1), (6, 4)]))
    yield Case(
        "comb", *_with_holes(7, 5, [(1, y) for y in range(4)] + [(4, y) for y in (1, 2, 3, 4)])
    )
    yield Case(
        "saddle", *_raised(grid(6, 6, seed=5), lambda x, y: 0.2 * ((x - 3) ** 2 - (y - 3) ** 2))
    )
    yield Case("hills", *_terrain(7, 6, 0.3, seed=11))
    yield Case("crags", *_terrain(7, 6, 1.5, seed=12))
    yield Case("crags_with_holes", *_crags_with_holes())
    yield Case("sphere", *icosphere(1))
    yield Case("crumpled_sphere", *_crumpled(icosphere(1), 0.6, seed=7))
    yield Case("torus", *torus(8, 7))
    yield Case("crumpled_torus", *_crumpled(torus(9, 6), 0.7, seed=8))
    yield Case("frame", *voxels((x, y, 0) for x in range(3) for y in range(3) if (x, y) != (1, 1)))
    yield Case("double_frame", *voxels(_double_frame()))
    yield Case("bent_pipe", *voxels([(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (2, 1, 1)]))
    yield Case("two_components", *joined(tetrahedron(), grid(3, 2)))
    yield Case("isolated_vertices", *_isolated_vertices())
    yield Case("bow_tie", *_bow_tie())
    yield Case("bow_tie_of_fans", *_bow_tie_of_fans())
    yield Case("pinched_cubes", *voxels([(0, 0, 0), (1, 1, 1)]))
    yield Case("pinched_holes", *_with_holes(6, 6, [(1, 1), (2, 2), (3, 3), (4, 2)]))


def _scaled(mesh, factors):
    return mesh[0] * np.asarray(factors, dtype=float), mesh[1]


def _raised(mesh, height):
    points = mesh[0].copy()
    points[:, 2] = height(points[:, 0], points[:, 1])
    return points, mesh[1]


def _terrain(columns, rows, amplitude, seed):
    points, faces = grid(columns, rows, seed=seed, jitter=0.22)
    points[:, 2] = np.random.default_rng(seed).uniform(-amplitude, amplitude, len(points))
    return points, faces


def _crumpled(mesh, amplitude, seed):
    return crumpled(mesh[0], amplitude, seed), mesh[1]


def _with_holes(columns, rows, cells):
    points, faces = grid(columns, rows)
    return drop_unused(points, without_cells(faces, columns, cells))


def _crags_with_holes():
    points, faces = _terrain(8, 7, 1.0, seed=13)
    return drop_unused(points, without_cells(faces, 8, [(2, 2), (3, 2), (5, 5), (5, 4), (1, 5)]))


def _obtuse_pair():
    """Two flat obtuse triangles: the line between the far corners leaves the domain."""
    points = np.array([(0.0, 0, 0), (4, 0, 0), (5, 1, 0), (5, -2, 0)])
    return points, np.array([(0, 1, 2), (0, 3, 1)])


def _open_fan():
    """A boundary vertex with more than a half turn of faces around it."""
    turns = np.linspace(0, 1.6 * np.pi, 8)
    rim = np.stack([np.cos(turns), np.sin(turns), 0.2 * np.sin(3 * turns)], axis=1)
    return np.vstack([(0, 0, 0), rim]), np.array([(0, k, k + 1) for k in range(1, 8)])


def _bipyramid(sides):
    vertices, faces, _, _ = cone(sides, 1.0)
    bottom = vertices[1:].mean(axis=0) - (0, 0, 0.4)
    below = [(b, a, sides + 1) for _, a, b in faces.tolist()]
    return np.vstack([vertices, bottom]), np.vstack([faces, below])


def _double_frame():
    return [(x, y, 0) for x in range(5) for y in range(3) if (x, y) not in ((1, 1), (3, 1))]


def _isolated_vertices():
    """Unused vertices before, between and after the used ones."""
    points, faces = tetrahedron()
    spread = np.full((8, 3), 5.0) + np.arange(8)[:, None]
    places = np.array([1, 2, 4, 6])
    spread[places] = points
    return spread, places[faces]


def _bow_tie():
    """Two cones that share their apex, closed discs both."""
    vertices, faces, _, _ = cone(6, 0.5)
    mirrored = vertices * (1, 1, -1)
    points, triangles = np.vstack([vertices, mirrored]), np.vstack([faces, faces[:, ::-1] + 7])
    return welded(points, triangles, 0, 7)


def _bow_tie_of_fans():
    """A closed cone and two open fans in one vertex: paths go through it among all three."""
    vertices, faces, _, _ = cone(5, 0.3)
    fan = np.array([(0, 0, 0), (1, 0, 1), (1, 1, 1.2), (0, 1, 1.1)], dtype=float)
    other = np.array([(0, 0, 0), (-1, 0, 1), (-1, -1, 1.2)], dtype=float)
    points = np.vstack([vertices, fan, other])
    triangles = np.vstack([faces, [(6, 7, 8), (6, 8, 9)], [(10, 11, 12)]])
    points, triangles = welded(points, triangles, 0, 6)
    return welded(points, triangles, 0, 9)


# Meshes of known distances ----------------------------------------------------------------------


def _known() -> Iterable[Case]:
    yield _planar("flat", *grid(20, 20, seed=1, jitter=0.22))
    for aspect in (1e-3, 1e-4, 1e-5):
        mesh = grid(20, 20, seed=2, jitter=0.22)
        yield _planar(f"slivers_{aspect:.0e}", *_scaled(mesh, (1, aspect, 1)))
    tilted = _planar("slivers_tilted", *_scaled(grid(16, 16, seed=4, jitter=0.22), (1, 1e-5, 1)))
    yield tilted.moved(rotation(1), (0.3, -2.0, 0.7))
    yield _planar("crowded_lines", *_crowded())
    yield _planar("needle_fan", *_needle_fan())
    yield _planar("caps", *_caps())
    yield from _pleats()
    for name, sides, heights in (
        ("prism_long", 5, np.linspace(0, 40, 9)),
        ("prism_even", 24, np.linspace(0, 6, 25)),
        ("prism_slivers", 12, [0, 1e-5, 0.5, 0.5 + 1e-5, 0.5 + 3e-5, 1.0, 1.0 + 1e-5]),
    ):
        vertices, faces, chart, girth = prism(sides, heights)
        yield Case(name, vertices, faces, lambda s, c=chart, g=girth: closed_forms.around(c, s, g))
    for name, arguments in (
        ("cone_sharp", {"sides": 5, "tilt": 1.2, "splits": 4}),
        ("cone_blunt", {"sides": 6, "tilt": 0.3, "splits": 4}),
        ("cone_saddle", {"sides": 6, "tilt": 0.5, "zigzag": True, "splits": 4}),
        ("cone_ruffle", {"sides": 12, "tilt": 1.1, "zigzag": True, "splits": 3}),
        ("cone_crowded", {"sides": 400, "tilt": 0.7, "splits": 1}),
    ):
        vertices, faces, polar, total = cone(**arguments)
        yield Case(name, vertices, faces, lambda s, p=polar, t=total: closed_forms.cone(p, s, t))
    for name, size in (("cube_grid", (5, 5, 5)), ("brick_grid", (2, 4, 9))):
        vertices, faces = box_grid(size)
        yield Case(name, vertices, faces, lambda s, z=size, v=vertices: _on_box(z, v, s))


def _planar(name, vertices, faces, chart=None) -> Case:
    chart = vertices if chart is None else chart
    return Case(name, vertices, faces, lambda s: closed_forms.plane(chart, s))


def _on_box(size, vertices, source):
    return closed_forms.box(size, vertices[source], vertices)


def _crowded():
    """Even lines, some doubled or tripled at a distance of 1e-5 and less."""
    lines = np.array([0, 1, 1 + 1e-5, 2, 3, 3 + 3e-6, 3 + 1e-5, 4, 5, 5 + 1e-5, 6])
    points, faces = grid(10, 10, seed=6)
    points[:, 0], points[:, 1] = lines[points[:, 0].astype(int)], lines[points[:, 1].astype(int)]
    return points, faces


def _needle_fan():
    """A quarter disc cut into wedges of which every second is 1e-5 wide."""
    steps = np.tile([0.1, 1e-5], 15)
    turns = np.concatenate([[0.0], np.cumsum(steps)])
    rim = np.stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))], axis=1)
    faces = [(0, k, k + 1) for k in range(1, len(turns))]
    return np.vstack([(0.0, 0, 0), rim]), np.array(faces)


def _caps():
    """A square whose faces all have an angle near 180 degrees: each is split just off its edges."""
    points, faces = grid(9, 9, seed=9, jitter=0.2)
    near = np.einsum("k,fkd->fd", (1e-5, 0.45 - 1e-5, 0.55), points[faces])
    split = []
    for number, (a, b, c) in enumerate(faces.tolist()):
        m = len(points) + number
        split += [(a, b, m), (b, c, m), (c, a, m)]
    return np.vstack([points, near]), np.array(split)


def _pleats() -> Iterable[Case]:
    """Flat strips folded along lines: developable, so Euclid still holds in the chart."""
    chart, faces = grid(24, 8, seed=10)
    lines = np.arange(25.0)
    lines[3::3] = lines[2:-1:3] + 1e-5
    for name, columns in (("pleats", np.arange(25.0)), ("pleats_slivers", lines)):
        flat = chart.copy()
        flat[:, 0] = columns[chart[:, 0].astype(int)]
        folded = pleated(flat, columns[1:-1], 1.1)
        yield _planar(name, folded, faces, flat)


# Meshes with edges that are not simply crossed ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class Irregular(Case):
    """A mesh, its edges (low, high) of three faces or more, and those wound the same way twice."""

    non_manifold: tuple[tuple[int, int], ...] = ()
    misoriented: tuple[tuple[int, int], ...] = ()


def _irregular() -> Iterable[Irregular]:
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0.2, 1, 0), (0.5, 0, 1), (0.8, -1, 0)])
    pages = np.array([(0, 1, 2), (1, 0, 3), (0, 1, 4)])
    yield Irregular("three_faces_at_an_edge", corners, pages, non_manifold=((0, 1),))
    two = np.array([(0, 1, 2), (0, 1, 3)])
    yield Irregular("misoriented", corners[:4], two, misoriented=((0, 1),))
    twice = np.array([(0, 1, 2), (0, 1, 2)])
    yield Irregular("face_twice", corners[:3], twice, misoriented=((0, 1), (0, 2), (1, 2)))
    vertices, faces = tetrahedron()
    flipped = faces.copy()
    flipped[2] = flipped[2, ::-1]
    yield Irregular("flipped_face", vertices, flipped, misoriented=((0, 2), (0, 3), (2, 3)))
    vertices, faces = moebius(9)
    yield Irregular("moebius", vertices, faces, misoriented=((0, 9),))
    faces, many, same = wound_at_random(faces, 1)
    yield Irregular("moebius_wound_at_random", vertices, faces, None, many, same)
    vertices, faces = voxels([(0, 0, 0), (1, 1, 0)])
    low, high = (int(np.flatnonzero((vertices == (1, 1, z)).all(axis=1))[0]) for z in (0, 1))
    edge = (min(low, high), max(low, high))
    yield Irregular("cubes_at_an_edge", vertices, faces, non_manifold=(edge,))
    for count in (3, 5):
        vertices, faces, spine = book(count, 3)
        yield Irregular(f"book_of_{count}", vertices, faces, non_manifold=spine)
    vertices, faces = _crumpled(torus(9, 6), 0.3, 3)
    faces, many, same = wound_at_random(faces, 2)
    yield Irregular("torus_wound_at_random", vertices, faces, None, many, same)
    for seed in range(6):
        yield _complex(7, 14, seed)


def wound_at_random(faces, seed):
    """The faces, half of them turned over; no edges of three; those that run the same way twice."""
    faces = faces.copy()
    turned = np.random.default_rng(seed).random(len(faces)) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    return faces, *_irregular_edges(faces)


def _irregular_edges(faces):
    runs: dict[tuple[int, int], list[bool]] = {}
    for face in np.asarray(faces).tolist():
        for a, b in itertools.pairwise([*face, face[0]]):
            runs.setdefault((min(a, b), max(a, b)), []).append(a < b)
    many = tuple(sorted(edge for edge, ways in runs.items() if len(ways) > 2))
    same = tuple(sorted(edge for edge, ways in runs.items() if ways in ([True] * 2, [False] * 2)))
    return many, same


def book(pages, rows, seed=None):
    """Uneven pages, two columns of quads each, that share a spine of several edges."""
    rng = np.random.default_rng(pages if seed is None else seed)
    points = [(0.0, 0.0, float(z)) for z in range(rows + 1)]
    faces = []
    for page in range(pages):
        turn = 2 * math.pi * page / pages
        columns = [list(range(rows + 1))]
        for i in (1, 2):
            columns.append([len(points) + z for z in range(rows + 1)])
            for z in range(rows + 1):
                x, y, up = rng.random(3)
                points.append(
                    (i * math.cos(turn) + 0.1 * x, i * math.sin(turn) + 0.1 * y, z + 0.2 * up)
                )
        for (left, right), z in itertools.product(itertools.pairwise(columns), range(rows)):
            a, b, c, d = left[z], right[z], right[z + 1], left[z + 1]
            faces += [(a, b, c), (a, c, d)] if rng.random() < 0.5 else [(a, b, d), (b, c, d)]
    return np.array(points), np.array(faces), tuple(itertools.pairwise(range(rows + 1)))


def _complex(vertex_count, face_count, seed) -> Irregular:
    """Random triangles between a few points: edges of many faces, wound at random."""
    rng = np.random.default_rng(seed)
    every = list(itertools.combinations(range(vertex_count), 3))
    chosen = [every[k] for k in rng.choice(len(every), face_count, replace=False)]
    faces, many, same = wound_at_random(np.array(chosen), seed)
    return Irregular(f"complex_{seed}", rng.random((vertex_count, 3)), faces, None, many, same)


def moebius(count):
    turn = 2 * np.pi * np.arange(count) / count
    points = []
    for side in (-0.4, 0.4):
        out = 1 + side * np.cos(turn / 2)
        points.append(
            np.stack([out * np.cos(turn), out * np.sin(turn), side * np.sin(turn / 2)], 1)
        )
    vertices = np.vstack(points)
    faces = []
    for k in range(count):
        a, b = k, k + count
        c, d = (k + 1, k + 1 + count) if k + 1 < count else (count, 0)
        faces += [(a, c, d), (a, d, b)]
    return vertices, np.array(faces)


SMALL = {case.name: case for case in _small()}
KNOWN = {case.name: case for case in _known()}
IRREGULAR = {case.name: case for case in _irregular()}
