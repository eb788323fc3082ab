"""Samples: procedural meshes of any number of faces, to start without a file.

Faces are counter-clockwise seen from outside, or from above.
"""

from collections.abc import Callable
from itertools import combinations
from math import ceil, pi, sqrt

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument
from geodesic_core.mesh.triangle_mesh import TriangleMesh

MOST_FACES = 50_000_000

_TUBE_RADIUS = 0.45
"""Of the knot, whose strands stay 1.66 apart and bend with a radius of 1.43 or more."""
_KNOT_LENGTH = 31.9
"""Of the knot's centre line."""

_TILES = 4
"""In a row of the obstacles, each with a hole."""
_WALLS = ((1.0, 0.0), (0.0, 1.0), (0.8, 0.6), (-0.6, 0.8), (0.6, 0.8), (-0.8, 0.6))
"""Directions that the longer holes have."""


def knot(faces: int) -> TriangleMesh:
    """Return a tube along a trefoil knot: closed, smooth, of genus 1; about 6 units wide.

    Parameters
    ----------
    faces
        Wanted number of faces, 500 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.knot(500)
    TriangleMesh(250 vertices, 500 faces)
    """
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
    return TriangleMesh(vertices, _split_quads(ids.T))


def sphere(faces: int) -> TriangleMesh:
    """Return the unit sphere as an icosahedron whose faces are cut into n² each; 20 n² faces.

    Parameters
    ----------
    faces
        Wanted number of faces, 20 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.sphere(80)
    TriangleMesh(42 vertices, 80 faces)
    """
    _refuse_count(faces, fewest=20)
    n = max(1, round(sqrt(faces / 20)))
    corners, triangles = _icosahedron()
    # Grid points of a face: row i, column j, so that the corners weigh n - i, i - j and j.
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
    return TriangleMesh(vertices, all_faces)


def plane(faces: int) -> TriangleMesh:
    """Return the unit square in the plane z = 0, as a grid with a boundary, seen from above.

    Parameters
    ----------
    faces
        Wanted number of faces, 2 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.plane(2).faces.tolist()
    [[0, 1, 3], [0, 3, 2]]
    """
    _refuse_count(faces, fewest=2)
    rows = max(1, round(sqrt(faces / 2)))
    columns = max(1, round(faces / (2 * rows)))
    y, x = np.meshgrid(
        np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij"
    )
    vertices = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    ids: Longs = np.arange(len(vertices), dtype=np.int64).reshape(x.shape)
    return TriangleMesh(vertices, _split_quads(ids.T))


def cortex(faces: int) -> TriangleMesh:
    """Return a closed surface in folds, like that of half a brain; 2.5 units long.

    A sphere, pressed flat on one side, with furrows where a noise is 0.

    Parameters
    ----------
    faces
        Wanted number of faces, 500 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.cortex(500)
    TriangleMesh(252 vertices, 500 faces)
    """
    _refuse_count(faces, fewest=500)
    ball = sphere(faces)
    x, y, z = ball.vertices.T
    bend = 2.0 * _noise_in_space(1.9 * x, 1.9 * y, 1.9 * z, 21)
    folds = np.abs(_noise_in_space(3.3 * x + bend, 3.3 * y - bend, 3.3 * z + bend, 24))
    radius = 0.84 + 0.22 * folds * folds / (folds * folds + 0.006)
    flat = np.where(x < 0.0, 0.45, 0.85)  # halves of a brain lie against each other
    vertices = radius[:, None] * np.stack([flat * x, 1.25 * y, 0.95 * z], axis=1)
    return TriangleMesh(vertices, ball.faces)


def terrain(faces: int) -> TriangleMesh:
    """Return mountains and valleys over a square, 10 units wide, seen from above.

    Ridges of noise on ever finer lattices, as fine as the grid of vertices has room for. Heights
    are the same to the bit on every machine, since they come from arithmetic alone.

    Parameters
    ----------
    faces
        Wanted number of faces, 200 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.terrain(200)
    TriangleMesh(121 vertices, 200 faces)
    """
    _refuse_count(faces, fewest=200)
    rows = round(sqrt(faces / 2))
    columns = round(faces / (2 * rows))
    y, x = np.meshgrid(
        np.linspace(0.0, 10.0, rows + 1), np.linspace(0.0, 10.0, columns + 1), indexing="ij"
    )
    # Mountains stand where the land is high, and are the rougher the higher; valleys are smooth.
    land = 0.5 + 0.7 * _noise(0.17 * x + 0.6, 0.17 * y + 0.3, 4)
    height, rough = 1.5 * land, np.clip(land, 0.0, 1.0)
    bend_x, bend_y = 0.5 * _noise(0.6 * x, 0.6 * y, 2), 0.5 * _noise(0.6 * x, 0.6 * y, 3)
    amplitude, frequency, octave = 1.9, 0.25, 5
    while 4.0 * frequency <= rows / 10.0 and octave < 16:
        bent = _noise(frequency * (x + bend_x), frequency * (y + bend_y), octave)
        ridge = (1.0 - 1.4 * np.sqrt(bent * bent + 0.003)) * rough
        height += amplitude * ridge * np.abs(ridge)
        rough = np.clip(1.2 * ridge, 0.05, 1.0)
        amplitude, frequency, octave = 0.42 * amplitude, 2.1 * frequency, octave + 1
    vertices = np.stack([x, y, height - height.min()], axis=2)
    ids: Longs = np.arange(x.size, dtype=np.int64).reshape(x.shape)
    faces_of_cells = _split_quads_short(vertices.swapaxes(0, 1), ids.T)
    return TriangleMesh(vertices.reshape(-1, 3), faces_of_cells)


def obstacles(faces: int) -> TriangleMesh:
    """Return a gently curved sheet with 16 holes, pillars and walls to pass; 8 units wide.

    Parameters
    ----------
    faces
        Wanted number of faces, 500 to 50 million; the sample has about as many.

    Returns
    -------
    TriangleMesh
        Faces are counter-clockwise seen from outside, or from above.

    Raises
    ------
    InvalidArgument
        The number is out of its range.

    Examples
    --------
    >>> gc.samples.obstacles(500)
    TriangleMesh(321 vertices, 512 faces)
    """
    _refuse_count(faces, fewest=500)
    side, rings = _tile_counts(faces)
    # Around a hole in a tile go rings of points, from the border of the tile to that of the hole.
    step = np.arange(side)
    low, high = np.zeros(side, int), np.full(side, side)
    border = np.concatenate(
        [
            np.stack(pair, axis=1)
            for pair in ((step, low), (high, step), (side - step, high), (low, side - step))
        ]
    )
    tile_y, tile_x = (each.ravel() for each in np.indices((_TILES, _TILES)))
    lattice = np.stack([tile_x, tile_y], axis=1)[:, None] * side + border
    away = 2.0 * border / side - 1.0
    inner = np.stack([_reach(tile, away) for tile in range(_TILES * _TILES)])
    share = np.arange(rings + 1)[None, :, None, None] / rings
    spread = (1.0 - share) * away + share * inner[:, None]
    centres = np.stack([tile_x, tile_y], axis=1) * 2.0 + (1.0 - _TILES)
    flat = (centres[:, None, None] + spread).reshape(-1, 2)
    # Tiles share the points on their borders, which are identified by their lattice point.
    keys = np.arange(len(flat)).reshape(spread.shape[:3]) + (_TILES * side + 1) ** 2
    keys[:, 0] = lattice[..., 1] * (_TILES * side + 1) + lattice[..., 0]
    _, first, ids = np.unique(keys, return_index=True, return_inverse=True)
    x, y = flat[first].T
    vertices = np.stack(
        [
            x + 0.35 * _noise(0.23 * x, 0.23 * y, 101),
            y + 0.35 * _noise(0.23 * x, 0.23 * y, 102),
            1.2 * _noise(0.17 * x, 0.17 * y, 103),
        ],
        axis=1,
    )
    around = np.pad(ids.reshape(keys.shape), ((0, 0), (0, 0), (0, 1)), mode="wrap")
    return TriangleMesh(vertices, np.concatenate([_split_quads(tile.T) for tile in around]))


SAMPLES: dict[str, Callable[[int], TriangleMesh]] = {
    "knot": knot,
    "sphere": sphere,
    "terrain": terrain,
    "cortex": cortex,
    "obstacles": obstacles,
    "plane": plane,
}
"""The samples by name."""


def _tile_counts(faces: int) -> tuple[int, int]:
    """Return the numbers of points a side of a tile and of rings, for about ``faces`` faces."""
    wanted = faces / (8 * _TILES * _TILES)
    middle = round(sqrt(2.0 * wanted))
    sides = range(max(2, middle - 3), middle + 4)
    pairs = [(side, max(1, round(wanted / side))) for side in sides]
    return min(pairs, key=lambda pair: abs(pair[0] * pair[1] - wanted))


def _reach(tile: int, away: Floats) -> Floats:
    """Return the points of a hole's border in the directions of those of its tile's border."""
    chance = _hashed(np.array([tile]), np.array([7]), 100)[0]
    direction: Floats = away / np.sqrt((away * away).sum(axis=1, keepdims=True))
    if chance % 3 == 0:  # a pillar
        radius: float = 0.4 + (chance >> 8) % 256 / 768.0
        return direction * radius
    # A wall: an ellipse, nearly as long as its tile has room for.
    cosine, sine = _WALLS[(chance >> 4) % len(_WALLS)]
    long, short = 0.86 / max(abs(cosine), abs(sine)), 0.18
    along = direction[:, 0] * cosine + direction[:, 1] * sine
    across = direction[:, 1] * cosine - direction[:, 0] * sine
    reach: Floats = 1.0 / np.sqrt((along / long) ** 2 + (across / short) ** 2)
    return direction * reach[:, None]


def _refuse_count(faces: int, fewest: int) -> None:
    if not fewest <= faces <= MOST_FACES:
        raise InvalidArgument(
            f"faces is {faces}; this sample can have {fewest} to {MOST_FACES} of them"
        )


def _split_quads(ids: Longs) -> Ints:
    """Return two triangles per cell of a grid of ids, turning from the first axis to the second."""
    a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3).astype(np.int32)


def _split_quads_short(corners: Floats, ids: Longs) -> Ints:
    """Return the same, each cell cut along its shorter diagonal: so edges run along ridges."""
    faces = _split_quads(ids).reshape(-1, 2, 3)
    height = corners[..., 2]
    forth = np.abs(height[:-1, :-1] - height[1:, 1:]).ravel()
    back = np.abs(height[1:, :-1] - height[:-1, 1:]).ravel()
    a, b, c, d = faces[:, 0, 0], faces[:, 0, 1], faces[:, 0, 2], faces[:, 1, 2]
    turned = np.stack([a, b, d, b, c, d], axis=1).reshape(-1, 2, 3)
    return np.where((back < forth)[:, None, None], turned, faces).reshape(-1, 3)


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


def _noise(x: Floats, y: Floats, seed: int) -> Floats:
    """Return gradient noise: smooth, 0 at the points of the unit lattice, within ±1.

    It takes arithmetic alone, so that it is the same to the bit on every machine.
    """
    left, below = np.floor(x), np.floor(y)
    u, v = x - left, y - below
    corners = []
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        bits = _hashed(left.astype(np.int64) + dx, below.astype(np.int64) + dy, seed)
        slope_x, slope_y = (bits & 0xFFFF) / 32768.0 - 1.0, (bits >> 16 & 0xFFFF) / 32768.0 - 1.0
        corners.append(slope_x * (u - dx) + slope_y * (v - dy))
    s, t = (w * w * w * (w * (6.0 * w - 15.0) + 10.0) for w in (u, v))
    lower = corners[0] + s * (corners[1] - corners[0])
    upper = corners[2] + s * (corners[3] - corners[2])
    value: Floats = lower + t * (upper - lower)
    return value


def _noise_in_space(x: Floats, y: Floats, z: Floats, seed: int) -> Floats:
    """Return the mean of gradient noise over the three coordinate planes, which no axis governs."""
    planes = _noise(x, y, seed), _noise(y, z, seed + 1), _noise(z, x, seed + 2)
    return (planes[0] + planes[1] + planes[2]) / 3.0


def _hashed(i: Longs, j: Longs, seed: int) -> Longs:
    """Return 32 pseudorandom bits for each point of a lattice."""
    mixed = i * 0x9E3779B1 + j * 0x85EBCA77 + seed * 0xC2B2AE3D
    for _ in range(2):
        mixed = (mixed ^ (mixed >> 15 & 0x1FFFF)) * 0x2C1B3C6D & 0xFFFFFFFF
    return mixed ^ mixed >> 16
