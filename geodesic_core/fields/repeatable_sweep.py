"""Repeatable sweeps: from some sources over all of a mesh, run again for what was not retained."""

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
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained import face_windows
from geodesic_core.kernels.retained.face_windows import FaceWindows
from geodesic_core.kernels.sweep import continuous_dijkstra, state
from geodesic_core.kernels.sweep.bounds import Bounds, with_parallel_windows
from geodesic_core.kernels.sweep.state import Wavefront
from geodesic_core.mesh.curve import Polyline
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class SweepStats:
    """Counts, memory and time of a sweep.

    Examples
    --------
    >>> mesh = gc.samples.sphere(80)
    >>> stats = gc.exact_distance(mesh, 0).stats
    >>> stats.windows_created >= stats.windows_kept > 0
    True
    """

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
        """Return the statistics of a sweep on ``mesh`` from its counts of windows.

        Parameters
        ----------
        mesh
            The surface, whose edges the counts are divided by.
        created, kept, peak
            Windows created, left after trimming, and alive at once.
        peak_bytes
            Memory of the state at its largest, bytes.
        seconds
            Time of the solve.

        Returns
        -------
        SweepStats
            The same, and the counts per edge.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # of five edges
        >>> gc.SweepStats.of(mesh, 10, 5, 3, 1024, 0.1).windows_per_edge_created
        2.0
        """
        edges = mesh.edge_count
        return cls(created, kept, peak, created / edges, kept / edges, peak_bytes, seconds)

    def as_dict(self) -> dict[str, Any]:
        """Return the statistics by name, as plain numbers.

        Returns
        -------
        dict
            What JSON can hold.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> gc.exact_distance(mesh, 0).stats.as_dict()["windows_peak"]
        0
        """
        return asdict(self)


class SweepResult(NamedTuple):
    """Findings of a sweep over all of a mesh, as far as retained; N as in its `Winners`."""

    distance: Floats
    """(N,) by node"""
    nearest: Ints
    """(N,) index of the nearest source, by node; -1 where unreached"""
    winners: Winners | None
    """Data of paths"""
    windows: FaceWindows | None
    """Windows of all faces"""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "SweepResult":
        """Return the result that these `arrays` hold."""
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
    """A sweep that can be run any number of times, with the same result to the bit."""

    mesh: TriangleMesh
    nodes: Nodes
    start_distances: Floats
    bounds: Bounds

    @classmethod
    def between(
        cls,
        mesh: TriangleMesh,
        sources: Sequence[Polyline],
        start_distances: Floats,
        targets: Sequence[SurfacePoint],
        bounds: Bounds,
        control: Control,
    ) -> "RepeatableSweep":
        """Return the sweep from canonical points and curves that also reaches some targets.

        Raises
        ------
        Cancelled, DeadlineExceeded
            As the control says.
        """
        nodes = nodes_of(mesh, sources, targets, control)
        if nodes.segments:
            bounds = with_parallel_windows(bounds, nodes.first_segment)
        return cls(mesh, nodes, start_distances, bounds)

    @property
    def all_faces(self) -> Flags:
        """Flags (F,), by inner face, that are all set."""
        return np.ones(len(self.mesh.topology.links) // 3, np.bool_)

    def run(
        self, control: Control, *, paths: bool = False, windows: Flags | None = None
    ) -> Wavefront:
        """Return the state after the sweep, with the data of paths and the windows of some faces.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
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

    def result_of(self, wave: Wavefront, *, paths: bool, windows: bool) -> SweepResult:
        """Return the result of a `run`, in memory of its own."""
        winners = all_winners(wave)
        return SweepResult(
            wave.vertices.distance,
            winners.nearest,
            winners if paths else None,
            face_windows.face_windows_of(wave) if windows else None,
        )

    def find_winners(self, control: Control) -> Winners:
        """Run the sweep for the data of paths."""
        return all_winners(self.run(control, paths=True))

    def find_windows(self, faces: Flags, control: Control) -> FaceWindows:
        """Run the sweep for the windows of some inner faces, flags (F,)."""
        return face_windows.face_windows_of(self.run(control, windows=faces))

    def find_winners_and_windows(self, control: Control) -> tuple[Winners, FaceWindows]:
        """Run the sweep for the data of paths and for all windows."""
        wave = self.run(control, paths=True, windows=self.all_faces)
        return all_winners(wave), face_windows.face_windows_of(wave)


def all_winners(wave: Wavefront) -> Winners:
    """Return the data of paths of a sweep over all of a mesh, in memory of its own."""
    winners = winners_of(
        wave,
        continuous_dijkstra.nearest_sources(
            wave.vertices.distance, wave.vertices.winner_ints, wave.vertices.source_index
        ),
    )
    # A copy holds the merges without the room for more.
    return winners._replace(merges=winners.merges.copy(), merge_ints=winners.merge_ints.copy())


def peak_bytes(wave: Wavefront) -> int:
    """Return the memory of a sweep that has finished, and of the windows that it retained."""
    return state.bytes_of(wave) + (face_windows.bytes_of(wave) if len(wave.pool.retained) else 0)


def stats_of(mesh: TriangleMesh, wave: Wavefront, seconds: float) -> SweepStats:
    """Return the statistics of a sweep that has finished."""
    created, kept, peak = (
        int(wave.counters[i]) for i in (state.CREATED, state.PROPAGATED, state.PEAK)
    )
    return SweepStats.of(mesh, created, kept, peak, peak_bytes(wave), seconds)


class Lazy(Generic[T]):
    """A value that is there already, or is found by the first call that is not stopped."""

    def __init__(self, find: Callable[[Control], T], value: T | None = None) -> None:
        self._find = find
        self._value = value

    @property
    def value(self) -> T | None:
        """The value; None until it is found."""
        return self._value

    def get(self, control: Control) -> T:
        """Return the value, found under ``control`` if it is not there.

        Raises
        ------
        GeodesicError
            As finding it does; the next call tries again.
        """
        if self._value is None:
            self._value = self._find(control)
        return self._value
