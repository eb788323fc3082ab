"""Answers to queries: from the store, or computed by a worker.

A query takes these steps, one type for each::

    wire model   the body of a request, such as ``DistancesRequest``          app.schemas
    Query        the validated query, and the form to answer in               app.queries
    Task         ``RunQuery``, the work of a worker, and its scheduling       app.engine
    Answer       the members of the answer, as the query's solver found       app.encoding
    Result       the body and its ``ResultManifest``, in memory or files      app.store
    TaskResult   the result on its way back, with the seconds it took         app.engine

Task to TaskResult are skipped where the store has the result. A ``Job`` runs the same steps after
its request has ended, and records the name of the result.
"""

from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any

from app.engine.interface import Engine, ProgressCallback
from app.engine.single_flight import SingleFlight
from app.engine.work import RunQuery, Task, TaskResult
from app.queries import MatrixQuery, Query, result_key
from app.service.matrix_parts import MatrixInParts
from app.service.progress import ignore_progress
from app.service.request_context import RequestContext
from app.service.time_limit import time_limit
from app.settings import Settings
from app.store.mesh_catalog import MeshCatalog
from app.store.results import Result, ResultStore, result_name

PhaseSeconds = Mapping[str, float]
"""Seconds of each phase of the work; empty where the store had the answer"""
Answered = tuple[Result, PhaseSeconds]
"""A result, to be released to the store of results once it has been sent, and its seconds"""
_Run = Callable[[ProgressCallback], Awaitable[TaskResult]]
"""The computation of an answer, which reports its progress"""


class Answering:
    """Finds or computes the answers to queries; the same query is computed once at a time."""

    def __init__(
        self,
        settings: Settings,
        catalog: MeshCatalog,
        results: ResultStore,
        engine: Engine,
        *,
        is_shared: bool,
    ) -> None:
        self.engine = engine
        self._settings = settings
        self._catalog = catalog
        self._results = results
        self._is_shared = is_shared
        self._flights: SingleFlight[TaskResult] = SingleFlight()
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
            result, seconds = await self.find_or_compute(
                query, context.caller.name, ignore_progress
            )
            if as_file:
                result = await self._results.with_files(result)
            return result, seconds

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
            # Small work costs less than to look for what another service has computed.
            if self._is_shared and not query.is_small:
                await self._results.index(name)
            stored = await self._results.find(name)
            self.lookups["miss" if stored is None else "hit"] += 1
            if stored is not None:
                return stored, {}
            counted = partial(self._run, run, query.kind)
            done = await self._flights.join(name, counted, on_progress, is_promised=is_promised)
            assert done.result is not None, "this kind of work answers"  # noqa: S101
            result = self._results.add(done.result)
            return result, done.seconds

    def _computation(
        self, query: Query[Any], client: str, *, is_promised: bool
    ) -> tuple[str, _Run]:
        """Return the name of the result of a query, and what computes it."""
        key = result_key(query)
        if isinstance(query, MatrixQuery) and query.is_in_parts(self._settings, as_job=is_promised):
            # In parts a sparse matrix has no limit of cells: it is another answer than in memory.
            name = result_name(query.mesh_id, f"{key}.parts")
            parts = MatrixInParts(query, client, name, self.engine, self._results)
            return name, parts.run
        name = result_name(query.mesh_id, key)
        work = RunQuery(query, name)
        task = Task(work, client, query.affinity_keys, query.is_small, is_promised)
        return name, partial(self.engine.run, task)

    async def _run(self, run: _Run, kind: str, on_progress: ProgressCallback) -> TaskResult:
        done = await run(on_progress)
        self.solves[kind] += 1
        self.solve_seconds[kind] += done.seconds["compute"]
        return done
