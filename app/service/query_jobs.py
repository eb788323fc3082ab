"""Queries that are answered by jobs, at once or when an answer takes long."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import structlog
from anyio import CapacityLimiter, to_thread

from app.encoding import Representation
from app.engine.interface import ProgressCallback
from app.errors import ProblemError, problem, problem_of
from app.jobs import Job, JobManager, JobSpec
from app.queries import KINDS, MatrixQuery, MeshSize, Query, fingerprint
from app.service.answering import Answered, Answering
from app.service.progress import ignore_progress
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
        self._handing_over: set[asyncio.Task[None]] = set()

    async def submit(self, query: Query[Any], context: RequestContext, key: str | None) -> Job:
        """Accept a job that answers a query, or return the job with the idempotency key."""
        query.check_answer(self._settings, as_job=True)
        self._answering.engine.refuse_when_full(context.caller.name)
        self._results.refuse_without_room(context.caller.name, self._room(query))

        return await self._jobs.submit(_spec_of(query, context, key), query.written)

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

        The job joins the work that was begun.
        """
        client = context.caller.name
        self._answering.engine.refuse_when_full(client)
        answering = asyncio.create_task(
            self._answering.find_or_compute(query, client, ignore_progress, is_promised=True)
        )
        try:
            await asyncio.wait({answering}, timeout=min(wait_s, context.deadline_s))
            if not answering.done():
                self._results.refuse_without_room(context.caller.name, self._room(query))
                job = await self._jobs.submit(_spec_of(query, context, key), query.written)
                handing_over = asyncio.create_task(self._hand_over(answering, job))
                self._handing_over.add(handing_over)
                handing_over.add_done_callback(self._handing_over.discard)
                return job
        except BaseException:
            self._abandon(answering)
            raise
        found = answering.result()
        if as_file:
            found = found._replace(result=await self._results.with_files(found.result))
        return found

    async def _hand_over(self, answering: "asyncio.Task[Answered]", job: Job) -> None:
        """Go on with work until a job has joined it."""
        try:
            async for state in self._jobs.watch(job, 0):
                if state.status != "accepted":
                    return
        finally:
            self._abandon(answering)

    def _abandon(self, answering: "asyncio.Task[Answered]") -> None:
        """Stop an answer that nobody will send, unless others wait for it as well."""
        answering.cancel()
        answering.add_done_callback(self._release)

    def _release(self, answered: "asyncio.Task[Answered]") -> None:
        if not answered.cancelled() and answered.exception() is None:
            self._results.release(answered.result().result)

    async def solve(self, spec: JobSpec, written: bytes, on_progress: ProgressCallback) -> Result:
        """Compute the answer of a job."""
        representation = Representation(spec.media_type, spec.dtype, spec.coding)

        async def attempt() -> Result:
            with self._catalog.pinned(spec.mesh_id):
                size = await self._size_of(spec.mesh_id)
                # One at a time: each may take a tenth of a second, and others want to be served.
                query = await to_thread.run_sync(
                    self._stored_query, spec, size, written, limiter=self._reading
                )
                query = query.answered_as(representation)
                return await self._promised(query, spec.client, on_progress)

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
        self, query: Query[Any], client: str, on_progress: ProgressCallback
    ) -> Result:
        """Answer the query of a job, with files, for which room is reserved before."""
        with self._results.reserving(client, self._room(query)):
            found = await self._answering.find_or_compute(
                query, client, on_progress, is_promised=True
            )
            return await self._results.with_files(found.result)

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
