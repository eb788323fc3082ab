"""What the routes ask for: meshes in the store, and answers to queries, computed or kept."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Any

from anyio import to_thread

from app.callers import Caller
from app.engine import (
    Answering,
    Done,
    Engine,
    Estimating,
    LocalEngine,
    MeshFromFile,
    MeshFromSample,
    StoredMesh,
    Work,
)
from app.errors import ProblemError, refuse
from app.mesh_store import PUBLIC_ARRAYS, MeshStore
from app.queries import Estimate, MeshSize, Query, result_key
from app.result_store import Result, ResultStore, result_name
from app.settings import Settings, variable_of

Seconds = Mapping[str, float]


@dataclass(frozen=True)
class Answered:
    """A result that is ready to be sent, and what it took."""

    result: Result
    seconds: Seconds


class Service:
    """The parts of a running service, and what they do together."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        results = settings.store / "results"
        self.meshes = MeshStore(settings.store)
        self.results = ResultStore(results, settings.results_bytes)
        self.engine: Engine = LocalEngine(settings, results)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Sweep the store and keep workers while inside."""
        self.meshes.prepare()
        self.results.prepare()
        await self.engine.start()
        try:
            yield
        finally:
            await self.engine.stop()

    async def add_mesh(
        self, work: MeshFromFile | MeshFromSample, deadline_s: float
    ) -> tuple[StoredMesh, Seconds]:
        """Have a worker read or make a mesh and store it."""
        done = await self._run(work, deadline_s)
        assert done.mesh is not None, "this kind of work stores a mesh"  # noqa: S101
        return done.mesh, done.seconds

    def describe(self, mesh_id: str) -> dict[str, Any]:
        """Return the report of a mesh, as clients see it."""
        manifest = self.meshes.manifest(mesh_id)
        names = [name for name, kept in PUBLIC_ARRAYS.items() if kept in manifest["crc32"]]
        return {
            "id": mesh_id,
            **manifest["report"],
            "warnings": manifest["warnings"],
            "created": manifest["created"],
            "arrays": {name: f"/v1/meshes/{mesh_id}/arrays/{name}" for name in names},
        }

    def size(self, mesh_id: str) -> MeshSize:
        """Return how many vertices and faces a mesh has."""
        report = self.meshes.manifest(mesh_id)["report"]
        return MeshSize(report["vertices"], report["faces"])

    async def list_meshes(self, limit: int, after: str) -> tuple[list[dict[str, Any]], str | None]:
        """Return the reports of ``limit`` meshes after an id, and where to go on, if anywhere."""
        return await to_thread.run_sync(self._list_meshes, limit, after)

    def _list_meshes(self, limit: int, after: str) -> tuple[list[dict[str, Any]], str | None]:
        ids, more = self.meshes.page(after, limit)
        described = []
        for mesh_id in ids:
            # Left out: what is deleted just now, or damaged, which it says when asked itself.
            with suppress(ProblemError):
                described.append(self.describe(mesh_id))
        return described, ids[-1] if more else None

    async def delete_mesh(self, mesh_id: str, caller: Caller) -> None:
        """Remove a mesh and its results."""
        if not caller.may_delete(self.meshes.owner(mesh_id)):
            raise refuse("forbidden", f"mesh {mesh_id} was stored with another API key")
        await to_thread.run_sync(self.meshes.delete, mesh_id)
        self.results.forget_mesh(mesh_id)

    async def answer(self, query: Query[Any], media_type: str, deadline_s: float) -> Answered:
        """Answer ``query``: from a kept result, or by a worker."""
        query.refuse_answer(media_type, self.size(query.mesh_id), self.settings)
        name = result_name(query.mesh_id, result_key(query, media_type))
        kept = await self.results.find(name)
        if kept is not None:
            return Answered(kept, {})
        done = await self._run(Answering(query, media_type, name), deadline_s, query.mesh_id)
        result = self.results.take_new(name, is_kept=query.is_repeatable)
        return Answered(result, done.seconds)

    async def estimate(
        self, query: Query[Any], media_type: str, deadline_s: float
    ) -> tuple[Estimate, Seconds]:
        """Have a worker, which has the mesh, tell what the answer to ``query`` would take."""
        query.refuse_answer(media_type, self.size(query.mesh_id), self.settings)
        done = await self._run(Estimating(query, media_type), deadline_s, query.mesh_id)
        assert done.estimate is not None, "this kind of work estimates"  # noqa: S101
        return done.estimate, done.seconds

    async def _run(self, work: Work, deadline_s: float, mesh_id: str = "") -> Done:
        async with self.within(deadline_s):
            return await self.engine.run(work, mesh_id or None)

    @asynccontextmanager
    async def within(self, deadline_s: float) -> AsyncIterator[None]:
        """Stop what runs inside after ``deadline_s``, with ``deadline_exceeded``."""
        try:
            async with asyncio.timeout(deadline_s):
                yield
        except TimeoutError:
            own = deadline_s >= self.settings.deadline_s
            setting = variable_of("deadline_s") if own else None
            detail = f"not finished within {deadline_s:g} s"
            raise refuse("deadline_exceeded", detail, limit=deadline_s, setting=setting) from None
