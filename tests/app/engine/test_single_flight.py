"""Single flight: concurrent requests share a computation, which stops when nobody waits for it."""

import asyncio
from collections.abc import Callable

import pytest

from app.engine.interface import ProgressCallback
from app.engine.single_flight import SingleFlight
from app.errors import ProblemError, problem
from app.service.progress import ignore_progress


class Work:
    """A computation that ends when ``end`` does; it counts how often it began and was cancelled."""

    def __init__(self) -> None:
        self.begun = self.cancelled = 0
        self.report: ProgressCallback = ignore_progress
        self.end: asyncio.Future[int] = asyncio.Future()

    async def __call__(self, on_progress: ProgressCallback) -> int:
        self.begun += 1
        self.report = on_progress
        on_progress(0.0)
        try:
            return await self.end
        except asyncio.CancelledError:
            self.cancelled += 1
            raise


async def joined(
    flights: SingleFlight[int], work: Work, on_progress: ProgressCallback = ignore_progress
) -> "asyncio.Task[int]":
    task = asyncio.create_task(flights.join("name", work, on_progress))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    return task


def run(test: Callable[[SingleFlight[int], Work], object]) -> None:
    async def main() -> None:
        flights: SingleFlight[int] = SingleFlight()
        await test(flights, Work())  # type: ignore[misc]
        await asyncio.sleep(0)
        assert "name" not in flights.names(), "what is over is forgotten"

    asyncio.run(main())


def test_all_calls_share_one_computation() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(5)]
        assert "name" in flights.names()
        work.end.set_result(7)

        assert await asyncio.gather(*waiting) == [7] * 5
        assert work.begun == 1

    run(test)


def test_a_promised_call_outlives_the_refusal_of_one_without_a_promise() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        first = await joined(flights, work)
        again = Work()
        promised = [
            asyncio.create_task(flights.join("name", again, ignore_progress, is_promised=True))
            for _ in range(2)
        ]
        other = await joined(flights, work)
        work.end.set_exception(problem("queue_full", "no place"))
        for each in (first, other):
            with pytest.raises(ProblemError, match="no place"):
                await each
        again.end.set_result(8)

        assert await asyncio.gather(*promised) == [8, 8]
        assert (work.begun, again.begun) == (1, 1)

    run(test)


def test_a_call_that_is_cancelled_leaves_the_computation_to_the_others() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        first, second = await joined(flights, work), await joined(flights, work)
        first.cancel()
        with pytest.raises(asyncio.CancelledError):
            await first
        assert work.cancelled == 0
        work.end.set_result(7)

        assert await second == 7

    run(test)


def test_a_computation_is_cancelled_with_the_last_call() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(3)]
        for task in waiting:
            assert work.cancelled == 0
            task.cancel()
            await asyncio.wait({task})
        await asyncio.sleep(0)

        assert (work.begun, work.cancelled) == (1, 1)

    run(test)


def test_a_call_after_the_last_was_cancelled_begins_anew() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        first = await joined(flights, work)
        first.cancel()
        await asyncio.wait({first})
        again = Work()
        second = await joined(flights, again)
        again.end.set_result(8)

        assert await second == 8
        assert (work.cancelled, again.begun) == (1, 1)

    run(test)


def test_each_call_has_a_deadline_of_its_own() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        patient = await joined(flights, work)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.01):
                await flights.join("name", work, ignore_progress)
        work.end.set_result(7)

        assert await patient == 7
        assert (work.begun, work.cancelled) == (1, 0)

    run(test)


def test_a_failure_reaches_all_calls_and_is_forgotten() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(2)]
        work.end.set_exception(ValueError("no"))
        failures = await asyncio.gather(*waiting, return_exceptions=True)
        assert [str(failure) for failure in failures] == ["no", "no"]

        again = Work()
        again.end.set_result(8)
        assert await flights.join("name", again, ignore_progress) == 8

    run(test)


def test_progress_is_reported_to_each_call_also_to_late_ones() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        early: list[float] = []
        late: list[float] = []
        first = await joined(flights, work, early.append)
        work.report(0.25)
        second = await joined(flights, work, late.append)
        work.report(0.5)
        work.end.set_result(7)
        await asyncio.gather(first, second)

        assert early == [0.0, 0.25, 0.5]
        assert late == [0.25, 0.5]

    run(test)
