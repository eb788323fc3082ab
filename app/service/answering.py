"""Answers to queries: from the store, or computed by a worker.

A query takes these steps, one type for each::

    wire model   the body of a request, such as ``DistancesRequest``          app.schemas
    Query        the validated query, and the form to answer in               app.queries
    Task         ``RunQuery``, the work of a worker, and its scheduling       app.engine
    Answer       the members of the answer, as the query's solver found       app.encoding
    Result       the body and its ``ResultManifest``, in memory or files      app.store
    TaskResult   the result on its way back, with the seconds it took         app.engine

Task to TaskResult are skipped where the store has the result. A cut ends with a mesh in the store,
and a result that names it. A ``Job`` runs the same steps after
its request has ended, and records the name of the result.
"""

from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, NamedTuple

from app.encoding import encode
from app.engine.interface import Engine, ProgressCallback
from app.engine.single_flight import SingleFlight
from app.engine.work import MeshFromCut, RunQuery, Task, TaskResult
from app.queries import CutQuery, MatrixQuery, Query, code_version, result_key
from app.service.matrix_parts import MatrixInParts
from app.service.mesh_storing import MeshStoring, PhaseSeconds, StoredMesh
from app.service.progress import ignore_progress
from app.service.request_context import RequestContext
from app.service.time_limit import time_limit
from app.settings import Settings
from app.store.mesh_catalog import MeshCatalog
from app.store.results import Result, ResultStore, in_memory_result, result_name


class Answered(NamedTuple):
    """An answer."""

    result: Result
    """To be released to the store of results once it has been sent"""
    seconds: PhaseSeconds
    mesh: StoredMesh | None = None
    """The mesh that a cut has made"""


_Run = Callable[[ProgressCallback], Awaitable[Answered]]
"""The computation of an answer, which reports its progress"""


class Answering:
    """Finds or computes the answers to queries; the same query is computed once at a time."""

    def __init__(
        self,
        settings: Settings,
        catalog: MeshCatalog,
        results: ResultStore,
        engine: Engine,
        mesh_storing: MeshStoring,
        *,
        is_shared: bool,
    ) -> None:
        self.engine = engine
        self._settings = settings
        self._catalog = catalog
        self._results = results
        self._mesh_storing = mesh_storing
        self._is_shared = is_shared
        self._flights: SingleFlight[Answered] = SingleFlight()
        self.lookups = {"hit": 0, "miss": 0}
        """Lookups of results in the store"""
        self.solves: Counter[str] = Counter()
        """Queries that workers answered, by kind"""
        self.solve_seconds: defaultdict[str, float] = defaultdict(float)
        """Seconds of solving, by kind of query"""

    async def answer(
        self, query: Query[Any], context: RequestContext, *, as_file: bool
    ) -> Answered:
        """Return the answer to a query within a deadline, ``as_file`` with files."""
        async with time_limit(self._settings, context.deadline_s):
            found = await self.find_or_compute(query, context.caller.name, ignore_progress)
            if as_file:
                found = found._replace(result=await self._results.with_files(found.result))
            return found

    async def find_or_compute(
        self,
        query: Query[Any],
        client: str,
        on_progress: ProgressCallback,
        *,
        is_promised: bool = False,
    ) -> Answered:
        """Return the answer to a query of a client, whose work the engine counts together.

        A promised one waits however full the queue is.
        """
        with self._catalog.pinned(query.mesh_id):
            query.check_answer(self._settings, as_job=is_promised)
            name, run = self._computation(query, client, is_promised=is_promised)
            stored = await self._find(query, name)
            if stored is not None:
                return Answered(stored, {})
            counted = partial(self._run, run, query.kind)
            done = await self._flights.join(name, counted, on_progress, is_promised=is_promised)
            return done._replace(result=self._results.add(done.result))

    async def _find(self, query: Query[Any], name: str) -> Result | None:
        """Return the stored result of a query; the mesh that a cut made may be gone by now."""
        if isinstance(query, CutQuery):
            return None
        # Small work costs less than to look for what another service has computed.
        if self._is_shared and not query.is_small:
            await self._results.index(name)
        stored = await self._results.find(name)
        self.lookups["miss" if stored is None else "hit"] += 1
        return stored

    def _computation(
        self, query: Query[Any], client: str, *, is_promised: bool
    ) -> tuple[str, _Run]:
        """Return the name of the result of a query, and what computes it."""
        key = result_key(query)
        if isinstance(query, MatrixQuery) and query.is_in_parts(self._settings, as_job=is_promised):
            # In parts a sparse matrix has no limit of cells: it is another answer than in memory.
            name = result_name(query.mesh_id, f"{key}.parts")
            parts = MatrixInParts(query, client, name, self.engine, self._results)
            return name, _answering(parts.run)
        name = result_name(query.mesh_id, key)
        if isinstance(query, CutQuery):
            return name, partial(self._cut, query, name, client, is_promised)
        work = RunQuery(query, name)
        task = Task(work, client, query.affinity_keys, query.is_small, is_promised)
        return name, _answering(partial(self.engine.run, task))

    async def _cut(
        self,
        query: CutQuery,
        name: str,
        client: str,
        is_promised: bool,
        on_progress: ProgressCallback,
    ) -> Answered:
        """Have a mesh cut, and return the answer, which names the new one."""
        stored = await self._mesh_storing.store(
            MeshFromCut(query),
            query.request.name,
            client,
            on_progress,
            affinity_keys=query.affinity_keys,
            is_promised=is_promised,
        )
        answer = query.told(stored.mesh_id, stored.about)
        parts, headers = encode(answer, query.representation)
        result = in_memory_result(name, parts, headers, code_version())
        return Answered(result, stored.seconds, stored)

    async def _run(self, run: _Run, kind: str, on_progress: ProgressCallback) -> Answered:
        done = await run(on_progress)
        self.solves[kind] += 1
        self.solve_seconds[kind] += done.seconds["compute"]
        return done


def _answering(run: Callable[[ProgressCallback], Awaitable[TaskResult]]) -> _Run:
    """Return the computation of an answer by work that ends with a result."""

    async def answered(on_progress: ProgressCallback) -> Answered:
        done = await run(on_progress)
        assert done.result is not None, "this kind of work answers"  # noqa: S101
        return Answered(done.result, done.seconds)

    return answered
