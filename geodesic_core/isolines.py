"""Lines of equal distance on the surface."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_core.arguments import is_index, is_number
from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels import isolines as kernels
from geodesic_core.kernels.isolines import Field
from geodesic_core.kernels.kept import Kept
from geodesic_core.kernels.topology import LENGTH
from geodesic_core.kernels.wavefront import FACE
from geodesic_core.mesh import TriangleMesh
from geodesic_core.nodes import Nodes
from geodesic_core.path import length_of
from geodesic_core.tolerances import PIECE

CHORD_SHARE = 1e-3
"""Share of the mean edge length that chords may stray from their arcs if nothing else is said."""

FINEST_CHORD = 1e-9
"""Share of the bounding box's diagonal below which no chord error is taken: what it takes in points
grows with the inverse of its root."""


@dataclass(frozen=True, slots=True)
class Isoline:
    """A polyline of points at one distance; between two points it lies in one face."""

    points: Floats
    """(K, 3) float64, mesh units"""
    closed: bool
    """Whether a last piece leads from the last point back to the first, which is not repeated."""
    faces: Ints
    """(K,) of a closed line, (K - 1,) of an open one: the face in which each piece lies"""

    @property
    def length(self) -> float:
        """Mesh units."""
        return length_of(np.vstack([self.points, self.points[:1]]) if self.closed else self.points)


def spaced_levels(distances: Floats, count: int) -> Floats:
    """Return levels evenly spaced between 0 and the largest finite distance, both left out.

    Raises
    ------
    InvalidArgument
        The count is not an integer, 1 or more; or no finite distance is above 0.
    """
    if not is_index(count) or count < 1:
        raise InvalidArgument(f"the count of levels is {count!r}; it must be an integer, 1 or more")
    largest = distances.max(where=np.isfinite(distances), initial=0.0)
    if largest == 0.0:
        raise InvalidArgument("only sources are reached: there is nothing to space levels in")
    spaced: Floats = np.arange(1, count + 1) * (largest / (count + 1))
    return spaced


def as_levels(levels: Sequence[float]) -> list[float]:
    """Return levels as floats.

    Raises
    ------
    InvalidArgument
        They are no sequence, or one of them is not a finite number above 0.
    """
    if isinstance(levels, str | bytes) or not isinstance(levels, Sequence | np.ndarray):
        raise InvalidArgument(f"levels is {levels!r}; it must be a sequence of distances")
    for i, level in enumerate(levels):
        if not is_number(level) or not (math.isfinite(level) and level > 0.0):
            raise InvalidArgument(f"level {i} is {level!r}; it must be a finite number above 0")
    return [float(level) for level in levels]


def as_chord_error(mesh: TriangleMesh, chord_error: float | None) -> float:
    """Return how far chords may stray from their arcs, mesh units.

    Raises
    ------
    InvalidArgument
        It is not a finite number, or finer than `FINEST_CHORD`.
    """
    if chord_error is None:
        return CHORD_SHARE * float(mesh.topology.geometry[:, LENGTH].mean())
    finest = FINEST_CHORD * mesh.diagonal
    if not is_number(chord_error) or not (math.isfinite(chord_error) and chord_error >= finest):
        raise InvalidArgument(
            f"chord_error is {chord_error!r}; it must be a finite number, {finest:g} or more"
        )
    return float(chord_error)


def find_isolines(
    mesh: TriangleMesh,
    kept: Kept,
    distances: Floats,
    nodes: Nodes,
    levels: Sequence[float],
    chord_error: float,
) -> list[list[Isoline]]:
    """Return the lines of each level; ``distances`` are by node.

    O(windows + F), and for each level O(F + n² log n) for n windows in each face that it passes.
    """
    topology, sites = mesh.topology, nodes.sites
    site_rows = np.argsort(sites.ints[: nodes.first_target, FACE], kind="stable")
    piece_rows = np.argsort(sites.piece_ints[:, FACE], kind="stable")
    field = Field(
        kept=kept,
        distance=distances,
        site_ints=sites.ints[site_rows],
        site_weights=sites.weights[site_rows],
        piece_ints=sites.piece_ints[piece_rows],
        piece_ends=sites.piece_ends[piece_rows],
        first_piece=nodes.first_piece,
    )
    least, most = kernels.face_ranges(topology, field)
    place = np.full(len(least), -1, np.int32)
    found = []
    for level in levels:
        cuts = kernels.cut_faces(topology, field, least, most, level, place)
        crossings = kernels.cross_edges(topology, distances, cuts, level, place)
        place[cuts.faces[:, 0]] = -1
        chains = kernels.chain_pieces(topology, distances, cuts, crossings, level, chord_error)
        found.append(
            _lines(mesh, *kernels.link_chains(topology.links, crossings, chains, PIECE * level))
        )
    return found


def _lines(
    mesh: TriangleMesh, points: Floats, faces: Ints, first: Longs, closed: Flags
) -> list[Isoline]:
    bounds = zip(first[:-1].tolist(), first[1:].tolist(), closed.tolist(), strict=True)
    return [
        Isoline(
            points=points[lo:hi].copy(),
            closed=bool(is_closed),
            faces=mesh.topology.outer_face[faces[lo : hi if is_closed else hi - 1]],
        )
        for lo, hi, is_closed in bounds
    ]
