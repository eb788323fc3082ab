"""Questions as many users ask them: some meshes are asked far more than others."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from benchmarks.scaling.figures import Figures
from benchmarks.scaling.model import Question
from geodesic_core.arrays import Floats

SMALL_S = 0.05
"""What is likely to take less is small work, as in the service"""


@dataclass(frozen=True)
class Assumed:
    """What cannot be measured here."""

    exponent: float = 0.9
    """Of Zipf's law: the mesh of rank r is asked r^-0.9 as often; of web pages 0.6 to 1"""
    kinds: Mapping[str, float] = field(
        default_factory=lambda: {"path": 0.6, "fast": 0.2, "approximate": 0.1, "exact": 0.1}
    )
    faces: float = 20_000.0
    """Of half of the meshes, at most"""
    spread: float = 1.0
    """Standard deviation of the logarithm of their number"""
    most_faces: float = 1_000_000.0
    repeated: float = 0.3
    """Share of questions that were asked before, whose answer a replica still has"""
    first_byte_s: float = 0.03
    bytes_a_second: float = 250e6
    """Of an object store, to one host, eight arrays at once"""
    copies_bytes: float = 2e12
    """Disk of a host for copies of meshes"""
    open_bytes: float = 2 * 2**30
    """Memory of a worker for open meshes: the service's default"""
    core_dollars: float = 0.045
    """An hour of a core, with its share of memory and disk"""
    stored_dollars: float = 0.023
    """A month of a gigabyte in an object store"""

    @property
    def mean_faces(self) -> float:
        """The faces of a mesh on average."""
        return float(self.faces_of(np.arange(1, 20_001)).mean())

    def faces_of(self, meshes: NDArray[np.int64]) -> Floats:
        """Return the faces of meshes by rank, which says nothing about them."""
        share = _scattered(meshes)
        faces = self.faces * np.exp(self.spread * ndtri(share))
        return np.asarray(np.minimum(self.most_faces, faces))

    def ranks(self, meshes: int, shares: Floats) -> NDArray[np.int64]:
        """Return the ranks below which some shares of all questions are, from 1."""
        s = 1.0 - self.exponent
        ranks = (shares * ((meshes + 1.0) ** s - 1.0) + 1.0) ** (1.0 / s)
        return np.asarray(np.clip(ranks.astype(np.int64), 1, meshes))

    def share_of(self, ranks: Floats, meshes: int) -> Floats:
        """Return the shares of questions that are to meshes of some ranks."""
        s = 1.0 - self.exponent
        return np.asarray(((ranks + 1.0) ** s - ranks**s) / ((meshes + 1.0) ** s - 1.0))


@dataclass(frozen=True)
class Cache:
    """Which meshes are where a cache has room for some bytes (LRU, by Che's approximation)."""

    assumed: Assumed
    meshes: int
    rate: float
    seconds: float
    """From the last question to a mesh until it has to go"""

    @classmethod
    def of(
        cls, assumed: Assumed, meshes: int, rate: float, caches: int, room: float, mesh_bytes: float
    ) -> "Cache":
        """Share meshes out to equal caches, each with room for some bytes."""
        edges = np.unique(np.geomspace(1, meshes, 400).astype(np.int64)).astype(float)
        counts = np.diff(edges, append=meshes + 1.0)
        middles = edges + (counts - 1) / 2
        rates = rate * assumed.share_of(middles, meshes)
        low, high = 1e-6, 1e15
        for _ in range(200):
            seconds = np.sqrt(low * high)
            kept = (counts * -np.expm1(-rates * seconds)).sum() * mesh_bytes / caches
            low, high = (seconds, high) if kept < room else (low, seconds)
        return cls(assumed, meshes, rate, float(low))

    def has(self, ranks: Floats) -> Floats:
        """Return the probabilities that meshes of some ranks are there."""
        rates = self.rate * self.assumed.share_of(ranks, self.meshes)
        return np.asarray(-np.expm1(-rates * self.seconds))


@dataclass(frozen=True)
class Traffic:
    """Questions a second, to some of all meshes."""

    figures: Figures
    assumed: Assumed
    meshes: int
    rate: float
    opened: Cache
    """Of the workers of a host, together"""
    seed: int = 0

    def questions(self, ranks: NDArray[np.int64], seconds: float) -> Iterator[Question]:
        """Yield questions to meshes of these ranks, evenly drawn over some seconds."""
        rng, assumed, figures = np.random.default_rng(self.seed), self.assumed, self.figures
        count = len(ranks)
        arrivals = np.sort(rng.uniform(0, seconds, count))
        faces = assumed.faces_of(ranks)
        worker_s = np.empty(count)
        is_small = np.empty(count, bool)
        kinds = rng.choice(len(assumed.kinds), count, p=list(assumed.kinds.values()))
        for i, kind in enumerate(assumed.kinds):
            its, solve = kinds == i, figures.solves[kind]
            likely = solve.seconds(faces[its])
            is_small[its] = likely < SMALL_S
            worker_s[its] = likely * rng.choice(solve.ratios, int(its.sum()))
        to_open = rng.uniform(size=count) > self.opened.has(ranks.astype(float))
        worker_s += to_open * figures.open_s_a_face * faces
        size = faces * figures.bytes_a_face
        pull_s = assumed.first_byte_s + size / assumed.bytes_a_second
        is_stored = rng.uniform(size=count) < assumed.repeated
        columns = (arrivals, worker_s, ranks, is_small, is_stored, pull_s)
        for row in zip(*(column.tolist() for column in columns), strict=True):
            yield Question(*row)


def _scattered(numbers: NDArray[np.int64]) -> Floats:
    """Return a number between 0 and 1 for each, without an order (splitmix64)."""
    with np.errstate(over="ignore"):
        z = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return (z.astype(float) + 0.5) / 2.0**64


def cell_of(meshes: NDArray[np.int64], cells: int) -> NDArray[np.int64]:
    """Return the cell of each mesh."""
    return (_scattered(meshes + 2**40) * cells).astype(np.int64)
