"""An engine whose workers see a folder, though meshes and answers are elsewhere."""

from collections.abc import Callable

from app.engine.interface import Engine, Load, ProgressCallback
from app.engine.work import JoinParts, MeshFromFile, StoreMesh, Task, TaskResult
from app.errors import ProblemError
from app.store.interface import Supply


class SuppliedEngine:
    """Has what a task needs brought to the folder before ``engine`` does it; see ``Engine``.

    What the task has written is sent before it counts as done.
    """

    def __init__(self, engine: Engine, supply: Supply) -> None:
        self._engine = engine
        self._supply = supply

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
        mesh_id = task.work.query.mesh_id
        parts = task.work.parts if isinstance(task.work, JoinParts) else ()
        async with self._supply.holding(mesh_id), self._supply.bringing_results(parts):
            try:
                done = await self._engine.run(task, on_progress)
            except ProblemError as error:
                if error.problem.code == "mesh_damaged":
                    await self._supply.distrust(mesh_id)
                raise
        if done.result is not None and done.result.has_files:
            await self._supply.send_result(done.result)
        return done

    async def _store(
        self, task: Task, work: StoreMesh, on_progress: ProgressCallback
    ) -> TaskResult:
        given = work.mesh_input
        file = given.path if isinstance(given, MeshFromFile) else None
        async with self._supply.bringing(file, work.folder):
            while True:
                done = await self._engine.run(task, on_progress)
                assert done.mesh is not None, "this kind of work writes a mesh"  # noqa: S101
                if await self._supply.send_mesh(done.mesh):
                    return done
