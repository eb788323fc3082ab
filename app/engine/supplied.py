"""An engine whose workers see a folder, though meshes and answers are elsewhere."""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from app.engine.interface import Engine, Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.work import (
    JoinParts,
    MeshFromCut,
    MeshFromFile,
    StoreMesh,
    Task,
    TaskResult,
    WritesResult,
)
from app.errors import ProblemError, StoreUnavailableError
from app.store.results import Result
from app.store.store import Supply


class SuppliedEngine:
    """Has what a task needs brought to the folder before ``engine`` does it; see ``Engine``.

    What the task has written is sent before it counts as done. If it was cancelled too late,
    its result is removed, or reported as unclaimed where it was being sent by then.
    """

    def __init__(self, engine: Engine, supply: Supply) -> None:
        self._engine = engine
        self._supply = supply
        self._users: Counter[str] = Counter()
        """Blocks that need the files of a result in the folder, see `_using`"""
        self._unclaimed: set[asyncio.Task[None]] = set()
        """Results that are still being sent, although their tasks were cancelled"""
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed
        engine.on_unclaimed = self._remove_unused

    @property
    def on_wait(self) -> Callable[[float], None]:
        """See ``Engine``."""
        return self._engine.on_wait

    @on_wait.setter
    def on_wait(self, call: Callable[[float], None]) -> None:
        self._engine.on_wait = call

    @property
    def on_work(self) -> Callable[[str, float], None]:
        """See ``Engine``."""
        return self._engine.on_work

    @on_work.setter
    def on_work(self, call: Callable[[str, float], None]) -> None:
        self._engine.on_work = call

    @property
    def load(self) -> Load:
        """See ``Engine``."""
        return self._engine.load

    @property
    def is_ready(self) -> bool:
        """See ``Engine``."""
        return self._engine.is_ready

    @property
    def is_draining(self) -> bool:
        """See ``Engine``."""
        return self._engine.is_draining

    async def start(self) -> None:
        """See ``Engine``."""
        await self._engine.start()

    def drain(self) -> None:
        """See ``Engine``."""
        self._engine.drain()

    async def stop(self) -> None:
        """See ``Engine``."""
        await self._engine.stop()

    def refuse_when_full(self, client: str) -> None:
        """See ``Engine``."""
        self._engine.refuse_when_full(client)

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Do the work of a task, see ``Engine``."""
        if isinstance(task.work, StoreMesh):
            return await self._store(task, task.work, on_progress)
        with self._using(task.work.result_name):
            done = await self._compute(task, task.work, on_progress)
            if done.result is not None and done.result.has_files:
                await self._send(done.result)
        return done

    @contextmanager
    def _using(self, name: str) -> Iterator[None]:
        """Leave the files of a result in the folder inside the block; the last block removes them.

        A task that was cancelled may still write or send them while the next one begins.
        """
        self._users[name] += 1
        try:
            yield
        finally:
            self._users[name] -= 1
            if not self._users[name]:
                del self._users[name]
                self._supply.discard_result(name)

    async def _remove_unused(self, name: str) -> None:
        with self._using(name):
            pass

    async def _compute(
        self, task: Task, work: WritesResult, on_progress: ProgressCallback
    ) -> TaskResult:
        parts = work.parts if isinstance(work, JoinParts) else ()
        async with self._supply.bringing_results(parts):
            return await self._run_on_mesh(work.query.mesh_id, task, on_progress)

    async def _run_on_mesh(
        self, mesh_id: str, task: Task, on_progress: ProgressCallback
    ) -> TaskResult:
        """Have a task done with a mesh in the folder."""
        async with self._supply.holding(mesh_id):
            try:
                return await self._engine.run(task, on_progress)
            except ProblemError as error:
                if error.problem.code == "mesh_damaged":
                    await self._supply.drop_copy(mesh_id)
                raise

    async def _send(self, result: Result) -> None:
        """Send a result; a call that is cancelled leaves that to the background."""
        sending = asyncio.create_task(self._send_whole(result))
        try:
            await asyncio.shield(sending)
        except asyncio.CancelledError:
            reporting = asyncio.create_task(self._report(sending, result.name))
            self._unclaimed.add(reporting)
            reporting.add_done_callback(self._unclaimed.discard)
            raise

    async def _send_whole(self, result: Result) -> None:
        with self._using(result.name):
            await self._supply.send_result(result)

    async def _report(self, sending: "asyncio.Task[None]", name: str) -> None:
        """Report a result as unclaimed once it is sent."""
        with suppress(StoreUnavailableError):
            await sending
            await self.on_unclaimed(name)

    async def _store(
        self, task: Task, work: StoreMesh, on_progress: ProgressCallback
    ) -> TaskResult:
        given = work.mesh_input
        file = given.path if isinstance(given, MeshFromFile) else None
        old = given.query.mesh_id if isinstance(given, MeshFromCut) else None
        async with self._supply.bringing(file, work.folder):
            while True:
                if old is None:
                    done = await self._engine.run(task, on_progress)
                else:
                    done = await self._run_on_mesh(old, task, on_progress)
                assert done.mesh is not None, "this kind of work writes a mesh"  # noqa: S101
                if await self._supply.send_mesh(done.mesh):
                    return done
