"""Use cases of the service: meshes in the store, and answers to queries, stored or computed.

A query takes these steps, one type for each::

    wire model      the body of a request, such as ``DistancesRequest``        app.schemas
    QueryRequest    the request: mesh, caller, deadline, preferences           app.http
    Query           the validated question, with a stable hash                 app.queries
    Representation  the form to answer in: media type, dtype, coding           app.encoding
    Task            ``RunQuery``, the work of a worker, and its scheduling     app.engine
    Answer          the members of the answer, as the query's solver found     app.encoding
    Encoded         the parts of the body, and headers                         app.encoding
    Result          the body and its ``ResultManifest``, in memory or files    app.store
    TaskResult      the result on its way back, with the seconds it took       app.engine

Task to TaskResult are skipped where the store has the result. A ``Job`` runs the same steps after
its request has ended, and records the name of the result.
"""

import asyncio
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from gc import collect, freeze
from pathlib import Path
from typing import Any

import structlog
from anyio import CapacityLimiter, to_thread

from app.access import Caller
from app.encoding import Representation
from app.engine.interface import Engine, ProgressCallback
from app.engine.single_flight import SingleFlight
from app.engine.supplied import SuppliedEngine
from app.engine.work import EstimateQuery, MeshInput, RunQuery, StoreMesh, Task, TaskResult
from app.errors import ProblemError, problem, problem_of
from app.jobs import Job, JobManager, JobRepository, JobSpec
from app.queries import KINDS, Estimate, MatrixQuery, MeshSize, Query, fingerprint, result_key
from app.repeating import repeat
from app.service.concurrency import ConcurrencyLimit
from app.service.maintenance import Damage
from app.service.matrix_parts import MatrixInParts
from app.service.progress import LatestProgress, ignore_progress
from app.service.resources import share_arenas
from app.service.scrub import scrubbing
from app.settings import Settings, variable_of
from app.state import Allowances, Database, MeshRecords, Replicas, database_of
from app.store import layout
from app.store.choice import store_of
from app.store.fields import FieldStore
from app.store.interface import Store
from app.store.mesh_catalog import MeshCatalog
from app.store.ownership import Share
from app.store.results import Result, ResultStore, result_name

logger = structlog.get_logger(module=__name__)

_CATALOG_PERIOD_S = 2.0
"""Seconds between two looks at what other services did to meshes, where they are shared"""

_STORE_PAUSE_S = 1.0
"""Seconds between two attempts of a job while the object store is away"""

Manifest = Mapping[str, Any]
PhaseSeconds = Mapping[str, float]
"""Seconds of each phase of the work; empty where the store had the answer"""
Run = Callable[[ProgressCallback], Awaitable[TaskResult]]
"""The computation of an answer, which reports its progress"""


@dataclass(frozen=True)
class RequestContext:
    """The caller of a request, its deadline, and its id."""

    caller: Caller
    deadline_s: float
    request_id: str


@dataclass(frozen=True)
class StoredMesh:
    """A mesh that an upload has put into the store, or found there."""

    manifest: Manifest
    is_new: bool
    seconds: PhaseSeconds


class Service:
    """The parts of a running service, and the use cases that combine them."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.database = _database_of(settings)
        self.store = store_of(settings)
        self.mesh_catalog = MeshCatalog(
            settings.folder,
            self.store.meshes,
            settings.store_bytes,
            evicts=settings.store_evict == "lru",
            quota=settings.quota_bytes,
            shared=MeshRecords(self.database) if self.database.is_shared else None,
        )
        self.results = ResultStore(
            self.store.results, settings.results_bytes, settings.results_memory_bytes
        )
        self.fields = FieldStore(settings.folder, settings.fields_bytes)
        self.engine = _engine(settings, self.store)
        self.engine.on_unclaimed = self.results.index_unclaimed
        replicas = Replicas(self.database) if self.database.is_shared else None
        self.allowances = Allowances(self.database, replicas.id) if replicas else None
        """What callers have taken, where several services count together"""
        self.jobs = JobManager(
            JobRepository(self.database),
            self.results,
            settings.job_ttl,
            settings.quota_jobs,
            replicas,
        )
        self._uploads = ConcurrencyLimit(
            settings.quota_uploads, "quota_exceeded", "uploads", "quota_uploads"
        )
        self.is_leaving = False
        """Whether the service is about to stop: it is not ready, whatever it still answers"""
        self.lookups = {"hit": 0, "miss": 0}
        """Lookups of results in the store"""
        self.solves: Counter[str] = Counter()
        """Queries that workers answered, by kind"""
        self.solve_seconds: defaultdict[str, float] = defaultdict(float)
        """Seconds of solving, by kind of query"""
        self._reading = CapacityLimiter(1)
        self._single_flight: SingleFlight[TaskResult] = SingleFlight()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Own the store, supply workers and run jobs inside the block."""
        share_arenas()
        with self.owning_store() as share:
            is_alone = share is None or share.is_first
            self.mesh_catalog.prepare(is_alone=is_alone)
            self.results.prepare(is_alone=is_alone)
            if is_alone:
                self.fields.prepare(self.mesh_catalog.ids)
            async with self._open_database(share):
                await self.engine.start()
                # Objects of the start live for ever; each full collection over them takes 90 ms.
                collect()
                freeze()
                try:
                    async with (
                        self.jobs.running(self._solve_again),
                        scrubbing(self.settings.folder, self._repair),
                    ):
                        self.results.make_room()  # now it is known which are those of jobs
                        yield
                finally:
                    await self.engine.stop()

    @contextmanager
    def owning_store(self) -> Iterator[Share | None]:
        """Own the store inside the block, or share it where the database is shared.

        Raises ``StoreError`` where the store is not usable, and ``StateError`` where the database
        is not.
        """
        with self.store.owned(is_shared=self.database.is_shared) as share:
            self.database.prepare()
            self.store.claim(self.database.service)
            yield share

    @asynccontextmanager
    async def _open_database(self, share: Share | None) -> AsyncIterator[None]:
        """Open the database inside the block; keep the catalogue up with other services there."""
        await self.database.open()
        following = None
        try:
            if self.database.is_shared:
                if share is None or share.is_first:
                    await self.mesh_catalog.reconcile()
                if share is not None:
                    share.let_others_in()
                following = asyncio.create_task(
                    repeat(self.mesh_catalog.keep_up, _CATALOG_PERIOD_S, "catalogue not kept up")
                )
            yield
        finally:
            if following is not None:
                following.cancel()
            if self.allowances is not None:
                await self.allowances.close()
            await self.database.close()

    def announce_end(self) -> None:
        """Say that the service is not ready, so that no new clients are sent to it."""
        self.is_leaving = True

    def drain(self) -> None:
        """Prepare for the end: finish running work, and refuse new work."""
        self.announce_end()
        self.engine.drain()
        self.jobs.end_events()

    @asynccontextmanager
    async def counting_upload(self, caller: Caller) -> AsyncIterator[None]:
        """Count the block as an upload of a caller, or refuse it with ``quota_exceeded``."""
        if self.allowances is None:
            with self._uploads.counting(caller):
                yield
        else:
            async with self._uploads.counting_for_all(caller, self.allowances):
                yield

    async def add_mesh(
        self, mesh_input: MeshInput, name: str | None, context: RequestContext
    ) -> StoredMesh:
        """Have a worker read or make a mesh, and store it under a name, if it has one."""
        async with (
            self.mesh_catalog.scratch_folder() as scratch,
            self.time_limit(context.deadline_s),
        ):
            work = StoreMesh(mesh_input, scratch / "mesh", context.caller.owner, name)
            task = Task(work, context.caller.name)
            while True:
                done = await self.engine.run(task, ignore_progress)
                written = done.mesh
                assert written is not None, "this kind of work writes a mesh"  # noqa: S101
                change = await self.mesh_catalog.add(written)
                if change is not None:
                    break
        for mesh_id in change.evicted:
            await self._forget(mesh_id)
        if change.is_healed:
            await self._forget(written.mesh_id)
        return StoredMesh(written.manifest, change.is_new, done.seconds)

    async def manifest(self, mesh_id: str) -> Manifest:
        """Return the manifest of a mesh, and mark the mesh as used."""
        self.mesh_catalog.use(mesh_id)
        return await self.store.meshes.manifest(mesh_id)

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read, and mark the mesh as used."""
        self.mesh_catalog.use(mesh_id)
        return await self.store.meshes.array_file(mesh_id, name)

    async def size(self, mesh_id: str) -> MeshSize:
        """Return the counts of a mesh that checks and estimates need."""
        report = (await self.store.meshes.manifest(mesh_id))["report"]
        return MeshSize(report["vertices"], report["faces"], report["mean_edge_length"])

    async def list_meshes(self, limit: int, after: str) -> tuple[list[Manifest], str | None]:
        """Return the manifests of ``limit`` meshes after an id, and the id to go on after."""
        ids, more = await self.store.meshes.page(after, limit)
        found = await asyncio.gather(*map(self._manifest_if_any, ids))
        return [each for each in found if each is not None], ids[-1] if more else None

    async def _manifest_if_any(self, mesh_id: str) -> Manifest | None:
        # Left out: meshes deleted meanwhile, and damaged ones. Reading those alone says why.
        with suppress(ProblemError):
            return await self.store.meshes.manifest(mesh_id)
        return None

    async def delete_mesh(self, mesh_id: str, caller: Caller) -> None:
        """Remove a mesh and its results; afterwards no service that shares the store has it."""
        if not caller.may_delete(await self._owner(mesh_id)):
            raise problem("forbidden", f"mesh {mesh_id} was stored with another API key")
        await self.mesh_catalog.delete(mesh_id)
        await self._forget(mesh_id)
        if self.database.is_shared:
            await asyncio.sleep(self.store.meshes.trusted_s)

    async def _owner(self, mesh_id: str) -> str | None:
        """Return the owner of a mesh; None where it has none, or its manifest is damaged."""
        try:
            owner: str | None = (await self.store.meshes.manifest(mesh_id))["owner"]
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            return None
        return owner

    async def _forget(self, mesh_id: str) -> None:
        """Remove results and fields of a mesh that is gone, or that was damaged.

        A disk may damage a mapped file without a trace in its status. Then nobody knows which
        answers came before.
        """
        self.results.forget_mesh(mesh_id)
        await to_thread.run_sync(self.fields.forget_mesh, mesh_id)

    async def _repair(self, damage: Damage) -> None:
        """Make sure that nothing damaged is used, though its file's status looks as before."""
        match damage.folder:
            case layout.MESHES:
                await self.store.meshes.distrust(damage.name)
                await self._forget(damage.name)
            case layout.RESULTS:
                self.results.discard(damage.name)
            case layout.FIELDS:
                await to_thread.run_sync(self.fields.discard, damage.name)

    async def answer(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        context: RequestContext,
        *,
        as_file: bool,
    ) -> tuple[Result, PhaseSeconds]:
        """Answer a query to a mesh of this ``size``, from the store or by a worker.

        The caller releases the result to ``results`` once it has been sent.
        """
        async with self.time_limit(context.deadline_s):
            client = context.caller.name
            result, seconds = await self._answer(
                query, size, representation, client, ignore_progress
            )
            if as_file:
                result = await self.results.with_files(result)
            return result, seconds

    async def estimate(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        context: RequestContext,
    ) -> tuple[Estimate, PhaseSeconds]:
        """Have a worker, which has the mesh, estimate the cost of the answer to a query."""
        query.check_answer(representation, size, self.settings, as_job=True)
        task = Task(
            EstimateQuery(query, representation),
            context.caller.name,
            query.affinity_keys,
            is_small=True,
        )
        async with self.time_limit(context.deadline_s):
            with self.mesh_catalog.pinned(query.mesh_id):
                done = await self.engine.run(task, ignore_progress)
        assert done.estimate is not None, "this kind of work estimates"  # noqa: S101
        return done.estimate, done.seconds

    async def submit(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        context: RequestContext,
        idempotency_key: str | None,
    ) -> Job:
        """Accept a job that answers a query, or return the job with the same idempotency key."""
        query.check_answer(representation, size, self.settings, as_job=True)
        client = context.caller.name
        self.engine.refuse_when_full(client)

        async def solve(on_progress: ProgressCallback) -> Result:
            return await self._patiently(
                partial(self._promised, query, size, representation, client, on_progress)
            )

        spec = self._job_spec(query, representation, context, idempotency_key)
        return await self.jobs.submit(spec, query.written, solve)

    async def answer_or_submit(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        context: RequestContext,
        wait_s: float,
        idempotency_key: str | None,
        *,
        as_file: bool,
    ) -> tuple[Result, PhaseSeconds] | Job:
        """Answer a query, by a job if that takes longer than the wait.

        The job goes on with the work that was begun. The caller releases a result to
        ``results`` once it has been sent.
        """
        client = context.caller.name
        self.engine.refuse_when_full(client)
        progress = LatestProgress()
        answering = asyncio.create_task(
            self._answer(query, size, representation, client, progress, is_promised=True)
        )

        begun = [answering]
        """Empty once a job has taken the work over, or nobody wants it any more"""

        async def attempt() -> Result:
            if begun:
                result, _ = await begun.pop()
                return await self.results.with_files(result)
            return await self._promised(query, size, representation, client, progress)

        async def solve(on_progress: ProgressCallback) -> Result:
            progress.follow(on_progress)
            return await self._patiently(attempt)

        try:
            await asyncio.wait({answering}, timeout=min(wait_s, context.deadline_s))
            if not answering.done():
                spec = self._job_spec(query, representation, context, idempotency_key)
                job = await self.jobs.submit(spec, query.written, solve)
                if job.spec is not spec:  # an earlier one with the same idempotency key
                    self._abandon(begun.pop())
                return job
        except BaseException:
            if begun:
                self._abandon(begun.pop())
            raise
        result, seconds = answering.result()
        return await self.results.with_files(result) if as_file else result, seconds

    def _abandon(self, answering: "asyncio.Task[tuple[Result, PhaseSeconds]]") -> None:
        """Stop an answer that nobody will send."""
        answering.cancel()
        answering.add_done_callback(self._release)

    def _release(self, answered: "asyncio.Task[tuple[Result, PhaseSeconds]]") -> None:
        if not answered.cancelled() and answered.exception() is None:
            self.results.release(answered.result()[0])

    def _job_spec(
        self,
        query: Query[Any],
        representation: Representation,
        context: RequestContext,
        idempotency_key: str | None,
    ) -> JobSpec:
        return JobSpec(
            owner=context.caller.owner,
            kind=query.kind,
            mesh_id=query.mesh_id,
            media_type=representation.media_type,
            dtype=representation.dtype,
            coding=representation.coding,
            client=context.caller.name,
            fingerprint=fingerprint(query, representation),
            idempotency_key=idempotency_key,
            request_id=context.request_id,
        )

    async def _solve_again(
        self, spec: JobSpec, written: bytes, on_progress: ProgressCallback
    ) -> Result:
        """Compute the answer of a job that was under way when the service ended."""
        representation = Representation(spec.media_type, spec.dtype, spec.coding)

        async def attempt() -> Result:
            with self.mesh_catalog.pinned(spec.mesh_id):
                size = await self.size(spec.mesh_id)
                # One at a time: each may take a tenth of a second, and others want to be served.
                query = await to_thread.run_sync(
                    self._stored_query, spec, size, written, limiter=self._reading
                )
                return await self._promised(query, size, representation, spec.client, on_progress)

        return await self._patiently(attempt)

    async def _patiently(self, attempt: Callable[[], Awaitable[Result]]) -> Result:
        """Return the answer of a job, which waits while the object store is away."""
        async with self.time_limit(self.settings.job_deadline_s, "job_deadline_s"):
            while True:
                try:
                    return await attempt()
                except (OSError, ProblemError) as error:
                    if problem_of(error).code != "store_unavailable":
                        raise
                    logger.warning("job waits, since the store does not answer", error=str(error))
                await asyncio.sleep(_STORE_PAUSE_S)

    async def _promised(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        client: str,
        on_progress: ProgressCallback,
    ) -> Result:
        """Answer the query of a job, with files."""
        result, _ = await self._answer(
            query, size, representation, client, on_progress, is_promised=True
        )
        return await self.results.with_files(result)

    def _stored_query(self, spec: JobSpec, size: MeshSize, written: bytes) -> Query[Any]:
        """Return the query of a job, which an older release may have written."""
        try:
            kind = KINDS[spec.kind]
            request = kind.model.model_validate_json(written)
        except (KeyError, ValueError) as error:
            detail = "this release of the service cannot read the query of the job"
            raise problem("engine_unavailable", detail, hint="send the query again") from error
        return kind.ask(spec.mesh_id, size, request, self.settings)

    async def _answer(
        self,
        query: Query[Any],
        size: MeshSize,
        representation: Representation,
        client: str,
        on_progress: ProgressCallback,
        *,
        is_promised: bool = False,
    ) -> tuple[Result, PhaseSeconds]:
        with self.mesh_catalog.pinned(query.mesh_id):
            query.check_answer(representation, size, self.settings, as_job=is_promised)
            in_parts = isinstance(query, MatrixQuery) and query.is_in_parts(
                representation, size, self.settings, as_job=is_promised
            )
            key = result_key(query, representation)
            # In parts a sparse matrix has no limit of cells: it is another answer than in memory.
            name = result_name(query.mesh_id, f"{key}.parts" if in_parts else key)
            # Small work costs less than to look for what another service has computed.
            if self.database.is_shared and not query.is_small(size):
                await self.results.index(name)
            stored = await self.results.find(name)
            self.lookups["miss" if stored is None else "hit"] += 1
            if stored is not None:
                return stored, {}
            if isinstance(query, MatrixQuery) and in_parts:
                run = MatrixInParts(
                    query, size, representation, name, client, self.engine, self.results
                ).run
            else:
                work = RunQuery(query, representation, name)
                is_small = query.is_small(size)
                task = Task(work, client, query.affinity_keys, is_small, is_promised)
                run = partial(self.engine.run, task)
            start = partial(self._run, run, query.kind)
            done = await self._single_flight.join(name, start, on_progress)
            assert done.result is not None, "this kind of work answers"  # noqa: S101
            result = self.results.add(done.result, is_reusable=query.is_repeatable)
            return result, done.seconds

    async def _run(self, run: Run, kind: str, on_progress: ProgressCallback) -> TaskResult:
        done = await run(on_progress)
        self.solves[kind] += 1
        self.solve_seconds[kind] += done.seconds["compute"]
        return done

    @asynccontextmanager
    async def time_limit(self, seconds: float, setting: str = "deadline_s") -> AsyncIterator[None]:
        """Stop the block after ``seconds``, whose upper bound is a setting."""
        try:
            async with asyncio.timeout(seconds):
                yield
        except TimeoutError:
            is_ours = seconds >= getattr(self.settings, setting)
            detail = f"not finished within {seconds:g} s"
            raise problem(
                "deadline_exceeded",
                detail,
                limit=seconds,
                setting=variable_of(setting) if is_ours else None,
            ) from None


def _engine(settings: Settings, store: Store) -> Engine:
    if settings.engine == "ray":  # nothing else imports what several machines need
        from app.engine.distributed import DistributedEngine
        from app.engine.ray_cluster import RayCluster

        return DistributedEngine(RayCluster(), settings, store)
    from app.engine.local import LocalEngine

    engine = LocalEngine(settings, settings.folder / layout.RESULTS)
    return engine if store.supply is None else SuppliedEngine(engine, store.supply)


def _database_of(settings: Settings) -> Database:
    url = settings.state.get_secret_value() if settings.state else None
    return database_of(settings.folder / layout.JOB_DATABASE, url)
