"""Surfaces of known shortest loops: flat tori, and two tori joined by a neck."""

import itertools

import numpy as np

import geodesic_core as gc
from tests.support import zoo


def flat_torus(columns, rows, first, second):
    """A torus that is flat: a parallelogram with these sides, its opposite sides joined."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")

    def at(a, b):
        return a % columns * rows + b % rows

    corners = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    lower, upper = ((corners[k] for k in face) for face in ((0, 1, 2), (0, 2, 3)))
    faces = np.concatenate([np.stack([*each], -1).reshape(-1, 3) for each in (lower, upper)])
    a, b = np.array(first) / columns, np.array(second) / rows
    right, up, across = (np.linalg.norm(step) for step in (a, b, a + b))
    lengths = np.repeat([[right, up, across], [across, right, up]], columns * rows, axis=0)
    return gc.TriangleMesh.from_lengths(faces, lengths)


def shortest_lattice_vector(first, second):
    """Length of the shortest loop of a flat torus, through any of its points."""
    i, j = (each.reshape(-1) for each in np.mgrid[-6:7, -6:7])
    steps = np.linalg.norm(np.outer(i, first) + np.outer(j, second), axis=1)
    return steps[steps > 1e-9].min()


def double_torus(around=24, across=16, rings=6):
    """Two tori joined by a straight neck: the mesh, a vertex of the neck, and its girth.

    The rings of the neck are shifted along x, so that a loop around it is as long as their outline
    seen from x.
    """
    points, faces = zoo.torus(around, across)
    tip = int(points[:, 0].argmax())
    star = faces[(faces == tip).any(axis=1)].tolist()
    turned = [face[face.index(tip) :] + face[: face.index(tip)] for face in star]
    after = {first: second for _, first, second in turned}
    ring = [turned[0][1]]
    while after[ring[-1]] != ring[0]:
        ring.append(after[ring[-1]])
    rest, count = faces[(faces != tip).all(axis=1)], len(points)
    mirrored = points.copy()
    mirrored[:, 0] = 2 * (points[tip, 0] + 1.0) - points[:, 0]
    shares = np.arange(1, rings) / rings
    necks = [(1 - share) * points[ring] + share * mirrored[ring] for share in shares]
    rows = [
        np.array(ring),
        *(2 * count + np.arange((rings - 1) * len(ring)).reshape(rings - 1, -1)),
    ]
    rows.append(count + np.array(ring))
    quads = []
    for a, b in itertools.pairwise(rows):
        c, d = np.roll(a, -1), np.roll(b, -1)
        quads += [np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]
    vertices = np.concatenate([points, mirrored, *necks])
    mesh = gc.TriangleMesh(vertices, np.concatenate([rest, rest[:, ::-1] + count, *quads]))
    outline = points[ring][:, 1:]
    girth = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).sum()
    return mesh, int(rows[rings // 2][0]), float(girth)


def holed_square(size, hole):
    """A grid of squares without those in a rectangle (x0, y0, x1, y1), which is a hole."""
    points, faces = zoo.grid(size, size)
    centres = points[faces].mean(axis=1)
    x0, y0, x1, y1 = hole
    is_in = (centres[:, 0] > x0) & (centres[:, 0] < x1)
    is_in &= (centres[:, 1] > y0) & (centres[:, 1] < y1)
    return gc.TriangleMesh(points, faces[~is_in])


def at(mesh, x, y):
    """The vertex at a place of the plane."""
    return int(np.flatnonzero((mesh.vertices[:, 0] == x) & (mesh.vertices[:, 1] == y))[0])
