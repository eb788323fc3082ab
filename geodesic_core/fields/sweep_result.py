"""Results of a sweep over all of a mesh: distances, data of paths, windows, and statistics."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple, Self

from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Ints
from geodesic_core.fields.sweep import winners_of
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.counters import CREATED, PEAK, PROPAGATED
from geodesic_core.kernels.front.relaxation import nearest_sources
from geodesic_core.kernels.front.state import FOUND, Merges, Sites, Wavefront, found
from geodesic_core.kernels.paths.backtracing import NO_END, Winners
from geodesic_core.kernels.retained import face_windows
from geodesic_core.kernels.retained.face_windows import FaceWindows
from geodesic_core.mesh.triangle_mesh import TriangleMesh

Retain = Literal["distances", "paths", "windows"]
"""Contents of a field in memory: each word includes the ones before it."""


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
    def of(cls, wave: Wavefront, retain: Retain) -> "SweepResult":
        """Return the result of a sweep that has finished, in memory of its own."""
        winners = all_winners(wave)
        return cls(
            wave.vertices.distance,
            winners.nearest,
            winners if retain != "distances" else None,
            face_windows.face_windows_of(wave) if retain == "windows" else None,
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], sites: Sites) -> "SweepResult":
        """Return the result that these `arrays` hold, of a sweep with these sites."""
        winners = windows = None
        if "winner" in arrays:
            merges = Merges(arrays["merges"], arrays["merge_ints"])
            winners = Winners(arrays["nearest"], found(arrays), merges, sites, NO_END)
        if "windows" in arrays:
            windows = FaceWindows(**{name: arrays[name] for name in FaceWindows._fields})
        return cls(arrays["distance"], arrays["nearest"], winners, windows)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, those of winners and windows among them."""
        arrays: dict[str, NDArray[Any]] = {"distance": self.distance, "nearest": self.nearest}
        arrays |= {} if self.winners is None else arrays_of(self.winners)
        return arrays | ({} if self.windows is None else self.windows._asdict())


def all_winners(wave: Wavefront) -> Winners:
    """Return the data of paths of a sweep over all of a mesh, in memory of its own."""
    vertices = wave.vertices
    nearest = nearest_sources(vertices.distance, vertices.winner_ints, vertices.source_index)
    winners = winners_of(wave, nearest)
    # A copy holds the merges without the room for more.
    merges = Merges(winners.merges.floats.copy(), winners.merges.ints.copy())
    return winners._replace(merges=merges)


def arrays_of(winners: Winners) -> dict[str, NDArray[Any]]:
    """Return the data of paths by name, without the sites, which the question tells."""
    vertices = {name: getattr(winners.vertices, name) for name in FOUND}
    merges, merge_ints = winners.merges
    return {"nearest": winners.nearest, **vertices, "merges": merges, "merge_ints": merge_ints}


def peak_bytes(wave: Wavefront) -> int:
    """Return the memory of a sweep that has finished, and of the windows that it retained."""
    return state.bytes_of(wave) + (face_windows.bytes_of(wave) if len(wave.pool.retained) else 0)


def stats_of(mesh: TriangleMesh, wave: Wavefront, seconds: float) -> SweepStats:
    """Return the statistics of a sweep that has finished."""
    created, kept, peak = (int(wave.counters[i]) for i in (CREATED, PROPAGATED, PEAK))
    return SweepStats.of(mesh, created, kept, peak, peak_bytes(wave), seconds)
