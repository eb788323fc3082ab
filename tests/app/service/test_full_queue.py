"""Jobs on a service whose queue is full: what was accepted is done."""

import asyncio
from pathlib import Path

import pytest

from app.encoding import NPY
from app.engine.interface import ProgressCallback
from app.engine.work import Task, TaskResult
from app.errors import ProblemError, problem
from tests.support.direct_engine import DirectEngine
from tests.support.killed_jobs import CONTEXT, MESH, Store, end_of
from tests.support.service import store_mesh
from tests.support.waiting import LONG_S
from tests.support.workers import new_worker


class FullEngine(DirectEngine):
    """Takes only what was promised; it refuses the rest only when it may, as a host far away."""

    def __init__(self, folder: Path) -> None:
        super().__init__(new_worker(folder))
        self.asked, self.may_refuse = asyncio.Event(), asyncio.Event()

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        if task.is_promised:
            return await super().run(task, on_progress)
        self.asked.set()
        await self.may_refuse.wait()
        raise problem("queue_full", "no place")


def test_a_job_is_done_though_the_same_query_of_a_client_is_refused(tmp_path: Path) -> None:
    """The job joined it while it was on its way."""
    store = Store(tmp_path, store_mesh(tmp_path, MESH))
    query = store.query(NPY)

    async def main() -> None:
        async with asyncio.timeout(LONG_S), store.service() as (service, _):
            engine = service.answering.engine = FullEngine(tmp_path)
            answering = service.answering.answer(query, CONTEXT, as_file=False)
            asked = asyncio.create_task(answering)
            await engine.asked.wait()
            job_id = await store.submit(service, NPY)
            while service.answering.lookups["miss"] < 2:
                await asyncio.sleep(0)
            engine.may_refuse.set()
            with pytest.raises(ProblemError) as refused:
                await asked
            assert refused.value.problem.code == "queue_full"
            assert (await end_of(service, job_id)).status == "successful"

    asyncio.run(main())
