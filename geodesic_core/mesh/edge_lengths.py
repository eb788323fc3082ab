"""Surfaces given by the lengths of their edges, and lengths within faces laid out flat."""

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.kernels.mesh.half_edges import (
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    TAIL,
    Topology,
)
from geodesic_core.mesh.degeneracies import of_three_vertices
from geodesic_core.tolerances import LARGEST_COORDINATE, ROUNDED_LENGTH, SHORTEST_EDGE


def as_edge_lengths(lengths: ArrayLike, faces: Longs) -> Floats:
    """Return the lengths of the edges of faces, (F, 3), the same in all faces of an edge.

    Faces that repeat a vertex are not part of the surface; their lengths are not looked at.

    Raises
    ------
    InvalidMesh
        They are no numbers of this shape. Or one is NaN, infinite or too short, a face breaks the
        triangle inequality, or two faces disagree on their edge, by more than rounding.
    """
    try:
        own = np.array(lengths, np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidMesh(f"lengths are not real numbers: {error}", kind="face") from error
    if own.shape != faces.shape:
        raise InvalidMesh(
            f"lengths have shape {own.shape}; it must be {faces.shape}, one for each edge of a "
            "face: from corner 0 to 1, from 1 to 2, and from 2 to 0",
            kind="face",
        )
    surface = np.flatnonzero(of_three_vertices(faces))
    _check_each(own, surface)
    own[surface] = _agreed(own[surface], faces[surface])
    _check_triangles(own, surface)
    return own


def _check_each(lengths: Floats, surface: Longs) -> None:
    fits = (lengths[surface] >= SHORTEST_EDGE) & (lengths[surface] <= LARGEST_COORDINATE)
    bad = surface[~fits.all(axis=1)]
    if len(bad):
        raise InvalidMesh(
            f"face {bad[0]} has the lengths {lengths[bad[0]].tolist()}; they must be numbers from "
            f"{SHORTEST_EDGE:g} to {LARGEST_COORDINATE:g}",
            kind="face",
            elements=bad[:10].tolist(),
        )


def _check_triangles(lengths: Floats, surface: Longs) -> None:
    longest = lengths[surface].max(axis=1, initial=0.0)
    others = lengths[surface].sum(axis=1) - longest
    excess = longest / others - 1.0
    bad = surface[np.argsort(-excess, kind="stable")][: np.count_nonzero(excess > ROUNDED_LENGTH)]
    if len(bad):
        raise InvalidMesh(
            f"face {bad[0]} has the lengths {lengths[bad[0]].tolist()}: one is longer than the "
            "other two together, which no triangle has",
            kind="face",
            elements=bad[:10].tolist(),
        )


def _agreed(lengths: Floats, faces: Longs) -> Floats:
    """Return the lengths of faces, each as the lowest face of its edge has it."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends = np.sort(ends, axis=1)
    keys = ends[:, 0] << 32 | ends[:, 1]
    _, first, edge = np.unique(keys, return_index=True, return_inverse=True)
    flat = lengths.reshape(-1)
    agreed: Floats = flat[first][edge]
    apart = np.abs(flat / agreed - 1.0)
    worst = int(apart.argmax())
    if apart[worst] > ROUNDED_LENGTH:
        start, end = ends[worst].tolist()
        raise InvalidMesh(
            f"the edge between the vertices {start} and {end} has the length {agreed[worst]:.17g} "
            f"in one face and {flat[worst]:.17g} in another: all faces of an edge must agree. Two "
            "different edges between the same vertices cannot be told apart: split one of them",
            kind="edge",
            elements=[(start, end)],
        )
    return agreed.reshape(lengths.shape)


def flat_points(topology: Topology, inner_faces: Longs, weights: Floats) -> Floats:
    """Return points of faces in the frames of their first half-edges, (N, 2), mesh units.

    ``weights`` (N, 3) are those at inner corners.
    """
    rows = topology.geometry[3 * inner_faces]
    reach = weights[:, 2] * rows[:, LENGTH_LEFT]
    x = weights[:, 1] * rows[:, LENGTH] + reach * rows[:, COS_LEFT]
    return np.stack([x, reach * rows[:, SIN_LEFT]], axis=1)


def weights_in_faces(
    topology: Topology, faces: Ints, points_faces: Ints, weights: Floats, inner_faces: Longs
) -> Floats:
    """Return the weights of points, given in faces that hold them, in other ones that do, (N, 3).

    ``faces`` are the mesh's, ``points_faces`` those of the points, and ``inner_faces`` the others.
    """
    given = topology.inner_vertex[faces[points_faces]]
    corners = topology.links[3 * inner_faces[:, None] + np.arange(3), TAIL]
    same = given[:, :, None] == corners[:, None, :]
    found: Floats = (weights[:, :, None] * same).sum(axis=1)
    return found
