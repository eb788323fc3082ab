"""Procedural meshes, for whoever has no file at hand."""

from collections.abc import Callable
from itertools import combinations
from math import ceil, pi, sqrt

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument

Sample = tuple[Floats, Ints]
"""(V, 3) float64 positions and (F, 3) int32 faces, counter-clockwise seen from outside."""

MOST_FACES = 50_000_000

_TUBE_RADIUS = 0.45
"""Of the knot, whose strands stay 1.66 apart and bend with a radius of 1.43 or more."""
_KNOT_LENGTH = 31.9
"""Of the knot's centre line."""


def knot(faces: int) -> Sample:
    """Return a tube along a trefoil knot: closed, smooth, of genus 1; about 6 units wide."""
    _refuse_count(faces, fewest=500)
    around = ceil(sqrt(0.5 * faces * 2.0 * pi * _TUBE_RADIUS / _KNOT_LENGTH))
    along = round(faces / (2 * around))
    t = np.arange(along)[:, None] * (2.0 * pi / along)
    ring = 2.0 + np.cos(3 * t)
    centre = np.hstack([ring * np.cos(2 * t), ring * np.sin(2 * t), np.sin(3 * t)])
    tangent = np.hstack(
        [
            -3 * np.sin(3 * t) * np.cos(2 * t) - 2 * ring * np.sin(2 * t),
            -3 * np.sin(3 * t) * np.sin(2 * t) + 2 * ring * np.cos(2 * t),
            3 * np.cos(3 * t),
        ]
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The knot winds on a torus, whose normal makes a frame that closes without a twist.
    normal = np.hstack(
        [np.cos(3 * t) * np.cos(2 * t), np.cos(3 * t) * np.sin(2 * t), np.sin(3 * t)]
    )
    angle = (np.arange(around) * (2.0 * pi / around))[None, :, None]
    across = np.cos(angle) * normal[:, None] + np.sin(angle) * np.cross(tangent, normal)[:, None]
    vertices = (centre[:, None] + _TUBE_RADIUS * across).reshape(-1, 3)
    ids: Longs = np.arange(along * around, dtype=np.int64).reshape(along, around)
    ids = np.pad(ids, ((0, 1), (0, 1)), mode="wrap")
    return vertices, _split_quads(ids.T)


def sphere(faces: int) -> Sample:
    """Return the unit sphere as an icosahedron whose faces are cut into n² each; 20 n² faces."""
    _refuse_count(faces, fewest=20)
    n = max(1, round(sqrt(faces / 20)))
    corners, triangles = _icosahedron()
    # Grid points of a face: row i, place j, so that the corners weigh n - i, i - j and j.
    i, j = np.tril_indices(n + 1)
    weights = np.stack([n - i, i - j, j], axis=1)
    at = i * (i + 1) // 2 + j
    upper, lower = i < n, (i < n) & (j < i)
    grid = np.concatenate(
        [
            np.stack([at, at + i + 1, at + i + 2], axis=1)[upper],
            np.stack([at, at + i + 2, at + 1], axis=1)[lower],
        ]
    )
    # A point is known by the corners that weigh in and by how much: so faces share their borders.
    base = 12 * (n + 1)
    codes = np.sort(np.where(weights > 0, triangles[:, None] * (n + 1) + weights, 0), axis=2)
    keys = (codes[..., 0] * base + codes[..., 1]) * base + codes[..., 2]
    _, first, ids = np.unique(keys, return_index=True, return_inverse=True)
    face, point = np.divmod(first, len(weights))
    vertices = np.einsum("vk,vkd->vd", weights[point].astype(float), corners[triangles[face]])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    all_faces = ids.reshape(20, -1)[:, grid].reshape(-1, 3)
    return vertices, all_faces.astype(np.int32)


def plane(faces: int) -> Sample:
    """Return the unit square in the plane z = 0, as a grid with a boundary, seen from above."""
    _refuse_count(faces, fewest=2)
    rows = max(1, round(sqrt(faces / 2)))
    columns = max(1, round(faces / (2 * rows)))
    y, x = np.meshgrid(
        np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij"
    )
    vertices = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    ids: Longs = np.arange(len(vertices), dtype=np.int64).reshape(x.shape)
    return vertices, _split_quads(ids.T)


SAMPLES: dict[str, Callable[[int], Sample]] = {"knot": knot, "sphere": sphere, "plane": plane}
"""The samples by name."""


def _refuse_count(faces: int, fewest: int) -> None:
    if not fewest <= faces <= MOST_FACES:
        raise InvalidArgument(
            f"faces is {faces}; this sample can have {fewest} to {MOST_FACES} of them"
        )


def _split_quads(ids: Longs) -> Ints:
    """Return two triangles per cell of a grid of ids, turning from the first axis to the second."""
    a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3).astype(np.int32)


def _icosahedron() -> tuple[Floats, Ints]:
    golden = (1.0 + sqrt(5.0)) / 2.0
    pairs = np.array([(a, b) for a in (-1.0, 1.0) for b in (-golden, golden)])
    blocks = np.zeros((3, 4, 3))
    for axis in range(3):
        blocks[axis][:, [axis, (axis + 1) % 3]] = pairs
    corners = blocks.reshape(12, 3)
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 2.1  # edges are 2 long
    triples = np.array([t for t in combinations(range(12), 3) if near[np.ix_(t, t)].all()])
    inward = np.linalg.det(corners[triples]) < 0.0
    triples[inward] = triples[inward][:, ::-1]
    return corners, triples.astype(np.int32)
