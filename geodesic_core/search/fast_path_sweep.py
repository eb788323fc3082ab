"""The fast sweep of a search between two points, pruned by the length of a known path.

It leads from the corners around the start to those around the end, in reused memory.
"""

import math

import numpy as np

from geodesic_core.arrays import Ints
from geodesic_core.control import Control
from geodesic_core.fields.fast_sweep import bucket_width, engine_on
from geodesic_core.fields.path import located_path
from geodesic_core.fields.sources import Nodes, nodes_of
from geodesic_core.fields.sweep import run_sweep, winners_of
from geodesic_core.fields.vertex_points import VertexPoints
from geodesic_core.kernels.fast import rows, sweep
from geodesic_core.kernels.fast.state import fast_bounds, new_wavefront
from geodesic_core.kernels.front.bounds import PruningBounds, exact_bounds
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.state import NO_SITES, Wavefront, bytes_of
from geodesic_core.kernels.mesh.locations import Locations
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.mesh.surface_curve import SurfaceCurve, in_space, length_on, locations_of
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.leg import End, Leg

_BEYOND = 1.002, 1.03
"""Shares of the length of the known path up to which it looks, one after the other.

Its own paths are about 0.3 % too long before they are pulled tight, and up to 3 %. Most known paths
are longer than the shortest by more, and a narrow sweep finds that one; the others take a wide one.
"""


class FastPathSweep:
    """A fast sweep over one mesh, from search to search."""

    def __init__(self, mesh: TriangleMesh, nearest: Ints) -> None:
        self.mesh = mesh
        self.touched = 0
        """Vertices that all sweeps reached"""
        self._nearest = nearest
        """(V,) zeros: a search has one source"""
        self._wave: Wavefront | None = None
        """None before the first search, and after one that was stopped"""

    @property
    def nbytes(self) -> int:
        """Memory held, bytes."""
        return 0 if self._wave is None else bytes_of(self._wave)

    def curve(
        self,
        leg: Leg,
        upper: float,
        pruning_bounds: PruningBounds,
        effort: int,
        control: Control,
        share: float,
    ) -> SurfaceCurve | None:
        """Return a path from the start to the end, or None where it finds none of that length.

        ``pruning_bounds`` are those of paths through the end, ``share`` is the progress to show.
        Another ``effort`` than that of the call before takes new memory.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `run_sweep`.
        """
        if self._wave is not None and self._wave.places.per_edge != effort:
            self._wave = None
        for beyond in _BEYOND:
            limit = leg.bound(upper) * beyond
            bounds = pruning_bounds._replace(limit=limit)
            curve = self._within(leg, upper, bounds, effort, control, share)
            if curve is not None:
                return curve
        return None

    def _within(
        self,
        leg: Leg,
        upper: float,
        pruning_bounds: PruningBounds,
        effort: int,
        control: Control,
        share: float,
    ) -> SurfaceCurve | None:
        """Return a path that is not much longer than the limit of the bounds."""
        mesh, topology = self.mesh, self.mesh.topology
        wave, self._wave = self._wave, None
        if wave is None:
            width = bucket_width(topology)
            wave = new_wavefront(topology, NO_SITES, effort, width, 0, pruned=True)
            control.check_memory(bytes_of(wave))
        bounds = fast_bounds(exact_bounds(math.inf, pruning_bounds))
        corners = topology.outer_vertex[leg.start.corners]
        nodes = nodes_of(mesh, VertexPoints(mesh, corners), [], control)
        sweep.start_sweep(
            topology, wave, nodes.sources, nodes.source_indices, leg.start.reaches, bounds
        )
        wave, outcome = run_sweep(
            mesh, wave, bounds, control, lambda _: share, engine=engine_on(topology)
        )
        if outcome != Outcome.FINISHED:  # it goes in circles
            return None
        self.touched += int(wave.counters[TOUCHED])
        lengths = wave.vertices.distance[leg.end.corners] + leg.end.reaches
        found = float(lengths.min())
        leg.log.add("fast", min(found, upper), wave)
        curve = None
        if found < math.inf:
            node = int(leg.end.corners[lengths.argmin()])
            curve = self._traced(wave, nodes, node, leg.start, leg.end)
            leg.log.add("backtrace", min(curve.length, upper))
        rows.forget(topology, wave)
        self._wave = wave
        return curve

    def _traced(
        self, wave: Wavefront, nodes: Nodes, node: int, start: End, end: End
    ) -> SurfaceCurve:
        """Return the path to a corner of the end, with the ways from and to the points there."""
        mesh = self.mesh
        located, faces = located_path(mesh, winners_of(wave, self._nearest), nodes, node)
        parts, crossed = [in_space(mesh, located)], [faces]
        if start.point.vertex_index is None:
            parts.insert(0, in_space(mesh, locations_of(mesh, [start.point])))
            crossed.insert(0, np.array([start.point.face_index], np.int32))
        if end.point.vertex_index is None:
            parts.append(in_space(mesh, locations_of(mesh, [end.point])))
            crossed.append(np.array([end.point.face_index], np.int32))
        whole = Locations(*map(np.concatenate, zip(*parts, strict=True)))
        faces = np.concatenate(crossed)
        return SurfaceCurve(mesh, faces, False, length_on(mesh, whole, faces), whole)
