"""A sweep from some sources over all of a mesh: run once, or again for what was not kept."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Generic, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.control import Control
from geodesic_core.fields.sources import Nodes, nodes_of
from geodesic_core.fields.sweep import share_of_vertices, sweep_nodes, winners_of
from geodesic_core.kernels.isolines import face_windows
from geodesic_core.kernels.isolines.face_windows import FaceWindows
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.sweep import continuous_dijkstra, state
from geodesic_core.kernels.sweep.bounds import Bounds, with_parallel_windows
from geodesic_core.kernels.sweep.state import Wavefront
from geodesic_core.mesh.curve import Polyline
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SweepStats:
    """What a sweep did."""

    windows_created: int
    windows_kept: int
    """Windows left after trimming: those that were propagated."""
    windows_peak: int
    """Windows alive at once, at most."""
    windows_per_edge_created: float
    windows_per_edge_kept: float
    peak_bytes: int
    """Memory of the sweep's state at its largest, the mesh itself not counted."""
    seconds: float
    """Time of the solve, with the allocation of its state."""

    @classmethod
    def of(
        cls, mesh: TriangleMesh, created: int, kept: int, peak: int, peak_bytes: int, seconds: float
    ) -> Self:
        """Return the statistics of a sweep with these counts of windows."""
        edges = mesh.edge_count
        return cls(created, kept, peak, created / edges, kept / edges, peak_bytes, seconds)

    def as_dict(self) -> dict[str, Any]:
        """Return the statistics as what JSON can hold."""
        return asdict(self)


class SweepResult(NamedTuple):
    """What a sweep over all of a mesh has found, as far as it is kept; N as in its `Winners`."""

    distance: Floats
    """(N,) by node"""
    nearest: Ints
    """(N,): the index of the nearest source, by node; -1 where unreached"""
    winners: Winners | None
    """What paths need"""
    windows: FaceWindows | None
    """Those of all faces"""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "SweepResult":
        """Return what these `arrays` hold."""
        winners = windows = None
        if "winner" in arrays:
            winners = Winners(**{name: arrays[name] for name in Winners._fields})
        if "windows" in arrays:
            windows = FaceWindows(**{name: arrays[name] for name in FaceWindows._fields})
        return cls(arrays["distance"], arrays["nearest"], winners, windows)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, those of winners and windows among them."""
        arrays: dict[str, NDArray[Any]] = {"distance": self.distance, "nearest": self.nearest}
        for group in (self.winners, self.windows):
            arrays |= {} if group is None else group._asdict()
        return arrays


@dataclass(frozen=True)
class RepeatableSweep:
    """A sweep that can be run any number of times: what it finds is the same to the bit."""

    mesh: TriangleMesh
    nodes: Nodes
    start_distances: Floats
    bounds: Bounds

    @classmethod
    def between(
        cls,
        mesh: TriangleMesh,
        places: Sequence[Polyline],
        start_distances: Floats,
        targets: Sequence[SurfacePoint],
        bounds: Bounds,
    ) -> "RepeatableSweep":
        """Return the sweep from points and curves, which are canonical, that knows of targets."""
        nodes = nodes_of(mesh, places, targets)
        if nodes.pieces:
            bounds = with_parallel_windows(bounds, nodes.first_piece)
        return cls(mesh, nodes, start_distances, bounds)

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
            As in `run_sweep`; the memory of `face_windows_of` counts as well.
        """
        mesh, limit, merges = self.mesh, self.bounds.max_distance, bool(self.bounds.merging)
        wave = state.new_wavefront(
            mesh.topology, self.nodes.sites, merges=merges, paths=merges and paths, windows=windows
        )
        control.check_memory(state.bytes_of(wave))
        reachable = int(np.isin(mesh.components, self.nodes.components).sum())
        share = share_of_vertices(reachable, limit)
        wave = sweep_nodes(
            mesh, wave, self.nodes, self.start_distances, self.bounds, control, share
        )
        control.check_memory(peak_bytes(wave))
        wave.vertices.distance[wave.vertices.distance > limit] = math.inf
        if control.progress is not None:
            control.progress(1.0)
        return wave

    def found(self, wave: Wavefront, *, paths: bool, windows: bool) -> SweepResult:
        """Return what a `run` has found, in memory of its own."""
        winners = all_winners(wave)
        return SweepResult(
            wave.vertices.distance,
            winners.nearest,
            winners if paths else None,
            face_windows.face_windows_of(wave) if windows else None,
        )

    def find_winners(self, control: Control) -> Winners:
        """Run the sweep for what paths need."""
        return all_winners(self.run(control, paths=True))

    def find_windows(self, faces: Flags, control: Control) -> FaceWindows:
        """Run the sweep for the windows of some inner faces (F,)."""
        return face_windows.face_windows_of(self.run(control, windows=faces))

    def find_ways(self, control: Control) -> tuple[Winners, FaceWindows]:
        """Run the sweep for what paths need, and for all windows."""
        wave = self.run(control, paths=True, windows=self.all_faces)
        return all_winners(wave), face_windows.face_windows_of(wave)


def all_winners(wave: Wavefront) -> Winners:
    """Return what backtracing needs of a sweep over all of a mesh, in memory of its own."""
    found = winners_of(
        wave,
        continuous_dijkstra.nearest_sources(
            wave.vertices.distance, wave.vertices.winner_ints, wave.vertices.source_index
        ),
    )
    # What was recorded of merges is kept, not the room for more.
    return found._replace(merges=found.merges.copy(), merge_ints=found.merge_ints.copy())


def peak_bytes(wave: Wavefront) -> int:
    """Return the memory of a sweep that has finished, and of the windows that it kept."""
    return state.bytes_of(wave) + (face_windows.bytes_of(wave) if len(wave.pool.retained) else 0)


def stats_of(mesh: TriangleMesh, wave: Wavefront, seconds: float) -> SweepStats:
    """Return the statistics of a sweep that has finished."""
    created, kept, peak = (int(wave.counters[i]) for i in (state.CREATED, state.KEPT, state.PEAK))
    return SweepStats.of(mesh, created, kept, peak, peak_bytes(wave), seconds)


class Lazy(Generic[T]):
    """A value that is there already, or is found at the first call that is not stopped."""

    def __init__(self, find: Callable[[Control], T], found: T | None = None) -> None:
        self._find = find
        self._found = found

    @property
    def found(self) -> T | None:
        """The value, if it is there."""
        return self._found

    def get(self, control: Control) -> T:
        """Return the value.

        Raises
        ------
        GeodesicError
            As finding it does; the next call looks for it anew.
        """
        if self._found is None:
            self._found = self._find(control)
        return self._found
