"""What runs inside a worker process."""

import logging
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from ctypes import c_double, c_longlong
from dataclasses import dataclass, replace
from gc import freeze
from multiprocessing import connection, parent_process
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from setproctitle import setproctitle

import geodesic_core as gc
from app.encoding import JSON, encode
from app.engine.memory import limit_memory, refuse_beyond_limit
from app.engine.work import (
    Answering,
    Done,
    Estimating,
    MeshFromFile,
    MeshFromSample,
    MeshOrigin,
    Outcome,
    Storing,
    Work,
)
from app.errors import problem_of
from app.field_store import FieldStore
from app.json_mesh import read_json_mesh
from app.kept import Kept
from app.mesh_store import MeshStore, OpenMesh
from app.queries import SMALL_SECONDS, Fields, Grant, Query, code_version, estimate
from app.queries.refusals import refuse_large_json
from app.result_store import write_result
from app.settings import Settings, variable_of

logger = logging.getLogger(__name__)

TITLE = "geodesic-worker"


@dataclass(frozen=True)
class WorkerConfig:
    """What a worker is told when it starts."""

    settings: Settings
    results: Path
    niceness: int = 0
    """How far the process steps back behind others when there is more to do than cores"""


@dataclass
class Worker:
    """The state of a worker process: its meshes, kept open while they fit."""

    config: WorkerConfig
    stop_number: c_longlong
    progress: c_double

    def __post_init__(self) -> None:
        self.settings = self.config.settings
        self.store = MeshStore(self.settings.store)
        self.meshes: Kept[tuple[str, bytes], OpenMesh]
        """By id and barriers"""
        self.meshes = Kept(self.settings.worker_mesh_bytes, lambda opened: opened.nbytes)
        store = FieldStore(self.settings.store, self.settings.fields_bytes)
        self.fields = Fields(self.settings.worker_field_bytes, store, code_version())
        self._writer = ThreadPoolExecutor(1)

    def do(self, number: int, work: Work) -> Done:
        """Do ``work``, unless the number of the work to stop reaches ``number``."""
        clock = Clock()

        def is_to_stop() -> bool:
            return self.stop_number.value >= number

        match work:
            case Storing():
                return self._store(work, clock)
            case Answering():
                try:
                    return self._answer(work, clock, is_to_stop)
                finally:
                    if self.fields.has_unwritten:
                        self._writer.submit(self.fields.write)  # while the answer is on its way
            case Estimating():
                return self._estimate(work, clock, is_to_stop)

    def _store(self, work: Storing, clock: "Clock") -> Done:
        with clock.phase("load"):
            mesh = _make_mesh(work.origin, self.settings.max_faces)
        with clock.phase("store"):
            written = self.store.write_aside(mesh, work.folder, work.origin.owner)
        return Done(clock.seconds, mesh=written)

    def _answer(self, work: Answering, clock: "Clock", cancel: Callable[[], bool]) -> Done:
        settings = self.settings
        grant = Grant(
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
            refuse_large_json(found.values, settings.max_json_values, work.query.hint)
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
        return Done(clock.seconds, answer=written)

    def _estimate(self, work: Estimating, clock: "Clock", cancel: Callable[[], bool]) -> Done:
        with clock.phase("load"):
            opened = self._open(work.query)
        with clock.phase("compute"):
            found = estimate(work.query, work.form, opened, cancel)
        return Done(clock.seconds, estimate=found)

    def _report(self, share: float) -> None:
        self.progress.value = share

    def _open(self, query: Query[Any]) -> OpenMesh:
        """Return the mesh of a query, with its barriers."""
        barriers, mesh_id = query.barriers, query.mesh_id
        opened = self._keep((mesh_id, b""), lambda: self.store.open(mesh_id))
        if len(barriers):
            free = opened
            opened = self._keep((mesh_id, barriers.tobytes()), lambda: query.among(free))
        return opened

    def _keep(self, name: tuple[str, bytes], open_mesh: Callable[[], OpenMesh]) -> OpenMesh:
        opened = self.meshes.find(name, open_mesh)
        for unused in self.meshes.surplus(least=1):
            self.fields.forget(unused)
        return opened

    def forget_all(self) -> None:
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


def _make_mesh(origin: MeshOrigin, max_faces: int) -> gc.TriangleMesh:
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

# pebble calls module functions: the state of the process has to live beside them.
_worker: Worker | None = None


def initialize(
    config: WorkerConfig, stop_number: c_longlong, pid: c_longlong, progress: c_double
) -> None:
    """Make this process a worker; called once, by its pool."""
    global _worker  # noqa: PLW0603
    setproctitle(TITLE)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    os.nice(config.niceness)
    _worker = Worker(config, stop_number, progress)
    pid.value = os.getpid()


def warm_up() -> None:
    """Compile the kernels, or load them; from then on memory is limited."""
    gc.warm_up()
    freeze()  # what is loaded now stays: a collection that looks through it takes 90 ms
    limit_memory(_this_worker().settings.worker_memory_bytes)


def do(number: int, work: Work) -> Outcome:
    """Do ``work``; what goes wrong is a value, since not every exception survives a pipe."""
    worker = _this_worker()
    try:
        return worker.do(number, work)
    except gc.errors.Cancelled:
        return None
    except MemoryError as error:
        worker.forget_all()  # what is kept counts as well
        limit, setting = worker.settings.worker_memory_bytes, variable_of("worker_memory_bytes")
        return replace(problem_of(error), limit=limit, setting=setting)
    except Exception as error:
        problem = problem_of(error)
        if problem.code == "internal_error":
            logger.exception("a worker failed at %s", work)
        return problem


def _this_worker() -> Worker:
    assert _worker is not None, "the pool calls initialize first"  # noqa: S101
    return _worker


def _die_with_parent() -> None:
    # The sentinel is the read end of a pipe whose other end closes with the parent, however that
    # ends; PR_SET_PDEATHSIG would fire already when the parent's *thread* that started us ends.
    parent = parent_process()
    assert parent is not None, "a worker has a parent"  # noqa: S101
    connection.wait([parent.sentinel])
    os._exit(1)
