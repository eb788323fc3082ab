"""Matrices that are larger than memory: parts that all workers compute, joined to one result.

The parts are results as well. So a job that is begun again, after a stop or by another service,
finds those that are whole.
"""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial

from app.engine.interface import Engine, ProgressCallback
from app.engine.work import ComputePart, JoinParts, Task, TaskResult
from app.engine.worker import REACHED
from app.queries import MatrixQuery
from app.store.results import Result, ResultStore

NotePart = Callable[[int, float], None]
"""Receives the number of a part, and the share of it that is done"""

_JOINING = 0.03
"""Share of the time that it takes to join the parts, about"""


@dataclass(eq=False)
class MatrixInParts:
    """The computation of one matrix."""

    query: MatrixQuery
    client: str
    """The name of the caller, whose work the engine counts together"""
    result_name: str
    engine: Engine
    results: ResultStore
    _seconds: float = 0.0
    _found: dict[int, Result] = field(default_factory=dict)

    async def run(self, on_progress: ProgressCallback) -> TaskResult:
        """Compute all parts, as many at a time as there are workers, and join them.

        Raises ``ProblemError`` where the store has no room, and as ``Engine.run`` does.
        """
        query = self.query
        areas = query.areas_of_parts()
        shares = [0.0] * len(areas)
        whole = sum(areas) / (1.0 - _JOINING)

        def note(part: int, share: float) -> None:
            shares[part] = share
            done = sum(area * share for area, share in zip(areas, shares, strict=True))
            on_progress(done / whole)

        needed = query.bytes_in_parts()
        with self.results.reserving(self.client, needed) as reserve, self._using_parts():
            await self._compute(len(areas), note, reserve)
            found = [self._found[part] for part in range(len(areas))]
            reached = sum(map(_reached, found))
            names = [part.name for part in found]
            work = JoinParts(query, names, reached, self.result_name)
            done = await self.engine.run(self._task(work), lambda _share: None)
            seconds = {**done.seconds, "compute": self._seconds + done.seconds["compute"]}
        for part in found:
            self.results.discard(part.name)
        return replace(done, seconds=seconds)

    @contextmanager
    def _using_parts(self) -> Iterator[None]:
        """Release the parts that were found or computed at the end of the block."""
        try:
            yield
        finally:
            for part in self._found.values():
                self.results.release(part)

    async def _compute(self, count: int, note: NotePart, reserve: Callable[[int], None]) -> None:
        todo = iter(range(count))
        running: set[asyncio.Task[Result]] = set()
        try:
            while True:
                while len(running) < self._at_once and (part := next(todo, None)) is not None:
                    running.add(asyncio.create_task(self._find_or_compute(part, note)))
                if not running:
                    return
                done, running = await asyncio.wait(running, return_when=asyncio.FIRST_COMPLETED)
                for each in done:
                    found = each.result()
                    size, reached = found.manifest.size, _reached(found)
                    reserve(self.query.bytes_of_part(size, reached))
        finally:
            for each in running:
                each.cancel()
            await asyncio.gather(*running, return_exceptions=True)

    @property
    def _at_once(self) -> int:
        """Parts under way at the same time: hosts may join and leave."""
        load = self.engine.load
        return max(1, load.idle + load.busy + load.missing)

    async def _find_or_compute(self, part: int, note: NotePart) -> Result:
        name = f"{self.result_name}-{part}"
        await self.results.index(name)  # another service may have computed it
        result = await self.results.find(name)
        if result is None:
            work = ComputePart(self.query, part, name)
            done = await self.engine.run(self._task(work), partial(note, part))
            assert done.result is not None, "this kind of work answers"  # noqa: S101
            self._seconds += done.seconds["compute"]
            result = await self.results.with_files(self.results.add(done.result))
        self._found[part] = result
        note(part, 1.0)
        return result

    def _task(self, work: ComputePart | JoinParts) -> Task:
        return Task(work, self.client, self.query.affinity_keys, is_promised=True)


def _reached(part: Result) -> int:
    """Return the number of finite distances of the matrix that come from a part."""
    return int(part.manifest.headers[REACHED])
