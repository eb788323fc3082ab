"""Meshes as people have them: real ones, where they are at hand, and others of the same kinds.

``rough_scan`` and ``thin_cad`` are made here, so that what is tested on real meshes is tested
everywhere. The real ones are other people's, and not part of the project: ``MESHES`` names a
folder that has them, by default ``../shared/meshes`` beside the checkout.
"""

import os
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.paths import ROOT

MESHES = Path(os.environ.get("MESHES", ROOT / "../shared/meshes"))


def mesh_of(case: zoo.Case) -> gc.TriangleMesh:
    return gc.TriangleMesh(case.vertices, case.faces)


def random_points(mesh: gc.TriangleMesh, count: int, seed: int = 0) -> list[gc.SurfacePoint]:
    """Points inside faces, on edges and at vertices, by turns."""
    rng = np.random.default_rng(seed)
    points = []
    for i, face in enumerate(rng.integers(0, len(mesh.faces), count).tolist()):
        u, v, w = rng.dirichlet(np.ones(3)).tolist()
        points.append(
            [
                gc.SurfacePoint.face(face, (u, v, w)),
                gc.SurfacePoint.edge(face, int(rng.integers(3)), float(u)),
                gc.SurfacePoint.vertex(int(mesh.faces[face, 0])),
            ][i % 3]
        )
    return [mesh.point(point) for point in points]


def real_mesh(name: str) -> Path:
    """The path of a real mesh; skips the test where it is absent."""
    path = MESHES / name
    if not path.exists():
        pytest.skip(f"no {name} in {MESHES}: run with MESHES=FOLDER that has it")
    return path


def named_mesh(name: str) -> gc.TriangleMesh:
    """A mesh that is made here, or a real one, by its name."""
    make = MADE_HERE.get(name)
    return gc.TriangleMesh(*make()) if make else gc.load_mesh(real_mesh(name))


def rough_scan():
    """A ball with noise of a fifth of an edge, and holes where the scanner did not see."""
    vertices, faces = zoo.icosphere(4)
    vertices = zoo.crumpled(vertices, 0.015, seed=1)
    centroids = vertices[faces].mean(axis=1)
    unseen = np.array([(0.0, 0, -1), (0.6, 0.8, 0), (-0.8, 0, 0.6)])
    seen = np.linalg.norm(centroids[:, None] - unseen, axis=2).min(axis=1) > 0.15
    return zoo.drop_unused(vertices, faces[seen])


def thin_cad():
    """A turned part as CAD programs export it: fans on its ends, long thin triangles around it."""
    sides, heights = 90, [0.0, 1.0, 1.02, 2.5]
    vertices, faces, *_ = zoo.prism(sides, heights)
    vertices[sides : 2 * sides, :2] *= 0.7  # a step between the second ring and the third
    bottom, top, last = len(vertices), len(vertices) + 1, (len(heights) - 1) * sides
    turn = np.arange(sides)
    after = (turn + 1) % sides
    fans = [
        np.stack([np.full(sides, bottom), after, turn], axis=1),
        np.stack([np.full(sides, top), last + turn, last + after], axis=1),
    ]
    ends = [(0.0, 0.0, heights[0]), (0.0, 0.0, heights[-1])]
    return np.vstack([vertices, ends]), np.vstack([faces, *fans])


MADE_HERE = {"rough_scan": rough_scan, "thin_cad": thin_cad}
