"""New vertices: where they are on the old surface, and in space."""

from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs


class Locations(NamedTuple):
    """Points of the old surface that vertices from number ``first`` on are at, N of them."""

    first: int
    """Number of old vertices"""
    faces: Longs
    """(N,): an old face that holds each"""
    weights: Floats
    """(N, 3): weights in it"""

    def joined(self, faces: Longs, weights: Floats) -> "Locations":
        """Return the locations with those of more vertices."""
        return Locations(
            self.first, np.append(self.faces, faces), np.concatenate([self.weights, weights])
        )


def weights_in(locations: Locations, old_faces: Ints, vertices: Longs, faces: Longs) -> Floats:
    """Return the weights of vertices in old faces that hold them, (N, 3)."""
    is_new = vertices >= locations.first
    corners = old_faces[faces]
    weights: Floats = (corners == vertices[:, None]).astype(np.float64)
    new = vertices[is_new] - locations.first
    given = old_faces[locations.faces[new]]
    same = given[:, :, None] == corners[is_new][:, None, :]
    weights[is_new] = (locations.weights[new][:, :, None] * same).sum(axis=1)
    return weights


def positions_of(old_vertices: Floats, old_faces: Ints, locations: Locations) -> Floats:
    """Return the positions of new vertices, the same to the bit from all faces of an edge.

    From the lowest vertex on, so that rounding does not depend on the face.
    """
    corners = old_faces[locations.faces]
    order = np.argsort(np.where(locations.weights > 0.0, corners, len(old_vertices)), axis=1)
    lowest, *others = np.take_along_axis(corners, order, axis=1).T
    weights = np.take_along_axis(locations.weights, order, axis=1)
    start = old_vertices[lowest]
    first, second = (
        weights[:, i, None] * (old_vertices[corner] - start) for i, corner in enumerate(others, 1)
    )
    placed: Floats = start + first + second
    return placed
