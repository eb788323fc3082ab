"""Work that is done again and again."""

import asyncio
from contextlib import suppress

import pytest

from app.repeating import repeat
from tests.support import virtual_time
from tests.support.logs import Log


def test_work_goes_on_after_any_failure(log: Log) -> None:
    failures = [OSError("the disk is full"), ValueError("unheard of"), None, KeyError("again")]
    times = []

    async def fail() -> None:
        times.append(virtual_time.now())
        failure = failures[len(times) - 1]
        if failure is not None:
            raise failure

    async def main() -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(7.0):
                await repeat(fail, 2.0, "work not done")

    virtual_time.run(main())
    assert times == [0.0, 2.0, 4.0, 6.0]
    assert [(line["event"], line["log_level"]) for line in log] == [
        ("work not done", "warning"),
        ("work not done", "error"),
        ("work not done", "error"),
    ]


def test_work_ends_although_it_loses_its_cancellation() -> None:
    """As `asyncio.wait_for` does in Python 3.11, now and then."""
    times = []

    async def lose_it() -> None:
        times.append(virtual_time.now())
        with suppress(asyncio.CancelledError):
            await asyncio.sleep(60.0)

    async def main() -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(7.0):
                await repeat(lose_it, 2.0, "work not done")

    virtual_time.run(main())
    assert times == [0.0]
