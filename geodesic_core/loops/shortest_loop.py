"""The shortest loop through a point that cannot be shrunk to a point.

It is the shortest path, on the universal cover of the surface, from the point above it in one sheet
to one in another sheet. Of that cover only those sheets are made that such a path can meet: first
those next to the point's own. Then the path that is found bounds the others. A path on into a
sheet that is missing crosses an edge, and is no shorter than the way to that edge and the way from
there back to the point: where this is no more than the bound, the sheet is added. It ends, since
only so many sheets are within the bound; and what is found is the shortest loop, of all.
"""

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control, rounds
from geodesic_core.errors import NoLoop
from geodesic_core.fields.distance_field import DistanceField, solve
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import component_of
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.mesh.half_edges import HEAD, LENGTH, OPPOSITE, TAIL
from geodesic_core.loops.covers import Cover, cover_of, require_two_sided
from geodesic_core.loops.cut_graph import CutGraph, cut_graph
from geodesic_core.loops.words import Kinds
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SEARCH_SLACK


def shortest_loop_through(
    mesh: TriangleMesh, point: SurfacePoint, control: Control
) -> SurfaceCurve:
    """Return the shortest loop through a canonical point that does not shrink to a point.

    Raises
    ------
    NoLoop
        Every loop does.
    InvalidMesh
        The surface has no two sides.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    require_two_sided(mesh)
    search = _LoopSearch(mesh, point, control)
    if len(search.graph.words) == 1:
        raise NoLoop("every loop on this part of the surface shrinks to a point")
    cover, field, sheet = search.run()
    path = field.path_to(cover.lifted(point, sheet))
    return cover.lowered(path, closed=True)


class _LoopSearch:
    """A search for the shortest loop through a point."""

    def __init__(self, mesh: TriangleMesh, point: SurfacePoint, control: Control) -> None:
        self._mesh, self._point, self._parts = mesh, point, rounds(control)
        topology = mesh.topology
        links, lengths = topology.links, topology.geometry[:, LENGTH]
        field = _swept(mesh, point, [], np.inf, next(self._parts))
        distances = field.distances[topology.outer_vertex]
        ways = distances[links[:, TAIL]] + distances[links[:, HEAD]]
        self._lengths = lengths
        self._nearest: Floats = 0.5 * (ways - lengths)
        """(3F,): a lower bound of the distance of each half-edge's points from the point"""
        in_part = topology.component[topology.outer_vertex[links[:, TAIL]]]
        is_edge = links[:, OPPOSITE] > np.arange(len(links))
        is_edge &= in_part == component_of(mesh, point)
        self.graph: CutGraph = cut_graph(topology, np.flatnonzero(is_edge), distances)
        self._kinds = Kinds(self.graph.relator)
        opposite = links[:, OPPOSITE]
        self._words_out = np.where(opposite >= 0, self.graph.word_of[opposite], 0)
        """(3F,): the number of the word of leaving a face over each half-edge"""
        across = ways + lengths
        self._limit = float(across[self.graph.word_of > 0].min(initial=np.inf))
        """Largest length of the loops that are looked for"""

    def run(self) -> tuple[Cover, DistanceField, int]:
        """Return a cover, the distances on it, and the sheet to which the loop leads."""
        self._add_around([0])
        while True:
            control = next(self._parts)
            cover = self._cover(control)
            sheets = range(1, len(self._kinds.words))
            targets = [cover.lifted(self._point, sheet) for sheet in sheets]
            # What is within the limit on an edge is near both of its ends
            limit = self._limit * (1.0 + SEARCH_SLACK)
            start, reach = cover.lifted(self._point, 0), limit + float(self._lengths.max())
            beside = control.holding(cover.mesh.nbytes)
            field = _swept(cover.mesh, start, targets, reach, beside)
            lengths = [field.distance_at(target) for target in targets]
            is_found = min(lengths) <= limit
            if min(lengths) < np.inf:
                self._limit = min(lengths)
            missing = self._missing(cover, field)
            if is_found and not len(missing):
                return cover, field, 1 + int(np.argmin(lengths))
            if min(lengths) == np.inf:
                self._limit *= 2.0
            self._add_around(missing.tolist())

    def _add_around(self, sheets: list[int]) -> None:
        """Add the sheets next to some sheets."""
        for sheet in sheets:
            for word in self.graph.words:
                self._kinds.number(self._kinds.words[sheet] + word)

    def _cover(self, control: Control) -> Cover:
        """Return the cover of the sheets so far: of the faces that a loop within the limit meets.

        A point of the loop is no farther than half of its length.
        """
        kinds, words = self._kinds, self.graph.words
        self._across = np.array(
            [[kinds.number(sheet + word, add=False) for word in words] for sheet in kinds.words]
        )
        reach = 0.5 * self._limit * (1.0 + SEARCH_SLACK)
        kept: NDArray[np.bool_] = np.any(self._nearest.reshape(-1, 3) <= reach, axis=1)
        kept[self._mesh.inner_face[self._point.face_index]] = True
        return cover_of(self._mesh, self._across[:, self._words_out], kept, control)

    def _missing(self, cover: Cover, field: DistanceField) -> Longs:
        """Return the sheets that a loop within the limit may leave for one that is missing."""
        face_count = len(self._mesh.topology.links) // 3
        half_edges = (3 * cover.base_faces)[:, None] + np.arange(3)
        sheets = np.repeat(cover.copies // face_count, 3).reshape(-1, 3)
        distances = field.distances[cover.mesh.faces]
        ways = distances + np.roll(distances, -1, axis=1) - self._lengths[half_edges]
        is_near = 0.5 * ways + self._nearest[half_edges] <= self._limit
        is_open = self._across[sheets, self._words_out[half_edges]] < 0
        return np.unique(sheets[is_near & is_open])


def _swept(
    mesh: TriangleMesh,
    point: SurfacePoint,
    targets: list[SurfacePoint],
    limit: float,
    control: Control,
) -> DistanceField:
    question = Question.of(mesh, point, targets, limit, control)
    return solve(ExactSweep(question), "paths", control)
