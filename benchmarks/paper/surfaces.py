"""Surfaces of the paper's experiments, made here: by Loop's subdivision, or with noise."""

import numpy as np
from trimesh.remesh import subdivide_loop

import geodesic_core as gc
from geodesic_core.arrays import Floats, Ints

Surface = tuple[Floats, Ints]

_OCTAHEDRON = (
    np.array([(0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)], float),
    np.array(
        [(0, i, i % 4 + 1) for i in range(1, 5)] + [(5, i % 4 + 1, i) for i in range(1, 5)],
        np.int32,
    ),
)


def sphere(level: int) -> Surface:
    """Return the octahedron, subdivided ``level`` times, then projected onto the unit sphere."""
    vertices, faces = subdivided(_OCTAHEDRON, level)
    return vertices / np.linalg.norm(vertices, axis=1)[:, None], faces


def convex(level: int) -> Surface:
    """Return a cap over a square: four faces with a raised middle, subdivided."""
    return subdivided(_square(middle=1.0, corners=(0, 0, 0, 0)), level)


def saddle(level: int) -> Surface:
    """Return a saddle over a square, whose corners go up and down, subdivided."""
    return subdivided(_square(middle=0.0, corners=(1, -1, 1, -1)), level)


def eight(level: int) -> Surface:
    """Return a surface with two holes: a slab of 5 × 3 cubes without two, subdivided."""
    cubes = {(x, y) for x in range(5) for y in range(3)} - {(1, 1), (3, 1)}
    quads = []
    for x, y in sorted(cubes):
        low, high = (
            [(x + a, y + b, z) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))] for z in (0, 1)
        )
        quads += [high, low[::-1]]
        for i, (dx, dy) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (x + dx, y + dy) not in cubes:
                j = (i + 1) % 4
                quads.append([low[i], low[j], high[j], high[i]])
    corners, places = np.unique(np.reshape(quads, (-1, 3)), axis=0, return_inverse=True)
    a, b, c, d = places.reshape(-1, 4).T
    faces = np.concatenate([np.stack(each, axis=1) for each in ((a, b, c), (a, c, d))])
    return subdivided((corners.astype(float), faces.astype(np.int32)), level)


def noisy(surface: Surface, noise: float, seed: int) -> Surface:
    """Move each vertex in a random direction, by at most a share of the mean length of edges."""
    vertices, faces = surface
    rng = np.random.default_rng(seed)
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    ways = rng.normal(size=vertices.shape)
    ways *= (rng.random(len(ways)) * noise * edges.mean() / np.linalg.norm(ways, axis=1))[:, None]
    return vertices + ways, faces


def knot(faces: int) -> Surface:
    """Return the smooth knot of the samples."""
    mesh = gc.samples.knot(faces)
    return mesh.vertices, mesh.faces


def subdivided(surface: Surface, level: int) -> Surface:
    """Return a surface that is subdivided ``level`` times by Loop's scheme."""
    vertices, faces = surface
    if level:
        # trimesh has types in part.
        vertices, faces = subdivide_loop(vertices, faces, level)  # type: ignore[no-untyped-call]
    return np.asarray(vertices, float), np.asarray(faces, np.int32)


def _square(middle: float, corners: tuple[float, float, float, float]) -> Surface:
    around = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    positions = [(x, y, z) for (x, y), z in zip(around, corners, strict=True)] + [(0, 0, middle)]
    faces = [(i, (i + 1) % 4, 4) for i in range(4)]
    return np.array(positions, float), np.array(faces, np.int32)
