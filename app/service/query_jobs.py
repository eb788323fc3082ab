"""Queries that are answered by jobs, at once or when an answer takes long."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import structlog
from anyio import CapacityLimiter, to_thread

from app.encoding import Representation
from app.engine.interface import ProgressCallback
from app.errors import ProblemError, problem, problem_of
from app.jobs import Job, JobManager, JobSpec
from app.queries import KINDS, MatrixQuery, MeshSize, Query, fingerprint
from app.service.answering import Answered, Answering
from app.service.progress import LatestProgress
from app.service.request_context import RequestContext
from app.service.time_limit import time_limit
from app.settings import Settings
from app.store.mesh_catalog import MeshCatalog
from app.store.results import Result, ResultStore

logger = structlog.get_logger(module=__name__)

_STORE_PAUSE_S = 1.0
"""Seconds between two attempts of a job while the object store is away"""

SizeOf = Callable[[str], Awaitable[MeshSize]]
"""Returns the size of a mesh, by its id"""


class _Begun:
    """An answer that is under way, for whoever takes it first."""

    def __init__(self, answering: "asyncio.Task[Answered]") -> None:
        self._answering: asyncio.Task[Answered] | None = answering

    def take(self) -> "asyncio.Task[Answered] | None":
        """Return the answer under way; None where it was taken before."""
        answering, self._answering = self._answering, None
        return answering


class QueryJobs:
    """Makes jobs of queries, and computes their answers, again after a restart."""

    def __init__(
        self,
        settings: Settings,
        answering: Answering,
        jobs: JobManager,
        catalog: MeshCatalog,
        results: ResultStore,
        size_of: SizeOf,
    ) -> None:
        self._settings = settings
        self._answering = answering
        self._jobs = jobs
        self._catalog = catalog
        self._results = results
        self._size_of = size_of
        self._reading = CapacityLimiter(1)

    async def submit(self, query: Query[Any], context: RequestContext, key: str | None) -> Job:
        """Accept a job that answers a query, or return the job with the idempotency key."""
        query.check_answer(self._settings, as_job=True)
        self._answering.engine.refuse_when_full(context.caller.name)
        self._results.refuse_without_room(context.caller.owner, self._room(query))

        async def solve(on_progress: ProgressCallback) -> Result:
            promised = partial(
                self._promised, query, context.caller.name, context.caller.owner, on_progress
            )
            return await self._patiently(promised)

        return await self._jobs.submit(_spec_of(query, context, key), query.written, solve)

    async def answer_or_submit(
        self,
        query: Query[Any],
        context: RequestContext,
        wait_s: float,
        key: str | None,
        *,
        as_file: bool,
    ) -> Answered | Job:
        """Answer a query, by a job if that takes longer than the wait.

        The job goes on with the work that was begun.
        """
        client = context.caller.name
        self._answering.engine.refuse_when_full(client)
        progress = LatestProgress()
        answering = asyncio.create_task(
            self._answering.find_or_compute(query, client, progress, is_promised=True)
        )
        begun = _Begun(answering)

        async def attempt() -> Result:
            first = begun.take()
            if first is None:
                return await self._promised(query, client, context.caller.owner, progress)
            result, _ = await first
            return await self._results.with_files(result)

        async def solve(on_progress: ProgressCallback) -> Result:
            progress.follow(on_progress)
            return await self._patiently(attempt)

        try:
            await asyncio.wait({answering}, timeout=min(wait_s, context.deadline_s))
            if not answering.done():
                self._results.refuse_without_room(context.caller.owner, self._room(query))
                spec = _spec_of(query, context, key)
                job = await self._jobs.submit(spec, query.written, solve)
                if job.spec is not spec:  # an earlier one with the same idempotency key
                    self._abandon(begun)
                return job
        except BaseException:
            self._abandon(begun)
            raise
        result, seconds = answering.result()
        return await self._results.with_files(result) if as_file else result, seconds

    def _abandon(self, begun: _Begun) -> None:
        """Stop an answer that nobody will send, unless a job has taken it."""
        answering = begun.take()
        if answering is not None:
            answering.cancel()
            answering.add_done_callback(self._release)

    def _release(self, answered: "asyncio.Task[Answered]") -> None:
        if not answered.cancelled() and answered.exception() is None:
            self._results.release(answered.result()[0])

    async def solve_again(
        self, spec: JobSpec, written: bytes, on_progress: ProgressCallback
    ) -> Result:
        """Compute the answer of a job that was under way when the service ended."""
        representation = Representation(spec.media_type, spec.dtype, spec.coding)

        async def attempt() -> Result:
            with self._catalog.pinned(spec.mesh_id):
                size = await self._size_of(spec.mesh_id)
                # One at a time: each may take a tenth of a second, and others want to be served.
                query = await to_thread.run_sync(
                    self._stored_query, spec, size, written, limiter=self._reading
                )
                query = query.answered_as(representation)
                return await self._promised(query, spec.client, spec.owner, on_progress)

        return await self._patiently(attempt)

    async def _patiently(self, attempt: Callable[[], Awaitable[Result]]) -> Result:
        """Return the answer of a job, which waits while the object store is away."""
        async with time_limit(self._settings, self._settings.job_deadline_s, "job_deadline_s"):
            while True:
                try:
                    return await attempt()
                except (OSError, ProblemError) as error:
                    if problem_of(error).code != "store_unavailable":
                        raise
                    logger.warning("job waits, since the store does not answer", error=str(error))
                await asyncio.sleep(_STORE_PAUSE_S)

    async def _promised(
        self, query: Query[Any], client: str, owner: str | None, on_progress: ProgressCallback
    ) -> Result:
        """Answer the query of a job, with files, for which room is reserved before."""
        with self._results.reserving(owner, self._room(query)):
            result, _ = await self._answering.find_or_compute(
                query, client, on_progress, is_promised=True
            )
            return await self._results.with_files(result)

    def _room(self, query: Query[Any]) -> int:
        """Return the bytes to reserve for an answer; a matrix in parts reserves its own."""
        if isinstance(query, MatrixQuery) and query.is_in_parts(self._settings, as_job=True):
            return 0
        return query.rough_bytes()

    def _stored_query(self, spec: JobSpec, size: MeshSize, written: bytes) -> Query[Any]:
        """Return the query of a job, which an older release may have written."""
        try:
            kind = KINDS[spec.kind]
            request = kind.model.model_validate_json(written)
        except (KeyError, ValueError) as error:
            detail = "this release of the service cannot read the query of the job"
            raise problem("engine_unavailable", detail, hint="send the query again") from error
        return kind.ask(spec.mesh_id, size, request, self._settings)


def _spec_of(query: Query[Any], context: RequestContext, key: str | None) -> JobSpec:
    representation = query.representation
    return JobSpec(
        owner=context.caller.owner,
        kind=query.kind,
        mesh_id=query.mesh_id,
        media_type=representation.media_type,
        dtype=representation.dtype,
        coding=representation.coding,
        client=context.caller.name,
        fingerprint=fingerprint(query),
        idempotency_key=key,
        request_id=context.request_id,
    )
