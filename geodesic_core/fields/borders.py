"""Borders of territories: the edges of the geodesic Voronoi diagram of the sources.

The territory of a source is the part of the surface that is nearer to it than to any other one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from geodesic_core.arrays import Flags, Ints
from geodesic_core.control import Control, in_slices
from geodesic_core.fields.isolines import (
    Arrays,
    bytes_of,
    joined,
    retained_sweep,
    starts_of,
)
from geodesic_core.fields.sources import Nodes
from geodesic_core.fields.sweep_result import all_winners
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.borders.border_chains import trace_borders
from geodesic_core.kernels.borders.border_lines import link_borders
from geodesic_core.kernels.borders.outlines import cross_edges
from geodesic_core.kernels.borders.territories import Territories, divide_faces, mixed_faces
from geodesic_core.kernels.curves.chains import Chains
from geodesic_core.kernels.curves.thinning import thin_lines
from geodesic_core.kernels.front.state import FACE
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows, face_windows_of
from geodesic_core.mesh.surface_curve import SurfaceCurve, curves_of
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import CUT_OFF, PIECE

RINGS = 2
"""Rings of faces around those with vertices of several territories that borders are looked for in
at first; where a border leads out of them, a second sweep looks farther."""


@dataclass(frozen=True, eq=False, repr=False)
class Border(SurfaceCurve):
    """A curve of points that are equally near to two sources, and no nearer to a third.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> (line,) = gc.exact_distance(mesh, [0, 10]).borders()  # its lower corners
    >>> line.sources, line.closed, np.unique(line.points[:, 0].round(9)).tolist()
    ((0, 1), False, [0.5])
    """

    sources: tuple[int, int]
    """Indices into the sources of the field, the lower one first."""

    def __repr__(self) -> str:
        first, second = self.sources
        return f"Border(sources {first} and {second}, {self.summary})"


def swept_borders(
    sweep: ExactSweep, nearest: Ints, chord_error: float, control: Control
) -> list[Border]:
    """Return the borders of an exact sweep, which is run for the windows near them.

    ``nearest`` is the source of each inner vertex, as far as known before.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    mesh, nodes = sweep.question.mesh, sweep.question.nodes
    faces = _faces_of_several(mesh, nodes, nearest)
    while True:
        faces = _with_rings(mesh, faces, RINGS)
        wave = sweep.run_for(control.for_part(0, 2), windows=faces)
        control = control.for_part(1, 2)
        drawn = _Drawing(sweep, all_winners(wave), face_windows_of(wave), faces, chord_error)
        part = control.for_part(0, 2)
        borders = drawn.borders(part)
        if borders is not None:
            return borders
        control = control.for_part(1, 2)
        faces = _with_rings(mesh, drawn.faces, RINGS)


def borders_of(
    sweep: ExactSweep,
    winners: Winners,
    windows: FaceWindows,
    chord_error: float,
    control: Control,
) -> list[Border]:
    """Return the borders of an exact sweep that retained all windows.

    O(windows), and O(n³) for n windows that are nearest
    somewhere in a face, in each face that borders cross.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says; what the lines are drawn from counts as memory of the call.
    """
    drawing = _Drawing(sweep, winners, windows, sweep.all_faces, chord_error)
    found = drawing.borders(control)
    return [] if found is None else found  # all faces have their windows


class _Drawing:
    """Borders of a finished sweep, in the faces whose windows it retained."""

    def __init__(
        self,
        sweep: ExactSweep,
        winners: Winners,
        windows: FaceWindows,
        faces: Flags,
        chord_error: float,
    ) -> None:
        self.faces = faces.copy()
        """Faces that borders may pass; `borders` sets those that they pass, too"""
        question, distances = sweep.question, winners.vertices.distance
        self._mesh, self._nearest, self._chord_error = question.mesh, winners.nearest, chord_error
        self._swept = retained_sweep(windows, distances, question.nodes)
        # At its very limit the sweep is cut off by rounding: lines stay clear of that.
        self._limit = question.max_distance * (1.0 - CUT_OFF)
        self._nbytes = bytes_of([(*windows, distances, winners.nearest)])

    def borders(self, control: Control) -> list[Border] | None:
        """Return the borders; None where they leave the faces whose windows are there."""
        control.check_memory(self._nbytes)
        topology, swept = self._mesh.topology, self._swept
        mixed: Any = np.zeros(len(self.faces), np.bool_)

        def mix(first: int, last: int) -> int:
            mixed_faces(topology, swept, self._nearest, self._limit, first, last, mixed)
            return len(mixed)

        in_slices(len(mixed), mix, control.for_part(0, 4))
        candidates = np.flatnonzero(mixed & self.faces).astype(np.int32)
        if len(candidates) == 0:
            return []
        rank = np.full(len(mixed), -1, np.int32)
        control = control.holding(self._nbytes + rank.nbytes)
        divided = self._divided(candidates, rank, control.for_part(1, 4, 2))
        if divided is None:
            return None
        labelled = cross_edges(topology, divided, rank)
        parts: list[Arrays] = []
        next_node = len(labelled.sources)
        # Corners may all be sources, at distance 0; points of a face are at most an edge farther.
        edges = topology.geometry[:, LENGTH].reshape(-1, 3)[candidates]
        farthest = swept.distance.max(where=np.isfinite(swept.distance), initial=0.0) + edges.max()
        near = PIECE * float(farthest)

        def trace(first: int, last: int) -> int:
            nonlocal next_node
            found = trace_borders(
                topology, divided, labelled, near, 0.5 * self._chord_error, first, last, next_node
            )
            parts.append((found.weights, *found.chains, found.sources))
            next_node = found.next_node
            control.check_memory(bytes_of(parts))
            return len(divided.faces)

        in_slices(len(divided.faces), trace, control.for_part(3, 4))
        weights, sizes, nodes, faces, sources = joined(parts)
        chains = Chains(weights, starts_of(sizes), nodes, faces)
        lines, of_lines = link_borders(topology, rank, labelled, chains, sources, next_node, near)
        thin_lines(topology.geometry, lines, 0.5 * self._chord_error)
        return [
            Border(**vars(curve), sources=(lower, higher))
            for curve, (lower, higher) in zip(
                curves_of(self._mesh, lines), of_lines.tolist(), strict=True
            )
        ]

    def _divided(self, candidates: Ints, rank: Ints, control: Control) -> Territories | None:
        """Divide the candidates, and the neighbours that borders lead to; None as for `borders`.

        ``rank`` (F,) is -1 all over; the call sets it to the row of each face among those divided.
        """
        rank[candidates] = np.arange(len(candidates))
        faces = candidates
        retained, parts = self.faces.copy(), list[Arrays]()

        def divide(first: int, last: int) -> int:
            nonlocal faces
            found = divide_faces(
                self._mesh.topology,
                self._swept,
                self._nearest,
                self._limit,
                faces[first:last],
                len(faces),
                rank,
            )
            parts.append(found[:-1])
            faces = np.concatenate([faces, found[-1]])
            control.check_memory(faces.nbytes + bytes_of(parts))
            return len(faces)

        in_slices(len(faces), divide, control)
        self.faces[faces] = True
        if not retained[faces].all():
            return None
        runs, runs_of, curves, curves_of = joined(parts)
        return Territories(faces, runs, starts_of(runs_of), curves, starts_of(curves_of))


def _faces_of_several(mesh: TriangleMesh, nodes: Nodes, nearest: Ints) -> Flags:
    """Flag the inner faces with vertices of two territories, and those that sources lie in."""
    corners = nearest[mesh.topology.links[:, TAIL].reshape(-1, 3)]
    highest = corners.max(axis=1)
    lowest = np.where(corners < 0, highest[:, None], corners).min(axis=1)
    flags: Flags = lowest != highest
    flags[nodes.sites.ints[: nodes.first_target, FACE]] = True
    flags[nodes.sites.segment_ints[:, FACE]] = True
    return flags


def _with_rings(mesh: TriangleMesh, faces: Flags, rings: int) -> Flags:
    """Return the flags of inner faces with those of some rings around them."""
    corners = mesh.topology.links[:, TAIL].reshape(-1, 3)
    for _ in range(rings):
        touched = np.zeros(len(mesh.topology.flags), np.bool_)
        touched[corners[faces]] = True
        widened: Any = touched[corners].any(axis=1)
        faces = widened
    return faces
