"""A worker: it does one piece of work at a time, with meshes and fields cached."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter, time_ns
from typing import Any, NamedTuple

import numpy as np
import structlog
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import JSON, array_headers, encode, npy_parts, too_large_for
from app.engine.memory import refuse_beyond_limit
from app.engine.mesh_json import read_json_mesh
from app.engine.priority import low_priority_thread
from app.engine.signals import Signals
from app.engine.work import (
    ComputePart,
    JoinParts,
    MeshFromCut,
    MeshFromFile,
    MeshFromSample,
    Outcome,
    RunQuery,
    StoreMesh,
    TaskResult,
    Work,
)
from app.errors import problem_of, too_large_unpacked
from app.queries import (
    SMALL_SECONDS,
    CutQuery,
    ExecutionContext,
    FieldCache,
    Query,
    Unwritten,
    code_version,
)
from app.queries.cut import arrays_of
from app.queries.validation import check_json_size, invalid_fields, naming
from app.settings import Settings
from app.store.fields import FieldStore
from app.store.lru_cache import LRUCache
from app.store.meshes import CutFrom, MeshStore, OpenMesh, WrittenMesh
from app.store.results import Buffer, body_path, write_result, write_result_file
from app.store.scratch import most_unpacked
from app.tracing import Period

logger = structlog.get_logger(module=__name__)

REACHED = "Geodesic-Reached"
"""Header of a part of a matrix: the number of finite distances"""


@dataclass(frozen=True)
class WorkerConfig:
    """The configuration of a worker process."""

    settings: Settings
    results: Path


class _Matrix(NamedTuple):
    """The matrix of the latest part."""

    opened: OpenMesh
    question: tuple[bytes, str]
    """The query as JSON, and the type of numbers"""
    parts: gc.MatrixParts


@dataclass
class Worker:
    """The state of a worker process: open meshes and fields, cached while they fit."""

    config: WorkerConfig
    signals: Signals

    def __post_init__(self) -> None:
        self.settings = self.config.settings
        self.store = MeshStore(self.settings.folder)
        self.meshes: LRUCache[tuple[str, bytes], OpenMesh]
        """Open meshes by id and barriers"""
        self.meshes = LRUCache(self.settings.worker_mesh_bytes, lambda opened: opened.nbytes)
        self._stored = FieldStore(self.settings.folder, self.settings.fields_bytes)
        self.fields = FieldCache(self.settings.worker_field_bytes, self._stored, code_version())
        self._matrix: _Matrix | None = None
        self._writer = low_priority_thread()
        self._before = Signals.from_buffer_copy(self.signals)  # what former workers have counted

    def do(self, number: int, work: Work) -> Outcome:
        """Do ``work``; an error becomes a value, since not every exception can be pickled."""
        try:
            return self._do(number, work)
        except gc.errors.Cancelled:
            return None
        except MemoryError as error:
            self._forget_all()  # caches count as well
            limit, setting = self.settings.worker_memory_bytes, "worker_memory_bytes"
            return replace(problem_of(error), limit=limit, setting=setting)
        except Exception as error:
            problem = problem_of(error)
            if problem.code == "internal_error":
                logger.exception("work failed", work=type(work).__name__)
            return problem

        finally:
            self.signals.mesh_evictions = self._before.mesh_evictions + self.meshes.evictions
            self.signals.field_evictions = self._before.field_evictions + self.fields.evictions

    def _do(self, number: int, work: Work) -> TaskResult:
        """Do ``work`` until the number of the work to stop reaches ``number``."""
        clock = Clock()

        def is_cancelled() -> bool:
            return bool(self.signals.stop_number >= number)

        match work:
            case StoreMesh():
                return self._store(work, clock, is_cancelled)
            case RunQuery():
                try:
                    return self._answer(work, clock, is_cancelled)
                finally:
                    fields = self.fields.take_unwritten()
                    if fields:
                        self._writer.submit(self._write_fields, fields)  # while the answer is sent
            case ComputePart():
                return self._compute_part(work, clock, is_cancelled)
            case JoinParts():
                return self._join_parts(work, clock, is_cancelled)

    def _store(self, work: StoreMesh, clock: "Clock", cancel: Callable[[], bool]) -> TaskResult:
        given = work.mesh_input
        if isinstance(given, MeshFromCut):
            return self._store_cut(work, given.query, clock, cancel)
        with _in_scratch_folder(cancel):
            with clock.phase("load"):
                mesh = _make_mesh(given, self.settings, cancel)
            written = self._write_aside(mesh, work, clock, cancel)
        return TaskResult(clock.seconds, clock.periods, mesh=written)

    def _store_cut(
        self, work: StoreMesh, query: CutQuery, clock: "Clock", cancel: Callable[[], bool]
    ) -> TaskResult:
        with clock.phase("load"):
            opened = self._open(query)
        with clock.phase("compute"):
            cut, about = query.make(opened, self._context(cancel))
            _refuse_size(len(cut.vertices), len(cut.faces), self.settings)
            _stop_if(cancel)
            mesh = cut.mesh
        with _in_scratch_folder(cancel):
            origin = CutFrom(query.mesh_id, arrays_of(cut))
            written = self._write_aside(mesh, work, clock, cancel, origin)
        return TaskResult(clock.seconds, clock.periods, mesh=written, about_mesh=about)

    def _write_aside(
        self,
        mesh: gc.TriangleMesh,
        work: StoreMesh,
        clock: "Clock",
        cancel: Callable[[], bool],
        cut_from: CutFrom | None = None,
    ) -> WrittenMesh:
        check = partial(_stop_if, cancel)
        check()
        with clock.phase("store"):
            return self.store.write_aside(mesh, work.folder, work.name, check, cut_from)

    def _context(self, cancel: Callable[[], bool]) -> ExecutionContext:
        settings = self.settings
        return ExecutionContext(
            cancel,
            self._report,
            self.fields,
            settings.query_memory_bytes,
            settings.max_json_values,
            settings.max_matrix_cells,
            settings.max_sources,
        )

    def _answer(self, work: RunQuery, clock: "Clock", cancel: Callable[[], bool]) -> TaskResult:
        settings, context = self.settings, self._context(cancel)
        with clock.phase("load"):
            opened = self._open(work.query)
        with clock.phase("compute"):
            answer = work.query.answer(opened, context)
        if work.query.representation.media_type == JSON:
            check_json_size(answer.values, settings.max_json_values, work.query.hint)
        with clock.phase("encode"):
            parts, headers = encode(answer, work.query.representation)
            result = write_result(
                self.config.results,
                work.result_name,
                _stopped_if(cancel, parts),
                headers,
                code_version(),
                is_cheap=clock.seconds["compute"] < SMALL_SECONDS,
            )
        return TaskResult(clock.seconds, clock.periods, result=result)

    def _compute_part(
        self, work: ComputePart, clock: "Clock", cancel: Callable[[], bool]
    ) -> TaskResult:
        with clock.phase("load"):
            opened = self._open(work.query)
        with clock.phase("compute"), _refusing_overflow(work.query.representation.dtype):
            parts = self._parts_of(work, opened, cancel)
            rows = parts.compute(
                work.part,
                progress=self._report,
                cancel=cancel,
                memory_limit=self.settings.query_memory_bytes,
            )
        with clock.phase("encode"):
            result = write_result(
                self.config.results,
                work.result_name,
                _stopped_if(cancel, npy_parts(rows)),
                {REACHED: str(parts.reached(rows))},
                code_version(),
                is_cheap=False,
            )
        return TaskResult(clock.seconds, clock.periods, result=result)

    def _join_parts(
        self, work: JoinParts, clock: "Clock", cancel: Callable[[], bool]
    ) -> TaskResult:
        root = self.config.results
        with clock.phase("load"):
            opened = self._open(work.query)

        def part(number: int) -> NDArray[Any]:
            _stop_if(cancel)
            rows: NDArray[Any] = np.load(body_path(root, work.parts[number]), mmap_mode="r")
            return rows

        with clock.phase("compute"):
            parts = self._parts_of(work, opened, cancel)
            answer = work.query.answer_of_parts(opened, work.reached, cancel)
        with clock.phase("encode"):
            headers = array_headers(answer, np.dtype(work.query.representation.dtype), parts.shape)
            write, check = partial(parts.write, part=part), partial(_stop_if, cancel)
            name = work.result_name
            result = write_result_file(root, name, write, headers, code_version(), check)
        return TaskResult(clock.seconds, clock.periods, result=result)

    def _parts_of(
        self, work: ComputePart | JoinParts, opened: OpenMesh, cancel: Callable[[], bool]
    ) -> gc.MatrixParts:
        """Return the parts of a matrix; many of them come one after the other."""
        made, question = self._matrix, (work.query.written, work.query.representation.dtype)
        if made is None or made.opened is not opened or made.question != question:
            parts = work.query.parts(opened, cancel)
            made = self._matrix = _Matrix(opened, question, parts)
        return made.parts

    def _write_fields(self, fields: Sequence[Unwritten]) -> None:
        self.fields.write(fields)
        removed = self._before.stored_field_evictions + self._stored.evictions
        self.signals.stored_field_evictions = removed

    def _report(self, share: float) -> None:
        self.signals.progress = share

    def _open(self, query: Query[Any]) -> OpenMesh:
        """Return the open mesh of a query, with its barriers."""
        barriers, mesh_id = query.barriers, query.mesh_id
        opened = self._cached((mesh_id, b""), lambda: self.store.open(mesh_id))
        if len(barriers):
            without_barriers = opened
            opened = self._cached(
                (mesh_id, barriers.tobytes()), lambda: query.with_barriers(without_barriers)
            )
        return opened

    def _cached(self, name: tuple[str, bytes], open_mesh: Callable[[], OpenMesh]) -> OpenMesh:
        opened = self.meshes.find(name, open_mesh)
        if not self.store.is_current(opened):
            self._close(name)
            opened = self.meshes.find(name, open_mesh)
        for evicted in self.meshes.evict(spare=1):
            self._forget(evicted)
        return opened

    def _close(self, name: tuple[str, bytes]) -> None:
        self._forget(name)
        self.meshes.drop(name)

    def _forget(self, name: tuple[str, bytes]) -> None:
        """Drop what was made of a mesh."""
        self.fields.forget(name)
        if self._matrix is not None and self._matrix.opened.name == name:
            self._matrix = None

    def _forget_all(self) -> None:
        """Empty all caches."""
        for name in list(self.meshes):
            self._close(name)


def _stop_if(cancel: Callable[[], bool]) -> None:
    if cancel():
        raise gc.errors.Cancelled("cancelled between two steps of the work")


def _stopped_if(cancel: Callable[[], bool], parts: Iterable[Buffer]) -> Iterator[Buffer]:
    """Yield the parts of a body; between two of them the work can be stopped."""
    for part in parts:
        _stop_if(cancel)
        yield part


@contextmanager
def _refusing_overflow(dtype: str) -> Iterator[None]:
    with np.errstate(over="raise"):
        try:
            yield
        except FloatingPointError:
            raise too_large_for(dtype) from None


class Clock:
    """Stopwatch of the phases of a piece of work."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.periods: dict[str, Period] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the block as a phase."""
        start, start_ns = perf_counter(), time_ns()
        yield
        self.seconds[name] = perf_counter() - start
        self.periods[name] = Period(start_ns, time_ns())


@contextmanager
def _in_scratch_folder(cancel: Callable[[], bool]) -> Iterator[None]:
    """Take missing files for a cancelled request, which removes its upload and scratch folder."""
    try:
        yield
    except FileNotFoundError:
        if cancel():
            raise gc.errors.Cancelled from None
        raise


def _refuse_size(vertices: int, faces: int, settings: Settings) -> None:
    if faces > settings.max_faces:
        raise gc.errors.TooManyFaces(faces, settings.max_faces)
    if vertices > settings.max_vertices:
        raise gc.errors.TooManyVertices(vertices, settings.max_vertices)


def _make_mesh(
    mesh_input: MeshFromFile | MeshFromSample, settings: Settings, cancel: Callable[[], bool]
) -> gc.TriangleMesh:
    mesh = _read_mesh(mesh_input, settings, cancel)
    _refuse_size(len(mesh.vertices), 0, settings)  # which lengths alone do not tell before
    return mesh


def _read_mesh(
    mesh_input: MeshFromFile | MeshFromSample, settings: Settings, cancel: Callable[[], bool]
) -> gc.TriangleMesh:
    max_faces, max_vertices = settings.max_faces, settings.max_vertices
    faces: NDArray[np.int32] | NDArray[np.int64]
    vertices: NDArray[np.float64] | None
    lengths: NDArray[np.float64] | None = None
    sample: gc.TriangleMesh | None = None
    match mesh_input:
        case MeshFromSample():
            sample = gc.samples.SAMPLES[mesh_input.sample](mesh_input.faces)
            vertices, faces = sample.vertices, sample.faces
        case MeshFromFile(path=path, file_type="json"):
            refuse_beyond_limit(_JSON_GROWS * path.stat().st_size)
            faces, vertices, lengths = read_json_mesh(path.read_bytes())
        case MeshFromFile(path=path):
            max_bytes = most_unpacked(path.stat().st_size, settings.max_upload_bytes)
            try:
                with naming((gc.errors.InvalidArgument, _MERGE)):
                    return gc.load_mesh(
                        path,
                        mesh_input.file_type,
                        mesh_input.merge,
                        max_faces=max_faces,
                        max_vertices=max_vertices,
                        max_bytes=max_bytes,
                        cancel=cancel,
                    )
            except gc.errors.FileTooLarge:
                raise too_large_unpacked(max_bytes, settings.max_upload_bytes) from None
    _refuse_size(0 if vertices is None else len(vertices), len(faces), settings)
    if sample is not None and mesh_input.merge == "none":
        return sample
    _stop_if(cancel)
    if lengths is None:
        assert vertices is not None, "one of both tells the lengths of edges"  # noqa: S101
        return gc.TriangleMesh(vertices, faces, merge=mesh_input.merge)
    if mesh_input.merge != "none":
        message = "merge must be 'none' for a surface that is given by its lengths"
        raise invalid_fields([_MERGE], message)
    return gc.TriangleMesh.from_lengths(faces, lengths, vertices)


_MERGE = "/query/merge"
"""Where the parameter is that says how vertices are merged"""


_JSON_GROWS = 40
"""Bytes that orjson takes for each byte of JSON: at most 37 were measured. Without, it crashes."""
