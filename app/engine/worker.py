"""What runs inside a worker process."""

import logging
import os
import pickle
import select
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from ctypes import Structure, c_double, c_longlong
from dataclasses import dataclass, replace
from gc import freeze
from io import BufferedRWPair
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from setproctitle import setproctitle

import geodesic_core as gc
from app.encoding import JSON, encode
from app.engine.memory import limit_memory, refuse_beyond_limit
from app.engine.mesh_json import read_json_mesh
from app.engine.work import (
    EstimateQuery,
    MeshFromFile,
    MeshFromSample,
    MeshInput,
    Outcome,
    RunQuery,
    StoreMesh,
    TaskResult,
    Work,
)
from app.errors import problem_of
from app.queries import SMALL_SECONDS, ExecutionContext, FieldCache, Query, code_version, estimate
from app.queries.validation import check_json_size
from app.settings import Settings, variable_of
from app.store.fields import FieldStore
from app.store.lru_cache import LRUCache
from app.store.meshes import MeshStore, OpenMesh
from app.store.results import write_result

logger = logging.getLogger(__name__)

TITLE = "geodesic-worker"
SIZE_BYTES = 8
"""Of the number before each outcome"""

_STEP_BACK = 10
"""Niceness of what is not small: small work and the API process go first."""


@dataclass(frozen=True)
class WorkerConfig:
    """What a worker is told when it starts."""

    settings: Settings
    results: Path


class Signals(Structure):
    """Memory that a worker shares with the service."""

    _fields_ = (
        ("stop_number", c_longlong),  # of the work to stop; earlier work has ended
        ("begun_number", c_longlong),  # of the work that was taken up last
        ("progress", c_double),  # which share of that is done
    )


@dataclass
class Worker:
    """The state of a worker process: its meshes, kept open while they fit."""

    config: WorkerConfig
    signals: Signals

    def __post_init__(self) -> None:
        self.settings = self.config.settings
        self.store = MeshStore(self.settings.store)
        self.meshes: LRUCache[tuple[str, bytes], OpenMesh]
        """By id and barriers"""
        self.meshes = LRUCache(self.settings.worker_mesh_bytes, lambda opened: opened.nbytes)
        store = FieldStore(self.settings.store, self.settings.fields_bytes)
        self.fields = FieldCache(self.settings.worker_field_bytes, store, code_version())
        self._writer = _thread_behind()

    def do(self, number: int, work: Work) -> Outcome:
        """Do ``work``; what goes wrong is a value, since not every exception survives a pipe."""
        try:
            return self._do(number, work)
        except gc.errors.Cancelled:
            return None
        except MemoryError as error:
            self._forget_all()  # what is kept counts as well
            limit, setting = self.settings.worker_memory_bytes, variable_of("worker_memory_bytes")
            return replace(problem_of(error), limit=limit, setting=setting)
        except Exception as error:
            problem = problem_of(error)
            if problem.code == "internal_error":
                logger.exception("a worker failed at %s", work)
            return problem

    def _do(self, number: int, work: Work) -> TaskResult:
        """Do ``work``, unless the number of the work to stop reaches ``number``."""
        clock = Clock()

        def is_to_stop() -> bool:
            return bool(self.signals.stop_number >= number)

        match work:
            case StoreMesh():
                return self._store(work, clock)
            case RunQuery():
                try:
                    return self._answer(work, clock, is_to_stop)
                finally:
                    if self.fields.has_unwritten:
                        self._writer.submit(self.fields.write)  # while the answer is on its way
            case EstimateQuery():
                return self._estimate(work, clock, is_to_stop)

    def _store(self, work: StoreMesh, clock: "Clock") -> TaskResult:
        with clock.phase("load"):
            mesh = _make_mesh(work.origin, self.settings.max_faces)
        with clock.phase("store"):
            written = self.store.write_aside(mesh, work.folder, work.origin.owner)
        return TaskResult(clock.seconds, mesh=written)

    def _answer(self, work: RunQuery, clock: "Clock", cancel: Callable[[], bool]) -> TaskResult:
        settings = self.settings
        grant = ExecutionContext(
            cancel,
            self._report,
            self.fields,
            settings.query_memory_bytes,
            settings.max_json_values,
            settings.max_matrix_cells,
        )
        with clock.phase("load"):
            opened = self._open(work.query)
        with clock.phase("compute"):
            found = work.query.answer(opened, grant)
        if work.form.media_type == JSON:
            check_json_size(found.values, settings.max_json_values, work.query.hint)
        with clock.phase("encode"):
            encoded = encode(found, work.form)
            written = write_result(
                self.config.results,
                work.result_name,
                encoded.parts,
                encoded.headers,
                code_version(),
                is_cheap=clock.seconds["compute"] < SMALL_SECONDS,
            )
        return TaskResult(clock.seconds, answer=written)

    def _estimate(
        self, work: EstimateQuery, clock: "Clock", cancel: Callable[[], bool]
    ) -> TaskResult:
        with clock.phase("load"):
            opened = self._open(work.query)
        with clock.phase("compute"):
            found = estimate(work.query, work.form, opened, cancel)
        return TaskResult(clock.seconds, estimate=found)

    def _report(self, share: float) -> None:
        self.signals.progress = share

    def _open(self, query: Query[Any]) -> OpenMesh:
        """Return the mesh of a query, with its barriers."""
        barriers, mesh_id = query.barriers, query.mesh_id
        opened = self._keep((mesh_id, b""), lambda: self.store.open(mesh_id))
        if len(barriers):
            free = opened
            opened = self._keep((mesh_id, barriers.tobytes()), lambda: query.with_barriers(free))
        return opened

    def _keep(self, name: tuple[str, bytes], open_mesh: Callable[[], OpenMesh]) -> OpenMesh:
        opened = self.meshes.find(name, open_mesh)
        for unused in self.meshes.surplus(least=1):
            self.fields.forget(unused)
        return opened

    def _forget_all(self) -> None:
        """Give back all memory that is only kept."""
        for name in list(self.meshes):
            self.fields.forget(name)
            self.meshes.drop(name)


class Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure what runs inside."""
        start = perf_counter()
        yield
        self.seconds[name] = perf_counter() - start


def _make_mesh(origin: MeshInput, max_faces: int) -> gc.TriangleMesh:
    faces: NDArray[np.int32] | NDArray[np.int64]
    match origin:
        case MeshFromSample():
            vertices, faces = gc.samples.SAMPLES[origin.name](origin.faces)
        case MeshFromFile(file_type="json"):
            refuse_beyond_limit(_JSON_GROWS * origin.path.stat().st_size)
            vertices, faces = read_json_mesh(origin.path.read_bytes())
        case MeshFromFile():
            return gc.load_mesh(origin.path, origin.file_type, origin.merge, max_faces=max_faces)
    if len(faces) > max_faces:
        raise gc.errors.TooManyFaces(len(faces), max_faces)
    return gc.TriangleMesh(vertices, faces, merge=origin.merge)


_JSON_GROWS = 40
"""Bytes that orjson takes for one of JSON; 37 were the most measured. Lacking them, it crashes."""


def run(config: WorkerConfig, signals: Signals, line: socket.socket) -> None:
    """Be a worker process, at the end of a ``line``: do what comes along it, until it is cut."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # meant for the service, which ends its workers
    setproctitle(TITLE)
    threading.Thread(target=_die_with, args=(line,), daemon=True).start()
    worker = Worker(config, signals)
    behind = _thread_behind()
    warm_up(config.settings.worker_memory_bytes)
    with line.makefile("rwb") as messages, suppress(EOFError, BrokenPipeError):
        _send(messages, None)
        while True:
            number, work, is_small = pickle.load(messages)  # noqa: S301 - of our own service
            signals.begun_number = number
            if is_small:
                outcome = worker.do(number, work)
            else:
                outcome = behind.submit(worker.do, number, work).result()
            _send(messages, outcome)


def warm_up(allowed_memory: int) -> None:
    """Compile the kernels, or load them; from then on memory is limited."""
    gc.warm_up()
    freeze()  # what is loaded now stays: a collection that looks through it takes 90 ms
    limit_memory(allowed_memory)


def _thread_behind() -> ThreadPoolExecutor:
    """Start a thread that lets others go first, when there is more to do than cores.

    On Linux niceness is a thread's own. It cannot be taken back, so that a worker that stepped back
    itself would do so for small work as well.
    """
    thread = ThreadPoolExecutor(1)
    thread.submit(os.nice, _STEP_BACK).result()
    return thread


def _send(messages: BufferedRWPair, outcome: Outcome) -> None:
    """Send an outcome after its size, by which who reads without waiting knows when it is whole."""
    pickled = pickle.dumps(outcome)
    messages.write(len(pickled).to_bytes(SIZE_BYTES))
    messages.write(pickled)
    messages.flush()


def _die_with(line: socket.socket) -> None:
    # The other end closes with the service, however that ends, and with the slot. Who is busy does
    # not read; PR_SET_PDEATHSIG would tell of the end of the process that forked us.
    hung_up = select.poll()
    hung_up.register(line, 0)
    hung_up.poll()
    os._exit(1)
