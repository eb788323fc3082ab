"""The same surface written otherwise, and where its points are then."""

from dataclasses import dataclass, replace

import numpy as np

import geodesic_core as gc
from tests.support import zoo


@dataclass(frozen=True, eq=False)
class Rewritten:
    """A mesh, and where on the mesh that it came from each of its faces lies."""

    vertices: np.ndarray
    faces: np.ndarray
    origin: np.ndarray
    """(F,): the face of the first mesh that each is a part of; -1 for a needle"""
    weights: np.ndarray
    """(F, 3, 3): of each corner, in that face"""
    scale: float = 1.0
    merge: str = "none"

    @classmethod
    def of(cls, case: zoo.Case) -> "Rewritten":
        """The mesh as it is."""
        count = len(case.faces)
        return cls(case.vertices, case.faces, np.arange(count), np.tile(np.eye(3), (count, 1, 1)))

    def mesh(self) -> gc.TriangleMesh:
        return gc.TriangleMesh(self.vertices, self.faces, merge=self.merge)

    def point(self, face: int, barycentric) -> gc.SurfacePoint:
        """The point of the first mesh with these weights in one of its faces."""
        parts = np.flatnonzero(self.origin == face)
        shares = [np.linalg.solve(self.weights[part].T, barycentric) for part in parts]
        best = int(np.argmax([share.min() for share in shares]))
        return gc.SurfacePoint.face(int(parts[best]), tuple(shares[best].tolist()))

    def taking(self, order) -> "Rewritten":
        """Some of the faces, in another order."""
        return replace(
            self, faces=self.faces[order], origin=self.origin[order], weights=self.weights[order]
        )


def renamed(rng, this: Rewritten) -> Rewritten:
    """Other vertex numbers, face order and first corners."""
    names = rng.permutation(len(this.vertices))
    vertices = np.empty_like(this.vertices)
    vertices[names] = this.vertices
    turns = (np.arange(3) + rng.integers(0, 3, (len(this.faces), 1))) % 3
    return _cornered(replace(this, vertices=vertices, faces=names[this.faces]), turns).taking(
        rng.permutation(len(this.faces))
    )


def inside_out(_rng, this: Rewritten) -> Rewritten:
    return _cornered(this, np.tile([0, 2, 1], (len(this.faces), 1)))


def wound_otherwise(rng, this: Rewritten) -> Rewritten:
    """Some of the faces turned over."""
    turned = rng.random((len(this.faces), 1)) < rng.choice([0.1, 0.5])
    return _cornered(this, np.where(turned, [0, 2, 1], [0, 1, 2]))


def moved(rng, this: Rewritten) -> Rewritten:
    shift = rng.normal(size=3) * np.abs(this.vertices).max()
    turn = zoo.rotation(int(rng.integers(2**31)))
    return replace(this, vertices=this.vertices @ turn.T + shift)


def scaled(rng, this: Rewritten) -> Rewritten:
    factor = float(rng.choice([1e-9, 1e-3, 7.0, 1e9]))
    return replace(this, vertices=this.vertices * factor, scale=this.scale * factor)


def faces_split(rng, this: Rewritten) -> Rewritten:
    """Some faces split in three at a point inside."""
    for face in rng.permutation(np.flatnonzero(this.origin >= 0))[: rng.integers(1, 6)]:
        at = rng.dirichlet([3, 3, 3])
        this = _with_vertex(this, at @ this.vertices[this.faces[face]], [(face, at)])
    return this


def edges_split(rng, this: Rewritten) -> Rewritten:
    """Some edges split at a point, with all faces beside them."""
    for _ in range(rng.integers(1, 6)):
        face, corner = rng.choice(np.flatnonzero(this.origin >= 0)), rng.integers(3)
        a, b = this.faces[face, corner], this.faces[face, (corner + 1) % 3]
        t = rng.uniform(0.1, 0.9)
        beside = np.flatnonzero((this.faces == a).any(axis=1) & (this.faces == b).any(axis=1))
        splits = [(g, (1 - t) * (this.faces[g] == a) + t * (this.faces[g] == b)) for g in beside]
        this = _with_vertex(this, (1 - t) * this.vertices[a] + t * this.vertices[b], splits)
    return this


def torn_to_merge(rng, this: Rewritten) -> Rewritten:
    """Some corners with vertices of their own, which merging takes for one."""
    if len(np.unique(this.vertices, axis=0)) < len(this.vertices):
        return this  # what lies at one position was not one before
    flat = this.faces.reshape(-1).copy()
    loose = np.flatnonzero(rng.random(len(flat)) < rng.choice([0.1, 0.9]))
    vertices = np.vstack([this.vertices, this.vertices[flat[loose]]])
    flat[loose] = len(this.vertices) + np.arange(len(loose))
    return replace(this, vertices=vertices, faces=flat.reshape(-1, 3), merge="exact")


def needled(rng, this: Rewritten) -> Rewritten:
    """With edges of no length."""
    vertices, faces, _, place = zoo.needled(this.vertices, this.faces, int(rng.integers(2**31)))
    origin, weights = np.full(len(faces), -1), np.tile(np.eye(3), (len(faces), 1, 1))
    origin[place], weights[place] = this.origin, this.weights
    return replace(this, vertices=vertices, faces=faces, origin=origin, weights=weights)


REWRITINGS = (
    faces_split,
    edges_split,
    moved,
    scaled,
    needled,
    torn_to_merge,
    renamed,
    inside_out,
    wound_otherwise,
)
"""In the order in which they may be applied: what shares a position must go on doing so."""


def _cornered(this: Rewritten, corners) -> Rewritten:
    """The faces with their corners in another order."""
    rows = np.arange(len(corners))[:, None]
    return replace(this, faces=this.faces[rows, corners], weights=this.weights[rows, corners])


def _with_vertex(this: Rewritten, position, splits) -> Rewritten:
    """With a new vertex in some faces, at weights in each that are zero where it is on an edge."""
    new = len(this.vertices)
    faces, origin, weights = [], [], []
    for face, at in splits:
        for corner in np.flatnonzero(at):  # the part that has the vertex in place of this corner
            faces.append(np.where(np.arange(3) == corner, new, this.faces[face]))
            origin.append(this.origin[face])
            weights.append(this.weights[face].copy())
            weights[-1][corner] = at @ this.weights[face]
    kept = this.taking(np.setdiff1d(np.arange(len(this.faces)), [face for face, _ in splits]))
    return replace(
        this,
        vertices=np.vstack([this.vertices, position]),
        faces=np.vstack([kept.faces, faces]),
        origin=np.concatenate([kept.origin, origin]),
        weights=np.concatenate([kept.weights, weights]),
    )
