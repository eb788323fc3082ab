"""The lag of the event loop: how much later than asked for it wakes a coroutine."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from time import perf_counter

_PERIOD_S = 0.25


@asynccontextmanager
async def measuring_lag(observe: Callable[[float], None]) -> AsyncIterator[None]:
    """Give ``observe`` the seconds of lag, four times a second, inside the block."""

    async def measure() -> None:
        while True:
            due = perf_counter() + _PERIOD_S
            await asyncio.sleep(_PERIOD_S)
            observe(max(0.0, perf_counter() - due))  # the loop's clock ticks in milliseconds

    measuring = asyncio.create_task(measure())
    try:
        yield
    finally:
        measuring.cancel()
