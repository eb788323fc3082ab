"""Single flight: concurrent requests share a computation, which stops when nobody waits for it."""

import asyncio
from collections.abc import Callable

import pytest

from app.engine.interface import ProgressCallback
from app.service.single_flight import SingleFlight


class Work:
    """Work that ends when it is told to, and counts what becomes of it."""

    def __init__(self) -> None:
        self.begun = self.cancelled = 0
        self.told: ProgressCallback = print
        self.end: asyncio.Future[int] = asyncio.Future()

    async def __call__(self, told: ProgressCallback) -> int:
        self.begun += 1
        self.told = told
        told(0.0)
        try:
            return await self.end
        except asyncio.CancelledError:
            self.cancelled += 1
            raise


def nobody(_: float) -> None: ...


async def joined(
    flights: SingleFlight[int], work: Work, told: ProgressCallback = nobody
) -> "asyncio.Task[int]":
    task = asyncio.create_task(flights.join("name", work, told))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    return task


def run(test: Callable[[SingleFlight[int], Work], object]) -> None:
    async def main() -> None:
        flights: SingleFlight[int] = SingleFlight()
        await test(flights, Work())  # type: ignore[misc]
        await asyncio.sleep(0)
        assert "name" not in flights, "what is over is forgotten"

    asyncio.run(main())


def test_all_get_what_was_done_once() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(5)]
        assert "name" in flights
        work.end.set_result(7)

        assert await asyncio.gather(*waiting) == [7] * 5
        assert work.begun == 1

    run(test)


def test_who_leaves_does_not_stop_it_for_the_others() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        first, second = await joined(flights, work), await joined(flights, work)
        first.cancel()
        with pytest.raises(asyncio.CancelledError):
            await first
        assert work.cancelled == 0
        work.end.set_result(7)

        assert await second == 7

    run(test)


def test_it_stops_when_the_last_leaves() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(3)]
        for task in waiting:
            assert work.cancelled == 0
            task.cancel()
            await asyncio.wait({task})
        await asyncio.sleep(0)

        assert (work.begun, work.cancelled) == (1, 1)

    run(test)


def test_who_comes_after_the_last_has_left_begins_anew() -> None:
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


def test_each_has_a_deadline_of_its_own() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        patient = await joined(flights, work)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.01):
                await flights.join("name", work, nobody)
        work.end.set_result(7)

        assert await patient == 7
        assert (work.begun, work.cancelled) == (1, 0)

    run(test)


def test_a_failure_is_told_to_all_and_kept_for_nobody() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        waiting = [await joined(flights, work) for _ in range(2)]
        work.end.set_exception(ValueError("no"))
        assert [str(e) for e in await asyncio.gather(*waiting, return_exceptions=True)] == [
            "no"
        ] * 2

        again = Work()
        again.end.set_result(8)
        assert await flights.join("name", again, nobody) == 8

    run(test)


def test_all_are_told_how_far_it_is_also_who_comes_late() -> None:
    async def test(flights: SingleFlight[int], work: Work) -> None:
        early: list[float] = []
        late: list[float] = []
        await joined(flights, work, early.append)
        work.told(0.25)
        await joined(flights, work, late.append)
        work.told(0.5)
        work.end.set_result(7)
        await asyncio.sleep(0.01)

        assert early == [0.0, 0.25, 0.5]
        assert late == [0.25, 0.5]

    run(test)
