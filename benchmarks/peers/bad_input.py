"""Small meshes with something wrong, and the distances that are right all the same."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints


class BadMesh(NamedTuple):
    """A strip of the plane with a fault: distances from vertex 0 are known, or there are none."""

    name: str
    vertices: Floats
    faces: Ints
    right: Floats | None
    """Infinite where there is no path; None where the mesh must be refused"""


def bad_meshes(size: int = 8) -> Iterator[BadMesh]:
    """Yield each bad mesh: a flat square of ``size`` by ``size`` cells, with one fault."""
    steps = np.arange(size + 1.0)
    x, y = np.meshgrid(steps, steps)
    flat = np.stack([x.reshape(-1), y.reshape(-1), np.zeros(x.size)], axis=1)
    cells = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).reshape(-1)
    a, b, c, d = cells, cells + 1, cells + size + 1, cells + size + 2
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)]).astype(np.int32)
    right = np.linalg.norm(flat, axis=1)

    def with_more(points: list[tuple[float, float, float]]) -> Floats:
        return np.vstack([flat, points]) if points else flat

    n = len(flat)
    corner = int(size)  # at (size, 0, 0)
    fin = np.array([(corner - 1, corner, n)], np.int32)
    up = (size - 0.5, 0.0, 1.0)
    past = right[[corner - 1, corner]]
    reach = min(past[i] + np.linalg.norm(np.subtract(up, flat[corner - 1 + i])) for i in (0, 1))
    middle = flat[corner - 1] * 0.5 + flat[corner] * 0.5
    reach = min(reach, np.linalg.norm(middle) + 1.0)
    yield BadMesh(
        "edge of three faces",
        with_more([up, (size - 0.5, 0.0, -1.0)]),
        np.vstack([faces, fin, [(corner - 1, corner, n + 1)]]).astype(np.int32),
        np.append(right, [reach, reach]),
    )
    yield BadMesh(
        "face that repeats a vertex", flat, np.vstack([faces, [(3, 3, 4)]]).astype(np.int32), right
    )
    yield BadMesh(
        "face without area", flat, np.vstack([faces, [(0, 1, 2)]]).astype(np.int32), right
    )
    yield BadMesh(
        "two components",
        with_more([(20, 0, 0), (21, 0, 0), (20, 1, 0)]),
        np.vstack([faces, [(n, n + 1, n + 2)]]).astype(np.int32),
        np.append(right, [np.inf] * 3),
    )
    yield BadMesh("vertex of no face", with_more([(5, 5, 5)]), faces, np.append(right, np.inf))
    turned = faces.copy()
    turned[::3] = turned[::3, ::-1]
    yield BadMesh("mixed winding", flat, turned, right)
    spoilt = flat.copy()
    spoilt[n // 2, 2] = np.nan
    yield BadMesh("NaN in a position", spoilt, faces, None)
    beyond = faces.copy()
    beyond[5, 1] = n + 7
    yield BadMesh("index out of range", flat, beyond, None)
