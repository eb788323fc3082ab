"""Figures measured here, in processor seconds, which other programs change least."""

import asyncio
import math
import tempfile
import time
import tracemalloc
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import geodesic_core as gc
from app.engine.placement import Occupancy, ranked
from app.store.folder import Folder
from app.store.layout import MESHES
from app.store.mesh_catalog import MeshCatalog
from app.store.mesh_home import MeshRecord
from app.store.meshes import MeshStore
from geodesic_core.arrays import Floats

FACES = (2_000, 10_000, 50_000)
RUNS = 25
KINDS = ("path", "fast", "approximate", "exact")
RECORDS, COPIES = 200_000, 500
HOSTS = (8, 64, 512)


@dataclass(frozen=True)
class Solve:
    """Seconds of a kind of question: ``scale`` × faces^``exponent``, times one of ``ratios``."""

    scale: float
    exponent: float
    ratios: Floats

    def seconds(self, faces: Any) -> Any:
        """Return the median for some faces; elementwise for an array."""
        return self.scale * faces**self.exponent


@dataclass(frozen=True)
class Figures:
    """What a question, a mesh, a record and a choice take."""

    solves: Mapping[str, Solve]
    bytes_a_face: float
    """Of a stored mesh"""
    plain_bytes_a_face: float
    """Of its vertices and corners alone, from which the rest can be made"""
    open_s_a_face: float
    """To map a mesh and to verify its bytes"""
    build_s_a_face: float
    """To make a mesh of its vertices and corners"""
    record_s: float
    """For each mesh that replicas share: to keep up with their table, once"""
    record_bytes: float
    copy_s: float
    """For each copy that a host has: to find those that go, at each pull"""
    place_s: Mapping[int, float]
    """To choose a host, by their number"""

    def place_s_among(self, hosts: int) -> float:
        """Return the seconds to choose one of some hosts."""
        return float(np.interp(hosts, list(self.place_s), list(self.place_s.values())))


def measure() -> Figures:
    """Measure all of them."""
    meshes = {faces: gc.samples.knot(faces) for faces in FACES}
    mesh = meshes[FACES[-1]]
    plain = mesh.vertices.nbytes + mesh.faces.nbytes
    stored = sum(array.nbytes for array in mesh.arrays().values())
    record_s, record_bytes = _records()
    return Figures(
        {kind: _solve(kind, meshes) for kind in KINDS},
        stored / len(mesh.faces),
        plain / len(mesh.faces),
        _opening(mesh) / len(mesh.faces),
        spent(partial(gc.TriangleMesh, mesh.vertices, mesh.faces)) / len(mesh.faces),
        record_s,
        record_bytes,
        _copies(),
        {count: _placing(count) for count in HOSTS},
    )


def spent(call: Callable[[], Any], runs: int = 5) -> float:
    """Return the processor seconds of a call in this thread, the median of some runs."""
    times = []
    for _ in range(runs):
        start = time.thread_time()
        call()
        times.append(time.thread_time() - start)
    return median(times)


def _solve(kind: str, meshes: Mapping[int, gc.TriangleMesh]) -> Solve:
    times = {faces: _times(kind, mesh) for faces, mesh in meshes.items()}
    logs = [math.log(median(some)) for some in times.values()]
    exponent, offset = np.polyfit(np.log(list(times)), logs, 1)
    scale = math.exp(offset)
    ratios = [np.array(some) / (scale * faces**exponent) for faces, some in times.items()]
    return Solve(scale, float(exponent), np.concatenate(ratios))


def _times(kind: str, mesh: gc.TriangleMesh) -> Sequence[float]:
    solver, rng = gc.Solver(mesh), np.random.default_rng(3)
    asks: dict[str, Callable[[int, int], Any]] = {
        "path": solver.shortest_path,
        "fast": lambda source, _: gc.fast_distance(mesh, source, retain="distances"),
        "approximate": lambda source, _: gc.approximate_distance(mesh, source, retain="distances"),
        "exact": lambda source, _: gc.exact_distance(mesh, source, retain="distances"),
    }
    ask = asks[kind]
    ask(0, 1)  # loads the kernels
    pairs = rng.choice(len(mesh.vertices), (RUNS, 2), replace=False).tolist()
    return [spent(partial(ask, *pair), runs=1) for pair in pairs]


def _opening(mesh: gc.TriangleMesh) -> float:
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for run in range(5):
            store = MeshStore(Path(folder, str(run)))
            store.folder.parent.mkdir()
            written = store.write_aside(mesh, Path(folder, f"{run} aside"))
            assert written.folder is not None, "it is new"  # noqa: S101
            store.install(written.mesh_id, written.folder)
            times.append(spent(partial(store.open, written.mesh_id), runs=1))
        return median(times)


class _Table:
    """A shared table in memory: what the database itself takes is not counted."""

    def __init__(self, records: Mapping[str, MeshRecord]) -> None:
        self._records = records

    @asynccontextmanager
    async def alone(self) -> AsyncIterator["_Table"]:
        """See ``MeshTables``."""
        yield self

    async def note_uses(self, used: Iterable[str], pinned: Collection[str]) -> None:
        """See ``MeshTables``."""

    async def all(self) -> Mapping[str, MeshRecord]:
        """See ``MeshTable``."""
        return self._records

    async def add(self, mesh_id: str, record: MeshRecord) -> None:
        """See ``MeshTable``."""

    async def remove(self, mesh_id: str) -> None:
        """See ``MeshTable``."""


def _records() -> tuple[float, float]:
    """Return the seconds and the bytes of a record."""
    tracemalloc.start()
    records = {f"{i:032x}": MeshRecord(i) for i in range(RECORDS)}
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    with tempfile.TemporaryDirectory() as folder:
        store = MeshStore(Path(folder))
        home: Any = store  # nothing is asked of it
        catalog = MeshCatalog(home, 2**60, evicts=False, shared=_Table(records))
        seconds = spent(lambda: asyncio.run(catalog.keep_up()))
    return seconds / RECORDS, size / RECORDS


def _copies() -> float:
    """Return the seconds for each copy, of meshes that have as many files as real ones."""
    names = list(gc.samples.plane(2).arrays())
    with tempfile.TemporaryDirectory() as folder:
        for i in range(COPIES):
            copy = Path(folder, MESHES, f"{i:032x}")
            copy.mkdir(parents=True)
            for name in names:
                (copy / f"{name}.npy").touch()
        return spent(lambda: list(Folder(Path(folder)).found(MESHES))) / COPIES


def _placing(count: int) -> float:
    hosts = {f"host {i}": Occupancy(0, 16) for i in range(count)}
    return spent(lambda: [ranked(f"{i:032x}", hosts, is_small=True) for i in range(20)]) / 20
