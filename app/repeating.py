"""Work in the background that is done again and again, whatever happens."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import NoReturn

import structlog

logger = structlog.get_logger(module=__name__)


async def repeat(do: Callable[[], Awaitable[object]], pause_s: float, failure: str) -> NoReturn:
    """Do something again and again, with a pause after each time; ``failure`` is logged.

    It ends when its task is cancelled, even if ``do`` lost that: `asyncio.wait_for`, which psycopg
    uses, does so in Python 3.11 where what it waits for happens at the same moment.
    """
    this = asyncio.current_task()
    assert this is not None, "a coroutine runs in a task"  # noqa: S101
    while True:
        try:
            await do()
        except OSError as error:  # such as a full disk, or a database that is away
            logger.warning(failure, error=repr(error))
        except Exception:
            logger.exception(failure)
        if this.cancelling():
            raise asyncio.CancelledError
        await asyncio.sleep(pause_s)
