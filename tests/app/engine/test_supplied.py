"""The engine of a machine whose results are objects: nothing stays in its folder, all counts."""

import asyncio
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import anyio
import pytest
from obstore.store import MemoryStore

from app.encoding import NPY
from app.engine.interface import ProgressCallback
from app.engine.supplied import SuppliedEngine
from app.engine.work import RunQuery, Task, TaskResult
from app.errors import StoreUnavailableError
from app.service.progress import ignore_progress
from app.store.bucket import Bucket
from app.store.bucket_store import BucketStore
from app.store.layout import RESULTS, TEMPORARY
from app.store.meshes import MeshStore
from app.store.results import ResultFiles, ResultStore
from geodesic_core import samples
from tests.support.direct_engine import DirectEngine
from tests.support.waiting import wait_until
from tests.support.workers import distances_query, new_worker, numbers, run_query


@dataclass
class Machine:
    """A machine with a worker, and the service there."""

    folder: Path
    engine: SuppliedEngine
    inner: DirectEngine
    results: ResultStore
    work: RunQuery

    def ask(self, on_progress: ProgressCallback = ignore_progress) -> "asyncio.Task[TaskResult]":
        return asyncio.create_task(self.engine.run(Task(self.work, "alice"), on_progress))

    async def end_for_nobody(self) -> None:
        """Do the work of a task that was cancelled, too late to stop it."""
        assert self.inner._worker.do(next(numbers), self.work) is not None
        await self.inner.on_unclaimed(self.work.result_name)

    def files(self) -> list[Path]:
        return list((self.folder / RESULTS).glob("*/*"))


@asynccontextmanager
async def machine_at(folder: Path) -> AsyncIterator[Machine]:
    store = BucketStore(Bucket(MemoryStore()), folder, 10**9, "memory")
    with store.owned():
        written = MeshStore(folder).write_aside(samples.plane(50_000), folder / TEMPORARY / "mesh")
        assert await store.send_mesh(written)
        await store.meshes.put(written)
        work = run_query(distances_query(written.mesh_id), NPY)
        inner = DirectEngine(new_worker(folder))
        results = ResultStore(store.results, 10**9, memory=0)
        engine = SuppliedEngine(inner, store)
        engine.on_unclaimed = results.index_unclaimed
        yield Machine(folder, engine, inner, results, work)


@pytest.fixture
def play(tmp_path: Path) -> Callable[[Callable[[Machine], Awaitable[None]]], None]:
    """A function that runs a scene on a machine."""

    def run(scene: Callable[[Machine], Awaitable[None]]) -> None:
        async def main() -> None:
            async with machine_at(tmp_path) as machine:
                await scene(machine)
                assert not machine.files()

        asyncio.run(main())

    return run


Play = Callable[[Callable[[Machine], Awaitable[None]]], None]


def test_a_result_is_sent(play: Play) -> None:
    async def scene(machine: Machine) -> None:
        done = await machine.ask()
        assert done.result is not None
        assert await machine.results._files.size(done.result.name) == done.result.manifest.size

    play(scene)


@pytest.mark.slow
def test_a_result_that_comes_too_late_is_removed(play: Play) -> None:
    async def scene(machine: Machine) -> None:
        await machine.end_for_nobody()
        assert machine.results.nbytes == 0

    play(scene)


@pytest.mark.slow
def test_a_result_that_comes_too_late_is_left_to_a_task_that_writes_the_same(play: Play) -> None:
    async def scene(machine: Machine) -> None:
        begun, go_on = asyncio.Event(), asyncio.Event()
        machine.inner.before_work = go_on.wait  # type: ignore[assignment]
        asking = machine.ask(lambda _share: begun.set())
        await begun.wait()
        await machine.end_for_nobody()
        assert machine.files()
        go_on.set()
        await asking

    play(scene)


@pytest.mark.slow
def test_a_result_counts_where_its_request_ends_while_it_is_sent(
    play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    writes: list[threading.Event] = []
    write = Bucket.write

    def write_slowly(*arguments: Any) -> None:
        writes.append(may_go_on := threading.Event())
        may_go_on.wait()
        write(*arguments)

    async def until(condition: Callable[[], object]) -> None:
        await anyio.to_thread.run_sync(wait_until, condition)

    async def scene(machine: Machine) -> None:
        monkeypatch.setattr(Bucket, "write", write_slowly)
        first = machine.ask()
        await until(lambda: len(writes) == 1)
        first.cancel()
        again = machine.ask()
        await until(lambda: len(writes) == 2)
        assert first.cancelled()

        writes[0].set()
        await until(lambda: machine.results.nbytes > 0)
        writes[1].set()
        assert (await again).result is not None

    play(scene)


@pytest.mark.slow
def test_a_result_that_cannot_be_sent_is_removed(
    play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail(*_: object) -> None:
        raise StoreUnavailableError("away")

    async def scene(machine: Machine) -> None:
        monkeypatch.setattr(ResultFiles, "write", fail)
        with pytest.raises(StoreUnavailableError):
            await machine.ask()

    play(scene)
