"""Random meshes of every kind, small enough for the oracle."""

import itertools

import numpy as np
from hypothesis import strategies as st

from tests.support import zoo
from tests.support.oracles.graph import edge_lengths


def terrain(rng, *, holes=0):
    columns, rows = rng.integers(2, 6, 2).tolist()
    points, faces = zoo.grid(columns, rows, seed=int(rng.integers(2**31)), jitter=0.22)
    points[:, 2] = rng.choice([0, 0.2, 1, 3]) * rng.normal(size=len(points))
    cells = list(itertools.product(range(columns), range(rows)))
    gone = [cells[k] for k in rng.choice(len(cells), min(holes, len(cells) - 1), replace=False)]
    return zoo.drop_unused(points, zoo.without_cells(faces, columns, gone))


def holed_terrain(rng):
    return terrain(rng, holes=int(rng.integers(1, 5)))


def thin_terrain(rng):
    """Slivers, down to an aspect of some 1e-4, not flat."""
    points, faces = terrain(rng)
    return points * (1, 10.0 ** -rng.uniform(1, 3.5), 0.1), faces


def ball(rng):
    vertices, faces = (zoo.tetrahedron, zoo.octahedron, zoo.icosahedron)[rng.integers(3)]()
    if len(faces) < 20:
        vertices, faces = zoo.subdivide(vertices, faces)
    return zoo.crumpled(vertices, rng.choice([0, 0.1, 0.5, 1]), int(rng.integers(2**31))), faces


def ring(rng):
    vertices, faces = zoo.torus(*rng.integers(3, 7, 2).tolist())
    return zoo.crumpled(vertices, rng.choice([0, 0.3, 1]), int(rng.integers(2**31))), faces


def cubes(rng):
    """A random polycube: flat angles, saddles and ties; cubes may touch at a corner."""
    cells = [(0, 0, 0)]
    for _ in range(int(rng.integers(1, 7))):
        start = cells[rng.integers(len(cells))]
        cell = tuple(int(x) for x in np.array(start) + rng.permutation([0, 0, rng.choice([-1, 1])]))
        if cell not in cells and _is_manifold(*zoo.voxels([*cells, cell])):
            cells.append(cell)
    return zoo.voxels(cells)


def cone(rng):
    sides = 2 * int(rng.integers(2, 7))
    vertices, faces, _, _ = zoo.cone(sides, rng.uniform(0, 1.4), zigzag=bool(rng.integers(2)))
    return zoo.crumpled(vertices, rng.choice([0, 0.2]), int(rng.integers(2**31))), faces


def wound(rng):
    """A mesh of another kind, half of its faces turned over."""
    vertices, faces = KINDS[rng.integers(len(KINDS))](rng)
    return vertices, zoo.wound_at_random(faces, int(rng.integers(2**31)))[0]


def moebius(rng):
    vertices, faces = zoo.moebius(int(rng.integers(5, 12)))
    faces, _, _ = zoo.wound_at_random(faces, int(rng.integers(2**31)))
    return zoo.crumpled(vertices, rng.choice([0, 0.1]), int(rng.integers(2**31))), faces


def book(rng):
    pages, rows, seed = rng.integers((3, 1, 0), (6, 4, 2**31)).tolist()
    vertices, faces, _ = zoo.book(pages, rows, seed)
    return vertices, zoo.wound_at_random(faces, seed)[0]


def pages(rng):
    """A few triangles on one edge, and some more beside them."""
    count = int(rng.integers(3, 6))
    points = np.vstack([[(0, 0, 0), (0, 0, 1)], rng.normal(size=(count, 3))])
    faces = [(0, 1, 2 + k) for k in range(count)] + [(1, 2, 3)] * int(rng.integers(2))
    return points, zoo.wound_at_random(np.array(faces), int(rng.integers(2**31)))[0]


def blocks(rng):
    """Cubes that meet at faces, at edges, which have four faces then, and at corners."""
    cells = rng.integers(0, 3, (int(rng.integers(2, 6)), 3))
    return zoo.voxels(map(tuple, cells.tolist()))


def tangle(rng):
    """Random triangles between a few points: edges of many faces, and sheets that cross."""
    every = list(itertools.combinations(range(7), 3))
    chosen = rng.choice(len(every), int(rng.integers(3, 15)), replace=False)
    faces, _, _ = zoo.wound_at_random(np.array(every)[chosen], int(rng.integers(2**31)))
    return zoo.drop_unused(rng.random((7, 3)), faces)


def _is_manifold(vertices, faces) -> bool:
    return 2 * len(edge_lengths(vertices, faces)) == 3 * len(faces)


KINDS = (terrain, holed_terrain, thin_terrain, ball, ring, cubes, cone)
IRREGULAR_KINDS = (wound, moebius, book, pages, blocks, tangle)


@st.composite
def cases(draw, kinds=KINDS) -> zoo.Case:
    kind = draw(st.sampled_from(kinds))
    seed = draw(st.integers(0, 2**31 - 1))
    vertices, faces = kind(np.random.default_rng(seed))
    return zoo.Case(f"{kind.__name__}({seed})", vertices, faces)
