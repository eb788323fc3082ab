"""Work that is done again and again."""

import asyncio

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
