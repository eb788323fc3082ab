"""A sweep from some sources over all of a mesh: run once, or again for what was not kept."""

import math
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Flags, Floats
from geodesic_core.kernels import kept, sweep, wavefront
from geodesic_core.kernels.backtrace import Winners
from geodesic_core.kernels.kept import Kept
from geodesic_core.kernels.wavefront import Bounds, Wavefront
from geodesic_core.mesh import TriangleMesh
from geodesic_core.nodes import Nodes
from geodesic_core.run import Control, share_of_vertices, sweep_nodes, winners_of


@dataclass(frozen=True)
class WholeSweep:
    """A sweep that can be run any number of times: what it finds is the same to the bit."""

    mesh: TriangleMesh
    nodes: Nodes
    start_distances: Floats
    bounds: Bounds

    @property
    def all_faces(self) -> Flags:
        """Flags (F,), by inner face, that are all set."""
        return np.ones(len(self.mesh.topology.links) // 3, np.bool_)

    def run(
        self, control: Control, *, paths: bool = False, windows: Flags | None = None
    ) -> Wavefront:
        """Return the state after the sweep, with what paths need, and the windows of some faces.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded, NotConverged
            As in `run_sweep`; the memory of `kept_of` counts as well.
        """
        mesh, limit, merges = self.mesh, self.bounds.max_distance, bool(self.bounds.merging)
        wave = wavefront.new_wavefront(
            mesh.topology, self.nodes.sites, merges=merges, paths=merges and paths, windows=windows
        )
        control.grant_memory(wavefront.bytes_of(wave))
        reachable = int(np.isin(mesh.components, self.nodes.components).sum())
        share = share_of_vertices(reachable, limit)
        wave = sweep_nodes(
            mesh, wave, self.nodes, self.start_distances, self.bounds, control, share
        )
        control.grant_memory(peak_bytes(wave))
        wave.distance[wave.distance > limit] = math.inf
        if control.progress is not None:
            control.progress(1.0)
        return wave

    def find_winners(self, control: Control) -> Winners:
        """Run the sweep for what paths need."""
        return all_winners(self.run(control, paths=True))

    def find_windows(self, faces: Flags, control: Control) -> Kept:
        """Run the sweep for the windows of some inner faces (F,)."""
        return kept.kept_of(self.run(control, windows=faces))

    def find_ways(self, control: Control) -> tuple[Winners, Kept]:
        """Run the sweep for what paths need, and for all windows."""
        wave = self.run(control, paths=True, windows=self.all_faces)
        return all_winners(wave), kept.kept_of(wave)


def all_winners(wave: Wavefront) -> Winners:
    """Return what backtracing needs of a sweep over all of a mesh, in memory of its own."""
    found = winners_of(wave, sweep.nearest_sources(wave.distance, wave.winner_ints, wave.origin))
    # What was recorded of merges is kept, not the room for more.
    return found._replace(merges=found.merges.copy(), merge_ints=found.merge_ints.copy())


def peak_bytes(wave: Wavefront) -> int:
    """Return the memory of a sweep that has finished, and of the windows that it kept."""
    return wavefront.bytes_of(wave) + (kept.bytes_of(wave) if len(wave.kept) else 0)
