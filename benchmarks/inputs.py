"""The meshes of the benchmarks: made here, or read from a folder."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from trimesh.remesh import subdivide, subdivide_loop

import geodesic_core as gc
from geodesic_core.arrays import Floats, Ints, Longs

REFINED: Mapping[str, Callable[[Floats, Ints], tuple[Floats, Longs]]] = {
    "Loop": subdivide_loop,
    "split": subdivide,
}
"""Ways to make four faces of each: smoothed, or in the planes of the old ones."""


@dataclass(frozen=True)
class Inputs:
    """Meshes by name; files that the folder lacks are left out, with a message."""

    folder: Path

    def arrays(self, names: Iterable[str]) -> Iterator[tuple[str, Floats, Ints]]:
        """Yield name, vertices and faces; ``icosphere N`` is made, other names are files.

        What follows a file's name, with commas, tells how the mesh is refined: see `REFINED`.
        """
        for name in names:
            file, *ways = name.split(", ")
            if name.startswith("icosphere "):
                yield name, *icosphere(int(name.split()[1]))
            elif (path := self.folder / file).exists():
                mesh = gc.load_mesh(path)
                vertices, faces = mesh.vertices, mesh.faces
                for way in ways:
                    vertices, corners = REFINED[way](vertices, faces)
                    faces = corners.astype(np.int32)
                yield name, vertices, faces
            else:
                print(f"{name}: not in the meshes folder, left out")


def icosphere(level: int) -> tuple[Floats, Ints]:
    """Return a unit icosahedron whose faces are split in four and pushed to the sphere."""
    phi = (1 + 5**0.5) / 2
    corners = [(a, b * phi) for a in (-1, 1) for b in (-1, 1)]
    vertices = np.array([p for a, b in corners for p in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))])
    gaps = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = np.isclose(gaps, 2)
    faces = np.array(
        [
            (a, b, c) if np.linalg.det(vertices[[a, b, c]]) > 0 else (a, c, b)
            for a in range(12)
            for b in range(a)
            for c in range(b)
            if near[a, b] and near[b, c] and near[c, a]
        ]
    )
    for _ in range(level):
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2))
        edges, places = np.unique(edges, axis=0, return_inverse=True)
        middles = (len(vertices) + places).reshape(-1, 3)
        vertices = np.vstack([vertices, vertices[edges].mean(axis=1)])
        (a, b, c), (ab, bc, ca) = faces.T, middles.T
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
        vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    return vertices / np.linalg.norm(vertices, axis=1)[:, None], faces.astype(np.int32)
