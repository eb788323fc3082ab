"""What the routes ask for: meshes in the store, and answers to queries, computed or kept."""

import asyncio
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from gc import collect, freeze
from pathlib import Path
from typing import Any

from anyio import to_thread

from app.access import Caller
from app.encoding import Representation
from app.engine.interface import Engine, ProgressCallback
from app.engine.local import LocalEngine
from app.engine.work import EstimateQuery, MeshInput, RunQuery, StoreMesh, Task, TaskResult
from app.errors import ProblemError, problem
from app.jobs import Job, JobRepository, Jobs, JobSpec, require_whole
from app.queries import Estimate, MeshSize, Query, fingerprint, result_key
from app.service.single_flight import SingleFlight
from app.settings import Settings, variable_of
from app.store.fields import FieldStore
from app.store.layout import JOB_BOOK, RESULTS, owned
from app.store.mesh_catalog import MeshCatalog
from app.store.meshes import PUBLIC_ARRAYS, MeshStore
from app.store.results import Result, ResultStore, result_name

Seconds = Mapping[str, float]


@dataclass(frozen=True)
class RequestContext:
    """Who asks, and how long they would wait."""

    caller: Caller
    deadline_s: float
    request_id: str


@dataclass(frozen=True)
class Answered:
    """A result that is ready to be sent, and what it took."""

    result: Result
    seconds: Seconds


@dataclass(frozen=True)
class Added:
    """A mesh that is in the store, as clients see it, and what it took."""

    mesh: Mapping[str, Any]
    is_new: bool
    seconds: Seconds


class Service:
    """The parts of a running service, and what they do together."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        results = settings.store / RESULTS
        self.meshes = MeshStore(settings.store)
        self.mesh_books = MeshCatalog(
            settings.store,
            self.meshes,
            settings.store_bytes,
            evicts=settings.store_evict == "lru",
        )
        self.results = ResultStore(results, settings.results_bytes, settings.results_memory_bytes)
        self.fields = FieldStore(settings.store, settings.fields_bytes)
        self.engine: Engine = LocalEngine(settings, results)
        self._job_book = settings.store / JOB_BOOK
        self.jobs = Jobs(JobRepository(self._job_book), self.results, settings.job_ttl)
        self.lookups = {"hit": 0, "miss": 0}
        """Whether answers asked for were kept"""
        self.solves: Counter[str] = Counter()
        """By kind of query"""
        self.solve_seconds: defaultdict[str, float] = defaultdict(float)
        self._flights: SingleFlight[TaskResult] = SingleFlight()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Own the store, keep workers, and run jobs while inside."""
        with self.owning_store():
            self.mesh_books.prepare()
            self.results.prepare()
            self.fields.prepare(self.mesh_books.ids)
            await self.engine.start()
            # What is there by now stays. Looking through it for garbage takes 90 ms each time.
            collect()
            freeze()
            try:
                async with self.jobs.running():
                    yield
            finally:
                await self.engine.stop()

    @contextmanager
    def owning_store(self) -> Iterator[None]:
        """Own the store while inside; raises ``StoreError`` where it cannot be used as it is."""
        with owned(self.settings.store):
            require_whole(self._job_book)
            yield

    def drain(self) -> None:
        """Finish what runs, and refuse all else: the service is about to stop."""
        self.engine.drain()
        self.jobs.end_events()

    async def add_mesh(self, origin: MeshInput, asker: RequestContext) -> Added:
        """Have a worker read or make a mesh, and store it."""
        async with self.mesh_books.scratch_folder() as scratch, self.within(asker.deadline_s):
            order = Task(StoreMesh(origin, scratch / "mesh"), asker.caller.name)
            done = await self.engine.run(order, ignore_progress)
            assert done.mesh is not None, "this kind of work writes a mesh"  # noqa: S101
            kept = await self.mesh_books.keep(done.mesh)
        for mesh_id in kept.evicted:
            await self._forget(mesh_id)
        return Added(_described(done.mesh.manifest), kept.is_new, done.seconds)

    def describe(self, mesh_id: str) -> dict[str, Any]:
        """Return the report of a mesh, as clients see it."""
        self.mesh_books.use(mesh_id)
        return _described(self.meshes.manifest(mesh_id))

    def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read."""
        self.mesh_books.use(mesh_id)
        return self.meshes.array_file(mesh_id, name)

    def size(self, mesh_id: str) -> MeshSize:
        """Return how large a mesh is."""
        report = self.meshes.manifest(mesh_id)["report"]
        return MeshSize(report["vertices"], report["faces"], report["mean_edge_length"])

    async def list_meshes(self, limit: int, after: str) -> tuple[list[dict[str, Any]], str | None]:
        """Return the reports of ``limit`` meshes after an id, and where to go on, if anywhere."""
        return await to_thread.run_sync(self._list_meshes, limit, after)

    def _list_meshes(self, limit: int, after: str) -> tuple[list[dict[str, Any]], str | None]:
        ids, more = self.meshes.page(after, limit)
        described = []
        for mesh_id in ids:
            # Left out: what is deleted just now, or damaged, which it says when asked itself.
            with suppress(ProblemError):
                described.append(_described(self.meshes.manifest(mesh_id)))
        return described, ids[-1] if more else None

    async def delete_mesh(self, mesh_id: str, caller: Caller) -> None:
        """Remove a mesh and its results."""
        if not caller.may_delete(self.meshes.owner(mesh_id)):
            raise problem("forbidden", f"mesh {mesh_id} was stored with another API key")
        await self.mesh_books.delete(mesh_id)
        await self._forget(mesh_id)

    async def _forget(self, mesh_id: str) -> None:
        """Remove what was found on a mesh that is gone."""
        self.results.forget_mesh(mesh_id)
        await to_thread.run_sync(self.fields.forget_mesh, mesh_id)

    async def answer(
        self,
        query: Query[Any],
        size: MeshSize,
        form: Representation,
        asker: RequestContext,
        *,
        as_file: bool,
    ) -> Answered:
        """Answer ``query`` to a mesh of this ``size``: from a kept result, or by a worker."""
        async with self.within(asker.deadline_s):
            answered = await self._answer(query, size, form, asker.caller.name, ignore_progress)
            if as_file:
                return replace(answered, result=await self.results.with_files(answered.result))
            return answered

    async def estimate(
        self, query: Query[Any], size: MeshSize, form: Representation, asker: RequestContext
    ) -> tuple[Estimate, Seconds]:
        """Have a worker, which has the mesh, tell what the answer to ``query`` would take."""
        query.check_answer(form.media_type, size, self.settings)
        order = Task(
            EstimateQuery(query, form), asker.caller.name, query.affinity_keys, is_small=True
        )
        async with self.within(asker.deadline_s):
            with self.mesh_books.held(query.mesh_id):
                done = await self.engine.run(order, ignore_progress)
        assert done.estimate is not None, "this kind of work estimates"  # noqa: S101
        return done.estimate, done.seconds

    async def submit(
        self,
        query: Query[Any],
        size: MeshSize,
        form: Representation,
        asker: RequestContext,
        key: str | None,
    ) -> Job:
        """Accept a job that answers ``query``; one for all with the same idempotency ``key``."""
        query.check_answer(form.media_type, size, self.settings)
        self.engine.refuse_when_full(asker.caller.name)

        async def solve(told: ProgressCallback) -> Result:
            async with self.within(self.settings.job_deadline_s, "job_deadline_s"):
                return (await self._answer(query, size, form, asker.caller.name, told)).result

        errand = JobSpec(
            owner=asker.caller.owner,
            kind=query.kind,
            mesh_id=query.mesh_id,
            media_type=form.media_type,
            fingerprint=fingerprint(query, form),
            idempotency_key=key,
            request_id=asker.request_id,
        )
        return await self.jobs.submit(errand, solve)

    async def _answer(
        self,
        query: Query[Any],
        size: MeshSize,
        form: Representation,
        client: str,
        told: ProgressCallback,
    ) -> Answered:
        with self.mesh_books.held(query.mesh_id):
            query.check_answer(form.media_type, size, self.settings)
            name = result_name(query.mesh_id, result_key(query, form))
            kept = await self.results.find(name)
            self.lookups["miss" if kept is None else "hit"] += 1
            if kept is not None:
                return Answered(kept, {})
            work = RunQuery(query, form, name)
            order = Task(work, client, query.affinity_keys, query.is_small(size))
            done = await self._flights.join(name, partial(self._solve, order, query.kind), told)
            assert done.answer is not None, "this kind of work answers"  # noqa: S101
            result = self.results.take_new(name, done.answer, is_kept=query.is_repeatable)
            return Answered(result, done.seconds)

    async def _solve(self, order: Task, kind: str, told: ProgressCallback) -> TaskResult:
        done = await self.engine.run(order, told)
        self.solves[kind] += 1
        self.solve_seconds[kind] += done.seconds["compute"]
        return done

    @asynccontextmanager
    async def within(self, seconds: float, setting: str = "deadline_s") -> AsyncIterator[None]:
        """Stop what runs inside after so many seconds, which ``setting`` bounds."""
        try:
            async with asyncio.timeout(seconds):
                yield
        except TimeoutError:
            own = seconds >= getattr(self.settings, setting)
            detail = f"not finished within {seconds:g} s"
            raise problem(
                "deadline_exceeded",
                detail,
                limit=seconds,
                setting=variable_of(setting) if own else None,
            ) from None


def _described(manifest: Mapping[str, Any]) -> dict[str, Any]:
    mesh_id = manifest["id"]
    names = [name for name, kept in PUBLIC_ARRAYS.items() if kept in manifest["crc32"]]
    return {
        "id": mesh_id,
        **manifest["report"],
        "warnings": manifest["warnings"],
        "created": manifest["created"],
        "arrays": {name: f"/v1/meshes/{mesh_id}/arrays/{name}" for name in names},
    }


def ignore_progress(_share: float) -> None:
    """Tell nobody which share is done."""
