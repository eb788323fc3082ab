"""The parts of a running service, put together, and what it does with meshes."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from gc import collect, freeze
from pathlib import Path

from app.engine.interface import Engine
from app.engine.supplied import SuppliedEngine
from app.engine.work import MeshInput
from app.jobs import JobManager, JobRepository, JobRunner, Retention
from app.queries import MeshSize
from app.repeating import repeat
from app.service.answering import Answering
from app.service.concurrency import ConcurrencyLimit
from app.service.mesh_storing import Manifest, MeshStoring, StoredMesh
from app.service.progress import ignore_progress
from app.service.query_jobs import QueryJobs
from app.service.request_context import RequestContext
from app.service.resources import share_arenas
from app.service.time_limit import time_limit
from app.settings import Settings
from app.state import Database
from app.store import layout
from app.store.choice import store_of
from app.store.fields import FieldStore
from app.store.mesh_catalog import MeshCatalog, MeshTables
from app.store.mesh_index import MeshIndex
from app.store.ownership import Share
from app.store.results import ResultStore
from app.store.scratch import Scratch
from app.store.store import Store

_CATALOG_PERIOD_S = 2.0
"""Seconds between two looks at what other services did to meshes, where they are shared"""

_JOBS_PERIOD_S = 5.0
"""Seconds between two looks at what others did to jobs, where another process runs them"""


class Service:
    """The parts of a running service, and the use cases that combine them."""

    def __init__(self, settings: Settings, *, runs_jobs: bool = False) -> None:
        self.settings = settings
        self.database = _database_of(settings)
        self._is_one_of_many = self.database.is_shared and settings.engine == "ray"
        self._runs_jobs = runs_jobs or not self._is_one_of_many
        self.store = store_of(settings)
        self.scratch = Scratch(settings.folder, settings.scratch_bytes)
        self.mesh_catalog = MeshCatalog(
            self.store.meshes,
            settings.store_bytes,
            evicts=settings.store_evict == "lru",
            shared=_mesh_records(self.database),
        )
        self.mesh_index = MeshIndex(self.store.meshes)
        self.results = ResultStore(
            self.store.results,
            settings.results_bytes,
            settings.results_memory_bytes,
            settings.quota_results_bytes,
        )
        self.fields = FieldStore(settings.folder, settings.fields_bytes)
        self.engine = _engine(settings, self.store)
        self.engine.on_unclaimed = self.results.index_unclaimed
        self.mesh_storing = MeshStoring(
            self.scratch, self.mesh_catalog, self.results, self.fields, self.engine
        )
        repository, ttl_s = JobRepository(self.database), settings.job_ttl
        retention = Retention(self.results, ttl_s)
        self.jobs = JobManager(repository, self.results, retention)
        self.answering = Answering(
            settings,
            self.mesh_catalog,
            self.results,
            self.engine,
            self.mesh_storing,
            is_shared=self.database.is_shared,
        )
        self.query_jobs = QueryJobs(
            settings, self.answering, self.jobs, self.mesh_catalog, self.results, self.size
        )
        self.job_runner = JobRunner(
            repository, self.results, retention, ttl_s, self.query_jobs.solve, self.jobs.notify
        )
        self.uploads = ConcurrencyLimit(
            settings.quota_uploads, "quota_exceeded", "uploads", "quota_uploads"
        )
        self.is_leaving = False
        """Whether the service is about to stop: it is not ready, whatever it still answers"""

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Own the store, supply workers and run jobs inside the block."""
        share_arenas()
        with self.owning_store() as share:
            self.scratch.prepare(is_alone=share.is_first)
            self.mesh_catalog.prepare()
            self.results.prepare()
            if share.is_first:
                self.fields.prepare(self.mesh_catalog.ids)
            async with self._using_database(share):
                await self.engine.start()
                # Objects of the start live for ever; each full collection over them takes 90 ms.
                collect()
                freeze()
                try:
                    async with self._running_jobs():
                        self.results.make_room()  # now it is known which are those of jobs
                        yield
                finally:
                    await self.engine.stop()

    @asynccontextmanager
    async def _running_jobs(self) -> AsyncIterator[None]:
        """Have jobs run inside the block: here, or by the one process of a cluster that does it."""
        try:
            if self._runs_jobs:
                self.jobs.runner = self.job_runner
                async with self.job_runner.running():
                    yield
            else:
                from app.service.ray_jobs import RemoteRunner

                service_of = partial(Service, runs_jobs=True)
                self.jobs.runner = RemoteRunner(service_of, self.settings)
                await self.jobs.keep_up()
                keeping_up = repeat(self.jobs.keep_up, _JOBS_PERIOD_S, "jobs not kept up")
                task = asyncio.create_task(keeping_up)
                try:
                    yield
                finally:
                    task.cancel()
                    await asyncio.wait({task})
        finally:
            self.jobs.end_events()

    @contextmanager
    def owning_store(self) -> Iterator[Share]:
        """Own the store inside the block, or share it with the other services of a cluster.

        Raises ``StoreError`` where the store is not usable, and ``StateError`` where the database
        is not.
        """
        with self.store.owned(is_shared=self._is_one_of_many) as share:
            self.database.prepare()
            self.store.claim(self.database.service)
            yield share

    @asynccontextmanager
    async def _using_database(self, share: Share) -> AsyncIterator[None]:
        """Use the database inside the block; keep the catalogue up with other services there."""
        following = None
        try:
            if self.database.is_shared:
                if share.is_first:
                    await self.mesh_catalog.reconcile()
                if self._is_one_of_many:
                    share.let_others_in()
                following = asyncio.create_task(
                    repeat(self.mesh_catalog.keep_up, _CATALOG_PERIOD_S, "catalogue not kept up")
                )
            yield
        finally:
            if following is not None:
                following.cancel()
                await asyncio.wait({following})
            await self.database.aclose()

    def announce_end(self) -> None:
        """Say that the service is not ready, so that no new clients are sent to it."""
        self.is_leaving = True

    def drain(self) -> None:
        """Prepare for the end: finish running work, and refuse new work."""
        self.announce_end()
        self.engine.drain()
        self.jobs.end_events()

    async def add_mesh(
        self, mesh_input: MeshInput, name: str | None, context: RequestContext
    ) -> StoredMesh:
        """Have a worker read or make a mesh, and store it under a name, if it has one."""
        client = context.caller.name
        async with time_limit(self.settings, context.deadline_s):
            return await self.mesh_storing.store(mesh_input, name, client, ignore_progress)

    async def manifest(self, mesh_id: str) -> Manifest:
        """Return the manifest of a mesh, and mark the mesh as used."""
        self.mesh_catalog.use(mesh_id)
        return await self.store.meshes.manifest(mesh_id)

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read, and mark the mesh as used."""
        self.mesh_catalog.use(mesh_id)
        return await self.store.meshes.array_file(mesh_id, name)

    async def size(self, mesh_id: str) -> MeshSize:
        """Return the counts of a mesh that checks need."""
        report = (await self.store.meshes.manifest(mesh_id))["report"]
        return MeshSize(report["vertices"], report["faces"], report["mean_edge_length"])

    async def delete_mesh(self, mesh_id: str) -> None:
        """Remove a mesh and its results; afterwards no service that shares the store has it."""
        await self.mesh_catalog.delete(mesh_id)
        await self.mesh_storing.forget(mesh_id)
        if self.database.is_shared:
            await asyncio.sleep(self.store.meshes.trusted_s)


def _engine(settings: Settings, store: Store) -> Engine:
    if settings.engine == "ray":  # nothing else imports what several machines need
        from app.engine.ray_cluster import set_variables

        set_variables()
        from app.engine.ray_engine import RayEngine

        return RayEngine(store)
    from app.engine.local import LocalEngine

    engine = LocalEngine(settings, settings.folder / layout.RESULTS)
    return engine if store.supply is None else SuppliedEngine(engine, store.supply)


def _mesh_records(database: Database) -> MeshTables | None:
    """Return the table of meshes that several services share, if there are several."""
    if not database.is_shared:
        return None
    from app.state.mesh_records import MeshRecords  # words of PostgreSQL, a tenth of a second

    return MeshRecords(database)


def _database_of(settings: Settings) -> Database:
    url = settings.state.get_secret_value() if settings.state else None
    return Database(settings.folder / layout.JOB_DATABASE, url)
